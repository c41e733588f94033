//! Where something is and how it is turned.

use glam::{DAffine3, DQuat, DVec3};
use serde::Serialize;

/// A rigid pose: the frame that it places, seen from the frame that it is placed in.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Pose {
    /// Origin, metres.
    pub position: DVec3,
    /// Unit quaternion; rotates vectors of the placed frame into the outer one.
    pub orientation: DQuat,
}

impl Pose {
    /// At the origin, unrotated.
    pub const IDENTITY: Self = Self {
        position: DVec3::ZERO,
        orientation: DQuat::IDENTITY,
    };

    /// A pose from its parts; `orientation` must have unit length.
    #[must_use]
    pub fn new(position: DVec3, orientation: DQuat) -> Self {
        Self {
            position,
            orientation,
        }
    }

    /// `self` after `inner`: `a_from_c = a_from_b.then(b_from_c)`.
    #[must_use]
    pub fn then(&self, inner: &Self) -> Self {
        Self {
            position: self.position + self.orientation * inner.position,
            orientation: self.orientation * inner.orientation,
        }
    }

    /// As a matrix: the outer frame from the placed one.
    #[must_use]
    pub fn affine(&self) -> DAffine3 {
        DAffine3::from_rotation_translation(self.orientation, self.position)
    }

    /// Heading about +Y, radians in (-pi, pi]: 0 looks along -Z, positive turns left. A gaze straight up
    /// or down has no heading of its own; there the direction that the top of the head points to (down)
    /// or away from (up) stands in, which is the limit of tilting the head from the horizon.
    #[must_use]
    pub fn heading_rad(&self) -> f64 {
        let forward = self.orientation * DVec3::NEG_Z;
        // 1e-6: within 0.2 arc seconds of vertical the horizontal part is mostly rounding of the input.
        let level = if forward.x.hypot(forward.z) > 1e-6 {
            forward
        } else {
            (self.orientation * DVec3::Y) * -forward.y.signum()
        };
        (-level.x).atan2(-level.z)
    }
}
