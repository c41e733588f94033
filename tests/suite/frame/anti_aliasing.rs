//! Samples that are spread over the pixel from frame to frame: where they lie, what their mean over frames is, and what it
//! must not keep or lose.

use std::f64::consts::PI;

use glam::{DAffine3, DQuat, DVec3};
use stereolux::renderer::{Eye, InstanceId, Renderer};
use stereolux::scene::{AlphaMode, Material, Scene};
use stereolux::settings::{Method, RenderSettings, Reuse};
use stereolux::xr::{Pose, View};

use super::hard_support::{add, eyes_at, eyes_at_origin, quad};
use super::lights_sampling::map_of;
use super::support::{
    both_bits, builtin, mean, method, parallel_views, play, radiance, renderer, square_fov,
    start_views, statistics,
};

const SIZE: u32 = 32;
/// Frames after which the offsets begin again.
const CYCLE: u32 = 64;

/// What `auto` switches on.
fn sequence(kind: Method, reuse: Reuse) -> RenderSettings {
    let mut settings = method(kind, reuse);
    settings.decide_switches(true);
    settings
}

/// Where in its pixel each of an eye's rays that meet something passes, from the centre, in pixels.
fn offsets(renderer: &Renderer, view: &View, eye: Eye) -> Vec<[f64; 2]> {
    let t = view.fov.tangents();
    let size = f64::from(SIZE);
    let rays = renderer.read_hit_rays(eye).unwrap().unwrap();
    let of = |(pixel, ray): (usize, &[f32; 4])| {
        let direction = DVec3::new(ray[0].into(), ray[1].into(), ray[2].into());
        let p = view.orientation.inverse() * direction;
        let x = (p.x / -p.z - t.left) / (t.right - t.left) * size;
        let y = (t.up - p.y / -p.z) / (t.up - t.down) * size;
        let [column, row] = [pixel as u32 % SIZE, pixel as u32 / SIZE].map(f64::from);
        [x - column - 0.5, y - row - 0.5]
    };
    let hits = rays.iter().enumerate().filter(|(_, ray)| ray[3] > 0.0);
    hits.map(of).collect()
}

#[test]
fn both_eyes_rays_pass_where_the_frame_says_and_frames_alone_keep_the_centre() {
    let scene = builtin("cornell");
    let views = start_views(&scene, 21.0);
    for (kind, reuse) in [
        (Method::Photon, Reuse::Scatter),
        (Method::Photon, Reuse::Lookup),
        (Method::Path, Reuse::Off),
    ] {
        // A tangent of up to 0.4 in f32, of which a pixel is 0.024: 8 roundings of 6e-8 * 0.4 / 0.024.
        let tolerance = 1e-5;
        let mut alone = renderer(&scene, &method(kind, reuse), [SIZE, SIZE]);
        let mut over_time = renderer(&scene, &sequence(kind, reuse), [SIZE, SIZE]);
        let mut places = Vec::new();
        for frame in 0..CYCLE + 1 {
            play(&mut alone, &views, frame..frame + 1);
            play(&mut over_time, &views, frame..frame + 1);
            let [left, right] = [(Eye::Left, 0), (Eye::Right, 1)].map(|(eye, index)| {
                for [x, y] in offsets(&alone, &views[index], eye) {
                    assert!(x.abs() < tolerance && y.abs() < tolerance, "{x} {y}");
                }
                let found = offsets(&over_time, &views[index], eye);
                assert!(found.len() > 500, "{}", found.len());
                for place in &found {
                    for (one, first) in place.iter().zip(found[0]) {
                        assert!((one - first).abs() < 2.0 * tolerance, "{kind:?} {reuse:?}");
                    }
                }
                found[0]
            });
            assert!((left[0] - right[0]).abs() + (left[1] - right[1]).abs() < 4.0 * tolerance);
            places.push(left);
        }
        assert!((places[0][0] - places[CYCLE as usize][0]).abs() < 2.0 * tolerance);
        places.pop();
        // Nets: each of the 8, 16, 32 or 64 cells of all ways to part the pixel evenly by powers of two holds one of as many
        // frames in a row, which bounds their discrepancy; and the mean of either coordinate is 0.
        for bits in 3..7 {
            let count = 1_usize << bits;
            let blocks = places.chunks(count);
            for (block, wide) in blocks.flat_map(|b| (0..=bits).map(move |wide| (b, wide))) {
                let (columns, rows) = (1_usize << wide, count >> wide);
                let mut held = vec![0; count];
                for [x, y] in block {
                    let cell = |at: f64, count: usize| ((at + 0.5) * count as f64) as usize;
                    held[cell(*y, rows) * columns + cell(*x, columns)] += 1;
                }
                assert_eq!(held, vec![1; count], "{columns} by {rows}");
            }
        }
        for axis in 0..2 {
            let mean = places.iter().map(|place| place[axis]).sum::<f64>() / f64::from(CYCLE);
            assert!(mean.abs() < tolerance, "{mean}");
        }
    }
}

#[test]
fn equal_eyes_stay_equal_while_the_head_moves() {
    let scene = builtin("gallery");
    let start = scene.start_pose();
    for (kind, reuse) in [
        (Method::Photon, Reuse::Scatter),
        (Method::Photon, Reuse::Off),
        (Method::Path, Reuse::Lookup),
    ] {
        let mut settings = sequence(kind, reuse);
        settings.photon.count = 2000;
        let mut renderer = renderer(&scene, &settings, [SIZE, SIZE]);
        for frame in 0..4 {
            let turn = DQuat::from_rotation_y(0.01 * f64::from(frame));
            let head = Pose::new(start.position, turn * start.orientation);
            let views = parallel_views(head, 0.0, square_fov(35.0));
            play(&mut renderer, &views, frame..frame + 1);
            let [left, right] = both_bits(&renderer);
            assert!(left == right, "{kind:?} {reuse:?}, frame {frame}");
        }
    }
}

#[test]
fn a_still_head_converges_to_the_mean_over_the_pixels_area() {
    let scene = builtin("cornell");
    let views = start_views(&scene, 21.0);
    // As many pictures of either kind, each with a seed of its own.
    const PICTURES: u32 = 8;
    let pictures = |spp: u32, frames: u32, first_seed: u32| -> Vec<Vec<[f32; 3]>> {
        let one = |seed| {
            let mut settings = method(Method::Path, Reuse::Off);
            settings.seed = seed;
            settings.spp = spp;
            settings.decide_switches(true);
            let mut renderer = renderer(&scene, &settings, [SIZE, SIZE]);
            play(&mut renderer, &views, 0..frames);
            radiance(&renderer, Eye::Right)
        };
        (first_seed..first_seed + PICTURES).map(one).collect()
    };
    let frames = RenderSettings::default().reconstruct.still_until;
    let still = pictures(1, frames, 100);
    let reference = pictures(64, 1, 200);
    // Means of whole pictures: Student's t with 14 degrees of freedom is beyond 4.14 in one of a thousand.
    let of = |pictures: &[Vec<[f32; 3]>]| {
        let means: Vec<f64> = pictures.iter().map(|picture| mean(picture)).collect();
        statistics(&means)
    };
    let ((found, variance), (expected, expected_variance)) = (of(&still), of(&reference));
    let t = (found - expected) / (variance + expected_variance).sqrt();
    assert!(t.abs() < 4.14, "{found}, expected {expected}: t = {t}");
    let off = (found / expected - 1.0).abs();
    assert!(off < 0.01, "{found}, expected {expected}");
    // And of single pixels: the mean of t^2 is 14 / 12. Its own spread is that of a mean over 1024 pixels, one channel, of
    // values whose variance is 2 * 14^2 * 13 / (12^2 * 10) = 3.54: 0.059. Five of those, and as much for the tails that
    // paths have and the normal distribution has not.
    let mut sum = 0.0;
    let pixels = (SIZE * SIZE) as usize;
    for pixel in 0..pixels {
        let of = |pictures: &[Vec<[f32; 3]>]| {
            let values: Vec<_> = pictures.iter().map(|p| f64::from(p[pixel][1])).collect();
            statistics(&values)
        };
        let ((found, variance), (expected, expected_variance)) = (of(&still), of(&reference));
        sum += (found - expected).powi(2) / (variance + expected_variance).max(1e-12);
    }
    let square = sum / pixels as f64;
    assert!(square < 14.0 / 12.0 + 0.6, "mean of t^2: {square}");
}

/// By paths, without the mean over still frames, which would hide what the history does.
fn by_history(scene: &Scene) -> Renderer {
    let mut settings = sequence(Method::Path, Reuse::Off);
    settings.reconstruct.still = false.into();
    renderer(scene, &settings, [SIZE, SIZE])
}

/// Surfaces that only shine, before one another: (left, bottom, width, height, depth ahead), metres, and radiance.
fn shining(parts: &[([f64; 5], f32)]) -> Scene {
    let mut scene = Scene::default();
    for (index, ([x, y, width, height, ahead], emission)) in parts.iter().enumerate() {
        let material = Material {
            emission: [*emission; 3],
            ..Material::lambert(&format!("part {index}"), [0.0; 3])
        };
        let corner = DVec3::new(*x, *y, -ahead);
        let quad = quad(corner, DVec3::X * *width, DVec3::Y * *height);
        add(&mut scene, &quad, material);
    }
    scene
}

#[test]
fn a_moving_block_leaves_no_ghost_after_three_frames() {
    // At 2 m a pixel is 4 m / 32 = 0.125 m wide. The block is 8 pixels wide and 20 times as bright, or as dark, as the wall.
    const PIXEL_M: f64 = 0.125;
    for (steps_px, block) in [
        (3.0, 2.0),
        (0.7, 2.0),
        (3.0, 0.005),
        (2.5, 0.005),
        (0.7, 0.005),
    ] {
        let scene = shining(&[
            ([-4.0, -4.0, 8.0, 8.0, 2.0], 0.1),
            ([-2.0, -0.5, 1.0, 1.0, 1.999], block),
        ]);
        let [darker, brighter] = [block.min(0.1), block.max(0.1)];
        for kind in [Method::Path, Method::Photon] {
            let mut renderer = renderer(&scene, &sequence(kind, Reuse::Scatter), [SIZE, SIZE]);
            let views = eyes_at_origin(45.0);
            let (mut mixed, mut behind) = (0, 0);
            for frame in 0..12_u32 {
                let x = steps_px * PIXEL_M * f64::from(frame);
                let place = DAffine3::from_translation(DVec3::X * x);
                let moved = renderer.set_instance_transform(InstanceId(1), place);
                assert_eq!(moved, frame > 0);
                play(&mut renderer, &views, frame..frame + 1);
                if frame < 4 {
                    continue;
                }
                let shown = radiance(&renderer, Eye::Left);
                // The block's left edge three frames ago, in the left eye's pixels: 16 is straight ahead of it.
                let edge = 16.0 + (-2.0 + x - 3.0 * steps_px * PIXEL_M + 0.0315) / PIXEL_M;
                for (pixel, light) in shown.iter().enumerate() {
                    let x = f64::from(pixel as u32 % SIZE);
                    // A pixel to the left of it, none of the block's light has been there for three frames.
                    if x + 1.0 < edge - 1.0 {
                        behind += 1;
                        let off = (light[0] / 0.1 - 1.0).abs();
                        assert!(
                            off < 0.02,
                            "{block}, {steps_px}, {kind:?}, {frame}, {pixel}: {light:?}"
                        );
                    }
                    mixed += u32::from((2.0 * darker..0.95 * brighter).contains(&light[0]));
                }
            }
            assert!(behind > 400, "{behind}");
            // Its edges are smooth.
            assert!(mixed > 50, "{mixed}");
        }
    }
}

/// A black pane before a wall that shines: whichever of the two a pixel met in the frames before, by chance, each counts as often as it
/// is met while the head turns.
#[test]
fn what_is_seen_through_a_pane_counts_as_often_as_it_is_met() {
    const WIDE: u32 = 64;
    const FRAMES: u32 = 24;
    for covered in [0.8_f32, 0.34] {
        let mut scene = shining(&[([-60.0, -60.0, 120.0, 120.0, 30.0], 1.0)]);
        let mut pane = Material::lambert("pane", [0.0; 3]);
        pane.base_color[3] = covered;
        pane.alpha_mode = AlphaMode::Blend;
        let corner = DVec3::new(-30.0, -30.0, -15.0);
        let sides = [60.0 * DVec3::X, 60.0 * DVec3::Y];
        add(&mut scene, &quad(corner, sides[0], sides[1]), pane);
        let settings = sequence(Method::Path, Reuse::Off);
        let mut renderer = renderer(&scene, &settings, [WIDE, WIDE]);
        let mut sum = 0.0;
        for frame in 0..FRAMES {
            // Half a pixel of 90 degrees / 64.
            let turn = DQuat::from_rotation_y(0.012 * f64::from(frame));
            let views = eyes_at(DVec3::ZERO, turn, 45.0);
            play(&mut renderer, &views, frame..frame + 1);
            if frame >= FRAMES / 2 {
                sum += mean(&radiance(&renderer, Eye::Left)) * 2.0 / f64::from(FRAMES);
            }
        }
        // 49,152 samples, no noisier than independent ones: 0.9 % of 0.2. Twice that and more was found where what no pixel
        // around had seen in the frame before began anew: 7 to 9 %, and -2 % of 0.66, of which chance is 0.3 %.
        let expected = f64::from(1.0 - covered);
        let error = (expected * (1.0 - expected) / f64::from(WIDE * WIDE * FRAMES / 2)).sqrt();
        let off = (sum - expected) / error;
        assert!(off.abs() < 4.0, "{covered}: {sum}, {off} standard errors");
    }
}

#[test]
fn a_lamp_thinner_than_a_pixel_keeps_its_energy() {
    // At 2 m a pixel is 0.125 m wide; the lamp is half a pixel wide, five high, and stands before a
    // black wall.
    const PIXEL_M: f64 = 0.125;
    let (left, bottom) = (-2.03, -0.31);
    for radiance_of_lamp in [5.0, 500.0] {
        for moves in [false, true] {
            let lamp = [left, bottom, 0.5 * PIXEL_M, 5.0 * PIXEL_M, 2.0];
            let wall = ([-8.0, -8.0, 16.0, 16.0, 2.001], 0.0);
            let scene = shining(&[wall, (lamp, radiance_of_lamp)]);
            let mut renderer = by_history(&scene);
            let mut sum = 0.0;
            for frame in 0..2 * CYCLE {
                // By whole pixels, so that history is read at pixels and the offsets meet the lamp alike in each cycle: to and
                // fro between two places eight pixels apart.
                let step = match frame % 16 {
                    step if moves => f64::from(step.min(16 - step)),
                    _ => 0.0,
                };
                let views = eyes_at(DVec3::X * (-PIXEL_M * step), DQuat::IDENTITY, 45.0);
                play(&mut renderer, &views, frame..frame + 1);
                if frame >= CYCLE {
                    let shown = radiance(&renderer, Eye::Left);
                    sum += mean(&shown) * f64::from(SIZE * SIZE) / f64::from(CYCLE);
                }
            }
            let energy = sum / f64::from(radiance_of_lamp);
            // The columns of 64 offsets are a 64th of a pixel apart, so 32 of 64 meet a lamp half a pixel wide, 160 in all.
            // The history is a linear filter of a signal with that period, whose mean over a cycle is the signal's; what the
            // first frames lacked is down to 0.8^48 = 2e-5 of it. Only the rows at its two ends part a column's samples: a
            // part of a net between two lines is off by at most log2(64) / 2 + 1 = 4 samples, at either end: 8 of 160, 5 %.
            let off = (energy / 2.5 - 1.0).abs();
            let what = format!("radiance {radiance_of_lamp}, moves {moves}");
            assert!(off < 0.05, "{what}: {energy} pixels of 2.5");
        }
    }
}

#[test]
fn a_sun_smaller_than_a_pixel_keeps_its_light_as_the_head_turns() {
    // Straight ahead a pixel of 3.6 degrees is 2.5 texels of 1.4 degrees wide.
    let (width, height, radiance_of_sun) = (256, 128, 1000.0);
    let texel = |x, y| {
        [if (x, y) == (130, 60) {
            radiance_of_sun as f32
        } else {
            0.0
        }; 3]
    };
    let scene = Scene {
        environment: Some(map_of([width, height], texel)),
        ..Scene::default()
    };
    let step = PI / f64::from(height);
    let (elevation, azimuth) = (3.5 * step, 2.5 * step);
    let towards = DQuat::from_rotation_y(-azimuth) * DQuat::from_rotation_x(elevation);
    let mut renderer = renderer(&scene, &sequence(Method::Photon, Reuse::Off), [SIZE, SIZE]);
    for frame in 0..40 {
        let turn = DQuat::from_rotation_y(0.006 * f64::from(frame));
        play(
            &mut renderer,
            &eyes_at(DVec3::ZERO, turn, 45.0),
            frame..frame + 1,
        );
        // On the image plane the sun's solid angle is divided by cos^3.
        let cosine = (turn.inverse() * towards * DVec3::NEG_Z).dot(DVec3::NEG_Z);
        let pixels = step * step * elevation.cos() / cosine.powi(3) * 16.0 * 16.0;
        let shown = radiance(&renderer, Eye::Left);
        let found = mean(&shown) * 1024.0 / radiance_of_sun;
        // As in crates/gpu/tests/suite/surroundings.rs: 1.7 %, and 1 % for the sun's width.
        let off = (found / pixels - 1.0).abs();
        assert!(off < 0.027, "{frame}: {found} of {pixels}");
        // Nothing stood before it, so no history has a part in it. A pixel's mean reads texels up to 1.25 + 1.4 from its centre
        // (more on a slant), so that 3x3 pixels read the sun, 4x4 at most.
        let lit = shown.iter().filter(|light| light[0] > 0.0).count();
        assert!(lit <= 16, "{frame}: {lit}");
    }
}

#[test]
fn a_lamp_does_not_leak_to_pixels_that_never_saw_it() {
    // At 2 m a pixel is 0.125 m wide. The lamp's right edge moves to the right by a 25th of a pixel per frame: the history of the
    // pixels before it is read between them and the lamp, which they never saw.
    const PIXEL_M: f64 = 0.125;
    let right = -0.0315 - 1.6 * PIXEL_M;
    let scene = shining(&[
        ([-8.0, -8.0, 16.0, 16.0, 2.001], 0.0),
        ([right - 1.0, -1.0, 1.0, 2.0, 2.0], 50.0),
    ]);
    let mut renderer = by_history(&scene);
    for frame in 0..40 {
        let aside = DVec3::X * (-0.04 * PIXEL_M * f64::from(frame));
        let views = eyes_at(aside, DQuat::IDENTITY, 45.0);
        play(&mut renderer, &views, frame..frame + 1);
    }
    // The left eye began at -0.0315 m, with the edge at its column 16 - 1.6, and has seen it move by 1.56.
    let shown = radiance(&renderer, Eye::Left);
    let row = &shown[16 * SIZE as usize..17 * SIZE as usize];
    assert!(row[10..14].iter().all(|light| light[0] > 49.0), "{row:?}");
    assert!(row[15][0] > 1.0 && row[15][0] < 49.0, "{row:?}");
    assert!(row[16..].iter().all(|light| *light == [0.0; 3]), "{row:?}");
}

#[test]
fn an_edge_in_the_images_last_row_is_smooth() {
    // Half of the row's height shows a surface, half nothing: what would tell that neither is new lies outside the image.
    const PIXEL_M: f64 = 0.125;
    let bottom = -15.5 * PIXEL_M;
    let scene = shining(&[([-8.0, bottom, 16.0, 16.0, 2.0], 1.0)]);
    let mut renderer = by_history(&scene);
    let views = eyes_at_origin(45.0);
    for frame in 0..CYCLE {
        play(&mut renderer, &views, frame..frame + 1);
        // Any 16 frames from a multiple of 16 meet the surface 8 times; in no 8 in a row does a net in base 2 miss it, so that
        // at least 0.2 * 0.8^7 = 0.04 of either is left.
        if frame >= 16 {
            let shown = radiance(&renderer, Eye::Left);
            let last = &shown[(SIZE * (SIZE - 1)) as usize..];
            let inside = |light: &[f32; 3]| (0.04..0.96).contains(&light[0]);
            assert!(last.iter().all(inside), "frame {frame}: {last:?}");
        }
    }
}
