//! The reference that the error view compares with: path traced, one frame at a time, while nothing else changes.

use super::render_engine::{EngineError, animate, library, mean_of};
use crate::gpu::{Gate, GpuContext, ShaderLibrary};
use crate::images::ImageRgb;
use crate::renderer::Renderer;
use crate::scene::Scene;
use crate::settings::{Eyes, Method, Mips, ReconstructSettings, RenderSettings, Reuse, Settings};
use crate::xr::View;

/// Frames of the reference have numbers of their own, so that their noise is independent of the picture's.
const FIRST_FRAME: u32 = 1 << 31;

/// A path tracer for the same view, and its mean.
pub struct Reference {
    renderer: Renderer,
    library: ShaderLibrary,
    size: [u32; 2],
    /// An animation has moved the renderer's scene.
    is_animated: bool,
}

impl Reference {
    /// Settings of the reference to a picture: both eyes path traced by themselves, with nothing filtered, at the depth of
    /// what is compared.
    pub fn settings(settings: &RenderSettings) -> RenderSettings {
        let mut reference = settings.clone();
        if settings.method == Method::Photon {
            reference.path.max_depth = settings.photon.max_depth;
        }
        reference.method = Method::Path;
        reference.reuse = Reuse::Off;
        reference.reconstruct = ReconstructSettings::default();
        reference.textures.mips = Mips::Off;
        reference
    }

    /// Compiles the path tracer. `gate` is asked before every pass.
    ///
    /// # Errors
    /// [`EngineError::Render`].
    pub fn new(
        scene: &Scene,
        settings: &Settings,
        size: [u32; 2],
        gate: Gate,
    ) -> Result<Self, EngineError> {
        let library = library(settings)?;
        let mut context = GpuContext::open(Some(&settings.adapter))?;
        context.keep_pipelines();
        context.set_gate(gate);
        let render = Self::settings(&settings.render);
        let renderer = Renderer::new(context, &library, scene, &render, Eyes::Both, size)?;
        Ok(Self {
            renderer,
            library,
            size,
            is_animated: false,
        })
    }

    /// Adds a frame of `views`; `scene` is the one that it was made of.
    ///
    /// # Errors
    /// [`EngineError`].
    pub fn add(
        &mut self,
        scene: &Scene,
        views: &[View; 2],
        index: u32,
        scene_time_ns: Option<i64>,
    ) -> Result<(), EngineError> {
        let index = FIRST_FRAME.wrapping_add(index);
        let is_animated = &mut self.is_animated;
        animate(&mut self.renderer, scene, scene_time_ns, is_animated);
        self.renderer.render_frame(views, index, |_| {})?;
        self.renderer.average(&self.library, None)?;
        Ok(())
    }

    /// Device memory in use, bytes.
    pub fn device_bytes(&self) -> Option<u64> {
        self.renderer.context().allocated_bytes()
    }

    /// Pixels per eye.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Forgets the frames: the view has changed.
    pub fn clear(&mut self) {
        self.renderer.forget_mean();
    }

    /// Frames so far.
    pub fn frames(&self) -> u32 {
        self.renderer.mean_frames()
    }

    /// Mean radiance of an eye, 0 left or 1 right; `None` before the first frame.
    ///
    /// # Errors
    /// [`EngineError`].
    pub fn mean(&self, eye: usize) -> Result<Option<ImageRgb>, EngineError> {
        mean_of(&self.renderer, eye)
    }
}
