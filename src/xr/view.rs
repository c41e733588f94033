//! Poses, fields of view and the projection of one eye, in f64.
//!
//! An eye looks along -Z of its own space with +X to its right and +Y up. A view ray's tangents are
//! linear in pixel position: `tan(angle_left)` at x = 0 to `tan(angle_right)` at x = width,
//! `tan(angle_up)` at y = 0 (the top) to `tan(angle_down)` at y = height. Nothing assumes that a field of
//! view is symmetric or that the eyes are parallel. These functions are the f64 twin of the shaders'
//! projection and the judge of every reprojected pixel.

use super::ArgumentError;
use super::validation;
use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3, DVec4};
use std::str::FromStr;

/// Points nearer than this to the eye's plane, or behind it, are not visible; metres. Small enough for
/// scenes a millimetre across, large enough that tangents stay finite in f32.
pub const NEAR_M: f64 = 1e-6;

/// A rigid pose: the frame that it places, seen from the frame that it is placed in.
#[derive(Clone, Copy, Debug, PartialEq)]
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

impl FromStr for Pose {
    type Err = ArgumentError;

    /// Reads `x y z qx qy qz qw` (metres, quaternion within 1e-3 of unit length).
    fn from_str(text: &str) -> Result<Self, ArgumentError> {
        let v = numbers::<7>(text, "a pose is \"x y z qx qy qz qw\"")?;
        let orientation = validation::unit_quaternion(v[3], v[4], v[5], v[6])
            .map_err(|what| ArgumentError(format!("pose {text:?}: {what}")))?;
        Ok(Self::new(DVec3::new(v[0], v[1], v[2]), orientation))
    }
}

/// Exactly `N` finite numbers, separated by spaces or commas.
fn numbers<const N: usize>(text: &str, shape: &str) -> Result<[f64; N], ArgumentError> {
    let mut values = [0.0; N];
    let mut count = 0;
    for word in text
        .split(|c: char| c == ',' || c.is_whitespace())
        .filter(|w| !w.is_empty())
    {
        let value = word.parse::<f64>().ok().filter(|v| v.is_finite());
        let Some(value) = value else {
            return Err(ArgumentError(format!(
                "{word:?} is not a finite number; {shape}"
            )));
        };
        if let Some(slot) = values.get_mut(count) {
            *slot = value;
        }
        count += 1;
    }
    if count == N {
        Ok(values)
    } else {
        Err(ArgumentError(format!(
            "{text:?} holds {count} numbers, not {N}; {shape}"
        )))
    }
}

/// Four angles of a view frustum from the eye's -Z axis, radians, signed as OpenXR signs them: left and
/// down are negative for an eye that sees straight ahead (XrFovf).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fov {
    /// Left edge.
    pub angle_left: f64,
    /// Right edge, greater than left.
    pub angle_right: f64,
    /// Top edge.
    pub angle_up: f64,
    /// Bottom edge, less than up.
    pub angle_down: f64,
}

impl Fov {
    /// From degrees. Not checked; see [`validation::check_fov`].
    #[must_use]
    pub fn from_degrees(left: f64, right: f64, up: f64, down: f64) -> Self {
        Self {
            angle_left: left.to_radians(),
            angle_right: right.to_radians(),
            angle_up: up.to_radians(),
            angle_down: down.to_radians(),
        }
    }

    /// The tangents of the four angles.
    #[must_use]
    pub fn tangents(&self) -> Tangents {
        Tangents {
            left: self.angle_left.tan(),
            right: self.angle_right.tan(),
            up: self.angle_up.tan(),
            down: self.angle_down.tan(),
        }
    }
}

impl FromStr for Fov {
    type Err = ArgumentError;

    /// Reads `left right up down` in degrees, signed as OpenXR signs them, and checks them.
    fn from_str(text: &str) -> Result<Self, ArgumentError> {
        let v = numbers::<4>(
            text,
            "a field of view is \"left right up down\" in degrees, left and down negative",
        )?;
        let fov = Self::from_degrees(v[0], v[1], v[2], v[3]);
        validation::check_fov(&fov)
            .map_err(|fault| ArgumentError(format!("field of view {text:?}: {fault}")))?;
        Ok(fov)
    }
}

/// Tangents of a [`Fov`]: where the image plane at distance 1 ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tangents {
    /// x of the left edge.
    pub left: f64,
    /// x of the right edge.
    pub right: f64,
    /// y of the top edge.
    pub up: f64,
    /// y of the bottom edge.
    pub down: f64,
}

/// A half-line in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayInWorld {
    /// The eye, metres.
    pub origin: DVec3,
    /// Unit length.
    pub direction: DVec3,
}

/// One eye: where it is, how it is turned, and what it sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// The eye, metres.
    pub position_in_world: DVec3,
    /// World from eye; unit quaternion.
    pub orientation: DQuat,
    /// What it sees.
    pub fov: Fov,
}

impl View {
    /// The point half-way between two eyes, metres: the origin of a frame's render space. It is taken from the views alone,
    /// so that a recording, which holds views and no head, replays bit for bit.
    #[must_use]
    pub fn midpoint_in_world([left, right]: &[Self; 2]) -> DVec3 {
        let left = left.position_in_world;
        left + 0.5 * (right.position_in_world - left)
    }

    /// World from eye: rotation and translation, no scale.
    #[must_use]
    pub fn world_from_eye(&self) -> DAffine3 {
        DAffine3 {
            matrix3: DMat3::from_quat(self.orientation),
            translation: self.position_in_world,
        }
    }

    /// Eye from world, by transposing the rotation and rotating the position back: exact where a general
    /// inverse would lose digits. Far from the world's origin prefer [`View::point_in_eye`], which
    /// subtracts before it rotates.
    #[must_use]
    pub fn eye_from_world(&self) -> DAffine3 {
        let matrix3 = DMat3::from_quat(self.orientation).transpose();
        DAffine3 {
            matrix3,
            translation: -(matrix3 * self.position_in_world),
        }
    }

    /// A world point seen from the eye, metres: R^T (h - e).
    #[must_use]
    pub fn point_in_eye(&self, point_in_world: DVec3) -> DVec3 {
        DMat3::from_quat(self.orientation).transpose() * (point_in_world - self.position_in_world)
    }

    /// Clip from eye in WebGPU's clip space (x right, y up, depth 1 at `near_m` falling to 0 at
    /// infinity), row-equivalent to [`View::pixel_from_point_in_world`].
    #[must_use]
    pub fn clip_from_eye(&self, near_m: f64) -> DMat4 {
        let t = self.fov.tangents();
        let (width, height) = (t.right - t.left, t.up - t.down);
        DMat4::from_cols(
            DVec4::new(2.0 / width, 0.0, 0.0, 0.0),
            DVec4::new(0.0, 2.0 / height, 0.0, 0.0),
            DVec4::new(
                (t.right + t.left) / width,
                (t.up + t.down) / height,
                0.0,
                -1.0,
            ),
            DVec4::new(0.0, 0.0, near_m, 0.0),
        )
    }

    /// The pixel position (from the top left, centres at .5) of a world point in an image of `width` x
    /// `height` pixels: equations (3) to (5) of the 2020 report, generalised to asymmetric fields of
    /// view. `None` if the point is behind the eye (z >= -[`NEAR_M`]), outside the half-open image, or
    /// not finite.
    #[must_use]
    pub fn pixel_from_point_in_world(
        &self,
        point_in_world: DVec3,
        width: u32,
        height: u32,
    ) -> Option<(f64, f64)> {
        let p = self.point_in_eye(point_in_world);
        let in_front = p.z < -NEAR_M;
        if !in_front {
            return None;
        }
        let t = self.fov.tangents();
        let (width, height) = (f64::from(width), f64::from(height));
        let x = (p.x / -p.z - t.left) / (t.right - t.left) * width;
        let y = (t.up - p.y / -p.z) / (t.up - t.down) * height;
        ((0.0..width).contains(&x) && (0.0..height).contains(&y)).then_some((x, y))
    }

    /// Direction through pixel position (`x`, `y`), eye space, scaled so that z = -1.
    #[must_use]
    pub fn direction_in_eye(&self, x: f64, y: f64, width: u32, height: u32) -> DVec3 {
        let t = self.fov.tangents();
        let (u, v) = (x / f64::from(width), y / f64::from(height));
        DVec3::new(
            t.left + u * (t.right - t.left),
            t.up + v * (t.down - t.up),
            -1.0,
        )
    }

    /// The ray through pixel position (`x`, `y`); a pixel's centre is (i + 0.5, j + 0.5).
    #[must_use]
    pub fn ray_through_pixel(&self, x: f64, y: f64, width: u32, height: u32) -> RayInWorld {
        let direction_in_eye = self.direction_in_eye(x, y, width, height);
        RayInWorld {
            origin: self.position_in_world,
            direction: (self.orientation * direction_in_eye).normalize(),
        }
    }
}
