//! A gamepad, where there is one and the program was built with the feature `gamepad`.
//!
//! The feature is off by default: the library that reads pads needs the headers of `libudev` on Linux, which a fresh
//! machine does not have.

use super::fly_camera::Thrust;

/// Turn of the head at full stick, points of mouse travel per second: half a turn.
#[cfg(any(feature = "gamepad", test))]
const LOOK_POINTS_PER_S: f64 = 800.0;
/// Sticks rest a little off their middle.
#[cfg(any(feature = "gamepad", test))]
const DEAD_ZONE: f64 = 0.12;

/// Sticks as a movement and a turn per second: the left stick walks, the right one looks, triggers go up and down.
#[cfg(any(feature = "gamepad", test))]
fn movement(left: [f64; 2], right: [f64; 2], triggers: [f64; 2]) -> (Thrust, [f64; 2]) {
    let live = |value: f64| {
        let beyond = (value.abs() - DEAD_ZONE).max(0.0) / (1.0 - DEAD_ZONE);
        beyond.min(1.0) * value.signum()
    };
    let thrust = Thrust {
        right: live(left[0]),
        ahead: live(left[1]),
        up: live(triggers[1]) - live(triggers[0]),
        ..Thrust::default()
    };
    // A stick pushed up looks up; mouse travel counts downwards.
    let look = [
        LOOK_POINTS_PER_S * live(right[0]),
        -LOOK_POINTS_PER_S * live(right[1]),
    ];
    (thrust, look)
}

/// All pads of the machine.
#[cfg(feature = "gamepad")]
pub struct Gamepad(Option<gilrs::Gilrs>);

#[cfg(feature = "gamepad")]
impl Gamepad {
    /// Begins to listen; says why if that is not possible.
    pub fn open() -> Self {
        let pads = gilrs::Gilrs::new();
        let pads = pads.inspect_err(|error| log::warn!("gamepads cannot be read: {error}"));
        Self(pads.ok())
    }

    /// What the first pad asks for, if one is connected: movement, and mouse travel per second.
    pub fn poll(&mut self) -> Option<(Thrust, [f64; 2])> {
        use gilrs::{Axis, Button};
        let pads = self.0.as_mut()?;
        while pads.next_event().is_some() {}
        let (_, pad) = pads.gamepads().next()?;
        let axis = |axis| f64::from(pad.value(axis));
        let trigger = |button| {
            pad.button_data(button)
                .map_or(0.0, |data| f64::from(data.value()))
        };
        let left = [axis(Axis::LeftStickX), axis(Axis::LeftStickY)];
        let right = [axis(Axis::RightStickX), axis(Axis::RightStickY)];
        let triggers = [Button::LeftTrigger2, Button::RightTrigger2].map(trigger);
        Some(movement(left, right, triggers))
    }
}

/// No pads: the feature is off.
#[cfg(not(feature = "gamepad"))]
pub struct Gamepad;

#[cfg(not(feature = "gamepad"))]
impl Gamepad {
    /// Nothing to open.
    pub fn open() -> Self {
        Self
    }

    /// Nothing.
    pub fn poll(&mut self) -> Option<(Thrust, [f64; 2])> {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sticks_have_a_dead_zone_and_full_travel() {
        let (rest, look) = movement([0.1, -0.1], [0.05, 0.0], [0.0, 0.1]);
        assert!(!rest.is_some());
        assert_eq!(look, [0.0, 0.0]);
        let (full, look) = movement([-1.0, 1.0], [1.0, 1.0], [0.0, 1.0]);
        assert_eq!((full.right, full.ahead, full.up), (-1.0, 1.0, 1.0));
        assert_eq!(look, [LOOK_POINTS_PER_S, -LOOK_POINTS_PER_S]);
    }
}
