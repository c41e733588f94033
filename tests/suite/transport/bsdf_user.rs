//! A user's BSDF, added by one shader file and one entry, held to the same tests as the built-in ones.

use std::f64::consts::PI;

use glam::DVec3;
use stereolux::gpu::ShaderLibrary;
use stereolux::images::{Image, ImageRgb, read_image};
use stereolux::scene::{Material, Needs, Scene};
use stereolux::settings::{Eyes, Method, RenderSettings, Reuse};

use super::block_statistics::{BlockStatistics, z_test};
use super::bsdf_probe::{BsdfProbe, BsdfQuery, NONE, at_angle, wide};
use super::bsdf_twin::{Dice, tolerance};
use super::chi_square::{Sampled, p_value, sidak};
use super::lights_sampling::mean_and_error;
use super::support::{
    Folder, adapter_name, assert_clean, assert_says, context, images_of, renderer_by, settings,
    start_views,
};
use super::user_bsdf_example as example;
use crate::suite::embedded_scenes::cornell::WHITE;

fn library() -> ShaderLibrary {
    example::library().unwrap()
}

const REFLECTANCE: [f32; 3] = [0.9, 0.5, 0.2];

fn clay(spread_rad: f32) -> Material {
    example::clay(spread_rad, REFLECTANCE)
}

/// Rough clay, smooth clay, and what smooth clay is.
fn rough_smooth_and_plain() -> [Material; 3] {
    let plain = Material::lambert("plain", [0.9, 0.5, 0.2]);
    [clay(0.5), clay(0.0), plain]
}

#[test]
fn a_users_bsdf_samples_as_its_density_says() {
    let context = context();
    let materials = rough_smooth_and_plain();
    let level = sidak(0.01, 6);
    for on in [&["user_bsdf"][..], &["user_bsdf", "glossy", "dielectric"]] {
        let probe = BsdfProbe::new(&context, &library(), on, &materials);
        for degrees in [0.0, 45.0, 85.0] {
            let query = BsdfQuery::from(at_angle(degrees, 0.1), 0, 0);
            let draw = |count: u32, seed: u32| -> Vec<(f64, f64)> {
                let samples = probe.samples(query, count, seed);
                assert!(samples.iter().all(|s| s.flags & NONE == 0));
                let directions = samples.iter().map(|s| wide(s.wi));
                directions.map(|wi| (wi.z, wi.y.atan2(wi.x))).collect()
            };
            let (points, pilot) = (draw(200_000, 1), draw(20_000, 2));
            let sampled = Sampled::on_sphere(&points, points.len(), &pilot, &[0.0]);
            let p = p_value(&sampled, &|z, _| z.max(0.0) / PI);
            assert!(p > level, "{degrees} degrees: p = {p:e}");
        }
    }
}

#[test]
fn a_users_bsdf_is_reciprocal_and_lambert_without_roughness() {
    let context = context();
    let materials = rough_smooth_and_plain();
    let probe = BsdfProbe::new(&context, &library(), &["user_bsdf"], &materials);
    let mut dice = Dice::new(31);
    for _ in 0..50 {
        let (wo, wi) = (dice.direction(false), dice.direction(false));
        let ask = |wo, wi, material| {
            wide(probe.evaluate(&[BsdfQuery::pair(wo, material, wi, 0)])[0].value)
        };
        let (there, back) = (ask(wo, wi, 0), ask(wi, wo, 0));
        assert!((there - back).length() <= 1e-5 * there.length());
        let (smooth, plain) = (ask(wo, wi, 1), ask(wo, wi, 2));
        assert!((smooth - plain).length() <= 1e-6 * plain.length());
        // The user's model is called.
        assert!((there - plain).length() > 1e-3 * plain.length());
    }
}

/// A and B of the model for a spread of slopes, radians.
fn coefficients(spread_rad: f64) -> (f64, f64) {
    let squared = spread_rad * spread_rad;
    let a = 1.0 - 0.5 * squared / (squared + 0.33);
    (a, 0.45 * squared / (squared + 0.09))
}

/// Oren and Nayar 1994, section 4.4, eq. 30, by its angles; over the reflectance.
fn twin(spread_rad: f64, wo: DVec3, wi: DVec3) -> f64 {
    let (a, b) = coefficients(spread_rad);
    let angle = |v: DVec3| v.z.min(1.0).acos();
    let (alpha, beta) = (angle(wo).max(angle(wi)), angle(wo).min(angle(wi)));
    let turn = wi.y.atan2(wi.x) - wo.y.atan2(wo.x);
    (a + b * turn.cos().max(0.0) * alpha.sin() * beta.tan()) / PI
}

/// What a white surface returns of light from all around, towards the angle `o` from the normal. The integral of
/// max(0, cos phi) is 2; sin^2 and sin^2 cos remain on the two sides of `o`.
fn returned(spread_rad: f64, o: f64) -> f64 {
    let (a, b) = coefficients(spread_rad);
    let below = o.sin() * (0.5 * o - 0.25 * (2.0 * o).sin());
    let beyond = o.tan() * (1.0 - o.sin().powi(3)) / 3.0;
    a + 2.0 * b / PI * (below + beyond)
}

#[test]
fn the_examples_shader_is_oren_and_nayars_model() {
    let context = context();
    let spreads = [0.0_f32, 0.1, 0.3, 0.6, 1.0];
    let materials = spreads.map(clay);
    let probe = BsdfProbe::new(&context, &library(), &["user_bsdf"], &materials);
    let mut dice = Dice::new(32);
    let random = |index: usize| {
        let wo = dice.direction(false);
        BsdfQuery::pair(wo, index % 5, dice.direction(false), 0)
    };
    let queries: Vec<BsdfQuery> = (0..1000).map(random).collect();
    let mut other_roughness = 0;
    for (query, answer) in queries.iter().zip(probe.evaluate(&queries)) {
        let (wo, wi) = (wide(query.wo).normalize(), wide(query.wi).normalize());
        let value = |spread: f32, channel: usize| {
            move |wo: DVec3, wi: DVec3| {
                f64::from(REFLECTANCE[channel]) * twin(f64::from(spread), wo, wi)
            }
        };
        for channel in 0..3 {
            let model = value(spreads[query.material as usize], channel);
            let error = (f64::from(answer.value[channel]) - model(wo, wi)).abs();
            let allowed = tolerance(&model, wo, wi);
            assert!(error <= allowed, "{error:e} of {allowed:e}: {query:?}");
        }
        // Negative control: a tenth of a radian more is another model.
        let other = value(spreads[query.material as usize] + 0.1, 0);
        let error = (f64::from(answer.value[0]) - other(wo, wi)).abs();
        other_roughness += usize::from(error > tolerance(&other, wo, wi));
    }
    assert!(other_roughness > 900, "{other_roughness}");
}

#[test]
fn a_furnace_of_clay_returns_what_the_model_says() {
    let context = context();
    let spreads = [0.0_f32, 0.2, 0.6, 1.0];
    let materials = spreads.map(clay);
    let probe = BsdfProbe::new(&context, &library(), &["user_bsdf"], &materials);
    for (material, spread) in spreads.iter().enumerate() {
        for degrees in [0.0, 45.0, 85.0, 89.99] {
            let query = BsdfQuery::from(at_angle(degrees, 0.3), material, 0);
            let samples = probe.samples(query, 65_536, 3);
            let (mean, error) = mean_and_error(samples.iter().map(|s| f64::from(s.value[0])));
            let due =
                f64::from(REFLECTANCE[0]) * returned(f64::from(*spread), degrees.to_radians());
            let off = (mean - due).abs();
            let what = format!("spread {spread}, {degrees} degrees: {mean} +- {error}");
            assert!(off <= 4.0 * error + 1e-6, "{what} for {due}");
        }
    }
    // The model is a fit: white and slightly rough, it returns up to 1.6 % more than arrives, at grazing angles.
    let most = (1..100).map(|i| returned(0.01 * f64::from(i), 89.99_f64.to_radians()));
    let most = most.fold(0.0, f64::max);
    assert!((1.014..1.016).contains(&most), "{most}");
}

/// Two walls and a block of it, in a box of otherwise plain Lambert surfaces.
const PAINTED: [&str; 3] = ["left wall", "back wall", "short block"];

/// Frames of one renderer: independent, because random streams are keyed by the frame and photons are traced anew.
fn renders(scene: &Scene, count: u32, change: impl FnOnce(&mut RenderSettings)) -> Vec<ImageRgb> {
    const SIZE: u32 = 24;
    let settings = settings(|s| {
        s.reuse = Reuse::Off;
        s.path.max_depth = 3;
        s.photon.max_depth = 3;
        s.photon.every_frame = true;
        change(s);
    });
    let size = [SIZE, SIZE];
    let mut renderer = renderer_by(&library(), scene, &settings, Eyes::Left, size).unwrap();
    let views = start_views(scene, 19.65);
    let images = images_of(&mut renderer, &views, 0..count).into_iter();
    let image = |pixels| Image::new(SIZE, SIZE, pixels).unwrap();
    images.map(image).collect()
}

#[test]
fn paths_and_photons_agree_on_a_users_bsdf() {
    const RENDERS: u32 = 16;
    const SIGNIFICANCE: f64 = 1e-3;
    // The photon method's own error. Direct light is next-event estimation in both. A disc of radius r at a distance
    // d < r from an edge loses the share (acos x - x sqrt(1 - x^2)) / pi of its light, x = d / r, which is 2 / (3 pi) on
    // average over that strip: of a block's indirect light 0.212 r L / A is lost, with edges of length L on both sides
    // in an area A. A block of 8 pixels shows 0.2 m x 0.2 m or more and at most eight times its width of edges, so L / A
    // is 40 per metre: 4 % of the indirect light at 5 mm, which is less than half of all light there: 2 %. The limit on |z| is 4,
    // so an allowance of 0.5 % in its denominator forgives that.
    const ALLOWANCE: f64 = 0.005;
    let scene = example::cornell_with(&PAINTED, &example::clay(1.0, WHITE)).unwrap();
    let statistics = |renders: &[ImageRgb]| BlockStatistics::of_renders(renders, 8);
    let path = |s: &mut RenderSettings| {
        s.method = Method::Path;
        s.spp = 8;
    };
    let paths = statistics(&renders(&scene, RENDERS, path));
    let photons = statistics(&renders(&scene, RENDERS, |s| {
        s.method = Method::Photon;
        s.spp = 4;
        s.photon.count = 65_536;
        s.photon.radius_m = 0.005;
    }));
    let test = z_test(&paths, &photons, SIGNIFICANCE, ALLOWANCE);
    eprintln!("clay, paths against photons: {test:?}");
    assert_eq!(test.rejected, 0, "{test:?}");
    // Negative control: Lambert in its place is another picture, in most blocks.
    let plain = example::cornell_with(&PAINTED, &Material::lambert("plain", WHITE)).unwrap();
    let plain = statistics(&renders(&plain, 4, path));
    let control = z_test(&plain, &photons, SIGNIFICANCE, ALLOWANCE);
    assert!(control.rejected > control.tests / 4, "{control:?}");
}

#[test]
fn a_users_bsdf_brings_its_own_code_alone() {
    let needs = Needs::of(&example::cornell_with(&PAINTED, &clay(0.6)).unwrap());
    assert_eq!(needs.bsdfs, ["lambert", "user"]);
    assert!(!needs.glossy && !needs.dielectric && !needs.caustics);
    assert_eq!(needs.not_lambert, ["clay"; 3], "one for each mesh");
    // Without the entry its surfaces would be black; that is an error, which says what to do.
    let features = super::trace_probe::features(&["user_bsdf", "from_list"]);
    let compiled = ShaderLibrary::embedded().compile("passes/path_trace", &features);
    let error = compiled.err().unwrap().to_string();
    assert!(error.contains("install_user_bsdfs"), "{error}");
    library().compile("passes/path_trace", &features).unwrap();
    // Nor may a number lie beyond the entries.
    let beyond = Material {
        user_bsdf: 2,
        ..clay(0.6)
    };
    let scene = example::cornell_with(&PAINTED, &beyond).unwrap();
    let made = renderer_by(&library(), &scene, &settings(|_| {}), Eyes::Both, [8, 8]);
    let error = made.err().unwrap().to_string();
    assert_says(&error, &["number 2", "holds 1"]);
    // A mesh that is not there is named.
    let error = example::cornell_with(&["sofa"], &clay(0.6)).unwrap_err();
    assert!(error.to_string().contains("sofa"), "{error}");
}

#[test]
fn the_example_writes_its_pictures() {
    let folder = Folder::new("user-bsdf");
    example::compare(&folder.join("out"), Some(adapter_name()), 24, 4).unwrap();
    assert_eq!(
        folder.files(),
        ["out/clay.exr", "out/plain.exr", "out/plain_and_clay.png"]
    );
    let [plain, clay] =
        ["plain", "clay"].map(|name| read_image(&folder.join(&format!("out/{name}.exr"))).unwrap());
    assert_clean(&clay.pixels, "clay");
    assert_eq!([clay.width, clay.height], [24, 24]);
    // The blocks are other ones, and with them what they reflect elsewhere.
    let pairs = plain.pixels.iter().zip(&clay.pixels);
    assert!(pairs.filter(|(a, b)| a != b).count() > 50);
}
