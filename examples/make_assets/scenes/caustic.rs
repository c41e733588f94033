//! The geometry of `builtin:caustic`.

use glam::{DAffine3, DQuat, DVec3};
use stereolux::scene::builtin::caustic::{
    FLOOR_TO_CENTRE, HALF_FLOOR_M, IOR, LAMP_EDGE_M, LAMP_HEIGHT_M, LAMP_RADIANCE, RADIUS_M,
};
use stereolux::scene::{Material, SceneError};

use super::glb_writer::{GlbWriter, Payload};
use super::shapes::Shape;

const LEVELS: u32 = 5;

/// The binary glTF of the scene.
pub fn write() -> Result<Vec<u8>, SceneError> {
    let mut glb = GlbWriter::new();
    let plaster = glb.material(&Material::lambert("floor", [0.7; 3]));
    let glass = glb.material(&Material {
        name: "glass".to_owned(),
        metallic: 0.0,
        roughness: 0.0,
        transmission: 1.0,
        ior: IOR,
        ..Material::default()
    });
    let lamp = glb.material(&Material {
        emission: [LAMP_RADIANCE; 3],
        ..Material::lambert("lamp", [0.0; 3])
    });
    let corner = DVec3::new(-HALF_FLOOR_M, 0.0, HALF_FLOOR_M);
    let floor = Shape::quad(
        corner,
        DVec3::X * 2.0 * HALF_FLOOR_M,
        DVec3::NEG_Z * 2.0 * HALF_FLOOR_M,
    );
    let floor = glb.mesh("floor", &[floor.plain_part(plaster)])?;
    glb.node("floor", DAffine3::IDENTITY, Payload::Mesh(floor));
    let ball = Shape::icosphere(RADIUS_M, LEVELS);
    let ball = glb.mesh("ball", &[ball.plain_part(glass)])?;
    glb.node(
        "ball",
        DAffine3::from_translation(DVec3::Y * RADIUS_M * FLOOR_TO_CENTRE),
        Payload::Mesh(ball),
    );
    let half = 0.5 * LAMP_EDGE_M;
    let panel = Shape::quadrangle_facing(
        [
            DVec3::new(-half, LAMP_HEIGHT_M, -half),
            DVec3::new(half, LAMP_HEIGHT_M, -half),
            DVec3::new(half, LAMP_HEIGHT_M, half),
            DVec3::new(-half, LAMP_HEIGHT_M, half),
        ],
        DVec3::ZERO,
    );
    let panel = glb.mesh("lamp", &[panel.plain_part(lamp)])?;
    glb.node("lamp", DAffine3::IDENTITY, Payload::Mesh(panel));
    let camera = glb.camera("viewpoint", 0.75);
    let eye = DVec3::new(0.0, 0.7, 0.9);
    let towards = DVec3::new(0.0, 0.1, 0.0) - eye;
    let pitch = towards.y.atan2(-towards.z);
    glb.node(
        "viewpoint",
        DAffine3::from_rotation_translation(DQuat::from_rotation_x(pitch), eye),
        Payload::Camera(camera),
    );
    glb.finish("caustic")
}
