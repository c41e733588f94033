//! What may pass into the frame loop, and what a runtime's bad pose turns into.

#![allow(clippy::unwrap_used)]

use glam::{DQuat, DVec3};
use stereolux_xr::validation::{check_fov, check_views, unit_quaternion};
use stereolux_xr::{
    Fov, FrameState, FrameSubmission, LocatedViews, RenderTargets, SessionInfo, Validated, View,
    ViewFlags, XrError, XrSession,
};

fn good(x: f64) -> LocatedViews {
    let view = View {
        position_in_world: DVec3::new(x, 1.6, 0.0),
        orientation: DQuat::from_rotation_y(0.3),
        fov: Fov::from_degrees(-45.0, 40.0, 45.0, -50.0),
    };
    LocatedViews::valid([view, view])
}

#[test]
fn quaternions_near_unit_length_are_normalised_and_others_refused() {
    let scaled = |s: f64| unit_quaternion(0.0, 0.6 * s, 0.0, 0.8 * s);
    for s in [1.0, 0.9991, 1.0009] {
        assert!((scaled(s).unwrap().length() - 1.0).abs() < 1e-15);
    }
    for s in [0.0, 0.9989, 1.0011, 2.0, 1e200, f64::NAN, f64::INFINITY] {
        assert!(scaled(s).is_err(), "{s}");
    }
}

#[test]
fn a_normalised_quaternion_is_never_touched_again() {
    // Rounded to 4 digits, as trajectories are written.
    let mut changed = 0;
    for i in 0..2000 {
        let angle = f64::from(i) * 0.1;
        let round = |v: f64| (v * 1e4).round() / 1e4;
        let (x, w) = (round(angle.sin() * 0.8), round(angle.cos()));
        let (y, z) = (round(angle.sin() * 0.6), 0.0);
        let once = unit_quaternion(x, y, z, w).unwrap();
        changed += u32::from(once.to_array() != [x, y, z, w]);
        let twice = unit_quaternion(once.x, once.y, once.z, once.w).unwrap();
        assert_eq!(
            once.to_array().map(f64::to_bits),
            twice.to_array().map(f64::to_bits)
        );
    }
    assert!(
        changed > 1000,
        "the control: most of the inputs did need normalising, {changed}"
    );
}

#[test]
fn fields_of_view_in_order_and_within_89_degrees() {
    let field = |l, r, u, d| {
        check_fov(&Fov::from_degrees(l, r, u, d))
            .err()
            .map(|f| f.field)
    };
    assert_eq!(field(-45.0, 45.0, 45.0, -45.0), None);
    assert_eq!(field(-89.0, 89.0, 89.0, -89.0), None);
    assert_eq!(
        field(10.0, 20.0, -10.0, -20.0),
        None,
        "need not contain straight ahead"
    );
    assert_eq!(field(-85.0, 85.0, 85.0, -85.0), None);
    assert_eq!(field(-89.1, 45.0, 45.0, -45.0).as_deref(), Some("left"));
    assert_eq!(field(-45.0, 100.0, 45.0, -45.0).as_deref(), Some("right"));
    assert_eq!(field(-45.0, 45.0, 90.0, -45.0).as_deref(), Some("up"));
    assert_eq!(field(-45.0, 45.0, 45.0, -200.0).as_deref(), Some("down"));
    assert_eq!(field(45.0, -45.0, 45.0, -45.0).as_deref(), Some("left"));
    assert_eq!(field(-45.0, -45.0, 45.0, -45.0).as_deref(), Some("left"));
    assert_eq!(field(-45.0, 45.0, -45.0, 45.0).as_deref(), Some("down"));
    assert_eq!(
        field(-45.0, f64::NAN, 45.0, -45.0).as_deref(),
        Some("right")
    );
}

#[test]
fn each_fault_names_its_field() {
    let fault = |change: fn(&mut LocatedViews)| {
        let mut views = good(0.0);
        change(&mut views);
        check_views(&views).map_err(|fault| fault.field)
    };
    assert!(fault(|_| {}).is_ok());
    let named = |change| fault(change).unwrap_err();
    assert_eq!(
        named(|v| v.flags.position_valid = false),
        "flags.position_valid"
    );
    assert_eq!(
        named(|v| v.flags.orientation_valid = false),
        "flags.orientation_valid"
    );
    assert_eq!(
        named(|v| v.views[0].position_in_world.y = f64::NAN),
        "views[0].position"
    );
    assert_eq!(
        named(|v| v.views[1].orientation = DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0)),
        "views[1].orientation"
    );
    assert_eq!(named(|v| v.views[1].fov.angle_up = 2.0), "views[1].fov.up");
}

/// A runtime that says what it is told to say.
struct Scripted {
    info: SessionInfo,
    answers: Vec<Option<LocatedViews>>,
    at: usize,
}

impl Scripted {
    fn new(answers: Vec<Option<LocatedViews>>) -> Self {
        Self {
            info: SessionInfo {
                source: "scripted".into(),
                headset: "none".into(),
                refresh_hz: 90.0,
                recommended_size: None,
                hidden: None,
                takes_depth: false,
            },
            answers,
            at: 0,
        }
    }
}

impl XrSession for Scripted {
    fn info(&self) -> &SessionInfo {
        &self.info
    }
    fn wait_frame(&mut self) -> Result<Option<FrameState>, XrError> {
        Ok(None)
    }
    fn begin_frame(&mut self) -> Result<(), XrError> {
        Ok(())
    }
    fn locate_views(&mut self, _: i64) -> Result<Option<LocatedViews>, XrError> {
        self.at += 1;
        self.answers
            .get(self.at - 1)
            .copied()
            .ok_or_else(|| XrError::Runtime("session lost".into()))
    }
    fn acquire_targets(&mut self) -> Result<RenderTargets, XrError> {
        Ok(RenderTargets::FrameLoopOwned)
    }
    fn end_frame(&mut self, _: FrameSubmission<'_>) -> Result<(), XrError> {
        Ok(())
    }
}

#[test]
fn a_bad_pose_repeats_the_last_good_one() {
    let untracked = LocatedViews {
        flags: ViewFlags {
            position_valid: false,
            orientation_valid: true,
        },
        ..good(9.0)
    };
    let mut not_a_number = good(8.0);
    not_a_number.views[1].position_in_world.x = f64::NAN;
    let script = vec![
        Some(untracked),
        None,
        Some(good(1.0)),
        Some(untracked),
        Some(not_a_number),
        None,
        Some(good(2.0)),
    ];
    let mut session = Validated::new(Scripted::new(script));
    let mut next = || {
        session
            .locate_views(0)
            .unwrap()
            .map(|v| (v.views[0].position_in_world.x, v.repeated))
    };
    assert_eq!(next(), None, "no good pose yet");
    assert_eq!(next(), None);
    assert_eq!(next(), Some((1.0, false)));
    assert_eq!(next(), Some((1.0, true)));
    assert_eq!(next(), Some((1.0, true)));
    assert_eq!(next(), Some((1.0, true)));
    assert_eq!(next(), Some((2.0, false)));
    // Nothing located is no good pose either.
    assert_eq!(session.last_fault().unwrap().field, "views");
    // A lost runtime is an error, not a bad pose.
    assert!(session.locate_views(0).is_err());
}

#[test]
fn a_pose_that_is_repeated_moves_with_the_wearer() {
    let mut session = Validated::new(Scripted::new(vec![Some(good(1.0)), None]));
    session.locate_views(0).unwrap();
    let by_m = DVec3::new(0.5, 2.0, -3.0);
    session.move_wearer(by_m);
    let repeated = session.locate_views(0).unwrap().unwrap();
    assert!(repeated.repeated);
    for (view, before) in repeated.views.iter().zip(&good(1.0).views) {
        assert_eq!(view.position_in_world, before.position_in_world + by_m);
    }
}

#[test]
fn nearly_unit_quaternions_from_a_runtime_come_out_unit() {
    let mut views = good(0.0);
    views.views[0].orientation = DQuat::from_xyzw(0.0, 0.600_1, 0.0, 0.8);
    let mut session = Validated::new(Scripted::new(vec![Some(views)]));
    let located = session.locate_views(0).unwrap().unwrap();
    assert!((located.views[0].orientation.length() - 1.0).abs() < 1e-15);
    assert!(session.last_fault().is_none());
}
