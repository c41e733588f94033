//! Photons near edges: what a disc over an edge loses, and what the correction gives back.

use std::f64::consts::FRAC_PI_3;

use glam::{DAffine3, DVec3};
use stereolux::renderer::Eye;
use stereolux::scene::{LightKind, Material, Scene};
use stereolux::settings::Kernel;
use stereolux::xr::Pose;

use super::hard_support::{add, add_point_light, glowing, quad};
use super::photon_map::map_only;
use crate::suite::support::{assert_clean, frame, parallel_views, radiance, renderer, square_fov};

const PATHS: u32 = 100_000;
const ALBEDO: f32 = 0.5;
const IRRADIANCE: f32 = 3.0;
/// The plate: so many metres square, at this distance before the eye. Pixels of 1/16 m end at its edges.
const SIDE_M: f64 = 1.5;
const DISTANCE_M: f64 = 2.0;
const SIZE: u32 = 64;
const RADIUS_M: f64 = 0.375;
const BAR_M: f64 = 0.5 * RADIUS_M;
/// As in `passes/photon_edges.wesl`.
const MOST_TRIALS: i32 = 4;
const MOST_HALVED: i32 = 3;
const PATHS_PER_TRIED: f64 = 2.0;

/// Mean, and mean square, of the share of its light that a photon leaves on a rectangle, over photons spread evenly on it.
/// `corrected`: times its weight. Of a disc that covers a share c, n trials find surface with probability c (1 - c)^(n - 1);
/// without success its radius is halved.
fn kept([width, height]: [f64; 2], kernel: Kernel, corrected: bool) -> [f64; 2] {
    const STEPS: usize = 48;
    let middle = |i: usize| (i as f64 + 0.5) / STEPS as f64;
    let weight = |q: f64| match kernel {
        _ if q > 1.0 => 0.0,
        Kernel::Constant => 1.0,
        Kernel::Epanechnikov => 1.0 - q * q,
        Kernel::Cone => 1.0 - q,
    };
    let disc: Vec<[f64; 3]> = (0..STEPS * STEPS)
        .map(|i| [i % STEPS, i / STEPS].map(|i| 2.0 * middle(i) - 1.0))
        .map(|[x, y]| [x, y, weight(x.hypot(y))])
        .collect();
    let whole: f64 = disc.iter().map(|[.., weight]| weight).sum();
    let covered = |at: [f64; 2], radius_m: f64| {
        let inside = disc.iter().filter(|[x, y, _]| {
            let point = [at[0] + radius_m * x, at[1] + radius_m * y];
            (0.0..width).contains(&point[0]) && (0.0..height).contains(&point[1])
        });
        inside.map(|[.., weight]| weight).sum::<f64>() / whole
    };
    let (mut sum, mut squares) = (0.0, 0.0);
    for i in 0..STEPS * STEPS {
        let at = [width * middle(i % STEPS), height * middle(i / STEPS)];
        let own = covered(at, RADIUS_M);
        let mut tried = vec![(own, 1.0)];
        for halved in (0..=MOST_HALVED).take_while(|_| corrected) {
            let (_, failed) = tried.pop().unwrap();
            let c = covered(at, RADIUS_M / f64::from(1 << halved));
            let first = if halved == 0 { 1.0 } else { PATHS_PER_TRIED };
            tried.extend((0..MOST_TRIALS).map(|misses| {
                let weight = first + PATHS_PER_TRIED * f64::from(misses);
                (weight * c, failed * c * (1.0 - c).powi(misses))
            }));
            tried.push((own, failed * (1.0 - c).powi(MOST_TRIALS)));
        }
        let mean = |power| tried.iter().map(|(left, p)| left.powi(power) * p).sum();
        let both = |tried: f64, other: f64| other + (tried - other) / PATHS_PER_TRIED;
        sum += both(mean(1), own);
        squares += both(mean(2), own * own);
    }
    [sum, squares].map(|sum| sum / (STEPS * STEPS) as f64)
}

/// A plate of a height under a sun that stands behind the eye; with `block`, a block stands on its right half.
fn plate(height_m: f64, block: bool) -> Scene {
    let mut scene = Scene::default();
    let at = |x: f64, y: f64| DVec3::new(x - SIDE_M / 2.0, y - SIDE_M / 2.0, -DISTANCE_M);
    let [right, up] = [DVec3::X, DVec3::Y].map(|axis| SIDE_M * axis);
    let mut quads = vec![quad(at(0.0, SIDE_M - height_m), right, height_m * DVec3::Y)];
    if block {
        let middle = at(SIDE_M / 2.0, 0.0);
        quads.push(quad(middle, DVec3::Z, up));
        quads.push(quad(middle + DVec3::Z, right / 2.0, up));
    }
    for quad in &quads {
        add(&mut scene, quad, Material::lambert("gray", [ALBEDO; 3]));
    }
    add_point_light(&mut scene, DVec3::ZERO, IRRADIANCE);
    scene.lights[0].kind = LightKind::Directional;
    scene
}

/// What the eye sees by direct light from the map.
fn seen(scene: &Scene, kernel: Kernel, corrected: bool) -> Vec<[f32; 3]> {
    let settings = map_only(PATHS, |s| {
        s.photon.max_depth = 2;
        s.photon.radius_m = RADIUS_M;
        s.photon.kernel = kernel;
        s.photon.edge_correction = corrected;
    });
    let mut renderer = renderer(scene, &settings, [SIZE; 2]);
    let views = parallel_views(Pose::IDENTITY, 0.0, square_fov(45.0));
    frame(&mut renderer, &views);
    let image = radiance(&renderer, Eye::Left);
    assert_clean(&image, "photons near edges");
    image
}

/// Radiance of the plate's lit part over that of an endless plane.
fn found(scene: &Scene, lit: [f64; 2], kernel: Kernel, corrected: bool) -> f64 {
    let image = seen(scene, kernel, corrected);
    // A plane across the view: every pixel shows as much of it.
    let pixel_m = 2.0 * DISTANCE_M / f64::from(SIZE);
    let [columns, rows] = lit.map(|metres| (metres / pixel_m).round() as usize);
    let first = (SIZE as usize - (SIDE_M / pixel_m).round() as usize) / 2;
    let sum: f64 = (first..first + rows)
        .flat_map(|y| (first..first + columns).map(move |x| y * SIZE as usize + x))
        .map(|pixel| f64::from(image[pixel][0]))
        .sum();
    let endless = f64::from(ALBEDO) * f64::from(IRRADIANCE) / std::f64::consts::PI;
    sum / (columns * rows) as f64 / endless
}

#[test]
fn a_plate_keeps_the_light_that_its_edges_lose() {
    let open = (plate(SIDE_M, false), [SIDE_M, SIDE_M]);
    // Without the block's hiding it, the floor under it would count as lit.
    let walled = (plate(SIDE_M, true), [SIDE_M / 2.0, SIDE_M]);
    for ((scene, lit), kernel) in [
        (&open, Kernel::Constant),
        (&open, Kernel::Epanechnikov),
        (&open, Kernel::Cone),
        (&walled, Kernel::Constant),
        (&(plate(BAR_M, false), [SIDE_M, BAR_M]), Kernel::Constant),
    ] {
        let [lost, _] = kept(*lit, kernel, false);
        let [right, square] = kept(*lit, kernel, true);
        // Paths start on a disc around the scene; a photon's power is the irradiance times the disc over the paths, so the
        // mean's variance is at most the mean square over the number that lands. Five standard errors; and a pixel's middle
        // stands for the pixel, (1/16 m)^2 / 24 times the slope at the edges over the area: 0.001 in the plate, 0.006 in the bar.
        let radius_squared = SIDE_M * SIDE_M / 2.0 + 0.25;
        let landing = f64::from(PATHS) * lit[0] * lit[1] / (std::f64::consts::PI * radius_squared);
        let tolerance = 5.0 * (square / landing).sqrt() + 0.001 * SIDE_M / lit[1];
        let [plain, corrected] = [false, true].map(|on| found(scene, *lit, kernel, on));
        let what = format!(
            "{kernel:?} on {lit:?}: {plain} and {corrected}, {lost} and {right} +- {tolerance}"
        );
        println!("{what}");
        assert!((plain - lost).abs() < tolerance, "{what}, not {lost}");
        assert!((corrected - right).abs() < tolerance, "{what}, not {right}");
        // Each would notice the other.
        assert!(right - lost > 2.0 * tolerance, "{what}");
        // Three quarters of what is missing at least: of a corner's photons, the trials give up on some. Of a bar more than half.
        let missing = if lit[1] < RADIUS_M { 0.45 } else { 0.25 };
        assert!(1.0 - right < missing * (1.0 - lost), "{what}, {right} of 1");
    }
}

/// Under a lamp that hangs lower than the radius, discs lie on the floor as they do in the open: nothing is missing there.
#[test]
fn in_a_gap_narrower_than_the_radius_no_photon_is_corrected() {
    for height_m in [0.2, 0.5, 0.9].map(|share| share * RADIUS_M) {
        let mut scene = Scene::default();
        let corner = DVec3::new(-6.0, -height_m / 2.0, 6.0);
        let floor = quad(corner, 12.0 * DVec3::X, -12.0 * DVec3::Z);
        let above = corner + height_m * DVec3::Y - 12.0 * DVec3::Z;
        let lamp = quad(above, 12.0 * DVec3::X, 12.0 * DVec3::Z);
        add(&mut scene, &floor, Material::lambert("gray", [ALBEDO; 3]));
        add(&mut scene, &lamp, glowing([1.0; 3]));
        let images = [false, true].map(|corrected| seen(&scene, Kernel::Constant, corrected));
        // Rows that see the floor less than five radii away; its edges are farther from there than a disc reaches.
        let near = (height_m / 2.0) / (5.0 * RADIUS_M);
        let first = (f64::from(SIZE) * 0.5 * (1.0 + near)).ceil() as usize;
        let [plain, corrected] = images.map(|image| image[first * SIZE as usize..].to_vec());
        let mean = plain.iter().map(|c| f64::from(c[0])).sum::<f64>() / plain.len() as f64;
        assert!((mean / f64::from(ALBEDO) - 1.0).abs() < 0.2, "{mean}");
        assert!(plain == corrected, "a gap of {height_m} m");
    }
}

/// Two facets with one shading normal shine alike up to their ridge, though a sun's photons are denser on the one that faces it:
/// each stands for an area of the facet that it lies on, wherever it is gathered.
#[test]
fn smooth_facets_shine_alike_on_both_sides_of_their_ridge() {
    // By more, photons beyond the ridge would lie too high to count.
    const TILT: f64 = 0.25;
    let mut scene = Scene::default();
    let slope = DVec3::new(SIDE_M, 0.0, SIDE_M * TILT.tan());
    let along = 2.0 * SIDE_M * DVec3::Y;
    let ridge = DVec3::new(0.0, -SIDE_M, -DISTANCE_M);
    for (corner, across) in [
        (ridge - slope, slope),
        (ridge, slope * DVec3::new(1.0, 1.0, -1.0)),
    ] {
        let facet = quad(corner, across, along);
        add(&mut scene, &facet, Material::lambert("gray", [ALBEDO; 3]));
    }
    for mesh in &mut scene.meshes {
        mesh.normals.fill([0.0, 0.0, 1.0]);
    }
    add_point_light(&mut scene, DVec3::ZERO, IRRADIANCE);
    scene.lights[0].kind = LightKind::Directional;
    let sun = scene.nodes.last_mut().unwrap();
    sun.parent_from_node = DAffine3::from_rotation_y(-FRAC_PI_3);
    let image = seen(&scene, Kernel::Constant, false);
    let expected = f64::from(ALBEDO * IRRADIANCE) * FRAC_PI_3.cos() / std::f64::consts::PI;
    // A ball around a place beside the ridge cuts more out of the facets than out of a plane: less than 1 % here. A column's pixels
    // share the photons of some ten discs, of 500 on the darker facet: 2 %. By the gather's own facet they would be 0.7 and 1.8.
    for column in [SIZE / 2 - 1, SIZE / 2] {
        let rows = (SIZE / 4..3 * SIZE / 4).map(|row| image[(row * SIZE + column) as usize]);
        let mean = rows.map(|c| f64::from(c[0])).sum::<f64>() / f64::from(SIZE / 2);
        let share = mean / expected;
        assert!((share - 1.0).abs() < 0.06, "column {column}: {share}");
    }
}
