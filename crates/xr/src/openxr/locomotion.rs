//! Moving and turning through the scene: where the runtime's space lies in the world.

use glam::{DQuat, DVec2, DVec3};

use crate::view::Pose;

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
    snap_turn_rad: f64,
    turn_is_due: bool,
}

impl Locomotion {
    /// Starts with the space at `world_from_space`. Speed at full deflection, m/s; one snap turn, radians.
    pub(super) fn new(world_from_space: Pose, speed_m_per_s: f64, snap_turn_rad: f64) -> Self {
        Self {
            world_from_space,
            speed_m_per_s,
            snap_turn_rad,
            turn_is_due: true,
        }
    }

    pub(super) fn world_from_space(&self) -> Pose {
        self.world_from_space
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

    /// Turns about the head's vertical by one snap if the stick (right positive) has just been pushed; true if so. The
    /// head itself stays where it is.
    pub(super) fn snap_turn(&mut self, head: &Pose, stick_x: f64) -> bool {
        if stick_x.abs() < SNAP_AGAIN_UNDER {
            self.turn_is_due = true;
        }
        if stick_x.is_nan() || stick_x.abs() < SNAP_AT || !self.turn_is_due {
            return false;
        }
        self.turn_is_due = false;
        // A positive angle about +Y turns left.
        let turn = DQuat::from_rotation_y(-stick_x.signum() * self.snap_turn_rad);
        let from_head = self.world_from_space.position - head.position;
        self.world_from_space = Pose::new(
            head.position + turn * from_head,
            (turn * self.world_from_space.orientation).normalize(),
        );
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at_start() -> Locomotion {
        Locomotion::new(Pose::IDENTITY, 2.0, 30_f64.to_radians())
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
        let before = head(&locomotion);
        assert!(locomotion.snap_turn(&before, 0.9));
        let after = head(&locomotion);
        assert!((after.position - before.position).length() < 1e-12);
        // Right is negative.
        assert!((after.heading_rad() + 30_f64.to_radians()).abs() < 1e-12);
        assert!(!locomotion.snap_turn(&after, 1.0), "held");
        assert!(!locomotion.snap_turn(&after, 0.5), "not back yet");
        assert!(!locomotion.snap_turn(&after, 0.8), "not back yet");
        assert!(!locomotion.snap_turn(&after, 0.0));
        assert!(locomotion.snap_turn(&after, -0.9));
        assert!(head(&locomotion).heading_rad().abs() < 1e-12);
    }
}
