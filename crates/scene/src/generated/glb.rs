//! Binary glTF of what is made by formulas.

use std::collections::BTreeSet;

use glam::{DMat3, DQuat, DVec3};
use serde_json::{Value, json};

use super::super::SceneError;
use super::super::gltf_writer::assemble;
use super::surface::Surface;

/// A file in the making: every surface is a mesh with a node of its own.
#[derive(Default)]
pub struct Glb {
    nodes: Vec<Value>,
    meshes: Vec<Value>,
    materials: Vec<Value>,
    extensions: BTreeSet<String>,
    cameras: Vec<Value>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    bytes: Vec<u8>,
}

impl Glb {
    /// Adds a surface with a glTF material.
    pub fn add(&mut self, name: &str, surface: &Surface, mut material: Value) {
        material["name"] = json!(name);
        if let Some(extensions) = material["extensions"].as_object() {
            self.extensions.extend(extensions.keys().cloned());
        }
        let vec3 = |values: &[DVec3]| -> Vec<u8> {
            let values = values.iter().flat_map(|value| value.as_vec3().to_array());
            values.flat_map(f32::to_le_bytes).collect()
        };
        let count = surface.positions.len();
        let least = surface
            .positions
            .iter()
            .fold(DVec3::INFINITY, |least, p| least.min(*p));
        let most = surface
            .positions
            .iter()
            .fold(DVec3::NEG_INFINITY, |most, p| most.max(*p));
        let positions = self.accessor(&vec3(&surface.positions), count, "VEC3", FLOAT);
        self.accessors[positions]["min"] = json!(least.as_vec3().to_array());
        self.accessors[positions]["max"] = json!(most.as_vec3().to_array());
        let normals = self.accessor(&vec3(&surface.normals), count, "VEC3", FLOAT);
        let corners: Vec<u8> = surface
            .triangles
            .iter()
            .flatten()
            .flat_map(|corner| corner.to_le_bytes())
            .collect();
        let indices = self.accessor(
            &corners,
            3 * surface.triangles.len(),
            "SCALAR",
            UNSIGNED_INT,
        );
        let mut attributes = json!({ "POSITION": positions, "NORMAL": normals });
        if !surface.colors.is_empty() {
            let shares = surface
                .colors
                .iter()
                .flat_map(|color| color.extend(1.0).to_array());
            let words = shares.map(|share| (share.clamp(0.0, 1.0) * 65_535.0).round() as u16);
            let colors: Vec<u8> = words.flat_map(u16::to_le_bytes).collect();
            let colors = self.accessor(&colors, count, "VEC4", UNSIGNED_SHORT);
            self.accessors[colors]["normalized"] = json!(true);
            attributes["COLOR_0"] = json!(colors);
        }
        let primitive = json!({ "attributes": attributes, "indices": indices, "material": self.materials.len() });
        self.nodes
            .push(json!({ "name": name, "mesh": self.meshes.len() }));
        self.meshes
            .push(json!({ "name": name, "primitives": [primitive] }));
        self.materials.push(material);
    }

    /// Adds the camera that the head starts at.
    pub fn camera(&mut self, eye: DVec3, towards: DVec3, yfov_deg: f64) {
        let back = (eye - towards).normalize();
        let right = DVec3::Y.cross(back).normalize();
        let turned = DQuat::from_mat3(&DMat3::from_cols(right, back.cross(right), back));
        self.nodes.push(json!({
            "name": "viewpoint", "camera": self.cameras.len(),
            "translation": eye.to_array(), "rotation": turned.to_array(),
        }));
        let perspective = json!({ "yfov": yfov_deg.to_radians(), "znear": 0.05 });
        self.cameras
            .push(json!({ "type": "perspective", "perspective": perspective }));
    }

    /// The file.
    ///
    /// # Errors
    /// As [`assemble`].
    pub fn finish(self) -> Result<Vec<u8>, SceneError> {
        let mut document = json!({
            "asset": { "version": "2.0", "generator": "stereolux" },
            "scene": 0,
            "scenes": [{ "nodes": (0..self.nodes.len()).collect::<Vec<_>>() }],
            "nodes": self.nodes, "meshes": self.meshes, "materials": self.materials, "cameras": self.cameras,
            "accessors": self.accessors, "bufferViews": self.views, "buffers": [{ "byteLength": self.bytes.len() }],
        });
        if !self.extensions.is_empty() {
            document["extensionsUsed"] = json!(self.extensions);
        }
        assemble(document.to_string().into_bytes(), self.bytes)
    }

    /// Appends values whose size is a multiple of four bytes; the accessor's number.
    fn accessor(&mut self, values: &[u8], count: usize, kind: &str, component: u32) -> usize {
        self.views.push(
            json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": values.len() }),
        );
        self.bytes.extend(values);
        let view = self.views.len() - 1;
        self.accessors.push(
            json!({ "bufferView": view, "count": count, "type": kind, "componentType": component }),
        );
        self.accessors.len() - 1
    }
}

const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
const FLOAT: u32 = 5126;

/// A Lambert surface.
pub fn lambert(color: [f64; 3]) -> Value {
    json!({
        "pbrMetallicRoughness": { "baseColorFactor": [color[0], color[1], color[2], 1.0], "metallicFactor": 0.0 },
        "extensions": { "KHR_materials_specular": { "specularFactor": 0.0 } },
    })
}

/// A body of glass or water: index of refraction, and what is left of white light after a distance.
pub fn body(ior: f64, roughness: f64, distance_m: f64, left: [f64; 3]) -> Value {
    json!({
        "pbrMetallicRoughness": { "metallicFactor": 0.0, "roughnessFactor": roughness },
        "extensions": {
            "KHR_materials_ior": { "ior": ior },
            "KHR_materials_transmission": { "transmissionFactor": 1.0 },
            "KHR_materials_volume": { "thicknessFactor": 1.0, "attenuationDistance": distance_m, "attenuationColor": left },
        },
    })
}
