//! Skins and animations, read from the plain JSON: the typed form refuses channels without a node.

use std::collections::HashMap;

use glam::{DAffine3, DMat4};
use serde_json::Value;

use super::super::animation::{Animation, Interpolation, NodeTracks, Track};
use super::super::needs::Motion;
use super::super::{Mesh, Node, SceneError, Skin};
use super::Notes;
use super::accessors::Reader;
use super::document::Document;

/// A list of the plain JSON; empty where there is none.
fn list_of<'a>(
    document: &Document<'_>,
    object: &'a Value,
    key: &str,
    place: &str,
) -> Result<&'a [Value], SceneError> {
    match object.get(key) {
        None => Ok(&[]),
        Some(Value::Array(list)) => Ok(list),
        Some(_) => Err(document.fault(format!("{place}.{key}: must be a list"))),
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
    let greatest: Vec<Option<u16>> = meshes.iter().map(greatest_joint).collect();
    for (at, skin) in raw.node_skins.iter().enumerate() {
        let (Some(skin), Some(node)) = (skin, nodes.get_mut(at)) else {
            continue;
        };
        let place = format!("nodes[{at}] '{}'.skin", node.name);
        let skin = in_range(document, skin, &place, skins.len())?;
        let Some((mesh, index)) = node
            .mesh
            .and_then(|index| Some((meshes.get(index)?, index)))
        else {
            notes.warn(format_args!("{place}: the node has no mesh for a skin"));
            continue;
        };
        if mesh.joints.is_empty() {
            notes.warn(format_args!(
                "{place}: mesh '{}' has no JOINTS_0 and WEIGHTS_0 and stays rigid",
                mesh.name
            ));
            continue;
        }
        let joints = skins[skin].joints.len();
        if let Some(joint) = greatest[index].filter(|joint| usize::from(*joint) >= joints) {
            return Err(document.fault(format!(
                "{place}: mesh '{}' names joint {joint}, the skin has {joints}",
                mesh.name
            )));
        }
        node.skin = Some(skin);
    }
    Ok(skins)
}

/// The greatest joint that moves a vertex of a mesh.
fn greatest_joint(mesh: &Mesh) -> Option<u16> {
    let used = mesh.joints.iter().flat_map(|vertex| {
        let influences = vertex.joints.into_iter().zip(vertex.weights);
        influences.filter(|(_, weight)| *weight > 0.0)
    });
    used.map(|(joint, _)| joint).max()
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
    let joints = list_of(document, skin, "joints", &place)?
        .iter()
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
    let mut animations = Vec::new();
    for (at, raw) in document.motion.animations.iter().enumerate() {
        let place = format!("animations[{at}]");
        let mut import = Import {
            document,
            reader,
            samplers: list_of(document, raw, "samplers", &place)?,
            nodes,
            meshes,
            clip: Animation {
                name: name_of(raw, format!("animation {at}")),
                number: at,
                ..Animation::default()
            },
            tracks_of: HashMap::new(),
            place,
        };
        let channels = list_of(document, raw, "channels", &import.place)?;
        for (index, channel) in channels.iter().enumerate() {
            left_out += usize::from(!import.channel(index, channel)?);
        }
        if !import.clip.nodes.is_empty() {
            animations.push(import.clip);
        }
    }
    if left_out > 0 {
        notes.leave_out(
            "animation channels",
            format!("{left_out} channels move no node's transform or weights, and are not played"),
        );
    }
    Ok(animations)
}

/// One animation on its way in.
struct Import<'a> {
    document: &'a Document<'a>,
    reader: &'a Reader<'a>,
    place: String,
    samplers: &'a [Value],
    nodes: &'a [Node],
    meshes: &'a [Mesh],
    clip: Animation,
    /// Where a node's tracks stand in the clip.
    tracks_of: HashMap<usize, usize>,
}

impl Import<'_> {
    /// Reads a channel into its node's tracks; false if it moves no node.
    fn channel(&mut self, at: usize, channel: &Value) -> Result<bool, SceneError> {
        let place = format!("{}.channels[{at}]", self.place);
        let fault = |what: &str| self.document.fault(format!("{place}: {what}"));
        let target = channel
            .get("target")
            .ok_or_else(|| fault("has no target"))?;
        let path = target.get("path").and_then(Value::as_str);
        let path = path.ok_or_else(|| fault("its target has no path"))?;
        // Section 5.7: a channel without a node is left to extensions.
        if target.get("node").is_none() || path == "pointer" {
            return Ok(false);
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
        let count = self.samplers.len();
        let sampler = index(self.document, channel, "sampler", &place, count)?;
        // Weights are scalars, one after the other.
        let components = if path == "weights" { 1 } else { width };
        let track = self.track(sampler, components, width)?;
        let clip = &mut self.clip;
        clip.length_s = clip
            .length_s
            .max(track.times_s.last().copied().unwrap_or_default());
        let at = *self.tracks_of.entry(node).or_insert_with(|| {
            clip.nodes.push(NodeTracks {
                node,
                translation: None,
                rotation: None,
                scale: None,
                weights: None,
            });
            clip.nodes.len() - 1
        });
        let tracks = &mut clip.nodes[at];
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
        Ok(true)
    }

    fn targets_of(&self, node: usize) -> Option<usize> {
        let mesh = self.meshes.get(self.nodes.get(node)?.mesh?)?;
        (!mesh.targets.is_empty()).then_some(mesh.targets.len())
    }

    fn track(&self, at: usize, components: usize, width: usize) -> Result<Track, SceneError> {
        let place = format!("{}.samplers[{at}]", self.place);
        let fault = |what: String| self.document.fault(format!("{place}{what}"));
        let Some(sampler) = self.samplers.get(at) else {
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
        let (_, values) =
            self.reader
                .read_floats(output, &[components], &format!("{place}.output"))?;
        let per_key = if interpolation == Interpolation::CubicSpline {
            3
        } else {
            1
        };
        let wanted = times_s.len() * per_key * width;
        if values.len() != wanted {
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
