//! The simulated headset: the same at every run, bounded, gravity vertical, times on the refresh grid.

#![allow(clippy::unwrap_used)]

use glam::{DQuat, DVec3};
use stereolux_settings::Choice as _;
use stereolux_xr::simulated::{
    SWAY_ANGLES_RAD, SWAY_BAND_HZ, SWAY_POSITION_M, WALK_BOB_M, WALK_LENGTH_M, WALK_PERIOD_S,
    YAW_SWEEP_PERIOD_S, YAW_SWEEP_RAD,
};
use stereolux_xr::{
    FrameSubmission, Headset, LocatedViews, Motion, Pose, SimulatedSession, XrError, XrSession,
};

const MOTIONS: &[Motion] = Motion::ALL;

fn start() -> Pose {
    Pose::new(
        DVec3::new(1.0, 1.6, -3.0),
        DQuat::from_euler(glam::EulerRot::YXZ, 0.8, -0.2, 0.0),
    )
}

fn session(motion: Motion) -> SimulatedSession {
    SimulatedSession::new(Headset::load("quest3").unwrap(), motion, start(), None).with_seed(7)
}

/// Runs the frame loop's five calls to the end of the stream.
pub fn play(session: &mut dyn XrSession) -> Vec<(i64, LocatedViews)> {
    let mut frames = Vec::new();
    while let Some(frame) = session.wait_frame().unwrap() {
        assert!(frame.should_render);
        session.begin_frame().unwrap();
        let time_ns = frame.predicted_display_time_ns;
        let views = session.locate_views(time_ns).unwrap().unwrap();
        session.acquire_targets().unwrap();
        session
            .end_frame(FrameSubmission::new(time_ns, Some(&views)))
            .unwrap();
        frames.push((time_ns, views));
    }
    frames
}

#[test]
fn two_runs_are_the_same_and_two_seeds_are_not() {
    for &motion in MOTIONS {
        let frames = |motion| {
            play(&mut SimulatedSession::new(
                Headset::load("index").unwrap(),
                motion,
                start(),
                Some(50),
            ))
        };
        assert_eq!(frames(motion), frames(motion));
        assert_eq!(frames(motion).len(), 50);
    }
    let late = |seed| session(Motion::Sway).with_seed(seed).head_at(2_000_000_000);
    assert_ne!(late(1), late(2));
}

#[test]
fn the_pose_depends_on_time_alone() {
    let mut session = session(Motion::Sway).with_seed(3);
    session.wait_frame().unwrap();
    let late = session.locate_views(5_000_000_000).unwrap();
    let early = session.locate_views(1_000_000_000).unwrap();
    assert_eq!(session.locate_views(5_000_000_000).unwrap(), late);
    assert_ne!(early, late);
}

#[test]
fn frames_lie_on_the_refresh_grid() {
    let headset = Headset::load("quest3")
        .unwrap()
        .with_refresh_hz(72.0)
        .unwrap();
    let mut session = SimulatedSession::new(headset, Motion::Still, start(), Some(73));
    let times: Vec<i64> = play(&mut session).iter().map(|frame| frame.0).collect();
    assert_eq!(times[0], 0);
    assert_eq!(times[1], 13_888_889);
    assert_eq!(times[72], 1_000_000_000);
    assert_eq!(session.wait_frame().unwrap(), None, "the end stays the end");
    assert_eq!(session.info().refresh_hz, 72.0);
    assert_eq!(session.info().recommended_size, Some([2064, 2208]));
}

#[test]
fn no_frames_is_a_stream_too() {
    let mut session = SimulatedSession::new(
        Headset::load("vive").unwrap(),
        Motion::Still,
        start(),
        Some(0),
    );
    assert_eq!(session.wait_frame().unwrap(), None);
}

#[test]
fn every_motion_starts_at_the_start_pose_and_stays_near_it() {
    for &motion in MOTIONS {
        let session = session(motion);
        let first = session.head_at(0);
        assert_eq!(first.position, start().position, "{motion}");
        assert!(
            first.orientation.angle_between(start().orientation) < 1e-7,
            "{motion}"
        );
        let mut travelled = 0.0_f64;
        let mut turned = 0.0_f64;
        for k in 0..6000 {
            let head = session.head_at(k * 10_000_000);
            let moved = head.position - start().position;
            assert!(head.position.is_finite() && head.orientation.is_normalized());
            travelled = travelled.max(moved.length());
            turned = turned.max(head.orientation.angle_between(start().orientation));
            if motion == Motion::Sway {
                // Each coordinate's bound holds in the heading's frame.
                let local = DQuat::from_rotation_y(-start().heading_rad()) * moved;
                assert!(local.abs().max_element() <= SWAY_POSITION_M);
            }
        }
        let (least_m, most_m, least_rad, most_rad) = match motion {
            Motion::Still => (0.0, 0.0, 0.0, 1e-7),
            // Sampled every 10 ms the sweep's peak is met within 1e-4.
            Motion::Yaw => (0.0, 0.0, YAW_SWEEP_RAD - 1e-4, YAW_SWEEP_RAD + 1e-7),
            Motion::Walk => (
                WALK_LENGTH_M - 1e-3,
                WALK_LENGTH_M + 2.0 * WALK_BOB_M,
                0.0,
                1e-7,
            ),
            // At least a tenth of the bound is used; the three turns add up at most.
            Motion::Sway => (
                0.1 * SWAY_POSITION_M,
                3.0_f64.sqrt() * SWAY_POSITION_M,
                0.1 * SWAY_ANGLES_RAD[0],
                SWAY_ANGLES_RAD.iter().sum(),
            ),
        };
        assert!(
            (least_m..=most_m).contains(&travelled),
            "{motion}: {travelled} m"
        );
        assert!(
            (least_rad..=most_rad).contains(&turned),
            "{motion}: {turned} rad"
        );
    }
}

#[test]
fn the_sweep_turns_about_the_vertical_and_the_walk_goes_ahead() {
    let quarter_ns = (YAW_SWEEP_PERIOD_S * 0.25e9) as i64;
    let turned = session(Motion::Yaw).head_at(quarter_ns);
    let expected = DQuat::from_rotation_y(YAW_SWEEP_RAD) * start().orientation;
    assert!(turned.orientation.angle_between(expected) < 1e-7);
    let half_ns = (WALK_PERIOD_S * 0.5e9) as i64;
    let ahead = session(Motion::Walk).head_at(half_ns).position - start().position;
    let heading = DQuat::from_rotation_y(start().heading_rad());
    let local = heading.conjugate() * ahead;
    assert!((local.z + WALK_LENGTH_M).abs() < 1e-12, "{local}");
    assert!(local.y.abs() <= WALK_BOB_M && local.x.abs() <= WALK_BOB_M);
}

#[test]
fn sway_holds_no_energy_beyond_its_band() {
    // Power of one coordinate, by correlation with sines over 200 s under a Hann window (side lobes fall as the
    // third power: 2.5 Hz is 100 bins from the band's edge, so leakage is under 1e-6 of the amplitude).
    let session = session(Motion::Sway).with_seed(11);
    let count = 20_000;
    let swayed: Vec<f64> = (0..count)
        .map(|k| {
            let head = session.head_at(k * 10_000_000);
            let hann = 0.5 - 0.5 * (std::f64::consts::TAU * k as f64 / count as f64).cos();
            hann * (head.position.x - start().position.x)
        })
        .collect();
    let amplitude = |hertz: f64| {
        let (mut re, mut im) = (0.0, 0.0);
        for (k, value) in swayed.iter().enumerate() {
            let phase = std::f64::consts::TAU * hertz * k as f64 * 0.01;
            re += value * phase.cos();
            im += value * phase.sin();
        }
        4.0 * f64::hypot(re, im) / count as f64
    };
    let peak = |from: f64, to: f64| {
        let steps = ((to - from) / 0.0025) as u32;
        (0..=steps)
            .map(|i| amplitude(from + f64::from(i) * 0.0025))
            .fold(0.0, f64::max)
    };
    let inside = peak(SWAY_BAND_HZ[0], SWAY_BAND_HZ[1]);
    let outside = peak(2.5, 4.0);
    assert!(inside > 0.05 * SWAY_POSITION_M, "{inside}");
    assert!(outside < 1e-4 * inside, "{outside} against {inside}");
}

#[test]
fn calls_out_of_order_are_errors() {
    let mut session = session(Motion::Still);
    let refused = |result: Result<(), XrError>| matches!(result, Err(XrError::CallOrder(_)));
    assert!(refused(session.begin_frame()));
    assert!(refused(session.locate_views(0).map(drop)));
    let frame = session.wait_frame().unwrap().unwrap();
    let time_ns = frame.predicted_display_time_ns;
    assert!(refused(session.wait_frame().map(drop)));
    assert!(refused(session.acquire_targets().map(drop)));
    session.begin_frame().unwrap();
    assert!(refused(
        session.end_frame(FrameSubmission::new(time_ns + 1, None))
    ));
    session
        .end_frame(FrameSubmission::new(time_ns, None))
        .unwrap();
    assert!(refused(
        session.end_frame(FrameSubmission::new(time_ns, None))
    ));
}
