//! Writes binary glTF 2.0 with the features that the importer reads.
//!
//! Positions, normals and texture coordinates are rounded to seven decimals before they become f32, so that the last
//! bit of a sine, which differs between mathematical libraries, does not change the file.

use glam::{DAffine3, DVec2, DVec3};
use serde_json::{Value, json};
use stereolux_scene::animation::{Interpolation, Track};
use stereolux_scene::gltf_writer::{assemble, number, numbers, put_light_kind};
use stereolux_scene::{
    AlphaMode, Filter, Material, MorphTarget, PunctualLight, SceneError, TextureRef, VertexJoints,
    Wrap,
};

/// Triangles of one material, in object space, metres.
#[derive(Clone, Debug, Default)]
pub struct Part {
    /// Index from [`GlbWriter::material`].
    pub material: u32,
    /// One per vertex.
    pub positions: Vec<DVec3>,
    /// One per vertex, unit length; empty for flat shading.
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
    bin: Vec<u8>,
    accessors: Vec<Value>,
    animations: Vec<Value>,
    has_parent: Vec<bool>,
    skins: Vec<Value>,
    buffer_views: Vec<Value>,
    cameras: Vec<Value>,
    images: Vec<Value>,
    lights: Vec<Value>,
    materials: Vec<Value>,
    meshes: Vec<Value>,
    nodes: Vec<Value>,
    samplers: Vec<Value>,
    textures: Vec<Value>,
    extensions_used: Vec<&'static str>,
}

/// glTF's enumerations (glTF 2.0, sections 5.1 and 5.26).
const FLOAT: u32 = 5126;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34_962;
const ELEMENT_ARRAY_BUFFER: u32 = 34_963;

impl GlbWriter {
    /// An empty scene.
    pub fn new() -> Self {
        Self::default()
    }

    /// Embeds an 8-bit RGB picture as PNG and a texture that samples it; returns the texture's index.
    ///
    /// # Errors
    /// `rgb` does not hold `width * height * 3` bytes.
    pub fn texture(
        &mut self,
        name: &str,
        width: u32,
        height: u32,
        rgb: &[u8],
        wrap: Wrap,
        filter: Filter,
    ) -> Result<u32, SceneError> {
        use image::codecs::png::{CompressionType, FilterType, PngEncoder};
        use image::{ExtendedColorType, ImageEncoder};
        let mut png = Vec::new();
        if rgb.len() != width as usize * height as usize * 3 {
            return Err(SceneError::Write {
                what: format!("image '{name}' is not {width}x{height} RGB"),
            });
        }
        PngEncoder::new_with_quality(&mut png, CompressionType::Default, FilterType::Adaptive)
            .write_image(rgb, width, height, ExtendedColorType::Rgb8)
            .map_err(|error| SceneError::Write {
                what: format!("image '{name}': {error}"),
            })?;
        let view = self.view(&png, None);
        self.images
            .push(json!({ "name": name, "mimeType": "image/png", "bufferView": view }));
        let mode = match wrap {
            Wrap::Repeat => 10_497,
            Wrap::Mirror => 33_648,
            Wrap::Clamp => 33_071,
        };
        let (magnify, minify) = match filter {
            Filter::Nearest => (9728, 9728),
            Filter::Linear => (9729, 9729),
        };
        self.samplers.push(
            json!({ "magFilter": magnify, "minFilter": minify, "wrapS": mode, "wrapT": mode }),
        );
        self.textures
            .push(json!({ "sampler": self.samplers.len() - 1, "source": self.images.len() - 1 }));
        Ok(self.textures.len() as u32 - 1)
    }

    /// Adds a material; its texture indices are those that [`GlbWriter::texture`] gave.
    pub fn material(&mut self, material: &Material) -> u32 {
        let defaults = Material::default();
        let mut pbr = json!({
            "baseColorFactor": numbers(&material.base_color),
            "metallicFactor": number(material.metallic),
            "roughnessFactor": number(material.roughness),
        });
        self.slot(&mut pbr, "baseColorTexture", material.base_color_texture);
        self.slot(
            &mut pbr,
            "metallicRoughnessTexture",
            material.metallic_roughness_texture,
        );
        let mut value = json!({ "name": material.name, "pbrMetallicRoughness": pbr });
        self.slot(&mut value, "normalTexture", material.normal_texture);
        if material.normal_texture.is_some() && material.normal_scale != 1.0 {
            value["normalTexture"]["scale"] = number(material.normal_scale);
        }
        self.slot(&mut value, "emissiveTexture", material.emissive_texture);
        let mut extensions = json!({});
        if material.is_emissive() {
            // The factor is limited to 0..1, the strength is not.
            let strength = material.emission.iter().copied().fold(1.0_f32, f32::max);
            value["emissiveFactor"] = numbers(&material.emission.map(|channel| channel / strength));
            if strength > 1.0 {
                extensions["KHR_materials_emissive_strength"] =
                    json!({ "emissiveStrength": number(strength) });
            }
        }
        match material.alpha_mode {
            AlphaMode::Opaque => {}
            AlphaMode::Mask { cutoff } => {
                value["alphaMode"] = json!("MASK");
                value["alphaCutoff"] = number(cutoff);
            }
            AlphaMode::Blend => value["alphaMode"] = json!("BLEND"),
        }
        if material.double_sided {
            value["doubleSided"] = json!(true);
        }
        if material.ior != defaults.ior {
            extensions["KHR_materials_ior"] = json!({ "ior": number(material.ior) });
        }
        let has_specular = material.specular != defaults.specular
            || material.specular_color != defaults.specular_color
            || material.specular_texture.is_some()
            || material.specular_color_texture.is_some();
        if has_specular {
            let mut specular = json!({
                "specularFactor": number(material.specular),
                "specularColorFactor": numbers(&material.specular_color),
            });
            self.slot(&mut specular, "specularTexture", material.specular_texture);
            self.slot(
                &mut specular,
                "specularColorTexture",
                material.specular_color_texture,
            );
            extensions["KHR_materials_specular"] = specular;
        }
        if material.transmission > 0.0 {
            let mut transmission = json!({ "transmissionFactor": number(material.transmission) });
            self.slot(
                &mut transmission,
                "transmissionTexture",
                material.transmission_texture,
            );
            extensions["KHR_materials_transmission"] = transmission;
        }
        if material.thickness > 0.0 || material.attenuation_distance_m.is_finite() {
            let mut volume = json!({ "thicknessFactor": number(material.thickness), "attenuationColor": numbers(&material.attenuation_color) });
            if material.attenuation_distance_m.is_finite() {
                volume["attenuationDistance"] = number(material.attenuation_distance_m);
            }
            extensions["KHR_materials_volume"] = volume;
        }
        for name in [
            "KHR_materials_emissive_strength",
            "KHR_materials_ior",
            "KHR_materials_specular",
            "KHR_materials_transmission",
            "KHR_materials_volume",
        ] {
            if extensions.get(name).is_some() {
                self.uses(name);
            }
        }
        if extensions
            .as_object()
            .is_some_and(|extensions| !extensions.is_empty())
        {
            value["extensions"] = extensions;
        }
        self.materials.push(value);
        self.materials.len() as u32 - 1
    }

    /// Adds a mesh of one primitive per part.
    ///
    /// # Errors
    /// A part whose arrays differ in length, or whose triangles name missing vertices.
    pub fn mesh(&mut self, name: &str, parts: &[Part]) -> Result<u32, SceneError> {
        let mut primitives = Vec::with_capacity(parts.len());
        for part in parts {
            let count = part.positions.len();
            let fits = |length: usize| length == 0 || length == count;
            let in_range = part
                .triangles
                .as_flattened()
                .iter()
                .all(|vertex| (*vertex as usize) < count);
            if count == 0
                || !fits(part.normals.len())
                || !fits(part.uvs.len())
                || !fits(part.joints.len())
                || part
                    .targets
                    .iter()
                    .any(|target| target.positions.len() != count || target.normals.len() != count)
                || !in_range
                || part.triangles.is_empty()
            {
                return Err(SceneError::Write {
                    what: format!(
                        "mesh '{name}' has a part without triangles or with arrays that do not fit"
                    ),
                });
            }
            let positions: Vec<[f32; 3]> = part.positions.iter().map(on_grid).collect();
            let mut attributes = json!({ "POSITION": self.floats(&positions, "VEC3", true) });
            if !part.normals.is_empty() {
                let normals: Vec<[f32; 3]> = part.normals.iter().map(on_grid).collect();
                attributes["NORMAL"] = json!(self.floats(&normals, "VEC3", false));
            }
            if !part.uvs.is_empty() {
                let uvs: Vec<[f32; 2]> = part
                    .uvs
                    .iter()
                    .map(|uv| [round(uv.x), round(uv.y)])
                    .collect();
                attributes["TEXCOORD_0"] = json!(self.floats(&uvs, "VEC2", false));
            }
            let indices = self.indices(part.triangles.as_flattened(), count);
            if !part.joints.is_empty() {
                let (joints, weights) = self.joints(&part.joints);
                attributes["JOINTS_0"] = json!(joints);
                attributes["WEIGHTS_0"] = json!(weights);
            }
            let mut primitive =
                json!({ "attributes": attributes, "indices": indices, "material": part.material });
            if !part.targets.is_empty() {
                let targets: Vec<Value> = part
                    .targets
                    .iter()
                    .map(|target| {
                        let positions = self.floats(&target.positions, "VEC3", true);
                        let normals = self.floats(&target.normals, "VEC3", false);
                        json!({ "POSITION": positions, "NORMAL": normals })
                    })
                    .collect();
                primitive["targets"] = Value::Array(targets);
            }
            primitives.push(primitive);
        }
        self.meshes
            .push(json!({ "name": name, "primitives": primitives }));
        Ok(self.meshes.len() as u32 - 1)
    }

    /// Adds a punctual light.
    pub fn light(&mut self, light: &PunctualLight) -> u32 {
        self.uses("KHR_lights_punctual");
        let intensity = light.intensity.iter().copied().fold(0.0_f32, f32::max);
        let color = if intensity > 0.0 {
            light.intensity.map(|channel| channel / intensity)
        } else {
            [1.0; 3]
        };
        let mut value =
            json!({ "name": light.name, "color": numbers(&color), "intensity": number(intensity) });
        put_light_kind(&mut value, light.kind);
        self.lights.push(value);
        self.lights.len() as u32 - 1
    }

    /// Adds a perspective camera with the given full vertical angle, square pictures.
    pub fn camera(&mut self, name: &str, yfov_rad: f32) -> u32 {
        self.cameras.push(json!({
            "name": name,
            "type": "perspective",
            "perspective": { "aspectRatio": 1.0, "yfov": number(yfov_rad), "znear": 0.01 },
        }));
        self.cameras.len() as u32 - 1
    }

    /// Adds a root node; returns its index. The transform must be a translation, rotation and scaling without shear.
    pub fn node(&mut self, name: &str, world_from_node: DAffine3, payload: Payload) -> u32 {
        self.bare_node(name, world_from_node, Some(payload))
    }

    /// Adds a root node that may carry nothing, for joints.
    pub fn bare_node(
        &mut self,
        name: &str,
        world_from_node: DAffine3,
        payload: Option<Payload>,
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
        match payload {
            None => {}
            Some(Payload::Mesh(index)) => value["mesh"] = json!(index),
            Some(Payload::Camera(index)) => value["camera"] = json!(index),
            Some(Payload::Light(index)) => {
                value["extensions"] = json!({ "KHR_lights_punctual": { "light": index } })
            }
        }
        self.nodes.push(value);
        self.has_parent.push(false);
        self.nodes.len() as u32 - 1
    }

    /// Hangs nodes under another one; their transforms then lead to it.
    pub fn adopt(&mut self, parent: u32, children: &[u32]) {
        for child in children {
            if let Some(has_parent) = self.has_parent.get_mut(*child as usize) {
                *has_parent = true;
            }
        }
        if let Some(node) = self.nodes.get_mut(parent as usize) {
            node["children"] = json!(children);
        }
    }

    /// Gives a node's mesh a skin: joints, and for each the matrix from the mesh's space to its own.
    pub fn skin(&mut self, node: u32, joints: &[u32], joint_from_mesh: &[DAffine3]) {
        let matrices: Vec<[f32; 16]> = joint_from_mesh
            .iter()
            .map(|matrix| glam::DMat4::from(*matrix).to_cols_array().map(round))
            .collect();
        let matrices = self.plain_floats(&matrices, "MAT4", false);
        self.skins
            .push(json!({ "joints": joints, "inverseBindMatrices": matrices }));
        if let Some(node) = self.nodes.get_mut(node as usize) {
            node["skin"] = json!(self.skins.len() - 1);
        }
    }

    /// Adds an animation.
    ///
    /// # Errors
    /// A track whose values do not fit its keys.
    pub fn animation(&mut self, name: &str, channels: &[Channel<'_>]) -> Result<(), SceneError> {
        let (mut samplers, mut targets) = (Vec::new(), Vec::new());
        for channel in channels {
            let track = &channel.track;
            let (interpolation, per_key) = match track.interpolation {
                Interpolation::Step => ("STEP", 1),
                Interpolation::Linear => ("LINEAR", 1),
                Interpolation::CubicSpline => ("CUBICSPLINE", 3),
            };
            let fits = track.values.len() == track.times_s.len() * per_key * track.width;
            if track.times_s.is_empty() || !fits {
                return Err(SceneError::Write {
                    what: format!(
                        "animation '{name}' has a track whose values do not fit its keys"
                    ),
                });
            }
            let times: Vec<[f32; 1]> = track.times_s.iter().map(|time| [round(*time)]).collect();
            let values: Vec<f32> = track.values.iter().map(|value| round(*value)).collect();
            let input = self.plain_floats(&times, "SCALAR", true);
            let output = match channel.path {
                "rotation" => self.plain_floats(values.as_chunks::<4>().0, "VEC4", false),
                "weights" => self.plain_floats(values.as_chunks::<1>().0, "SCALAR", false),
                _ => self.plain_floats(values.as_chunks::<3>().0, "VEC3", false),
            };
            targets.push(json!({
                "sampler": samplers.len(),
                "target": { "node": channel.node, "path": channel.path },
            }));
            samplers
                .push(json!({ "input": input, "output": output, "interpolation": interpolation }));
        }
        self.animations
            .push(json!({ "name": name, "samplers": samplers, "channels": targets }));
        Ok(())
    }

    fn joints(&mut self, joints: &[VertexJoints]) -> (usize, usize) {
        let bytes: Vec<u8> = joints
            .iter()
            .flat_map(|vertex| vertex.joints)
            .flat_map(u16::to_le_bytes)
            .collect();
        let view = self.view(&bytes, Some(ARRAY_BUFFER));
        self.accessors.push(json!({ "bufferView": view, "componentType": UNSIGNED_SHORT, "count": joints.len(), "type": "VEC4" }));
        let first = self.accessors.len() - 1;
        let weights: Vec<[f32; 4]> = joints.iter().map(|vertex| vertex.weights).collect();
        (first, self.floats(&weights, "VEC4", false))
    }

    /// The finished file.
    ///
    /// # Errors
    /// More than 4 GiB of data.
    pub fn finish(mut self, name: &str) -> Result<Vec<u8>, SceneError> {
        pad(&mut self.bin, 0);
        let roots: Vec<usize> = (0..self.nodes.len())
            .filter(|node| !self.has_parent[*node])
            .collect();
        let mut root = json!({
            "asset": { "version": "2.0", "generator": "stereolux" },
            "scene": 0,
            "scenes": [{ "name": name, "nodes": roots }],
            "nodes": self.nodes,
        });
        if !self.lights.is_empty() {
            root["extensions"] = json!({ "KHR_lights_punctual": { "lights": self.lights } });
        }
        self.extensions_used.sort_unstable();
        let lists = [
            (
                "extensionsUsed",
                self.extensions_used.into_iter().map(Value::from).collect(),
            ),
            ("meshes", self.meshes),
            ("materials", self.materials),
            ("textures", self.textures),
            ("samplers", self.samplers),
            ("images", self.images),
            ("cameras", self.cameras),
            ("skins", self.skins),
            ("animations", self.animations),
            ("accessors", self.accessors),
            ("bufferViews", self.buffer_views),
        ];
        for (key, list) in lists {
            // glTF forbids empty lists.
            if !list.is_empty() {
                root[key] = Value::Array(list);
            }
        }
        if !self.bin.is_empty() {
            root["buffers"] = json!([{ "byteLength": self.bin.len() }]);
        }
        assemble(root.to_string().into_bytes(), self.bin)
    }

    fn uses(&mut self, extension: &'static str) {
        if !self.extensions_used.contains(&extension) {
            self.extensions_used.push(extension);
        }
    }

    fn slot(&mut self, object: &mut Value, key: &str, texture: Option<TextureRef>) {
        let Some(texture) = texture else { return };
        let mut value = json!({ "index": texture.texture });
        if texture.uv_set != 0 {
            value["texCoord"] = json!(texture.uv_set);
        }
        let [su, sin_v, tu, sin_u, sv, tv] = texture.texcoord_from_uv;
        if texture.texcoord_from_uv != TextureRef::IDENTITY && sin_u == 0.0 && sin_v == 0.0 {
            self.uses("KHR_texture_transform");
            value["extensions"] = json!({ "KHR_texture_transform": { "offset": numbers(&[tu, tv]), "scale": numbers(&[su, sv]) } });
        }
        object[key] = value;
    }

    fn view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        pad(&mut self.bin, 0);
        let mut view =
            json!({ "buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len() });
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.bin.extend_from_slice(bytes);
        self.buffer_views.push(view);
        self.buffer_views.len() - 1
    }

    fn floats<const N: usize>(
        &mut self,
        elements: &[[f32; N]],
        kind: &str,
        with_bounds: bool,
    ) -> usize {
        self.floats_for(elements, kind, with_bounds, Some(ARRAY_BUFFER))
    }

    /// Numbers that are no vertex attributes.
    fn plain_floats<const N: usize>(
        &mut self,
        elements: &[[f32; N]],
        kind: &str,
        with_bounds: bool,
    ) -> usize {
        self.floats_for(elements, kind, with_bounds, None)
    }

    fn floats_for<const N: usize>(
        &mut self,
        elements: &[[f32; N]],
        kind: &str,
        with_bounds: bool,
        target: Option<u32>,
    ) -> usize {
        let bytes: Vec<u8> = elements
            .as_flattened()
            .iter()
            .flat_map(|value| value.to_le_bytes())
            .collect();
        let view = self.view(&bytes, target);
        let mut accessor = json!({ "bufferView": view, "componentType": FLOAT, "count": elements.len(), "type": kind });
        if with_bounds {
            let extreme = |pick: fn(f32, f32) -> f32| -> Vec<Value> {
                (0..N)
                    .map(|axis| {
                        number(
                            elements
                                .iter()
                                .map(|element| element[axis])
                                .fold(elements[0][axis], pick),
                        )
                    })
                    .collect()
            };
            accessor["min"] = Value::Array(extreme(f32::min));
            accessor["max"] = Value::Array(extreme(f32::max));
        }
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    fn indices(&mut self, indices: &[u32], vertex_count: usize) -> usize {
        // 65535 itself is reserved (primitive restart).
        let is_short = vertex_count <= 65_535;
        let bytes: Vec<u8> = if is_short {
            indices
                .iter()
                .flat_map(|index| (*index as u16).to_le_bytes())
                .collect()
        } else {
            indices
                .iter()
                .flat_map(|index| index.to_le_bytes())
                .collect()
        };
        let view = self.view(&bytes, Some(ELEMENT_ARRAY_BUFFER));
        let component = if is_short {
            UNSIGNED_SHORT
        } else {
            UNSIGNED_INT
        };
        self.accessors.push(json!({ "bufferView": view, "componentType": component, "count": indices.len(), "type": "SCALAR" }));
        self.accessors.len() - 1
    }
}

fn pad(bytes: &mut Vec<u8>, filler: u8) {
    bytes.resize(bytes.len().next_multiple_of(4), filler);
}

/// Rounds to seven decimals, and turns -0 into 0.
fn round(value: f64) -> f32 {
    ((value * 1e7).round() / 1e7 + 0.0) as f32
}

fn on_grid(v: &DVec3) -> [f32; 3] {
    [round(v.x), round(v.y), round(v.z)]
}
