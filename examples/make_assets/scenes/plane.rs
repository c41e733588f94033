//! The geometry of `builtin:plane`.

use glam::{DAffine3, DVec3};
use stereolux::scene::builtin::plane::{
    ALBEDO, DISTANCE_M, HALF_EDGE_M, LIGHT_INTENSITY, LIGHT_POSITION,
};
use stereolux::scene::{LightKind, Material, PunctualLight, SceneError};

use super::glb_writer::{GlbWriter, Payload};
use super::shapes::Shape;

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
    let mesh = glb.mesh("plane", &[plane.plain_part(material)])?;
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
