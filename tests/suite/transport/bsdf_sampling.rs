//! BSDF sampling against its density: chi-square at normal, 45 and 85 degrees.

use std::f64::consts::PI;

use glam::DVec3;
use stereolux::gpu::{GpuContext, ShaderLibrary};
use stereolux::scene::Material;

use super::bsdf_probe::{BACK, BsdfProbe, BsdfQuery, DELTA, NONE, at_angle, wide};
use super::bsdf_twin::Twin;
use super::chi_square::{Sampled, p_value, sidak};
use super::support::context;

const DRAWS: u32 = 200_000;
const PILOT: u32 = 40_000;
/// Chance that a right sampler fails anywhere in one test function.
const LEVEL: f64 = 0.01;

pub fn metal(roughness: f32) -> Material {
    Material {
        base_color: [0.9, 0.6, 0.3, 1.0],
        roughness,
        ..Material::default()
    }
}

pub fn coated(roughness: f32) -> Material {
    Material {
        metallic: 0.0,
        ..metal(roughness)
    }
}

pub fn glass(roughness: f32) -> Material {
    Material {
        metallic: 0.0,
        transmission: 1.0,
        base_color: [0.9, 1.0, 0.8, 1.0],
        roughness,
        ..Material::default()
    }
}

fn coordinates(wi: DVec3) -> (f64, f64) {
    (wi.z.clamp(-1.0, 1.0), wi.y.atan2(wi.x))
}

/// p-value of the shader's samples under the twin's density for another material perhaps.
fn test_against(
    probe: &BsdfProbe<'_>,
    index: u32,
    twin: &Twin,
    degrees: f64,
    flags: u32,
    is_delta_share: bool,
) -> f64 {
    let wo = at_angle(degrees, 0.7);
    let query = BsdfQuery {
        wo,
        material: index,
        wi: [0.0; 3],
        flags,
    };
    let directions = |count: u32, seed: u32| -> Vec<(f64, f64)> {
        probe
            .samples(query, count, seed)
            .iter()
            .filter(|sample| sample.flags & (NONE | DELTA) == 0)
            .map(|sample| coordinates(wide(sample.wi).normalize()))
            .collect()
    };
    let points = directions(DRAWS, 1);
    let pilot = directions(PILOT, 2);
    assert!(!points.is_empty() || is_delta_share);
    let wo = wide(wo).normalize();
    let density = |z: f64, phi: f64| {
        let r = (1.0 - z * z).max(0.0).sqrt();
        twin.pdf(wo, DVec3::new(r * phi.cos(), r * phi.sin(), z))
    };
    let sampled = Sampled {
        points: &points,
        draws: DRAWS as usize,
        pilot: &pilot,
        domain: [(-1.0, 1.0), (-PI, PI)],
        breaks: &[0.0],
    };
    p_value(&sampled, &density)
}

fn glossy_probe<'a>(context: &'a GpuContext, materials: &[Material]) -> BsdfProbe<'a> {
    let on = ["glossy", "dielectric"];
    BsdfProbe::new(context, &ShaderLibrary::embedded(), &on, materials)
}

fn cases() -> Vec<(&'static str, Material, u32)> {
    let mut cases = vec![
        ("lambert", Material::lambert("lambert", [0.8, 0.5, 0.2]), 0),
        ("smooth coat over a base", coated(0.0), 0),
        (
            "half metal",
            Material {
                metallic: 0.5,
                ..metal(0.4)
            },
            0,
        ),
        (
            "half glass",
            Material {
                transmission: 0.5,
                ..glass(0.4)
            },
            0,
        ),
        (
            "everything",
            Material {
                transmission: 0.5,
                metallic: 0.3,
                ..glass(0.6)
            },
            0,
        ),
        (
            "strong index",
            Material {
                ior: 2.4,
                ..glass(0.4)
            },
            BACK,
        ),
    ];
    for roughness in [0.15, 0.3, 0.6, 1.0] {
        cases.push(("metal", metal(roughness), 0));
        cases.push(("coat", coated(roughness), 0));
        cases.push(("glass from outside", glass(roughness), 0));
        cases.push(("glass from inside", glass(roughness), BACK));
    }
    cases
}

#[test]
fn samples_follow_the_density() {
    let context = context();
    let cases = cases();
    let materials: Vec<Material> = cases.iter().map(|case| case.1.clone()).collect();
    let probe = glossy_probe(&context, &materials);
    let angles = [0.0, 45.0, 85.0];
    let level = sidak(LEVEL, cases.len() * angles.len());
    for (index, (name, material, flags)) in cases.iter().enumerate() {
        for degrees in angles {
            let twin = Twin::new(material, *flags);
            let p = test_against(&probe, index as u32, &twin, degrees, *flags, false);
            assert!(
                p > level,
                "{name}, roughness {}, {degrees} degrees: p = {p:e} < {level:e}",
                material.roughness
            );
        }
    }
}

#[test]
fn a_wrong_density_fails() {
    let context = context();
    let materials = [
        metal(0.3),
        glass(0.3),
        Material::lambert("lambert", [0.5; 3]),
        coated(0.3),
    ];
    let wrong = [
        Material {
            roughness: 0.31,
            ..metal(0.3)
        },
        Material {
            ior: 1.52,
            ..glass(0.3)
        },
        coated(1.0),
        Material {
            base_color: [0.3, 0.3, 0.3, 1.0],
            ..coated(0.3)
        },
    ];
    let probe = glossy_probe(&context, &materials);
    for (index, other) in wrong.iter().enumerate() {
        let p = test_against(&probe, index as u32, &Twin::new(other, 0), 45.0, 0, false);
        assert!(
            p < 1e-6,
            "case {index}: p = {p:e} for a density that is wrong"
        );
    }
}

#[test]
fn samples_carry_the_density_and_the_weight_that_eval_and_pdf_give() {
    let context = context();
    let cases = cases();
    let materials: Vec<Material> = cases.iter().map(|case| case.1.clone()).collect();
    let probe = glossy_probe(&context, &materials);
    for (index, (name, _, flags)) in cases.iter().enumerate() {
        for degrees in [0.0, 60.0, 89.0, 89.99] {
            let query = BsdfQuery {
                wo: at_angle(degrees, -2.0),
                material: index as u32,
                wi: [0.0; 3],
                flags: *flags,
            };
            let samples = probe.samples(query, 2000, 3);
            let queries: Vec<BsdfQuery> = samples
                .iter()
                .map(|sample| BsdfQuery {
                    wi: sample.wi,
                    ..query
                })
                .collect();
            for (sample, answer) in samples.iter().zip(probe.evaluate(&queries)) {
                assert!(
                    sample.value.iter().all(|v| v.is_finite()) && sample.pdf.is_finite(),
                    "{name}: {sample:?}"
                );
                if sample.flags & (NONE | DELTA) != 0 {
                    continue;
                }
                let cosine = f64::from(sample.wi[2].abs());
                for channel in 0..3 {
                    let due = f64::from(answer.value[channel]) * cosine / f64::from(answer.pdf);
                    // Same code on the same numbers: only the compiler's choice of fused operations differs.
                    let error = (f64::from(sample.value[channel]) - due).abs();
                    assert!(
                        error <= 1e-4 * due.max(1e-3),
                        "{name}, {degrees} degrees: {sample:?} but {due} is due"
                    );
                }
            }
        }
    }
}
