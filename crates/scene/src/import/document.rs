//! The JSON part of a glTF file, checked before anything reads it.

use std::fmt;
use std::path::Path;

use gltf::json;
use gltf::json::validation::{Checked, Error as Fault, Validate};
use serde::de::{Deserialize, Deserializer, Error as _, MapAccess, SeqAccess, Visitor};
use serde_json::Value;

use super::super::SceneError;
use stereolux_base::limits::{LoadBudget, product};

/// Keys whose integers are indices or enumerations of 32 bits. The `gltf` crate cuts larger numbers to 32 bits, so
/// that 4294967296 would silently mean 0. The accessors that a primitive's attributes and morph targets name stand under
/// keys of their own.
const INDEX_KEYS: [&str; 22] = [
    "buffer",
    "bufferView",
    "source",
    "sampler",
    "index",
    "texCoord",
    "mesh",
    "skin",
    "camera",
    "light",
    "scene",
    "material",
    "indices",
    "mode",
    "componentType",
    "nodes",
    "children",
    "target",
    "wrapS",
    "wrapT",
    "magFilter",
    "minFilter",
];

/// What a value of the JSON takes at most in its plain and its typed form, with the room that lists and tables grow into,
/// bytes.
const VALUE_BYTES: u64 = 256;
/// The same of an object, which has a table of its members.
const OBJECT_BYTES: u64 = 768;

/// Lists whose entries take more than their JSON, bytes each: in the scene, in the copies that edits are told by, in poses,
/// and packed for the device.
const ENTRY_BYTES: [(&str, u64); 3] = [("nodes", 1536), ("materials", 2048), ("meshes", 1024)];

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
    pub fn take(top: &mut serde_json::Map<String, Value>) -> Result<Self, String> {
        let mut list = |key: &str| match top.remove(key) {
            None => Ok(Vec::new()),
            Some(Value::Array(list)) => Ok(list),
            Some(_) => Err(format!("{key}: must be a list")),
        };
        let (animations, skins) = (list("animations")?, list("skins")?);
        let nodes = top.get_mut("nodes").and_then(Value::as_array_mut);
        let node_skins = nodes
            .into_iter()
            .flatten()
            .map(|node| node.as_object_mut()?.remove("skin"))
            .collect();
        Ok(Self {
            animations,
            skins,
            node_skins,
        })
    }
}

/// A parsed file.
pub struct Document<'a> {
    /// Where it came from; external resources resolve beside it.
    pub path: &'a Path,
    /// What all that is expanded asks first.
    pub budget: &'a LoadBudget,
    /// Typed content, without animations and skins.
    pub root: json::Root,
    /// The same as plain JSON: extensions that the typed form drops are read from here.
    pub raw: Value,
    /// Animations and skins.
    pub motion: RawMotion,
}

impl<'a> Document<'a> {
    /// Parses the JSON and checks versions and number ranges.
    pub fn parse(path: &'a Path, bytes: &[u8], budget: &'a LoadBudget) -> Result<Self, SceneError> {
        budget
            .take(parsed_bytes(bytes), "the values of the JSON")
            .map_err(|error| SceneError::over(path, &error))?;
        let Unique(mut raw) = serde_json::from_slice(bytes)
            .map_err(|error| SceneError::invalid(path, format!("not glTF: JSON error: {error}")))?;
        let Some(top) = raw.as_object_mut() else {
            return Err(SceneError::invalid(
                path,
                "not glTF: the JSON is not an object",
            ));
        };
        let stated = |key: &str| top.get("asset")?.get(key)?.as_str();
        let Some(version) = stated("version") else {
            return Err(SceneError::invalid(
                path,
                "not glTF 2.0: 'asset.version' is missing",
            ));
        };
        // Of later 2.x a reader of 2.0 understands what it must; `minVersion` says where that is not so (section 3.2).
        let needed = stated("minVersion").filter(|needed| *needed != "2.0");
        let major = version.split('.').next();
        if let Some(version) = needed.or((major != Some("2")).then_some(version)) {
            return Err(SceneError::invalid(
                path,
                format!("glTF version {version} is not supported; version 2.0 is"),
            ));
        }
        let motion = RawMotion::take(top).map_err(|what| SceneError::invalid(path, what))?;
        // A scene may leave its list of nodes out (glTF 2.0, section 5.27); gltf-json demands one.
        if let Some(scenes) = top.get_mut("scenes").and_then(Value::as_array_mut) {
            for scene in scenes.iter_mut().filter_map(Value::as_object_mut) {
                scene
                    .entry("nodes")
                    .or_insert_with(|| Value::Array(Vec::new()));
            }
        }
        strip_extras(&mut raw);
        for (list, bytes) in ENTRY_BYTES {
            let count = raw.get(list).and_then(Value::as_array).map_or(0, Vec::len) as u64;
            budget
                .take(product(&[count, bytes]), format_args!("{count} {list}"))
                .map_err(|error| SceneError::over(path, &error))?;
        }
        if let Some(place) = oversized_index(&raw, "", Meaning::Other) {
            return Err(SceneError::invalid(
                path,
                format!("{place}: index out of range"),
            ));
        }
        let root = json::Root::deserialize(&raw).map_err(|error| {
            SceneError::invalid(path, locate_structural_fault(&raw, &error.to_string()))
        })?;
        Ok(Self {
            path,
            budget,
            root,
            raw,
            motion,
        })
    }

    /// Checks every index and enumeration.
    pub fn validate(&self) -> Result<(), SceneError> {
        // The crate's own check of POSITION indexes without looking, so look first.
        let accessors = self.root.accessors.len();
        for (mesh_index, mesh) in self.root.meshes.iter().enumerate() {
            for (primitive_index, primitive) in mesh.primitives.iter().enumerate() {
                for (semantic, accessor) in &primitive.attributes {
                    if accessor.value() >= accessors {
                        let place = format!(
                            "meshes[{mesh_index}].primitives[{primitive_index}].attributes"
                        );
                        let name = match semantic {
                            Checked::Valid(semantic) => semantic.to_string(),
                            Checked::Invalid => "?".to_owned(),
                        };
                        return Err(self.fault(format!(
                            "{place}.{name}: accessor {} is out of range, there are {accessors}",
                            accessor.value()
                        )));
                    }
                }
            }
        }
        let mut first: Option<(String, Fault)> = None;
        self.root
            .validate(&self.root, json::Path::new, &mut |path, fault| {
                if first.is_none() && !is_tolerated(path().as_str(), fault) {
                    first = Some((path().as_str().to_owned(), fault));
                }
            });
        if let Some((place, fault)) = first {
            let place = as_in_the_file(&place);
            let what = match fault {
                Fault::IndexOutOfBounds => "index out of range",
                Fault::Invalid => "invalid value",
                Fault::Missing => "missing",
                Fault::Oversize => "larger than this machine can address",
                Fault::Unsupported => "extension is not supported",
            };
            let found =
                value_at(&self.raw, &place).filter(|value| !value.is_array() && !value.is_object());
            let found = found.map_or_else(String::new, |value| format!(" {value}"));
            return Err(self.fault(format!("{place}: {what}{found}")));
        }
        Ok(())
    }

    /// An error in this file.
    pub fn fault(&self, what: impl AsRef<str>) -> SceneError {
        SceneError::invalid(self.path, what)
    }

    /// Takes memory for good; `place` and `what` say what needs it.
    pub fn take(&self, bytes: u64, place: &str, what: impl fmt::Display) -> Result<(), SceneError> {
        self.budget
            .take(bytes, format_args!("{place}: {what}"))
            .map_err(|error| SceneError::over(self.path, &error))
    }

    /// The raw JSON at `list[index]`.
    pub fn raw_item(&self, list: &str, index: usize) -> Option<&Value> {
        self.raw.get(list)?.get(index)
    }
}

/// A place with extensions named as files do: the library calls `KHR_lights_punctual` `khrLightsPunctual`.
fn as_in_the_file(place: &str) -> String {
    let mut after_extensions = false;
    let named = place.split('.').map(|part| {
        let is_extension = std::mem::replace(&mut after_extensions, part == "extensions");
        let Some(end) = part.find(char::is_uppercase).filter(|_| is_extension) else {
            return part.to_owned();
        };
        let mut name = part[..end].to_uppercase();
        for letter in part[end..].chars() {
            if letter.is_uppercase() {
                name.push('_');
            }
            name.extend(letter.to_lowercase());
        }
        name
    });
    named.collect::<Vec<_>>().join(".")
}

/// What stands at a place such as `nodes[0].mesh`.
fn value_at<'a>(root: &'a Value, place: &str) -> Option<&'a Value> {
    let parts = place.split(['.', '[', ']']).filter(|part| !part.is_empty());
    parts.into_iter().try_fold(root, |value, part| match value {
        Value::Array(_) => value.get(part.parse::<usize>().ok()?),
        _ => value.get(part),
    })
}

/// Faults of the strict check that harm nothing here: the extent of POSITION is measured, accessors without a view
/// hold zeros, and textures without a source are left out with a warning of their own.
fn is_tolerated(place: &str, fault: Fault) -> bool {
    match fault {
        Fault::Missing => {
            place.ends_with("POSITION\"].min")
                || place.ends_with("POSITION\"].max")
                || place.ends_with(".bufferView")
                || (place.starts_with("textures[") && place.ends_with(".source"))
        }
        Fault::Invalid => place.ends_with("POSITION\"].min") || place.ends_with("POSITION\"].max"),
        Fault::Unsupported => true,
        Fault::IndexOutOfBounds | Fault::Oversize => false,
    }
}

fn strip_extras(value: &mut Value) {
    match value {
        Value::Object(object) => {
            object.remove("extras");
            object.values_mut().for_each(strip_extras);
        }
        Value::Array(list) => list.iter_mut().for_each(strip_extras),
        _ => {}
    }
}

/// What the numbers below a key are.
#[derive(Clone, Copy, PartialEq)]
enum Meaning {
    /// An index or an enumeration of 32 bits.
    Index,
    /// Accessors by semantic, as attributes and morph targets name them, or a list of such objects.
    Accessors,
    /// Anything else.
    Other,
}

impl Meaning {
    fn of(key: &str, parent: Self) -> Self {
        match key {
            _ if parent == Self::Accessors || INDEX_KEYS.contains(&key) => Self::Index,
            "attributes" | "targets" => Self::Accessors,
            _ => Self::Other,
        }
    }
}

/// Path of the first index that does not fit 32 bits.
fn oversized_index(value: &Value, place: &str, meaning: Meaning) -> Option<String> {
    match value {
        Value::Number(number) if meaning == Meaning::Index => {
            let too_large = number
                .as_u64()
                .is_some_and(|number| number > u64::from(u32::MAX));
            too_large.then(|| place.to_owned())
        }
        Value::Object(object) => object.iter().find_map(|(key, value)| {
            let place = if place.is_empty() {
                key.clone()
            } else {
                format!("{place}.{key}")
            };
            oversized_index(value, &place, Meaning::of(key, meaning))
        }),
        Value::Array(list) => list.iter().enumerate().find_map(|(index, value)| {
            oversized_index(value, &format!("{place}[{index}]"), meaning)
        }),
        _ => None,
    }
}

/// What JSON text takes when it is parsed, bytes: its values are told by the marks between them, outside of strings.
fn parsed_bytes(text: &[u8]) -> u64 {
    let (mut bytes, mut in_string, mut is_escaped) = (3 * text.len() as u64, false, false);
    for byte in text {
        match byte {
            _ if is_escaped => is_escaped = false,
            b'\\' => is_escaped = in_string,
            b'"' => in_string = !in_string,
            b'{' if !in_string => bytes = bytes.saturating_add(OBJECT_BYTES),
            b',' | b':' | b'[' if !in_string => bytes = bytes.saturating_add(VALUE_BYTES),
            _ => {}
        }
    }
    bytes
}

/// JSON in which no object has a key twice: readers differ in which of the two they take.
struct Unique(Value);

/// Whole numbers below 2^53 are their own as f64.
const MOST_EXACT: f64 = 9_007_199_254_740_992.0;

impl<'de> Deserialize<'de> for Unique {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(UniqueVisitor).map(Self)
    }
}

struct UniqueVisitor;

impl<'de> Visitor<'de> for UniqueVisitor {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("JSON")
    }

    fn visit_bool<E>(self, value: bool) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_i64<E>(self, value: i64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_u64<E>(self, value: u64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_f64<E>(self, value: f64) -> Result<Value, E> {
        // Integers may have a fraction of 0 or an exponent (glTF 2.0, section 2.7).
        let whole = value as i64;
        let is_whole = value.abs() < MOST_EXACT
            && whole as f64 == value
            && (whole != 0 || value.is_sign_positive());
        Ok(if is_whole { whole.into() } else { value.into() })
    }

    fn visit_str<E>(self, value: &str) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Value, A::Error> {
        let mut values = Vec::new();
        while let Some(Unique(value)) = list.next_element()? {
            values.push(value);
        }
        Ok(values.into())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut members: A) -> Result<Value, A::Error> {
        let mut object = serde_json::Map::new();
        while let Some(key) = members.next_key::<String>()? {
            if object.contains_key(&key) {
                return Err(A::Error::custom(format!(
                    "the key '{key}' stands twice in one object"
                )));
            }
            let Unique(value) = members.next_value()?;
            object.insert(key, value);
        }
        Ok(object.into())
    }
}

/// Says which list entry has the wrong shape: the parser of the whole file only says what is wrong.
fn locate_structural_fault(raw: &Value, whole: &str) -> String {
    fn probe<'a, T: Deserialize<'a>>(raw: &'a Value, list: &str) -> Option<String> {
        raw.get(list)?
            .as_array()?
            .iter()
            .enumerate()
            .find_map(|(index, item)| {
                let error = T::deserialize(item).err()?;
                Some(format!("{list}[{index}]: {error}"))
            })
    }
    probe::<json::Accessor>(raw, "accessors")
        .or_else(|| probe::<json::Buffer>(raw, "buffers"))
        .or_else(|| probe::<json::buffer::View>(raw, "bufferViews"))
        .or_else(|| probe::<json::Mesh>(raw, "meshes"))
        .or_else(|| probe::<json::Node>(raw, "nodes"))
        .or_else(|| probe::<json::Material>(raw, "materials"))
        .or_else(|| probe::<json::Texture>(raw, "textures"))
        .or_else(|| probe::<json::texture::Sampler>(raw, "samplers"))
        .or_else(|| probe::<json::Image>(raw, "images"))
        .or_else(|| probe::<json::Camera>(raw, "cameras"))
        .or_else(|| probe::<json::Scene>(raw, "scenes"))
        .unwrap_or_else(|| format!("not glTF 2.0: {whole}"))
}
