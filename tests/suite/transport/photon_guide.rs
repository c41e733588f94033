//! Guided emission of photons (`shaders/shared/photon_guide.wesl`): as bright as without a guide, more photons through a window,
//! and no guide where there is nothing to be guided to.

use glam::DVec3;
use stereolux::gpu::ShaderLibrary;
use stereolux::renderer::Eye;
use stereolux::scene::{Material, Scene};
use stereolux::settings::{Eyes, Force, Reuse};

use super::hard_support::{Triangle, add, add_sun, constant_environment, looking_ahead, quad};
use super::support::{self, radiance, renderer_by, settings, statistics};
use crate::suite::frame::layout::changed;

const SIZE: u32 = 8;
/// Four for each pilot: the least that is guided.
const PHOTONS: u32 = 1 << 17;
/// Half the room's width.
const HALF_M: f64 = 2.0;

/// A cube around the origin, with a square window in its wall towards +X.
fn room() -> Vec<Triangle> {
    const WINDOW_M: f64 = 0.8;
    let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| axis * 2.0 * HALF_M);
    let low = DVec3::splat(-HALF_M);
    let (far, side) = (low + x, 0.5 - 0.25 * WINDOW_M / HALF_M);
    let rest = 1.0 - side;
    [
        [low, y, z],
        [low, z, x],
        [low + y, x, z],
        [low, x, y],
        [low + z, y, x],
        // Beside the window, below and above it.
        [far, z * side, y],
        [far + z * rest, z * side, y],
        [far + z * side, z * (rest - side), y * side],
        [far + z * side + y * rest, z * (rest - side), y * side],
    ]
    .into_iter()
    .flat_map(|[corner, u, v]| quad(corner, u, v))
    .collect()
}

/// A room under an even sky, or in the sunlight that falls through its window.
fn scene(walls: &[Triangle], is_sunlit: bool) -> Scene {
    let mut scene = Scene::default();
    add(&mut scene, walls, Material::lambert("wall", [0.7; 3]));
    if is_sunlit {
        add_sun(&mut scene, DVec3::new(0.8, 0.5, -0.2), 3.0);
    } else {
        scene.environment = Some(constant_environment([1.0; 3]));
    }
    scene
}

/// Mean of a frame's picture, and photons in the map.
fn frame(library: &ShaderLibrary, scene: &Scene, guided: Force, seed: u32) -> (f64, u32) {
    let settings = settings(|s| {
        s.reuse = Reuse::Off;
        s.seed = seed;
        s.photon.count = PHOTONS;
        s.force.guided_photons = guided;
    });
    let mut renderer = renderer_by(library, scene, &settings, Eyes::Left, [SIZE; 2]).unwrap();
    let views = looking_ahead(DVec3::new(0.2, 0.1, 0.3), 45.0);
    let result = support::frame(&mut renderer, &views);
    let picture = radiance(&renderer, Eye::Left);
    let sum: f64 = picture.iter().map(|pixel| f64::from(pixel[1])).sum();
    (sum / picture.len() as f64, result.photons.map.stored)
}

/// Mean difference between guided and other pictures, in standard errors; `library` guides.
fn deviation(library: &ShaderLibrary, scene: &Scene, seeds: u32) -> f64 {
    let plain = ShaderLibrary::embedded();
    let differences: Vec<f64> = (0..seeds)
        .map(|seed| {
            let guided = frame(library, scene, Force::On, seed).0;
            guided - frame(&plain, scene, Force::Off, seed + seeds).0
        })
        .collect();
    let (mean, variance) = statistics(&differences);
    mean / variance.sqrt()
}

#[test]
fn guided_photons_are_as_bright_and_more_of_them_come_through_a_window() {
    const SEEDS: u32 = 12;
    let library = ShaderLibrary::embedded();
    for is_sunlit in [false, true] {
        let scene = scene(&room(), is_sunlit);
        let [guided, plain] =
            [Force::Auto, Force::Off].map(|guided| frame(&library, &scene, guided, 1).1);
        assert!(
            guided > 4 * plain,
            "{guided} photons, {plain} without a guide"
        );
        // Four standard errors: 1 in 16,000 by chance.
        let off = deviation(&library, &scene, SEEDS);
        assert!(
            off.abs() < 4.0,
            "sunlit: {is_sunlit}: {off} standard errors"
        );
        // Comparator that must fail: photons that are not weighed.
        let weighed = "emitted.flux *= density / (";
        let alike = "emitted.flux *= 1.0 + 0.0 / (";
        let wrong = changed("shared/photon_guide", weighed, alike);
        let off = deviation(&wrong, &scene, SEEDS);
        assert!(off > 8.0, "sunlit: {is_sunlit}: {off} standard errors");
    }
}

#[test]
fn where_photons_are_of_use_by_chance_there_is_no_guide() {
    let library = ShaderLibrary::embedded();
    let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| axis * 2.0 * HALF_M);
    let low = DVec3::splat(-HALF_M);
    let scene = scene(&[quad(low, z, x), quad(low, x, y)].concat(), false);
    let stored = |library, guided| f64::from(frame(library, &scene, guided, 1).1);
    let plain = stored(&library, Force::Off);
    // A path's photons are a few: counts have a standard error of 2 sqrt(n) at most, their difference 1.4 times that.
    let bound = 4.0 * 2.8 * plain.sqrt();
    let off = (stored(&library, Force::On) - plain).abs();
    assert!(off < bound, "{off} of {plain}");
    // Comparator that must fail: a guide in any case.
    let wrong = changed(
        "passes/guide_setup",
        "MOST_VARIANCE: f32 = 0.5",
        "MOST_VARIANCE: f32 = 1.0e9",
    );
    let off = (stored(&wrong, Force::On) - plain).abs();
    assert!(off > bound, "{off} of {plain}");
}
