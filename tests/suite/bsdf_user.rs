//! A user's BSDF, added by one shader file and one entry, held to the same tests as the built-in ones.

use std::f64::consts::PI;

use glam::DVec3;
use stereolux::gpu::ShaderLibrary;
use stereolux::gpu::scene::{UserBsdf, install_user_bsdfs};
use stereolux::scene::Material;

use super::bsdf_probe::{BsdfProbe, BsdfQuery, NONE, at_angle, wide};
use super::bsdf_twin::Dice;
use super::chi_square::{Sampled, p_value, sidak};
use super::support::context;

fn library() -> ShaderLibrary {
    let mut library = ShaderLibrary::embedded();
    let entry = UserBsdf {
        name: "oren_nayar".to_owned(),
        source: include_str!("bsdf_oren_nayar.wesl").to_owned(),
    };
    install_user_bsdfs(&mut library, &[entry]).unwrap();
    library
}

fn clay(roughness: f32) -> Material {
    Material {
        user_bsdf: 1,
        roughness,
        ..Material::lambert("clay", [0.9, 0.5, 0.2])
    }
}

#[test]
fn a_users_bsdf_samples_as_its_density_says() {
    let context = context();
    let materials = [
        clay(0.5),
        clay(0.0),
        Material::lambert("plain", [0.9, 0.5, 0.2]),
    ];
    let level = sidak(0.01, 6);
    for on in [
        &[UserBsdf::FEATURE][..],
        &[UserBsdf::FEATURE, "glossy", "dielectric"],
    ] {
        let probe = BsdfProbe::new(&context, &library(), on, &materials);
        for degrees in [0.0, 45.0, 85.0] {
            let query = BsdfQuery {
                wo: at_angle(degrees, 0.1),
                material: 0,
                wi: [0.0; 3],
                flags: 0,
            };
            let draw = |count: u32, seed: u32| -> Vec<(f64, f64)> {
                let samples = probe.samples(query, count, seed);
                assert!(samples.iter().all(|s| s.flags & NONE == 0));
                samples
                    .iter()
                    .map(|s| (wide(s.wi).z, f64::from(s.wi[1]).atan2(f64::from(s.wi[0]))))
                    .collect()
            };
            let (points, pilot) = (draw(200_000, 1), draw(20_000, 2));
            let sampled = Sampled {
                points: &points,
                draws: points.len(),
                pilot: &pilot,
                domain: [(-1.0, 1.0), (-PI, PI)],
                breaks: &[0.0],
            };
            let p = p_value(&sampled, &|z, _| z.max(0.0) / PI);
            assert!(p > level, "{degrees} degrees: p = {p:e}");
            let energy: f64 = probe
                .samples(query, 65_536, 3)
                .iter()
                .map(|s| f64::from(s.value[0]))
                .sum::<f64>()
                / 65_536.0;
            assert!(energy < 1.0, "{degrees} degrees: {energy}");
        }
    }
}

#[test]
fn a_users_bsdf_is_reciprocal_and_lambert_without_roughness() {
    let context = context();
    let materials = [
        clay(0.5),
        clay(0.0),
        Material::lambert("plain", [0.9, 0.5, 0.2]),
    ];
    let probe = BsdfProbe::new(&context, &library(), &[UserBsdf::FEATURE], &materials);
    let mut dice = Dice::new(31);
    for _ in 0..50 {
        let (wo, wi) = (dice.direction(false), dice.direction(false));
        let ask = |wo, wi, material| {
            probe.evaluate(&[BsdfQuery {
                wo,
                material,
                wi,
                flags: 0,
            }])[0]
                .value
        };
        let (there, back) = (
            DVec3::from(ask(wo, wi, 0).map(f64::from)),
            DVec3::from(ask(wi, wo, 0).map(f64::from)),
        );
        assert!((there - back).length() <= 1e-5 * there.length());
        let (smooth, plain) = (
            DVec3::from(ask(wo, wi, 1).map(f64::from)),
            DVec3::from(ask(wo, wi, 2).map(f64::from)),
        );
        assert!((smooth - plain).length() <= 1e-6 * plain.length());
        assert!(
            (there - plain).length() > 1e-3 * plain.length(),
            "the user's model is not called"
        );
    }
}
