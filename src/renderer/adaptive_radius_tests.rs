//! Automatic radii that shrink where photons are dense (`shaders/shared/gather.wesl`), on a plate in sunlight.

use std::f64::consts::PI;

use glam::DVec3;

use crate::gpu::{GpuContext, ShaderLibrary};
use crate::renderer::test_support::{context, direct_from_map, looking_ahead, nodes_of, walls};
use crate::renderer::{Eye, Renderer};
use crate::scene::{LightKind, Material, Node, PunctualLight, Scene};
use crate::settings::{Eyes, Force};

const PATHS: u32 = 1 << 19;
const SEEDS: u32 = 4;
/// Pixels across the picture, which is just the plate.
const SIZE: usize = 64;
const SIDE_M: f64 = 1.0;
const DISTANCE_M: f64 = 2.0;
const ALBEDO: f32 = 0.5;
const IRRADIANCE: f32 = 2.0;
/// As in `shaders/passes/grid_setup.wesl`.
const MOST_GATHERED: f64 = 250.0;

/// A plate faces the eye and the sun behind it. Sheets of many times its area stand beside it along the sunlight, which passes
/// them: the automatic radius is far too wide for the plate.
fn scene() -> Scene {
    let corner = DVec3::new(-0.5, -0.5, 0.0) * SIDE_M - DISTANCE_M * DVec3::Z;
    let [x, y] = [DVec3::X, DVec3::Y].map(|axis| SIDE_M * axis);
    let sheets = (0..200).map(|i| {
        let beside = corner + (1.1 + 0.001 * f64::from(i)) * x;
        [beside, 2.0 * DVec3::Z, y]
    });
    let rectangles: Vec<_> = [[corner, x, y]].into_iter().chain(sheets).collect();
    let meshes = vec![walls(&rectangles, 0)];
    let mut nodes = nodes_of(&meshes);
    nodes.push(Node {
        light: Some(0),
        ..Node::default()
    });
    Scene {
        materials: vec![Material::lambert("grey", [ALBEDO; 3])],
        roots: vec![0, 1],
        meshes,
        nodes,
        lights: vec![PunctualLight {
            name: "sun".to_owned(),
            kind: LightKind::Directional,
            intensity: [IRRADIANCE; 3],
        }],
        ..Scene::default()
    }
}

/// What a plate's pictures hold, means over seeds.
struct Found {
    /// Irradiance over the sun's, by rows.
    picture: Vec<f64>,
    photons_per_m2: f64,
    radius_m: f64,
}

fn found(context: &GpuContext, adaptive: bool, corrected: bool) -> Found {
    let mut settings = direct_from_map(PATHS);
    settings.photon.adaptive_radius = adaptive;
    settings.photon.edge_correction = corrected;
    settings.force.guided_photons = Force::Off;
    let (scene, library) = (scene(), ShaderLibrary::embedded());
    let half = (0.5 * SIDE_M / DISTANCE_M).atan().to_degrees();
    let view = looking_ahead(DVec3::ZERO, half);
    let mut found = Found {
        picture: vec![0.0; SIZE * SIZE],
        photons_per_m2: 0.0,
        radius_m: 0.0,
    };
    let of_the_sun = PI / f64::from(ALBEDO * IRRADIANCE * SEEDS as f32);
    for seed in 0..SEEDS {
        settings.seed = seed;
        let size = [SIZE as u32; 2];
        let mut renderer = Renderer::new(
            context.clone(),
            &library,
            &scene,
            &settings,
            Eyes::Left,
            size,
        )
        .unwrap();
        let result = renderer.render_frame(&[view; 2], 0, |_| {}).unwrap();
        let picture = renderer.read_radiance(Eye::Left).unwrap().unwrap();
        for (sum, pixel) in found.picture.iter_mut().zip(&picture) {
            *sum += of_the_sun * f64::from(pixel[0]);
        }
        let stored = f64::from(result.photons.map.stored);
        found.photons_per_m2 += stored / (SIDE_M * SIDE_M * f64::from(SEEDS));
        found.radius_m = renderer.radius_m();
    }
    found
}

/// Share of a disc that lies within a straight edge, `edge` radii from its centre.
fn within_edge(edge: f64) -> f64 {
    let edge = edge.min(1.0);
    1.0 - (edge.acos() - edge * (1.0 - edge * edge).sqrt()) / PI
}

#[test]
fn a_disc_holds_as_many_photons_as_it_may_and_even_light_stays_as_bright() {
    let context = context();
    let found = [false, true].map(|adaptive| found(&context, adaptive, false));
    let pixel_m = SIDE_M / SIZE as f64;
    let mut apart = 0;
    for column in 0..SIZE / 2 {
        let edge_m = (column as f64 + 0.5) * pixel_m;
        let rows = SIZE / 4..3 * SIZE / 4;
        let mean = |found: &Found| {
            let pixels = rows.clone().map(|row| found.picture[row * SIZE + column]);
            pixels.sum::<f64>() / rows.len() as f64
        };
        // Of the box around a place, two radii along a side, the plate's photons are those up to its edge. A disc would hold a
        // share pi / 4 of as many.
        let expected = |found: &Found, adaptive: bool| {
            let radius_m = found.radius_m;
            let boxed = found.photons_per_m2 * 2.0 * radius_m * (radius_m + edge_m.min(radius_m));
            let held = boxed * PI / 4.0;
            let shrunk_m = radius_m * (MOST_GATHERED / held).sqrt();
            let radius_m = if adaptive { shrunk_m } else { radius_m };
            // Photons that the rows' discs hold together, over all seeds: five standard errors of as many, were they
            // independent. They are spread more evenly than that.
            let strip_m2 = 2.0 * radius_m * rows.len() as f64 * pixel_m;
            let photons = found.photons_per_m2 * strip_m2 * f64::from(SEEDS);
            (within_edge(edge_m / radius_m), 5.0 / photons.sqrt())
        };
        let expected = [expected(&found[0], false), expected(&found[1], true)];
        for (found, (value, tolerance)) in found.iter().zip(expected) {
            let mean = mean(found);
            let what = format!("{edge_m} m: {mean}, not {value} +- {tolerance}");
            assert!((mean - value).abs() < tolerance, "{what}");
        }
        let difference = expected[1].0 - expected[0].0;
        apart += usize::from(difference > expected[0].1 + expected[1].1);
    }
    // Each radius would notice the other.
    assert!(apart > SIZE / 16, "{apart} columns tell the radii apart");
}

#[test]
fn a_smaller_disc_needs_less_of_the_correction_at_edges() {
    let context = context();
    let [lost, kept] = [false, true].map(|corrected| {
        let found = found(&context, true, corrected);
        let sum: f64 = found.picture.iter().sum();
        (sum / found.picture.len() as f64, found)
    });
    let (kept, found) = kept;
    // An edge takes 2 r / (3 pi) of a disc's width: the integral of what lies outside. A photon's weight makes good for the
    // map's radius.
    let lost_by = |radius_m: f64| 4.0 * 2.0 / (3.0 * PI) * radius_m / SIDE_M;
    let wide = lost_by(found.radius_m);
    println!("{} and {kept}, a wide disc loses {wide}", lost.0);
    // The radius changes along an edge by up to the square root of 2, and with it what is lost and what is made good.
    let shrunk_m = (MOST_GATHERED / (PI * found.photons_per_m2)).sqrt();
    let [least, most] = [1.0, 2f64.sqrt()].map(|wider| lost_by(wider * shrunk_m));
    assert!((least..most).contains(&(1.0 - lost.0)), "{}", lost.0);
    assert!((kept - 1.0).abs() < most - least, "{kept}");
    // All of the weight would be noticed.
    assert!(wide > 4.0 * (most - least), "{wide}");
}
