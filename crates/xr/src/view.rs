//! Poses, fields of view and the projection of one eye, in f64.
//!
//! An eye looks along -Z of its own space with +X to its right and +Y up. A view ray's tangents are
//! linear in pixel position: `tan(angle_left)` at x = 0 to `tan(angle_right)` at x = width,
//! `tan(angle_up)` at y = 0 (the top) to `tan(angle_down)` at y = height. Nothing assumes that a field of
//! view is symmetric or that the eyes are parallel. These functions are the f64 twin of the shaders'
//! projection and the judge of every reprojected pixel.

pub use stereolux_base::pose::Pose;

use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3, DVec4};
use serde::Serialize;

/// Points nearer than this to the eye's plane, or behind it, are not visible; metres. Small enough for
/// scenes a millimetre across, large enough that tangents stay finite in f32.
pub const NEAR_M: f64 = 1e-6;

/// Four angles of a view frustum from the eye's -Z axis, radians, signed as OpenXR signs them: left and
/// down are negative for an eye that sees straight ahead (XrFovf).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Fov {
    /// Left edge.
    #[serde(rename = "left")]
    pub angle_left: f64,
    /// Right edge, greater than left.
    #[serde(rename = "right")]
    pub angle_right: f64,
    /// Top edge.
    #[serde(rename = "up")]
    pub angle_up: f64,
    /// Bottom edge, less than up.
    #[serde(rename = "down")]
    pub angle_down: f64,
}

impl Fov {
    /// From degrees. Not checked; `validation::check_fov` does that.
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
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct View {
    /// The eye, metres.
    #[serde(rename = "position")]
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

    /// The head between two eyes: half-way in place and in direction.
    #[must_use]
    pub fn head_in_world(views: &[Self; 2]) -> Pose {
        let [left, right] = views.map(|view| view.orientation);
        Pose::new(Self::midpoint_in_world(views), left.slerp(right, 0.5))
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
    /// view. `None` if the point is behind the eye (z >= -`NEAR_M`), outside the half-open image, or
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
