//! `builtin:parade`: a room in which everything that can move does.
//!
//! A box and a lantern (an emitter) travel as rigid bodies, a tube bends by a skin of three joints, a ball takes another
//! shape by a morph target. The clip `parade` moves them all, `wave` bends the tube alone. Both end as they begin.

/// Length of the clip `parade`, seconds.
pub const LENGTH_S: f64 = 4.0;
/// Height of the tube, metres.
pub const TUBE_M: f64 = 1.2;
/// Radius of the ball, metres.
pub const BALL_M: f64 = 0.3;
/// Radiance of the lamp over the room.
pub const LAMP_RADIANCE: f32 = 8.0;
