//! The photon map: power, grid, gather against brute force, extremes of radius and count, overflow.

use glam::{DAffine3, DVec3};
use stereolux::renderer::{Eye, MapKind, PhotonGrid, Renderer, SortedPhoton};
use stereolux::scene::Scene;
use stereolux::settings::{DirectLight, Kernel, Method, RenderSettings, Reuse};
use stereolux::xr::View;

use super::bsdf_probe::wide;
use super::hard_support::is_black;
use crate::suite::embedded_scenes::sphere;
pub use crate::suite::support::start_views as views;
use crate::suite::support::{
    Triangles, assert_clean, bits, both, builtin, frame, hit_in_world, hit_rays, mean, pixel_ray,
    placed, radiance, rendered, renderer, settings,
};

/// Each eye by itself, direct light from the map: the picture shows photons and nothing else.
pub fn map_only(count: u32, change: impl FnOnce(&mut RenderSettings)) -> RenderSettings {
    settings(|s| {
        s.reuse = Reuse::Off;
        s.photon.count = count;
        s.photon.direct = DirectLight::Map;
        change(s);
    })
}

pub fn photons(renderer: &Renderer) -> Vec<SortedPhoton> {
    renderer.read_photons(MapKind::Photons).unwrap().unwrap()
}

pub fn grid(renderer: &Renderer) -> (PhotonGrid, Vec<u32>) {
    let grid = renderer.read_photon_grid(MapKind::Photons);
    grid.unwrap().unwrap()
}

fn flux(photons: &[SortedPhoton]) -> f64 {
    photons.iter().map(|photon| f64::from(photon.flux[0])).sum()
}

/// Twin of `grid_cell` in `shaders/shared/grid.wesl`.
pub fn grid_cell(grid: &PhotonGrid, position: [f32; 3]) -> [u32; 3] {
    let padding = [grid.columns, 1, 1];
    [0, 1, 2].map(|axis| {
        let cells = grid.inverse_edge * padding[axis] as f32;
        let at = (position[axis] - grid.origin[axis]) * cells;
        at.clamp(
            padding[axis] as f32,
            (grid.dims[axis] - padding[axis] - 1) as f32,
        ) as u32
    })
}

/// With `grid_row_start`.
fn table_cell(grid: &PhotonGrid, position: [f32; 3]) -> usize {
    let cell = grid_cell(grid, position);
    let row = if grid.hashed_rows == 0 {
        (cell[2] * grid.dims[1] + cell[1]) * grid.dims[0]
    } else {
        let mut h = cell[1].wrapping_mul(73_856_093) ^ cell[2].wrapping_mul(19_349_663);
        h ^= h >> 15;
        h = h.wrapping_mul(0x2c1b_3c6d);
        h ^= h >> 12;
        h % grid.hashed_rows
    };
    (row + cell[0]) as usize
}

/// Photons that do not lie in the run of their own cell.
fn astray(grid: &PhotonGrid, starts: &[u32], photons: &[SortedPhoton]) -> usize {
    photons
        .iter()
        .enumerate()
        .filter(|(index, photon)| {
            let cell = table_cell(grid, photon.position);
            !(starts[cell] as usize..starts[cell + 1] as usize).contains(index)
        })
        .count()
}

#[test]
fn direct_photons_carry_the_lights_power_exactly() {
    let scene = builtin("sphere");
    let settings = map_only(20_000, |s| s.photon.max_depth = 2);
    let mut renderer = renderer(&scene, &settings, [8, 8]);
    let result = frame(&mut renderer, &views(&scene, 40.0));
    // One light, closed wall: every path stores one photon of the whole power. Rounding only: 4 pi I in f32.
    let power = 4.0 * std::f64::consts::PI * f64::from(sphere::LIGHT_INTENSITY);
    let map = result.photons.map;
    let counts = (map.emitted, map.stored, map.dropped, map.paths_kept);
    assert_eq!(counts, (20_000, 20_000, 0, 20_000));
    let found = flux(&photons(&renderer)) / f64::from(map.paths_kept);
    assert!((found / power - 1.0).abs() < 1e-5, "{found} W of {power} W");
    let said = renderer.scene().total_power_w()[0];
    assert!((said / power - 1.0).abs() < 1e-5, "the scene says {said} W");
}

#[test]
fn reflected_photons_carry_the_geometric_series() {
    let scene = builtin("sphere");
    let paths = 20_000_u32;
    let depth = 6;
    let settings = map_only(paths, |s| s.photon.max_depth = depth);
    let renderer = rendered(&scene, &settings, [8, 8], &views(&scene, 40.0));
    // Photons of power P survive each reflection with chance a = 1/2: their number per path is geometric, cut at
    // depth - 1. Mean m = sum of a^k for k < depth - 1; the variance of a full geometric count is a / (1 - a)^2 = 2 at
    // most, so the mean over N paths has a standard deviation of at most sqrt(2 / N); five of those.
    let a = f64::from(sphere::ALBEDO);
    let expected: f64 = (0..depth as i32 - 1).map(|k| a.powi(k)).sum();
    let power = 4.0 * std::f64::consts::PI * f64::from(sphere::LIGHT_INTENSITY);
    let found = flux(&photons(&renderer)) / f64::from(paths) / power;
    let tolerance = 5.0 * (2.0 / f64::from(paths)).sqrt();
    let off = (found - expected).abs();
    assert!(off < tolerance, "{found} for {expected} +- {tolerance}");
}

#[test]
fn every_photon_lies_in_the_run_of_its_cell() {
    let scene = builtin("cornell");
    for (radius_m, cells, hashed, columns) in [
        (0.05, 2_097_152, false, 4),
        (0.02, 4096, true, 1),
        (1e-6, 2_097_152, true, 1),
        (5.0, 64, false, 2),
    ] {
        let settings = map_only(5000, |s| {
            s.photon.radius_m = radius_m;
            s.photon.grid_cells_max = cells;
        });
        let mut renderer = renderer(&scene, &settings, [8, 8]);
        let result = frame(&mut renderer, &views(&scene, 19.0));
        let (grid, starts) = grid(&renderer);
        let photons = photons(&renderer);
        let what = format!("radius {radius_m}, at most {cells} cells");
        assert_eq!(photons.len(), result.photons.map.stored as usize, "{what}");
        assert!(photons.len() > 5000, "{what}: {} photons", photons.len());
        assert_eq!(grid.hashed_rows > 0, hashed, "{what}");
        let count = grid.cell_count;
        assert!(count <= cells, "{what}: {count} cells");
        // No neighbour may be missed, no runs overlap, and no photon be without a cell.
        assert!(grid.inverse_edge <= 1.0 / radius_m as f32, "{what}");
        assert_eq!(grid.columns, columns, "{what}");
        assert_eq!(starts[0], 0, "{what}");
        assert!(starts.is_sorted(), "{what}: runs overlap");
        let end = *starts.last().unwrap() as usize;
        assert_eq!(end, photons.len(), "{what}");
        assert_eq!(astray(&grid, &starts, &photons), 0, "{what}");
        // Negative control: neighbours exchanged across the list are noticed, where there is more than one cell.
        let mut shuffled = photons.clone();
        shuffled.reverse();
        if starts[starts.len() / 2] != 0 && radius_m < 1.0 {
            let wrong = astray(&grid, &starts, &shuffled);
            assert!(wrong > photons.len() / 2, "{what}: the check is blind");
        }
        // The same frame again gives the same order, bit for bit: sums over runs do not depend on scheduling.
        let again = rendered(&scene, &settings, [8, 8], &views(&scene, 19.0));
        assert!(self::photons(&again) == photons, "{what}: another order");
    }
}

/// Direction of flight and normal.
pub fn directions(photon: &SortedPhoton) -> (DVec3, DVec3) {
    (-wide(photon.towards_light), wide(photon.normal))
}

/// Factor on a photon's flux where it is gathered: it arrived per area of the surface that it lies on, and is scattered by the
/// cosine to the one that gathers (`shaders/shared/surface.wesl`, gather_shading_correction).
pub fn per_own_area(direction: DVec3, photon_normal: DVec3, normal: DVec3) -> f64 {
    const MOST_CORRECTION: f64 = 8.0;
    const ONE_FACET: f64 = 0.99999;
    if photon_normal.dot(normal) > ONE_FACET {
        return 1.0;
    }
    let [own, here] = [photon_normal, normal].map(|normal| direction.dot(normal).abs());
    (here / own.max(1e-6)).min(MOST_CORRECTION)
}

/// By how much a photon `offset` from a point clears the limits of `shaders/shared/gather_limits.wesl`: as a cosine, and in
/// metres. One is negative if it lies on another surface.
pub fn clearances(offset: DVec3, photon_normal: DVec3, normal: DVec3, min_cos: f64) -> [f64; 2] {
    let slope = ((1.0 - min_cos) / 2.0).sqrt();
    let rise = offset.dot(normal).abs();
    [
        photon_normal.dot(normal) - min_cos,
        slope * offset.length() - rise,
    ]
}

/// Whether it clears the default limits.
pub fn on_one_surface(offset: DVec3, photon_normal: DVec3, normal: DVec3) -> bool {
    let min_cos = RenderSettings::default().photon.normal_min_cos;
    let clear = clearances(offset, photon_normal, normal, min_cos);
    clear.into_iter().all(|by| by >= 0.0)
}

/// Radiance of one Lambert pixel from every photon there is, in f64; red channel.
fn brute_force(
    renderer: &Renderer,
    scene: &Scene,
    triangles: &Triangles,
    photons: &[SortedPhoton],
    view: &View,
    pixel: u32,
) -> Option<f64> {
    let ray = pixel_ray(view, pixel as usize, renderer.size());
    let (t, normal, material) = triangles.closest(ray.origin, ray.direction, 0.0)?;
    // The published left wall is no plane; its two triangles share smoothed normals, and the gather weighs photons by the
    // ratio of two cosines there. Flat surfaces are what this sum is exact for.
    if scene.materials[material as usize].name == "red" {
        return None;
    }
    let material = &scene.materials[material as usize];
    let normal = normal.normalize() * -normal.dot(ray.direction).signum();
    let point = ray.origin + ray.direction * t - renderer.origin_in_world();
    let radius = renderer.radius_m();
    let paths = renderer.photon_map()?.counters().paths_kept;
    let mut sum = 0.0;
    for photon in photons {
        let at = DVec3::from(photon.position.map(f64::from));
        let own_radius = radius / f64::from(photon.narrower_by);
        let share = at.distance_squared(point) / (own_radius * own_radius);
        let (direction, photon_normal) = directions(photon);
        let is_near = share <= 1.0 && on_one_surface(at - point, photon_normal, normal);
        if is_near && direction.dot(normal) < 0.0 {
            let flux = f64::from(photon.flux[0]) * per_own_area(direction, photon_normal, normal);
            sum += 2.0 * (1.0 - share) * flux / own_radius.powi(2);
        }
    }
    let reflected = f64::from(material.base_color[0]) / std::f64::consts::PI.powi(2) * sum;
    Some(f64::from(material.emission[0]) + reflected / f64::from(paths))
}

/// Holds pixels of the left eye's image against the sum over these photons, where there is a sum and it is not black.
/// Returns how many there were.
pub fn assert_sums(
    renderer: &Renderer,
    scene: &Scene,
    photons: &[SortedPhoton],
    view: &View,
    pixels: impl IntoIterator<Item = u32>,
    tolerance: f64,
    what: &str,
) -> usize {
    let triangles = Triangles::of(scene);
    let image = radiance(renderer, Eye::Left);
    assert_clean(&image, what);
    let mut compared = 0;
    for pixel in pixels {
        let sum = brute_force(renderer, scene, &triangles, photons, view, pixel);
        let Some(expected) = sum.filter(|sum| *sum > 0.0) else {
            continue;
        };
        compared += 1;
        let found = f64::from(image[pixel as usize][0]);
        let off = (found / expected - 1.0).abs();
        assert!(off < tolerance, "{what}, {pixel}: {found} for {expected}");
    }
    compared
}

#[test]
fn gathering_over_the_grid_is_a_sum_over_all_photons() {
    let scene = builtin("cornell");
    let size = [24, 24];
    let mut images = Vec::new();
    for cells in [2_097_152, 16_384, 2048] {
        let settings = map_only(20_000, |s| {
            s.photon.radius_m = 0.03;
            s.photon.grid_cells_max = cells;
            // Weight 0 at the rim: a photon that f32 and f64 place on two sides of it does not show.
            s.photon.kernel = Kernel::Epanechnikov;
        });
        let views = views(&scene, 19.0);
        let renderer = rendered(&scene, &settings, size, &views);
        let photons = photons(&renderer);
        // Two dense grids, one without columns, and one hashed.
        assert_eq!(grid(&renderer).0.hashed_rows > 0, cells == 2048);
        assert_eq!(grid(&renderer).0.columns > 1, cells > 16_384);
        // Positions agree to 1e-6 m, so a weight is off by 4 x 1e-6 / 0.03 = 1e-4 at most, single terms of a sum of
        // several; normals packed in 11 bits and directions in 16 move photons over a threshold only at grazing
        // angles, where one of some twenty photons may be gained or lost: rare, and counted below.
        let pixels = (0..24 * 24).step_by(7);
        let what = format!("{cells} cells");
        let compared = assert_sums(&renderer, &scene, &photons, &views[0], pixels, 2e-3, &what);
        assert!(compared > 40, "only {compared} pixels");
        images.push(radiance(&renderer, Eye::Left));
    }
    // Hashed rows hold the same photons in the same order: nothing but the table differs.
    let [dense, hashed] = [1, 2].map(|at: usize| bits(&images[at]));
    assert!(dense == hashed, "dense and hashed grids disagree");
}

#[test]
fn a_radius_larger_than_the_scene_gathers_everything() {
    let scene = builtin("cornell");
    // All photons in one cell: sorting and gathering one long run.
    let settings = map_only(200_000, |s| {
        s.photon.radius_m = 10.0;
        s.photon.kernel = Kernel::Epanechnikov;
    });
    let mut renderer = renderer(&scene, &settings, [8, 8]);
    let views = views(&scene, 19.0);
    let result = frame(&mut renderer, &views);
    let (grid, starts) = grid(&renderer);
    assert_eq!(grid.dims, [9, 3, 3], "one cell and its padding");
    // All photons share the middle cell.
    assert_eq!(starts[40 + 1] - starts[40], result.photons.map.stored);
    let photons = photons(&renderer);
    // Ceiling, back wall, block and floor. A running f32 sum of n positive terms is off by n 2^-24 at the very worst:
    // 3e5 / 1.7e7 = 2 %.
    let (pixels, what) = ([12, 27, 36, 60], "huge radius");
    let compared = assert_sums(&renderer, &scene, &photons, &views[0], pixels, 0.02, what);
    assert_eq!(compared, 4);
}

#[test]
fn no_photons_and_vanishing_radii_give_clean_images() {
    let scene = builtin("cornell");
    let views = views(&scene, 19.0);
    let direct_only = settings(|s| s.photon.max_depth = 2);
    let direct_only = rendered(&scene, &direct_only, [24, 24], &views);
    let direct_only = bits(&radiance(&direct_only, Eye::Left));
    for (count, radius_m) in [(0, 0.0), (0, 0.05), (3000, 1e-9), (3000, 1e-30)] {
        let settings = settings(|s| {
            s.photon.count = count;
            s.photon.radius_m = radius_m;
        });
        let mut renderer = renderer(&scene, &settings, [24, 24]);
        let result = frame(&mut renderer, &views);
        let [left, right] = both(&renderer);
        let what = format!("{count} photons, radius {radius_m}");
        assert_clean(&left, &what);
        assert_clean(&right, &what);
        // No photon is that near: direct light is all there is.
        assert!(mean(&left) > 0.0 && bits(&left) == direct_only, "{what}");
        assert_eq!(result.photons.map.emitted, count, "{what}");
        assert_eq!(result.photons.map.stored > 0, count > 0, "{what}");
    }
}

#[test]
fn overflow_is_counted_and_loses_no_energy() {
    let scene = builtin("sphere");
    let size = [16, 16];
    let render = |capacity: u32| {
        let settings = map_only(20_000, |s| {
            s.photon.capacity = capacity;
            s.photon.radius_m = 0.25;
        });
        let mut renderer = renderer(&scene, &settings, size);
        let views = views(&scene, 40.0);
        let result = frame(&mut renderer, &views);
        let mean = mean(&radiance(&renderer, Eye::Left));
        let counters = renderer.photon_map().unwrap().counters();
        (mean, result.photons.map, counters)
    };
    let (whole, map, _) = render(0);
    assert_eq!((map.dropped, map.paths_kept), (0, 20_000));
    let (capped, map, counters) = render(1000);
    assert_eq!((map.capacity, map.emitted), (1000, 20_000));
    assert!(map.stored <= 1000 && map.stored > 900, "{map:?}");
    assert!(map.dropped > 0 && map.paths_kept < 20_000, "{map:?}");
    // Every photon is stored or counted as dropped.
    assert_eq!(map.stored + map.dropped, counters.demanded);
    // About 500 paths of 2 photons each are left, of which an image of the sphere's half sees half: relative standard
    // deviation about 1 / sqrt(250) = 6 %. Four of those; lost energy would show as a factor of 40.
    let off = (capped / whole - 1.0).abs();
    assert!(off < 0.25, "{capped} with 1000 photons, {whole} with all");
}

#[test]
fn an_automatic_buffer_grows_for_the_next_frame() {
    // A white room keeps photons alive: more are stored than the first guess of two per path.
    let mut scene = builtin("sphere");
    scene.materials[0].base_color = [0.95, 0.95, 0.95, 1.0];
    let settings = map_only(4096, |s| {
        s.photon.every_frame = true;
        s.photon.max_depth = 32;
    });
    let mut renderer = renderer(&scene, &settings, [8, 8]);
    let views = views(&scene, 40.0);
    let first = frame(&mut renderer, &views).photons.map;
    assert!(first.dropped > 0 && first.paths_kept < 4096, "{first:?}");
    let second = renderer.render_frame(&views, 1, |_| {}).unwrap().photons;
    assert!(second.traced);
    let second = second.map;
    assert!(second.capacity > first.capacity, "{second:?}");
    assert_eq!((second.dropped, second.paths_kept), (0, 4096));
}

#[test]
fn a_static_map_is_traced_once_and_every_frame_traces_anew() {
    let scene = builtin("cornell");
    let views = views(&scene, 19.0);
    for every_frame in [false, true] {
        let settings = map_only(2000, |s| s.photon.every_frame = every_frame);
        let mut renderer = renderer(&scene, &settings, [8, 8]);
        let frames: Vec<_> = (0..3)
            .map(|index| {
                let result = renderer.render_frame(&views, index, |_| {}).unwrap();
                (result.photons.traced, photons(&renderer))
            })
            .collect();
        for (index, (traced, map)) in frames.iter().enumerate().skip(1) {
            assert_eq!(*traced, every_frame, "frame {index}");
            let is_same = *map == frames[index - 1].1;
            assert_eq!(is_same, !every_frame, "frame {index}");
        }
    }
}

#[test]
fn a_moving_head_gathers_from_a_map_that_stays() {
    // Photons are kept relative to the head that traced them; 1e6 m out, an offset in f32 would be off by centimetres.
    let far = DVec3::new(1.0e6 + 0.123, 0.377, -1.0e6 + 0.711);
    let scene = placed(builtin("cornell"), DAffine3::from_translation(far));
    let settings = map_only(20_000, |s| {
        s.photon.radius_m = 0.04;
        s.photon.kernel = Kernel::Epanechnikov;
    });
    let mut renderer = renderer(&scene, &settings, [24, 24]);
    let mut moved = views(&scene, 19.0);
    frame(&mut renderer, &moved);
    let photons = photons(&renderer);
    let traced_at = renderer.photon_map().unwrap().traced_at().unwrap().0;
    for view in &mut moved {
        view.position_in_world += DVec3::new(0.11, -0.07, -0.23);
    }
    let result = renderer.render_frame(&moved, 1, |_| {}).unwrap();
    assert!(!result.photons.traced);
    // Brute force in the photons' own space: put the renderer's origin where they were traced.
    let shift = traced_at - renderer.origin_in_world();
    let carried: Vec<SortedPhoton> = photons
        .iter()
        .map(|photon| {
            let mut photon = *photon;
            for axis in 0..3 {
                photon.position[axis] = (f64::from(photon.position[axis]) + shift[axis]) as f32;
            }
            photon
        })
        .collect();
    let pixels = (0..24 * 24).step_by(11);
    // As above, with the rounding of 1e6 m in f64 (1e-10 m) far below.
    let view = &moved[0];
    let compared = assert_sums(&renderer, &scene, &carried, view, pixels, 2e-3, "moved");
    assert!(compared > 20);
    // The path from eye to photon is real: the hit lies where the f64 ray ends.
    let rays = hit_rays(&renderer, Eye::Left);
    let middle = 12 * 24 + 12;
    let hit = hit_in_world(view, rays[middle]);
    let ray = pixel_ray(view, middle, [24, 24]);
    let first = Triangles::of(&scene).closest(ray.origin, ray.direction, 0.0);
    let (t, ..) = first.unwrap();
    assert!(hit.distance(ray.origin + ray.direction * t) < 1e-5);
}

#[test]
fn scenes_without_lights_emit_nothing() {
    let mut scene = builtin("cornell");
    for material in &mut scene.materials {
        material.emission = [0.0; 3];
    }
    for method in [Method::Photon, Method::Path] {
        let settings = settings(|s| s.method = method);
        let mut renderer = renderer(&scene, &settings, [16, 16]);
        let result = frame(&mut renderer, &views(&scene, 19.0));
        let map = result.photons.map;
        assert_eq!((map.emitted, map.stored), (0, 0));
        assert!(!result.photons.traced);
        let images = both(&renderer);
        assert!(images.iter().all(|eye| is_black(eye)), "{method:?}");
        assert!(result.stereo.reused > 0, "surfaces are still seen");
    }
}
