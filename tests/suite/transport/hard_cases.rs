//! Extremes of geometry, view, scale and light, each against a value known beforehand.

use std::f64::consts::PI;

use glam::{DQuat, DVec3};
use stereolux::renderer::Eye;
use stereolux::scene::{Material, Scene};
use stereolux::settings::{Method, RenderSettings, Reuse, Technique};
use stereolux::xr::{Pose, View};

use super::bsdf_twin::Twin;
use super::chi_square::integrate;
use super::hard_support::*;
use super::lights_sampling::map_of;
use super::techniques::settings_of;
use crate::suite::embedded_scenes::{plane, sphere};
use crate::suite::support::{
    assert_clean, bits, builtin, frame, images_of, mean, method, parallel_views, pixel_ray,
    radiance, renderer, settings, square_fov, start_views, statistics,
};

#[test]
fn an_eye_in_a_sealed_box_sees_black_and_in_a_glowing_one_its_glow() {
    let views = eyes_at(DVec3::new(0.3, -0.2, 0.1), DQuat::IDENTITY, 45.0);
    let sides = cube();
    // Lit from outside through its lid, or not: a shadow ray must not slip through an edge.
    let lit = |triangles: &[Triangle]| {
        let mut scene = Scene::default();
        add(&mut scene, triangles, Material::lambert("wall", [0.5; 3]));
        add_point_light(&mut scene, DVec3::new(0.1, 3.0, 0.2), 100.0);
        scene
    };
    let emission = |albedo: f32, double_sided: bool| {
        let mut scene = Scene::default();
        let material = Material {
            emission: [0.5, 1.0, 2.0],
            double_sided,
            ..Material::lambert("glow", [albedo; 3])
        };
        add(&mut scene, &sides, material);
        scene
    };
    for kind in [Method::Photon, Method::Path] {
        for reuse in [Reuse::Off, Reuse::Scatter] {
            let settings = method(kind, reuse);
            for (what, scene) in [
                ("lit from outside", lit(&sides)),
                ("glows outwards", emission(0.5, false)),
            ] {
                for image in images(&scene, &settings, [24, 24], &views) {
                    assert!(is_black(&image), "{kind:?} {reuse:?}: {what}");
                }
            }
        }
        // Negative control: without its lid the box is lit.
        let off = method(kind, Reuse::Off);
        let open = images(&lit(&sides[..10]), &off, [24, 24], &views);
        assert!(mean(&open[0]) > 0.01, "{kind:?}: the open box is black");
        // Nothing reflects: emission, bit for bit.
        for image in images(&emission(0.0, true), &off, [24, 24], &views) {
            let is_emission = image.iter().all(|&p| p == [0.5, 1.0, 2.0]);
            assert!(is_emission, "{kind:?}: not the emission");
        }
    }
    // Half is reflected: L = e (1 + a + ...) with one term per surface of the path, 2 e (1 - a^depth).
    let depth = 12;
    for image in images(&emission(0.5, true), &paths(depth, 64), [32, 32], &views) {
        for (channel, e) in [0.5, 1.0, 2.0].into_iter().enumerate() {
            let expected = 2.0 * e * (1.0 - 0.5_f64.powi(depth as i32));
            let sum: f64 = image.iter().map(|p| f64::from(p[channel])).sum();
            let found = sum / image.len() as f64;
            // 65,536 paths whose values spread by less than their mean: 0.4 % at one standard deviation.
            let off = relative(found, expected);
            assert!(off < 0.016, "{found} for {expected} in channel {channel}");
        }
    }
}

#[test]
fn an_eye_on_a_surface_gives_a_clean_image() {
    let scene = builtin("plane");
    for kind in [Method::Photon, Method::Path] {
        for turn in [
            DQuat::IDENTITY,
            DQuat::from_rotation_y(PI / 2.0),
            DQuat::from_rotation_x(PI / 4.0),
        ] {
            let views = eyes_at(DVec3::new(0.1, 0.2, -plane::DISTANCE_M), turn, 45.0);
            for reuse in [Reuse::Scatter, Reuse::Lookup] {
                images(&scene, &method(kind, reuse), [16, 16], &views);
            }
        }
    }
}

#[test]
fn points_behind_beside_and_on_the_right_images_border() {
    // In f64. The borders are the view's own tangents, doubled: exact, and so is the quotient.
    let [_, right] = eyes_at_origin(40.0);
    let right = View {
        position_in_world: DVec3::ZERO,
        ..right
    };
    let t = right.fov.tangents();
    let at = |x: f64, y: f64, z: f64| {
        right.pixel_from_point_in_world(DVec3::new(x * 2.0, y * 2.0, z * 2.0), 48, 32)
    };
    assert_eq!(at(t.left, 0.0, -1.0).map(|p| p.0), Some(0.0));
    assert_eq!(at(0.0, t.up, -1.0).map(|p| p.1), Some(0.0));
    assert_eq!(at(t.right, 0.0, -1.0), None, "the image is half open");
    assert_eq!(at(0.0, t.down, -1.0), None, "the image is half open");
    // A part in 1e12 inside and outside: f64 keeps 1e-16.
    let hair = 1.0 - 1e-12;
    assert!(at(t.right * hair, 0.0, -1.0).is_some_and(|p| p.0 < 48.0 && p.0 > 47.999));
    assert!(at(0.0, t.down * hair, -1.0).is_some_and(|p| p.1 < 32.0 && p.1 > 31.999));
    assert_eq!(at(t.left / hair, 0.0, -1.0), None);
    assert_eq!(at(0.0, t.up / hair, -1.0), None);
    assert_eq!(at(2.0 * t.right, 0.0, -1.0), None, "beside");
    assert_eq!(at(0.0, 0.0, 1.0), None, "behind");
    assert_eq!(at(0.1, 0.1, 0.0), None, "in the eye's plane");
    assert_eq!(at(0.0, 0.0, 0.0), None, "in the eye");
    assert_eq!(at(f64::NAN, 0.0, -1.0), None);
}

#[test]
fn a_right_eye_that_sees_nothing_of_the_left_image_is_filled_as_if_alone() {
    let scene = builtin("sphere");
    let size = [24, 24];
    let views = eyes_at(DVec3::new(0.1, 0.2, 0.3), DQuat::IDENTITY, 40.0);
    for (what, turn) in [("behind", PI), ("beside", PI / 2.0)] {
        let mut views = views;
        views[1].orientation = DQuat::from_rotation_y(turn);
        for kind in [Method::Photon, Method::Path] {
            let alone = images(&scene, &method(kind, Reuse::Off), size, &views);
            let mut renderer = renderer(&scene, &method(kind, Reuse::Scatter), size);
            let stereo = frame(&mut renderer, &views).stereo;
            let what = format!("{what} {kind:?}: {stereo:?}");
            assert_eq!(stereo.reused, 0, "{what}");
            let outside = stereo.filled_because.out_of_left_view;
            assert_eq!(outside, size[0] * size[1], "{what}");
            // Filled pixels are those of an eye alone.
            let right = bits(&radiance(&renderer, Eye::Right));
            assert!(right == bits(&alone[1]), "{what}");
            // Negative control: the left eye looks elsewhere.
            assert!(bits(&alone[0]) != bits(&alone[1]));
        }
    }
}

#[test]
fn samples_exactly_on_a_border_reach_no_pixel_and_others_theirs() {
    // Both eyes in one place, so hits keep their tangents. A right pixel is half as wide as a left one, and the right
    // image begins on a left pixel's centre or a quarter of a right pixel before it: left samples lie exactly on right
    // borders, the outermost on the border of the image, or in every other pixel.
    let scene = builtin("plane");
    let size = 32_u32;
    let centre = |i: f64| (2.0 * (i + 0.5) / f64::from(size) - 1.0).atan();
    for kind in [Method::Photon, Method::Path] {
        for before in [0.0, 0.125] {
            let mut views = parallel_views(Pose::IDENTITY, 0.0, square_fov(45.0));
            views[1].fov.angle_left = centre(4.0 - before);
            views[1].fov.angle_right = centre(20.0 - before);
            views[1].fov.angle_down = centre(4.0 + before);
            views[1].fov.angle_up = centre(20.0 + before);
            let mut renderer = renderer(&scene, &method(kind, Reuse::Scatter), [size, size]);
            let stereo = frame(&mut renderer, &views).stereo;
            let winners = renderer.read_winners().unwrap().unwrap();
            let right = radiance(&renderer, Eye::Right);
            assert_clean(&right, "border");
            for (pixel, &winner) in winners.iter().enumerate() {
                let (x, y) = (pixel as u32 % size, pixel as u32 / size);
                // Rounding decides on which side of its border a sample lies, so none is carried; a quarter of a
                // pixel inside, sample k of a row lands in pixel 2k. Rows count from the top.
                let expected = if before == 0.0 || x % 2 == 1 || y % 2 == 1 {
                    u32::MAX
                } else {
                    (11 + y / 2) * size + 4 + x / 2
                };
                assert_eq!(winner, expected, "{kind:?} {before}: ({x}, {y})");
            }
            // Pixels that no sample reached trace their rays, and so do those where the edge between the plane's two
            // triangles runs between sample and centre; all of them find their light among the left samples.
            let reached = if before == 0.0 { 0 } else { 16 * 16 };
            let on_edge = stereo.traced - (size * size - reached);
            assert!(on_edge <= reached.min(16), "{kind:?} {before}: {on_edge}");
            assert_eq!(stereo.reused, size * size, "{kind:?} {before}");
            if reached == 0 {
                let traced = images(&scene, &method(kind, Reuse::Lookup), [size, size], &views);
                assert!(bits(&right) == bits(&traced[1]), "{kind:?}");
            }
        }
    }
}

#[test]
fn fields_of_view_of_1_and_170_degrees() {
    for half_degrees in [0.5, 85.0] {
        let scene = builtin("plane");
        let views = eyes_at_origin(half_degrees);
        let what = format!("{half_degrees} degrees");
        check_closed_form(&scene, &views, 32, 1.0, CLOSED_FORM, &what);
        for kind in [Method::Photon, Method::Path] {
            for reuse in [Reuse::Scatter, Reuse::Lookup] {
                images(&scene, &method(kind, reuse), [32, 32], &views);
            }
        }
        // Negative control: another opening is another image.
        let other = eyes_at_origin(half_degrees * 0.98);
        let [left, _] = images(&scene, &paths(2, 1), [32, 32], &views);
        assert!(worst(&left, &plane_in_closed_form(&other[0], 32, 1.0)) > CLOSED_FORM);

        // The integrating sphere: radiance 1 - a^11 to depth 12, whatever the angle. Paths differ by the facets'
        // distances, under 1 %, and now and then one ends between the facet's horizon and that of its interpolated
        // normal: it loses half of its light at most, which is 0.1 % of a tile of 576.
        let scene = builtin("sphere");
        let views = start_views(&scene, half_degrees);
        let expected = sphere::RADIANCE * (1.0 - f64::from(sphere::ALBEDO).powi(11));
        for image in images(&scene, &paths(12, 16), [24, 24], &views) {
            for (tile, found) in tiles(&image, 24, 6).into_iter().enumerate() {
                let off = relative(found, expected);
                assert!(off < 0.02, "{half_degrees} degrees, tile {tile}: {off}");
            }
        }
    }
}

#[test]
fn an_empty_scene_is_black_or_its_environment() {
    let text = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"name":"nothing"}]}"#;
    let mut scene = Scene::from_bytes("empty.gltf", text.as_bytes()).unwrap();
    assert_eq!(scene.triangle_count(), 0);
    let views = |turn| eyes_at(DVec3::new(1.0, 2.0, 3.0), turn, 10.0);
    let all = [Method::Photon, Method::Path]
        .map(|kind| [Reuse::Off, Reuse::Scatter, Reuse::Lookup].map(|reuse| method(kind, reuse)));
    for settings in all.iter().flatten() {
        for image in images(&scene, settings, [16, 16], &views(DQuat::IDENTITY)) {
            assert!(is_black(&image));
        }
    }
    // Red above, blue below: beyond the outermost texels' centres (45 degrees) the map is constant, ahead it is their
    // mean. Blends of equal numbers round twice: 2^-23.
    let texel = |_, y| [[3.0, 0.0, 0.0], [0.0, 0.0, 0.25]][y as usize];
    scene.environment = Some(map_of([4, 2], texel));
    for settings in all.iter().flatten() {
        for (up, expected) in [(0.5 * PI, [3.0, 0.0, 0.0]), (-0.5 * PI, [0.0, 0.0, 0.25])] {
            let views = views(DQuat::from_rotation_x(up));
            for image in images(&scene, settings, [16, 16], &views) {
                let off = worst(&image, &vec![expected; 256]);
                assert!(off < 3e-7, "looking up by {up}: {off}");
            }
        }
        for image in images(&scene, settings, [16, 16], &views(DQuat::IDENTITY)) {
            // Symmetric about the horizon, so the mean is that of the halves; f32 sums of 256 pixels.
            let expected = (0.5 * 3.0 + 0.5 * 0.25) / 3.0;
            assert!(relative(mean(&image), expected) < 1e-5);
        }
    }
}

/// What of light is left after a metre of [`absorbing_glass`].
const SURVIVES_PER_M: [f64; 3] = [0.5, 0.8, 0.2];

/// Glass that does not bend light.
fn absorbing_glass(absorbs: bool) -> Material {
    Material {
        metallic: 0.0,
        transmission: 1.0,
        ior: 1.0,
        roughness: 0.0,
        attenuation_distance_m: if absorbs { 1.0 } else { f32::INFINITY },
        attenuation_color: SURVIVES_PER_M.map(|c| c as f32),
        ..Material::default()
    }
}

/// A white wall inside a block of absorbing glass that does not bend light, lit from inside it.
///
/// Eye at the origin, block from z = -1 to -5, wall at z = -3 facing the eye, lamp at z = -2: light of radiance
/// albedo / pi times I cos / d^2, times exp(-absorption (d + way from the block's front to the wall)). A clear pane in the block, at
/// z = -1.5, takes the body from no ray; a clear plate takes as much of the way as it fills of the block, be it inside or across its front.
#[test]
fn lamps_inside_an_absorbing_body_are_dimmed_by_both_methods() {
    const INTENSITY: f32 = 7.0;
    const ALBEDO: f64 = 0.8;
    let body = block(DVec3::splat(2.0), -3.0);
    let wall = square_ahead(1.9, 3.0);
    let pane = square_ahead(1.9, 1.5);
    let turned: Vec<Triangle> = pane.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    let half = DVec3::new(1.8, 1.8, 0.05);
    let (plate, across) = (block(half, -1.5), block(half, -1.0));
    let lit = |absorbs: bool, clear: &[Triangle], is_open: bool| {
        let mut scene = Scene::default();
        add(&mut scene, &body, absorbing_glass(absorbs));
        let glass = absorbing_glass(false);
        add(&mut scene, clear, Material { is_open, ..glass });
        let white = Material::lambert("wall", [ALBEDO as f32; 3]);
        add(&mut scene, &wall, white);
        add_point_light(&mut scene, DVec3::new(0.2, 0.1, -2.0), INTENSITY);
        scene
    };
    let views = eyes_at_origin(15.0);
    let expected = |absorbs: bool, clear_m: f64| -> Vec<[f32; 3]> {
        (0..24 * 24)
            .map(|pixel| {
                let ray = pixel_ray(&views[0], pixel, [24, 24]);
                let point = ray.origin + ray.direction * (3.0 / -ray.direction.z);
                let to_lamp = DVec3::new(0.2, 0.1, -2.0) - point;
                let d = to_lamp.length();
                let light = ALBEDO / PI * f64::from(INTENSITY) * (to_lamp.z / d) / (d * d);
                let inside = d + (2.0 - clear_m) / -ray.direction.z;
                SURVIVES_PER_M.map(|share| {
                    let left = if absorbs { share.powf(inside) } else { 1.0 };
                    (light * left) as f32
                })
            })
            .collect()
    };
    for kind in [Method::Photon, Method::Path] {
        // Eye, glass, wall, lamp: three segments, four with a pane, five with a plate, so nothing but this light.
        for (absorbs, clear, depth, clear_m) in [
            (true, &[][..], 3, 0.0),
            (false, &[], 3, 0.0),
            (true, &pane, 4, 0.0),
            (true, &turned, 4, 0.0),
            (true, &plate, 5, 0.1),
            (true, &across, 5, 0.05),
        ] {
            let settings = settings_of(kind, Technique::Mis, depth, 1);
            let scene = lit(absorbs, clear, depth == 4);
            let found = &images(&scene, &settings, [24, 24], &views)[0];
            // Some 60 operations at 2^-24, exponentials of up to 8 with an error of 2^-22 in their argument.
            let off = worst(found, &expected(absorbs, clear_m));
            let what = format!("{kind:?}, absorbing {absorbs}, {depth} segments");
            assert!(off < 1e-4, "{what}: {off:e}");
            // Negative control.
            assert!(worst(found, &expected(!absorbs, clear_m)) > 0.5, "{what}");
        }
    }
}

/// A white pane before uniform surroundings is as bright as they are, from both sides: what it does not mirror passes it.
#[test]
fn panes_keep_light() {
    let glass = Material {
        metallic: 0.0,
        transmission: 1.0,
        roughness: 0.0,
        ..Material::default()
    };
    let square = square_ahead(0.8, 1.0);
    let back: Vec<Triangle> = square.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    let views = eyes_at_origin(15.0);
    for method in [Method::Photon, Method::Path] {
        let settings = settings_of(method, Technique::Mis, 4, 1);
        for shape in [&square, &back] {
            let off = |is_open: bool| {
                let glass = Material {
                    is_open,
                    ..glass.clone()
                };
                let mut scene = Scene::default();
                add(&mut scene, shape, glass);
                scene.environment = Some(map_of([4, 2], |_, _| [0.5; 3]));
                worst(
                    &images(&scene, &settings, [16, 16], &views)[0],
                    &[[0.5; 3]; 256],
                )
            };
            // A few products of rounded numbers.
            assert!(off(true) < 1e-6, "{method:?}: {:e}", off(true));
            // Negative control: a body that has no other face.
            assert!(off(false) > 0.1);
        }
    }
}

/// Irradiance of a sun at normal incidence.
const SUN: f64 = 3.0;

/// The cube, scaled and moved along z.
fn block(half: DVec3, middle_z: f64) -> Vec<Triangle> {
    let moved = |corners: Triangle| corners.map(|p| p * half + DVec3::Z * middle_z);
    cube().into_iter().map(moved).collect()
}

/// Seen through 2 m of glass, a wall in the sun has albedo / pi times E cos, times what the eye's way through the glass leaves: one
/// wall stands behind a block, and one within a block whose top is open, by which the sun shines in. Its way there has no
/// length, and costs nothing.
#[test]
fn a_wall_in_the_sun_is_dimmed_by_what_the_eye_looks_through_alone() {
    const ALBEDO: f64 = 0.8;
    let views = eyes_at_origin(5.0);
    let closed = block(DVec3::new(0.5, 0.5, 1.0), -2.0);
    let open = block(DVec3::splat(2.0), -3.0)[..10].to_vec();
    // Segments: eye, glass, glass, wall, sun; and eye, glass, wall, sun.
    for (name, glass, wall_m, to_sun, depth) in [
        ("behind", closed, 9.0, DVec3::new(1.0, 0.0, 1.0), 4),
        ("within", open, 3.0, DVec3::new(0.0, 1.0, 0.5), 3),
    ] {
        let lit = |absorbs: bool| {
            let mut scene = Scene::default();
            add(&mut scene, &glass, absorbing_glass(absorbs));
            let white = Material::lambert("wall", [ALBEDO as f32; 3]);
            add(&mut scene, &square_ahead(1.9, wall_m), white);
            add_sun(&mut scene, to_sun, SUN as f32);
            scene
        };
        let expected = |absorbs: bool| -> Vec<[f32; 3]> {
            let light = ALBEDO / PI * SUN * to_sun.normalize().z;
            let of_pixel = |pixel| {
                let ray = pixel_ray(&views[0], pixel, [24, 24]);
                let inside = 2.0 * ray.direction.length() / -ray.direction.z;
                SURVIVES_PER_M.map(|share| {
                    let left = if absorbs { share.powf(inside) } else { 1.0 };
                    (light * left) as f32
                })
            };
            (0..24 * 24).map(of_pixel).collect()
        };
        for kind in [Method::Photon, Method::Path] {
            let settings = settings_of(kind, Technique::Mis, depth, 1);
            for absorbs in [true, false] {
                let found = &images(&lit(absorbs), &settings, [24, 24], &views)[0];
                // Some 40 operations at 2^-24, exponentials of up to 3.3 with an error of 2^-22 in their argument.
                let off = worst(found, &expected(absorbs));
                let what = format!("{name}, {kind:?}, absorbing {absorbs}");
                assert!(off < 1e-5, "{what}: {off:e}");
                // Negative control.
                assert!(worst(found, &expected(!absorbs)) > 0.5, "{what}");
            }
        }
    }
}

/// Means of the left eye's channels and their standard errors over independent frames.
fn means_of_frames(
    scene: &Scene,
    settings: &RenderSettings,
    size: u32,
    views: &[View; 2],
    frames: u32,
) -> [(f64, f64); 3] {
    let mut renderer = renderer(scene, settings, [size; 2]);
    let images = images_of(&mut renderer, views, 0..frames);
    [0, 1, 2].map(|channel| {
        let mean = |image: &Vec<[f32; 3]>| {
            let sum: f64 = image.iter().map(|pixel| f64::from(pixel[channel])).sum();
            sum / image.len() as f64
        };
        let means: Vec<f64> = images.iter().map(mean).collect();
        let (mean, square) = statistics(&means);
        (mean, square.sqrt())
    })
}

/// Under a block 1 m thick a slanted sun's photons bring E cos, times what their way of 1 m / cos leaves.
#[test]
fn photons_of_a_slanted_sun_are_dimmed_by_their_way_through_a_block() {
    const ALBEDO: f64 = 0.8;
    let slant = 30.0_f64.to_radians();
    let lit = |absorbs: bool| {
        let mut scene = Scene::default();
        // Behind the eye, and so wide that all light on what the eye sees comes in by its front.
        let glass = block(DVec3::new(2.0, 2.0, 0.5), 1.0);
        add(&mut scene, &glass, absorbing_glass(absorbs));
        let white = Material::lambert("wall", [ALBEDO as f32; 3]);
        add(&mut scene, &square_ahead(0.8, 1.0), white);
        add_sun(
            &mut scene,
            DVec3::new(slant.sin(), 0.0, slant.cos()),
            SUN as f32,
        );
        scene
    };
    let views = eyes_at_origin(15.0);
    let settings = settings(|s| {
        s.reuse = Reuse::Off;
        s.photon.count = 131_072;
        s.photon.radius_m = 0.1;
        s.photon.caustic_radius_m = 0.1;
        s.photon.every_frame = true;
        // Sun, glass, glass, wall, eye.
        s.photon.max_depth = 4;
    });
    for absorbs in [true, false] {
        let means = means_of_frames(&lit(absorbs), &settings, 16, &views, 8);
        for ((mean, error), share) in means.into_iter().zip(SURVIVES_PER_M) {
            let after = |way_m: f64| {
                ALBEDO / PI * SUN * slant.cos() * if absorbs { share.powf(way_m) } else { 1.0 }
            };
            let due = after(1.0 / slant.cos());
            let what = format!("{share} a metre: {mean:.5} +- {error:.5}, {due:.5} is due");
            eprintln!("{what}");
            // Student's t with 7 degrees of freedom lies beyond 5 with probability 1.6e-3; photons fall evenly, so that discs add no bias.
            let is_due = |due: f64| (mean - due).abs() <= 5.0 * error;
            assert!(is_due(due), "{what}");
            // Negative controls: the block's thickness in place of the way through it, and 5 % more.
            assert!(!absorbs || share > 0.7 || !is_due(after(1.0)), "{what}");
            assert!(!is_due(1.05 * due), "{what}");
        }
    }
}

/// Two metres behind the front of a block of absorbing glass a polished metal in the light of a lamp, and a wall in that of a glowing
/// ceiling: what a path finds by chance, at the surface behind the first one and by a surface's own direction.
#[test]
fn light_that_paths_find_by_chance_inside_an_absorbing_body_is_dimmed() {
    const SIZE: u32 = 16;
    const ALBEDO: f64 = 0.8;
    const LIGHT: f64 = 7.0;
    const WALL_Z: f64 = -3.0;
    let within = |material: Material| {
        let mut scene = Scene::default();
        add(
            &mut scene,
            &block(DVec3::splat(2.0), WALL_Z),
            absorbing_glass(true),
        );
        add(&mut scene, &square_ahead(1.9, -WALL_Z), material);
        scene
    };
    // Where its lobe is wide over pixels and narrow enough to be followed.
    let metal = Material {
        base_color: [ALBEDO as f32, ALBEDO as f32, ALBEDO as f32, 1.0],
        metallic: 1.0,
        roughness: 0.2,
        ..Material::default()
    };
    let twin = Twin::new(&metal, 0);
    let mut polished = within(metal);
    let lamp = DVec3::new(0.02, 0.01, -2.0);
    add_point_light(&mut polished, lamp, LIGHT as f32);
    let highlight = eyes_at_origin(3.0);
    let of_pixel = |pixel: usize| {
        let ray = pixel_ray(&highlight[0], pixel, [SIZE; 2]);
        let to_eye = -ray.direction.normalize();
        let to_lamp = lamp - ray.origin - ray.direction * (WALL_Z / ray.direction.z);
        let (wi, d) = (to_lamp.normalize(), to_lamp.length());
        let light = twin.eval(to_eye, wi)[0] * LIGHT * wi.z / (d * d);
        SURVIVES_PER_M.map(|share| light * share.powf(d + 2.0 / to_eye.z))
    };
    let count = (SIZE * SIZE) as usize;
    let by_lamp = (0..count).map(of_pixel).fold([0.0; 3], |sum, pixel| {
        [0, 1, 2].map(|channel| sum[channel] + pixel[channel] / count as f64)
    });
    let mut under_ceiling = within(Material::lambert("wall", [ALBEDO as f32; 3]));
    let (height, [near, far]) = (0.5, [-2.9, -1.9]);
    let corner = DVec3::new(-1.0, height, near);
    let ceiling = quad(corner, 2.0 * DVec3::X, (far - near) * DVec3::Z);
    add(&mut under_ceiling, &ceiling, glowing([LIGHT as f32; 3]));
    // At the wall's middle, of which a degree is seen; the light bends over that by 1e-3 of itself at most.
    let middle = eyes_at_origin(0.5);
    let from_middle = -middle[0].position_in_world.x;
    let by_ceiling = SURVIVES_PER_M.map(|share| {
        let arriving = |x: f64, z: f64| {
            let square = (x + from_middle).powi(2) + height * height + (z - WALL_Z).powi(2);
            LIGHT * (z - WALL_Z) * height / (square * square) * share.powf(square.sqrt())
        };
        ALBEDO / PI * share.powi(2) * integrate(&arriving, [-1.0, 1.0], [near, far], 0)
    });
    for (name, scene, views, due) in [
        ("metal", polished, highlight, by_lamp),
        ("wall", under_ceiling, middle, by_ceiling),
    ] {
        for kind in [Method::Photon, Method::Path] {
            // Eye, glass, surface, light. One sample goes through a pixel's centre.
            let settings = settings_of(kind, Technique::Mis, 3, 1);
            let means = means_of_frames(&scene, &settings, SIZE, &views, 128);
            for ((mean, error), due) in means.into_iter().zip(due) {
                let what = format!("{name}, {kind:?}: {mean:.5} +- {error:.5}, {due:.5} is due");
                eprintln!("{what}");
                let is_due = |due: f64| (mean - due).abs() <= 4.0 * error + 1e-3 * due;
                assert!(is_due(due), "{what}");
                // Negative control.
                assert!(!is_due(1.1 * due), "{what}: 10 % more passes");
            }
        }
    }
}
