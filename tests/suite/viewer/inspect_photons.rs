//! Views of photons, motion and variance, against counts and sums on the host.

use std::f64::consts::PI;

use glam::{DAffine3, DQuat, DVec3};
use stereolux::gpu::ShaderLibrary;
use stereolux::images::luminance;
use stereolux::renderer::{
    Eye, InspectedValues, Inspection, InstanceId, PhotonMap, Renderer, SortedPhoton,
};
use stereolux::scene::Scene;
use stereolux::settings::{Kernel, Method, RenderSettings, Reuse, Search};
use stereolux::xr::{Pose, View};

use super::bsdf_probe::wide;
use super::inspect::{center_ray, colors, inspected, scalars, surfaces, views};
use super::photon_map::{clearances, directions, grid_cell, map_only};
use super::support::*;
use crate::suite::embedded_scenes::plane;
use crate::suite::transport::parts::hall_of_mirrors;

const SIZE: [u32; 2] = [32, 32];

/// A photon in f64, world space.
struct Placed {
    position: DVec3,
    /// To within a step of 2 / 2047 in one coordinate and 2 / 1023 in the other.
    normal: DVec3,
    flux: DVec3,
    cell: [u32; 3],
}

fn placed(renderer: &Renderer, map: &PhotonMap) -> Vec<Placed> {
    let (origin, _) = map.traced_at().unwrap();
    let (grid, _) = renderer.read_photon_grid(map.kind()).unwrap().unwrap();
    let place = |photon: &SortedPhoton| Placed {
        position: origin + wide(photon.position),
        normal: directions(photon).1,
        flux: wide(photon.flux),
        cell: grid_cell(&grid, photon.position),
    };
    let photons = renderer.read_photons(map.kind()).unwrap().unwrap();
    photons.iter().map(place).collect()
}

/// Density and occupancy by going through all photons; `grid_rows` says whether the grid is expected to be hashed.
fn counts_are_the_hosts(
    scene: &Scene,
    settings: &RenderSettings,
    size: [u32; 2],
    hashed: bool,
) -> u32 {
    let mut renderer = rendered(scene, settings, size, &views(scene, 20.0));
    // A head that has moved on: photons keep the space of the frame that traced them.
    let mut head = scene.start_pose();
    head.position += DVec3::new(0.03, 0.02, -0.05);
    let views = parallel_views(head, 0.063, square_fov(20.0));
    play(&mut renderer, &views, 1..2);
    let map = renderer.photon_map().unwrap();
    let slices = map.gather_slices();
    let (grid, _) = renderer.read_photon_grid(map.kind()).unwrap().unwrap();
    assert_eq!(grid.hashed_rows != 0, hashed);
    let photons = placed(&renderer, map);
    let origin = map.traced_at().unwrap().0;
    let radius = f64::from(grid.radius);
    let area = PI * radius * radius;
    let eye = Eye::Right;
    let density = scalars(&mut renderer, Inspection::PhotonDensity, eye);
    let occupancy = scalars(&mut renderer, Inspection::GridOccupancy, eye);
    let seen = surfaces(&mut renderer, eye);
    let (mut certain, mut found, mut others) = (0, 0.0, 0);
    for (pixel, surface) in seen.iter().enumerate() {
        if surface.instance.is_none() {
            assert_eq!((density[pixel], occupancy[pixel]), (0.0, 0.0));
            continue;
        }
        let (from, direction) = center_ray(&views[1], size, pixel);
        let point = from + direction * f64::from(surface.distance_m);
        let normal = wide(surface.geometric_normal_in_world);
        // f32 misplaces points and photons of a room of 1 m by some 1e-6 m; packed normals turn by up to 4e-4.
        let (mut least, mut most, mut wider) = (0.0, 0.0, 0.0);
        for photon in &photons {
            let distance = photon.position.distance(point);
            let [turned, risen] = clearances(
                photon.position - point,
                photon.normal,
                normal,
                settings.photon.normal_min_cos,
            );
            let is_sure = turned > 1e-3 && risen > 1e-5;
            wider += f64::from(u8::from(distance < 1.2 * radius && is_sure));
            if distance < radius + 1e-5 && turned > -1e-3 && risen > -1e-5 {
                most += 1.0;
                least += f64::from(u8::from(distance < radius - 1e-5 && is_sure));
            }
        }
        let count = f64::from(density[pixel]) * area;
        let allowed = least - 0.01..=most + 0.01;
        assert!(allowed.contains(&count), "{pixel}: {count} of {allowed:?}");
        found += count;
        others += usize::from(count < wider - 0.01);
        let cells = DVec3::new(f64::from(grid.columns), 1.0, 1.0) * f64::from(grid.inverse_edge);
        let at = (point - origin - wide(grid.origin)) * cells;
        let at = at.to_array();
        if at.iter().any(|at| (at - at.round()).abs() < 1e-4) {
            continue;
        }
        certain += 1;
        let cell = [0, 1, 2].map(|axis| at[axis] as u32);
        let inside = photons.iter().filter(|photon| photon.cell == cell).count();
        assert_eq!(occupancy[pixel], inside as f32, "pixel {pixel}");
    }
    assert!(certain > seen.len() / 4 && found > 0.0, "{certain} {found}");
    assert!(occupancy.iter().sum::<f32>() > 0.0);
    // A radius wider by a fifth would have been noticed, where it is not wider than the scene anyway.
    assert!(slices > 1 || others > seen.len() / 8, "{others}");
    slices
}

#[test]
fn density_and_occupancy_are_counts_of_the_photons_there_are() {
    let scene = builtin("cornell");
    let dense = settings(|s| s.photon.count = 8192);
    assert_eq!(counts_are_the_hosts(&scene, &dense, [24, 20], false), 1);
    let hashed = settings(|s| {
        s.photon.count = 4096;
        s.photon.radius_m = 0.02;
        s.photon.grid_cells_max = 1024;
    });
    counts_are_the_hosts(&scene, &hashed, [24, 20], true);
    // So many photons in a cell that they are counted in slices.
    let sliced = settings(|s| {
        s.photon.count = 65_536;
        s.photon.radius_m = 3.0;
    });
    let slices = counts_are_the_hosts(&scene, &sliced, [6, 6], false);
    assert!(slices > 1, "{slices}");
}

/// Share of the disc around (x, y) that lies on the square of +-`half`.
fn disc_share(x: f64, y: f64, radius: f64, half: f64) -> f64 {
    const STEPS: i32 = 48;
    let (mut inside, mut all) = (0.0, 0.0);
    for i in 0..STEPS * STEPS {
        let part = |k: i32| (f64::from(2 * k + 1) / f64::from(STEPS) - 1.0) * radius;
        let (u, v) = (part(i % STEPS), part(i / STEPS));
        if u * u + v * v <= radius * radius {
            all += 1.0;
            inside += f64::from(u8::from((x + u).abs() < half && (y + v).abs() < half));
        }
    }
    inside / all
}

#[test]
fn the_density_of_a_plane_integrates_to_its_photons() {
    let scene = builtin("plane");
    let radius = 1.0;
    let settings = map_only(4096, |s| s.photon.radius_m = radius);
    // The whole plane: half an edge of 10 m in 2 m is 78.7 degrees.
    let mut renderer = rendered(&scene, &settings, [128, 128], &views(&scene, 80.0));
    let density = scalars(&mut renderer, Inspection::PhotonDensity, Eye::Left);
    // Pixels are linear in tangents, so each covers the same area of a plane that faces the eye.
    let pixel_m = 2.0 * 80_f64.to_radians().tan() * plane::DISTANCE_M / 128.0;
    let integral = sum(&density) * pixel_m * pixel_m;
    let photons = placed(&renderer, renderer.photon_map().unwrap());
    let share = |p: DVec3| disc_share(p.x, p.y, radius, plane::HALF_EDGE_M);
    let expected: f64 = photons.iter().map(|photon| share(photon.position)).sum();
    // Each photon counts in as many pixels as have their centre in its disc of 5.6 pixels' radius: 100 on average, off by
    // some 2 of them, a different number for each of 4,096 photons: 2 % / 64 in all. The 48 steps of the share do likewise.
    assert!(photons.len() > 1000);
    let off = (integral / expected - 1.0).abs();
    assert!(off < 2e-3, "{integral} of {expected}");
    assert!((integral / photons.len() as f64 - 1.0).abs() < 0.1);
}

/// Photons that each pixel of a view sees, by f64, each ray to the eye traced; or without asking what lies between.
fn host_dots(
    scene: &Scene,
    photons: &[Placed],
    view: &View,
    size: [u32; 2],
    traces: bool,
) -> Vec<f32> {
    let triangles = Triangles::of(scene);
    let mut dots = vec![0.0; (size[0] * size[1]) as usize];
    for photon in photons {
        let to_eye = view.position_in_world - photon.position;
        if photon.normal.dot(to_eye) <= 0.0 {
            continue;
        }
        let place = view.pixel_from_point_in_world(photon.position, size[0], size[1]);
        let Some((x, y)) = place else {
            continue;
        };
        if !(traces && triangles.blocked(photon.position, view.position_in_world, 1e-4)) {
            dots[(y as u32 * size[0] + x as u32) as usize] += 1.0;
        }
    }
    dots
}

fn sum(values: &[f32]) -> f64 {
    values.iter().map(|&value| f64::from(value)).sum()
}

fn difference(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from((a - b).abs())).sum()
}

#[test]
fn dots_are_the_photons_that_the_eye_sees() {
    let scene = builtin("cornell");
    let settings = settings(|s| s.photon.count = 8192);
    let views = views(&scene, 21.0);
    let mut renderer = rendered(&scene, &settings, [64, 64], &views);
    let photons = placed(&renderer, renderer.photon_map().unwrap());
    for (eye, view) in [Eye::Left, Eye::Right].into_iter().zip(&views) {
        let dots = scalars(&mut renderer, Inspection::PhotonDots, eye);
        let expected = host_dots(&scene, &photons, view, [64, 64], true);
        let unseen = host_dots(&scene, &photons, view, [64, 64], false);
        // Photons a pixel's width behind an edge count though they are hidden: the boxes' outlines run through some
        // 150 of 4,096 pixels. Which of two pixels a photon lies in is rounding.
        let (wrong, all) = (difference(&dots, &expected), sum(&expected));
        // Without a depth test there would be many more.
        let hidden = difference(&unseen, &expected);
        let what = format!("{eye:?}: {wrong} of {all}, {hidden} hidden");
        assert!(all > 1000.0 && wrong < 0.02 * all, "{what}");
        assert!(hidden > 4.0 * wrong && hidden > 0.05 * all, "{what}");
    }
}

#[test]
fn dots_of_both_maps_on_a_plane_are_all_photons_in_the_picture() {
    // A kd-tree's photons lie in another order.
    let plane = builtin("plane");
    let settings = map_only(4096, |s| s.photon.search = Search::KdTree);
    let views = views(&plane, 45.0);
    let mut renderer = rendered(&plane, &settings, SIZE, &views);
    let photons = placed_anywhere(&renderer);
    let dots = scalars(&mut renderer, Inspection::PhotonDots, Eye::Left);
    let [width, height] = SIZE;
    let inside = |p: &DVec3| {
        views[0]
            .pixel_from_point_in_world(*p, width, height)
            .is_some()
    };
    let expected = photons.iter().filter(|p| inside(p)).count() as f64;
    // One on the very border may be rounded out.
    let found = sum(&dots);
    let off = (found - expected).abs();
    assert!(off <= 1.0 && expected > 500.0, "{found} {expected}");
    let library = ShaderLibrary::embedded();
    let refused = renderer.inspect(&library, Inspection::GridOccupancy, Eye::Left);
    assert_says(&refused.unwrap_err().to_string(), &["photon.search=grid"]);
}

fn placed_anywhere(renderer: &Renderer) -> Vec<DVec3> {
    let map = renderer.photon_map().unwrap();
    let (origin, _) = map.traced_at().unwrap();
    let photons = renderer.read_photons(map.kind()).unwrap().unwrap();
    photons.iter().map(|p| origin + wide(p.position)).collect()
}

#[test]
fn caustic_light_is_the_estimate_from_the_caustic_map_alone() {
    let scene = builtin("caustic");
    let settings = settings(|s| {
        s.reuse = Reuse::Off;
        s.photon.count = 32_768;
        s.photon.kernel = Kernel::Constant;
        s.output.parts = true;
    });
    let views = views(&scene, 25.0);
    let mut renderer = rendered(&scene, &settings, SIZE, &views);
    let map = renderer.caustic_map().unwrap();
    let photons = placed(&renderer, map);
    let radius = renderer.caustic_radius_m();
    let paths = f64::from(map.counters().paths_kept);
    let floor = renderer.scene().instance_of_node(0).unwrap();
    for (eye, view) in [Eye::Left, Eye::Right].into_iter().zip(&views) {
        let light = colors(&mut renderer, Inspection::Caustic, eye);
        let indirect = colors(&mut renderer, Inspection::Indirect, eye);
        let seen = surfaces(&mut renderer, eye);
        let (mut on_floor, mut bright, mut total) = (0, 0.0_f64, 0.0);
        for (pixel, surface) in seen.iter().enumerate() {
            // What is gathered from this map is part of what is indirect; both are sums of the same terms.
            for c in 0..3 {
                assert!(light[pixel][c] <= indirect[pixel][c] * (1.0 + 1e-5) + 1e-6);
            }
            if surface.instance != Some(floor) {
                continue;
            }
            on_floor += 1;
            let (from, direction) = center_ray(view, SIZE, pixel);
            let point = from + direction * f64::from(surface.distance_m);
            // Photons within 1e-5 m of the border count or not.
            let sum_within = |radius: f64| -> f64 {
                let is_near = |p: &&Placed| p.position.distance(point) < radius && p.normal.y > 0.9;
                photons
                    .iter()
                    .filter(is_near)
                    .map(|photon| photon.flux.x)
                    .sum()
            };
            let area = PI * radius * radius;
            let scale = f64::from(surface.albedo[0]) / PI / (area * paths);
            let [least, most] = [-1e-5, 1e-5].map(|more| sum_within(radius + more) * scale);
            let found = f64::from(light[pixel][0]);
            // Lambert: the same weight from every direction, but the shading correction of flat normals rounds.
            let allowed = least * 0.999 - 1e-9..=most * 1.001 + 1e-9;
            assert!(allowed.contains(&found), "{pixel}: {found} {allowed:?}");
            bright = bright.max(found);
            total += found;
        }
        let mean = total / f64::from(on_floor);
        let is_bright = bright > 5.0 * mean;
        assert!(on_floor > 300 && is_bright, "{on_floor} {bright} {mean}");
    }
}

/// Every pixel's motion, and whether it is known.
fn inspected_motion(renderer: &mut Renderer, eye: Eye) -> (Vec<[f32; 2]>, Vec<bool>) {
    let motion = inspected(renderer, Inspection::Motion, eye);
    match motion.values {
        InspectedValues::Vector2(vectors) => (vectors, motion.has_value.unwrap()),
        other => panic!("{other:?}"),
    }
}

/// Every 64th frame's samples lie 1/128 pixel beside the centres. Motion that changes by under 2.5 pixels from pixel to pixel
/// is off by less than 0.02, but where a silhouette comes between: at 1 in 64 of the pixels along one, and they are fewer than
/// half of all.
fn assert_is_of_the_pass(vectors: &[[f32; 2]], known: &[bool], read: &[[f32; 4]]) {
    let others = vectors.iter().zip(known).zip(read);
    let differ = others.filter(|((vector, known), read)| {
        let off = (vector[0] - read[0]).hypot(vector[1] - read[1]);
        **known != (read[3] > 0.0) || off > 0.02
    });
    let differ = differ.count();
    assert!(differ <= 1024 / 128, "{differ} of 1024");
}

#[test]
fn motion_in_a_mirror_is_that_of_the_pass_while_the_head_walks() {
    let scene = hall_of_mirrors(0.0);
    let settings = settings(|s| {
        s.method = Method::Path;
        s.reuse = Reuse::Off;
        s.reconstruct.taa = true.into();
        s.reconstruct.svgf = true.into();
    });
    let mut renderer = renderer(&scene, &settings, SIZE);
    for step in [0, 1] {
        let at = DVec3::new(0.04, 0.0, -0.06) * f64::from(step);
        let head = Pose::new(at, DQuat::IDENTITY);
        let views = parallel_views(head, 0.063, square_fov(30.0));
        play(&mut renderer, &views, 64 * step..64 * step + 1);
    }
    for eye in Eye::ALL {
        let (vectors, known) = inspected_motion(&mut renderer, eye);
        let (_, read) = renderer.read_motion(eye).unwrap().unwrap();
        assert_is_of_the_pass(&vectors, &known, &read);
    }
}

#[test]
fn motion_is_that_of_the_pass_and_needs_no_reconstruction() {
    let scene = builtin("gallery");
    let view = |step: f64| {
        let mut head = scene.start_pose();
        head.position += DVec3::new(0.02, -0.01, 0.015) * step;
        head.orientation *= DQuat::from_rotation_y(0.02 * step);
        parallel_views(head, 0.063, square_fov(40.0))
    };
    let filtered = settings(|s| {
        s.method = Method::Path;
        s.path.max_depth = 2;
        s.reuse = Reuse::Off;
        s.reconstruct.taa = true.into();
        s.reconstruct.svgf = true.into();
    });
    let mut plain = filtered.clone();
    plain.reconstruct.taa = false.into();
    plain.reconstruct.svgf = false.into();
    plain.output.motion = true;
    let mut found: Vec<Vec<[f32; 2]>> = Vec::new();
    for settings in [&filtered, &plain] {
        let mut renderer = renderer(&scene, settings, SIZE);
        for step in 0..2 {
            let at = DAffine3::from_translation(DVec3::new(0.04, 0.02, 0.0) * f64::from(step))
                * scene.instances()[3].world_from_object;
            renderer.set_instance_transform(InstanceId(3), at);
            play(
                &mut renderer,
                &view(f64::from(step)),
                64 * step..64 * step + 1,
            );
            if step == 0 {
                // Nothing came before.
                let first = inspected(&mut renderer, Inspection::Motion, Eye::Left);
                assert_eq!(first.has_value, Some(vec![false; 1024]));
            }
        }
        for eye in Eye::ALL {
            let (vectors, known) = inspected_motion(&mut renderer, eye);
            assert!(known.iter().filter(|known| **known).count() > 1000);
            if let Some((_, read)) = renderer.read_motion(eye).unwrap() {
                assert_is_of_the_pass(&vectors, &known, &read);
            }
            let longest = vectors.iter().map(|v| v[0].hypot(v[1])).fold(0.0, f32::max);
            assert!(longest > 0.5 && longest < 10.0, "{longest}");
            found.push(vectors);
        }
    }
    assert!(found[0] == found[2] && found[1] == found[3]);
    assert!(found[0] != found[1]);
}

#[test]
fn variance_is_zero_without_noise_and_that_of_the_light_with_it() {
    let at_rest = |name: &str, frames: u32, depth: u32| {
        let scene = builtin(name);
        let settings = settings(|s| {
            s.method = Method::Path;
            s.path.max_depth = depth;
            s.reuse = Reuse::Off;
            s.reconstruct.svgf = true.into();
            s.reconstruct.stereo = false;
            s.reconstruct.moments_alpha = 0.0;
            s.output.parts = true;
        });
        let mut renderer = renderer(&scene, &settings, SIZE);
        let views = views(&scene, 18.0);
        let mut frames_of_luminance = Vec::new();
        for index in 0..frames {
            // Every 64th frame's samples lie at one place in their pixels.
            play(&mut renderer, &views, 64 * index..64 * index + 1);
            let parts = renderer.read_parts(Eye::Left).unwrap().unwrap();
            let of_pixel = |pixel: usize| {
                [&parts.direct, &parts.indirect].map(|part| {
                    let light = [0, 1, 2].map(|c| {
                        let albedo = f64::from(parts.albedo[pixel][c]).max(0.01);
                        f64::from(part[pixel][c]) / albedo
                    });
                    luminance(light)
                })
            };
            frames_of_luminance.push((0..1024).map(of_pixel).collect::<Vec<[f64; 2]>>());
        }
        let variance = scalars(&mut renderer, Inspection::Variance, Eye::Left);
        (variance, frames_of_luminance)
    };
    // A point light on a plane: every frame is the same, but means are packed within 2^-11.
    let (still, frames) = at_rest("plane", 4, 2);
    for (found, [direct, indirect]) in still.iter().zip(&frames[0]) {
        let off = (direct + indirect) / 2048.0;
        assert!(
            (0.0..off * off + 1e-9).contains(&f64::from(*found)),
            "{found} {off}"
        );
    }
    let (noisy, frames) = at_rest("cornell", 6, 3);
    let count = frames.len() as f64;
    for (pixel, &found) in noisy.iter().enumerate() {
        let mut expected = 0.0;
        for part in 0..2 {
            let mean = frames.iter().map(|f| f[pixel][part]).sum::<f64>() / count;
            let squares = frames.iter().map(|f| (f[pixel][part] - mean).powi(2));
            expected += squares.sum::<f64>() / count;
        }
        // At rest every pixel's history is its own. Of six frames' variances each is packed within 2^-7, and each mean within
        // 2^-11 of itself, at most the greatest value.
        let error = (f64::from(found) - expected).abs();
        let most = frames
            .iter()
            .map(|f| f[pixel][0] + f[pixel][1])
            .fold(0.0, f64::max);
        let off = most / 2048.0;
        let allowed = 6.0 / 128.0 * expected + 2.0 * expected.sqrt() * off + off * off + 1e-6;
        assert!(error <= allowed, "{pixel}: {found} {expected}");
    }
    assert!(noisy.iter().filter(|v| **v > 1e-3).count() > 300);
}
