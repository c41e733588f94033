//! The ways to gather that the default is compared with: kd-tree, k nearest, one fused kernel, loads by workgroup.

use glam::{DQuat, DVec3};
use stereolux::gpu::ShaderLibrary;
use stereolux::renderer::{Eye, MapKind, RenderError, Renderer, SortedPhoton};
use stereolux::scene::{Material, Scene};
use stereolux::settings::{
    DirectLight, Eyes, Force, Kernel, Loads, Method, PhotonEstimate, RenderSettings, Reuse,
    Schedule, Search,
};

use super::hard_support::{add, eyes_at, quad};
use super::photon_map::{
    assert_sums, directions, grid, map_only, on_one_surface, per_own_area, photons, views,
};
use super::support::{
    Triangles, assert_clean, bits, both_bits, builtin, mean, pixel_ray, play, radiance, rendered,
    renderer, renderer_by, settings, strays,
};

pub type Change = fn(&mut RenderSettings);

pub const KD: Change = |s| s.photon.search = Search::KdTree;
pub const NEAREST: Change = |s| s.photon.estimate = PhotonEstimate::Nearest;
pub const KD_NEAREST: Change = |s| {
    KD(s);
    NEAREST(s);
};
const FUSED: Change = |s| s.photon.schedule = Schedule::Fused;
const COOPERATIVE: Change = |s| s.photon.loads = Loads::Cooperative;
/// Each way with its own pass.
const WAYS: [(&str, Change); 5] = [
    ("kd_gather", KD),
    ("nearest_gather", NEAREST),
    ("kd_nearest_gather", KD_NEAREST),
    ("eye_fused", FUSED),
    ("shared_gather", COOPERATIVE),
];

/// A sum of n terms that are not negative, in f32, is off by n 2^-24 of itself at the very worst, whatever the order, and
/// a term has some thirty roundings behind it; two such sums differ by twice that.
fn rounding(terms: usize) -> f32 {
    2.0 * (terms as f32 + 30.0) * 2.0_f32.powi(-24)
}

fn position(photon: &SortedPhoton) -> DVec3 {
    DVec3::from(photon.position.map(f64::from))
}

/// Most photons that any ball of this radius can hold: every such ball that holds one lies in the ball of twice the
/// radius around it.
fn fullest_ball(photons: &[SortedPhoton], radius_m: f64) -> usize {
    let at: Vec<DVec3> = photons.iter().map(position).collect();
    let within = |center: &DVec3| {
        let near = |other: &&DVec3| other.distance_squared(*center) <= 4.0 * radius_m * radius_m;
        at.iter().filter(near).count()
    };
    at.iter().map(within).max().unwrap_or(0)
}

fn sorted_bits(photons: &[SortedPhoton]) -> Vec<[u32; 16]> {
    let mut all: Vec<[u32; 16]> = photons.iter().copied().map(bytemuck::cast).collect();
    all.sort_unstable();
    all
}

/// What is wrong with a tree in heap order; nothing if it is a kd-tree whose nodes part the longest side of their box.
fn tree_faults(nodes: &[[f32; 4]]) -> Vec<String> {
    fn walk(
        nodes: &[[f32; 4]],
        node: usize,
        lower: [f32; 3],
        upper: [f32; 3],
        faults: &mut Vec<String>,
    ) {
        let Some(&[x, y, z, axis]) = nodes.get(node) else {
            return;
        };
        let at = [x, y, z];
        for side in 0..3 {
            if at[side] < lower[side] || at[side] > upper[side] {
                faults.push(format!("node {node} lies beyond its box, axis {side}"));
            }
        }
        let axis = axis as usize;
        if 2 * node + 1 >= nodes.len() {
            return;
        }
        let extent = |side: usize| upper[side] - lower[side];
        if (0..3).any(|side| extent(side) > extent(axis)) {
            faults.push(format!("node {node} parts a shorter side, axis {axis}"));
        }
        let (mut left, mut right) = (upper, lower);
        left[axis] = at[axis];
        right[axis] = at[axis];
        walk(nodes, 2 * node + 1, lower, left, faults);
        walk(nodes, 2 * node + 2, right, upper, faults);
    }
    let bound = |pick: fn(f32, f32) -> f32| {
        [0, 1, 2].map(|axis| {
            let along = nodes.iter().map(|node| node[axis]);
            along.reduce(pick).unwrap_or(0.0)
        })
    };
    let mut faults = Vec::new();
    walk(nodes, 0, bound(f32::min), bound(f32::max), &mut faults);
    faults
}

fn nodes(renderer: &Renderer, count: usize) -> Vec<[f32; 4]> {
    let nodes = renderer.read_kd_nodes(MapKind::Photons, count as u32);
    nodes.unwrap().expect("a kd-tree")
}

#[test]
fn a_tree_of_every_size_is_left_balanced_and_holds_every_photon() {
    // Direct photons of the closed sphere: one per path, so any number can be had. Around powers of two the bottom level
    // is full, begun or almost full. Cornell's walls have photons of one coordinate by the thousand.
    let counts = [1, 2, 3, 6, 7, 8, 12, 1000].map(|count| ("sphere", count, 2));
    for (name, count, depth) in counts.into_iter().chain([("cornell", 3000, 6)]) {
        let scene = builtin(name);
        let settings = map_only(count, |s| {
            s.photon.max_depth = depth;
            s.photon.radius_m = 0.05;
        });
        let what = format!("{count} paths in {name}");
        let views = views(&scene, 19.0);
        let grid = rendered(&scene, &settings, [8, 8], &views);
        let mut by_tree = settings.clone();
        KD(&mut by_tree);
        let tree = rendered(&scene, &by_tree, [8, 8], &views);
        let held = photons(&tree);
        assert!(name != "sphere" || held.len() == count as usize, "{what}");
        let in_grid = sorted_bits(&photons(&grid));
        assert!(sorted_bits(&held) == in_grid, "{what}: other photons");
        let mut nodes = nodes(&tree, held.len());
        for (node, photon) in nodes.iter().zip(&held) {
            assert_eq!(node[..3], photon.position, "{what}: a node is its photon");
        }
        let faults = tree_faults(&nodes);
        assert!(faults.is_empty(), "{what}: {faults:?}");
        // Negative control: a tree with two photons exchanged.
        if held.len() > 2 {
            nodes.swap(1, 2);
            assert_ne!(tree_faults(&nodes).len(), 0, "{what}: the check is blind");
        }
        // The same photons give the same tree, however threads are scheduled.
        let again = rendered(&scene, &by_tree, [8, 8], &views);
        assert!(photons(&again) == held, "{what}: another tree");
    }
}

/// The left eye by way of `change`, and its renderer.
fn image(
    scene: &Scene,
    base: &RenderSettings,
    change: Change,
    size: u32,
) -> (Vec<[f32; 3]>, Renderer) {
    let mut settings = base.clone();
    change(&mut settings);
    let renderer = rendered(scene, &settings, [size, size], &views(scene, 19.0));
    (radiance(&renderer, Eye::Left), renderer)
}

#[test]
fn kd_tree_and_workgroups_find_the_grids_photons() {
    let scene = builtin("cornell");
    for (radius_m, cells) in [(0.03, 524_288), (0.03, 2048), (0.004, 524_288)] {
        let base = map_only(4000, |s| {
            s.photon.radius_m = radius_m;
            s.photon.grid_cells_max = cells;
        });
        let (plain, renderer) = image(&scene, &base, |_| {}, 32);
        let hashed = grid(&renderer).0.hashed_rows > 0;
        assert!(hashed || cells > 2048, "one grid is hashed");
        let tolerance = rounding(fullest_ball(&photons(&renderer), radius_m));
        assert!(tolerance < 1e-3, "{tolerance}");
        for (name, way) in [("kd", KD), ("cooperative", COOPERATIVE)] {
            let (found, _) = image(&scene, &base, way, 32);
            let what = format!("{name}, radius {radius_m}, hashed {hashed}");
            assert_clean(&found, &what);
            assert_eq!(strays(&plain, &found, tolerance), 0, "{what}");
        }
        // In a dense grid the list's order is that of the rows: not a bit differs.
        if !hashed {
            let (found, _) = image(&scene, &base, COOPERATIVE, 32);
            assert!(bits(&found) == bits(&plain), "radius {radius_m}");
        }
        // Negative control: a radius that is larger by half a percent has a photon more here and there.
        let mut wider = base.clone();
        wider.photon.radius_m *= 1.005;
        let (wider, _) = image(&scene, &wider, KD, 32);
        assert!(strays(&plain, &wider, tolerance) > 32, "radius {radius_m}");
    }
}

#[test]
fn slices_go_on_where_they_stopped() {
    let scene = builtin("cornell");
    let triangles = Triangles::of(&scene);
    let views = views(&scene, 19.0);
    // Every photon is within the radius: more than one slice of each way, and a whole tree to walk.
    let base = map_only(60_000, |s| {
        s.photon.radius_m = 10.0;
        s.photon.kernel = Kernel::Epanechnikov;
        s.reuse = Reuse::Off;
    });
    for (name, way) in [
        ("kd_gather", KD),
        ("shared_gather", COOPERATIVE),
        ("eye_fused", FUSED),
    ] {
        let (_, renderer) = image(&scene, &base, way, 8);
        let map = renderer.photon_map().unwrap();
        let photons = photons(&renderer);
        assert!(map.gather_slices() > 1, "{name}: one slice");
        // Ceiling, back wall, block and floor; rounding as for the grid (`photon_map`).
        let pixels = [12, 27, 36, 60];
        let compared = assert_sums(&renderer, &scene, &photons, &views[0], pixels, 0.02, name);
        assert_eq!(compared, 4, "{name}");
    }
    // The heap is kept from slice to slice.
    let mut images = Vec::new();
    for (name, way) in [
        ("nearest_gather", NEAREST),
        ("kd_nearest_gather", KD_NEAREST),
    ] {
        let mut base = base.clone();
        base.photon.nearest = 16;
        let (found, renderer) = image(&scene, &base, way, 8);
        let map = renderer.photon_map().unwrap();
        let (photons, paths) = (photons(&renderer), map.counters().paths_kept);
        assert!(map.gather_slices() > 1, "{name}: one slice");
        for pixel in [12, 27, 36, 60] {
            let (point, normal, albedo) = seen(&scene, &triangles, pixel, 8).unwrap();
            let point = point - renderer.origin_in_world();
            let twin = nearest_twin(&photons, point, normal, albedo, 10.0, 16, paths);
            let found = f64::from(found[pixel][0]);
            // As in the test of the nearest photons.
            let off = (found / twin.0 - 1.0).abs();
            let what = format!("{name}, pixel {pixel}: {found} for {twin:?}");
            assert!(twin.1 == 16 && off < 2e-3, "{what}");
        }
        images.push(found);
    }
    assert_eq!(strays(&images[0], &images[1], rounding(16)), 0);
}

/// What a pixel of `size` across sees, for twins: place (world), normal towards the eye, reflectance. None where
/// `photon_map::assert_sums` has none: the red wall's normals are interpolated.
fn seen(
    scene: &Scene,
    triangles: &Triangles,
    pixel: usize,
    size: usize,
) -> Option<(DVec3, DVec3, f64)> {
    let view = views(scene, 19.0)[0];
    let ray = pixel_ray(&view, pixel, [size as u32; 2]);
    let (t, normal, material) = triangles.closest(ray.origin, ray.direction, 0.0)?;
    let material = &scene.materials[material as usize];
    if material.name == "red" || material.emission[0] > 0.0 {
        return None;
    }
    let normal = normal.normalize() * -normal.dot(ray.direction).signum();
    let point = ray.origin + ray.direction * t;
    Some((point, normal, f64::from(material.base_color[0])))
}

/// Radiance of a Lambert pixel from its `nearest` photons, in f64, red; how many they are, and their radius squared.
fn nearest_twin(
    photons: &[SortedPhoton],
    point: DVec3,
    normal: DVec3,
    albedo: f64,
    radius_m: f64,
    nearest: usize,
    paths: u32,
) -> (f64, usize, f64) {
    let mut found: Vec<(f64, f64)> = photons
        .iter()
        .filter_map(|photon| {
            let (direction, photon_normal) = directions(photon);
            let squared = position(photon).distance_squared(point);
            let counts = squared <= radius_m * radius_m
                && on_one_surface(position(photon) - point, photon_normal, normal)
                && direction.dot(normal) < 0.0;
            let factor = per_own_area(direction, photon_normal, normal);
            counts.then(|| (squared, factor * f64::from(photon.flux[0])))
        })
        .collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found.truncate(nearest);
    let squared = match found.last() {
        Some(last) if found.len() == nearest => last.0,
        _ => radius_m * radius_m,
    };
    let terms = found
        .iter()
        .map(|(at, flux)| 2.0 * (1.0 - at / squared) * flux);
    let sum: f64 = terms.sum();
    let area = std::f64::consts::PI * squared;
    let value = albedo / std::f64::consts::PI * sum / (area * f64::from(paths));
    (value, found.len(), squared)
}

#[test]
fn the_nearest_photons_are_those_of_an_exhaustive_search() {
    let scene = builtin("cornell");
    let triangles = Triangles::of(&scene);
    for (count, radius_m) in [(20, 0.1), (1, 0.1), (64, 0.03)] {
        let base = map_only(20_000, |s| {
            s.photon.radius_m = radius_m;
            s.photon.nearest = count;
            // Weight 0 at the k-th photon: which of two at almost one distance it is does not show.
            s.photon.kernel = Kernel::Epanechnikov;
        });
        let mut images = Vec::new();
        for way in [NEAREST, KD_NEAREST] {
            let (found, renderer) = image(&scene, &base, way, 24);
            let photons = photons(&renderer);
            let paths = renderer.photon_map().unwrap().counters().paths_kept;
            let (mut compared, mut full, mut other) = (0, 0, 0);
            for pixel in (0..24 * 24).step_by(7) {
                let Some((point, normal, albedo)) = seen(&scene, &triangles, pixel, 24) else {
                    continue;
                };
                let point = point - renderer.origin_in_world();
                let twin = |nearest| {
                    nearest_twin(&photons, point, normal, albedo, radius_m, nearest, paths)
                };
                let (expected, held, squared) = twin(count as usize);
                let found = f64::from(found[pixel][0]);
                if count == 1 && held == 1 {
                    // Its own distance is the radius: weight 0, but for the quotient's 2.5 units in the last place (Vulkan).
                    let fluxes = photons.iter().map(|photon| f64::from(photon.flux[0]));
                    let area = std::f64::consts::PI.powi(2) * squared * f64::from(paths);
                    let most = 2.0 * albedo * fluxes.fold(0.0, f64::max) / area;
                    assert!(found <= 3e-7 * most, "pixel {pixel}: {found:e} of {most:e}");
                    compared += 1;
                    continue;
                }
                if expected <= 0.0 {
                    continue;
                }
                compared += 1;
                full += usize::from(held == count as usize);
                // Positions agree to 1e-6 m; distances of 0.01 m and more are squared and divided by each other, which
                // makes 4e-4 of a weight and of the area each. Photons at grazing angles: see `photon_map`.
                let off = (found / expected - 1.0).abs();
                assert!(off < 2e-3, "{pixel}, {count} nearest: {found}, {expected}");
                // Negative control: one photon more is another estimate.
                let (wrong, ..) = twin(count as usize + 1);
                other += usize::from((wrong / expected - 1.0).abs() > 2e-3);
            }
            assert!(compared > 40, "only {compared} pixels");
            let is_seen = full > 40 && other > 40;
            assert!(count != 20 || is_seen, "{full} full, {other} differ");
            images.push(found);
        }
        let strays = strays(&images[0], &images[1], rounding(count as usize));
        assert_eq!(strays, 0, "{count} nearest");
    }
}

#[test]
fn one_kernel_gives_the_images_of_two_bit_for_bit() {
    // Direct light by its own pass, which wants the surfaces, or from the map; mirrors, glass and a map of caustics; all
    // pixels, and the list of those that reuse leaves.
    for (name, direct, reuse) in [
        ("cornell", DirectLight::Map, Reuse::Off),
        ("cornell", DirectLight::Nee, Reuse::Scatter),
        ("caustic", DirectLight::Map, Reuse::Lookup),
        ("gallery", DirectLight::Nee, Reuse::Off),
    ] {
        let scene = builtin(name);
        let base = settings(|s| {
            s.photon.direct = direct;
            s.reuse = reuse;
            s.spp = 2;
        });
        let views = views(&scene, 25.0);
        let [split, fused] = [(|_: &mut RenderSettings| {}) as Change, FUSED].map(|way| {
            let mut settings = base.clone();
            way(&mut settings);
            both_bits(&rendered(&scene, &settings, [32, 32], &views))
        });
        assert!(split == fused, "{name}, {direct:?}, {reuse:?}");
    }
}

/// Where photons and tree lie must not show, nor how many threads trace and sort them.
#[test]
fn copies_in_textures_and_wide_groups_give_the_same_images_by_every_way() {
    let scene = builtin("cornell");
    let views = views(&scene, 25.0);
    let default: Change = |_| {};
    for (name, way) in WAYS.into_iter().chain([("photon_gather", default)]) {
        // The fused kernel fits without copies where the scene needs little.
        let (on, off) = (Force::On, Force::Off);
        let [plain, copied, wide] = [(off, off), (on, off), (off, on)].map(|(texels, groups)| {
            let mut settings = map_only(4000, way);
            settings.photon.every_frame = true;
            settings.force.record_texels = texels;
            settings.force.wide_machine = groups;
            let mut renderer = renderer(&scene, &settings, [32, 32]);
            play(&mut renderer, &views, 0..1);
            let first = both_bits(&renderer);
            // Once more with other photons: the copies follow.
            play(&mut renderer, &views, 1..2);
            let second = both_bits(&renderer);
            assert!(first != second, "{name}: the same photons");
            second
        });
        let is_lit = plain.iter().flatten().any(|pixel| pixel[0] != 0);
        assert!(is_lit, "{name}: black");
        assert!(plain == copied && plain == wide, "{name}");
    }
    // Nor how many paths a thread follows: one, or up to eight of some 8,000.
    let [one, several] = [Force::On, Force::Off].map(|groups| {
        let mut settings = map_only(4000, |s| s.method = Method::Path);
        settings.force.wide_machine = groups;
        both_bits(&rendered(&scene, &settings, [96, 96], &views))
    });
    assert!(one == several, "paths");
}

#[test]
fn nothing_of_another_way_is_compiled() {
    let scene = builtin("cornell");
    let library = ShaderLibrary::embedded();
    let made =
        |settings: &RenderSettings| renderer_by(&library, &scene, settings, Eyes::Left, [8, 8]);
    let compiled = |change: Change| made(&map_only(100, change)).unwrap().pass_names();
    let has = |names: &[String], name: &str| names.iter().any(|other| other == name);
    let own: Vec<&str> = WAYS.iter().map(|(name, _)| *name).collect();
    let plain = compiled(|_| {});
    assert!(has(&plain, "photon_gather") && has(&plain, "cell_count"));
    assert!(!own.iter().any(|name| has(&plain, name)));
    let is_of_trees = |name: &String| name.starts_with("kd_");
    assert!(!plain.iter().any(is_of_trees), "{plain:?}");
    for (name, way) in WAYS {
        let names = compiled(way);
        assert!(has(&names, name), "{names:?}");
        assert!(!has(&names, "photon_gather"), "{names:?}");
        for other in own.iter().filter(|other| **other != name) {
            assert!(!has(&names, other), "{name} comes with {other}");
        }
        // A tree has no cells, and a grid no tree.
        assert_ne!(has(&names, "kd_move"), has(&names, "cell_count"));
        assert_eq!(has(&names, "kd_move"), name.starts_with("kd_"));
    }
    let odd = map_only(100, |s| {
        FUSED(s);
        KD(s);
    });
    let refused = made(&odd);
    assert!(matches!(refused, Err(RenderError::Settings(line)) if line.contains("fused")));
}

#[test]
fn no_photons_and_vanishing_radii_are_clean_in_every_way() {
    let scene = builtin("cornell");
    let lamps = scene.materials.iter().filter(|m| m.is_emissive());
    let lamps: Vec<[f32; 3]> = lamps.map(|material| material.emission).collect();
    for (name, way) in WAYS {
        for (count, radius_m) in [(0, 0.05), (500, 1e-9)] {
            let base = map_only(count, |s| s.photon.radius_m = radius_m);
            let (plain, _) = image(&scene, &base, |_| {}, 16);
            let (found, _) = image(&scene, &base, way, 16);
            let what = format!("{name}, {count} photons, radius {radius_m}");
            // No photon is that near: only lamps are seen.
            let is_seen = |pixel: &[f32; 3]| *pixel == [0.0; 3] || lamps.contains(pixel);
            assert!(found.iter().chain(&plain).all(is_seen), "{what}");
        }
    }
}

/// Four sheets that light each other, a gather radius apart, so that a gather's ball has as many photons in every cell that it walks.
fn stacked_sheets() -> Scene {
    let mut scene = Scene::default();
    let glow = Material {
        emission: [1.0; 3],
        double_sided: true,
        ..Material::lambert("sheet", [0.5; 3])
    };
    for z in [0.0, 0.25, 0.5, 0.75] {
        let corner = DVec3::new(-0.5, -0.5, -2.0 - z);
        add(&mut scene, &quad(corner, DVec3::X, DVec3::Y), glow.clone());
    }
    scene
}

#[test]
fn no_photon_is_left_out_where_all_cells_are_full() {
    let light = |change: Change| {
        let settings = settings(|s| {
            s.photon.direct = DirectLight::Map;
            s.photon.edge_correction = false;
            s.photon.radius_m = 0.2499;
            s.photon.count = 400_000;
            s.photon.max_depth = 3;
            s.reuse = Reuse::Off;
            change(s);
        });
        let views = eyes_at(DVec3::new(0.0, 0.0, -2.05), DQuat::IDENTITY, 8.0);
        let mut renderer = renderer(&stacked_sheets(), &settings, [8, 8]);
        renderer.render_frame(&views, 0, |_| {}).unwrap();
        let stored = renderer.photon_map().unwrap().counters().stored;
        (mean(&radiance(&renderer, Eye::Left)), stored)
    };
    let [(by_grid, stored), (by_tree, _)] = [light(|_| {}), light(KD)];
    // Nine rows of nine columns hold more than a thread's loops take, three rows of nine less (6 % are lost by those).
    assert!(stored > 200_000, "{stored}");
    let off = (by_grid / by_tree - 1.0).abs();
    assert!(
        off < f64::from(rounding(stored as usize)),
        "{by_grid}, {by_tree}"
    );
}
