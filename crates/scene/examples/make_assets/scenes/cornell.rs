//! `builtin:cornell`: the Cornell box with its published measurements.
//!
//! Geometry and camera: Cornell University Program of Computer Graphics, *The Cornell Box: physical data* (the box of
//! 1998, after Goral, Torrance, Greenberg and Battaile, *Modeling the interaction of light between diffuse surfaces*,
//! SIGGRAPH 1984), in millimetres. That frame looks along +Z with +X to the left; half a turn about +Y brings it to
//! glTF's, so (x, y, z) mm stands at (-x, y, -z) / 1000 m. The red wall is on the left of the picture.
//!
//! Colours: the published spectra reduced to linear sRGB as renderers commonly use them. All surfaces are ideal
//! Lambert (KHR_materials_specular, factor 0). The lamp hangs 0.8 mm under the ceiling, so that no surfaces coincide.

use glam::{DAffine3, DVec3};
use stereolux_scene::{Material, SceneError};

use super::glb_writer::{GlbWriter, Payload};
use super::shapes::Shape;

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

/// Corners of the room in mm, those of the floor first.
const ROOM: [[f64; 3]; 8] = [
    [552.8, 0.0, 0.0],
    [0.0, 0.0, 0.0],
    [0.0, 0.0, 559.2],
    [549.6, 0.0, 559.2],
    [556.0, 548.8, 0.0],
    [556.0, 548.8, 559.2],
    [0.0, 548.8, 559.2],
    [0.0, 548.8, 0.0],
];
const LAMP_FACE: [[f64; 3]; 4] = [
    [343.0, 548.0, 227.0],
    [343.0, 548.0, 332.0],
    [213.0, 548.0, 332.0],
    [213.0, 548.0, 227.0],
];
/// x and z of a block's corners, its height, and the corner at which each of its sides begins, in the published order.
type Block = ([[f64; 2]; 4], f64, [usize; 4]);
const SHORT_BLOCK: Block = (
    [[130.0, 65.0], [82.0, 225.0], [240.0, 272.0], [290.0, 114.0]],
    165.0,
    [3, 0, 1, 2],
);
const TALL_BLOCK: Block = (
    [
        [423.0, 247.0],
        [265.0, 296.0],
        [314.0, 456.0],
        [472.0, 406.0],
    ],
    330.0,
    [0, 3, 2, 1],
);
const CAMERA: [f64; 3] = [278.0, 273.0, -800.0];

/// From the published frame, mm, to glTF's, m.
fn place([x, y, z]: [f64; 3]) -> DVec3 {
    DVec3::new(-x, y, -z) / 1000.0
}

/// The top and the sides of a block, facing away from its middle.
fn block((corners, height, sides): Block) -> Shape {
    let at = |corner: usize, y| {
        let [x, z] = corners[corner % 4];
        place([x, y, z])
    };
    let top = [0, 1, 2, 3].map(|corner| at(corner, height));
    let middle = top.iter().sum::<DVec3>() / 4.0 - DVec3::Y * at(0, height / 2.0).y;
    let sides = sides.map(|a| [at(a, 0.0), at(a, height), at(a + 3, height), at(a + 3, 0.0)]);
    let mut block = Shape::default();
    for face in [top].into_iter().chain(sides) {
        let center = face.iter().sum::<DVec3>() / 4.0;
        block.append(Shape::quadrangle_facing(face, 2.0 * center - middle));
    }
    block
}

/// The binary glTF of the box.
pub fn write() -> Result<Vec<u8>, SceneError> {
    let mut glb = GlbWriter::new();
    let white = glb.material(&Material::lambert("white", WHITE));
    let red = glb.material(&Material::lambert("red", RED));
    let green = glb.material(&Material::lambert("green", GREEN));
    let lamp = glb.material(&Material {
        emission: LAMP_RADIANCE,
        ..Material::lambert("lamp", LAMP)
    });

    let wall = |corners: [usize; 4]| corners.map(|corner| ROOM[corner]);
    let room = [
        ("floor", wall([0, 1, 2, 3]), white),
        ("ceiling", wall([4, 5, 6, 7]), white),
        ("back wall", wall([3, 2, 6, 5]), white),
        ("right wall", wall([2, 1, 7, 6]), green),
        ("left wall", wall([0, 3, 5, 4]), red),
        ("lamp", LAMP_FACE, lamp),
    ];
    for (name, face, material) in room {
        let shape = Shape::quadrangle_facing(face.map(place), place([278.0, 274.4, 279.6]));
        let mesh = glb.mesh(name, &[shape.plain_part(material)]);
        glb.node(name, DAffine3::IDENTITY, Payload::Mesh(mesh));
    }
    for (name, of) in [("short block", SHORT_BLOCK), ("tall block", TALL_BLOCK)] {
        let mesh = glb.mesh(name, &[block(of).plain_part(white)]);
        glb.node(name, DAffine3::IDENTITY, Payload::Mesh(mesh));
    }
    let camera = glb.camera("viewpoint", CAMERA_YFOV_RAD);
    glb.node(
        "viewpoint",
        DAffine3::from_translation(place(CAMERA)),
        Payload::Camera(camera),
    );
    glb.finish("cornell")
}
