//! Skins and animations, read from the plain JSON: the typed form refuses channels without a node.

use glam::{DAffine3, DMat4};
use serde_json::Value;

use super::super::animation::{Animation, Interpolation, NodeTracks, Track};
use super::super::needs::{LeftOut, Motion};
use super::super::{Mesh, Node, SceneError, Skin};
use super::Notes;
use super::accessors::Reader;
use super::document::Document;

/// Most numbers over all keyframes: a bound on what small files over one buffer can ask for.
const MAX_VALUES: usize = 1 << 26;

/// What the typed document leaves out.
#[derive(Clone, Debug, Default)]
pub struct RawMotion {
    pub animations: Vec<Value>,
    pub skins: Vec<Value>,
    /// By node.
    pub node_skins: Vec<Option<Value>>,
}

impl RawMotion {
    /// Takes animations and skins out of the document.
    pub fn take(top: &mut serde_json::Map<String, Value>) -> Self {
        let mut list = |key: &str| match top.remove(key) {
            Some(Value::Array(list)) => list,
            _ => Vec::new(),
        };
        let (animations, skins) = (list("animations"), list("skins"));
        let nodes = top.get_mut("nodes").and_then(Value::as_array_mut);
        let node_skins = nodes
            .into_iter()
            .flatten()
            .map(|node| node.as_object_mut()?.remove("skin"))
            .collect();
        Self {
            animations,
            skins,
            node_skins,
        }
    }
}

/// An index of the plain JSON, checked against a list's length.
fn index(
    document: &Document<'_>,
    object: &Value,
    key: &str,
    place: &str,
    count: usize,
) -> Result<usize, SceneError> {
    let Some(value) = object.get(key) else {
        return Err(document.fault(format!("{place}.{key}: missing")));
    };
    in_range(document, value, &format!("{place}.{key}"), count)
}

fn in_range(
    document: &Document<'_>,
    value: &Value,
    place: &str,
    count: usize,
) -> Result<usize, SceneError> {
    let index = value.as_u64().and_then(|index| usize::try_from(index).ok());
    index.filter(|index| *index < count).ok_or_else(|| {
        // Whatever else stands there may be of any length.
        let found = if value.is_number() {
            value.to_string()
        } else {
            "what is no number".to_owned()
        };
        document.fault(format!(
            "{place}: {found} is out of range, there are {count}"
        ))
    })
}

fn name_of(object: &Value, otherwise: String) -> String {
    object
        .get("name")
        .and_then(Value::as_str)
        .map_or(otherwise, str::to_owned)
}

/// Reads the skins and gives them to their nodes.
pub fn import_skins(
    document: &Document<'_>,
    reader: &Reader<'_>,
    nodes: &mut [Node],
    meshes: &[Mesh],
    notes: &mut Notes,
) -> Result<Vec<Skin>, SceneError> {
    let raw = &document.motion;
    let skins = raw
        .skins
        .iter()
        .enumerate()
        .map(|(at, skin)| import_skin(document, reader, at, skin, nodes))
        .collect::<Result<Vec<_>, _>>()?;
    for (at, skin) in raw.node_skins.iter().enumerate() {
        let (Some(skin), Some(node)) = (skin, nodes.get_mut(at)) else {
            continue;
        };
        let place = format!("nodes[{at}] '{}'.skin", node.name);
        let skin = in_range(document, skin, &place, skins.len())?;
        let Some(mesh) = node.mesh.and_then(|mesh| meshes.get(mesh)) else {
            notes.warn(format!("{place}: the node has no mesh for a skin"));
            continue;
        };
        if mesh.joints.is_empty() {
            notes.warn(format!(
                "{place}: mesh '{}' has no JOINTS_0 and WEIGHTS_0 and stays rigid",
                mesh.name
            ));
            continue;
        }
        let joints = skins[skin].joints.len();
        let beyond = mesh.joints.iter().enumerate().find_map(|(vertex, of)| {
            let used = of.joints.iter().zip(of.weights);
            let joint = used
                .filter(|(_, weight)| *weight > 0.0)
                .map(|(joint, _)| *joint)
                .find(|joint| usize::from(*joint) >= joints)?;
            Some((vertex, joint))
        });
        if let Some((vertex, joint)) = beyond {
            return Err(document.fault(format!(
                "{place}: vertex {vertex} of mesh '{}' names joint {joint}, the skin has {joints}",
                mesh.name
            )));
        }
        node.skin = Some(skin);
    }
    Ok(skins)
}

fn import_skin(
    document: &Document<'_>,
    reader: &Reader<'_>,
    at: usize,
    skin: &Value,
    nodes: &[Node],
) -> Result<Skin, SceneError> {
    let place = format!("skins[{at}]");
    let fault = |what: String| document.fault(format!("{place}{what}"));
    let list = skin.get("joints").and_then(Value::as_array);
    let joints = list
        .into_iter()
        .flatten()
        .enumerate()
        .map(|(joint, value)| {
            in_range(
                document,
                value,
                &format!("{place}.joints[{joint}]"),
                nodes.len(),
            )
        })
        .collect::<Result<Vec<_>, _>>()?;
    if joints.is_empty() {
        return Err(fault(": has no joints".to_owned()));
    }
    if joints.len() > usize::from(u16::MAX) {
        return Err(fault(format!(": {} joints are too many", joints.len())));
    }
    let joint_from_mesh = match skin.get("inverseBindMatrices") {
        None => vec![DAffine3::IDENTITY; joints.len()],
        Some(_) => {
            let count = document.root.accessors.len();
            let accessor = index(document, skin, "inverseBindMatrices", &place, count)?;
            let place = format!("{place}.inverseBindMatrices");
            let matrices = reader.read_matrices(accessor, &place)?;
            if matrices.len() < joints.len() {
                return Err(fault(format!(
                    ".inverseBindMatrices: {} matrices for {} joints",
                    matrices.len(),
                    joints.len()
                )));
            }
            let affine = |(joint, matrix): (usize, &[f32; 16])| {
                let matrix = DMat4::from_cols_array(&matrix.map(f64::from));
                let last_row = matrix.row(3) - glam::DVec4::W;
                // Written so that a NaN is refused too.
                if matrix.is_finite() && last_row.abs().max_element() <= 1e-6 {
                    Ok(DAffine3::from_mat4(matrix))
                } else {
                    Err(fault(format!(
                        ".inverseBindMatrices: matrix {joint} is not finite, or its last row is not 0 0 0 1"
                    )))
                }
            };
            matrices
                .iter()
                .take(joints.len())
                .enumerate()
                .map(affine)
                .collect::<Result<_, _>>()?
        }
    };
    Ok(Skin {
        name: name_of(skin, format!("skin {at}")),
        joints,
        joint_from_mesh,
    })
}

/// Reads all animations.
pub fn import_animations(
    document: &Document<'_>,
    reader: &Reader<'_>,
    nodes: &[Node],
    meshes: &[Mesh],
    notes: &mut Notes,
) -> Result<Vec<Animation>, SceneError> {
    let mut left_out = 0;
    let mut values = 0;
    let mut animations = Vec::new();
    for (at, raw) in document.motion.animations.iter().enumerate() {
        let mut import = Import {
            document,
            reader,
            place: format!("animations[{at}]"),
            samplers: raw.get("samplers").and_then(Value::as_array),
            nodes,
            meshes,
        };
        let mut clip = Animation {
            name: name_of(raw, format!("animation {at}")),
            ..Animation::default()
        };
        let channels = raw.get("channels").and_then(Value::as_array);
        for (channel_index, channel) in channels.into_iter().flatten().enumerate() {
            match import.channel(&mut clip, channel_index, channel)? {
                Some(count) => values += count,
                None => left_out += 1,
            }
            if values > MAX_VALUES {
                return Err(document.fault(format!(
                    "animations: more than {MAX_VALUES} numbers; split or thin out the keyframes"
                )));
            }
        }
        if !clip.nodes.is_empty() {
            animations.push(clip);
        }
    }
    if left_out > 0 {
        notes.source.left_out.push(LeftOut::new(
            "animation channels",
            format!("{left_out} channels move no node's transform or weights, and are not played"),
        ));
    }
    Ok(animations)
}

struct Import<'a> {
    document: &'a Document<'a>,
    reader: &'a Reader<'a>,
    place: String,
    samplers: Option<&'a Vec<Value>>,
    nodes: &'a [Node],
    meshes: &'a [Mesh],
}

impl Import<'_> {
    /// Reads a channel into its node's tracks; says how many numbers it holds, or `None` if it moves no node.
    fn channel(
        &mut self,
        clip: &mut Animation,
        at: usize,
        channel: &Value,
    ) -> Result<Option<usize>, SceneError> {
        let place = format!("{}.channels[{at}]", self.place);
        let fault = |what: &str| self.document.fault(format!("{place}: {what}"));
        let target = channel
            .get("target")
            .ok_or_else(|| fault("has no target"))?;
        let path = target.get("path").and_then(Value::as_str);
        let path = path.ok_or_else(|| fault("its target has no path"))?;
        // Section 5.7: a channel without a node is left to extensions.
        if target.get("node").is_none() || path == "pointer" {
            return Ok(None);
        }
        let node_place = format!("{place}.target");
        let node = index(self.document, target, "node", &node_place, self.nodes.len())?;
        let width = match path {
            "translation" | "scale" => 3,
            "rotation" => 4,
            "weights" => self.targets_of(node).ok_or_else(|| {
                fault("animates morph weights of a node whose mesh has no morph targets")
            })?,
            _ => {
                return Err(fault(
                    "path must be translation, rotation, scale or weights",
                ));
            }
        };
        let source = self.document.root.nodes.get(node);
        if path != "weights" && source.is_some_and(|source| source.matrix.is_some()) {
            return Err(fault(
                "animates a node that has a matrix; give the node translation, rotation and scale",
            ));
        }
        let count = self.samplers.map_or(0, Vec::len);
        let sampler = index(self.document, channel, "sampler", &place, count)?;
        let track = self.track(sampler, width)?;
        let numbers = track.values.len() + track.times_s.len();
        clip.length_s = clip
            .length_s
            .max(track.times_s.last().copied().unwrap_or_default());
        let tracks = match clip.nodes.iter().position(|tracks| tracks.node == node) {
            Some(at) => &mut clip.nodes[at],
            None => {
                clip.nodes.push(NodeTracks {
                    node,
                    rest: self.nodes[node].parts.unwrap_or_default(),
                    translation: None,
                    rotation: None,
                    scale: None,
                    weights: None,
                });
                let last = clip.nodes.len() - 1;
                &mut clip.nodes[last]
            }
        };
        let slot = match path {
            "translation" => &mut tracks.translation,
            "rotation" => &mut tracks.rotation,
            "scale" => &mut tracks.scale,
            _ => &mut tracks.weights,
        };
        if slot.replace(track).is_some() {
            return Err(fault(&format!(
                "a second channel for the {path} of node {node}"
            )));
        }
        Ok(Some(numbers))
    }

    fn targets_of(&self, node: usize) -> Option<usize> {
        let mesh = self.meshes.get(self.nodes.get(node)?.mesh?)?;
        (!mesh.targets.is_empty()).then_some(mesh.targets.len())
    }

    fn track(&self, at: usize, width: usize) -> Result<Track, SceneError> {
        let place = format!("{}.samplers[{at}]", self.place);
        let fault = |what: String| self.document.fault(format!("{place}{what}"));
        let Some(sampler) = self.samplers.and_then(|samplers| samplers.get(at)) else {
            return Err(fault(": missing".to_owned()));
        };
        let interpolation = match sampler.get("interpolation").map(Value::as_str) {
            None | Some(Some("LINEAR")) => Interpolation::Linear,
            Some(Some("STEP")) => Interpolation::Step,
            Some(Some("CUBICSPLINE")) => Interpolation::CubicSpline,
            Some(_) => {
                return Err(fault(
                    ".interpolation: must be LINEAR, STEP or CUBICSPLINE".to_owned(),
                ));
            }
        };
        let accessors = self.document.root.accessors.len();
        let accessor = |key| index(self.document, sampler, key, &place, accessors);
        let (input, output) = (accessor("input")?, accessor("output")?);
        let (_, times) = self
            .reader
            .read_floats(input, &[1], &format!("{place}.input"))?;
        let times_s: Vec<f64> = times.into_iter().map(f64::from).collect();
        if let Some(bad) = times_s
            .iter()
            .position(|time| !(*time >= 0.0 && time.is_finite()))
        {
            return Err(fault(format!(
                ".input: key {bad} is at {} s; times must be finite and not negative",
                times_s[bad]
            )));
        }
        if let Some(bad) = times_s.windows(2).position(|pair| pair[0] >= pair[1]) {
            return Err(fault(format!(
                ".input: times must ascend, but key {} is at {} s and the next at {} s",
                bad,
                times_s[bad],
                times_s[bad + 1]
            )));
        }
        // Weights are scalars, one after the other.
        let (components, values) =
            self.reader
                .read_floats(output, &[1, width], &format!("{place}.output"))?;
        let per_key = if interpolation == Interpolation::CubicSpline {
            3
        } else {
            1
        };
        let wanted = times_s.len() * per_key * width;
        let is_list = components == width || (components == 1 && self.is_scalar_list(width));
        if !is_list || values.len() != wanted {
            return Err(fault(format!(
                ".output: {} numbers do not fit {} keys of {per_key} x {width}",
                values.len(),
                times_s.len()
            )));
        }
        if let Some(bad) = values.iter().position(|value| !value.is_finite()) {
            return Err(fault(format!(".output: number {bad} is not finite")));
        }
        Ok(Track {
            times_s,
            values: values.into_iter().map(f64::from).collect(),
            width,
            interpolation,
        })
    }

    /// Numbers of vectors and quaternions come as such; only weights come one by one.
    fn is_scalar_list(&self, width: usize) -> bool {
        !matches!(width, 3 | 4) || self.meshes.iter().any(|mesh| mesh.targets.len() == width)
    }
}

/// What the scene's data say about motion.
pub fn summary(nodes: &[Node], meshes: &[Mesh], animations: &[Animation]) -> Motion {
    let mut animated: Vec<usize> = animations
        .iter()
        .flat_map(|clip| clip.nodes.iter().map(|tracks| tracks.node))
        .collect();
    animated.sort_unstable();
    animated.dedup();
    Motion {
        animations: animations.len(),
        animated_nodes: animated.len(),
        skinned_nodes: nodes.iter().filter(|node| node.skin.is_some()).count(),
        morph_meshes: meshes
            .iter()
            .filter(|mesh| !mesh.targets.is_empty())
            .count(),
        animated_morphs: animations
            .iter()
            .any(|clip| clip.nodes.iter().any(|tracks| tracks.weights.is_some())),
    }
}
