//! `builtin:cornell` at the settings of the contract, smaller: how much is reused, and at what error.

use stereolux::renderer::{Eye, Provenance};
use stereolux::scene::Scene;
use stereolux::settings::{Method, Reuse, Sampler};
use stereolux::xr::View;

use crate::suite::support::{
    builtin, frame, method, radiance, rendered, renderer, settings, start_views,
};

const SIZE: [u32; 2] = [64, 64];

fn views(scene: &Scene) -> [View; 2] {
    // The published camera's opening.
    start_views(scene, 19.65)
}

#[test]
fn most_of_the_right_eye_is_reused() {
    let scene = builtin("cornell");
    for (kind, size) in [(Method::Photon, [128, 128]), (Method::Path, [64, 64])] {
        let mut renderer = renderer(&scene, &method(kind, Reuse::Scatter), size);
        let stereo = frame(&mut renderer, &views(&scene)).stereo;
        eprintln!("{kind:?} {size:?}: {stereo:?}");
        assert!(stereo.reuse_fraction > 0.85, "{kind:?}: {stereo:?}");
    }
}

/// Relative squared errors of two images' pixels of a mask: (x - r)^2 / (r^2 + 0.01 s).
pub fn rel_mse(image: &[[f32; 3]], reference: &[[f32; 3]], mask: &[bool]) -> f64 {
    let square = |value: f32| f64::from(value) * f64::from(value);
    let s =
        reference.iter().flatten().map(|&r| square(r)).sum::<f64>() / (reference.len() * 3) as f64;
    let (mut sum, mut count) = (0.0, 0);
    for ((x, r), counted) in image.iter().zip(reference).zip(mask) {
        if *counted {
            for channel in 0..3 {
                sum += (f64::from(x[channel]) - f64::from(r[channel])).powi(2)
                    / (square(r[channel]) + 0.01 * s);
                count += 1;
            }
        }
    }
    sum / f64::from(count)
}

#[test]
fn reused_pixels_are_about_as_true_as_native_ones() {
    let scene = builtin("cornell");
    let views = views(&scene);
    // The reference averages over the pixel; so does the image that is judged, with several samples. A pixel counts as
    // reused if its last sample was: nearly all of its samples were.
    let reference = |seed| {
        let settings = settings(|s| {
            s.method = Method::Path;
            s.reuse = Reuse::Off;
            s.spp = 192;
            s.seed = seed;
        });
        radiance(&rendered(&scene, &settings, SIZE, &views), Eye::Right)
    };
    let (a, b) = (reference(1), reference(2));
    let mean = |(a, b): (&[f32; 3], &[f32; 3])| [0, 1, 2].map(|c| 0.5 * (a[c] + b[c]));
    let truth: Vec<[f32; 3]> = a.iter().zip(&b).map(mean).collect();
    let render = |reuse, sampler| {
        let settings = settings(|s| {
            s.reuse = reuse;
            s.spp = 4;
            s.photon.count = 65_536;
            s.path.sampler = sampler;
        });
        let renderer = rendered(&scene, &settings, SIZE, &views);
        let provenance = renderer.read_provenance().unwrap();
        (radiance(&renderer, Eye::Right), provenance)
    };
    // For the negative control: the left image in the right one's place is far off.
    let left = method(Method::Photon, Reuse::Off);
    let left = radiance(&rendered(&scene, &left, SIZE, &views), Eye::Left);
    // Samples that are scattered come from several left pixels, each of whose Sobol points are stratified by themselves:
    // a right pixel has the noise of independent ones (measured: 1.4 times native), so that is what it is held to.
    let cases = [
        (Reuse::Scatter, Sampler::Random, Sampler::Random, 1.2),
        (Reuse::Scatter, Sampler::Sobol, Sampler::Random, 1.0),
        (Reuse::Lookup, Sampler::Random, Sampler::Random, 1.05),
        (Reuse::Lookup, Sampler::Sobol, Sampler::Sobol, 1.05),
    ];
    for (reuse, sampler, native_sampler, most) in cases {
        let (reusing, provenance) = render(reuse, sampler);
        let (native, _) = render(Reuse::Off, native_sampler);
        let provenance = provenance.unwrap().into_iter();
        let mask: Vec<bool> = provenance.map(Provenance::is_reused).collect();
        let [with, without] = [&reusing, &native].map(|image| rel_mse(image, &truth, &mask));
        // The two halves of the reference differ by twice the squared error of one, four times that of their mean.
        let own = rel_mse(&a, &b, &mask) / 4.0;
        let what = format!(
            "relMSE of reused pixels: {with:.5} by {reuse:?} of {sampler:?}, {without:.5} native, {native_sampler:?}; \
             the reference's own {own:.5}"
        );
        eprintln!("{what}");
        // The reference has converged, and reuse costs no accuracy.
        assert!(own < 0.1 * without, "{what}");
        assert!(with <= most * without, "{what}");
        // Negative control: the measure tells eyes apart.
        assert!(rel_mse(&left, &truth, &mask) > 2.0 * without, "{what}");
    }
}
