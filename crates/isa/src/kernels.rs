//! Which kernels there are for a scene, and their SPIR-V.

use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;

use anyhow::{Context as _, Result};
use stereolux::frame::passes::{self, Domain, Pass};
use stereolux::frame::run::specialised;
use stereolux::gpu::kernel::{Binding, buffer_count, reflect_bindings};
use stereolux::gpu::spirv::module_words;
use stereolux::gpu::{CompiledShader, ShaderFeatures, ShaderLibrary};
use stereolux::renderer::{PlannedScene, plan_of_scene};
use stereolux::{
    AlphaMode, Environment, Method, RenderSettings, Scene, Texture, TextureImage, TextureRef,
    load_environment,
};

stereolux_base::words! {
    /// The frame that a kernel is a part of by default.
    #[derive(PartialOrd, Ord)]
    pub enum Frame: name {
        /// Of `run` with photons.
        Photon = "photon",
        /// Of `run` with the path tracer.
        Path = "path",
        /// None: a setting asks for it.
        Other = "other",
    }
}

/// A pass, specialised for a scene.
pub struct Kernel {
    /// Name of the scene.
    pub scene: String,
    /// The frame that it belongs to.
    pub frame: Frame,
    /// Name of the pass.
    pub pass: String,
    /// As it is compiled.
    pub shader: Arc<CompiledShader>,
}

/// Loads `NAME=SCENE[+SKY]`: `builtin:NAME`, `like:helmet` ([`like_helmet`]) or a glTF file, and an environment map.
pub fn load_scene(words: &str) -> Result<(String, Scene)> {
    let (name, source) = words
        .split_once('=')
        .with_context(|| format!("scene {words:?}: give NAME=SCENE or NAME=SCENE+SKY"))?;
    let (source, sky) = match source.split_once('+') {
        Some((source, sky)) => (source, Some(sky)),
        None => (source, None),
    };
    let mut scene = match (source.strip_prefix("builtin:"), source) {
        (Some(builtin), _) => Scene::builtin(builtin)?,
        (None, "like:helmet") => like_helmet()?,
        (None, file) => Scene::load(Path::new(file))?,
    };
    if let Some(sky) = sky {
        scene.environment = Some(load_environment(sky, 1.0)?.0);
    }
    Ok((name.to_owned(), scene))
}

/// What the shaders of a scanned object under a sky need, without the files: a surface with maps of base colour, metalness,
/// roughness and normals that may let light through, and a sky's light alone.
fn like_helmet() -> Result<Scene> {
    let mut scene = Scene::builtin("plane")?;
    for node in &mut scene.nodes {
        node.light = None;
    }
    scene.lights.clear();
    scene.images = vec![TextureImage {
        name: "grey".to_owned(),
        width: 1,
        height: 1,
        rgba8: vec![128, 128, 255, 255],
    }];
    scene.textures = vec![Texture::default()];
    let map = Some(TextureRef::plain(0));
    for material in &mut scene.materials {
        material.metallic = 1.0;
        // A visor.
        material.alpha_mode = AlphaMode::Blend;
        material.base_color_texture = map;
        material.metallic_roughness_texture = map;
        material.normal_texture = map;
    }
    scene.environment = Some(Environment {
        width: 2,
        height: 1,
        radiance: vec![[1.0; 3]; 2],
        name: "sky".to_owned(),
    });
    Ok(scene)
}

/// Every pass of the program, compute passes, as `scene` specialises them: those of `run`'s frame by either method, then
/// all others with the features of the frame of photons. `seen` has the texts that other scenes had already.
pub fn kernels_of(
    library: &ShaderLibrary,
    name: &str,
    scene: &Scene,
    seen: &mut HashSet<String>,
) -> Result<Vec<Kernel>> {
    let mut kernels = Vec::new();
    let mut add = |frame, pass: &Pass, features: &ShaderFeatures, from_list| -> Result<()> {
        let features = specialised(pass, features, from_list);
        let shader = library.compile(&pass.shader_name(), &features)?;
        if pass.over != Domain::Fragments && seen.insert(shader.wgsl.clone()) {
            kernels.push(Kernel {
                scene: name.to_owned(),
                frame,
                pass: pass.name.to_string(),
                shader,
            });
        }
        Ok(())
    };
    let mut in_frames = HashSet::new();
    let mut others = ShaderFeatures::default();
    for (frame, method) in [(Frame::Path, Method::Path), (Frame::Photon, Method::Photon)] {
        let mut settings = RenderSettings {
            method,
            ..RenderSettings::default()
        };
        settings.decide_switches(true);
        let PlannedScene {
            stages, features, ..
        } = plan_of_scene(scene, &settings, false)?;
        others = features;
        for step in stages.iter().flat_map(|stage| &stage.steps) {
            if let Some(pass) = step.pass() {
                add(frame, pass, &features, step.runs_from_list())?;
                in_frames.insert(pass.name.clone());
            }
        }
    }
    for pass in passes::ALL
        .iter()
        .filter(|pass| !in_frames.contains(&pass.name))
    {
        add(Frame::Other, pass, &others, true)?;
    }
    Ok(kernels)
}

impl Kernel {
    /// `scene pass`, for messages.
    pub fn name(&self) -> String {
        format!("{} {} ({})", self.scene, self.pass, self.frame.name())
    }

    /// Threads of a workgroup.
    pub fn group_threads(&self) -> u32 {
        let entries = self.shader.module.entry_points.iter();
        entries
            .map(|entry| entry.workgroup_size.iter().product())
            .max()
            .unwrap_or(1)
    }

    /// Bytes of the arrays in a thread's own memory that the pass declares: what it may keep in scratch.
    pub fn declared_bytes(&self) -> u32 {
        let module = &self.shader.module;
        let of = |variable: &naga::GlobalVariable| {
            let ty = &module.types[variable.ty].inner;
            let is_array = matches!(ty, naga::TypeInner::Array { .. });
            if is_array && variable.space == naga::AddressSpace::Private {
                ty.size(module.to_ctx())
            } else {
                0
            }
        };
        module.global_variables.iter().map(|(_, v)| of(v)).sum()
    }

    /// Buffers that the pass binds.
    pub fn buffers(&self) -> Result<usize> {
        Ok(buffer_count(&reflect_bindings(&self.shader)?))
    }

    /// SPIR-V as it goes to a driver of Vulkan 1.3 with robustness2, and the bindings in the order of their numbers.
    pub fn spirv(&self) -> Result<(Vec<u32>, Vec<Binding>)> {
        let bindings = reflect_bindings(&self.shader)?;
        let words = module_words(&self.shader, &bindings).with_context(|| self.name())?;
        Ok((words, bindings))
    }
}
