//! Moving and turning through the scene: where the runtime's space lies in the world.

use glam::{DQuat, DVec2, DVec3};

use crate::view::Pose;
use stereolux_settings::{OpenXrSettings, Turn};

/// Deflection of a stick below which it rests, as a share of the full way.
const DEAD_ZONE: f64 = 0.2;
/// A snap turn begins beyond the first and may begin again once the stick is back under the second.
const SNAP_AT: f64 = 0.7;
const SNAP_AGAIN_UNDER: f64 = 0.3;
/// A frame that took longer than this moves no further: a pause is not a leap.
const LONGEST_STEP_S: f64 = 0.1;

/// Place and heading of the runtime's space in the world.
#[derive(Clone, Copy, Debug)]
pub(super) struct Locomotion {
    world_from_space: Pose,
    speed_m_per_s: f64,
    turn: Turn,
    snap_turn_rad: f64,
    turn_rad_per_s: f64,
    turn_is_due: bool,
}

impl Locomotion {
    /// Starts with the space at `world_from_space`.
    pub(super) fn new(world_from_space: Pose, settings: &OpenXrSettings) -> Self {
        Self {
            world_from_space,
            speed_m_per_s: settings.move_m_per_s,
            turn: settings.turn,
            snap_turn_rad: settings.snap_turn_deg.to_radians(),
            turn_rad_per_s: settings.turn_deg_per_s.to_radians(),
            turn_is_due: true,
        }
    }

    pub(super) fn world_from_space(&self) -> Pose {
        self.world_from_space
    }

    /// Moves the space in the world.
    pub(super) fn move_by(&mut self, by_m: DVec3) {
        self.world_from_space.position += by_m;
    }

    /// Walks along the horizontal direction in which `head` (world from head) looks; `stick` is right and forward,
    /// each -1 to 1, for `seconds`.
    pub(super) fn walk(&mut self, head: &Pose, stick: DVec2, seconds: f64) {
        let deflection = stick.length();
        if deflection.is_nan() || deflection < DEAD_ZONE {
            return;
        }
        let stick = if deflection > 1.0 {
            stick / deflection
        } else {
            stick
        };
        let heading = DQuat::from_rotation_y(head.heading_rad());
        let step_m = self.speed_m_per_s * seconds.clamp(0.0, LONGEST_STEP_S);
        self.world_from_space.position += heading * DVec3::new(stick.x, 0.0, -stick.y) * step_m;
    }

    /// Turns about the head's vertical, as the stick (right positive) has stood for `seconds`; the head itself stays where
    /// it is.
    pub(super) fn turn(&mut self, head: &Pose, stick_x: f64, seconds: f64) {
        let right_rad = match self.turn {
            Turn::Snap => self.snap_rad(stick_x),
            Turn::Smooth if stick_x.abs() >= DEAD_ZONE => {
                let seconds = seconds.clamp(0.0, LONGEST_STEP_S);
                stick_x.clamp(-1.0, 1.0) * self.turn_rad_per_s * seconds
            }
            Turn::Smooth => 0.0,
        };
        // Nothing that rounds while the stick rests.
        if right_rad != 0.0 {
            self.turn_right(head, right_rad);
        }
    }

    /// One snap to the right or left if the stick has just been pushed, else 0.
    fn snap_rad(&mut self, stick_x: f64) -> f64 {
        if stick_x.abs() < SNAP_AGAIN_UNDER {
            self.turn_is_due = true;
        }
        if stick_x.is_nan() || stick_x.abs() < SNAP_AT || !self.turn_is_due {
            return 0.0;
        }
        self.turn_is_due = false;
        stick_x.signum() * self.snap_turn_rad
    }

    fn turn_right(&mut self, head: &Pose, right_rad: f64) {
        // A positive angle about +Y turns left.
        let turn = DQuat::from_rotation_y(-right_rad);
        let from_head = self.world_from_space.position - head.position;
        self.world_from_space = Pose::new(
            head.position + turn * from_head,
            (turn * self.world_from_space.orientation).normalize(),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at_start() -> Locomotion {
        let settings = OpenXrSettings {
            move_m_per_s: 2.0,
            ..OpenXrSettings::default()
        };
        Locomotion::new(Pose::IDENTITY, &settings)
    }

    #[test]
    fn walks_where_the_head_looks_and_keeps_the_height() {
        // Looking left (+90 degrees about +Y is -X) and down: forward is -X all the same.
        let gaze = DQuat::from_rotation_y(90_f64.to_radians())
            * DQuat::from_rotation_x(-40_f64.to_radians());
        let head = Pose::new(DVec3::new(0.0, 1.6, 0.0), gaze);
        let mut locomotion = at_start();
        locomotion.walk(&head, DVec2::new(0.0, 1.0), 0.05);
        let moved = locomotion.world_from_space().position;
        assert!(
            (moved - DVec3::new(-0.1, 0.0, 0.0)).length() < 1e-12,
            "{moved}"
        );
        locomotion.walk(&head, DVec2::new(0.1, 0.1), 0.05);
        assert_eq!(locomotion.world_from_space().position, moved, "dead zone");
        locomotion.walk(&head, DVec2::new(0.0, 1.0), 60.0);
        let moved = locomotion.world_from_space().position;
        assert!((moved.x + 0.3).abs() < 1e-12, "a pause is no leap: {moved}");
        locomotion.walk(&head, DVec2::new(f64::NAN, 1.0), 0.05);
        assert_eq!(locomotion.world_from_space().position, moved);
    }

    #[test]
    fn a_push_turns_once_about_the_head() {
        let in_space = Pose::new(DVec3::new(0.4, 1.6, -0.3), DQuat::IDENTITY);
        let mut locomotion = at_start();
        let head = |l: &Locomotion| l.world_from_space().then(&in_space);
        let mut heading_after = |stick_x: f64| {
            let before = head(&locomotion);
            locomotion.turn(&before, stick_x, 0.01);
            let after = head(&locomotion);
            assert!((after.position - before.position).length() < 1e-12);
            after.heading_rad().to_degrees()
        };
        // Right is negative. Held, and not yet back, it turns no further.
        for (stick_x, heading_deg) in [
            (0.9, -30.0),
            (1.0, -30.0),
            (0.5, -30.0),
            (0.8, -30.0),
            (f64::NAN, -30.0),
            (0.0, -30.0),
            (-0.9, 0.0),
        ] {
            let found = heading_after(stick_x);
            assert!((found - heading_deg).abs() < 1e-9, "{stick_x}: {found}");
        }
    }

    #[test]
    fn a_smooth_turn_goes_on_about_the_head_while_the_stick_is_pushed() {
        let in_space = Pose::new(DVec3::new(0.4, 1.6, -0.3), DQuat::IDENTITY);
        let mut locomotion = Locomotion {
            turn: Turn::Smooth,
            ..at_start()
        };
        let place = |l: &Locomotion| l.world_from_space().then(&in_space);
        // 90 degrees a second at full deflection: ten steps of 0.02 s turn by 18 degrees, half of it half as far.
        for (stick_x, heading_deg) in [(1.0, -18.0), (-0.5, -9.0), (0.1, -9.0), (f64::NAN, -9.0)] {
            for _ in 0..10 {
                let head = place(&locomotion);
                locomotion.turn(&head, stick_x, 0.02);
            }
            let head = place(&locomotion);
            let found = head.heading_rad().to_degrees();
            assert!((found - heading_deg).abs() < 1e-9, "{stick_x}: {found}");
            assert!((head.position - in_space.position).length() < 1e-12);
        }
        let head = place(&locomotion);
        locomotion.turn(&head, -1.0, 60.0);
        // A pause is no whirl: a tenth of a second.
        assert!(place(&locomotion).heading_rad().abs() < 1e-9);
    }
}
