//! The JSON part of a glTF file, checked before anything reads it.

use std::path::Path;

use gltf::json;
use gltf::json::validation::{Checked, Error as Fault, Validate};
use serde_json::Value;

use super::super::SceneError;
use super::motion::RawMotion;

/// Keys whose integers are indices or enumerations of 32 bits. The `gltf` crate cuts larger numbers to 32 bits, so
/// that 4294967296 would silently mean 0.
const INDEX_KEYS: [&str; 17] = [
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
];

/// A parsed file.
pub struct Document<'a> {
    /// Where it came from; external resources resolve beside it.
    pub path: &'a Path,
    /// Typed content, without animations and skins.
    pub root: json::Root,
    /// The same as plain JSON: extensions that the typed form drops are read from here.
    pub raw: Value,
    /// Animations and skins.
    pub motion: RawMotion,
}

impl<'a> Document<'a> {
    /// Parses the JSON and checks versions and number ranges.
    pub fn parse(path: &'a Path, bytes: &[u8]) -> Result<Self, SceneError> {
        let mut raw: Value = serde_json::from_slice(bytes)
            .map_err(|error| SceneError::invalid(path, format!("not glTF: JSON error: {error}")))?;
        let Some(top) = raw.as_object_mut() else {
            return Err(SceneError::invalid(
                path,
                "not glTF: the JSON is not an object",
            ));
        };
        let version = top
            .get("asset")
            .and_then(|asset| asset.get("version"))
            .and_then(Value::as_str);
        match version {
            None => {
                return Err(SceneError::invalid(
                    path,
                    "not glTF 2.0: 'asset.version' is missing",
                ));
            }
            Some(version) if version.split('.').next() != Some("2") => {
                return Err(SceneError::invalid(
                    path,
                    format!("glTF version {version} is not supported; version 2.0 is"),
                ));
            }
            Some(_) => {}
        }
        let motion = RawMotion::take(top);
        // A scene may leave its list of nodes out (glTF 2.0, section 5.27); gltf-json demands one.
        if let Some(scenes) = top.get_mut("scenes").and_then(Value::as_array_mut) {
            for scene in scenes.iter_mut().filter_map(Value::as_object_mut) {
                scene
                    .entry("nodes")
                    .or_insert_with(|| Value::Array(Vec::new()));
            }
        }
        strip_extras(&mut raw);
        if let Some(place) = oversized_index(&raw, "", false) {
            return Err(SceneError::invalid(
                path,
                format!("{place}: index out of range"),
            ));
        }
        let root: json::Root = json::deserialize::from_value(raw.clone()).map_err(|error| {
            SceneError::invalid(path, locate_structural_fault(&raw, &error.to_string()))
        })?;
        Ok(Self {
            path,
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
            let what = match fault {
                Fault::IndexOutOfBounds => "index out of range",
                Fault::Invalid => "invalid value",
                Fault::Missing => "missing",
                Fault::Oversize => "larger than this machine can address",
                Fault::Unsupported => "extension is not supported",
            };
            return Err(self.fault(format!("{place}: {what}")));
        }
        Ok(())
    }

    /// An error in this file.
    pub fn fault(&self, what: impl AsRef<str>) -> SceneError {
        SceneError::invalid(self.path, what)
    }

    /// The raw JSON at `list[index]`.
    pub fn raw_item(&self, list: &str, index: usize) -> Option<&Value> {
        self.raw.get(list)?.get(index)
    }
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

/// Path of the first index that does not fit 32 bits.
fn oversized_index(value: &Value, place: &str, is_index: bool) -> Option<String> {
    match value {
        Value::Number(number) if is_index => {
            let too_large = number
                .as_u64()
                .is_some_and(|number| number > u64::from(u32::MAX));
            too_large.then(|| place.to_owned())
        }
        Value::Object(object) => object.iter().find_map(|(key, value)| {
            let is_index = INDEX_KEYS.contains(&key.as_str()) || place.ends_with(".attributes");
            let place = if place.is_empty() {
                key.clone()
            } else {
                format!("{place}.{key}")
            };
            oversized_index(value, &place, is_index)
        }),
        Value::Array(list) => list.iter().enumerate().find_map(|(index, value)| {
            oversized_index(value, &format!("{place}[{index}]"), is_index)
        }),
        _ => None,
    }
}

/// Says which list entry has the wrong shape: the parser of the whole file only says what is wrong.
fn locate_structural_fault(raw: &Value, whole: &str) -> String {
    fn probe<T: serde::de::DeserializeOwned>(raw: &Value, list: &str) -> Option<String> {
        raw.get(list)?
            .as_array()?
            .iter()
            .enumerate()
            .find_map(|(index, item)| {
                let error = json::deserialize::from_value::<T>(item.clone()).err()?;
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
