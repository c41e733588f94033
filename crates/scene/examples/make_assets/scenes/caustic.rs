//! `builtin:caustic`: a glass ball over a diffuse floor, lit from above by a square lamp.
//!
//! The ball focuses the lamp into a bright spot on the floor. It is a polished sphere of [`IOR`] 1.5, whose paraxial
//! focus lies n R / (2 (n - 1)) = 1.5 R from its centre; the floor is [`FLOOR_TO_CENTRE`] R below it, where the caustic
//! is sharp but has a width. The lamp is large enough that a path from the floor through the glass finds it by chance,
//! so the path tracer converges to the same picture.

use glam::{DAffine3, DQuat, DVec3};
use stereolux_scene::{Material, SceneError};

use super::glb_writer::{GlbWriter, Payload};
use super::shapes::Shape;

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
        thickness: 2.0 * RADIUS_M as f32,
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
    let floor = glb.mesh("floor", &[floor.plain_part(plaster)]);
    glb.node("floor", DAffine3::IDENTITY, Payload::Mesh(floor));
    let ball = Shape::icosphere(RADIUS_M, LEVELS);
    let ball = glb.mesh("ball", &[ball.plain_part(glass)]);
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
    let panel = glb.mesh("lamp", &[panel.plain_part(lamp)]);
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
