//! A headset that is not there: its head pose is a function of time and nothing else, so every run with
//! the same settings sees the same views.
//!
//! Motion is added to a start pose so that gravity stays vertical: yaw turns about the world's +Y, head
//! pitch and roll are applied in the head's own frame, and displacements follow the start pose's heading.
//! At time 0 every motion is exactly at the start pose.

use super::frame_clock::{FrameOrder, Pacer, Pacing, display_time_ns, period_ns};
use super::view::Pose;
use super::{
    ActionValues, Actions, FrameState, FrameSubmission, HandScript, Headset, Input, LocatedViews,
    QualityFrom, RenderTargets, SessionInfo, XrError, XrSession,
};
use glam::{DQuat, DVec3};
use std::f64::consts::TAU;
use stereolux_base::random;
use stereolux_settings::Motion;

/// Yaw sweep amplitude: 30 degrees to each side, radians.
pub const YAW_SWEEP_RAD: f64 = TAU / 12.0;
/// Yaw sweep period, seconds; its peak rate is 47 degrees per second, an unhurried turn of the head.
pub const YAW_SWEEP_PERIOD_S: f64 = 4.0;
/// How far ahead the walk goes, metres.
pub const WALK_LENGTH_M: f64 = 0.6;
/// There and back, seconds.
pub const WALK_PERIOD_S: f64 = 6.0;
/// Steps per second, as in an easy stroll.
pub const WALK_STEP_HZ: f64 = 1.7;
/// Vertical bob of the head while walking, metres; the sideways sway is half of it.
pub const WALK_BOB_M: f64 = 0.02;
/// Lower and upper edge of the sway's spectrum, hertz: postural sway lies below 1 Hz, voluntary head
/// turns below 2 Hz.
pub const SWAY_BAND_HZ: [f64; 2] = [0.1, 2.0];
/// Bound on each coordinate's displacement in sway, metres.
pub const SWAY_POSITION_M: f64 = 0.03;
/// Bounds on yaw, pitch and roll in sway, radians (8, 4 and 2 degrees).
pub const SWAY_ANGLES_RAD: [f64; 3] = [TAU / 45.0, TAU / 90.0, TAU / 180.0];
/// Sines per noise channel.
const SINES: usize = 6;

/// Displacement and turn of the head against its start pose.
#[derive(Clone, Copy, Debug, Default)]
struct Offset {
    /// Metres, in the frame of the start pose's heading: x right, y up, z back.
    displacement: DVec3,
    yaw_rad: f64,
    pitch_rad: f64,
    roll_rad: f64,
}

/// Sum of sines with frequencies that share no period, zero at time 0.
#[derive(Clone, Debug)]
struct Noise {
    /// Amplitude (the sum of all is at most 1/2), angular frequency (rad/s), phase (rad).
    sines: [(f64, f64, f64); SINES],
}

impl Noise {
    fn new(random_state: &mut u64) -> Self {
        let [low, high] = SWAY_BAND_HZ;
        let sines = std::array::from_fn(|i| {
            // One frequency in each of SINES equal steps of the band on a log scale.
            let step = (i as f64 + random::unit(random_state)) / SINES as f64;
            let hertz = low * (high / low).powf(step);
            // Equal energy per octave: slow sway is wide, fast sway narrow, as in postural records.
            (low / hertz, TAU * hertz, TAU * random::unit(random_state))
        });
        let sum: f64 = sines.iter().map(|s: &(f64, f64, f64)| s.0).sum();
        Self {
            sines: sines.map(|(amplitude, rate, phase)| (0.5 * amplitude / sum, rate, phase)),
        }
    }

    /// In [-1, 1].
    fn at(&self, seconds: f64) -> f64 {
        self.sines
            .iter()
            .map(|(amplitude, rate, phase)| {
                amplitude * ((rate * seconds + phase).sin() - phase.sin())
            })
            .sum()
    }
}

fn source(motion: Motion, seed: u64) -> String {
    match motion {
        Motion::Sway => format!("simulated ({motion}, seed {seed})"),
        _ => format!("simulated ({motion})"),
    }
}

/// Noise of x, y, z, yaw, pitch and roll.
fn sway_noise(seed: u64) -> [Noise; 6] {
    let mut random_state = seed;
    std::array::from_fn(|_| Noise::new(&mut random_state))
}

/// A simulated headset: display times at the profile's refresh rate from 0 on, head poses from a
/// [`Motion`].
#[derive(Debug)]
pub struct SimulatedSession {
    info: SessionInfo,
    headset: Headset,
    motion: Motion,
    start: Pose,
    /// x, y, z, yaw, pitch, roll; only sway uses them.
    noise: [Noise; 6],
    hands: HandScript,
    actions: Actions,
    /// How far the application has moved the wearer.
    moved_m: DVec3,
    frame_limit: Option<u64>,
    next_frame: u64,
    order: FrameOrder,
    pacer: Pacer,
}

impl SimulatedSession {
    /// A head that starts at `start` (world from head) and ends after `frame_limit` frames, or never. Its sway is that of
    /// seed 0.
    #[must_use]
    pub fn new(headset: Headset, motion: Motion, start: Pose, frame_limit: Option<u64>) -> Self {
        Self {
            info: SessionInfo::of_profile(source(motion, 0), &headset),
            headset,
            motion,
            start,
            noise: sway_noise(0),
            hands: HandScript::default(),
            actions: Actions::default(),
            moved_m: DVec3::ZERO,
            frame_limit,
            next_frame: 0,
            order: FrameOrder::default(),
            pacer: Pacer::new(Pacing::AsFastAsPossible),
        }
    }

    /// Another sway for each seed; the other motions have no chance in them.
    #[must_use]
    pub fn with_seed(mut self, seed: u64) -> Self {
        self.noise = sway_noise(seed);
        self.info.source = source(self.motion, seed);
        self
    }

    /// Hands that do what a script says; without one there are none.
    #[must_use]
    pub fn with_hands(mut self, hands: HandScript) -> Self {
        self.hands = hands;
        self
    }

    /// What the application's actions are: the hands hold Touch controllers, and what is bound to those drives them.
    #[must_use]
    pub fn with_actions(mut self, actions: Actions) -> Self {
        self.actions = actions;
        self
    }

    /// Frames at once (the default) or when they are due.
    #[must_use]
    pub fn with_pacing(mut self, pacing: Pacing) -> Self {
        self.pacer = Pacer::new(pacing);
        self
    }

    /// World from head at a time, nanoseconds, as long as nothing moves the wearer.
    #[must_use]
    pub fn head_at(&self, time_ns: i64) -> Pose {
        let offset = self.offset_at(time_ns as f64 * 1e-9);
        let heading = DQuat::from_rotation_y(self.start.heading_rad());
        let orientation = DQuat::from_rotation_y(offset.yaw_rad)
            * self.start.orientation
            * DQuat::from_rotation_x(offset.pitch_rad)
            * DQuat::from_rotation_z(offset.roll_rad);
        Pose::new(
            self.start.position + heading * offset.displacement,
            orientation.normalize(),
        )
    }

    fn offset_at(&self, seconds: f64) -> Offset {
        match self.motion {
            Motion::Still => Offset::default(),
            Motion::Yaw => Offset {
                yaw_rad: YAW_SWEEP_RAD * (TAU / YAW_SWEEP_PERIOD_S * seconds).sin(),
                ..Offset::default()
            },
            Motion::Walk => {
                let ahead = 0.5 * WALK_LENGTH_M * (1.0 - (TAU / WALK_PERIOD_S * seconds).cos());
                // Two steps per stride: the head dips at every step and leans once per stride.
                let step = TAU * WALK_STEP_HZ * seconds;
                let bob = 0.5 * WALK_BOB_M * (step.cos() - 1.0);
                let lean = 0.5 * WALK_BOB_M * (0.5 * step).sin();
                Offset {
                    displacement: DVec3::new(lean, bob, -ahead),
                    ..Offset::default()
                }
            }
            Motion::Sway => {
                let [x, y, z, yaw, pitch, roll] = &self.noise;
                let displacement = DVec3::new(x.at(seconds), y.at(seconds), z.at(seconds));
                Offset {
                    displacement: SWAY_POSITION_M * displacement,
                    yaw_rad: SWAY_ANGLES_RAD[0] * yaw.at(seconds),
                    pitch_rad: SWAY_ANGLES_RAD[1] * pitch.at(seconds),
                    roll_rad: SWAY_ANGLES_RAD[2] * roll.at(seconds),
                }
            }
        }
    }
}

impl XrSession for SimulatedSession {
    fn info(&self) -> &SessionInfo {
        &self.info
    }

    fn wait_frame(&mut self) -> Result<Option<FrameState>, XrError> {
        self.order.may_wait()?;
        if self
            .frame_limit
            .is_some_and(|limit| self.next_frame >= limit)
        {
            return Ok(None);
        }
        let refresh_hz = self.info.refresh_hz;
        let frame = FrameState {
            predicted_display_time_ns: display_time_ns(self.next_frame, refresh_hz),
            period_ns: period_ns(refresh_hz),
            should_render: true,
            switch_reuse: false,
            quality: QualityFrom::Application,
        };
        self.pacer.wait_until(frame.predicted_display_time_ns);
        self.next_frame += 1;
        self.order.waited(&frame);
        Ok(Some(frame))
    }

    fn begin_frame(&mut self) -> Result<(), XrError> {
        self.order.begin()
    }

    fn locate_views(&mut self, display_time_ns: i64) -> Result<Option<LocatedViews>, XrError> {
        self.order.may_locate("locate_views")?;
        let mut head = self.head_at(display_time_ns);
        head.position += self.moved_m;
        Ok(Some(LocatedViews::valid(
            self.headset.views_from_head(&head),
        )))
    }

    fn locate_input(&mut self, display_time_ns: i64) -> Result<Input, XrError> {
        self.order.may_locate("locate_input")?;
        let mut input = self.hands.at(display_time_ns);
        for hand in &mut input.hands {
            let tracked = [&mut hand.grip, &mut hand.aim].into_iter().flatten();
            let joints = hand.joints.iter_mut().flat_map(|joints| joints.iter_mut());
            let poses = tracked.map(|tracked| &mut tracked.pose);
            for pose in poses.chain(joints.map(|joint| &mut joint.pose)) {
                pose.position += self.moved_m;
            }
        }
        input.actions = ActionValues::of_touch(&self.actions, &input.hands);
        Ok(input)
    }

    fn move_wearer(&mut self, by_m: DVec3) {
        self.moved_m += by_m;
    }

    fn acquire_targets(&mut self) -> Result<RenderTargets, XrError> {
        self.order.may_acquire()?;
        Ok(RenderTargets::FrameLoopOwned)
    }

    fn end_frame(&mut self, submission: FrameSubmission<'_>) -> Result<(), XrError> {
        self.order.end(submission.display_time_ns)
    }
}
