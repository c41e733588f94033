//! `builtin:sphere`: a closed diffuse sphere seen from inside, with a point light at its centre.
//!
//! An integrating sphere: the light gives the irradiance `E = I / R^2` everywhere, every reflection adds the share
//! `albedo` of the one before, evenly, so the outgoing radiance is `L = albedo / pi * E / (1 - albedo)` at every point
//! and in every direction. With the values below that is exactly 1 ([`RADIANCE`]); direct light alone gives 1 / 2.
//!
//! The mesh is an icosphere of 5120 triangles with smooth normals, whose vertices stand slightly outside the radius so
//! that its area is that of the sphere, 4 pi R^2: the mean radiance then follows from the balance of power,
//! `(1 - albedo) * mean E * area = 4 pi I`, whatever the facets do.

/// Radius.
pub const RADIUS_M: f64 = 1.0;
/// Reflectance in every channel.
pub const ALBEDO: f32 = 0.5;
/// Intensity of the light at the centre in every channel, W/sr.
pub const LIGHT_INTENSITY: f32 = std::f32::consts::PI;
/// Radiance of the wall in closed form, `albedo / pi * I / R^2 / (1 - albedo)`.
pub const RADIANCE: f64 = 1.0;
/// Place of the camera: off the centre, and no ray that it sends along -Z meets the light.
pub const CAMERA_POSITION: [f64; 3] = [0.25, 0.125, 0.375];
