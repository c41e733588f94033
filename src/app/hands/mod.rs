//! Hands and controllers in the picture.
//!
//! A tracked hand is a ball at every joint, a tube along every bone and skin over the palm; what only has a grip is the
//! runtime's model of its controller, or else a plain one. All but models are instances of a few meshes in one part of the
//! scene, moved by the frame's recorded input: a replay has the same pictures. They are lit, mirrored and cast shadows, and
//! no ray of the application meets them.

mod models;
mod shapes;
#[cfg(test)]
mod tests;

use std::iter::once;

use glam::{DAffine3, DMat3, DQuat, DVec3};

use self::models::Models;
use super::world::{World, WorldError};
use crate::pose::Pose;
use crate::scene::edit::{Edit, Placement};
use crate::scene::{Material, Node, Scene, ScenePart};
use crate::xr::Side;
use crate::xr::input::{Hand, Input, JOINTS, Joint, Tracked};

/// The wrist, and the first and last joint of each finger, in the order of `XrHandJointEXT`.
const WRIST: usize = 1;
const FINGERS: [[usize; 2]; 5] = [[2, 5], [6, 10], [11, 15], [16, 20], [21, 25]];
/// A ball at every joint but the palm, which lies within its skin; a bone from the wrist to each finger and along it.
const BALLS: usize = JOINTS - 1;
const BONES: usize = 24;
/// What the palm's skin is stretched between.
const PALM: [[usize; 3]; 12] = [
    [1, 2, 6],
    [2, 3, 6],
    [3, 7, 6],
    [1, 6, 11],
    [6, 7, 12],
    [6, 12, 11],
    [1, 11, 16],
    [11, 12, 17],
    [11, 17, 16],
    [1, 16, 21],
    [16, 17, 22],
    [16, 22, 21],
];
/// How thick a wrist is at most, in radii of the middle finger's root.
const WRIST_TO_ROOT: f64 = 1.2;
/// How much of the arm is shown behind the wrist, metres.
const ARM_M: f64 = 0.04;
/// What a hand is made of, in this order: balls at joints, tubes along bones, halves that taper them, skin on both
/// sides of the palm, and the arm's beginning.
const SHAPES: [(Shape, usize); 6] = [
    (Shape::Ball, BALLS),
    (Shape::Tube, BONES),
    (Shape::Half, BONES),
    (Shape::Skin, 2 * PALM.len()),
    (Shape::Tube, 1),
    (Shape::Ball, 1),
];
/// How many that are.
const SOLIDS: usize = BALLS + 2 * BONES + 2 * PALM.len() + 2;
/// Nodes of one side: joints with their solids, the controller with handle and head.
const NODES: usize = 1 + SOLIDS + 3;

/// Bones without length and joints without a radius are this large, metres: a placement has an inverse.
const LEAST_M: f64 = 1e-6;
/// Skin between joints that lie in a line is left out: below this sine of the angle.
const LEAST_SINE: f64 = 1e-3;
/// Where the head sits on the handle, in the grip, metres.
const HEAD_M: DVec3 = DVec3::new(0.0, 0.0, -0.056);

/// Meshes of the part, in their order.
#[derive(Clone, Copy, Debug)]
enum Shape {
    Ball,
    Tube,
    Half,
    Skin,
    Handle,
    Head,
}

/// The part of the scene that shows them.
pub(super) struct Hands {
    part: ScenePart,
    models: Models,
    is_shown: bool,
}

impl Hands {
    /// Parts of the scene that nobody else finds by name or meets by a ray.
    pub(super) fn parts(&self) -> impl Iterator<Item = &ScenePart> {
        once(&self.part).chain(self.models.shown.iter().flatten())
    }
}

/// Both hands and controllers as a scene of its own. Nothing is hidden: shaders are made for what comes to be seen.
fn scene() -> Scene {
    let matte = |name: &str, color: [f32; 3], roughness: f32| Material {
        roughness,
        specular: 1.0,
        ..Material::lambert(name, color)
    };
    let mut scene = Scene {
        name: "hands".to_owned(),
        meshes: vec![
            shapes::ball().mesh(0),
            shapes::tube().mesh(0),
            shapes::half().mesh(0),
            shapes::triangle().mesh(0),
            shapes::handle().mesh(1),
            shapes::head().mesh(1),
        ],
        materials: vec![
            matte("wearer's hands", [0.55, 0.42, 0.35], 0.6),
            matte("wearer's controllers", [0.25; 3], 0.4),
        ],
        ..Scene::default()
    };
    let hand = SHAPES.map(|(shape, count)| vec![shape; count]).concat();
    for side in Side::BOTH {
        group(&mut scene, &format!("wearer's {} hand", side.word()), &hand);
        let controller = format!("wearer's {} controller", side.word());
        group(&mut scene, &controller, &[Shape::Handle, Shape::Head]);
    }
    scene
}

/// Adds a node with a node for each shape below it, each a speck until it is placed.
fn group(scene: &mut Scene, name: &str, shapes: &[Shape]) {
    let root = scene.nodes.len();
    scene.roots.push(root);
    scene.nodes.push(Node {
        name: name.to_owned(),
        children: (root + 1..=root + shapes.len()).collect(),
        ..Node::default()
    });
    scene.nodes.extend(shapes.iter().map(|shape| Node {
        name: name.to_owned(),
        parent: Some(root),
        parent_from_node: speck(DVec3::ZERO),
        mesh: Some(*shape as usize),
        ..Node::default()
    }));
}

fn speck(at: DVec3) -> DAffine3 {
    DAffine3::from_mat3_translation(DMat3::from_diagonal(DVec3::splat(LEAST_M)), at)
}

/// The two joints of each bone.
fn bones() -> impl Iterator<Item = [usize; 2]> {
    FINGERS.into_iter().flat_map(|[first, last]| {
        let along = (first..last).map(|at| [at, at + 1]);
        once([WRIST, first]).chain(along)
    })
}

/// World from solid, in the order of [`SHAPES`].
fn solids(joints: &[Joint; JOINTS]) -> impl Iterator<Item = DAffine3> {
    // A wrist is about as thick as the bones that begin there, and wider.
    let wrist = &joints[WRIST];
    let root_m = radius_m(&joints[FINGERS[2][0]]);
    let skin_m = radius_m(wrist).min(root_m);
    let thick_m = radius_m(wrist).min(WRIST_TO_ROOT * root_m);
    let wrist_size = DVec3::new(radius_m(wrist), thick_m, radius_m(wrist));
    let wrist_ball = sized(&wrist.pose, wrist_size);
    let arm_end = DVec3::new(0.0, 0.0, ARM_M);
    let arm_end = wrist.pose.then(&Pose::new(arm_end, DQuat::IDENTITY));
    let arm = sized(&wrist.pose, wrist_size.with_z(ARM_M));
    let arm_end = sized(&arm_end, wrist_size.with_z(0.5 * thick_m));

    let balls = joints[WRIST + 1..].iter().map(ball);
    let tubes = bones().map(|bone| tube(bone.map(|at| &joints[at])));
    let halves = bones().map(|bone| {
        let [from, to] = bone.map(|at| &joints[at]);
        let is_wrist = bone[0] == WRIST;
        if is_wrist {
            speck(from.pose.position)
        } else {
            half(from, to)
        }
    });
    let skin = PALM.iter().map(move |corners| {
        corners.map(|at| {
            let joint = &joints[at];
            (joint, if at == WRIST { skin_m } else { radius_m(joint) })
        })
    });
    once(wrist_ball)
        .chain(balls)
        .chain(tubes)
        .chain(halves)
        .chain(skin.flat_map(skin_of))
        .chain([arm, arm_end])
}

fn radius_m(joint: &Joint) -> f64 {
    joint.radius_m.max(LEAST_M)
}

fn sized(world_from_joint: &Pose, size_m: DVec3) -> DAffine3 {
    let axes = DMat3::from_quat(world_from_joint.orientation) * DMat3::from_diagonal(size_m);
    DAffine3::from_mat3_translation(axes, world_from_joint.position)
}

/// As large as the joint.
fn ball(joint: &Joint) -> DAffine3 {
    sized(&joint.pose, DVec3::splat(radius_m(joint)))
}

/// From one joint to the other, as thick as the thinner one: the balls close it.
fn tube([from, to]: [&Joint; 2]) -> DAffine3 {
    along(from, to, radius_m(from).min(radius_m(to)))
}

/// Half a ball, drawn out from the thicker joint to the other one.
fn half(from: &Joint, to: &Joint) -> DAffine3 {
    if radius_m(from) < radius_m(to) {
        return half(to, from);
    }
    along(from, to, radius_m(from))
}

fn along(from: &Joint, to: &Joint, radius_m: f64) -> DAffine3 {
    let bone = to.pose.position - from.pose.position;
    let along = bone.try_normalize().unwrap_or(DVec3::Z);
    let (right, up) = along.any_orthonormal_pair();
    DAffine3 {
        matrix3: DMat3::from_cols(
            right * radius_m,
            up * radius_m,
            along * bone.length().max(LEAST_M),
        ),
        translation: from.pose.position,
    }
}

/// A triangle on either side of three joints, each of its corners as far from the joint as given beside it.
fn skin_of(corners: [(&Joint, f64); 3]) -> [DAffine3; 2] {
    let [a, b, c] = corners.map(|(joint, _)| joint.pose.position);
    let normal = (b - a).cross(c - a).normalize_or_zero();
    [normal, -normal].map(|out| {
        let [a, b, c] = corners.map(|(joint, off_m)| joint.pose.position + out * off_m);
        let [ab, ac] = [b - a, c - a];
        let matrix3 = DMat3::from_cols(ab, ac, out);
        if matrix3.determinant().abs() > LEAST_SINE * ab.length() * ac.length() {
            DAffine3::from_mat3_translation(matrix3, a)
        } else {
            speck(a)
        }
    })
}

/// World from handle and from head, which points where the hand does.
fn controller(grip: &Tracked, aim: Option<&Tracked>) -> [DAffine3; 2] {
    let head = Pose::new(
        grip.pose.then(&Pose::new(HEAD_M, DQuat::IDENTITY)).position,
        aim.unwrap_or(grip).pose.orientation,
    );
    [grip.pose.affine(), head.affine()]
}

impl World<'_> {
    /// Shows the wearer's hands, or does so no longer: along the joints where they are tracked, else a controller where
    /// a grip is, the runtime's model of it if there is one. They are where the frame's input has them, in that very frame. [`World::node`] does not find them,
    /// and [`World::cast_ray`] goes through them.
    ///
    /// In [`super::App::start`] the renderer is made for them; later the first call may compile.
    ///
    /// # Errors
    /// [`WorldError::Part`]: the renderer cannot take them.
    pub fn show_hands(&mut self, shows: bool) -> Result<(), WorldError> {
        if let Some(hands) = self.kept.hands.as_mut() {
            hands.is_shown = shows;
        } else if shows {
            let part = self.insert(scene(), "wearer's hands", DAffine3::IDENTITY)?;
            self.kept.hands = Some(Hands {
                part,
                models: Models::default(),
                is_shown: true,
            });
        }
        Ok(())
    }

    /// Puts them where a frame's input has them; what is not tracked is hidden.
    pub(super) fn move_hands(&mut self, input: &Input) -> Result<(), WorldError> {
        self.bring_model();
        let Some(hands) = self.kept.hands.as_mut() else {
            return Ok(());
        };
        let (is_shown, root) = (hands.is_shown, hands.part.root());
        let models = hands.models.shown.each_ref();
        let models = models.map(|model| model.as_ref().map(ScenePart::root));
        for side in Side::BOTH {
            let nodes = root + 1 + side as usize * NODES;
            let Hand {
                grip, aim, joints, ..
            } = input.hand(side);
            let joints = joints.as_ref().filter(|_| is_shown);
            let grip = grip.as_ref().filter(|_| is_shown && joints.is_none());
            self.place_all(nodes, joints.map(|joints| solids(joints)))?;
            let model = models[side as usize];
            if let Some(root) = model {
                self.show(root, grip.is_some())?;
                let world_from_model = grip.map(|grip| grip.pose.affine());
                self.put(root, world_from_model.into_iter())?;
            }
            let grip = grip.filter(|_| model.is_none());
            let controller = grip.map(|grip| controller(grip, aim.as_ref()).into_iter());
            self.place_all(nodes + 1 + SOLIDS, controller)?;
        }
        Ok(())
    }

    /// Places what is below a group and shows it, or hides it.
    fn place_all(
        &mut self,
        group: usize,
        world_from_nodes: Option<impl Iterator<Item = DAffine3>>,
    ) -> Result<(), WorldError> {
        self.show(group, world_from_nodes.is_some())?;
        self.put(group + 1, world_from_nodes.into_iter().flatten())
    }

    /// What stays as it was costs no edit; likewise below.
    fn show(&mut self, node: usize, is_visible: bool) -> Result<(), WorldError> {
        if self.scene().nodes[node].is_hidden == is_visible {
            self.set_visible(node, is_visible)?;
        }
        Ok(())
    }

    /// Places nodes, from the first on.
    fn put(
        &mut self,
        first: usize,
        world_from_nodes: impl Iterator<Item = DAffine3>,
    ) -> Result<(), WorldError> {
        for (node, world_from_node) in (first..).zip(world_from_nodes) {
            if self.scene().nodes[node].parent_from_node != world_from_node {
                let to = Placement::Matrix(world_from_node);
                self.edit(Edit::Transform { node, to })?;
            }
        }
        Ok(())
    }
}
