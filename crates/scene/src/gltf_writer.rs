//! What binary glTF 2.0 is written with.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet, HashSet};

use bytemuck::Pod;
use gltf::binary::{Glb, Header};
use serde_json::{Value, json};

use super::{LightKind, SceneError};

/// Component types of accessors (glTF 2.0, section 5.1.3).
pub const UNSIGNED_SHORT: u32 = 5123;
/// As [`UNSIGNED_SHORT`].
pub const UNSIGNED_INT: u32 = 5125;
const FLOAT: u32 = 5126;
/// What a device takes the bytes of a view for (section 5.11.5): vertices.
pub const VERTICES: Option<u32> = Some(34_962);
/// As [`VERTICES`]: their numbers.
pub const INDICES: Option<u32> = Some(34_963);

/// A file in the making: lists of its document, and the bytes of its only buffer.
#[derive(Debug, Default)]
pub struct Draft {
    bin: Vec<u8>,
    /// glTF forbids empty ones.
    lists: BTreeMap<&'static str, Vec<Value>>,
    /// Names of extensions.
    pub extensions_used: BTreeSet<String>,
}

/// The order of a draft's lists in the file, behind nodes and lights.
const LISTS: [&str; 10] = [
    "meshes",
    "materials",
    "textures",
    "samplers",
    "images",
    "cameras",
    "skins",
    "animations",
    "accessors",
    "bufferViews",
];

impl Draft {
    /// Appends to one of the document's lists, `lights` among them; returns the index.
    pub fn push(&mut self, list: &'static str, value: Value) -> u32 {
        let list = self.lists.entry(list).or_default();
        list.push(value);
        list.len() as u32 - 1
    }

    /// Appends bytes; returns the index of the buffer view.
    pub fn view(&mut self, bytes: &[u8], target: Option<u32>) -> u32 {
        pad(&mut self.bin);
        let mut view =
            json!({ "buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len() });
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.bin.extend_from_slice(bytes);
        self.push("bufferViews", view)
    }

    /// Appends floats; returns the index of the accessor.
    pub fn floats<const N: usize>(
        &mut self,
        elements: &[[f32; N]],
        with_bounds: bool,
        target: Option<u32>,
    ) -> u32 {
        let mut accessor = self.accessor(elements, FLOAT, target);
        if with_bounds {
            for (key, pick) in [("min", f32::min as fn(f32, f32) -> f32), ("max", f32::max)] {
                let extreme = |axis| elements.iter().map(|of| of[axis]).reduce(pick);
                let extremes = (0..N).filter_map(extreme).map(number);
                accessor[key] = extremes.collect();
            }
        }
        self.push("accessors", accessor)
    }

    /// Appends integers; returns the index of the accessor.
    pub fn integers<T: Pod, const N: usize>(
        &mut self,
        elements: &[[T; N]],
        component: u32,
        target: Option<u32>,
    ) -> u32 {
        let accessor = self.accessor(elements, component, target);
        self.push("accessors", accessor)
    }

    /// Appends values of a component type, and describes them.
    pub fn accessor<T: Pod, const N: usize>(
        &mut self,
        elements: &[[T; N]],
        component: u32,
        target: Option<u32>,
    ) -> Value {
        let kind = match N {
            1 => "SCALAR",
            2 => "VEC2",
            3 => "VEC3",
            4 => "VEC4",
            _ => "MAT4",
        };
        let view = self.view(bytemuck::cast_slice(elements.as_flattened()), target);
        json!({ "bufferView": view, "componentType": component, "count": elements.len(), "type": kind })
    }

    /// Sets a member of a node that was pushed.
    pub fn set(&mut self, node: u32, key: &str, value: Value) {
        if let Some(nodes) = self.lists.get_mut("nodes") {
            nodes[node as usize][key] = value;
        }
    }

    /// The file; its only scene is `scene` with all nodes that are nobody's children.
    ///
    /// # Errors
    /// As [`assemble`].
    pub fn finish(mut self, mut scene: Value) -> Result<Vec<u8>, SceneError> {
        pad(&mut self.bin);
        let nodes = self.lists.remove("nodes").unwrap_or_default();
        let children = nodes
            .iter()
            .filter_map(|node| node.get("children")?.as_array());
        let children: HashSet<_> = children.flatten().filter_map(Value::as_u64).collect();
        let roots = (0..nodes.len() as u64).filter(|node| !children.contains(node));
        scene["nodes"] = roots.collect();
        let mut root = json!({
            "asset": { "version": "2.0", "generator": "stereolux" },
            "scene": 0,
            "scenes": [scene],
            "nodes": nodes,
        });
        if let Some(lights) = self.lists.remove("lights") {
            root["extensions"] = json!({ "KHR_lights_punctual": { "lights": lights } });
        }
        if !self.extensions_used.is_empty() {
            root["extensionsUsed"] = json!(self.extensions_used);
        }
        for key in LISTS {
            if let Some(list) = self.lists.remove(key) {
                root[key] = Value::Array(list);
            }
        }
        root["buffers"] = json!([{ "byteLength": self.bin.len() }]);
        assemble(root.to_string().into_bytes(), self.bin)
    }
}

fn pad(bytes: &mut Vec<u8>) {
    bytes.resize(bytes.len().next_multiple_of(4), 0);
}

/// A `.glb` of its two chunks.
///
/// # Errors
/// [`SceneError::Write`] beyond 4 GiB.
pub fn assemble(json: Vec<u8>, bin: Vec<u8>) -> Result<Vec<u8>, SceneError> {
    let file = Glb {
        header: Header {
            magic: *b"glTF",
            version: 2,
            // Counted where it is written.
            length: 0,
        },
        json: Cow::Owned(json),
        bin: (!bin.is_empty()).then_some(Cow::Owned(bin)),
    };
    // Lengths that do not fit would be cut to 32 bits.
    let fits = |file: &Vec<u8>| u32::try_from(file.len()).is_ok();
    let file = file.to_vec().ok().filter(fits);
    file.ok_or_else(|| SceneError::Write {
        what: "the scene is larger than 4 GiB".to_owned(),
    })
}

/// Writes the kind of a punctual light into its glTF object, over another kind if need be.
pub fn put_light_kind(value: &mut Value, kind: LightKind) {
    match kind {
        LightKind::Point => value["type"] = json!("point"),
        LightKind::Directional => value["type"] = json!("directional"),
        LightKind::Spot {
            inner_cone_rad,
            outer_cone_rad,
        } => {
            value["type"] = json!("spot");
            if !value["spot"].is_object() {
                value["spot"] = json!({});
            }
            value["spot"]["innerConeAngle"] = number(inner_cone_rad);
            value["spot"]["outerConeAngle"] = number(outer_cone_rad);
            return;
        }
    }
    if let Some(object) = value.as_object_mut() {
        object.shift_remove("spot");
    }
}

/// The shortest decimal that reads back as this f32.
pub fn number(value: f32) -> Value {
    json!(value.to_string().parse::<f64>().unwrap_or_default())
}

/// As [`number`].
pub fn numbers(values: &[f32]) -> Value {
    Value::Array(values.iter().map(|value| number(*value)).collect())
}
