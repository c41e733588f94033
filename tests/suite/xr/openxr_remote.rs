//! Scripted heads, eyes and controllers through Monado's remote driver.

use std::collections::BTreeMap;

use glam::{DQuat, DVec3};
use serde_json::Value;
use stereolux::xr::trace::Trace;
use stereolux::xr::{Button, Pose, Side, View};

use super::openxr_support::{
    Remote, RemoteEye, assert_status, drive, recorded_session, remote_port, replayed_images, stats,
    stereolux_on_monado,
};
use crate::suite::support::{Folder, builtin};

fn turned(axis: DVec3, angle: f64) -> [f32; 4] {
    let q = DQuat::from_axis_angle(axis.normalize(), angle).as_quat();
    [q.x, q.y, q.z, q.w]
}

fn pose(orientation: [f32; 4], position: [f32; 3]) -> Pose {
    Pose::new(
        DVec3::from_array(position.map(f64::from)),
        DQuat::from_array(orientation.map(f64::from)).normalize(),
    )
}

/// Canted eyes, four different angles each, head turned and rolled; `step` moves it.
pub fn scripted(step: usize) -> Remote {
    let t = (step % 64) as f64;
    Remote {
        eyes: [
            RemoteEye {
                fov: [-0.9, 0.6, 0.7, -0.8],
                orientation: turned(DVec3::Y, 0.1),
                position: [-0.05, 0.01, 0.02],
            },
            RemoteEye {
                fov: [-0.55, 0.85, 0.75, -0.7],
                orientation: turned(DVec3::new(0.1, 1.0, 0.0), -0.12),
                position: [0.04, -0.01, 0.0],
            },
        ],
        head_orientation: turned(DVec3::new(0.2, 1.0, 0.3), 0.01 * t),
        head_position: [0.1 + 0.003 * t as f32, 1.5, 0.2 - 0.002 * t as f32],
        sticks: [[0.0; 2]; 2],
        a: false,
        b: false,
    }
}

/// Positions under 2 m in f32 through a few products: 4 roundings of 1.2e-7.
fn is_near(pose: &Pose, position: DVec3, orientation: DQuat) -> bool {
    (pose.position - position).length() < 1e-6
        && pose.orientation.dot(orientation).abs() > 1.0 - 1e-12
}

/// Runs a session that [`drive`] drives.
fn live_on_monado(args: &[String]) {
    let args: Vec<&str> = args.iter().map(String::as_str).collect();
    assert_status(&stereolux_on_monado(&["--remote"], &args), 0);
}

#[test]
fn scripted_poses_and_canted_asymmetric_eyes_arrive_and_replay() {
    let _port = remote_port();
    let start = builtin("cornell").start_pose();
    for space in ["local", "stage"] {
        let folder = Folder::new(&format!("openxr-remote-{space}"));
        let sent = drive(&folder.join("live"), scripted);
        let common = ["--size", "40x32", "--photons", "1000", "--every", "5"];
        let space_setting = format!("openxr.space={space}");
        let (p, q) = (start.position, start.orientation);
        let numbers = [p.x, p.y, p.z, q.x, q.y, q.z, q.w].map(|number| number.to_string());
        let starts_at = numbers.join(" ");
        let mut args = recorded_session(&folder, "run --session openxr --frames 21", &common);
        args.extend([
            "--set".to_owned(),
            space_setting,
            "--pose".to_owned(),
            starts_at,
        ]);
        live_on_monado(&args);

        // Monado keeps LOCAL 1.6 m over the floor, and STAGE starts as high under the scene's start: both alike.
        let world_from_floor = Pose::new(
            start.position - DVec3::Y * 1.6,
            DQuat::from_rotation_y(start.heading_rad()),
        );
        let sent = sent.lock().unwrap();
        let mut expected: Vec<[Pose; 2]> = Vec::new();
        for remote in sent.iter() {
            let head = world_from_floor.then(&pose(remote.head_orientation, remote.head_position));
            let eye = |eye: RemoteEye| head.then(&pose(eye.orientation, eye.position));
            let eyes = remote.eyes.map(eye);
            if expected.last() != Some(&eyes) {
                expected.push(eyes);
            }
        }
        let trace = Trace::read(&folder.join("trace.jsonl")).unwrap();
        assert_eq!(trace.frames.len(), 21);
        let mut places = BTreeMap::new();
        for frame in &trace.frames {
            for (eye, view) in frame.views.views.iter().enumerate() {
                let f = view.fov;
                let angles = [f.angle_left, f.angle_right, f.angle_up, f.angle_down];
                // Sent as f32, and so they come back.
                assert_eq!(angles, scripted(0).eyes[eye].fov.map(f64::from));
            }
            for hand in &frame.input.hands {
                // Where `Remote::packet` has both, unturned; each of grip and aim is that pose itself.
                let sent = world_from_floor.then(&pose([0.0, 0.0, 0.0, 1.0], [0.0, 1.2, -0.3]));
                for tracked in [hand.grip, hand.aim] {
                    let seen = tracked.expect("a tracked controller").pose;
                    let is_there = is_near(&sent, seen.position, seen.orientation);
                    assert!(is_there, "{space}: {seen:?}, not {sent:?}");
                }
            }
            let is_seen = |(eye, view): (&Pose, &View)| {
                is_near(eye, view.position_in_world, view.orientation)
            };
            let views = &frame.views.views;
            let found = expected
                .iter()
                .position(|eyes| eyes.iter().zip(views).all(is_seen));
            let found = found.unwrap_or_else(|| panic!("{space}: not sent: {frame:?}"));
            places.insert(found, ());
        }
        assert!(places.len() > 5, "the head moved: {places:?}");

        assert_eq!(replayed_images(&folder, &common), 10);
    }
}

#[test]
fn the_wearer_walks_turns_switches_reuse_and_quits() {
    let _port = remote_port();
    let folder = Folder::new("openxr-controls");
    let live = folder.join("live");
    // Still until frame 20; ahead until 40; one snap to the right; reuse off from about 60; quit at 80.
    let _sent = drive(&live, |frame| Remote {
        head_orientation: [0.0, 0.0, 0.0, 1.0],
        head_position: [0.0, 1.6, 0.0],
        sticks: [
            [0.0, if (20..40).contains(&frame) { 1.0 } else { 0.0 }],
            [if (45..55).contains(&frame) { 1.0 } else { 0.0 }, 0.0],
        ],
        a: (60..65).contains(&frame),
        b: frame >= 80,
        ..scripted(0)
    });
    let common = ["--size", "24x24", "--photons", "500", "--every", "10"];
    // Frames without limit: only the button ends this run. The timeout is for the case that it does not. Slow enough to
    // stay in front of the box.
    let walks = "run --session openxr --frames 2000 --set openxr.snap_turn_deg=20 --set openxr.move_m_per_s=0.2";
    live_on_monado(&recorded_session(&folder, walks, &common));

    let trace = Trace::read(&folder.join("trace.jsonl")).unwrap();
    let frames = stats(&live);
    assert!(frames.len() > 80 && frames.len() < 2000, "{}", frames.len());
    let left = |index: usize| trace.frames[index].input.hand(Side::Left);
    let presses = (1..trace.frames.len()).filter(|at| {
        let held = |at: usize| left(at).pressed.has(Button::Primary);
        held(*at) && !held(at - 1)
    });
    assert_eq!(presses.count(), 1, "the left A button went down once");
    assert!(!left(10).pressed.has(Button::Primary) && left(10).stick.y == 0.0);
    // The stick that walks is the application's too.
    assert!((20..45).any(|at| left(at).stick.y == 1.0));
    let [first, walked, turned] = [10, 43, 58].map(|at: usize| &trace.frames[at].views);
    let way = walked.midpoint_in_world() - first.midpoint_in_world();
    // Ahead is -Z here (the eyes' cant aside), at 0.2 m/s for about a second, and level.
    assert!(way.z < -0.04 && way.z > -0.6, "{way}");
    assert!(way.y.abs() < 1e-6, "{way}");
    let [first, walked, turned] = [first, walked, turned].map(|views| views.views[0].orientation);
    assert_eq!(walked, first, "walking does not turn");
    let degrees = walked.angle_between(turned).to_degrees();
    assert!((degrees - 20.0).abs() < 1e-3, "{degrees}");
    let switched: Vec<usize> = (0..trace.frames.len())
        .filter(|i| trace.frames[*i].switch_reuse)
        .collect();
    let [at] = switched[..] else {
        panic!("reuse was switched at {switched:?}");
    };
    let reused = |frame: &Value| frame["stereo"]["reused"].as_u64().unwrap();
    assert!(frames[..at].iter().all(|frame| reused(frame) > 0));
    assert!(frames[at..].iter().all(|frame| reused(frame) == 0));

    // All of that is in the recording.
    assert!(replayed_images(&folder, &common) >= 18);
}
