//! `builtin:parade`: a room in which everything that can move does.
//!
//! A box and a lantern (an emitter) travel as rigid bodies, a tube bends by a skin of three joints, a ball takes another
//! shape by a morph target. The clip `parade` moves them all, `wave` bends the tube alone. Both end as they begin.

use glam::{DAffine3, DQuat, DVec2, DVec3};
use stereolux_scene::animation::{Interpolation, Track};
use stereolux_scene::{Material, MorphTarget, SceneError, VertexJoints};

use super::glb_writer::{Channel, GlbWriter, Part, Payload};
use super::shapes::Shape;

/// Length of the clip `parade`, seconds.
pub const LENGTH_S: f64 = 4.0;
/// Height of the tube, metres.
pub const TUBE_M: f64 = 1.2;
/// Radius of the ball, metres.
pub const BALL_M: f64 = 0.3;
/// Radiance of the lamp over the room.
pub const LAMP_RADIANCE: f32 = 8.0;

const JOINTS: usize = 3;
const RINGS: usize = 16;

/// The binary glTF of the scene.
pub fn write() -> Result<Vec<u8>, SceneError> {
    let mut glb = GlbWriter::new();
    let grey = glb.material(&Material::lambert("plaster", [0.7; 3]));
    let red = glb.material(&Material::lambert("box", [0.7, 0.2, 0.15]));
    let green = glb.material(&Material::lambert("tube", [0.2, 0.6, 0.25]));
    let blue = glb.material(&Material::lambert("ball", [0.2, 0.3, 0.7]));
    let glow = |name: &str, emission| Material {
        emission,
        ..Material::lambert(name, [0.0; 3])
    };
    let lamp = glb.material(&glow("lamp", [LAMP_RADIANCE; 3]));
    let lantern = glb.material(&glow("lantern", [12.0, 7.0, 2.0]));

    let quad = |from: [f64; 3], u: DVec3, v: DVec3| Shape::quad(DVec3::from_array(from), u, v);
    let mut room = quad([-2.0, 0.0, 1.0], DVec3::X * 4.0, DVec3::NEG_Z * 3.0);
    room.append(quad([-2.0, 0.0, -2.0], DVec3::X * 4.0, DVec3::Y * 2.5));
    let still = [
        ("room", room.plain_part(grey)),
        (
            "lamp",
            quad([-0.5, 2.4, -1.0], DVec3::X, DVec3::Z).plain_part(lamp),
        ),
    ];
    for (name, part) in still {
        let mesh = glb.mesh(name, &[part]);
        glb.node(name, DAffine3::IDENTITY, Payload::Mesh(mesh));
    }
    let rigid = |glb: &mut GlbWriter, name: &str, half: f64, material: u32, at: DVec3| {
        let shape = Shape::beveled_box(DVec3::splat(-half), DVec3::splat(half), 0.1 * half);
        let mesh = glb.mesh(name, &[shape.plain_part(material)]);
        glb.node(name, DAffine3::from_translation(at), Payload::Mesh(mesh))
    };
    let box_node = rigid(&mut glb, "box", 0.18, red, box_at(0));
    let lantern_node = rigid(&mut glb, "lantern", 0.06, lantern, lantern_at(0));
    let joints = add_tube(&mut glb, green);
    let ball = add_ball(&mut glb, blue);
    let camera = glb.camera("viewpoint", 0.9);
    glb.node(
        "viewpoint",
        DAffine3::from_translation(DVec3::new(0.0, 1.0, 2.4)),
        Payload::Camera(camera),
    );

    let bend = |length_s: f64| -> Vec<Channel<'_>> {
        joints[1..]
            .iter()
            .map(|joint| Channel {
                node: *joint,
                path: "rotation",
                track: bending(length_s),
            })
            .collect()
    };
    let mut channels = vec![
        Channel {
            node: box_node,
            path: "translation",
            track: linear(5, |key| box_at(key).to_array().to_vec()),
        },
        Channel {
            node: box_node,
            path: "rotation",
            track: linear(5, |key| {
                let turn = DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2 * key as f64);
                turn.to_array().to_vec()
            }),
        },
        Channel {
            node: lantern_node,
            path: "translation",
            track: linear(5, |key| lantern_at(key).to_array().to_vec()),
        },
        Channel {
            node: ball,
            path: "weights",
            track: linear(3, |key| vec![f64::from(key == 1)]),
        },
    ];
    channels.extend(bend(LENGTH_S));
    glb.animation("parade", &channels);
    glb.animation("wave", &bend(0.5 * LENGTH_S));
    glb.finish("parade")
}

/// Corners of the box's way round the room, by key.
fn box_at(key: usize) -> DVec3 {
    let side = [(-1.2, -1.2), (1.2, -1.2), (1.2, 0.2), (-1.2, 0.2)][key % 4];
    DVec3::new(side.0, 0.18, side.1)
}

fn lantern_at(key: usize) -> DVec3 {
    let side = [(0.9, 1.3), (0.0, 1.7), (-0.9, 1.3), (0.0, 0.9)][key % 4];
    DVec3::new(side.0, side.1, -0.2)
}

/// Evenly spaced keys from 0 to [`LENGTH_S`].
fn linear(keys: usize, value: impl Fn(usize) -> Vec<f64>) -> Track {
    let values: Vec<f64> = (0..keys).flat_map(&value).collect();
    Track {
        times_s: (0..keys)
            .map(|key| LENGTH_S * key as f64 / (keys - 1) as f64)
            .collect(),
        width: values.len() / keys,
        values,
        interpolation: Interpolation::Linear,
    }
}

/// A joint that bends to one side and the other, at rest at its turning points.
fn bending(length_s: f64) -> Track {
    let angles = [0.0, 0.6, 0.0, -0.6, 0.0];
    let mut values = Vec::new();
    for (key, angle) in angles.iter().enumerate() {
        let rotation = DQuat::from_rotation_z(*angle).to_array();
        // Through the middle at full speed: half angle per second, about z.
        let speed = match key {
            0 | 4 => 1.0,
            2 => -1.0,
            _ => 0.0,
        };
        let tangent = [0.0, 0.0, speed * 0.6 * std::f64::consts::PI / length_s, 0.0];
        values.extend(tangent.iter().chain(&rotation).chain(&tangent));
    }
    Track {
        times_s: (0..5).map(|key| length_s * f64::from(key) / 4.0).collect(),
        values,
        width: 4,
        interpolation: Interpolation::CubicSpline,
    }
}

/// A tube that stands on the floor; returns its joints.
fn add_tube(glb: &mut GlbWriter, material: u32) -> Vec<u32> {
    let radius = 0.13;
    let ring = |at: usize| TUBE_M * at as f64 / RINGS as f64;
    let mut profile: Vec<DVec2> = (0..=RINGS).map(|at| DVec2::new(radius, ring(at))).collect();
    profile.push(DVec2::new(0.0, TUBE_M));
    let shape = Shape::lathe(&profile, 16, |_| 1.0);
    let gap = TUBE_M / JOINTS as f64;
    let joints = shape
        .positions
        .iter()
        .map(|position| {
            // Each joint holds its own piece and shares half a piece with its neighbours.
            let along = (position.y / gap - 0.5).clamp(0.0, (JOINTS - 1) as f64);
            let lower = (along.floor() as usize).min(JOINTS - 2);
            let share = (along - lower as f64) as f32;
            VertexJoints {
                joints: [lower as u16, lower as u16 + 1, 0, 0],
                weights: [1.0 - share, share, 0.0, 0.0],
            }
        })
        .collect();
    let part = Part {
        joints,
        ..shape.plain_part(material)
    };
    let mesh = glb.mesh("tube", &[part]);
    // The node's own place does not count: the joints stand where the tube does.
    let node = glb.node("tube", DAffine3::IDENTITY, Payload::Mesh(mesh));
    let foot = DVec3::new(-0.45, 0.0, -0.6);
    let mut nodes = Vec::new();
    for joint in 0..JOINTS {
        let at = if joint == 0 { foot } else { DVec3::Y * gap };
        nodes.push(glb.node(
            &format!("joint {joint}"),
            DAffine3::from_translation(at),
            None,
        ));
    }
    for pair in nodes.windows(2) {
        glb.adopt(pair[0], &pair[1..]);
    }
    let bind: Vec<DAffine3> = (0..JOINTS)
        .map(|joint| DAffine3::from_translation(DVec3::NEG_Y * gap * joint as f64))
        .collect();
    glb.skin(node, &nodes, &bind);
    nodes
}

/// A ball that becomes a lens with bumps.
fn add_ball(glb: &mut GlbWriter, material: u32) -> u32 {
    let ball = Shape::icosphere(BALL_M, 3);
    let bent = |p: &DVec3| {
        let bump = 1.0 + 0.25 * (9.0 * p.x / BALL_M).sin() * (7.0 * p.z / BALL_M).cos();
        DVec3::new(1.3 * p.x, 0.55 * p.y, 1.3 * p.z) * bump
    };
    let delta = |to: DVec3, from: DVec3| (to - from).as_vec3().to_array().map(on_grid);
    let positions = ball.positions.iter().map(|p| delta(bent(p), *p)).collect();
    // The gradient of the implicit form, bumps aside: enough for shading.
    let normals = ball
        .positions
        .iter()
        .zip(&ball.normals)
        .map(|(p, normal)| {
            let lens = DVec3::new(p.x / 1.3, p.y / 0.55, p.z / 1.3).normalize_or(*normal);
            delta(lens, *normal)
        })
        .collect();
    let part = Part {
        targets: vec![MorphTarget { positions, normals }],
        ..ball.plain_part(material)
    };
    let mesh = glb.mesh("ball", &[part]);
    let at = DAffine3::from_translation(DVec3::new(0.55, 0.45, -0.7));
    glb.node("ball", at, Payload::Mesh(mesh))
}

/// Rounded so far that the last bit of a sine, which differs between mathematical libraries, does not count.
fn on_grid(value: f32) -> f32 {
    ((f64::from(value) * 1e6).round() / 1e6 + 0.0) as f32
}
