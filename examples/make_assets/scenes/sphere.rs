//! The geometry of `builtin:sphere`.

use glam::{DAffine3, DVec3};
use stereolux::scene::builtin::sphere::{ALBEDO, CAMERA_POSITION, LIGHT_INTENSITY, RADIUS_M};
use stereolux::scene::{LightKind, Material, PunctualLight, SceneError};

use super::glb_writer::{GlbWriter, Payload};
use super::shapes::Shape;

const LEVELS: u32 = 4;

/// The binary glTF of the sphere.
pub fn write() -> Result<Vec<u8>, SceneError> {
    let mut glb = GlbWriter::new();
    let material = glb.material(&Material::lambert("wall", [ALBEDO; 3]));
    let area = 4.0 * std::f64::consts::PI * RADIUS_M * RADIUS_M;
    let inscribed = Shape::icosphere(RADIUS_M, LEVELS).area_m2();
    let wall = Shape::icosphere(RADIUS_M * (area / inscribed).sqrt(), LEVELS).inside_out();
    let mesh = glb.mesh("wall", &[wall.plain_part(material)])?;
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
