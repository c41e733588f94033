//! Writes binary glTF 2.0 with the features that the embedded scenes have.
//!
//! Positions, normals and texture coordinates are rounded to seven decimals before they become f32, so that the last
//! bit of a sine, which differs between mathematical libraries, does not change the file.

use glam::{DAffine3, DVec2, DVec3};
use image::RgbImage;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use serde_json::json;
use stereolux_scene::animation::{Interpolation, Track};
use stereolux_scene::gltf_writer::{
    Draft, INDICES, UNSIGNED_SHORT, VERTICES, number, numbers, put_light_kind,
};
use stereolux_scene::{Material, MorphTarget, PunctualLight, SceneError, VertexJoints, Wrap};

/// Triangles of one material, in object space, metres.
#[derive(Clone, Debug, Default)]
pub struct Part {
    /// Index from [`GlbWriter::material`].
    pub material: u32,
    /// One per vertex.
    pub positions: Vec<DVec3>,
    /// One per vertex, unit length.
    pub normals: Vec<DVec3>,
    /// One per vertex; empty for none. v points down the image.
    pub uvs: Vec<DVec2>,
    /// Counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// One per vertex; empty for none.
    pub joints: Vec<VertexJoints>,
    /// Morph targets: positions and normals, one of each per vertex.
    pub targets: Vec<MorphTarget>,
}

/// A channel of an animation.
#[derive(Clone, Debug)]
pub struct Channel<'a> {
    /// Index from [`GlbWriter::node`].
    pub node: u32,
    /// `translation`, `rotation`, `scale` or `weights`.
    pub path: &'a str,
    /// Keys.
    pub track: Track,
}

/// What hangs on a node beside its transform.
#[derive(Clone, Copy, Debug)]
pub enum Payload {
    /// Index from [`GlbWriter::mesh`].
    Mesh(u32),
    /// Index from [`GlbWriter::light`].
    Light(u32),
    /// Index from [`GlbWriter::camera`].
    Camera(u32),
}

/// Collects a scene and writes it as `.glb`.
#[derive(Debug, Default)]
pub struct GlbWriter {
    draft: Draft,
}

impl GlbWriter {
    /// An empty scene.
    pub fn new() -> Self {
        Self::default()
    }

    /// Embeds a picture as PNG and a texture that samples it, smoothly; returns the texture's index.
    pub fn texture(
        &mut self,
        name: &str,
        picture: &RgbImage,
        wrap: Wrap,
    ) -> Result<u32, SceneError> {
        let mut png = Vec::new();
        let (compression, filter) = (CompressionType::Default, FilterType::Adaptive);
        let encoder = PngEncoder::new_with_quality(&mut png, compression, filter);
        picture
            .write_with_encoder(encoder)
            .map_err(|error| SceneError::Write {
                what: format!("image '{name}': {error}"),
            })?;
        let view = self.draft.view(&png, None);
        let image = json!({ "name": name, "mimeType": "image/png", "bufferView": view });
        let mode = if wrap == Wrap::Repeat { 10_497 } else { 33_071 };
        let sampler = json!({ "magFilter": 9729, "minFilter": 9729, "wrapS": mode, "wrapT": mode });
        let sampler = self.draft.push("samplers", sampler);
        let source = self.draft.push("images", image);
        Ok(self
            .draft
            .push("textures", json!({ "sampler": sampler, "source": source })))
    }

    /// Adds a material of factors and a picture of its base colour, whose index [`GlbWriter::texture`] gave.
    pub fn material(&mut self, material: &Material) -> u32 {
        let mut pbr = json!({
            "baseColorFactor": numbers(&material.base_color),
            "metallicFactor": number(material.metallic),
            "roughnessFactor": number(material.roughness),
        });
        if let Some(texture) = material.base_color_texture {
            pbr["baseColorTexture"] = json!({ "index": texture.texture });
        }
        let mut value = json!({ "name": material.name, "pbrMetallicRoughness": pbr });
        let mut extensions = Vec::new();
        if material.is_emissive() {
            // The factor is limited to 0..1, the strength is not.
            let strength = material.emission.iter().copied().fold(1.0_f32, f32::max);
            value["emissiveFactor"] = numbers(&material.emission.map(|channel| channel / strength));
            let strength = json!({ "emissiveStrength": number(strength) });
            extensions.push(("KHR_materials_emissive_strength", strength));
        }
        if material.double_sided {
            value["doubleSided"] = json!(true);
        }
        if material.specular != 1.0 {
            let specular = json!({
                "specularFactor": number(material.specular),
                "specularColorFactor": numbers(&material.specular_color),
            });
            extensions.push(("KHR_materials_specular", specular));
        }
        if material.transmission > 0.0 {
            let transmission = json!({ "transmissionFactor": number(material.transmission) });
            extensions.push(("KHR_materials_transmission", transmission));
            let volume = json!({
                "thicknessFactor": number(material.thickness),
                "attenuationColor": numbers(&material.attenuation_color),
            });
            extensions.push(("KHR_materials_volume", volume));
        }
        for (name, extension) in extensions {
            self.draft.extensions_used.insert(name.to_owned());
            value["extensions"][name] = extension;
        }
        self.draft.push("materials", value)
    }

    /// Adds a mesh of one primitive per part.
    pub fn mesh(&mut self, name: &str, parts: &[Part]) -> u32 {
        let draft = &mut self.draft;
        let mut primitives = Vec::with_capacity(parts.len());
        for part in parts {
            let vec3s = |of: &[DVec3]| of.iter().map(on_grid).collect::<Vec<_>>();
            let mut attributes = json!({
                "POSITION": draft.floats(&vec3s(&part.positions), true, VERTICES),
                "NORMAL": draft.floats(&vec3s(&part.normals), false, VERTICES),
            });
            if !part.uvs.is_empty() {
                let uvs = part.uvs.iter().map(|uv| uv.to_array().map(round));
                let uvs: Vec<_> = uvs.collect();
                attributes["TEXCOORD_0"] = json!(draft.floats(&uvs, false, VERTICES));
            }
            let corners = part.triangles.as_flattened().iter();
            assert!(part.positions.len() <= 1 << 16, "corners have 16 bits");
            let corners: Vec<_> = corners.map(|corner| [*corner as u16]).collect();
            let indices = draft.integers(&corners, UNSIGNED_SHORT, INDICES);
            if !part.joints.is_empty() {
                let joints: Vec<_> = part.joints.iter().map(|vertex| vertex.joints).collect();
                let weights: Vec<_> = part.joints.iter().map(|vertex| vertex.weights).collect();
                attributes["JOINTS_0"] = json!(draft.integers(&joints, UNSIGNED_SHORT, VERTICES));
                attributes["WEIGHTS_0"] = json!(draft.floats(&weights, false, VERTICES));
            }
            let mut primitive =
                json!({ "attributes": attributes, "indices": indices, "material": part.material });
            if !part.targets.is_empty() {
                let targets = part.targets.iter().map(|target| {
                    let positions = draft.floats(&target.positions, true, VERTICES);
                    let normals = draft.floats(&target.normals, false, VERTICES);
                    json!({ "POSITION": positions, "NORMAL": normals })
                });
                primitive["targets"] = targets.collect();
            }
            primitives.push(primitive);
        }
        draft.push("meshes", json!({ "name": name, "primitives": primitives }))
    }

    /// Adds a punctual light.
    pub fn light(&mut self, light: &PunctualLight) -> u32 {
        let used = &mut self.draft.extensions_used;
        used.insert("KHR_lights_punctual".to_owned());
        let intensity = light.intensity.iter().copied().fold(0.0_f32, f32::max);
        let color = numbers(&light.intensity.map(|channel| channel / intensity));
        let mut value =
            json!({ "name": light.name, "color": color, "intensity": number(intensity) });
        put_light_kind(&mut value, light.kind);
        self.draft.push("lights", value)
    }

    /// Adds a perspective camera with the given full vertical angle, square pictures.
    pub fn camera(&mut self, name: &str, yfov_rad: f32) -> u32 {
        let camera = json!({
            "name": name,
            "type": "perspective",
            "perspective": { "aspectRatio": 1.0, "yfov": number(yfov_rad), "znear": 0.01 },
        });
        self.draft.push("cameras", camera)
    }

    /// Adds a root node, which may carry nothing: a joint; returns its index. The transform must be a translation, rotation
    /// and scaling without shear.
    pub fn node(
        &mut self,
        name: &str,
        world_from_node: DAffine3,
        payload: impl Into<Option<Payload>>,
    ) -> u32 {
        let (scale, rotation, translation) = world_from_node.to_scale_rotation_translation();
        let mut value = json!({ "name": name });
        if translation != DVec3::ZERO {
            value["translation"] = numbers(&on_grid(&translation));
        }
        let rotation = rotation.to_array().map(round);
        if rotation != [0.0, 0.0, 0.0, 1.0] {
            value["rotation"] = numbers(&rotation);
        }
        let scale = on_grid(&scale);
        if scale != [1.0; 3] {
            value["scale"] = numbers(&scale);
        }
        match payload.into() {
            None => {}
            Some(Payload::Mesh(index)) => value["mesh"] = json!(index),
            Some(Payload::Camera(index)) => value["camera"] = json!(index),
            Some(Payload::Light(index)) => {
                value["extensions"] = json!({ "KHR_lights_punctual": { "light": index } })
            }
        }
        self.draft.push("nodes", value)
    }

    /// Hangs nodes under another one; their transforms then lead to it.
    pub fn adopt(&mut self, parent: u32, children: &[u32]) {
        self.draft.set(parent, "children", json!(children));
    }

    /// Gives a node's mesh a skin: joints, and for each the matrix from the mesh's space to its own.
    pub fn skin(&mut self, node: u32, joints: &[u32], joint_from_mesh: &[DAffine3]) {
        let matrices: Vec<[f32; 16]> = joint_from_mesh
            .iter()
            .map(|matrix| glam::DMat4::from(*matrix).to_cols_array().map(round))
            .collect();
        let matrices = self.draft.floats(&matrices, false, None);
        let skin = json!({ "joints": joints, "inverseBindMatrices": matrices });
        let skin = self.draft.push("skins", skin);
        self.draft.set(node, "skin", json!(skin));
    }

    /// Adds an animation.
    pub fn animation(&mut self, name: &str, channels: &[Channel<'_>]) {
        let (mut samplers, mut targets) = (Vec::new(), Vec::new());
        for channel in channels {
            let track = &channel.track;
            let interpolation = match track.interpolation {
                Interpolation::Step => "STEP",
                Interpolation::Linear => "LINEAR",
                Interpolation::CubicSpline => "CUBICSPLINE",
            };
            let times: Vec<[f32; 1]> = track.times_s.iter().map(|time| [round(*time)]).collect();
            let values: Vec<f32> = track.values.iter().map(|value| round(*value)).collect();
            let input = self.draft.floats(&times, true, None);
            let output = match channel.path {
                "rotation" => self.draft.floats(values.as_chunks::<4>().0, false, None),
                "weights" => self.draft.floats(values.as_chunks::<1>().0, false, None),
                _ => self.draft.floats(values.as_chunks::<3>().0, false, None),
            };
            targets.push(json!({
                "sampler": samplers.len(),
                "target": { "node": channel.node, "path": channel.path },
            }));
            samplers
                .push(json!({ "input": input, "output": output, "interpolation": interpolation }));
        }
        self.draft.push(
            "animations",
            json!({ "name": name, "samplers": samplers, "channels": targets }),
        );
    }

    /// The finished file.
    ///
    /// # Errors
    /// More than 4 GiB of data.
    pub fn finish(self, name: &str) -> Result<Vec<u8>, SceneError> {
        self.draft.finish(json!({ "name": name }))
    }
}

/// Rounds to seven decimals, and turns -0 into 0.
fn round(value: f64) -> f32 {
    ((value * 1e7).round() / 1e7 + 0.0) as f32
}

fn on_grid(v: &DVec3) -> [f32; 3] {
    v.to_array().map(round)
}
