//! BSDF sampling against its density: chi-square at normal, 45 and 85 degrees.

use glam::DVec3;
use stereolux::gpu::GpuContext;
use stereolux::scene::Material;

use super::bsdf_probe::{BACK, BsdfProbe, BsdfQuery, DELTA, NONE, at_angle, wide};
use super::bsdf_twin::{Twin, direction};
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

/// The same glass as a thin wall.
pub fn pane(glass: Material) -> Material {
    Material {
        is_open: true,
        ..glass
    }
}

fn coordinates(wi: DVec3) -> (f64, f64) {
    (wi.z.clamp(-1.0, 1.0), wi.y.atan2(wi.x))
}

/// p-value of the shader's samples under the twin's density for another material perhaps.
fn test_against(
    probe: &BsdfProbe<'_>,
    index: usize,
    twin: &Twin,
    degrees: f64,
    flags: u32,
    is_delta_share: bool,
) -> f64 {
    let wo = at_angle(degrees, 0.7);
    let query = BsdfQuery::from(wo, index, flags);
    let directions = |count: u32, seed: u32| -> Vec<(f64, f64)> {
        let samples = probe.samples(query, count, seed).into_iter();
        let directions = samples.filter(|sample| sample.flags & (NONE | DELTA) == 0);
        directions
            .map(|sample| coordinates(wide(sample.wi).normalize()))
            .collect()
    };
    let points = directions(DRAWS, 1);
    let pilot = directions(PILOT, 2);
    assert!(!points.is_empty() || is_delta_share);
    let wo = wide(wo).normalize();
    let density = |z: f64, phi: f64| twin.pdf(wo, direction(z, phi));
    p_value(
        &Sampled::on_sphere(&points, DRAWS as usize, &pilot, &[0.0]),
        &density,
    )
}

fn glossy_probe<'a>(context: &'a GpuContext, materials: &[Material]) -> BsdfProbe<'a> {
    BsdfProbe::embedded(context, &["glossy", "dielectric", "thin_walls"], materials)
}

fn cases() -> Vec<(&'static str, Material, u32)> {
    let [mut half_metal, mut half_glass] = [metal(0.4), glass(0.4)];
    half_metal.metallic = 0.5;
    half_glass.transmission = 0.5;
    let [mut everything, mut strong_index] = [glass(0.6), glass(0.4)];
    (everything.transmission, everything.metallic) = (0.5, 0.3);
    strong_index.ior = 2.4;
    let mut cases = vec![
        ("lambert", Material::lambert("lambert", [0.8, 0.5, 0.2]), 0),
        ("smooth coat over a base", coated(0.0), 0),
        ("half metal", half_metal, 0),
        ("half glass", half_glass, 0),
        ("everything", everything, 0),
        ("strong index", strong_index, BACK),
    ];
    for roughness in [0.15, 0.3, 0.6, 1.0] {
        cases.push(("metal", metal(roughness), 0));
        cases.push(("coat", coated(roughness), 0));
        cases.push(("glass from outside", glass(roughness), 0));
        cases.push(("glass from inside", glass(roughness), BACK));
        cases.push(("pane", pane(glass(roughness)), BACK));
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
            let p = test_against(&probe, index, &twin, degrees, *flags, false);
            let what = format!(
                "{name}, roughness {}, {degrees} degrees",
                material.roughness
            );
            assert!(p > level, "{what}: p = {p:e} < {level:e}");
        }
    }
}

#[test]
fn a_wrong_density_fails() {
    let context = context();
    let lambert = Material::lambert("lambert", [0.5; 3]);
    let materials = [metal(0.3), glass(0.3), lambert, coated(0.3)];
    let [mut bent, mut grey] = [glass(0.3), coated(0.3)];
    bent.ior = 1.52;
    grey.base_color = [0.3, 0.3, 0.3, 1.0];
    let wrong = [metal(0.31), bent, coated(1.0), grey];
    let probe = glossy_probe(&context, &materials);
    for (index, other) in wrong.iter().enumerate() {
        let p = test_against(&probe, index, &Twin::new(other, 0), 45.0, 0, false);
        assert!(p < 1e-6, "case {index}: p = {p:e} for a wrong density");
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
            let query = BsdfQuery::from(at_angle(degrees, -2.0), index, *flags);
            let samples = probe.samples(query, 2000, 3);
            let asked = samples.iter().map(|sample| BsdfQuery {
                wi: sample.wi,
                ..query
            });
            let answers = probe.evaluate(&asked.collect::<Vec<_>>());
            for (sample, answer) in samples.iter().zip(answers) {
                let is_finite = sample.value.iter().all(|v| v.is_finite());
                assert!(is_finite && sample.pdf.is_finite(), "{name}: {sample:?}");
                if sample.flags & (NONE | DELTA) != 0 {
                    continue;
                }
                let cosine = f64::from(sample.wi[2].abs());
                for channel in 0..3 {
                    let due = f64::from(answer.value[channel]) * cosine / f64::from(answer.pdf);
                    // Same code on the same numbers: only the compiler's choice of fused operations differs.
                    let error = (f64::from(sample.value[channel]) - due).abs();
                    let what = format!("{name}, {degrees} degrees: {sample:?}");
                    assert!(error <= 1e-4 * due.max(1e-3), "{what}, {due} is due");
                }
            }
        }
    }
}
