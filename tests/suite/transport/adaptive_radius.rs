//! Automatic radii that shrink where photons are dense (`shaders/shared/gather.wesl`), on a plate in sunlight, which may come by way
//! of a mirror as a caustic.

use std::f64::consts::PI;
use std::iter::once;

use glam::{DAffine3, DQuat, DVec3};
use stereolux::frame::MapKind;
use stereolux::gpu::ShaderLibrary;
use stereolux::renderer::{Eye, FrameResult, Renderer};
use stereolux::scene::{Material, Scene};
use stereolux::settings::{Eyes, Force, RenderSettings};
use stereolux::xr::View;

use super::hard_support::{add, add_sun, direct_from_map, looking_ahead, quad};
use super::support::{self, placed, radiance, renderer_by};
use crate::suite::frame::layout::changed;

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

/// Where sunlight comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Sun {
    /// From behind the eye.
    Straight,
    /// From below, by a mirror behind the eye that fills the plate.
    Mirrored,
}

/// A plate faces the eye and the sun behind it. Sheets of many times its area stand beside it along the sunlight, which passes
/// them: the automatic radius is far too wide for the plate.
fn scene(sun: Sun, sheets: u32) -> Scene {
    let corner = DVec3::new(-0.5, -0.5, 0.0) * SIDE_M - DISTANCE_M * DVec3::Z;
    let [x, y] = [DVec3::X, DVec3::Y].map(|axis| SIDE_M * axis);
    let sheets = (0..sheets).map(|i| {
        let beside = corner + (1.1 + 0.001 * f64::from(i)) * x;
        [beside, 2.0 * DVec3::Z, y]
    });
    let rectangles = once([corner, x, y]).chain(sheets);
    let all = rectangles.flat_map(|[corner, u, v]| quad(corner, u, v));
    let mut scene = Scene::default();
    let grey = Material::lambert("grey", [ALBEDO; 3]);
    add(&mut scene, &all.collect::<Vec<_>>(), grey);
    let mut to_sun = DVec3::Z;
    if sun == Sun::Mirrored {
        // Light from below is turned ahead; it grazes plate and sheets on its way up.
        let corner = DVec3::new(-0.55, -0.55, 1.15);
        let square = quad(corner, 1.1 * DVec3::X, 1.1 * (DVec3::Y - DVec3::Z));
        let mirror = Material {
            metallic: 1.0,
            roughness: 0.0,
            ..Material::default()
        };
        add(&mut scene, &square, mirror);
        to_sun = DVec3::NEG_Y;
    }
    add_sun(&mut scene, to_sun, IRRADIANCE);
    scene
}

/// What a plate's pictures hold, means over seeds.
struct Found {
    /// Irradiance over the sun's, by rows.
    picture: Vec<f64>,
    photons_per_m2: f64,
    radius_m: f64,
}

/// The left eye's frame, a square of `pixels`, and its renderer.
fn frame(
    library: &ShaderLibrary,
    scene: &Scene,
    settings: &RenderSettings,
    views: &[View; 2],
    pixels: u32,
) -> (Renderer, FrameResult) {
    let renderer = renderer_by(library, scene, settings, Eyes::Left, [pixels; 2]);
    let mut renderer = renderer.unwrap();
    let result = support::frame(&mut renderer, views);
    (renderer, result)
}

fn found(sun: Sun, adaptive: bool, corrected: bool) -> Found {
    let mut settings = direct_from_map(PATHS);
    // Eye, plate, perhaps mirror, sun.
    settings.photon.max_depth = if sun == Sun::Mirrored { 3 } else { 2 };
    // All that the first frame finds; caustics are thought to be few.
    settings.photon.capacity = PATHS;
    settings.photon.adaptive_radius = adaptive;
    settings.photon.edge_correction = corrected;
    settings.force.guided_photons = Force::Off;
    // The radius of caustics is half as wide.
    let sheets = if sun == Sun::Mirrored { 400 } else { 200 };
    let (scene, library) = (scene(sun, sheets), ShaderLibrary::embedded());
    let half = (0.5 * SIDE_M / DISTANCE_M).atan().to_degrees();
    let views = looking_ahead(DVec3::ZERO, half);
    let mut found = Found {
        picture: vec![0.0; SIZE * SIZE],
        photons_per_m2: 0.0,
        radius_m: 0.0,
    };
    let of_the_sun = PI / f64::from(ALBEDO * IRRADIANCE * SEEDS as f32);
    for seed in 0..SEEDS {
        settings.seed = seed;
        let (renderer, result) = frame(&library, &scene, &settings, &views, SIZE as u32);
        let picture = radiance(&renderer, Eye::Left);
        for (sum, pixel) in found.picture.iter_mut().zip(&picture) {
            *sum += of_the_sun * f64::from(pixel[0]);
        }
        let (map, radius_m) = match sun {
            Sun::Straight => (result.photons.map, renderer.radius_m()),
            Sun::Mirrored => (
                result.photons.caustics.unwrap(),
                renderer.caustic_radius_m(),
            ),
        };
        let stored = f64::from(map.stored);
        found.photons_per_m2 += stored / (SIDE_M * SIDE_M * f64::from(SEEDS));
        found.radius_m = radius_m;
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
    check_discs(Sun::Straight);
}

#[test]
fn a_disc_of_caustics_holds_as_many_photons_as_it_may_and_even_light_stays_as_bright() {
    check_discs(Sun::Mirrored);
}

fn check_discs(sun: Sun) {
    let found = [false, true].map(|adaptive| found(sun, adaptive, false));
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
    // Each radius would notice the other; that of caustics is half as wide.
    let least = match sun {
        Sun::Mirrored => SIZE / 32,
        Sun::Straight => SIZE / 16,
    };
    assert!(
        apart > least,
        "{sun:?}: {apart} columns tell the radii apart"
    );
}

#[test]
fn a_smaller_disc_needs_less_of_the_correction_at_edges() {
    let [lost, kept] = [false, true].map(|corrected| {
        let found = found(Sun::Straight, true, corrected);
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

/// Photons that discs in the plate's middle hold over those that they may, and by how many times their own photons those of other
/// rows' at the same places are expected around them. The plate lies across the grid's rows, of which each holds one cell of it.
fn held(library: &ShaderLibrary, cells: [u32; 4]) -> (f64, f64) {
    const PIXELS: u32 = 32;
    let turn = DAffine3::from_rotation_y(0.5 * PI);
    let scene = placed(scene(Sun::Straight, 10), turn);
    let quarter = (0.25 * SIDE_M / DISTANCE_M).atan().to_degrees();
    let mut views = looking_ahead(DVec3::ZERO, quarter);
    for view in &mut views {
        view.orientation = DQuat::from_rotation_y(0.5 * PI);
    }
    let (mut share, mut strangers) = (0.0, 0.0);
    // Other numbers of places, other places for rows.
    for (seed, cells) in (0..).zip(cells) {
        let mut settings = direct_from_map(PATHS);
        settings.seed = seed;
        settings.force.guided_photons = Force::Off;
        settings.photon.grid_cells_max = cells;
        settings.output.work = true;
        let (renderer, result) = frame(library, &scene, &settings, &views, PIXELS);
        let gathers = result
            .work
            .iter()
            .filter(|d| d.label == "left.photon_gather");
        let counted: u64 = gathers.map(|d| d.counts.photons_counted).sum();
        share += counted as f64 / (f64::from(PIXELS * PIXELS) * MOST_GATHERED) / 4.0;
        let (grid, _) = renderer
            .read_photon_grid(MapKind::Photons)
            .unwrap()
            .unwrap();
        assert!(grid.columns == 1 || grid.hashed_rows == 0);
        if grid.hashed_rows > 0 {
            // A box holds four cells' photons of its own; nine rows, in parts four, two places each.
            let edges = SIDE_M * f64::from(grid.inverse_edge);
            strangers += 2.0 * edges * edges / f64::from(grid.hashed_rows) / 4.0;
        }
    }
    (share, strangers)
}

#[test]
fn a_disc_holds_as_many_photons_where_rows_share_places() {
    let library = ShaderLibrary::embedded();
    // Discs of 250 of the 100,000 photons there, whose density is that of the box's 1,200: one part in a thousand too many by
    // the spread of that, and half a percent by that of all.
    let (dense, none) = held(&library, [1 << 16; 4]);
    assert!((dense - 1.0).abs() < 0.02 && none == 0.0, "{dense}");
    // Which rows share places is left to chance: what is found around a disc is h times what is there, of mean 1 when the
    // expected s of strangers are taken away; h is 1 - s or more. Of a variance v that makes discs hold the mean of 1 / h,
    // which is 1 + (h - 1)^2 / h: between 1 and 1 + v / (1 - s).
    let cells = [4500, 4400, 4300, 4200];
    let (found, strangers) = held(&library, cells);
    // Each of nine rows meets a Poisson number of strange cells, of mean s. Rows count by products of p, 1 and 1 - p, whose squares
    // are (5 / 3)^2 together, of four.
    let variance = 25.0 / 9.0 * strangers / 16.0;
    let most = 1.0 + variance / (1.0 - strangers);
    // Means over the plate's middle, some 18 edges wide, of which 2 x 2 are independent, and over four tables: four standard errors.
    let tolerance = 4.0 * (variance / (81.0 * 4.0)).sqrt();
    println!(
        "{dense} where no rows share places, else {found} of 1 to {most} +- {tolerance}, {strangers} strangers"
    );
    assert!(
        (1.0 - tolerance..most + tolerance).contains(&found),
        "{found}"
    );
    // Negative control: with the strangers there.
    let wrong = changed("shared/gather", "found -= 4.0", "found -= 0.0");
    let (uncorrected, _) = held(&wrong, cells);
    println!("{uncorrected} with the strangers");
    assert!(uncorrected < 1.0 - 2.0 * tolerance, "{uncorrected}");
}
