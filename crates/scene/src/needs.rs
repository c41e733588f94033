//! What a scene really needs from the renderer, and what of it is left out.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use stereolux_base::features::{PerFeature, ShaderFeatures, WORDS};

use super::{AlphaMode, Environment, LightKind, Material, Scene, SceneStatistics};

/// A metal below this roughness focuses light well enough for a caustic to show.
pub const CAUSTIC_ROUGHNESS: f32 = 0.3;

/// A feature of a scene that is not modelled, and why.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct LeftOut {
    /// Extension or feature.
    pub feature: String,
    /// What happens instead, or why it is not needed.
    pub why: String,
}

impl LeftOut {
    /// A feature and the reason.
    pub fn new(feature: impl Into<String>, why: impl Into<String>) -> Self {
        Self {
            feature: feature.into(),
            why: why.into(),
        }
    }
}

/// Motion that a file describes.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Motion {
    /// Animations in the file that move a node or morph weights.
    pub animations: usize,
    /// Nodes that an animation moves.
    pub animated_nodes: usize,
    /// Nodes whose mesh is skinned.
    pub skinned_nodes: usize,
    /// Meshes with morph targets.
    pub morph_meshes: usize,
    /// Whether an animation changes morph weights.
    pub animated_morphs: bool,
}

impl Motion {
    /// The most general kind of motion: `static`, `node`, `skin` or `morph`.
    pub fn kind(&self) -> &'static str {
        if self.animated_morphs {
            "morph"
        } else if self.skinned_nodes > 0 && self.animated_nodes > 0 {
            "skin"
        } else if self.animated_nodes > 0 {
            "node"
        } else {
            "static"
        }
    }
}

/// Numbers of lights by kind.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct LightCounts {
    /// Point lights.
    pub point: usize,
    /// Spot lights.
    pub spot: usize,
    /// Directional lights.
    pub directional: usize,
    /// Emissive triangles over all instances.
    pub emissive_triangles: usize,
}

/// The reduced list of what a scene uses. Only materials on placed triangles count.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Needs {
    /// BSDF kinds: `lambert`, `glossy`, `metal`, `dielectric`, `user`.
    pub bsdfs: Vec<&'static str>,
    /// Materials by texture use (`base_color`, `normal`, ...).
    pub textures_by_use: BTreeMap<&'static str, usize>,
    /// Any material reads coordinate set 1.
    pub uv1: bool,
    /// Any normal texture.
    pub normal_maps: bool,
    /// Lights by kind.
    pub lights: LightCounts,
    /// Alpha mask or blend that can let a ray through.
    pub alpha: bool,
    /// Vertex colours other than white.
    pub vertex_colors: bool,
    /// An environment map.
    pub environment: bool,
    /// A focusing surface, a diffuse one and a light.
    pub caustics: bool,
    /// Any surface of the glTF model that is not ideal Lambert.
    pub glossy: bool,
    /// Any surface that lets light through as glass does.
    pub dielectric: bool,
    /// Any of them a thin wall.
    pub thin_walls: bool,
    /// `static`, `node`, `skin` or `morph`: what the file describes.
    pub motion: &'static str,
    /// Names of the animations, for `animation.clip`.
    pub clips: Vec<String>,
    /// A placed mesh changes its shape, by a skin or by morph targets.
    pub deformation: bool,
    /// Triangles over all instances.
    pub triangles: usize,
    /// Triangles stored once per mesh.
    pub stored_triangles: usize,
    /// Placed meshes.
    pub instances: usize,
    /// Materials in use.
    pub materials: usize,
    /// Textures in use.
    pub textures: usize,
    /// Bytes of the decoded images.
    pub texture_bytes: usize,
    /// Materials in use that are other than ideal Lambert, by name.
    pub not_lambert: Vec<String>,
    /// What is not modelled for this scene, and why.
    pub left_out: Vec<LeftOut>,
    /// What caustics are made of: a light, a diffuse surface, a focusing one.
    #[serde(skip)]
    pub(crate) caustic_parts: [bool; 3],
    /// Any surface smooth enough to show an image, or glass.
    #[serde(skip)]
    pub mirrors: bool,
}

impl Needs {
    /// Looks through the whole scene once.
    pub fn of(scene: &Scene) -> Self {
        Self::with_statistics(scene, &SceneStatistics::of(scene))
    }

    /// As [`Needs::of`], from what is known of the scene's triangles: work in proportion to nodes and materials.
    pub fn with_statistics(scene: &Scene, statistics: &SceneStatistics) -> Self {
        let instances = scene.instances();
        let mut needs = Self {
            motion: scene.source.motion.kind(),
            clips: scene
                .animations
                .iter()
                .map(|clip| clip.name.clone())
                .collect(),
            deformation: instances.iter().any(|placed| scene.deforms(placed.node)),
            instances: instances.len(),
            ..Self::default()
        };

        let mut placed = vec![0_usize; scene.meshes.len()];
        for instance in &instances {
            placed[instance.mesh] += 1;
        }
        // Materials in use, and whether a vertex of theirs lets light through.
        let mut used: BTreeMap<usize, bool> = BTreeMap::new();
        let shown = statistics.meshes.iter().zip(placed);
        for (mesh, placed) in shown.filter(|(_, placed)| *placed > 0) {
            needs.stored_triangles += mesh.triangles;
            needs.triangles += mesh.triangles * placed;
            needs.vertex_colors |= mesh.has_tints;
            for part in &mesh.uses {
                *used.entry(part.material).or_default() |= part.is_translucent;
                if scene.materials[part.material].is_emissive() {
                    needs.lights.emissive_triangles += placed * part.triangles;
                }
            }
        }
        for light in scene.light_instances() {
            let light = &scene.lights[light.light];
            if light.intensity == [0.0; 3] {
                continue;
            }
            match light.kind {
                LightKind::Point => needs.lights.point += 1,
                LightKind::Spot { .. } => needs.lights.spot += 1,
                LightKind::Directional => needs.lights.directional += 1,
            }
        }
        needs.environment = scene.environment.as_ref().is_some_and(Environment::shines);

        let in_use = || used.keys().map(|index| &scene.materials[*index]);
        needs.materials = used.len();
        let mut textures = BTreeSet::new();
        for (material, is_translucent) in in_use().zip(used.values()) {
            needs.add_material(material);
            needs.alpha |= alpha_matters(scene, statistics, material, *is_translucent);
            let slots = material.texture_slots().into_iter();
            textures.extend(slots.filter_map(|(_, slot)| Some(slot?.texture as usize)));
        }
        needs.textures = textures.len();
        let images = textures.iter().map(|at| scene.textures[*at].image as usize);
        let images: BTreeSet<usize> = images.collect();
        needs.texture_bytes = images.iter().map(|at| scene.images[*at].rgba8.len()).sum();

        let is_lit = needs.lights != LightCounts::default() || needs.environment;
        let has_diffuse =
            in_use().any(|material| material.user_bsdf != 0 || material.has_base_layer());
        needs.caustic_parts = [is_lit, has_diffuse, in_use().any(focuses)];
        needs.caustics = needs.caustic_parts == [true; 3];
        needs.mirrors = in_use().any(mirrors);
        needs.left_out = scene.source.left_out.clone();
        needs.note_unneeded();
        needs
    }

    fn add_material(&mut self, material: &Material) {
        let mut kind = |kind| {
            if !self.bsdfs.contains(&kind) {
                self.bsdfs.push(kind);
            }
        };
        if material.user_bsdf != 0 {
            kind("user");
        } else if material.is_lambert() {
            kind("lambert");
        } else {
            if material.has_base_layer() {
                kind("glossy");
            }
            if material.metallic > 0.0 {
                kind("metal");
            }
            if material.is_dielectric() {
                kind("dielectric");
            }
        }
        // A user's model brings code of its own and needs none of the layer's.
        self.glossy |= !material.is_lambert() && material.user_bsdf == 0;
        self.dielectric |= material.is_dielectric() && material.user_bsdf == 0;
        self.thin_walls |= material.is_thin_wall() && material.user_bsdf == 0;
        if !material.is_lambert() {
            self.not_lambert.push(material.name.clone());
        }
        for (name, slot) in material.texture_slots() {
            let Some(slot) = slot else { continue };
            *self.textures_by_use.entry(name).or_default() += 1;
            self.uv1 |= slot.uv_set == 1;
            self.normal_maps |= name == "normal";
        }
    }

    /// Features that the renderer has and this scene does without.
    fn note_unneeded(&mut self) {
        let not_glossy = if self.bsdfs.contains(&"user") {
            "every surface is ideal Lambert or has a user BSDF"
        } else {
            "every surface is ideal Lambert"
        };
        let reasons = PerFeature {
            glossy: Some(not_glossy),
            dielectric: Some("no surface is transmissive"),
            thin_walls: Some("no glass is a thin wall"),
            textures: Some("no material has a texture"),
            normal_maps: Some("no material has a normal texture"),
            alpha: Some("no surface has alpha mask or blend"),
            vertex_colors: Some("no mesh has vertex colours other than white"),
            emitters: Some("no triangle emits light"),
            points: Some("there is no point light"),
            spots: Some("there is no spot light"),
            directionals: Some("there is no directional light"),
            environment: Some("no environment is set"),
            caustics: Some("caustics need a smooth surface, a diffuse surface and a light"),
            uv1: Some("no texture reads coordinate set 1"),
            deformation: Some("no mesh has a skin or morph targets"),
            ..PerFeature::default()
        };
        let left_out = WORDS.zip(reasons, |word, why| Some(LeftOut::new(word, why?)));
        let absent = ShaderFeatures::ALL.without(self.shader_features());
        self.left_out.extend(absent.select(left_out).flatten());
    }

    fn has_textures(&self, name: &str) -> bool {
        self.textures_by_use.contains_key(name)
    }

    /// Needs of shaders once `part` is shown as well; surroundings, names and counts are the scene's own.
    #[must_use]
    pub fn widened_by(&self, part: &Self) -> Self {
        let mut both = self.clone();
        both.glossy |= part.glossy;
        both.dielectric |= part.dielectric;
        both.thin_walls |= part.thin_walls;
        both.textures_by_use.extend(&part.textures_by_use);
        both.uv1 |= part.uv1;
        both.normal_maps |= part.normal_maps;
        both.alpha |= part.alpha;
        both.vertex_colors |= part.vertex_colors;
        both.deformation |= part.deformation;
        both.lights.point += part.lights.point;
        both.lights.spot += part.lights.spot;
        both.lights.directional += part.lights.directional;
        both.lights.emissive_triangles += part.lights.emissive_triangles;
        for (there, more) in both.caustic_parts.iter_mut().zip(part.caustic_parts) {
            *there |= more;
        }
        both.caustics = both.caustic_parts == [true; 3];
        both.mirrors |= part.mirrors;
        both
    }

    /// The shader features that the scene needs; all others are off.
    pub fn shader_features(&self) -> ShaderFeatures {
        ShaderFeatures {
            glossy: self.glossy,
            dielectric: self.dielectric,
            thin_walls: self.thin_walls,
            textures: !self.textures_by_use.is_empty(),
            base_color_maps: self.has_textures("base_color"),
            metallic_roughness_maps: self.has_textures("metallic_roughness"),
            emissive_maps: self.has_textures("emissive"),
            specular_maps: self.has_textures("specular"),
            specular_color_maps: self.has_textures("specular_color"),
            transmission_maps: self.has_textures("transmission"),
            normal_maps: self.normal_maps,
            alpha: self.alpha,
            vertex_colors: self.vertex_colors,
            emitters: self.lights.emissive_triangles > 0,
            points: self.lights.point > 0,
            spots: self.lights.spot > 0,
            directionals: self.lights.directional > 0,
            environment: self.environment,
            caustics: self.caustics,
            uv1: self.uv1,
            deformation: self.deformation,
            ..ShaderFeatures::default()
        }
    }
}

/// Whether the surface gathers light into a caustic: smooth metal or what reflects like it, or glass.
fn focuses(material: &Material) -> bool {
    let is_metal_like = material.metallic > 0.0 || material.has_metal_like_layer();
    mirrors(material) && (is_metal_like || material.is_dielectric())
}

/// Whether the surface may show what it reflects or lets through: glass, or any layer that is smooth somewhere.
fn mirrors(material: &Material) -> bool {
    let is_smooth =
        material.roughness < CAUSTIC_ROUGHNESS || material.metallic_roughness_texture.is_some();
    let reflects = !material.is_lambert() && is_smooth;
    material.user_bsdf == 0 && (material.is_dielectric() || reflects)
}

/// Whether any ray can pass: something must bring alpha below the cutoff, or below 1 for blending.
fn alpha_matters(
    scene: &Scene,
    statistics: &SceneStatistics,
    material: &Material,
    translucent_vertices: bool,
) -> bool {
    let cutoff = match material.alpha_mode {
        AlphaMode::Opaque => return false,
        AlphaMode::Mask { cutoff } => cutoff,
        AlphaMode::Blend => 1.0,
    };
    let texture_alpha = material.base_color_texture.map_or(1.0, |slot| {
        let image = scene.textures[slot.texture as usize].image as usize;
        let least = statistics.least_alpha(image, scene.images.get(image));
        f32::from(least) / 255.0
    });
    translucent_vertices || material.base_color[3] * texture_alpha < cutoff
}
