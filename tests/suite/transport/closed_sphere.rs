//! A closed sphere with known radiance by every method, kind of light and sampler (pbrt's analytic test, extended to
//! photons), and a convex body under an even sky.

use std::f64::consts::PI;

use glam::{DAffine3, DQuat, DVec3};
use stereolux::renderer::Renderer;
use stereolux::scene::{LightKind, Scene};
use stereolux::settings::Sampler::{self, Random, Sobol};
use stereolux::settings::{DirectLight, Eyes, Method, RenderSettings, Reuse, Technique};
use stereolux::xr::{Pose, View};

use super::hard_support::{constant_environment, mesh};
use super::lights_probe::add_light;
use super::support::{
    builtin, images_of, mean, parallel_views, renderer, renderer_by, settings, square_fov,
    statistics,
};
use crate::suite::embedded_scenes::sphere::{ALBEDO, LIGHT_INTENSITY, RADIANCE};
use crate::suite::frame::layout::changed;

const SIZE: u32 = 24;
const DEPTH: u32 = 6;
const RUNS: u32 = 6;
/// What the facets may move: the sphere's mesh has the sphere's area, but its facets' distances from the centre, and so
/// the irradiance of a point light there, vary by under 1 % about it, and a view sees some of them; a gather disc of
/// radius r on a sphere of radius R is off by (r / R)^2 / 4 = 0.1 %.
const FACETS: f64 = 0.004;

/// The sphere with flat facets, so that no direction is lost between a facet's horizon and its shading normal's.
fn sphere() -> Scene {
    let mut scene = builtin("sphere");
    for flat in &mut scene.meshes {
        let all = flat.triangles.iter().map(|triangle| flat.corners(triangle));
        *flat = mesh(&all.collect::<Vec<_>>(), 0);
    }
    scene
}

/// Lights that can be put into the sphere, with the radiance that each gives the wall in view, to [`DEPTH`] segments.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Light {
    /// At the centre. A path of k segments meets k - 1 surfaces: L = a E / pi (1 + a + ...), E = I / R^2.
    Point,
    /// At the centre, shining backwards: what the view shows is lit from the second bounce on. An integrating sphere
    /// spreads the power P evenly: after k reflections the radiance is P a^k / (4 pi^2 R^2).
    Spot,
    /// The wall itself: L = Le (1 + a + ... + a^(DEPTH - 1)), in a closed body of any shape.
    Wall,
    /// A sun outside: nothing gets in.
    Sun,
}

const WALL_EMISSION: f32 = 0.25;
const SPOT_INTENSITY: f32 = 4.0;
const SPOT_INNER_RAD: f32 = 0.7;
const SPOT_OUTER_RAD: f32 = 1.0;

impl Light {
    fn radiance(self) -> f64 {
        let a = f64::from(ALBEDO);
        let series = |from: u32, to: u32| (from..to).map(|k| a.powi(k as i32)).sum::<f64>();
        match self {
            Self::Point => RADIANCE * (1.0 - a.powi(DEPTH as i32 - 1)),
            Self::Spot => {
                // KHR_lights_punctual: the falloff is the square of a ramp in the cosine, whose integral over it is a
                // third of its width.
                let [inner, outer] = [SPOT_INNER_RAD, SPOT_OUTER_RAD].map(|r| f64::from(r).cos());
                let power =
                    2.0 * PI * f64::from(SPOT_INTENSITY) * (1.0 - inner + (inner - outer) / 3.0);
                power / (4.0 * PI * PI) * series(2, DEPTH)
            }
            Self::Wall => f64::from(WALL_EMISSION) * series(0, DEPTH),
            Self::Sun => 0.0,
        }
    }

    fn add_to(self, scene: &mut Scene) {
        let (kind, intensity) = match self {
            // The lamp that is there.
            Self::Point => {
                scene.lights[0].intensity = [LIGHT_INTENSITY; 3];
                return;
            }
            Self::Wall => {
                for material in &mut scene.materials {
                    material.emission = [WALL_EMISSION; 3];
                }
                return;
            }
            Self::Spot => {
                let kind = LightKind::Spot {
                    inner_cone_rad: SPOT_INNER_RAD,
                    outer_cone_rad: SPOT_OUTER_RAD,
                };
                (kind, SPOT_INTENSITY)
            }
            Self::Sun => (LightKind::Directional, 0.2),
        };
        // Lights shine along their -Z: turned round, away from the view.
        let turned = DAffine3::from_quat(DQuat::from_rotation_y(PI));
        add_light(scene, kind, [intensity; 3], turned);
    }
}

fn lit_by(lights: &[Light]) -> (Scene, f64) {
    let mut scene = sphere();
    scene.lights[0].intensity = [0.0; 3];
    for light in lights {
        light.add_to(&mut scene);
    }
    (scene, lights.iter().map(|light| light.radiance()).sum())
}

fn path(sampler: Sampler, technique: Technique) -> RenderSettings {
    settings(|s| {
        s.method = Method::Path;
        s.reuse = Reuse::Off;
        s.spp = 16;
        s.path.max_depth = DEPTH;
        s.path.sampler = sampler;
        s.path.technique = technique;
    })
}

fn photons(sampler: Sampler, change: impl FnOnce(&mut RenderSettings)) -> RenderSettings {
    settings(|s| {
        s.reuse = Reuse::Off;
        s.path.sampler = sampler;
        s.photon.count = 60_000;
        s.photon.radius_m = 0.06;
        s.photon.max_depth = DEPTH;
        s.photon.every_frame = true;
        change(s);
    })
}

/// Mean of the left eye's image and its standard error over independent runs.
fn measured(scene: &Scene, settings: &RenderSettings, views: &[View; 2]) -> (f64, f64) {
    measured_by(renderer(scene, settings, [SIZE, SIZE]), views)
}

fn measured_by(mut renderer: Renderer, views: &[View; 2]) -> (f64, f64) {
    let images = images_of(&mut renderer, views, 0..RUNS);
    let means: Vec<f64> = images.iter().map(|image| mean(image)).collect();
    let (mean, squared_error) = statistics(&means);
    (mean, squared_error.sqrt())
}

/// Whether a mean is the expected one: within 1 %, and within 4 standard errors beside what the facets move.
fn agrees((found, error): (f64, f64), expected: f64) -> bool {
    let off = (found - expected).abs();
    off <= 0.01 * expected && off <= 4.0 * error + FACETS * expected
}

fn views() -> [View; 2] {
    parallel_views(builtin("sphere").start_pose(), 0.0, square_fov(40.0))
}

#[test]
fn every_kind_of_light_gives_its_closed_form() {
    for lights in [&[Light::Point][..], &[Light::Spot], &[Light::Wall]] {
        let (scene, expected) = lit_by(lights);
        for settings in [path(Random, Technique::Mis), photons(Random, |_| {})] {
            let found = measured(&scene, &settings, &views());
            let what = format!("{lights:?} by {:?}: {found:?}", settings.method);
            assert!(agrees(found, expected), "{what} for {expected}");
            // Negative control: 2 % more is noticed.
            assert!(!agrees(found, expected * 1.02), "{what}");
        }
    }
}

#[test]
fn every_method_and_sampler_adds_the_lights_up() {
    let lights = [Light::Point, Light::Spot, Light::Wall, Light::Sun];
    let (scene, expected) = lit_by(&lights);
    let all = [
        ("path", path(Random, Technique::Mis)),
        ("path, Sobol", path(Sobol, Technique::Mis)),
        ("path, light samples", path(Random, Technique::Light)),
        ("photons", photons(Random, |_| {})),
        ("photons, Sobol", photons(Sobol, |_| {})),
        (
            "photons, direct from the map",
            photons(Random, |s| s.photon.direct = DirectLight::Map),
        ),
        (
            "photons, progressive, Sobol",
            photons(Sobol, |s| {
                s.photon.progressive = true;
                s.photon.count = 20_000;
                s.spp = 4;
            }),
        ),
    ];
    for (name, settings) in all {
        let found = measured(&scene, &settings, &views());
        assert!(agrees(found, expected), "{name}: {found:?} for {expected}");
    }
    // Directions of the surfaces alone find the wall and no punctual light.
    let (scene, expected) = lit_by(&[Light::Wall, Light::Point]);
    let found = measured(&scene, &path(Sobol, Technique::Bsdf), &views());
    let of_wall = expected - Light::Point.radiance();
    assert!(agrees(found, of_wall), "{found:?} for {of_wall}");
}

/// [`DEPTH`] segments at an albedo of a half: the throughput falls under a quarter, where roulette begins, with two to go.
#[test]
fn roulette_keeps_the_closed_form() {
    let (scene, expected) = lit_by(&[Light::Wall, Light::Spot]);
    let with = |russian_roulette| {
        let mut settings = path(Random, Technique::Mis);
        settings.path.russian_roulette = russian_roulette;
        settings
    };
    for russian_roulette in [false, true] {
        let found = measured(&scene, &with(russian_roulette), &views());
        let what = format!("roulette {russian_roulette}: {found:?}");
        assert!(agrees(found, expected), "{what} for {expected}");
    }
    // Negative control, and proof that paths do end: without the survivors' weight their light is missing.
    let weight = "(*path).throughput /= survival;";
    let weightless = changed("passes/path_trace", weight, "");
    for (russian_roulette, loses) in [(false, false), (true, true)] {
        let settings = with(russian_roulette);
        let wrong = renderer_by(&weightless, &scene, &settings, Eyes::Both, [SIZE, SIZE]);
        let found = measured_by(wrong.unwrap(), &views());
        let what = format!("roulette {russian_roulette}, no weights: {found:?}");
        assert_eq!(!agrees(found, expected), loses, "{what} for {expected}");
    }
}

#[test]
fn nothing_gets_into_a_closed_sphere() {
    let (mut scene, _) = lit_by(&[Light::Sun]);
    scene.environment = Some(constant_environment([1.0; 3]));
    // A hit within its rounding (some 1e-7 m) of an edge may start its next ray beyond the neighbouring facet. There are
    // 43 m of edges per square metre: 43 x 2 x 1e-7 = 1e-5 of the rays, 5 of them a path, each bringing 1 at most.
    let bound = 5e-5;
    for settings in [path(Random, Technique::Mis), photons(Random, |_| {})] {
        let (found, _) = measured(&scene, &settings, &views());
        assert!(found < bound, "{:?}: {found}", settings.method);
    }
    // Negative control: one facet of 5120 missing lets in 1 / 5120 of what a ray can meet, times the albedo's series.
    scene.meshes[0].triangles.remove(0);
    let (found, _) = measured(&scene, &path(Random, Technique::Mis), &views());
    assert!(found > bound, "a hole goes unnoticed: {found}");
}

#[test]
fn a_convex_body_under_an_even_sky_sends_back_its_albedo() {
    // From outside: opaque surfaces scatter on both sides. Every ray that leaves a convex body meets the sky.
    let mut scene = sphere();
    scene.lights[0].intensity = [0.0; 3];
    scene.environment = Some(constant_environment([2.0; 3]));
    // So near that the ball fills the view: it spans 41.8 degrees, and the view's corners lie at 39.2.
    let head = Pose::new(DVec3::Z * 1.5, DQuat::IDENTITY);
    let views = parallel_views(head, 0.0, square_fov(30.0));
    let expected = 2.0 * f64::from(ALBEDO);
    let all =
        |s: &mut RenderSettings| (s.photon.direct, s.photon.count) = (DirectLight::Map, 1 << 20);
    for (name, settings) in [
        ("path", path(Random, Technique::Mis)),
        ("path, Sobol", path(Sobol, Technique::Mis)),
        ("path, light samples", path(Sobol, Technique::Light)),
        ("path, surfaces' directions", path(Random, Technique::Bsdf)),
        ("photons", photons(Random, |_| {})),
        ("photons, direct from the map", photons(Sobol, all)),
    ] {
        let found = measured(&scene, &settings, &views);
        assert!(agrees(found, expected), "{name}: {found:?} for {expected}");
    }
}
