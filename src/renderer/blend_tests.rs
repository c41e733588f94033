//! Blended surfaces over frames (`shaders/shared/alpha.wesl`): a pixel meets them as often as they cover, panes one behind the
//! other independently; photons light them as lamps do.

use glam::{DAffine3, DVec3};
use stereolux_report::statistics;

use crate::gpu::ShaderLibrary;
use crate::renderer::test_support::{
    add_light, context, direct_from_map, looking_ahead, replaced, scene_of, walls,
};
use crate::renderer::{Eye, Renderer};
use crate::scene::{AlphaMode, LightKind, Material, Scene};
use crate::settings::{DirectLight, Eyes, Method, RenderSettings, Reuse};
use crate::xr::View;

const SIZE: u32 = 32;
const FRAMES: u32 = 16;
const COVERED: f64 = 0.4;

/// Black panes before a lamp.
fn scene(panes: u32) -> Scene {
    let square = |z: f64, material| {
        let corner = DVec3::new(-9.0, -9.0, z);
        walls(&[[corner, 18.0 * DVec3::X, 18.0 * DVec3::Y]], material)
    };
    let mut lamp = Material::lambert("lamp", [0.0; 3]);
    lamp.emission = [1.0; 3];
    let mut pane = Material::lambert("pane", [0.0; 3]);
    pane.base_color[3] = COVERED as f32;
    pane.alpha_mode = AlphaMode::Blend;
    let mut meshes = vec![square(-4.0, 0)];
    meshes.extend((0..panes).map(|i| square(-1.0 - f64::from(i), 1)));
    scene_of(vec![lamp, pane], meshes)
}

/// One channel of the left eye's picture in each of so many frames.
fn pictures(
    library: &ShaderLibrary,
    scene: &Scene,
    settings: &RenderSettings,
    view: &View,
    frames: u32,
) -> Vec<Vec<f64>> {
    let size = [SIZE; 2];
    let mut renderer =
        Renderer::new(context(), library, scene, settings, Eyes::Left, size).unwrap();
    let of_frame = |frame| {
        renderer.render_frame(&[*view; 2], frame, |_| {}).unwrap();
        let picture = renderer.read_radiance(Eye::Left).unwrap().unwrap();
        picture.iter().map(|pixel| f64::from(pixel[0])).collect()
    };
    (0..frames).map(of_frame).collect()
}

/// Paths of each eye by itself.
fn paths() -> RenderSettings {
    RenderSettings {
        method: Method::Path,
        reuse: Reuse::Off,
        ..RenderSettings::default()
    }
}

/// In how many of the frames each pixel sees the lamp.
fn times_seen(library: &ShaderLibrary, panes: u32) -> Vec<f64> {
    // No pixel lies on a diagonal, where both triangles may be met.
    let view = looking_ahead(DVec3::new(0.013, 0.007, 0.0), 45.0);
    let pictures = pictures(library, &scene(panes), &paths(), &view, FRAMES);
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
    let chance = replaced(
        &library,
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
    let mut pane = Material::lambert("pane", [0.8; 3]);
    pane.base_color[3] = COVERED as f32;
    pane.alpha_mode = AlphaMode::Blend;
    let square = |z: f64, material| {
        let corner = DVec3::new(-2.0, -2.0, z);
        walls(&[[corner, 4.0 * DVec3::X, 4.0 * DVec3::Y]], material)
    };
    let mut meshes = vec![square(-3.0, 0)];
    meshes.extend(is_decal.then(|| square(-3.002, 1)));
    let materials = vec![pane, Material::lambert("wall", [0.8; 3])];
    let mut scene = scene_of(materials, meshes);
    let place = DAffine3::from_translation(DVec3::NEG_Z);
    add_light(&mut scene, LightKind::Point, 1.0, place);
    let view = looking_ahead(DVec3::ZERO, 10.0);
    let pictures = pictures(library, &scene, settings, &view, FRAMES);
    let mean = |picture: &Vec<f64>| picture.iter().sum::<f64>() / picture.len() as f64;
    pictures.iter().map(mean).collect()
}

#[test]
fn photons_light_a_pane_as_lamps_do() {
    let library = ShaderLibrary::embedded();
    // Once by photons that meet the pane and once by its coverage: light would count by its square.
    let squared = replaced(
        &library,
        "shared/photon_path",
        "flux /= select(1.0, coverage, coverage > 0.0);",
        "",
    );
    // Decal and wall by the photons of both.
    let doubled = replaced(
        &library,
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
        let by_lamp = statistics::mean(&by_lamp).unwrap();
        for edge_correction in [true, false] {
            let by_photons = |library| {
                let found = lit(
                    library,
                    &settings(DirectLight::Map, edge_correction),
                    is_decal,
                );
                let found = statistics::mean(&found).unwrap();
                let [error, lamp_error] = [&found, &by_lamp].map(|of| of.standard_error.unwrap());
                // Irradiance 1 / d^2 cos^3 is even within a radius to r^2 / d^2 = 0.25 %, and pixels' coverage differs by their
                // errors.
                let bound = 4.0 * (error + lamp_error) + 0.0025 * by_lamp.value;
                let off = (found.value - by_lamp.value).abs();
                (off <= bound, found.value / by_lamp.value)
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
    let face = |z: f64, turned: bool, material| {
        let [across, up] = [18.0 * DVec3::X, 18.0 * DVec3::Y];
        let corner = DVec3::new(-9.0, -9.0, z);
        let sides = if turned { [up, across] } else { [across, up] };
        walls(&[[corner, sides[0], sides[1]]], material)
    };
    let mut lamp = Material::lambert("lamp", [0.0; 3]);
    lamp.emission = [1.0; 3];
    let mut glass = Material::lambert("glass", [1.0; 3]);
    glass.base_color[3] = COVERED as f32;
    glass.alpha_mode = AlphaMode::Blend;
    glass.transmission = 1.0;
    glass.ior = 1.5;
    glass.roughness = 0.0;
    let meshes = vec![
        face(-4.0, false, 0),
        face(4.0, true, 0),
        face(-1.0, false, 1),
        face(-1.5, true, 1),
    ];
    let scene = scene_of(vec![lamp, glass], meshes);
    let library = ShaderLibrary::embedded();
    let wrong = replaced(
        &library,
        "shared/surface",
        "select(bsdf.transmission_scale, 1.0, is_blended)",
        "bsdf.transmission_scale",
    );
    let farthest_off = |library| {
        let view = looking_ahead(DVec3::new(0.013, 0.007, 0.0), 20.0);
        farthest(&pictures(library, &scene, &paths(), &view, 1)[0], 1.0)
    };
    // Whole paths weigh 1 but for rounding: a few steps of f32 per segment.
    let off = farthest_off(&library);
    assert!(off < 1e-5, "{off}");
    let off = farthest_off(&wrong);
    assert!(off > 0.5, "{off}");
}
