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

type Face = [[f64; 3]; 4];

const FLOOR: Face = [
    [552.8, 0.0, 0.0],
    [0.0, 0.0, 0.0],
    [0.0, 0.0, 559.2],
    [549.6, 0.0, 559.2],
];
const CEILING: Face = [
    [556.0, 548.8, 0.0],
    [556.0, 548.8, 559.2],
    [0.0, 548.8, 559.2],
    [0.0, 548.8, 0.0],
];
const BACK_WALL: Face = [
    [549.6, 0.0, 559.2],
    [0.0, 0.0, 559.2],
    [0.0, 548.8, 559.2],
    [556.0, 548.8, 559.2],
];
const RIGHT_WALL: Face = [
    [0.0, 0.0, 559.2],
    [0.0, 0.0, 0.0],
    [0.0, 548.8, 0.0],
    [0.0, 548.8, 559.2],
];
const LEFT_WALL: Face = [
    [552.8, 0.0, 0.0],
    [549.6, 0.0, 559.2],
    [556.0, 548.8, 559.2],
    [556.0, 548.8, 0.0],
];
const LAMP_FACE: Face = [
    [343.0, 548.0, 227.0],
    [343.0, 548.0, 332.0],
    [213.0, 548.0, 332.0],
    [213.0, 548.0, 227.0],
];
const SHORT_BLOCK: [Face; 5] = [
    [
        [130.0, 165.0, 65.0],
        [82.0, 165.0, 225.0],
        [240.0, 165.0, 272.0],
        [290.0, 165.0, 114.0],
    ],
    [
        [290.0, 0.0, 114.0],
        [290.0, 165.0, 114.0],
        [240.0, 165.0, 272.0],
        [240.0, 0.0, 272.0],
    ],
    [
        [130.0, 0.0, 65.0],
        [130.0, 165.0, 65.0],
        [290.0, 165.0, 114.0],
        [290.0, 0.0, 114.0],
    ],
    [
        [82.0, 0.0, 225.0],
        [82.0, 165.0, 225.0],
        [130.0, 165.0, 65.0],
        [130.0, 0.0, 65.0],
    ],
    [
        [240.0, 0.0, 272.0],
        [240.0, 165.0, 272.0],
        [82.0, 165.0, 225.0],
        [82.0, 0.0, 225.0],
    ],
];
const TALL_BLOCK: [Face; 5] = [
    [
        [423.0, 330.0, 247.0],
        [265.0, 330.0, 296.0],
        [314.0, 330.0, 456.0],
        [472.0, 330.0, 406.0],
    ],
    [
        [423.0, 0.0, 247.0],
        [423.0, 330.0, 247.0],
        [472.0, 330.0, 406.0],
        [472.0, 0.0, 406.0],
    ],
    [
        [472.0, 0.0, 406.0],
        [472.0, 330.0, 406.0],
        [314.0, 330.0, 456.0],
        [314.0, 0.0, 456.0],
    ],
    [
        [314.0, 0.0, 456.0],
        [314.0, 330.0, 456.0],
        [265.0, 330.0, 296.0],
        [265.0, 0.0, 296.0],
    ],
    [
        [265.0, 0.0, 296.0],
        [265.0, 330.0, 296.0],
        [423.0, 330.0, 247.0],
        [423.0, 0.0, 247.0],
    ],
];
/// A point in the middle of the room and one in each block, to tell fronts from backs.
const ROOM_MIDDLE: [f64; 3] = [278.0, 274.4, 279.6];
const SHORT_BLOCK_MIDDLE: [f64; 3] = [185.5, 82.5, 169.0];
const TALL_BLOCK_MIDDLE: [f64; 3] = [368.5, 165.0, 351.25];
const CAMERA: [f64; 3] = [278.0, 273.0, -800.0];

/// From the published frame, mm, to glTF's, m.
fn place(point: [f64; 3]) -> DVec3 {
    DVec3::new(-point[0], point[1], -point[2]) / 1000.0
}

/// A face with its front towards `middle`, or away from it.
fn oriented(face: Face, middle: [f64; 3], inward: bool) -> Shape {
    let corners = face.map(place);
    let center = corners.iter().sum::<DVec3>() / 4.0;
    let towards = if inward {
        place(middle)
    } else {
        2.0 * center - place(middle)
    };
    Shape::quadrangle_facing(corners, towards)
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

    let room = [
        ("floor", FLOOR, white),
        ("ceiling", CEILING, white),
        ("back wall", BACK_WALL, white),
        ("right wall", RIGHT_WALL, green),
        ("left wall", LEFT_WALL, red),
        ("lamp", LAMP_FACE, lamp),
    ];
    for (name, face, material) in room {
        let mesh = glb.mesh(
            name,
            &[oriented(face, ROOM_MIDDLE, true).plain_part(material)],
        )?;
        glb.node(name, DAffine3::IDENTITY, Payload::Mesh(mesh));
    }
    for (name, faces, middle) in [
        ("short block", SHORT_BLOCK, SHORT_BLOCK_MIDDLE),
        ("tall block", TALL_BLOCK, TALL_BLOCK_MIDDLE),
    ] {
        let mut block = Shape::default();
        for face in faces {
            block.append(oriented(face, middle, false));
        }
        let mesh = glb.mesh(name, &[block.plain_part(white)])?;
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
