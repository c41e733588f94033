//! `builtin:caustic`: a glass ball over a diffuse floor, lit from above by a square lamp.
//!
//! The ball focuses the lamp into a bright spot on the floor. It is a polished sphere of [`IOR`] 1.5, whose paraxial
//! focus lies n R / (2 (n - 1)) = 1.5 R from its centre; the floor is [`FLOOR_TO_CENTRE`] R below it, where the caustic
//! is sharp but has a width. The lamp is large enough that a path from the floor through the glass finds it by chance,
//! so the path tracer converges to the same picture.

/// Radius of the ball.
pub const RADIUS_M: f64 = 0.25;
/// Distance of its centre from the floor, in radii.
pub const FLOOR_TO_CENTRE: f64 = 1.4;
/// Index of refraction.
pub const IOR: f32 = 1.5;
/// Half the edge of the floor, metres.
pub const HALF_FLOOR_M: f64 = 1.0;
/// Edge of the lamp, metres.
pub const LAMP_EDGE_M: f64 = 0.5;
/// Height of the lamp over the floor, metres.
pub const LAMP_HEIGHT_M: f64 = 2.0;
/// Radiance of the lamp.
pub const LAMP_RADIANCE: f32 = 12.0;
