//! Binary glTF of what is made by formulas.

use glam::{DMat3, DQuat, DVec3};
use serde_json::{Value, json};

use super::super::SceneError;
use super::super::gltf_writer::{Draft, INDICES, UNSIGNED_INT, UNSIGNED_SHORT, VERTICES};
use super::surface::Surface;

/// A file in the making: every surface is a mesh with a node of its own.
#[derive(Default)]
pub struct Glb(Draft);

impl Glb {
    /// Adds a surface with a glTF material.
    pub fn add(&mut self, name: &str, surface: &Surface, mut material: Value) {
        let draft = &mut self.0;
        material["name"] = json!(name);
        if let Some(extensions) = material["extensions"].as_object() {
            draft.extensions_used.extend(extensions.keys().cloned());
        }
        let vec3s = |values: &[DVec3]| -> Vec<[f32; 3]> {
            let values = values.iter();
            values.map(|value| value.as_vec3().to_array()).collect()
        };
        let mut attributes = json!({
            "POSITION": draft.floats(&vec3s(&surface.positions), true, VERTICES),
            "NORMAL": draft.floats(&vec3s(&surface.normals), false, VERTICES),
        });
        let corners = surface.triangles.as_flattened().as_chunks::<1>().0;
        let indices = draft.integers(corners, UNSIGNED_INT, INDICES);
        if !surface.colors.is_empty() {
            let word = |share: f64| (share.clamp(0.0, 1.0) * 65_535.0).round() as u16;
            let colors = surface.colors.iter();
            let colors = colors.map(|color| color.extend(1.0).to_array().map(word));
            let colors: Vec<_> = colors.collect();
            let mut accessor = draft.accessor(&colors, UNSIGNED_SHORT, VERTICES);
            accessor["normalized"] = json!(true);
            attributes["COLOR_0"] = json!(draft.push("accessors", accessor));
        }
        let material = draft.push("materials", material);
        let primitive =
            json!({ "attributes": attributes, "indices": indices, "material": material });
        let mesh = draft.push("meshes", json!({ "name": name, "primitives": [primitive] }));
        draft.push("nodes", json!({ "name": name, "mesh": mesh }));
    }

    /// Adds the camera that the head starts at.
    pub fn camera(&mut self, eye: DVec3, towards: DVec3, yfov_deg: f64) {
        let back = (eye - towards).normalize();
        let right = DVec3::Y.cross(back).normalize();
        let turned = DQuat::from_mat3(&DMat3::from_cols(right, back.cross(right), back));
        let perspective = json!({ "yfov": yfov_deg.to_radians(), "znear": 0.05 });
        let camera = json!({ "type": "perspective", "perspective": perspective });
        let node = json!({
            "name": "viewpoint", "camera": self.0.push("cameras", camera),
            "translation": eye.to_array(), "rotation": turned.to_array(),
        });
        self.0.push("nodes", node);
    }

    /// The file.
    ///
    /// # Errors
    /// As [`Draft::finish`].
    pub fn finish(self) -> Result<Vec<u8>, SceneError> {
        self.0.finish(json!({}))
    }
}

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
