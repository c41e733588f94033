//! What makes pictures converge faster: scrambled Sobol points, and photon maps whose radius shrinks.

use stereolux::images::Image;
use stereolux::metrics::{FlipView, compare};
use stereolux::renderer::{Eye, progressive_radius_m};
use stereolux::settings::{Method, RenderSettings, Reuse, Sampler};

use crate::suite::support::{builtin, mean, radiance, rendered, settings, start_views};

const SIZE: u32 = 24;

fn image(change: impl FnOnce(&mut RenderSettings)) -> Image<[f32; 3]> {
    let settings = settings(|s| {
        s.reuse = Reuse::Off;
        s.path.max_depth = 4;
        s.photon.max_depth = 4;
        change(s);
    });
    let scene = builtin("cornell");
    let renderer = rendered(&scene, &settings, [SIZE, SIZE], &start_views(&scene, 21.0));
    Image::new(SIZE, SIZE, radiance(&renderer, Eye::Left)).unwrap()
}

fn path(spp: u32, sampler: Sampler, seed: u32) -> Image<[f32; 3]> {
    image(|s| {
        s.method = Method::Path;
        s.spp = spp;
        s.seed = seed;
        s.path.sampler = sampler;
    })
}

/// Relative MSE, mean relative bias, and the bias's own spread: rms error / sqrt(pixels), over the mean.
fn error(found: &Image<[f32; 3]>, reference: &Image<[f32; 3]>) -> (f64, f64, f64) {
    let view = FlipView {
        exposure: 1.0,
        pixels_per_degree: 67.0,
    };
    let comparison = compare(found, reference, None, view).unwrap();
    let pixels = f64::from(SIZE * SIZE);
    let mean = mean(&reference.pixels);
    (
        comparison.rel_mse.unwrap(),
        comparison.mean_rel_bias.unwrap(),
        comparison.rmse / mean / pixels.sqrt(),
    )
}

#[test]
fn sobol_points_converge_to_the_same_picture_with_less_error() {
    let reference = path(512, Sampler::Sobol, 77);
    // Medians over seeds: one pixel at the lamp's edge can outweigh a whole picture's error.
    let median = |sampler| {
        let mut errors: Vec<(f64, f64, f64)> = (1..=5)
            .map(|seed| error(&path(64, sampler, seed), &reference))
            .collect();
        errors.sort_by(|a, b| a.0.total_cmp(&b.0));
        errors[2]
    };
    let (random, random_bias, random_spread) = median(Sampler::Random);
    let (sobol, sobol_bias, sobol_spread) = median(Sampler::Sobol);
    // Measured: about 0.5. At 0.8 the claim would no longer be worth a setting.
    assert!(sobol < 0.8 * random, "relMSE {sobol}, random {random}");
    for (bias, spread) in [(random_bias, random_spread), (sobol_bias, sobol_spread)] {
        assert!(bias.abs() < 5.0 * spread, "bias {bias}, spread {spread}");
    }
    // Negative control: a picture a quarter too bright is further off than that.
    let mut brighter = path(64, Sampler::Sobol, 1);
    for channel in brighter.pixels.iter_mut().flatten() {
        *channel *= 1.25;
    }
    assert!(error(&brighter, &reference).1 > 5.0 * sobol_spread);
}

#[test]
fn progressive_photons_lose_the_bias_that_a_fixed_radius_keeps() {
    let reference = path(512, Sampler::Sobol, 78);
    // A radius so large that the fixed estimate's bias shows: 6 cm in a box of 55 cm.
    let photons = |spp: u32, progressive: bool| {
        image(|s| {
            s.spp = spp;
            s.photon.count = 4096;
            s.photon.radius_m = 0.06;
            s.photon.progressive = progressive;
        })
    };
    let (fixed, ..) = error(&photons(64, false), &reference);
    let (few, ..) = error(&photons(8, true), &reference);
    let (many, ..) = error(&photons(64, true), &reference);
    let what = format!("relMSE {few} at 8, {many} at 64, {fixed} with a fixed radius");
    assert!(many < few && many < 0.75 * fixed, "{what}");
}

#[test]
fn the_progressive_radius_follows_its_law() {
    // The product of (i + a) / (i + 1) for i = 1..n is Gamma(n + 1 + a) / (Gamma(1 + a) (n + 1)!), which tends to
    // n^(a - 1) / Gamma(1 + a): four times the passes shrink the squared radius by 4^(a - 1).
    let squared = |pass| progressive_radius_m(1.0, 0.7, pass).powi(2);
    assert!((squared(0) - 1.0).abs() < 1e-12);
    assert!((squared(1) - 1.7 / 2.0).abs() < 1e-12);
    let ratio = squared(4000) / squared(1000);
    assert!((ratio - 4f64.powf(-0.3)).abs() < 1e-3, "{ratio}");
}
