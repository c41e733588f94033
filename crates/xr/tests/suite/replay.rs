//! Replay: native traces as they stand, head motion through a headset.

#![allow(clippy::unwrap_used)]

use glam::{DQuat, DVec3};
use std::path::PathBuf;
use std::time::{Duration, Instant};
use stereolux_xr::{
    Headset, Pacing, Pose, ReplayOptions, ReplaySession, TraceBody, TraceUp, XrError, XrSession,
};

use super::simulated::play;
use crate::folders::TemporaryFile;

fn native(frames: i64) -> String {
    let mut text =
        "{\"format\":\"stereolux-trace\",\"version\":1,\"headset\":\"odd\",\"refresh_hz\":80.0}\n"
            .to_owned();
    for k in 0..frames {
        let view = format!(
            "{{\"position\":[{k}.5,1.0,2.0],\"orientation\":[0.0,0.0,0.0,1.0],\"fov\":{{\"left\":-0.9,\"right\":0.8,\"up\":0.9,\"down\":-0.9}}}}"
        );
        // Uneven times, as a runtime that drops frames gives them.
        text += &format!(
            "{{\"t_ns\":{},\"views\":[{view},{view}],\"flags\":{{\"position_valid\":true,\"orientation_valid\":true}}}}\n",
            1000 + k * k * 12_500_000
        );
    }
    text
}

/// Half a second of TUM: an optical camera in a z-up world, level, looking along +y, moving along +y at 1 m/s.
const TUM: &str = "# a comment\n100.0 3 0 1.5 -0.7071 0 0 0.7071\n100.25 3 0.25 1.5 -0.7071 0 0 0.7071\n100.5 3 0.5 1.5 -0.7071 0 0 0.7071\n";

fn options() -> ReplayOptions {
    let start = Pose::new(DVec3::new(0.0, 1.6, 4.0), DQuat::IDENTITY);
    ReplayOptions::new(Headset::load("symmetric").unwrap(), start)
}

/// A replay with something set.
fn open(
    file: &TemporaryFile,
    set: impl FnOnce(&mut ReplayOptions),
) -> Result<ReplaySession, XrError> {
    let mut options = options();
    set(&mut options);
    ReplaySession::open(&file.0, options)
}

#[test]
fn a_native_trace_replays_frame_by_frame_at_its_own_times() {
    let file = TemporaryFile::with("native.jsonl", &native(4));
    let mut session = ReplaySession::open(&file.0, options()).unwrap();
    assert_eq!(session.info().headset, "odd");
    assert_eq!(session.info().refresh_hz, 80.0);
    assert_eq!(session.info().recommended_size, None);
    assert_eq!(session.frame_count(), 4);
    let frames = play(&mut session);
    let times: Vec<i64> = frames.iter().map(|frame| frame.0).collect();
    assert_eq!(times, [1000, 12_501_000, 50_001_000, 112_501_000]);
    assert_eq!(frames[3].1.views[0].position_in_world.x, 3.5);
    assert_eq!(session.wait_frame().unwrap(), None);
}

#[test]
fn a_time_that_the_trace_does_not_hold_is_an_error() {
    let file = TemporaryFile::with("other-time.jsonl", &native(2));
    let mut session = ReplaySession::open(&file.0, options()).unwrap();
    session.wait_frame().unwrap();
    assert!(matches!(
        session.locate_views(1001),
        Err(XrError::CallOrder(_))
    ));
    assert!(session.locate_views(1000).is_ok());
}

#[test]
fn head_motion_gets_the_headsets_eyes_and_refresh_times() {
    let file = TemporaryFile::with("head.txt", TUM);
    let mut session = ReplaySession::open(&file.0, options()).unwrap();
    assert_eq!(session.info().recommended_size, Some([512, 512]));
    let frames = play(&mut session);
    // 0.5 s at 90 Hz: 45 intervals.
    assert_eq!(frames.len(), 46);
    assert_eq!(frames[45].0, 500_000_000);
    // Recentred: the first head stands at the start pose, the eyes to both sides of it.
    let first = frames[0].1;
    assert!(
        first
            .midpoint_in_world()
            .distance(DVec3::new(0.0, 1.6, 4.0))
            < 1e-15
    );
    assert!((first.views[0].position_in_world.x + 0.0315).abs() < 1e-15);
    assert!((first.views[1].position_in_world.x - 0.0315).abs() < 1e-15);
    // Ahead is -Z: after half a second, half a metre.
    assert!(
        frames[45]
            .1
            .midpoint_in_world()
            .distance(DVec3::new(0.0, 1.6, 3.5))
            < 1e-12
    );
    assert!(
        frames[9]
            .1
            .midpoint_in_world()
            .distance(DVec3::new(0.0, 1.6, 3.9))
            < 1e-12,
        "between rows"
    );
}

#[test]
fn recentring_can_be_left_out_and_frames_named() {
    let file = TemporaryFile::with("as-is.txt", TUM);
    let mut session = open(&file, |options| options.recenter = Some(false)).unwrap();
    assert!(
        play(&mut session)[0]
            .1
            .midpoint_in_world()
            .distance(DVec3::new(3.0, 1.5, 0.0))
            < 1e-15
    );
    let named = open(&file, |options| {
        options.recenter = Some(false);
        options.up = Some(TraceUp::Y);
        options.body = Some(TraceBody::OpenXr);
    });
    let first = play(&mut named.unwrap())[0].1;
    assert!(
        first
            .midpoint_in_world()
            .distance(DVec3::new(3.0, 0.0, 1.5))
            < 1e-15
    );
    let down = first.views[0].orientation * DVec3::NEG_Z;
    assert!(
        down.distance(DVec3::NEG_Y) < 1e-3,
        "the z-up turn is left out: {down}"
    );
}

#[test]
fn the_headset_sets_the_pace() {
    let file = TemporaryFile::with("pace.txt", TUM);
    let headset = Headset::load("quest3")
        .unwrap()
        .with_refresh_hz(120.0)
        .unwrap();
    let session = open(&file, |options| options.headset = headset).unwrap();
    assert_eq!(session.frame_count(), 61);
    assert_eq!(session.info().headset, "quest3");
}

#[test]
fn frame_limits() {
    let file = TemporaryFile::with("limit.jsonl", &native(5));
    for (limit, expected) in [(0, 0), (2, 2), (5, 5), (99, 5)] {
        let mut session = open(&file, |options| options.frame_limit = Some(limit)).unwrap();
        assert_eq!(play(&mut session).len(), expected);
    }
}

#[test]
fn one_pose_is_one_frame() {
    let file = TemporaryFile::with("one.txt", "5 0 0 0 0 0 0 1\n");
    assert_eq!(
        play(&mut ReplaySession::open(&file.0, options()).unwrap()).len(),
        1
    );
}

#[test]
fn flags_that_a_native_trace_has_no_use_for() {
    let file = TemporaryFile::with("flags.jsonl", &native(2));
    let refused = |set: fn(&mut ReplayOptions)| {
        let error = open(&file, set).unwrap_err();
        assert!(error.is_unusable_input());
        error.to_string()
    };
    assert!(refused(|options| options.up = Some(TraceUp::Z)).contains("--trace-up"));
    assert!(refused(|options| options.body = Some(TraceBody::Optical)).contains("--trace-body"));
    assert!(refused(|options| options.recenter = Some(true)).contains("--trace-recenter"));
    assert!(open(&file, |options| options.recenter = Some(false)).is_ok());
}

#[test]
fn a_killed_runs_trace_replays_with_a_warning() {
    let text = native(3);
    let file = TemporaryFile::with("killed.jsonl", &text[..text.len() - 40]);
    let mut session = ReplaySession::open(&file.0, options()).unwrap();
    let warnings = session.warnings();
    assert!(warnings.len() == 1 && warnings[0].contains("line 4"));
    assert_eq!(play(&mut session).len(), 2);
}

#[test]
fn unusable_files_are_input_errors_of_one_line() {
    let files = [
        TemporaryFile::with("empty.txt", ""),
        TemporaryFile::with("garbage.txt", "what is this\n"),
        TemporaryFile::with("broken.txt", "1 0 0 0 0 0 0 1\n2 0 0\n"),
        TemporaryFile::with("header.jsonl", "{\"format\":\"other\"}\n"),
    ];
    let directory = std::env::temp_dir();
    let missing = PathBuf::from("/nowhere/trace.jsonl");
    for path in files
        .iter()
        .map(|file| &file.0)
        .chain([&directory, &missing])
    {
        let error = ReplaySession::open(path, options()).unwrap_err();
        assert!(error.is_unusable_input(), "{error}");
        let text = error.to_string();
        assert!(
            text.contains(&path.display().to_string()) && !text.contains('\n'),
            "{text}"
        );
    }
}

#[test]
fn real_time_takes_the_time_of_the_recording() {
    let file = TemporaryFile::with("real-time.jsonl", &native(3));
    let start = Instant::now();
    play(&mut open(&file, |options| options.pacing = Pacing::RealTime).unwrap());
    // From the first frame to the third, 50 ms; how much longer is up to the machine.
    assert!(start.elapsed() >= Duration::from_millis(50));
}
