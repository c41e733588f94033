//! `builtin:sphere`: a closed diffuse sphere seen from inside, with a point light at its centre.
//!
//! An integrating sphere: the light gives the irradiance `E = I / R^2` everywhere, every reflection adds the share
//! `albedo` of the one before, evenly, so the outgoing radiance is `L = albedo / pi * E / (1 - albedo)` at every point
//! and in every direction. With the values below that is exactly 1 ([`RADIANCE`]); direct light alone gives 1 / 2.
//!
//! The mesh is an icosphere of 5120 triangles with smooth normals, whose vertices stand slightly outside the radius so
//! that its area is that of the sphere, 4 pi R^2: the mean radiance then follows from the balance of power,
//! `(1 - albedo) * mean E * area = 4 pi I`, whatever the facets do.

use glam::{DAffine3, DVec3};
use stereolux_scene::{LightKind, Material, PunctualLight, SceneError};

use super::glb_writer::{GlbWriter, Payload};
use super::shapes::Shape;

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

const LEVELS: u32 = 4;

/// The binary glTF of the sphere.
pub fn write() -> Result<Vec<u8>, SceneError> {
    let mut glb = GlbWriter::new();
    let material = glb.material(&Material::lambert("wall", [ALBEDO; 3]));
    let area = 4.0 * std::f64::consts::PI * RADIUS_M * RADIUS_M;
    let inscribed = Shape::icosphere(RADIUS_M, LEVELS).area_m2();
    let wall = Shape::icosphere(RADIUS_M * (area / inscribed).sqrt(), LEVELS).inside_out();
    let mesh = glb.mesh("wall", &[wall.plain_part(material)]);
    glb.node("wall", DAffine3::IDENTITY, Payload::Mesh(mesh));
    let light = glb.light(&PunctualLight {
        name: "lamp".to_owned(),
        kind: LightKind::Point,
        intensity: [LIGHT_INTENSITY; 3],
    });
    glb.node("lamp", DAffine3::IDENTITY, Payload::Light(light));
    let camera = glb.camera("viewpoint", std::f32::consts::FRAC_PI_2);
    glb.node(
        "viewpoint",
        DAffine3::from_translation(DVec3::from_array(CAMERA_POSITION)),
        Payload::Camera(camera),
    );
    glb.finish("sphere")
}
