//! `builtin:cornell`: the Cornell box with its published measurements.
//!
//! Geometry and camera: Cornell University Program of Computer Graphics, *The Cornell Box: physical data* (the box of
//! 1998, after Goral, Torrance, Greenberg and Battaile, *Modeling the interaction of light between diffuse surfaces*,
//! SIGGRAPH 1984), in millimetres. That frame looks along +Z with +X to the left; half a turn about +Y brings it to
//! glTF's, so (x, y, z) mm stands at (-x, y, -z) / 1000 m. The red wall is on the left of the picture.
//!
//! Colours: the published spectra reduced to linear sRGB as renderers commonly use them. All surfaces are ideal
//! Lambert (KHR_materials_specular, factor 0). The lamp hangs 0.8 mm under the ceiling, so that no surfaces coincide.

/// Reflectance of floor, ceiling, back wall and both blocks, linear RGB.
pub const WHITE: [f32; 3] = [0.725, 0.71, 0.68];
/// Reflectance of the left wall.
pub const RED: [f32; 3] = [0.63, 0.065, 0.05];
/// Reflectance of the right wall.
pub const GREEN: [f32; 3] = [0.14, 0.45, 0.091];
/// Reflectance of the lamp.
pub const LAMP: [f32; 3] = [0.78, 0.78, 0.78];
/// Radiance of the lamp, W sr^-1 m^-2.
pub const LAMP_RADIANCE: [f32; 3] = [17.0, 12.0, 4.0];
/// Vertical opening of the published camera: 25 mm of film behind 35 mm of focal length, 2 atan(12.5 / 35).
pub const CAMERA_YFOV_RAD: f32 = 0.686_047_9;
