//! The dielectric layer at the ends of its factors: index of refraction 1 and 0, and a black specular colour.
//!
//! KHR_materials_specular: F0 = min(((n - 1) / (n + 1))^2 colour, 1) strength and F90 = strength, so only strength 0
//! makes an ideal Lambert surface. KHR_materials_ior, "Specular-Glossiness Backwards Compatibility Mode": with n = 0 the
//! index counts as infinite and the Fresnel term is 1 from everywhere.

use std::f64::consts::PI;

use glam::{DQuat, DVec3};
use stereolux::scene::{Material, Needs, Scene};
use stereolux::settings::{Force, Method, Reuse};

use super::bsdf_probe::{BACK, BsdfProbe, BsdfQuery, DELTA, NONE, TRANSMITTED, at_angle, wide};
use super::bsdf_twin::{Dice, tolerance};
use super::hard_support::{add, constant_environment, eyes_at, images, quad, square_ahead};
use super::support::{bits, context, mean, method};

const BASE: [f32; 3] = [0.8, 0.5, 0.2];

fn plastic(ior: f32, specular: f32, specular_color: [f32; 3]) -> Material {
    Material {
        ior,
        specular,
        specular_color,
        roughness: 0.6,
        ..Material::lambert("plastic", BASE)
    }
}

/// A wall of the material under a white sky.
fn wall(material: &Material) -> Scene {
    let mut scene = Scene::default();
    add(&mut scene, &square_ahead(4.0, 1.0), material.clone());
    scene.environment = Some(constant_environment([1.0; 3]));
    scene
}

#[test]
fn only_specular_strength_zero_is_lambert() {
    let cases = [
        (plastic(1.5, 0.0, [1.0; 3]), true),
        (plastic(0.0, 0.0, [1.0; 3]), true),
        (plastic(1.0, 0.0, [0.0; 3]), true),
        (plastic(1.0, 1.0, [1.0; 3]), false),
        (plastic(1.5, 1.0, [0.0; 3]), false),
        (plastic(1.0, 0.01, [0.0; 3]), false),
        (plastic(0.0, 1.0, [0.0; 3]), false),
    ];
    for (material, lambert) in &cases {
        assert_eq!(material.is_lambert(), *lambert, "{material:?}");
        let needs = Needs::of(&wall(material));
        let kind = if *lambert { "lambert" } else { "glossy" };
        assert_eq!(needs.bsdfs, [kind], "{material:?}");
        assert_eq!(needs.glossy, !lambert, "{material:?}");
        assert_eq!(needs.not_lambert.is_empty(), *lambert, "{material:?}");
        // What `info` prints as left out, with its reason.
        let left_out = needs.left_out.iter().any(|left| left.feature == "glossy");
        assert_eq!(left_out, *lambert, "{material:?}");
    }
    // What shows as a full mirror focuses light as metal does.
    let caustics = |ior, roughness| {
        let mut material = plastic(ior, 1.0, [1.0; 3]);
        material.roughness = roughness;
        let mut scene = wall(&material);
        let floor = quad(DVec3::new(-4.0, -4.0, 4.0), DVec3::X * 8.0, DVec3::Z * -8.0);
        add(&mut scene, &floor, Material::lambert("floor", [0.5; 3]));
        Needs::of(&scene).caustics
    };
    assert!(caustics(0.0, 0.1));
    assert!(!caustics(0.0, 0.6) && !caustics(1.5, 0.1));
}

/// D and V of GGX from their textbook form (Walter et al. 2007, eq. 33; Heitz 2014, eq. 99), times each other.
fn microfacets(wo: DVec3, wi: DVec3, alpha: f64) -> f64 {
    let h = (wo + wi).normalize();
    let tan2 = |v: DVec3| (1.0 - v.z * v.z) / (v.z * v.z);
    let bracket = 1.0 + tan2(h) / (alpha * alpha);
    let d = 1.0 / (PI * alpha * alpha * h.z.powi(4) * bracket * bracket);
    let lambda = |v: DVec3| 0.5 * ((1.0 + alpha * alpha * tan2(v)).sqrt() - 1.0);
    d / ((1.0 + lambda(wo) + lambda(wi)) * 4.0 * wo.z * wi.z)
}

#[test]
fn values_at_the_ends_are_the_extensions() {
    // F at v.h = c for each, with w = (1 - c)^5.
    type Fresnel = fn(f64) -> [f64; 3];
    let cases: [(Material, Fresnel); 5] = [
        (plastic(1.0, 1.0, [1.0; 3]), |w| [w; 3]),
        (plastic(1.5, 1.0, [0.0; 3]), |w| [w; 3]),
        (plastic(1.0, 0.5, [1.0; 3]), |w| [0.5 * w; 3]),
        (plastic(0.0, 1.0, [1.0; 3]), |_| [1.0; 3]),
        // What a specular-glossiness material becomes: F0 is the specular colour.
        (plastic(0.0, 1.0, [0.5, 0.25, 0.125]), |w| {
            [0.5, 0.25, 0.125].map(|f0| f0 + (1.0 - f0) * w)
        }),
    ];
    let context = context();
    let materials: Vec<Material> = cases.iter().map(|(material, _)| material.clone()).collect();
    let probe = BsdfProbe::embedded(&context, &["glossy"], &materials);
    let mut dice = Dice::new(11);
    let mut most_beside_lambert = [0.0_f64; 5];
    for (index, (material, fresnel)) in cases.iter().enumerate() {
        // Random pairs, and one at grazing incidence: 89 degrees to either side.
        let mut pairs = vec![(at_angle(89.0, 0.0), at_angle(89.0, PI))];
        pairs.extend((0..400).map(|_| (dice.direction(false), dice.direction(false))));
        let query = |(wo, wi)| BsdfQuery::pair(wo, index, wi, 0);
        let queries: Vec<BsdfQuery> = pairs.into_iter().map(query).collect();
        for (query, answer) in queries.iter().zip(probe.evaluate(&queries)) {
            let (wo, wi) = (wide(query.wo).normalize(), wide(query.wi).normalize());
            for channel in 0..3 {
                let base = f64::from(BASE[channel]) / PI;
                let value = |wo: DVec3, wi: DVec3| {
                    let f = fresnel((1.0 - wo.dot((wo + wi).normalize())).powi(5));
                    let lost = f[0].max(f[1]).max(f[2]);
                    let layer = microfacets(wo, wi, f64::from(material.roughness).powi(2));
                    base * (1.0 - lost) + f[channel] * layer
                };
                let due = value(wo, wi);
                let found = f64::from(answer.value[channel]);
                let off = (found - due).abs();
                let what = format!("{found} for {due}: {query:?} of {material:?}");
                assert!(off <= tolerance(&value, wo, wi), "{what}");
                let beside = (due - base).abs() / base;
                most_beside_lambert[index] = most_beside_lambert[index].max(beside);
            }
        }
    }
    // Negative control: as Lambert, which the first three were once taken for, each would be far off.
    let are_far = most_beside_lambert.iter().all(|&off| off > 0.5);
    assert!(are_far, "{most_beside_lambert:?}");
}

#[test]
fn glass_of_infinite_index_is_a_mirror_from_both_sides() {
    let mirror = Material {
        transmission: 1.0,
        roughness: 0.0,
        ..plastic(0.0, 1.0, [1.0; 3])
    };
    let context = context();
    let probe = BsdfProbe::embedded(&context, &["glossy", "dielectric"], &[mirror]);
    for flags in [0, BACK] {
        for degrees in [0.0, 45.0, 85.0] {
            let wo = at_angle(degrees, 0.4);
            let query = BsdfQuery::from(wo, 0, flags);
            for sample in probe.samples(query, 2000, 2) {
                let kind = sample.flags & (DELTA | NONE | TRANSMITTED);
                assert_eq!(kind, DELTA, "{degrees} degrees: {sample:?}");
                assert_eq!(sample.wi, [-wo[0], -wo[1], wo[2]]);
                // The share that passes is 2 / (n cos) = 2e-7 at 85 degrees with the packed n of 1e8: rarely drawn.
                assert!(sample.value.iter().all(|w| (w - 1.0).abs() < 1e-6));
            }
        }
    }
}

#[test]
fn an_index_of_one_renders_as_with_the_layer_forced_on() {
    let scene = wall(&plastic(1.0, 1.0, [1.0; 3]));
    // The wall nearly edge on.
    let turn = DQuat::from_rotation_y(1.2);
    let views = eyes_at(DVec3::NEG_Z * 0.7, turn, 20.0);
    let render = |scene: &Scene, force| {
        let mut settings = method(Method::Path, Reuse::Off);
        settings.spp = 16;
        settings.path.max_depth = 2;
        settings.force.glossy = force;
        let [left, _] = images(scene, &settings, [16, 16], &views);
        left
    };
    let automatic = render(&scene, Force::Auto);
    assert!(bits(&automatic) == bits(&render(&scene, Force::On)));
    // Negative control: without the layer it is another picture. The base reflects 0.5 on average; a layer with
    // F90 = 1 seen at 70 degrees and beyond adds a tenth at least.
    let lambert = render(&scene, Force::Off);
    let (with, without) = (mean(&automatic), mean(&lambert));
    assert!(with > 1.05 * without, "{with} with, {without} without");
}
