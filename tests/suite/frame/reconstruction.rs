//! Filtering over time, neighbours and eyes: motion vectors, what the filter must leave alone, and what it gains.

use glam::{DAffine3, DQuat, DVec3};
use stereolux::gpu::ShaderLibrary;
use stereolux::images::{Image, aces_filmic, luminance};
use stereolux::metrics::{binocular_error, error_image};
use stereolux::renderer::{Eye, InstanceId, Renderer};
use stereolux::scene::{self, Filter, Instance, Material, Mesh, Node, Scene, Texture, TextureRef};
use stereolux::settings::{Eyes, Method, RenderSettings, Reuse};
use stereolux::xr::{Pose, View};

use super::hard_support::{add, square_ahead};
use super::layout::changed;
use super::support::{
    assert_clean, bits, both, builtin, mean, method, parallel_views, placed, play, radiance,
    renderer, renderer_by, square_fov, start_views,
};
use crate::suite::embedded_scenes::plane;

pub const SIZE: u32 = 64;
const PIXELS: usize = (SIZE * SIZE) as usize;
/// The width of the human head's eyes, metres.
pub const IPD_M: f64 = 0.063;

/// The path method with the filter on, changed by `change`.
pub fn filtered(reuse: Reuse, change: impl FnOnce(&mut RenderSettings)) -> RenderSettings {
    let mut settings = method(Method::Path, reuse);
    settings.reconstruct.svgf = true.into();
    change(&mut settings);
    settings
}

/// Views that the Cornell box fills.
fn filling_views(scene: &Scene) -> [View; 2] {
    start_views(scene, 21.0)
}

/// Every filter over time on.
fn filter_all(settings: &mut RenderSettings) {
    settings.reconstruct.svgf = true.into();
    settings.reconstruct.taa = true.into();
}

fn rel_mse(image: &[[f32; 3]], reference: &[[f32; 3]]) -> f64 {
    super::cornell::rel_mse(image, reference, &[true; PIXELS])
}

/// The left eye's mean of `frames` frames of one sample, spread over the pixels, with another seed than what it judges.
fn mean_of_frames(scene: &Scene, views: &[View; 2], frames: u32) -> Vec<[f32; 3]> {
    let mut settings = method(Method::Path, Reuse::Off);
    settings.seed = 1234;
    settings.reconstruct.still = true.into();
    settings.reconstruct.still_from = 0;
    settings.reconstruct.still_until = 1;
    let library = ShaderLibrary::embedded();
    let renderer = renderer_by(&library, scene, &settings, Eyes::Left, [SIZE, SIZE]);
    let mut renderer = renderer.unwrap();
    play(&mut renderer, views, 0..frames);
    radiance(&renderer, Eye::Left)
}

/// Displacement of every pixel of the second frame, and whether it is known.
fn motion(renderer: &Renderer, eye: Eye) -> Vec<[f32; 4]> {
    renderer.read_motion(eye).unwrap().unwrap().1
}

/// Continuous pixel position of a world point in f64; `None` behind the eye.
pub fn project(view: &View, point: DVec3) -> Option<[f64; 2]> {
    let p = view.orientation.inverse() * (point - view.position_in_world);
    let t = view.fov.tangents();
    let (tx, ty) = (p.x / -p.z, p.y / -p.z);
    let size = f64::from(SIZE);
    (p.z < 0.0).then_some([
        (tx - t.left) / (t.right - t.left) * size,
        (t.up - ty) / (t.up - t.down) * size,
    ])
}

/// Where in the pixel a record of what is seen lies, from the centre, in pixels: two signed 16-bit fractions.
pub fn place_in_pixel(record: &[u32; 4]) -> [f64; 2] {
    [record[3] as i16, (record[3] >> 16) as i16].map(|part| f64::from(part) / 32767.0)
}

/// Where in the image the sample of a pixel with this record lies, in pixels.
pub fn sample_at(pixel: usize, record: &[u32; 4]) -> [f64; 2] {
    let [x, y] = place_in_pixel(record);
    let [column, row] = [pixel as u32 % SIZE, pixel as u32 / SIZE].map(f64::from);
    [column + 0.5 + x, row + 0.5 + y]
}

/// The target: the previous frame's surface point is met to within a sixteenth of a pixel.
pub const MOTION_TOLERANCE_PX: f64 = 1.0 / 16.0;

#[test]
fn motion_of_eyes_and_instances_leads_to_the_surface_point_of_the_frame_before() {
    // Far from the world's origin: places are formed in f64.
    let far = DVec3::new(1.0e5, -3.0e4, 2.0e5);
    let scene = placed(builtin("plane"), DAffine3::from_translation(far));
    let at_rest = DAffine3::from_translation(far);
    let head = |step: f64| {
        Pose::new(
            far + DVec3::new(0.05, -0.02, 0.04) * step,
            DQuat::from_euler(glam::EulerRot::YXZ, 0.04 * step, 0.02 * step, -0.05 * step),
        )
    };
    // The plane, moved and turned about its own middle.
    let turned = |step: f64| {
        let middle = DVec3::NEG_Z * plane::DISTANCE_M;
        at_rest
            * DAffine3::from_translation(middle + DVec3::new(0.1, 0.0, 0.05) * step)
            * DAffine3::from_rotation_y(0.06 * step)
            * DAffine3::from_translation(-middle)
    };
    for (eyes_move, plane_moves) in [(true, false), (false, true), (true, true)] {
        let settings = filtered(Reuse::Scatter, |_| {});
        let mut renderer = renderer(&scene, &settings, [SIZE, SIZE]);
        let views = |step: f64| {
            let head = head(if eyes_move { step } else { 0.0 });
            parallel_views(head, IPD_M, square_fov(45.0))
        };
        let place = |step: f64| turned(if plane_moves { step } else { 0.0 });
        for step in [0.0, 1.0] {
            renderer.set_instance_transform(InstanceId(0), place(step));
            play(&mut renderer, &views(step), step as u32..step as u32 + 1);
        }
        for (eye, index) in [(Eye::Left, 0), (Eye::Right, 1)] {
            let (now, before) = (views(1.0)[index], views(0.0)[index]);
            let (seen, moved) = renderer.read_motion(eye).unwrap().unwrap();
            let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
            for (pixel, moved) in moved.iter().enumerate() {
                // Where the pixel's sample lies, in steps of 1 / 32767 pixels.
                let at = sample_at(pixel, &seen[pixel]);
                let ray = now.ray_through_pixel(at[0], at[1], SIZE, SIZE);
                let object_from_world = place(1.0).inverse();
                let origin = object_from_world.transform_point3(ray.origin);
                let direction = object_from_world.transform_vector3(ray.direction);
                let in_object = origin - direction * ((origin.z + plane::DISTANCE_M) / direction.z);
                let then = place(0.0).transform_point3(in_object);
                let expected = project(&before, then).unwrap();
                assert_eq!(moved[3], 1.0, "pixel {pixel} has no history");
                for axis in 0..2 {
                    let displacement = expected[axis] - at[axis];
                    worst = worst.max((f64::from(moved[axis]) - displacement).abs());
                    largest = largest.max(displacement.abs());
                }
            }
            let what = format!("{eye:?}, eyes {eyes_move}, plane {plane_moves}");
            assert!(worst < MOTION_TOLERANCE_PX, "{what}: {worst} pixels");
            // Negative control: no motion at all would be found out.
            assert!(largest > 20.0 * MOTION_TOLERANCE_PX, "{what}: {largest}");
        }
    }
}

#[test]
fn equal_eyes_move_alike() {
    let scene = builtin("cornell");
    let head = scene.start_pose();
    for reuse in [Reuse::Scatter, Reuse::Lookup] {
        let mut renderer = renderer(&scene, &filtered(reuse, |_| {}), [SIZE, SIZE]);
        // Eyes apart first and last: a copied eye must not go by what such a frame has left.
        for (frame, ipd_m) in [(0, IPD_M), (1, 0.0), (2, 0.0), (3, IPD_M)] {
            let step = Pose::new(DVec3::X * (0.01 * f64::from(frame)), DQuat::IDENTITY);
            let views = parallel_views(head.then(&step), ipd_m, square_fov(21.0));
            renderer.render_frame(&views, frame, |_| {}).unwrap();
            let [left, right] = Eye::ALL.map(|eye| motion(&renderer, eye));
            let moved = left.iter().filter(|moved| moved[0].abs() > 0.1).count();
            match frame {
                2 => {
                    assert!(left == right, "{reuse:?}: equal eyes move apart");
                    assert!(moved > PIXELS / 2, "{reuse:?}: {moved} pixels moved");
                }
                // Negative control.
                3 => assert!(left != right, "{reuse:?}: eyes apart move alike"),
                _ => {}
            }
        }
    }
}

#[test]
fn a_surface_that_was_not_there_has_no_history() {
    let scene = builtin("plane");
    let settings = filtered(Reuse::Off, |_| {});
    let mut renderer = renderer(&scene, &settings, [SIZE, SIZE]);
    let views = parallel_views(Pose::IDENTITY, IPD_M, square_fov(45.0));
    play(&mut renderer, &views, 0..1);
    assert!(motion(&renderer, Eye::Left).iter().all(|m| m[3] == 0.0));
    play(&mut renderer, &views, 1..2);
    assert!(motion(&renderer, Eye::Left).iter().all(|m| m[3] == 1.0));
    // In front of the old one, new in this frame.
    let nearer = DAffine3::from_translation(DVec3::Z * 0.5);
    renderer.add_instance(0, nearer).unwrap();
    play(&mut renderer, &views, 2..3);
    assert!(motion(&renderer, Eye::Left).iter().all(|m| m[3] == 0.0));
    play(&mut renderer, &views, 3..4);
    assert!(motion(&renderer, Eye::Left).iter().all(|m| m[3] == 1.0));
}

#[test]
fn light_without_noise_passes_the_filter() {
    // A point light on one plane: every sample is exact, its variance 0, and so neighbours of another brightness weigh
    // nothing: 4 standard deviations of 0 and LEAST_DEVIATION = 1e-6 against differences of 1e-3 and more from pixel to
    // pixel. The first three frames alone take their neighbours' spread for noise.
    let mut scene = builtin("plane");
    let views = parallel_views(Pose::IDENTITY, IPD_M, square_fov(45.0));
    for (stereo, metallic) in [(false, 0.0), (true, 0.0), (true, 1.0)] {
        scene.materials[0].metallic = metallic;
        let settings = filtered(Reuse::Off, |s| s.reconstruct.stereo = stereo);
        let mut renderer = renderer(&scene, &settings, [SIZE, SIZE]);
        // The samples lie elsewhere in the pixel each frame: the filter must leave their exponential mean.
        let mut mean = vec![0.0; PIXELS];
        for frame in 0..40 {
            play(&mut renderer, &views, frame..frame + 1);
            let share = f64::max(0.2, 1.0 / f64::from(frame + 1));
            let raw = renderer.read_samples(Eye::Left).unwrap().unwrap();
            for (mean, raw) in mean.iter_mut().zip(&raw) {
                *mean += share * (f64::from(raw[0]) - *mean);
            }
        }
        let clean = radiance(&renderer, Eye::Left);
        let pairs = mean.iter().zip(&clean);
        let off = pairs.map(|(mean, b)| (f64::from(b[0]) / mean - 1.0).abs());
        let worst = off.fold(0.0, f64::max);
        // What those leave decays by 0.8 per frame: of an error under 20 % then, 0.75 * 0.8^36 * 0.2 = 5e-5 are left. Light is
        // packed within 2^-14, three times in each frame of the five that the history is worth, and thrice on its way out. The
        // other eye's light, off between its samples or, on metal, another, is not taken in: no noise explains it.
        let tolerance = 5e-5 + 18.0 / 16384.0;
        assert!(worst < tolerance, "stereo {stereo}, {metallic}: {worst}");
    }
}

#[test]
fn filtered_frames_come_near_the_reference_and_keep_its_brightness() {
    let scene = builtin("cornell");
    let views = filling_views(&scene);
    // The raw frame's relMSE is about 0.16, the filtered one's 0.005: 500 frames leave 0.0003 of noise in the reference.
    let reference = mean_of_frames(&scene, &views, 500);
    let settings = filtered(Reuse::Off, |s| s.reconstruct.taa = true.into());
    let library = ShaderLibrary::embedded();
    let renderer = renderer_by(&library, &scene, &settings, Eyes::Left, [SIZE, SIZE]);
    let mut renderer = renderer.unwrap();
    play(&mut renderer, &views, 0..32);
    let raw = renderer.read_samples(Eye::Left).unwrap().unwrap();
    let clean = radiance(&renderer, Eye::Left);
    assert_clean(&clean, "filtered");
    let (before, after) = (rel_mse(&raw, &reference), rel_mse(&clean, &reference));
    assert!(after < 0.1 * before, "relMSE {before}, {after} filtered");
    let brightness = mean(&clean) / mean(&reference);
    assert!((brightness - 1.0).abs() < 0.02, "brightness {brightness}");
    // And as it is shown.
    let display = |image: &[[f32; 3]]| -> Vec<[f32; 3]> {
        image.iter().map(|p| p.map(aces_filmic)).collect()
    };
    let (raw, shown, reference) = (display(&raw), display(&clean), display(&reference));
    let (before, after) = (rel_mse(&raw, &reference), rel_mse(&shown, &reference));
    assert!(after < 0.1 * before, "relMSE {before} raw, {after} shown");
}

#[test]
fn sharing_makes_the_eyes_agree() {
    let scene = builtin("cornell");
    let views = filling_views(&scene);
    // Everything is Lambert: the same point has the same radiance in both eyes, so their difference is that of their
    // errors, whatever the reference. Black stands for it.
    let black = Image::new(SIZE, SIZE, vec![[0.0; 3]; PIXELS]).unwrap();
    let image = |pixels: &[[f32; 3]]| Image::new(SIZE, SIZE, pixels.to_vec()).unwrap();
    let disagreement = |stereo: bool| {
        let settings = filtered(Reuse::Off, |s| s.reconstruct.stereo = stereo);
        let mut renderer = renderer(&scene, &settings, [SIZE, SIZE]);
        play(&mut renderer, &views, 0..16);
        let [left_seen, seen] = Eye::ALL.map(|eye| renderer.read_motion(eye).unwrap().unwrap().0);
        // Pairs in f64: the right pixel's point in the left image, there at the same distance to 1 %.
        let partner = |(pixel, record): (usize, &[u32; 4])| {
            let distance = f64::from(f32::from_bits(record[0]));
            // Both eyes' samples lie at the same place in their pixels.
            let [dx, dy] = place_in_pixel(record);
            let [x, y] = sample_at(pixel, record);
            let ray = views[1].ray_through_pixel(x, y, SIZE, SIZE);
            let point = ray.origin + ray.direction * distance;
            let [u, v] = project(&views[0], point).filter(|_| distance > 0.0)?;
            let (u, v) = (u - dx, v - dy);
            // Near a left pixel's sample, so that hardly any of the difference is the light's own slope.
            let inside =
                |c: f64| (0.0..f64::from(SIZE)).contains(&c) && (c.fract() - 0.5).abs() < 0.2;
            if !inside(u) || !inside(v) {
                return None;
            }
            let left = v as u32 * SIZE + u as u32;
            let left_distance = f64::from(f32::from_bits(left_seen[left as usize][0]));
            // One pair across the rim of the lamp, which is not filtered, would outweigh all others.
            if (record[2] ^ left_seen[left as usize][2]) & 0x3fff_ffff != 0 {
                return None;
            }
            let expected = point.distance(views[0].position_in_world);
            ((left_distance / expected - 1.0).abs() < 0.01).then_some(left)
        };
        let pairs: Vec<Option<u32>> = seen.iter().enumerate().map(partner).collect();
        let error = |eye: Eye| error_image(&image(&radiance(&renderer, eye)), &black).unwrap();
        let pairs = Image::new(SIZE, SIZE, pairs).unwrap();
        let found = binocular_error(&error(Eye::Left), &error(Eye::Right), &black, &pairs).unwrap();
        assert!(found.pairs > PIXELS / 6, "{} pairs", found.pairs);
        found.rmse
    };
    let (alone, shared) = (disagreement(false), disagreement(true));
    assert!(shared < 0.5 * alone, "binocular {shared}, alone {alone}");
}

#[test]
fn the_still_mean_is_the_mean_of_the_frames_and_begins_anew_with_motion() {
    let scene = builtin("cornell");
    let views = filling_views(&scene);
    let mut settings = method(Method::Path, Reuse::Scatter);
    settings.reconstruct.still = true.into();
    settings.reconstruct.still_from = 0;
    settings.reconstruct.still_until = 1;
    let mut renderer = renderer(&scene, &settings, [SIZE, SIZE]);
    const FRAMES: u32 = 7;
    let mut sums = vec![[0.0_f64; 3]; PIXELS];
    let check = |renderer: &Renderer, sums: &[[f64; 3]], frames: u32| {
        let shown = radiance(renderer, Eye::Right);
        for (pixel, (shown, sum)) in shown.iter().zip(sums).enumerate() {
            for channel in 0..3 {
                let expected = sum[channel] / f64::from(frames);
                // `frames` sums and a division, each rounded to half a unit.
                let tolerance = 1e-6 + expected * f64::from(frames + 2) * f64::from(f32::EPSILON);
                let off = (f64::from(shown[channel]) - expected).abs();
                assert!(off <= tolerance, "pixel {pixel}: off by {off}");
            }
        }
    };
    for frame in 0..FRAMES {
        play(&mut renderer, &views, frame..frame + 1);
        let raw = renderer.read_samples(Eye::Right).unwrap().unwrap();
        for (sum, raw) in sums.iter_mut().zip(raw) {
            *sum = std::array::from_fn(|c| sum[c] + f64::from(raw[c]));
        }
        assert_eq!(renderer.reconstruction().unwrap().still_frames(), frame + 1);
    }
    check(&renderer, &sums, FRAMES);
    // A thousandth of a degree is motion.
    let mut turned = views;
    turned[0].orientation = (DQuat::from_rotation_y(1.7e-5) * turned[0].orientation).normalize();
    play(&mut renderer, &turned, FRAMES..FRAMES + 1);
    let raw = renderer.read_samples(Eye::Right).unwrap().unwrap();
    assert_eq!(bits(&radiance(&renderer, Eye::Right)), bits(&raw));
}

#[test]
fn the_anti_aliased_picture_is_the_bounded_mean_of_linear_light() {
    // The f64 twin of `taa` for eyes at rest, where history is read at the pixel itself. Inside a sphere every pixel finds
    // its surface in the frame before, and nothing moves.
    let scene = builtin("sphere");
    let views = parallel_views(scene.start_pose(), IPD_M, square_fov(40.0));
    let mut settings = method(Method::Path, Reuse::Off);
    settings.reconstruct.taa = true.into();
    settings.reconstruct.taa_clip = 0.5;
    // White is at less light than the frame has, so that samples are limited too.
    settings.output.exposure = 1e4;
    let mut renderer = renderer(&scene, &settings, [SIZE, SIZE]);
    let to = |c: [f64; 3]| {
        [
            0.25 * c[0] + 0.5 * c[1] + 0.25 * c[2],
            0.5 * (c[0] - c[2]),
            -0.25 * c[0] + 0.5 * c[1] - 0.25 * c[2],
        ]
    };
    let from = |c: [f64; 3]| [c[0] + c[1] - c[2], c[0] + c[2], c[0] - c[1] - c[2]];
    let size = SIZE as i64;
    let mut history: Vec<[f64; 3]> = Vec::new();
    let (mut means, mut squares) = (Vec::<f64>::new(), Vec::<f64>::new());
    let (mut clipped, mut raised) = (0, 0);
    for frame in 0..5 {
        play(&mut renderer, &views, frame..frame + 1);
        let now = renderer.read_samples(Eye::Left).unwrap().unwrap();
        let now: Vec<_> = now.iter().map(|p| p.map(f64::from)).collect();
        if frame == 0 {
            means = now.iter().map(|&p| luminance(p)).collect();
            squares = means.iter().map(|mean| mean * mean).collect();
            history.clone_from(&now);
        }
        let share = f64::max(0.2, 1.0 / f64::from(frame + 1));
        for pixel in (0..size * size).filter(|_| frame > 0) {
            let (x, y) = (pixel % size, pixel / size);
            let pixel = pixel as usize;
            let (mut sum, mut sum_of_squares, mut brightest) = ([0.0; 3], [0.0; 3], 0.0_f64);
            for k in 0..9 {
                let tap = |at: i64, step: i64| (at + step - 1).clamp(0, size - 1);
                let at = (tap(y, k / 3) * size + tap(x, k % 3)) as usize;
                if at != pixel {
                    brightest = brightest.max(luminance(now[at]));
                }
                let color = to(now[at]);
                for c in 0..3 {
                    sum[c] += color[c];
                    sum_of_squares[c] += color[c] * color[c];
                }
            }
            let mean = sum.map(|s| s / 9.0);
            let own = means[pixel];
            let spread = (squares[pixel] - own * own).max(0.0).sqrt();
            let allowed = ((own + spread) / luminance(history[pixel])).min(1.0);
            let old = to(history[pixel].map(|light| light * allowed));
            let mut excess = 1.0_f64;
            for c in 0..3 {
                let variance = sum_of_squares[c] / 9.0 - mean[c] * mean[c];
                let allowed = 0.5 * variance.max(0.0).sqrt() + 4.0 * spread;
                excess = excess.max((old[c] - mean[c]).abs() / allowed.max(1e-5));
            }
            clipped += usize::from(excess > 1.0);
            let kept = std::array::from_fn(|c| mean[c] + (old[c] - mean[c]) / excess);
            let kept = from(kept).map(|light: f64| light.max(0.0));
            let limit = brightest.max(1e-4).max(256.0 * luminance(kept));
            let limited = now[pixel].map(|c| c * (limit / luminance(now[pixel])).min(1.0));
            history[pixel] = std::array::from_fn(|c| (1.0 - share) * kept[c] + share * limited[c]);
            let bright = luminance(limited);
            means[pixel] = (1.0 - share) * own + share * bright;
            squares[pixel] = (1.0 - share) * squares[pixel] + share * bright * bright;
            if luminance(kept) > 1.01 * (own + spread) {
                raised += 1;
                means[pixel] = luminance(history[pixel]);
                squares[pixel] = means[pixel].powi(2);
            }
        }
        let shown = radiance(&renderer, Eye::Left);
        let scale = mean(&shown);
        for (pixel, (shown, expected)) in shown.iter().zip(&history).enumerate() {
            for c in 0..3 {
                // Variances as differences of squares lose half the digits: standard deviations near 0 are off by up to
                // sqrt(4 eps) = 5e-4 (over time, counted four times) and sqrt(9 eps) = 7e-4 (half) of the light, 2.3e-3
                // along each of three axes, which a channel adds up: 7e-3, and 5e-4 where the pixel's own samples limit it.
                // The frames before leave under as much again.
                let off = (f64::from(shown[c]) - expected[c]).abs();
                let what = format!("frame {frame}, pixel {pixel}");
                assert!(off < 1.5e-2 * scale, "{what}: off by {off} of {scale}");
            }
        }
    }
    for count in [clipped, raised] {
        assert!(count > PIXELS / 20 && count < 4 * PIXELS, "{count}");
    }
}

#[test]
fn two_replays_of_moving_eyes_are_equal_bit_for_bit() {
    let scene = builtin("cornell");
    for (kind, reuse) in [
        (Method::Path, Reuse::Scatter),
        (Method::Photon, Reuse::Lookup),
        (Method::Photon, Reuse::Off),
    ] {
        let run = || {
            let mut settings = method(kind, reuse);
            filter_all(&mut settings);
            settings.reconstruct.still = true.into();
            let mut renderer = renderer(&scene, &settings, [SIZE, SIZE]);
            for frame in 0..4 {
                let turn = DQuat::from_rotation_y(0.01 * f64::from(frame));
                let start = scene.start_pose();
                let head = Pose::new(start.position, turn * start.orientation);
                let views = parallel_views(head, IPD_M, square_fov(30.0));
                renderer.render_frame(&views, frame, |_| {}).unwrap();
            }
            both(&renderer).map(|shown| {
                assert_clean(&shown, "shown");
                bits(&shown)
            })
        };
        let (first, second) = (run(), run());
        assert!(first == second, "{kind:?} {reuse:?}");
        assert!(first[0] != first[1], "{kind:?}: both eyes show the same");
    }
}

/// The first instance that shines.
fn lamp_of(scene: &Scene) -> usize {
    let shines = |instance: &Instance| {
        let mut triangles = scene.meshes[instance.mesh].triangles.iter();
        triangles.any(|t| scene.materials[t.material as usize].is_emissive())
    };
    scene.instances().iter().position(shines).unwrap()
}

#[test]
fn light_that_goes_out_is_gone_after_a_stated_number_of_frames() {
    // By the weights of new frames alone, 0.2 of the light and 0.2 of the picture made of it, (1 + 0.2 n) 0.8^n would be left
    // after n frames: 0.82 after 3.
    const FRAMES: u32 = 3;
    let scene = builtin("cornell");
    let lamp = lamp_of(&scene);
    let views = filling_views(&scene);
    for (kind, shares) in [(Method::Path, 1), (Method::Photon, 1), (Method::Photon, 4)] {
        let mut settings = method(kind, Reuse::Scatter);
        filter_all(&mut settings);
        settings.photon.shares = shares;
        let mut renderer = renderer(&scene, &settings, [SIZE, SIZE]);
        play(&mut renderer, &views, 0..12);
        let lit = mean(&radiance(&renderer, Eye::Left));
        assert!(renderer.remove_instance(InstanceId(lamp as u32)));
        // The share of photons that is traced last still has the old light shares - 1 frames later.
        let gone = 12 + FRAMES + shares - 1;
        play(&mut renderer, &views, 12..gone);
        let rest = mean(&radiance(&renderer, Eye::Left)) / lit;
        eprintln!("{kind:?}, {shares} shares: {rest} left");
        assert!(rest < 0.05, "{kind:?}, {shares} shares: {rest} left");
    }
}

#[test]
fn what_stays_lit_keeps_its_history_when_another_light_comes() {
    let scene = builtin("cornell");
    let views = filling_views(&scene);
    let reference = mean_of_frames(&scene, &views, 500);
    for kind in [Method::Path, Method::Photon] {
        let error = |frames_before: u32, another: bool| {
            let mut settings = method(kind, Reuse::Off);
            filter_all(&mut settings);
            settings.photon.count = 65_536;
            let mut renderer = renderer(&scene, &settings, [SIZE, SIZE]);
            play(&mut renderer, &views, 24 - frames_before..24);
            if another {
                // Fifty metres behind the head, where it adds less than 1 / 1,000 of the lamp's light, but half the power.
                let behind = DAffine3::from_translation(DVec3::Z * 50.0);
                let lamp = scene.instances()[lamp_of(&scene)].mesh;
                renderer.add_instance(lamp, behind).unwrap();
            }
            play(&mut renderer, &views, 24..26);
            rel_mse(&radiance(&renderer, Eye::Left), &reference)
        };
        let (still, another, anew) = (error(24, false), error(24, true), error(0, false));
        eprintln!("{kind:?}: relMSE {still}, {another} beside another light, {anew} anew");
        // Half the photons and light samples now go to the other light: up to twice the variance in the newest frames' share.
        assert!(another < 2.0 * still, "{kind:?}: {another}, {still} alone");
        // Negative control: what forgets all of its history.
        assert!(anew > 2.0 * still, "{kind:?}: {anew} without history");
    }
}

/// A glossy floor with a checkerboard of two greys, before a lamp that it mirrors.
pub(crate) fn glossy_board(greys: [u8; 2]) -> Scene {
    board(greys.map(|grey| [grey; 3]))
}

fn board(colors: [[u8; 3]; 2]) -> Scene {
    let square = |corners: [[f32; 3]; 4], normal: [f32; 3], material| {
        let mut mesh = Mesh::plain(
            corners.to_vec(),
            vec![normal; 4],
            [[0, 1, 2], [0, 2, 3]],
            material,
        );
        mesh.uv0 = vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        mesh
    };
    let [near, far] = [2.0, -2.0];
    let floor = [[-2.0, near], [2.0, near], [2.0, far], [-2.0, far]].map(|[x, z]| [x, -1.0, z]);
    let lamp = [[-1.0, -0.5], [1.0, -0.5], [1.0, 1.5], [-1.0, 1.5]].map(|[x, y]| [x, y, -3.0]);
    let texels = (0..24 * 24).flat_map(|at| {
        let [r, g, b] = colors[(at % 24 + at / 24) % 2];
        [r, g, b, 255]
    });
    Scene {
        roots: vec![0, 1],
        nodes: [0, 1].map(Node::of_mesh).into(),
        meshes: vec![
            square(floor, [0.0, 1.0, 0.0], 0),
            square(lamp, [0.0, 0.0, 1.0], 1),
        ],
        materials: vec![
            Material {
                metallic: 0.0,
                roughness: 0.3,
                base_color_texture: Some(TextureRef::plain(0)),
                ..Material::default()
            },
            Material {
                emission: [10.0; 3],
                ..Material::lambert("lamp", [0.0; 3])
            },
        ],
        images: vec![scene::Image {
            name: "board".to_owned(),
            width: 24,
            height: 24,
            rgba8: texels.collect(),
        }],
        textures: vec![Texture {
            filter: Filter::Nearest,
            ..Texture::default()
        }],
        ..Scene::default()
    }
}

/// Mean of 16 filtered frames of a board's nearer half over that of 256 raw ones, per channel.
fn filtered_brightness(library: &ShaderLibrary, scene: &Scene) -> [f64; 3] {
    let pose = Pose::new(DVec3::Z * 1.6, DQuat::IDENTITY);
    let views = parallel_views(pose, IPD_M, square_fov(45.0));
    let settings = filtered(Reuse::Off, |settings| settings.path.max_depth = 3);
    let renderer = renderer_by(library, scene, &settings, Eyes::Left, [SIZE, SIZE]);
    let mut renderer = renderer.unwrap();
    let channel = |image: &[[f32; 3]], channel: usize| -> f64 {
        let floor = &image[2 * PIXELS / 3..];
        floor.iter().map(|pixel| f64::from(pixel[channel])).sum()
    };
    let mut sum = [0.0; 3];
    for frame in 0..24 {
        play(&mut renderer, &views, frame..frame + 1);
        if frame >= 8 {
            let image = radiance(&renderer, Eye::Left);
            sum = std::array::from_fn(|c| sum[c] + channel(&image, c) / 16.0);
        }
    }
    let raw = mean_of_frames(scene, &views, 256);
    std::array::from_fn(|c| sum[c] / channel(&raw, c))
}

/// What a channel or a whole texel does not reflect says nothing of the light, and neither darkens nor colours what lies beside it.
#[test]
fn black_texels_and_pure_colours_darken_nothing() {
    let matt = |colors| {
        let mut scene = board(colors);
        scene.materials[0].specular = 0.0;
        scene.materials[1].emission = [10.0, 7.0, 3.5];
        scene
    };
    let embedded = ShaderLibrary::embedded();
    let [black, red, teal, white] = [[0; 3], [255, 0, 0], [0, 149, 149], [230; 3]];
    for colors in [[black, white], [red, teal], [red, white], [white, white]] {
        let found = filtered_brightness(&embedded, &matt(colors));
        // As for highlights.
        let is_kept = |channel: &f64| (channel - 1.0).abs() < 0.02;
        assert!(found.iter().all(is_kept), "{colors:?}: {found:?}");
    }
    // A varnish shows the channels that its paint does not.
    let mut varnished = board([red, teal]);
    varnished.materials[0].roughness = 1.0;
    let found = filtered_brightness(&embedded, &varnished);
    assert!(found.iter().all(|c| (c - 1.0).abs() < 0.02), "{found:?}");
    let alike = changed("shared/mixing", "(theirs.y & asked) != 0u", "false");
    let [found, ..] = filtered_brightness(&alike, &varnished);
    assert!(found < 0.95, "{found}");
    // As if it had been seen to be unlit.
    let floored = changed(
        "shared/reconstruction",
        "select(mixing, DARK_LOG2, is_other)",
        "0.0",
    );
    let [found, ..] = filtered_brightness(&floored, &matt([black, white]));
    assert!((found - 1.0).abs() > 0.05, "{found}");
    // As if red light said how much blue there is.
    let guessed = changed("shared/mixing", "(theirs.y & asked) != 0u", "false");
    let [.., found] = filtered_brightness(&guessed, &matt([red, white]));
    assert!((found - 1.0).abs() > 0.2, "{found}");
}

/// A matt board behind the eye and before a lamp, in a mirror before the eye, of material 2.
fn board_in_a_mirror(colors: [[u8; 3]; 2]) -> Scene {
    let mut scene = board(colors);
    scene.materials[0].specular = 0.0;
    let place = |mesh: &mut Mesh, [left, bottom, right, top]: [f32; 4], z, normal| {
        let corners = [[left, bottom], [right, bottom], [right, top], [left, top]];
        mesh.positions = corners.map(|[x, y]| [x, y, z]).to_vec();
        mesh.normals = vec![[0.0, 0.0, normal]; 4];
    };
    place(&mut scene.meshes[0], [2.0, -2.0, -2.0, 2.0], 2.0, -1.0);
    place(&mut scene.meshes[1], [-0.5, 1.2, 0.5, 1.7], 0.5, 1.0);
    let mut mirror = scene.meshes[1].clone();
    place(&mut mirror, [-1.0, -1.0, 1.0, 1.0], -1.0, 1.0);
    for triangle in &mut mirror.triangles {
        triangle.material = 2;
    }
    scene.meshes.push(mirror);
    scene.nodes.push(Node::of_mesh(2));
    scene.roots.push(2);
    scene.materials.push(Material {
        metallic: 1.0,
        roughness: 0.0,
        ..Material::default()
    });
    scene
}

/// Smudges on a mirror spread what it shows, which is divided by the mirror's albedo there, and by that of what shows beside them.
#[test]
fn smudges_leave_what_a_mirror_shows_as_bright() {
    let mut scene = board_in_a_mirror([[100; 3]; 2]);
    let smudges = (0..16 * 16).flat_map(|at| {
        [
            0,
            if (at % 16 + at / 16) % 2 == 0 { 0 } else { 25 },
            255,
            255,
        ]
    });
    scene.images.push(scene::Image {
        name: "smudges".to_owned(),
        width: 16,
        height: 16,
        rgba8: smudges.collect(),
    });
    scene.textures.push(Texture {
        image: 1,
        ..scene.textures[0]
    });
    scene.materials[2].roughness = 1.0;
    scene.materials[2].metallic_roughness_texture = Some(TextureRef::plain(1));
    let views = parallel_views(Pose::IDENTITY, IPD_M, square_fov(30.0));
    let settings = filtered(Reuse::Off, |_| {});
    // Of red and of blue light.
    let sums = |image: &[[f32; 3]]| -> [f64; 2] {
        [0, 2].map(|channel| image.iter().map(|pixel| f64::from(pixel[channel])).sum())
    };
    let brightness = |library: &ShaderLibrary, scene: &Scene| {
        let renderer = renderer_by(library, scene, &settings, Eyes::Left, [SIZE, SIZE]);
        let mut renderer = renderer.unwrap();
        let mut shown = [0.0; 2];
        for frame in 0..24 {
            play(&mut renderer, &views, frame..frame + 1);
            if frame >= 8 {
                let sums = sums(&radiance(&renderer, Eye::Left));
                shown = [0, 1].map(|k| shown[k] + sums[k] / 16.0);
            }
        }
        let raw = sums(&mean_of_frames(scene, &views, 256));
        [0, 1].map(|k| shown[k] / raw[k])
    };
    let mut copper = scene.clone();
    copper.materials[0].base_color = [0.95, 0.4, 0.05, 1.0];
    copper.materials[0].base_color_texture = None;
    [copper.materials[0].metallic, copper.materials[0].roughness] = [1.0, 0.6];
    for scene in [&scene, &copper] {
        let found = brightness(&ShaderLibrary::embedded(), scene);
        // As for highlights.
        assert!(found.iter().all(|k| (k - 1.0).abs() < 0.02), "{found:?}");
    }
    let alike = changed(
        "passes/motion",
        "select(SPREAD_GLOSS, gloss, image.is_clear)",
        "0u",
    );
    let [found, _] = brightness(&alike, &scene);
    assert!((found - 1.0).abs() > 0.1, "{found}");
    // As if what spreads an image and what shows it clearly were metals alike.
    let metals = changed(
        "shared/mixing",
        "(own.x == SPREAD_GLOSS) != (theirs.x == SPREAD_GLOSS)",
        "false",
    );
    let [red, blue] = brightness(&metals, &copper);
    assert!((blue / red - 1.0).abs() > 0.05, "{red} {blue}");
}

/// What a mirror shows is divided by its own albedo, as if it were seen without the mirror.
#[test]
fn textures_in_mirrors_are_as_sharp_as_themselves() {
    let scene = board_in_a_mirror([[20; 3], [220; 3]]);
    let views = parallel_views(Pose::IDENTITY, IPD_M, square_fov(30.0));
    let settings = filtered(Reuse::Off, |settings| settings.path.max_depth = 3);
    let raw = mean_of_frames(&scene, &views, 256);
    let error = |library: &ShaderLibrary| {
        let renderer = renderer_by(library, &scene, &settings, Eyes::Left, [SIZE, SIZE]);
        let mut renderer = renderer.unwrap();
        play(&mut renderer, &views, 0..16);
        rel_mse(&radiance(&renderer, Eye::Left), &raw)
    };
    let found = error(&ShaderLibrary::embedded());
    let first = changed(
        "passes/motion",
        "select(image.tint, albedo, image.is_clear)",
        "image.tint",
    );
    let blurred = error(&first);
    // Noise alone is left, of 16 frames that no neighbour's joins.
    assert!(found < 0.2 * blurred, "{found}, {blurred}");
}

/// What a lobe mirrors does not grow with the base below it, by which it is divided: it is mixed among like bases alone.
#[test]
fn highlights_on_textures_are_as_bright_as_they_were() {
    let brightness = |library: &ShaderLibrary, greys, roughness| {
        let mut scene = glossy_board(greys);
        scene.materials[0].roughness = roughness;
        filtered_brightness(library, &scene)[0]
    };
    let embedded = ShaderLibrary::embedded();
    // 0.6 % is what a floor of one grey has, whose lamp's edge is noisy; 16 dependent frames leave as much again.
    for (greys, roughness) in [
        ([0, 230], 0.3),
        ([90, 200], 0.3),
        ([150, 150], 0.3),
        ([0, 230], 1.0),
        ([90, 200], 1.0),
    ] {
        let found = brightness(&embedded, greys, roughness);
        assert!(
            (found - 1.0).abs() < 0.02,
            "{greys:?}, {roughness}: {found}"
        );
    }
    let alike = changed(
        "shared/reconstruction",
        "select(mixing, DARK_LOG2, is_other)",
        "0.0",
    );
    let found = brightness(&alike, [0, 230], 0.3);
    assert!(found > 1.03, "{found}");
}

/// Pixels of several samples at a lamp's edge hold some of the wall's light: the lamp's dark base must not divide it.
#[test]
fn dark_lamps_keep_their_edges_with_several_samples() {
    const EMISSION: f32 = 8.0;
    const BASE: f32 = 0.1;
    let lamp = Material {
        emission: [EMISSION; 3],
        ..Material::lambert("lamp", [BASE; 3])
    };
    let mut scene = Scene::default();
    let wall = Material::lambert("wall", [0.7; 3]);
    add(&mut scene, &square_ahead(2.0, 2.0), wall);
    add(&mut scene, &square_ahead(0.33, 1.97), lamp);
    let views = parallel_views(Pose::IDENTITY, IPD_M, square_fov(45.0));
    let settings = filtered(Reuse::Off, |settings| settings.spp = 4);
    let picture = |library: &ShaderLibrary| {
        let renderer = renderer_by(library, &scene, &settings, Eyes::Left, [SIZE, SIZE]);
        let mut renderer = renderer.unwrap();
        play(&mut renderer, &views, 0..8);
        radiance(&renderer, Eye::Left)
    };
    let brightest = |image: &[[f32; 3]]| image.iter().flatten().copied().fold(0.0, f32::max);
    // Nothing is brighter than a closed room that emits and reflects as the lamp does.
    let found = picture(&ShaderLibrary::embedded());
    assert!(
        brightest(&found) <= EMISSION / (1.0 - BASE),
        "{}",
        brightest(&found)
    );
    let divided = changed(
        "passes/motion",
        "(!shows_surroundings && max_component(emission) > 0.0)",
        "false",
    );
    let found = picture(&divided);
    assert!(brightest(&found) > 2.0 * EMISSION, "{}", brightest(&found));
}
