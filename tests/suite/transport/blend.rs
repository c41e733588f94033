//! Blended surfaces over frames (`shaders/shared/alpha.wesl`): a pixel meets them as often as they cover, panes one behind the
//! other independently; photons light them as lamps do.

use glam::DVec3;
use stereolux::gpu::ShaderLibrary;
use stereolux::renderer::Eye;
use stereolux::scene::{AlphaMode, Material, Scene};
use stereolux::settings::{DirectLight, Eyes, Method, RenderSettings, Reuse};
use stereolux::xr::View;

use super::hard_support::{add, add_point_light, direct_from_map, glowing, looking_ahead, quad};
use super::support::{method, radiance, renderer_by, statistics};
use crate::suite::frame::layout::changed;

const SIZE: u32 = 32;
const FRAMES: u32 = 16;
const COVERED: f64 = 0.4;

/// A material of that colour that covers so much of what lies behind it.
fn blended(grey: f32) -> Material {
    let mut pane = Material::lambert("pane", [grey; 3]);
    pane.base_color[3] = COVERED as f32;
    pane.alpha_mode = AlphaMode::Blend;
    pane
}

/// Adds a square at z whose front looks along +Z, or along -Z if it is turned.
fn add_square(scene: &mut Scene, half_m: f64, z: f64, is_turned: bool, material: Material) {
    let [across, up] = [2.0 * half_m * DVec3::X, 2.0 * half_m * DVec3::Y];
    let corner = DVec3::new(-half_m, -half_m, z);
    let [u, v] = if is_turned {
        [up, across]
    } else {
        [across, up]
    };
    add(scene, &quad(corner, u, v), material);
}

/// Black panes before a lamp.
fn scene(panes: u32) -> Scene {
    let mut scene = Scene::default();
    add_square(&mut scene, 9.0, -4.0, false, glowing([1.0; 3]));
    for pane in 0..panes {
        add_square(&mut scene, 9.0, -1.0 - f64::from(pane), false, blended(0.0));
    }
    scene
}

/// One channel of the left eye's picture in each of so many frames.
fn pictures(
    library: &ShaderLibrary,
    scene: &Scene,
    settings: &RenderSettings,
    views: &[View; 2],
    frames: u32,
) -> Vec<Vec<f64>> {
    let mut renderer = renderer_by(library, scene, settings, Eyes::Left, [SIZE; 2]).unwrap();
    let of_frame = |frame| {
        renderer.render_frame(views, frame, |_| {}).unwrap();
        let picture = radiance(&renderer, Eye::Left);
        picture.iter().map(|pixel| f64::from(pixel[0])).collect()
    };
    (0..frames).map(of_frame).collect()
}

/// In how many of the frames each pixel sees the lamp.
fn times_seen(library: &ShaderLibrary, panes: u32) -> Vec<f64> {
    // No pixel lies on a diagonal, where both triangles may be met.
    let views = looking_ahead(DVec3::new(0.013, 0.007, 0.0), 45.0);
    let pictures = pictures(
        library,
        &scene(panes),
        &method(Method::Path, Reuse::Off),
        &views,
        FRAMES,
    );
    (0..pictures[0].len())
        .map(|pixel| pictures.iter().map(|picture| picture[pixel]).sum())
        .collect()
}

/// Greatest difference of a pixel's number from what is expected.
fn farthest(times: &[f64], expected: f64) -> f64 {
    let off = times.iter().map(|times| (times - expected).abs());
    off.fold(0.0, f64::max)
}

#[test]
fn a_pixel_meets_a_pane_as_often_as_it_covers() {
    let library = ShaderLibrary::embedded();
    let seen = times_seen(&library, 1);
    let expected = f64::from(FRAMES) * (1.0 - COVERED);
    // The most over all first numbers, by going through them: 1.6, 1.4, 2.4 and 2.4 frames for the four steps.
    let off = farthest(&seen, expected);
    assert!(off < 2.5, "{off} frames of {FRAMES}");
    // By chance one pixel in a thousand is off by three deviations, sqrt(16 * 0.4 * 0.6) = 2.0 frames.
    let chance = changed(
        "shared/alpha",
        "* (key & ALPHA_TURNS)",
        "* hash_combine(key, key)",
    );
    let off = farthest(&times_seen(&chance, 1), expected);
    assert!(off > 4.0, "{off} frames of {FRAMES} by chance");
}

#[test]
fn panes_one_behind_the_other_are_met_independently() {
    for panes in [1, 2] {
        let seen = times_seen(&ShaderLibrary::embedded(), panes);
        let count = seen.len() as f64;
        let share = (1.0 - COVERED).powi(panes as i32);
        let mean = seen.iter().sum::<f64>() / (count * f64::from(FRAMES));
        // Pixels are independent, each within a deviation of independent frames'.
        let error = (share * (1.0 - share) / (count * f64::from(FRAMES))).sqrt();
        assert!(
            (mean - share).abs() < 5.0 * error,
            "{panes}: {mean}, not {share} +- {error}"
        );
        // And each pixel for itself: two sequences of independent steps within twice what one is off by, plus chance's half.
        let off = farthest(&seen, f64::from(FRAMES) * share);
        assert!(off < 5.0, "{panes}: {off} frames of {FRAMES}");
    }
}

/// Mean radiance of a lit pane in each of some frames, whose photons differ; with a wall of its colour 2 mm behind it, as decals have.
fn lit(library: &ShaderLibrary, settings: &RenderSettings, is_decal: bool) -> Vec<f64> {
    let mut scene = Scene::default();
    add_square(&mut scene, 2.0, -3.0, false, blended(0.8));
    if is_decal {
        let wall = Material::lambert("wall", [0.8; 3]);
        add_square(&mut scene, 2.0, -3.002, false, wall);
    }
    add_point_light(&mut scene, DVec3::NEG_Z, 1.0);
    let views = looking_ahead(DVec3::ZERO, 10.0);
    let pictures = pictures(library, &scene, settings, &views, FRAMES);
    let mean = |picture: &Vec<f64>| picture.iter().sum::<f64>() / picture.len() as f64;
    pictures.iter().map(mean).collect()
}

#[test]
fn photons_light_a_pane_as_lamps_do() {
    let library = ShaderLibrary::embedded();
    // Once by photons that meet the pane and once by its coverage: light would count by its square.
    let squared = changed(
        "shared/photon_path",
        "flux /= select(1.0, coverage, coverage > 0.0);",
        "",
    );
    // Decal and wall by the photons of both.
    let doubled = changed(
        "shared/gather_point",
        "photon.is_blended != (*point).is_blended",
        "false",
    );
    let settings = |direct, edge_correction| {
        let mut settings = direct_from_map(1 << 16);
        settings.photon.direct = direct;
        settings.photon.every_frame = true;
        settings.photon.radius_m = 0.1;
        settings.photon.edge_correction = edge_correction;
        settings
    };
    for (is_decal, wrong) in [(false, squared), (true, doubled)] {
        let by_lamp = lit(&library, &settings(DirectLight::Nee, false), is_decal);
        let (by_lamp, lamp_variance) = statistics(&by_lamp);
        for edge_correction in [true, false] {
            let by_photons = |library| {
                let found = lit(
                    library,
                    &settings(DirectLight::Map, edge_correction),
                    is_decal,
                );
                let (found, variance) = statistics(&found);
                // Irradiance 1 / d^2 cos^3 is even within a radius to r^2 / d^2 = 0.25 %, and pixels' coverage differs by their
                // errors.
                let bound = 4.0 * (variance.sqrt() + lamp_variance.sqrt()) + 0.0025 * by_lamp;
                ((found - by_lamp).abs() <= bound, found / by_lamp)
            };
            let (is_right, ratio) = by_photons(&library);
            assert!(is_right, "decal {is_decal}: {ratio}");
            let (is_right, ratio) = by_photons(&wrong);
            assert!(!is_right, "decal {is_decal}: {ratio}");
        }
    }
}

/// Between walls that shine alike everything is as bright, whichever of a blended slab's faces a ray meets.
#[test]
fn blended_glass_keeps_the_light_of_a_furnace() {
    let glass = Material {
        transmission: 1.0,
        ior: 1.5,
        roughness: 0.0,
        ..blended(1.0)
    };
    let mut scene = Scene::default();
    for (z, is_turned, material) in [
        (-4.0, false, &glowing([1.0; 3])),
        (4.0, true, &glowing([1.0; 3])),
        (-1.0, false, &glass),
        (-1.5, true, &glass),
    ] {
        add_square(&mut scene, 9.0, z, is_turned, material.clone());
    }
    let library = ShaderLibrary::embedded();
    let wrong = changed(
        "shared/surface",
        "select(bsdf.transmission_scale, 1.0, is_blended)",
        "bsdf.transmission_scale",
    );
    let farthest_off = |library| {
        let views = looking_ahead(DVec3::new(0.013, 0.007, 0.0), 20.0);
        farthest(
            &pictures(
                library,
                &scene,
                &method(Method::Path, Reuse::Off),
                &views,
                1,
            )[0],
            1.0,
        )
    };
    // Whole paths weigh 1 but for rounding: a few steps of f32 per segment.
    let off = farthest_off(&library);
    assert!(off < 1e-5, "{off}");
    let off = farthest_off(&wrong);
    assert!(off > 0.5, "{off}");
}
