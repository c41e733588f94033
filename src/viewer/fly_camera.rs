//! A head that is moved by hand: mouse look, keys for the six directions.

use glam::{DQuat, DVec3};
use std::f64::consts::FRAC_PI_2;

use crate::xr::Pose;

/// Speed without run or slow keys, metres per second: a brisk walk. Scenes larger than a room scale it.
pub const WALK_M_PER_S: f64 = 1.5;
/// How many times faster the run key is, and how many times slower the slow key.
pub const RUN_FACTOR: f64 = 4.0;
/// Keys make the head at most so many times faster than the scene's size does, and so many times slower: in a room, from
/// 0.01 to 100 m/s.
const SPEED_RANGE: [f64; 2] = [1.0 / 128.0, 64.0];
/// Turn of the head per point of mouse travel, radians: 800 points turn it by 180 degrees.
pub const LOOK_RAD_PER_POINT: f64 = std::f64::consts::PI / 800.0;
/// The pitch stays this far from straight up and down, radians: there, a heading means nothing.
const POLE_RAD: f64 = 1e-3;

/// Keys and stick, as they are held: each component from -1 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Thrust {
    /// Right.
    pub right: f64,
    /// Up, along gravity.
    pub up: f64,
    /// Ahead, along the gaze.
    pub ahead: f64,
    /// The run key is held.
    pub runs: bool,
    /// The slow key is held.
    pub is_slow: bool,
}

impl Thrust {
    /// Whether anything is pressed.
    pub fn is_some(&self) -> bool {
        self.right != 0.0 || self.up != 0.0 || self.ahead != 0.0
    }
}

/// Place and gaze, with roll kept out: gravity stays vertical.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlyCamera {
    position_in_world: DVec3,
    heading_rad: f64,
    pitch_rad: f64,
    /// A pose that was set from outside may be rolled; it is kept until the head turns.
    exact: Option<DQuat>,
    /// Speed factor by the scene's size, as keys have changed it.
    pub speed: f64,
    /// The same before they did.
    first_speed: f64,
}

impl FlyCamera {
    /// Stands at `pose`. `scene_size_m`, the longest edge of the scene's box: crossing it takes about as long as crossing
    /// a room of 5 m.
    pub fn new(pose: Pose, scene_size_m: f64) -> Self {
        let speed = if scene_size_m.is_finite() && scene_size_m > 0.0 {
            scene_size_m / 5.0
        } else {
            1.0
        };
        let mut camera = Self {
            position_in_world: DVec3::ZERO,
            heading_rad: 0.0,
            pitch_rad: 0.0,
            exact: None,
            speed,
            first_speed: speed,
        };
        camera.set_pose(pose);
        camera
    }

    /// Moves to a pose as it is.
    pub fn set_pose(&mut self, pose: Pose) {
        let ahead = pose.orientation * DVec3::NEG_Z;
        self.position_in_world = pose.position;
        self.heading_rad = pose.heading_rad();
        self.pitch_rad = ahead.y.clamp(-1.0, 1.0).asin();
        self.exact = Some(pose.orientation);
    }

    /// World from head.
    pub fn pose(&self) -> Pose {
        Pose::new(self.position_in_world, self.orientation())
    }

    fn orientation(&self) -> DQuat {
        self.exact.unwrap_or_else(|| {
            DQuat::from_rotation_y(self.heading_rad) * DQuat::from_rotation_x(self.pitch_rad)
        })
    }

    /// Turns by mouse travel in points: right turns right, up looks up.
    pub fn look(&mut self, travel_points: [f64; 2]) {
        if travel_points == [0.0; 2] {
            return;
        }
        self.exact = None;
        self.heading_rad -= LOOK_RAD_PER_POINT * travel_points[0];
        let limit = FRAC_PI_2 - POLE_RAD;
        self.pitch_rad =
            (self.pitch_rad - LOOK_RAD_PER_POINT * travel_points[1]).clamp(-limit, limit);
    }

    /// How fast it moves by these keys, metres per second.
    pub fn speed_m_per_s(&self, thrust: &Thrust) -> f64 {
        let factor = match (thrust.runs, thrust.is_slow) {
            (true, false) => RUN_FACTOR,
            (false, true) => 1.0 / RUN_FACTOR,
            _ => 1.0,
        };
        WALK_M_PER_S * self.speed * factor
    }

    /// Walks `factor` times as fast from now on, within what is of use.
    pub fn change_speed(&mut self, factor: f64) {
        let [least, most] = SPEED_RANGE.map(|times| times * self.first_speed);
        self.speed = (self.speed * factor).clamp(least, most);
    }

    /// Moves for `seconds`.
    pub fn advance(&mut self, thrust: Thrust, seconds: f64) {
        let direction = self.orientation() * DVec3::new(thrust.right, 0.0, -thrust.ahead)
            + DVec3::Y * thrust.up;
        // Diagonals are no faster.
        let direction = direction / direction.length().max(1.0);
        self.position_in_world += direction * (self.speed_m_per_s(&thrust) * seconds);
    }

    /// Moves along the gaze: a notch of the wheel is a quarter of a metre at walking speed.
    pub fn dolly(&mut self, notches: f64) {
        let ahead = self.orientation() * DVec3::NEG_Z;
        self.position_in_world += ahead * (0.25 * self.speed * notches);
    }

    /// Goes around the point `distance_m` ahead, by mouse travel in points: the picture follows the pointer.
    pub fn orbit(&mut self, travel_points: [f64; 2], distance_m: f64) {
        let center = self.position_in_world + self.ahead() * distance_m;
        self.look(travel_points);
        self.position_in_world = center - self.ahead() * distance_m;
    }

    /// Moves across the gaze, by mouse travel in points, so that what is `distance_m` away stays about under the pointer.
    pub fn pan(&mut self, travel_points: [f64; 2], distance_m: f64) {
        let across = DVec3::new(-travel_points[0], travel_points[1], 0.0);
        self.position_in_world += self.orientation() * across * (LOOK_RAD_PER_POINT * distance_m);
    }

    /// Moves towards the point `distance_m` ahead, or away from it, by mouse travel in points: 200 upwards halve the
    /// distance. Returns what is left of it.
    pub fn approach(&mut self, travel_points: f64, distance_m: f64) -> f64 {
        let left_m = distance_m * (travel_points / 200.0).exp2();
        self.position_in_world += self.ahead() * (distance_m - left_m);
        left_m
    }

    fn ahead(&self) -> DVec3 {
        self.orientation() * DVec3::NEG_Z
    }

    /// Looks at a sphere from where the gaze comes from, so that it fills half of a view of `half_angle_rad`.
    pub fn focus(&mut self, center_in_world: DVec3, radius_m: f64, half_angle_rad: f64) {
        let ahead = self.orientation() * DVec3::NEG_Z;
        let distance_m = radius_m.max(1e-6) / (0.5 * half_angle_rad).sin().max(1e-3);
        self.position_in_world = center_in_world - ahead * distance_m;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at_origin() -> FlyCamera {
        FlyCamera::new(Pose::IDENTITY, 5.0)
    }

    #[test]
    fn keys_move_along_the_gaze_and_gravity() {
        let mut camera = at_origin();
        camera.look([-400.0, 0.0]);
        camera.advance(
            Thrust {
                ahead: 1.0,
                ..Thrust::default()
            },
            2.0,
        );
        // 400 points to the left are 90 degrees: ahead is -X.
        let expected = DVec3::new(-2.0 * WALK_M_PER_S, 0.0, 0.0);
        assert!((camera.pose().position - expected).length() < 1e-12);
        camera.advance(
            Thrust {
                up: 1.0,
                runs: true,
                ..Thrust::default()
            },
            1.0,
        );
        assert!((camera.pose().position.y - RUN_FACTOR * WALK_M_PER_S).abs() < 1e-12);
    }

    #[test]
    fn diagonals_are_no_faster_and_the_gaze_stops_before_the_pole() {
        let mut camera = at_origin();
        camera.advance(
            Thrust {
                ahead: 1.0,
                right: 1.0,
                ..Thrust::default()
            },
            1.0,
        );
        assert!((camera.pose().position.length() - WALK_M_PER_S).abs() < 1e-12);
        camera.look([0.0, -1e6]);
        let ahead = camera.pose().orientation * DVec3::NEG_Z;
        assert!(ahead.y > 0.999 && ahead.y < 1.0);
        assert!(camera.pose().heading_rad().abs() < 1e-9);
    }

    #[test]
    fn keys_leave_the_speed_within_what_is_of_use() {
        for size_m in [5.0, 1e5] {
            let mut camera = FlyCamera::new(Pose::IDENTITY, size_m);
            let first = camera.speed;
            for (factor, last) in [(2.0, 64.0), (0.5, 1.0 / 128.0)] {
                for _ in 0..2000 {
                    camera.change_speed(factor);
                }
                assert_eq!(camera.speed, last * first);
            }
        }
    }

    #[test]
    fn a_rolled_pose_stays_until_the_head_turns() {
        let rolled = Pose::new(DVec3::X, DQuat::from_rotation_z(0.5));
        let mut camera = FlyCamera::new(rolled, 1.0);
        assert_eq!(camera.pose(), rolled);
        camera.look([1.0, 0.0]);
        let up = camera.pose().orientation * DVec3::X;
        assert!(up.y.abs() < 1e-12, "the roll is gone");
    }

    #[test]
    fn the_point_that_is_orbited_and_approached_stays_ahead() {
        let mut camera = at_origin();
        let center = DVec3::new(0.0, 0.0, -3.0);
        camera.orbit([120.0, -45.0], 3.0);
        let pose = camera.pose();
        assert!(((pose.position - center).length() - 3.0).abs() < 1e-12);
        assert!(pose.position.length() > 1.0, "it went around");
        let ahead = pose.orientation * DVec3::NEG_Z;
        assert!((pose.position + 3.0 * ahead - center).length() < 1e-12);
        let left_m = camera.approach(-200.0, 3.0);
        assert!((left_m - 1.5).abs() < 1e-12);
        assert!((camera.pose().position + 1.5 * ahead - center).length() < 1e-12);
        // Across the gaze alone.
        let before = camera.pose().position;
        camera.pan([10.0, 20.0], 1.5);
        let way = camera.pose().position - before;
        assert!(way.length() > 0.05 && way.dot(ahead).abs() < 1e-12);
    }

    #[test]
    fn focus_sees_the_sphere_under_half_the_opening() {
        let mut camera = at_origin();
        camera.look([123.0, 45.0]);
        let (center, radius_m) = (DVec3::new(3.0, 1.0, -2.0), 0.7);
        camera.focus(center, radius_m, 0.8);
        let pose = camera.pose();
        let to_center = center - pose.position;
        assert!((pose.orientation * DVec3::NEG_Z).dot(to_center.normalize()) > 1.0 - 1e-12);
        assert!(((radius_m / to_center.length()).asin() - 0.4).abs() < 1e-12);
    }
}
