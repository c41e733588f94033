//! `builtin:plane`: one Lambert plane that faces the viewer, lit by a point light.
//!
//! The plane is z = -[`DISTANCE_M`], the camera stands at the origin and looks along -Z, so depth is the same over the
//! whole picture. In closed form:
//! - outgoing radiance: `L(p) = albedo / pi * I * h / |p - light|^3`, with h the light's distance from the plane
//!   ([`radiance_at`]);
//! - stereo disparity for an eye separation b and equal FOVs: `b / DISTANCE_M` in tangents, so
//!   `W * b / (DISTANCE_M * (tan right - tan left))` pixels on a picture W pixels wide. A left pixel column i shows up
//!   in the right picture moved left by this much; columns of the right picture from which it moves in from outside are
//!   the ones that cannot be reused.

use glam::{DAffine3, DVec3};
use stereolux_scene::{LightKind, Material, PunctualLight, SceneError};

use super::glb_writer::{GlbWriter, Payload};
use super::shapes::Shape;

/// Distance of the plane from the camera, along -Z.
pub const DISTANCE_M: f64 = 2.0;
/// Half the edge of the square plane: five times what +-45 degrees see.
pub const HALF_EDGE_M: f64 = 10.0;
/// Reflectance of the plane in every channel.
pub const ALBEDO: f32 = 0.5;
/// Place of the point light, on the camera's side.
pub const LIGHT_POSITION: [f64; 3] = [0.0, 0.75, -0.5];
/// Intensity of the point light in every channel, W/sr.
pub const LIGHT_INTENSITY: f32 = 10.0;

/// Radiance, the same in every channel, that leaves the plane at (x, y) towards the camera's side.
pub fn radiance_at(x: f64, y: f64) -> f64 {
    let light = DVec3::from_array(LIGHT_POSITION);
    let point = DVec3::new(x, y, -DISTANCE_M);
    let height = light.z + DISTANCE_M;
    f64::from(ALBEDO) / std::f64::consts::PI * f64::from(LIGHT_INTENSITY) * height
        / light.distance(point).powi(3)
}

/// The binary glTF of the plane.
pub fn write() -> Result<Vec<u8>, SceneError> {
    let mut glb = GlbWriter::new();
    let material = glb.material(&Material::lambert("plane", [ALBEDO; 3]));
    let corner = DVec3::new(-HALF_EDGE_M, -HALF_EDGE_M, -DISTANCE_M);
    let plane = Shape::quad(
        corner,
        DVec3::X * 2.0 * HALF_EDGE_M,
        DVec3::Y * 2.0 * HALF_EDGE_M,
    );
    let mesh = glb.mesh("plane", &[plane.plain_part(material)]);
    glb.node("plane", DAffine3::IDENTITY, Payload::Mesh(mesh));
    let light = glb.light(&PunctualLight {
        name: "lamp".to_owned(),
        kind: LightKind::Point,
        intensity: [LIGHT_INTENSITY; 3],
    });
    glb.node(
        "lamp",
        DAffine3::from_translation(DVec3::from_array(LIGHT_POSITION)),
        Payload::Light(light),
    );
    let camera = glb.camera("viewpoint", std::f32::consts::FRAC_PI_2);
    glb.node("viewpoint", DAffine3::IDENTITY, Payload::Camera(camera));
    glb.finish("plane")
}
