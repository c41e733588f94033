//! The node tree, cameras and lights.

use glam::{DAffine3, DMat4, DQuat, DVec3, DVec4};
use gltf::json;
use gltf::json::extensions::scene::khr_lights_punctual::{Light, Type as LightType};
use gltf::json::validation::Checked;

use super::super::subtree::reached_from;
use super::super::{Camera, LightKind, Mesh, Node, PunctualLight, Scene, SceneError, Trs};
use super::document::Document;
use super::{Notes, named};
use stereolux_base::limits::product;

/// What the tree yields.
pub struct Graph {
    pub nodes: Vec<Node>,
    pub roots: Vec<usize>,
    pub lights: Vec<PunctualLight>,
    pub cameras: Vec<Camera>,
}

/// Below this share of the product of its axes' lengths a determinant is rounding: the axes lie in one plane.
/// Matrices come as f32, whose relative rounding is 6e-8.
const SINGULAR_BELOW: f64 = 1e-7;

/// Weight of a morph target, bytes: in the scene, in the copy that edits are told by, and in poses.
const WEIGHT_BYTES: u64 = 40;

/// Imports the nodes and checks that they form a forest.
pub fn import(
    document: &Document<'_>,
    meshes: &[Mesh],
    notes: &mut Notes,
) -> Result<Graph, SceneError> {
    let cameras = document
        .root
        .cameras
        .iter()
        .enumerate()
        .map(|(index, camera)| import_camera(index, camera, notes))
        .collect();
    let lights = import_lights(document, notes)?;

    let count = document.root.nodes.len();
    let weights = document.root.nodes.iter().map(|node| {
        let mesh = node.mesh.and_then(|mesh| meshes.get(mesh.value()));
        mesh.map_or(0, |mesh| mesh.targets.len() as u64)
    });
    let weights = weights.fold(0, u64::saturating_add);
    let bytes = product(&[weights, WEIGHT_BYTES]);
    document.take(
        bytes,
        "nodes",
        format_args!("{weights} weights of morph targets"),
    )?;
    let mut nodes = Vec::with_capacity(count);
    for (index, source) in document.root.nodes.iter().enumerate() {
        let name = named(&source.name, "node", index);
        let light = source
            .extensions
            .as_ref()
            .and_then(|extensions| extensions.khr_lights_punctual.as_ref())
            .map(|light| light.light.value());
        let (parent_from_node, parts) = transform_of(document, index, &name, source)?;
        nodes.push(Node {
            parent_from_node,
            parts,
            name,
            parent: None,
            children: source
                .children
                .iter()
                .flatten()
                .map(json::Index::value)
                .collect(),
            mesh: source.mesh.map(|mesh| mesh.value()),
            light,
            camera: source.camera.map(|camera| camera.value()),
            skin: None,
            morph_weights: weights_of(document, index, source, meshes)?,
            is_hidden: is_hidden(document, index)?,
        });
    }
    link_parents(document, &mut nodes)?;
    let roots = scene_roots(document, &mut nodes, notes)?;
    Ok(Graph {
        nodes,
        roots,
        lights,
        cameras,
    })
}

/// KHR_node_visibility: `visible`, true by default, holds for the node and all below it.
fn is_hidden(document: &Document<'_>, index: usize) -> Result<bool, SceneError> {
    let visible = document.raw_item("nodes", index).and_then(|node| {
        node.get("extensions")?
            .get("KHR_node_visibility")?
            .get("visible")
    });
    match visible.map(serde_json::Value::as_bool) {
        None => Ok(false),
        Some(Some(visible)) => Ok(!visible),
        Some(None) => Err(document.fault(format!(
            "nodes[{index}].extensions.KHR_node_visibility: 'visible' must be true or false"
        ))),
    }
}

/// The node's weights of its mesh's morph targets, else the mesh's own, else 0 (glTF 2.0, section 3.7.2.2).
fn weights_of(
    document: &Document<'_>,
    index: usize,
    node: &json::Node,
    meshes: &[Mesh],
) -> Result<Vec<f64>, SceneError> {
    let Some(mesh_index) = node.mesh.map(|mesh| mesh.value()) else {
        return Ok(Vec::new());
    };
    let targets = meshes.get(mesh_index).map_or(0, |mesh| mesh.targets.len());
    let of_mesh = || document.root.meshes.get(mesh_index)?.weights.as_ref();
    let (weights, place) = match &node.weights {
        Some(weights) => (Some(weights), format!("nodes[{index}].weights")),
        None => (of_mesh(), format!("meshes[{mesh_index}].weights")),
    };
    let Some(weights) = weights.filter(|weights| !weights.is_empty()) else {
        return Ok(vec![0.0; targets]);
    };
    if weights.len() != targets || weights.iter().any(|weight| !weight.is_finite()) {
        return Err(document.fault(format!(
            "{place}: {} weights for {targets} morph targets, each must be finite",
            weights.len()
        )));
    }
    Ok(weights.iter().map(|weight| f64::from(*weight)).collect())
}

fn link_parents(document: &Document<'_>, nodes: &mut [Node]) -> Result<(), SceneError> {
    let label = |nodes: &[Node], index: usize| format!("nodes[{index}] '{}'", nodes[index].name);
    for parent in 0..nodes.len() {
        for child in nodes[parent].children.clone() {
            if child >= nodes.len() {
                return Err(document.fault(format!(
                    "{}: child {child} is out of range, there are {} nodes",
                    label(nodes, parent),
                    nodes.len()
                )));
            }
            if child == parent {
                return Err(document.fault(format!(
                    "{} is its own child: the nodes must form a tree",
                    label(nodes, child)
                )));
            }
            if let Some(other) = nodes[child].parent {
                return Err(document.fault(format!(
                    "{} is a child of both {} and {}: the nodes must form a tree",
                    label(nodes, child),
                    label(nodes, other),
                    label(nodes, parent)
                )));
            }
            nodes[child].parent = Some(parent);
        }
    }
    // With one parent each, whatever no parentless node reaches lies on or below a cycle.
    let tops = (0..nodes.len()).filter(|index| nodes[*index].parent.is_none());
    let reached = reached_from(nodes, tops.collect());
    match reached.iter().position(|reached| !reached) {
        None => Ok(()),
        Some(index) => Err(document.fault(format!(
            "{} lies on a cycle of nodes, or below one: the nodes must form a tree",
            label(nodes, index)
        ))),
    }
}

fn scene_roots(
    document: &Document<'_>,
    nodes: &mut [Node],
    notes: &mut Notes,
) -> Result<Vec<usize>, SceneError> {
    let root = &document.root;
    let chosen = root.scene.map_or(0, |scene| scene.value());
    let Some(scene) = root.scenes.get(chosen) else {
        if root.scene.is_some() {
            return Err(document.fault(format!(
                "scene: {chosen} is out of range, there are {}",
                root.scenes.len()
            )));
        }
        if !nodes.is_empty() {
            notes.warn("the file has no scene: every node is shown");
        }
        return Ok((0..nodes.len())
            .filter(|index| nodes[*index].parent.is_none())
            .collect());
    };
    if root.scenes.len() > 1 {
        notes.warn(format_args!(
            "the file has {} scenes: scene {chosen} is shown",
            root.scenes.len()
        ));
    }
    let mut roots = Vec::with_capacity(scene.nodes.len());
    let mut listed = vec![false; nodes.len()];
    for index in scene.nodes.iter().map(json::Index::value) {
        let Some(node) = nodes.get(index) else {
            return Err(document.fault(format!(
                "scenes[{chosen}]: node {index} is out of range, there are {}",
                nodes.len()
            )));
        };
        if listed[index] {
            return Err(document.fault(format!(
                "scenes[{chosen}]: nodes[{index}] '{}' is listed twice",
                node.name
            )));
        }
        listed[index] = true;
        roots.push(index);
    }
    cut_from_parents(nodes, &listed, |line| {
        notes.warn(format_args!("scenes[{chosen}]: {line}"));
    })
    .map_err(|line| document.fault(format!("scenes[{chosen}]: {line}")))?;
    Ok(roots)
}

/// Takes nodes that the scene lists as roots although they have a parent, as other readers do where the scene does not show that
/// parent (UniGLTF writes such files); `note` gets a line for each. Where it shows both, what is meant is unknown: the fault's line.
fn cut_from_parents(
    nodes: &mut [Node],
    listed: &[bool],
    mut note: impl FnMut(String),
) -> Result<(), String> {
    let of_listed = (0..nodes.len()).filter(|index| listed[*index]);
    let below = of_listed.flat_map(|root| nodes[root].children.iter().copied());
    let is_shown = reached_from(nodes, below.collect());
    for index in 0..nodes.len() {
        let Some(parent) = nodes[index].parent.filter(|_| listed[index]) else {
            continue;
        };
        let line = format!(
            "nodes[{index}] '{}' is not a root, it is a child of nodes[{parent}] '{}'",
            nodes[index].name, nodes[parent].name
        );
        if is_shown[index] {
            return Err(format!("{line}, and would be shown twice"));
        }
        note(format!(
            "{line}, which the scene does not show: it is taken as a root"
        ));
        nodes[index].parent = None;
    }
    for node in nodes {
        node.children.retain(|child| !listed[*child]);
    }
    Ok(())
}

/// The numbers of `list` in f64, as the file has them: the typed form cuts them to `rounded`.
fn precisely<const N: usize>(list: Option<&serde_json::Value>, rounded: [f32; N]) -> [f64; N] {
    let number = |index: usize| list?.get(index)?.as_f64();
    std::array::from_fn(|index| number(index).unwrap_or(f64::from(rounded[index])))
}

/// A node's transform in parts, as the file has them; `None` if it has a matrix, or a rotation without length.
pub fn parts_of(document: &Document<'_>, index: usize, node: &json::Node) -> Option<Trs> {
    if node.matrix.is_some() {
        return None;
    }
    let exact = |key: &str| document.raw_item("nodes", index)?.get(key);
    let vector = |key, value: Option<[f32; 3]>, default| {
        value.map_or(default, |value| {
            DVec3::from_array(precisely(exact(key), value))
        })
    };
    let rotation = node.rotation.map_or(DQuat::IDENTITY, |rotation| {
        DQuat::from_array(precisely(exact("rotation"), rotation.0))
    });
    Some(Trs {
        translation: vector("translation", node.translation, DVec3::ZERO),
        rotation: Trs::unit(rotation)?,
        scale: vector("scale", node.scale, DVec3::ONE),
    })
}

fn transform_of(
    document: &Document<'_>,
    index: usize,
    name: &str,
    node: &json::Node,
) -> Result<(DAffine3, Option<Trs>), SceneError> {
    let fault = |what: &str| document.fault(format!("nodes[{index}] '{name}': {what}"));
    let parts = parts_of(document, index, node);
    let affine = if let Some(matrix) = node.matrix {
        let exact = document
            .raw_item("nodes", index)
            .and_then(|node| node.get("matrix"));
        let matrix = DMat4::from_cols_array(&precisely(exact, matrix));
        if (matrix.row(3) - DVec4::W).abs().max_element() > 1e-6 {
            return Err(fault(
                "the matrix is not affine: its last row must be 0 0 0 1",
            ));
        }
        DAffine3::from_mat4(matrix)
    } else {
        parts
            .ok_or_else(|| fault("the rotation quaternion has no length"))?
            .parent_from_node()
    };
    if affine.is_finite() {
        Ok((affine, parts))
    } else {
        Err(fault(NOT_FINITE))
    }
}

pub const NOT_FINITE: &str = "the transform is not finite";

/// Why a local transform cannot be used, if it cannot.
pub fn transform_fault(affine: &DAffine3) -> Option<&'static str> {
    if !affine.is_finite() {
        return Some(NOT_FINITE);
    }
    is_flat(affine).then_some("the transform is singular: it flattens space (is a scale 0?)")
}

fn is_flat(affine: &DAffine3) -> bool {
    let axes = affine.matrix3;
    let volume = axes.x_axis.length() * axes.y_axis.length() * axes.z_axis.length();
    // Written so that a NaN from overflow fails too.
    !(axes.determinant().abs() > SINGULAR_BELOW * volume
        && volume > 0.0
        && affine.inverse().is_finite())
}

fn import_camera(index: usize, camera: &json::Camera, notes: &mut Notes) -> Camera {
    let name = named(&camera.name, "camera", index);
    let yfov = camera.perspective.as_ref().map(|lens| lens.yfov);
    let is_usable = |yfov: &f32| *yfov > 0.0 && *yfov < std::f32::consts::PI;
    if let Some(yfov) = yfov.filter(|yfov| !is_usable(yfov)) {
        notes.warn(format_args!(
            "cameras[{index}] '{name}': yfov {yfov} is not between 0 and pi, the camera counts as one without an angle"
        ));
    }
    Camera {
        name,
        yfov_rad: yfov.filter(is_usable),
    }
}

/// Whether the renderer, and a file, can hold a place.
pub fn fits_f32(placed: &DAffine3) -> bool {
    let mut numbers = placed.to_cols_array().into_iter();
    numbers.all(|number| number.abs() <= f64::from(f32::MAX))
}

/// Checks that nested transforms stay within what the renderer counts in: one scale after the other may each make sense and
/// their product none. What is flattened is out of sight, as a scale of 0 on all axes means (glTF 2.0, section 3.5.3): files
/// hide things by it until an animation shows them.
pub fn check_placements(
    document: &Document<'_>,
    scene: &Scene,
    notes: &mut Notes,
) -> Result<(), SceneError> {
    let mut flat = vec![false; scene.nodes.len()];
    for (index, world_from_node) in scene.placed_nodes() {
        let node = &scene.nodes[index];
        let label = || format!("nodes[{index}] '{}'", node.name);
        if !fits_f32(&world_from_node) {
            return Err(document.fault(format!(
                "{}: with those of its parents its transform is beyond 32-bit floats (are nested scales meant?)",
                label()
            )));
        }
        let below_flat = node.parent.is_some_and(|parent| flat[parent]);
        flat[index] =
            below_flat || is_flat(&node.parent_from_node) || !world_from_node.inverse().is_finite();
        if flat[index] && !below_flat {
            notes.warn(format_args!(
                "{}: its transform flattens space (is a scale 0?): meshes there are out of sight while it does",
                label()
            ));
        }
    }
    // Joints count wherever they hang.
    let rest = (!scene.skins.is_empty()).then(|| scene.rest_pose());
    for (skin, joints) in scene.skins.iter().map(|skin| &skin.joints).enumerate() {
        let is_beyond = |joint: &&usize| {
            let placed = rest
                .as_ref()
                .and_then(|rest| rest.world_from_node.get(**joint));
            placed.is_some_and(|placed| !fits_f32(placed))
        };
        if let Some(joint) = joints.iter().find(is_beyond) {
            return Err(document.fault(format!(
                "skins[{skin}], joint nodes[{joint}]: with those of its parents its transform is beyond 32-bit floats"
            )));
        }
    }
    Ok(())
}

fn import_lights(
    document: &Document<'_>,
    notes: &mut Notes,
) -> Result<Vec<PunctualLight>, SceneError> {
    let list = document
        .root
        .extensions
        .as_ref()
        .and_then(|extensions| extensions.khr_lights_punctual.as_ref());
    let list: &[Light] = list.map_or(&[], |list| &list.lights);
    list.iter()
        .enumerate()
        .map(|(index, light)| import_light(document, notes, index, light))
        .collect()
}

fn import_light(
    document: &Document<'_>,
    notes: &mut Notes,
    index: usize,
    light: &Light,
) -> Result<PunctualLight, SceneError> {
    let name = named(&light.name, "light", index);
    let fault = |what: &str| document.fault(format!("lights[{index}] '{name}': {what}"));
    let mut intensity = light.color.map(|channel| channel * light.intensity);
    if intensity.iter().any(|channel| !channel.is_finite()) {
        return Err(fault("the intensity is not finite"));
    }
    if intensity.iter().any(|channel| *channel < 0.0) {
        notes.warn(format_args!(
            "lights[{index}] '{name}': negative intensity is raised to 0"
        ));
        intensity = intensity.map(|channel| channel.max(0.0));
    }
    let kind = match light.type_ {
        Checked::Valid(LightType::Point) => LightKind::Point,
        Checked::Valid(LightType::Directional) => LightKind::Directional,
        Checked::Valid(LightType::Spot) => {
            let spot = light
                .spot
                .as_ref()
                .ok_or_else(|| fault("a spot light without 'spot'"))?;
            let (inner, outer) = (spot.inner_cone_angle, spot.outer_cone_angle);
            // The standard wants inner < outer; exporters write a hard edge as inner = outer.
            let in_order = 0.0 <= inner
                && inner <= outer
                && 0.0 < outer
                && outer <= std::f32::consts::FRAC_PI_2 + 1e-6;
            if !in_order {
                return Err(fault(&format!(
                    "cone angles must be 0 <= inner <= outer <= pi/2 and outer not 0, they are {inner} and {outer}"
                )));
            }
            LightKind::Spot {
                inner_cone_rad: inner,
                outer_cone_rad: outer.min(std::f32::consts::FRAC_PI_2),
            }
        }
        Checked::Invalid => return Err(fault("unknown type")),
    };
    Ok(PunctualLight {
        name,
        kind,
        intensity,
    })
}
