//! What the filter must not spread or keep: what surfaces send out by themselves, and rare bright samples that nothing has
//! averaged yet.

use glam::{DQuat, DVec3};
use stereolux::images::luminance;
use stereolux::renderer::Eye;
use stereolux::scene::{Material, Scene};
use stereolux::settings::{Method, Reuse};

use super::hard_support::{add, eyes_at, glowing, quad, square_ahead};
use super::reconstruction::{SIZE, filtered};
use super::support::{builtin, method, play, radiance, rendered, renderer, start_views};

const EMISSION: f32 = 3.1;

/// A pane behind bars thinner than a pixel, all of one mesh, 2 m in front of the origin; nothing reflects.
fn pane_and_bars() -> Scene {
    let mut scene = Scene::default();
    let tall = DVec3::new(0.0, 8.0, 0.0);
    let mut triangles = square_ahead(4.0, 2.0).to_vec();
    let of_pane = triangles.len();
    // A pixel is 4 m / 64 wide there.
    let (period, width) = (0.131, 0.045);
    triangles.extend((0..60).flat_map(|bar| {
        let x = -4.0 + period * f64::from(bar);
        quad(DVec3::new(x, -4.0, -1.995), DVec3::X * width, tall)
    }));
    add(&mut scene, &triangles, glowing([EMISSION; 3]));
    for triangle in &mut scene.meshes[0].triangles[of_pane..] {
        triangle.material = scene.materials.len() as u32;
    }
    scene.materials.push(Material::lambert("bars", [0.0; 3]));
    scene
}

#[test]
fn a_pane_does_not_mix_with_the_bars_before_it() {
    let scene = pane_and_bars();
    // Nothing is left to the filter, and the reflected light that is added is 0.
    for (method, reuse) in [
        (Method::Path, Reuse::Off),
        (Method::Photon, Reuse::Off),
        (Method::Photon, Reuse::Scatter),
    ] {
        for spp in [1, 2] {
            let settings = filtered(reuse, |s| {
                s.method = method;
                s.spp = spp;
            });
            let mut renderer = renderer(&scene, &settings, [SIZE, SIZE]);
            for step in 0..6 {
                let head = DVec3::new(0.021, 0.008, 0.0) * f64::from(step);
                let views = eyes_at(head, DQuat::IDENTITY, 45.0);
                play(&mut renderer, &views, step..step + 1);
            }
            let what = format!("{method:?} {reuse:?}, {spp} samples");
            let mut worst = 0.0_f64;
            for eye in [Eye::Left, Eye::Right] {
                let raw = renderer.read_samples(eye).unwrap().unwrap();
                let lit = raw.iter().filter(|p| p[0] > 0.5 * EMISSION).count();
                assert!(lit > raw.len() / 3 && lit < raw.len(), "{what}: {lit} lit");
                for (raw, shown) in raw.iter().zip(&radiance(&renderer, eye)) {
                    worst = worst.max((f64::from(raw[0]) - f64::from(shown[0])).abs());
                }
            }
            // Negative control: with two samples per pixel the pane is filtered as all else, and mixes.
            if spp == 1 {
                assert!(worst == 0.0, "{what}: {worst}");
            } else {
                assert!(worst > 0.1 * f64::from(EMISSION), "{what}: {worst}");
            }
        }
    }
}

/// The pixel and those next to it, as far as they are in the image.
fn around(pixel: usize) -> impl Iterator<Item = usize> {
    let size = SIZE as usize;
    let near = |at: usize| at.saturating_sub(1)..(at + 2).min(size);
    let columns = near(pixel % size);
    near(pixel / size).flat_map(move |y| columns.clone().map(move |x| y * size + x))
}

#[test]
fn light_without_history_lies_between_its_darkest_and_its_brightest_neighbour() {
    let scene = builtin("cornell");
    let views = start_views(&scene, 21.0);
    for frames in [0, 4] {
        // Without the wavelet the first frame's picture is the limited light times albedo.
        let mut settings = method(Method::Path, Reuse::Off);
        settings.reconstruct.svgf = true.into();
        settings.reconstruct.stereo = false;
        settings.reconstruct.atrous_passes = 0.into();
        settings.reconstruct.firefly_frames = frames;
        settings.output.parts = true;
        let renderer = rendered(&scene, &settings, [SIZE, SIZE], &views);
        let parts = renderer.read_parts(Eye::Left).unwrap().unwrap();
        let shown = radiance(&renderer, Eye::Left);
        let raw = renderer.read_samples(Eye::Left).unwrap().unwrap();
        let (seen, _) = renderer.read_motion(Eye::Left).unwrap().unwrap();
        let albedo = |i: usize, c: usize| f64::from(parts.albedo[i][c]).max(0.01);
        // The f64 twin, away from the lamp, whose emission goes past all this.
        let light: Vec<[[f64; 3]; 2]> = (0..raw.len())
            .map(|i| {
                let over = |p: &[f32; 3]| std::array::from_fn(|c| f64::from(p[c]) / albedo(i, c));
                [over(&parts.direct[i]), over(&parts.indirect[i])]
            })
            .collect();
        // By luminance, of the light of neighbours that see a surface.
        let ranked = |pixel: usize, kind: usize| {
            let others = around(pixel).filter(|&i| i != pixel && seen[i][0] != 0);
            let mut others: Vec<_> = others.map(|other| light[other][kind]).collect();
            others.sort_by(|a, b| luminance(*a).total_cmp(&luminance(*b)));
            others.first().copied().zip(others.last().copied())
        };
        let is_lamp = |pixel: usize| raw[pixel][0] > 10.0;
        let (mut limited, mut raised, mut judged) = (0, 0, 0);
        for pixel in 0..raw.len() {
            if seen[pixel][0] == 0 || around(pixel).any(is_lamp) {
                continue;
            }
            judged += 1;
            let (mut expected, mut slack) = ([0.0_f64; 3], [1e-12; 3]);
            let mut is_limited = false;
            for (kind, mut part) in light[pixel].into_iter().enumerate() {
                let (darkest, brightest) = ranked(pixel, kind).unwrap_or((part, part));
                let own = luminance(part);
                if frames > 0 && own < luminance(darkest) {
                    part = darkest;
                    raised += 1;
                } else if frames > 0 && own > luminance(brightest) {
                    let share = luminance(brightest) / own;
                    part = part.map(|channel| channel * share);
                    is_limited |= share < 0.99;
                }
                // Light is packed twice, each time within 2^-14 of its greatest channel; the limit is a ratio of two luminances,
                // each a fifth of that channel or more (red light, of which there is most).
                let greatest = part.into_iter().fold(0.0, f64::max);
                for channel in 0..3 {
                    expected[channel] += albedo(pixel, channel) * part[channel];
                    slack[channel] += albedo(pixel, channel) * greatest * 12.0 / 16384.0;
                }
            }
            limited += u32::from(is_limited);
            for channel in 0..3 {
                let off = (f64::from(shown[pixel][channel]) - expected[channel]).abs();
                let what = format!("pixel {pixel}, {frames} frames: {off}");
                assert!(off <= slack[channel], "{what} of {expected:?}");
            }
        }
        assert!(judged > 3000, "{judged}");
        // Every ninth pixel is the brightest of nine, in either kind of light; most of the darkest are black as others are.
        assert_eq!(limited > 300, frames > 0, "{limited} limited");
        assert_eq!(raised > 100, frames > 0, "{raised} raised");
    }
}
