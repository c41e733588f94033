//! Hands of the simulated headset: a script of what they do when, read from TOML.
//!
//! ```toml
//! joints = true                # both hands have joints (`simulated_joints`); without it they have none
//! [[right]]
//! at_s = 0.5                   # seconds; each step of a hand is later than the one before
//! reach = "vase"               # the grip goes to the middle of that node, where the scene's file has it
//! [[right]]
//! at_s = 1.0
//! press = ["squeeze"]          # held from now on, until a later step says otherwise
//! [[right]]
//! at_s = 2.0
//! position_m = [0.3, 1.0, 0.2] # in the world
//! [[right]]
//! at_s = 2.1
//! press = []
//! ```
//!
//! A hand rests below the head's start, beside it, until its first step, and moves in a straight line at even speed from
//! step to step; steps that name no place do not count for that. Grip and aim lie in the same place and turn alike.

use std::path::Path;

use glam::{DQuat, DVec2, DVec3};
use serde::Deserialize;
use toml::Spanned;

use super::input::{Button, Buttons, Hand, Input, Side, Tracked};
use super::simulated_joints::joints_of;
use super::{InputError, toml_files, validation};
use stereolux_base::pose::Pose;

/// Where a hand rests, in the frame of the head's heading: right (left for the left hand), up, back; metres.
const REST_M: DVec3 = DVec3::new(0.2, -0.4, -0.35);
/// How far a waving hand goes to each side, metres, and how often a second.
const WAVE_M: f64 = 0.1;
const WAVE_HZ: f64 = 1.0;
/// Half of the time over which velocity is taken, seconds.
const VELOCITY_STEP_S: f64 = 1e-3;

/// What both hands do; by default there are none.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HandScript {
    hands: [Option<HandPlan>; 2],
    has_joints: bool,
}

/// What one hand does.
#[derive(Clone, Debug, Default, PartialEq)]
struct HandPlan {
    /// Seconds and where the hand is then, in order; at least one.
    places: Vec<(f64, Pose)>,
    /// Seconds from which on these buttons are held.
    held: Vec<(f64, Buttons)>,
    /// Seconds from which on the stick stands so.
    sticks: Vec<(f64, DVec2)>,
    /// Seconds from which on the hand waves or does not.
    waves: Vec<(f64, bool)>,
}

#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct File {
    joints: bool,
    left: Vec<Spanned<Step>>,
    right: Vec<Spanned<Step>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Step {
    at_s: f64,
    position_m: Option<[f64; 3]>,
    orientation: Option<[f64; 4]>,
    reach: Option<String>,
    point_at: Option<String>,
    offset_m: Option<[f64; 3]>,
    press: Option<Vec<String>>,
    stick: Option<[f64; 2]>,
    wave: Option<bool>,
}

/// Where a node of that name is in the world, or what to say beside that there is none.
type PlaceOf<'a> = dyn Fn(&str) -> Result<DVec3, String> + 'a;

impl HandScript {
    /// Reads a script. `start` is where the head starts, `world_from_head`; `place_of` says where a node is in the world,
    /// or what to add to the message that there is none.
    ///
    /// # Errors
    /// An unreadable file, or the first fault in it, with file, line and field.
    pub fn load(path: &Path, start: &Pose, place_of: &PlaceOf<'_>) -> Result<Self, InputError> {
        let (name, text) = toml_files::read(path, "script of hands")?;
        Self::parse(&name, &text, start, place_of)
    }

    /// As [`HandScript::load`], from text; `file` names it in errors.
    ///
    /// # Errors
    /// The first fault, with file, line and field.
    pub fn parse(
        file: &str,
        text: &str,
        start: &Pose,
        place_of: &PlaceOf<'_>,
    ) -> Result<Self, InputError> {
        let read: File = toml_files::parsed(file, text)?;
        let plan = |side: Side, steps: &[Spanned<Step>]| {
            if steps.is_empty() {
                return Ok(None);
            }
            let mut plan = HandPlan::resting(side, start);
            let mut last_s = f64::NEG_INFINITY;
            for step in steps {
                let added = plan.add(step.get_ref(), last_s, place_of);
                added.map_err(|(field, what)| {
                    let start = step.span().start;
                    // The step's own line where the field is left out.
                    let own = text[start..].lines().enumerate();
                    let mut own = own.take_while(|(at, line)| *at == 0 || !line.starts_with("[["));
                    let key = |line: &str| line.split('=').next().unwrap_or("").trim() == field;
                    let below = own.find(|(_, line)| key(line)).map_or(0, |(at, _)| at);
                    let line = toml_files::line_at(text, start) + below;
                    let field = format!("{}.{field}", side.word());
                    InputError::field(file, line, &field, what)
                })?;
                last_s = step.get_ref().at_s;
            }
            Ok(Some(plan))
        };
        Ok(Self {
            hands: [
                plan(Side::Left, &read.left)?,
                plan(Side::Right, &read.right)?,
            ],
            has_joints: read.joints,
        })
    }

    /// What the hands do at a time, nanoseconds.
    #[must_use]
    pub fn at(&self, time_ns: i64) -> Input {
        let seconds = time_ns as f64 * 1e-9;
        let hand = |side: Side| {
            let plan = self.hands[side as usize].as_ref();
            let mut hand = plan.map_or_else(Hand::default, |plan| plan.at(seconds));
            let grip = hand.grip.filter(|_| self.has_joints);
            hand.joints = grip.map(|grip| joints_of(side, &grip.pose, hand.trigger, hand.squeeze));
            hand
        };
        Input {
            hands: Side::BOTH.map(hand),
            ..Input::default()
        }
    }
}

impl HandPlan {
    fn resting(side: Side, start: &Pose) -> Self {
        let heading = DQuat::from_rotation_y(start.heading_rad());
        let sign = match side {
            Side::Left => -1.0,
            Side::Right => 1.0,
        };
        let rest = REST_M * DVec3::new(sign, 1.0, 1.0);
        Self {
            places: vec![(
                f64::NEG_INFINITY,
                Pose::new(start.position + heading * rest, heading),
            )],
            ..Self::default()
        }
    }

    /// Adds a step; the field and what is wrong with it.
    fn add(
        &mut self,
        step: &Step,
        last_s: f64,
        place_of: &PlaceOf<'_>,
    ) -> Result<(), (&'static str, String)> {
        let at_s = step.at_s;
        if !at_s.is_finite() || at_s < 0.0 || at_s <= last_s {
            let what = format!(
                "{at_s} is not a time at or after 0 and after the hand's step before; give seconds in order"
            );
            return Err(("at_s", what));
        }
        if let Some(place) = self.place(step, place_of)? {
            self.places.push((at_s, place));
        }
        if let Some(words) = &step.press {
            let buttons = words.iter().map(|word| Button::named(word));
            let buttons: Result<Buttons, _> = buttons.collect();
            self.held
                .push((at_s, buttons.map_err(|what| ("press", what))?));
        }
        if let Some(stick) = step.stick {
            if !stick.iter().all(|axis| (-1.0..=1.0).contains(axis)) {
                let what = format!("{stick:?} is not within -1 to 1 on both axes");
                return Err(("stick", what));
            }
            self.sticks.push((at_s, DVec2::from_array(stick)));
        }
        if let Some(wave) = step.wave {
            self.waves.push((at_s, wave));
        }
        Ok(())
    }

    /// Where a step puts the hand; `None` if it does not say.
    fn place(
        &self,
        step: &Step,
        place_of: &PlaceOf<'_>,
    ) -> Result<Option<Pose>, (&'static str, String)> {
        let finite = |name, value: Option<[f64; 3]>| match value.map(DVec3::from_array) {
            Some(value) if !value.is_finite() => Err((name, format!("{value} is not finite"))),
            value => Ok(value),
        };
        let node = |name: &'static str, node: &Option<String>| {
            let place = node.as_ref().map(|node| {
                place_of(node)
                    .map_err(|hint| (name, format!("the scene has no node '{node}'{hint}")))
            });
            place.transpose()
        };
        let given = finite("position_m", step.position_m)?;
        let reached = node("reach", &step.reach)?;
        if given.is_some() && reached.is_some() {
            let what = "stands beside position_m; a step has one of them".to_owned();
            return Err(("reach", what));
        }
        if step.orientation.is_some() && step.point_at.is_some() {
            let what = "stands beside orientation; a step has one of them".to_owned();
            return Err(("point_at", what));
        }
        let offset = finite("offset_m", step.offset_m)?;
        let aimed_at = node("point_at", &step.point_at)?;
        let last = self.places.last().map_or(Pose::IDENTITY, |(_, pose)| *pose);
        let moves = given.or(reached).is_some() || offset.is_some();
        if !moves && aimed_at.is_none() && step.orientation.is_none() {
            return Ok(None);
        }
        let position = given.or(reached).unwrap_or(last.position) + offset.unwrap_or(DVec3::ZERO);
        let orientation = match (step.orientation, aimed_at) {
            (Some([x, y, z, w]), _) => {
                validation::unit_quaternion(x, y, z, w).map_err(|what| ("orientation", what))?
            }
            (None, Some(target)) => match (target - position).try_normalize() {
                Some(direction) => DQuat::from_rotation_arc(DVec3::NEG_Z, direction).normalize(),
                None => return Err(("point_at", "the hand is in that very place".to_owned())),
            },
            (None, None) => last.orientation,
        };
        Ok(Some(Pose::new(position, orientation)))
    }

    fn at(&self, seconds: f64) -> Hand {
        let pose = self.pose_at(seconds);
        let (before, after) = (
            self.pose_at(seconds - VELOCITY_STEP_S),
            self.pose_at(seconds + VELOCITY_STEP_S),
        );
        let per_second = 0.5 / VELOCITY_STEP_S;
        let turn = after.orientation * before.orientation.conjugate();
        // The short way round.
        let turn = if turn.w < 0.0 { -turn } else { turn };
        let tracked = Tracked {
            pose,
            linear_velocity: (after.position - before.position) * per_second,
            angular_velocity: turn.to_scaled_axis() * per_second,
        };
        let pressed = latest(&self.held, seconds).unwrap_or_default();
        let pulled = |button| f64::from(u8::from(pressed.has(button)));
        Hand {
            grip: Some(tracked),
            aim: Some(tracked),
            trigger: pulled(Button::Trigger),
            squeeze: pulled(Button::Squeeze),
            stick: latest(&self.sticks, seconds).unwrap_or_default(),
            pressed,
            touched: pressed,
            joints: None,
        }
    }

    fn pose_at(&self, seconds: f64) -> Pose {
        let next = self.places.partition_point(|(at_s, _)| *at_s <= seconds);
        let (began_s, mut pose) = match next.checked_sub(1).and_then(|last| self.places.get(last)) {
            Some((at_s, pose)) => (at_s.max(0.0), *pose),
            None => (0.0, Pose::IDENTITY),
        };
        if let Some((end_s, end)) = self.places.get(next)
            && seconds > began_s
        {
            let share = (seconds - began_s) / (end_s - began_s);
            pose = Pose::new(
                pose.position.lerp(end.position, share),
                // Unit length to the last bits, as a recording reads it back.
                pose.orientation.slerp(end.orientation, share).normalize(),
            );
        }
        if latest(&self.waves, seconds) == Some(true) {
            let sideways = WAVE_M * (std::f64::consts::TAU * WAVE_HZ * seconds).sin();
            pose.position += pose.orientation * (DVec3::X * sideways);
        }
        pose
    }
}

/// What was said last at or before a time.
fn latest<T: Copy>(said: &[(f64, T)], seconds: f64) -> Option<T> {
    let before = said.iter().take_while(|(at_s, _)| *at_s <= seconds);
    before.last().map(|(_, value)| *value)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<HandScript, String> {
        let place_of = |name: &str| match name {
            "vase" => Ok(DVec3::new(0.0, 1.0, -2.0)),
            _ => Err(String::new()),
        };
        HandScript::parse("hands.toml", text, &Pose::IDENTITY, &place_of)
            .map_err(|error| error.to_string())
    }

    fn grip(script: &HandScript, side: Side, seconds: f64) -> Tracked {
        script.at((seconds * 1e9) as i64).hands[side as usize]
            .grip
            .unwrap()
    }

    /// Central differences of a straight line and of an even turn are exact, but for roundings of 1e-16 m over 2e-3 s.
    #[test]
    fn a_hand_moves_and_turns_evenly_between_two_steps() {
        let (sine, cosine) = 0.25_f64.sin_cos();
        let script = format!(
            "[[right]]\nat_s = 1.0\nposition_m = [0, 0, 0]\norientation = [0, 0, 0, 1]\n\
             [[right]]\nat_s = 2.0\nposition_m = [1, 2, -3]\norientation = [0, {sine}, 0, {cosine}]\n"
        );
        let script = parse(&script).unwrap();
        let half = grip(&script, Side::Right, 1.5);
        assert!((half.pose.position - DVec3::new(0.5, 1.0, -1.5)).length() < 1e-9);
        assert!((half.linear_velocity - DVec3::new(1.0, 2.0, -3.0)).length() < 1e-9);
        assert!((half.angular_velocity - DVec3::new(0.0, 0.5, 0.0)).length() < 1e-9);
        let after = grip(&script, Side::Right, 3.0);
        assert_eq!(after.linear_velocity, DVec3::ZERO);
        assert_eq!(after.pose.position, DVec3::new(1.0, 2.0, -3.0));
        assert_eq!(script.at(0).hands[Side::Left as usize], Hand::default());
    }

    #[test]
    fn hands_rest_beside_the_head_and_wave_sideways() {
        let script = parse("[[left]]\nat_s = 1\npress = []\n[[right]]\nat_s = 0\nwave = true\n");
        let script = script.unwrap();
        let left = grip(&script, Side::Left, 0.0).pose.position;
        assert_eq!(left, REST_M * DVec3::new(-1.0, 1.0, 1.0));
        // A quarter of a second is the end of the way, half of one its middle; a central difference leaves out a sixth of
        // the third derivative by h^2, 0.1 (2 pi)^3 1e-6 / 6 m/s.
        let end = grip(&script, Side::Right, 0.25).pose.position;
        assert!((end - REST_M - DVec3::X * WAVE_M).length() < 1e-12);
        let middle = grip(&script, Side::Right, 0.5);
        let speed = -std::f64::consts::TAU * WAVE_M * WAVE_HZ;
        assert!((middle.linear_velocity.x - speed).abs() < 5e-6);
    }

    #[test]
    fn every_fault_of_a_script_is_one_line_with_its_place() {
        for (text, line, field) in [
            (
                "[[right]]\nat_s = 1\n[[right]]\nat_s = 1\n",
                4,
                "right.at_s",
            ),
            ("[[left]]\nat_s = -1\n", 2, "left.at_s"),
            (
                "[[left]]\nat_s = 1\nposition_m = [0, 0, 0]\nreach = 'vase'\n",
                4,
                "left.reach",
            ),
            (
                "[[left]]\nat_s = 1\norientation = [0, 0, 0, 1]\npoint_at = 'vase'\n",
                4,
                "left.point_at",
            ),
            (
                "[[left]]\nat_s = 1\nreach = 'vase'\npoint_at = 'vase'\n",
                4,
                "left.point_at",
            ),
            ("[[left]]\nat_s = 1\nreach = 'vise'\n", 3, "left.reach"),
            ("[[left]]\nat_s = 1\nstick = [2, 0]\n", 3, "left.stick"),
            ("[[left]]\nat_s = 1\npress = ['nose']\n", 3, "left.press"),
            (
                "[[left]]\nat_s = 1\nposition_m = [0, nan, 0]\n",
                3,
                "left.position_m",
            ),
        ] {
            let error = parse(text).unwrap_err();
            let place = format!("line {line}, field {field}: ");
            assert!(error.contains(&place), "{error}");
            assert!(!error.contains('\n'), "{error}");
        }
    }
}
