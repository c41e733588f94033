//! Frames that are sent before earlier ones are done: the same images, statistics and choices, without waiting.

use std::collections::VecDeque;

use glam::{DAffine3, DVec3};
use stereolux::renderer::frames_in_flight::MOST;
use stereolux::renderer::{
    FrameResult, InstanceId, PhotonStats, Renderer, StereoStats, WorkLimits,
};
use stereolux::scene::Scene;
use stereolux::settings::{Method, RenderSettings, Reuse};
use stereolux::xr::{Pose, View};

use super::support::{both, builtin, parallel_views, renderer, settings, square_fov, white_box};

/// Frames of each run.
const FRAMES: u32 = 60;
/// The frame from which the room is closed, so that photons stay in it.
const CLOSED: u32 = 4;

/// A head that sways, but for the frames from 20 to 30.
fn views(scene: &Scene, frame: u32) -> [View; 2] {
    let start = scene.start_pose();
    let time = f64::from(if (20..30).contains(&frame) { 20 } else { frame });
    let sway = DVec3::new(0.01 * (0.7 * time).sin(), 0.004 * (1.1 * time).cos(), 0.0);
    let head = Pose::new(start.position + sway, start.orientation);
    parallel_views(head, 0.063, square_fov(21.0))
}

/// Opens the box until the frame [`CLOSED`], and moves a block in every frame.
fn move_things(renderer: &mut Renderer, frame: u32) {
    for wall in 0..5 {
        let away = if frame < CLOSED { 100.0 } else { 0.0 };
        let offset = DVec3::Y * (away * f64::from(wall + 1));
        renderer.set_instance_transform(InstanceId(wall), DAffine3::from_translation(offset));
    }
    let beside = DVec3::X * (0.01 * f64::from(frame));
    renderer.set_instance_transform(InstanceId(6), DAffine3::from_translation(beside));
}

fn moving(shares: u32) -> RenderSettings {
    settings(|s| {
        s.method = Method::Photon;
        s.reuse = Reuse::Scatter;
        s.photon.shares = shares;
        s.photon.max_depth = 32;
    })
}

/// What is compared of a frame.
type Seen = ([Vec<[f32; 3]>; 2], PhotonStats, StereoStats);

/// Images and statistics of all frames, with `most` of them on their way at once.
fn run(
    scene: &Scene,
    settings: &RenderSettings,
    most: usize,
    mut change: impl FnMut(&mut Renderer, u32),
) -> Vec<Seen> {
    let mut renderer = renderer(scene, settings, [16, 16]);
    let mut images = Vec::new();
    let mut results: Vec<FrameResult> = Vec::new();
    let mut flights = VecDeque::new();
    for frame in 0..FRAMES {
        if flights.len() == most {
            let oldest = flights.pop_front().unwrap();
            results.push(renderer.retire(oldest).unwrap());
        }
        change(&mut renderer, frame);
        let views = views(scene, frame);
        flights.push_back(renderer.send_frame(&views, frame, |_| {}).unwrap());
        images.push(both(&renderer));
    }
    for flight in flights {
        results.push(renderer.retire(flight).unwrap());
    }
    let all = images.into_iter().zip(results);
    all.map(|(images, result)| (images, result.photons, result.stereo))
        .collect()
}

#[test]
fn images_and_statistics_are_the_same_whatever_is_in_flight() {
    let scene = white_box();
    for shares in [1, 4] {
        let settings = moving(shares);
        let one = run(&scene, &settings, 1, move_things);
        let overflows = |(_, photons, _): &Seen| photons.map.dropped > 0;
        let first = one.iter().position(overflows).expect("no list overflowed");
        assert!(first >= CLOSED as usize, "frame {first} overflowed");
        let capacity = |frame: usize| one[frame].1.map.capacity;
        let grown = first + MOST as usize;
        assert_eq!(capacity(grown - 1), capacity(first));
        assert!(capacity(grown) > capacity(first), "nothing grew");
        for most in [2, 3] {
            let more = run(&scene, &settings, most, move_things);
            for (frame, (a, b)) in one.iter().zip(&more).enumerate() {
                let what = format!("{most} in flight, {shares} shares, frame {frame}");
                assert_eq!((a.1, a.2), (b.1, b.2), "{what}");
                assert!(a.0 == b.0, "{what} differs");
            }
        }
    }
}

#[test]
fn a_head_that_rests_sees_the_same_whatever_is_in_flight() {
    let scene = builtin("cornell");
    let mut settings = moving(1);
    // As many as both eyes have pixels: a map per frame.
    settings.photon.count = 512;
    settings.reconstruct.svgf = true.into();
    settings.reconstruct.taa = true.into();
    settings.reconstruct.still = true.into();
    settings.reconstruct.still_from = 0;
    let one = run(&scene, &settings, 1, |_, _| {});
    for (frame, (_, photons, _)) in one.iter().enumerate() {
        // The first frame's, those at rest, and once more as it ends.
        let traces = frame == 0 || (21..=30).contains(&frame);
        assert_eq!(photons.traced, traces, "frame {frame}");
    }
    for most in [1, 3] {
        let again = run(&scene, &settings, most, |_, _| {});
        assert!(one == again, "{most} in flight");
    }
}

/// Changes quality now and then, while photons are shared out and their list grows.
fn change_quality(renderer: &mut Renderer, frame: u32) {
    move_things(renderer, frame);
    let mut quality = renderer.most_quality();
    match frame % 16 {
        3 => quality.resolution_scale = 0.5,
        6 => {
            quality.photons_per_frame /= 3;
            quality.photon_shares = 2;
        }
        9 => (quality.max_depth, quality.reuse) = (8, false),
        12 => {}
        _ => return,
    }
    renderer.set_quality(&quality).unwrap();
}

#[test]
fn quality_changes_in_the_same_frame_whatever_is_in_flight() {
    let scene = white_box();
    let [one, two, three] = [1, 2, 3].map(|most| run(&scene, &moving(4), most, change_quality));
    assert_eq!(one[3].0[0].len(), 8 * 8);
    assert_eq!(one[6].0[0].len(), 16 * 16);
    for (frame, one) in one.iter().enumerate() {
        assert!(*one == two[frame], "2 in flight: frame {frame} differs");
        assert!(*one == three[frame], "3 in flight: frame {frame} differs");
    }
}

#[test]
fn nothing_waits_while_things_move_deform_and_trace_photons() {
    for (name, shares) in [("cornell", 1), ("cornell", 4), ("parade", 1)] {
        let scene = builtin(name);
        let mut renderer = renderer(&scene, &moving(shares), [16, 16]);
        let mut flights = VecDeque::new();
        let mut waits = Vec::new();
        for frame in 0..FRAMES {
            if flights.len() == 2 {
                let oldest = flights.pop_front().unwrap();
                let result = renderer.retire(oldest).unwrap();
                assert!(result.photons.traced, "{name}");
                assert_eq!(result.photons.map.dropped, 0, "{name}");
            }
            if name == "cornell" {
                let beside = DVec3::X * (0.01 * f64::from(frame));
                renderer.set_instance_transform(InstanceId(6), DAffine3::from_translation(beside));
            } else {
                renderer.animate(i64::from(frame) * 50_000_000);
            }
            let before = renderer.context().host_waits();
            let views = views(&scene, frame);
            flights.push_back(renderer.send_frame(&views, frame, |_| {}).unwrap());
            waits.push(renderer.context().host_waits() - before);
        }
        // The first map's counts are waited for.
        let (first, later) = waits.split_first().unwrap();
        assert!(*first > 0, "{name}");
        assert!(later.iter().all(|waits| *waits == 0), "{name}: {waits:?}");
    }
}

/// Drivers reset a device that answers nothing for long: cards get the eyes' samples in pieces, by the number of rays and by
/// the last frame's times.
#[test]
fn images_are_the_same_whatever_a_submission_may_take() {
    const SAMPLES: usize = 16;
    let scene = builtin("cornell");
    for (method, reuse) in [
        (Method::Path, Reuse::Off),
        (Method::Path, Reuse::Lookup),
        (Method::Photon, Reuse::Scatter),
    ] {
        let settings = settings(|s| {
            s.method = method;
            s.reuse = reuse;
            s.spp = SAMPLES as u32;
            s.gpu.timestamps = true.into();
            s.output.chrome_trace = true;
        });
        // Submissions of the eyes, of two frames; the last one's images.
        let run = |limits| {
            let mut renderer = renderer(&scene, &settings, [24, 16]);
            renderer.limit_work(limits);
            let mut cuts = Vec::new();
            for frame in 0..2 {
                let views = views(&scene, frame);
                let result = renderer.render_frame(&views, frame, |_| {}).unwrap();
                let submissions = result.times.submissions.unwrap();
                let of_eyes = submissions.iter().filter(|s| s.host.stage == "frame");
                cuts.push(of_eyes.count());
            }
            (cuts, both(&renderer))
        };
        let (whole, expected) = run(WorkLimits::SOFTWARE);
        assert_eq!(whole, [1, 1]);
        let [mut split, mut slow] = [WorkLimits::SOFTWARE; 2];
        split.submission_rays = 1.0;
        slow.submission_ms = 0.0;
        for (limits, wanted) in [
            // The first frame in submissions of one sample; the second was timed, and is not cut.
            (split, [SAMPLES, 1]),
            // The other way round: no frame takes no time.
            (slow, [1, SAMPLES]),
        ] {
            let (cuts, images) = run(limits);
            assert_eq!(cuts, wanted, "{method:?}");
            assert!(images == expected, "{method:?} {reuse:?}");
        }
    }
}
