//! A scene with its edits, a renderer for it, and the frames that it has made: what the rendering thread keeps for each set
//! of settings.

use std::sync::Arc;
use std::time::Instant;

use egui::{Color32, ColorImage};

use super::accumulate::Accumulator;
use super::frames::{FrameReport, Look, Seen};
use super::reference::Reference;
use super::session::{DesktopSession, SharedViews};
use super::worker::Wanted;
use crate::false_color::{self, Coloring, ErrorMapError, Legend, Scale};
use crate::frame_loop::{self, FrameStats, LoopError, Step};
use crate::gpu::{GpuContext, GpuError, ShaderLibrary};
use crate::images::{Image, ImageError, ImageRgb, ImageRgb8, encode_display, tone_map};
use crate::renderer::{
    Applied, Eye, Inspected, InspectedValues, Inspection, RenderError, Renderer,
};
use crate::scene::Scene;
use crate::scene::edit::{Edit, EditError};
use crate::settings::{Eyes, Settings};

/// What can go wrong on the rendering thread.
#[derive(Debug, thiserror::Error)]
pub enum StudioError {
    /// A pass, the device, settings that do not go together.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// The session.
    #[error(transparent)]
    Loop(#[from] LoopError),
    /// An edit that the scene refuses.
    #[error(transparent)]
    Edit(#[from] EditError),
    /// An image of a wrong size.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A picture and its reference do not go together.
    #[error(transparent)]
    ErrorMap(#[from] ErrorMapError),
    /// Settings were refused before; nothing is rendered until they change.
    #[error("nothing is rendered: the last settings or shaders were refused")]
    NoRenderer,
}

impl From<GpuError> for StudioError {
    fn from(error: GpuError) -> Self {
        Self::Render(error.into())
    }
}

impl StudioError {
    /// Whether the device is gone.
    pub fn is_lost(&self) -> bool {
        matches!(
            self,
            Self::Render(RenderError::Gpu(GpuError::Lost { .. }))
                | Self::Loop(LoopError::Render(RenderError::Gpu(GpuError::Lost { .. })))
        )
    }
}

/// See the module.
pub struct Studio {
    scene: Scene,
    /// Edited since the renderer was told.
    is_edited: bool,
    /// The scene asks for a renderer of its own, such as one with another feature compiled in.
    is_outgrown: bool,
    engine: Option<Engine>,
    /// Settings that made no renderer; not tried again until something changes.
    refused: Option<Arc<Settings>>,
    averaged: [Accumulator; 2],
    /// What the pixels see, of the view in hand.
    seen: Option<[Arc<Seen>; 2]>,
}

struct Engine {
    renderer: Renderer,
    library: ShaderLibrary,
    settings: Arc<Settings>,
    size: [u32; 2],
}

impl Studio {
    /// A scene without a renderer yet.
    pub fn new(scene: Scene) -> Self {
        Self {
            scene,
            is_edited: false,
            is_outgrown: false,
            engine: None,
            refused: None,
            averaged: Default::default(),
            seen: None,
        }
    }

    /// The scene as edited.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Device memory in use, bytes.
    pub fn device_bytes(&self) -> Option<u64> {
        let engine = self.engine.as_ref()?;
        engine.renderer.context().allocated_bytes()
    }

    /// Frames averaged so far.
    pub fn frames(&self) -> u32 {
        self.averaged[0].frames()
    }

    /// Forgets the frames: the view, the scene or the size has changed.
    pub fn clear(&mut self) {
        for averaged in &mut self.averaged {
            averaged.clear();
        }
        self.seen = None;
    }

    /// Edits the scene; the renderer is told by [`Studio::take_changes`].
    ///
    /// # Errors
    /// [`StudioError::Edit`]; the scene stays as it was.
    pub fn edit(&mut self, edit: &Edit) -> Result<(), StudioError> {
        edit.clone().apply(&mut self.scene)?;
        self.is_edited = true;
        self.refused = None;
        Ok(())
    }

    /// Whether [`Studio::prepare`] has work to do.
    pub fn needs_renderer(&self, settings: &Arc<Settings>) -> bool {
        let fits = self
            .engine
            .as_ref()
            .is_some_and(|engine| same_renderer(&engine.settings, settings) && !self.is_outgrown);
        !fits && !is_refused(self.refused.as_ref(), settings)
    }

    /// Makes a renderer. One that was there stays until the new one is whole.
    ///
    /// # Errors
    /// [`StudioError::Render`]: these settings, this scene or this shader make none. The same settings are not tried again
    /// until the scene or the shaders change.
    pub fn prepare(
        &mut self,
        settings: &Arc<Settings>,
        size: [u32; 2],
        library: impl FnOnce(&Settings) -> Result<ShaderLibrary, StudioError>,
    ) -> Result<(), StudioError> {
        let kept = self
            .engine
            .as_ref()
            .filter(|engine| engine.settings.gpu.shader_folder == settings.gpu.shader_folder)
            .map(|engine| engine.library.clone());
        let made = match kept {
            Some(library) => Ok(library),
            None => library(settings),
        }
        .and_then(|library| self.make(settings, size, library));
        match made {
            Ok(engine) => {
                self.engine = Some(engine);
                self.is_outgrown = false;
                self.is_edited = false;
                self.refused = None;
                self.clear();
                Ok(())
            }
            Err(error) => {
                self.refused = Some(Arc::clone(settings));
                Err(error)
            }
        }
    }

    fn make(
        &self,
        settings: &Arc<Settings>,
        size: [u32; 2],
        library: ShaderLibrary,
    ) -> Result<Engine, StudioError> {
        let context = GpuContext::open(Some(&settings.adapter))?;
        let renderer = Renderer::new(
            context,
            &library,
            &self.scene,
            &settings.render,
            Eyes::Both,
            size,
        )?;
        Ok(Engine {
            renderer,
            library,
            settings: Arc::clone(settings),
            size,
        })
    }

    /// Compiles everything again from other shaders.
    ///
    /// # Errors
    /// [`StudioError::Render`] naming the shader; what was there stays.
    pub fn reload(&mut self, library: ShaderLibrary) -> Result<(), StudioError> {
        let Some(engine) = &self.engine else {
            self.refused = None;
            return Ok(());
        };
        let (settings, size) = (Arc::clone(&engine.settings), engine.size);
        self.engine = Some(self.make(&settings, size, library)?);
        self.clear();
        Ok(())
    }

    /// Tells the renderer of edits; true if there were any.
    ///
    /// # Errors
    /// [`StudioError::Render`].
    pub fn take_changes(&mut self) -> Result<bool, StudioError> {
        if !std::mem::take(&mut self.is_edited) {
            return Ok(false);
        }
        if let Some(engine) = &mut self.engine {
            match engine.renderer.apply_scene(&self.scene)? {
                Applied::InPlace(_) => {}
                Applied::NeedsRebuild { why } => {
                    log::debug!("a new renderer: {why}");
                    self.is_outgrown = true;
                }
            }
        }
        self.clear();
        Ok(true)
    }

    /// The renderer, for images of `size`.
    ///
    /// # Errors
    /// [`StudioError::NoRenderer`], [`StudioError::Render`].
    fn renderer_of(
        &mut self,
        size: [u32; 2],
    ) -> Result<(&mut Renderer, &ShaderLibrary), StudioError> {
        let engine = self.engine.as_mut().ok_or(StudioError::NoRenderer)?;
        if engine.size != size {
            engine.renderer.resize(size)?;
            engine.size = size;
        }
        Ok((&mut engine.renderer, &engine.library))
    }

    fn engine(&mut self) -> Result<&mut Engine, StudioError> {
        self.engine.as_mut().ok_or(StudioError::NoRenderer)
    }

    /// One frame through the frame loop, added to the mean; `None` if the session shows nothing.
    ///
    /// # Errors
    /// [`StudioError`].
    pub fn frame(
        &mut self,
        session: &mut DesktopSession,
        index: u32,
        scene_time_ns: Option<i64>,
        size: [u32; 2],
    ) -> Result<Option<FrameStats>, StudioError> {
        let began = Instant::now();
        let (renderer, library) = self.renderer_of(size)?;
        let step = frame_loop::step(session, renderer, library, index, |_| scene_time_ns, |_| {})?;
        let Step::Rendered(rendered) = step else {
            return Ok(None);
        };
        let non_finite = self.accumulate()?;
        Ok(Some(rendered.into_stats(index, non_finite, began)))
    }

    /// Adds the frame that was just rendered to the mean; returns pixels that were not finite, which count as 0.
    ///
    /// # Errors
    /// [`StudioError::Render`].
    fn accumulate(&mut self) -> Result<usize, StudioError> {
        let engine = self.engine.as_ref().ok_or(StudioError::NoRenderer)?;
        let mut non_finite = 0;
        // What is reconstructed is an average already.
        let is_averaged = engine.settings.render.reconstruct.is_on();
        for (eye, averaged) in [Eye::Left, Eye::Right].into_iter().zip(&mut self.averaged) {
            let mut pixels = engine.renderer.read_radiance(eye)?.unwrap_or_default();
            for pixel in &mut pixels {
                if !pixel.iter().all(|channel| channel.is_finite()) {
                    *pixel = [0.0; 3];
                    non_finite += 1;
                }
            }
            if is_averaged {
                averaged.clear();
            }
            averaged.add(&pixels);
        }
        Ok(non_finite)
    }

    /// Mean radiance of an eye, 0 left or 1 right.
    pub fn mean(&self, eye: usize, size: [u32; 2]) -> Option<ImageRgb> {
        self.averaged[eye].mean(size)
    }

    /// An eye's picture: tone mapped, or what TAA makes for the display.
    fn shown(&self, eye: usize, exposure: f64, size: [u32; 2]) -> Result<ImageRgb8, StudioError> {
        let engine = self.engine.as_ref().ok_or(StudioError::NoRenderer)?;
        let displayed =
            engine
                .renderer
                .read_displayed(if eye == 0 { Eye::Left } else { Eye::Right })?;
        Ok(match displayed {
            Some(pixels) => encode_display(&Image::new(size[0], size[1], pixels)?),
            None => {
                let mean = self.mean(eye, size).ok_or(StudioError::NoRenderer)?;
                tone_map(&mean, exposure)
            }
        })
    }

    /// The left eye's picture.
    ///
    /// # Errors
    /// [`StudioError`].
    pub fn picture(&self, exposure: f64, size: [u32; 2]) -> Result<Arc<ColorImage>, StudioError> {
        Ok(Arc::new(color_image(&self.shown(0, exposure, size)?)))
    }

    /// What pixels see, from the frame that was just rendered if the view is new.
    fn seen(&mut self, size: [u32; 2]) -> Result<[Arc<Seen>; 2], StudioError> {
        if let Some(seen) = &self.seen
            && seen[0].size == size
        {
            return Ok(seen.clone());
        }
        let engine = self.engine()?;
        let mut found = Vec::with_capacity(2);
        for eye in [Eye::Left, Eye::Right] {
            let surfaces = engine.renderer.inspect_surfaces(&engine.library, eye)?;
            found.push(Arc::new(Seen::of(size, &surfaces)));
        }
        let seen = [Arc::clone(&found[0]), Arc::clone(&found[1])];
        self.seen = Some(seen.clone());
        Ok(seen)
    }

    /// Everything that the window shows of the frame that was just rendered.
    ///
    /// # Errors
    /// [`StudioError`].
    pub fn report(
        &mut self,
        wanted: &Wanted,
        size: [u32; 2],
        views: &SharedViews,
        stats: FrameStats,
        reference: Option<&Reference>,
    ) -> Result<FrameReport, StudioError> {
        let views = *views
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner);
        let seen = self.seen(size)?;
        let mut legend = None;
        let is_dark = self.engine()?.renderer.scene().light_count() == 0;
        let mut notes = [0, 1].map(|_| {
            is_dark.then(|| {
                "the scene holds no light: drop an .hdr onto the window, or add a light to a node"
                    .to_owned()
            })
        });
        let mut eyes = Vec::with_capacity(2);
        for (eye, note) in notes.iter_mut().enumerate() {
            let colored = match wanted.look {
                Look::Picture => None,
                Look::Inspection(inspection) => match self.inspect(inspection, eye, size) {
                    Ok(inspected) => {
                        let coloring = shared(Coloring::of(inspection), legend.as_ref());
                        Some(false_color::picture(&inspected, coloring)?)
                    }
                    // Such as provenance, which the left eye does not have.
                    Err(StudioError::Render(RenderError::Settings(why))) => {
                        *note = Some(why);
                        None
                    }
                    Err(error) => return Err(error),
                },
                Look::Error => match (reference, self.mean(eye, size)) {
                    (Some(reference), Some(mean)) => {
                        let log = Coloring {
                            scale: Scale::Log,
                            range: None,
                        };
                        let coloring = shared(log, legend.as_ref());
                        match reference.mean(eye) {
                            Some(converged) => {
                                Some(false_color::relative_error(&mean, &converged, coloring)?)
                            }
                            None => None,
                        }
                    }
                    _ => {
                        *note = Some("the reference begins once the view stands still".to_owned());
                        None
                    }
                },
            };
            eyes.push(Arc::new(match colored {
                Some(picture) => {
                    legend.get_or_insert(picture.legend);
                    color_image(&picture.image)
                }
                None => color_image(&self.shown(eye, wanted.exposure, size)?),
            }));
        }
        Ok(FrameReport {
            number: wanted.number,
            index: stats.frame,
            eyes: [Arc::clone(&eyes[0]), Arc::clone(&eyes[1])],
            other: None,
            legend,
            notes,
            seen,
            views,
            size,
            is_full: false,
            frames: self.frames(),
            stats,
            device_bytes: self.device_bytes(),
        })
    }

    fn inspect(
        &mut self,
        inspection: Inspection,
        eye: usize,
        size: [u32; 2],
    ) -> Result<Inspected, StudioError> {
        if inspection == Inspection::Variance
            && let Some(engine) = &self.engine
            && inspection.missing(&engine.settings.render).is_some()
        {
            let values = self.averaged[eye].variance().ok_or_else(|| {
                RenderError::Settings(
                    "variance needs two frames of a view that stands still".to_owned(),
                )
            })?;
            return Ok(Inspected {
                inspection,
                eye: if eye == 0 { Eye::Left } else { Eye::Right },
                size,
                values: InspectedValues::Scalar(values),
                unit: "(W/(m² sr))²",
                has_value: None,
            });
        }
        let engine = self.engine()?;
        let eye = if eye == 0 { Eye::Left } else { Eye::Right };
        Ok(engine.renderer.inspect(&engine.library, inspection, eye)?)
    }
}

/// Both eyes share one scale, or they could not be compared: the second takes the first one's.
fn shared(coloring: Coloring, first: Option<&Legend>) -> Coloring {
    let range = match first {
        Some(Legend::Bar { range, .. }) => Some(*range),
        Some(Legend::White { white, .. }) => Some([0.0, *white]),
        Some(Legend::Wheel { longest, .. }) => Some([0.0, *longest]),
        _ => None,
    };
    Coloring { range, ..coloring }
}

/// Whether two sets of settings make the same renderer.
fn same_renderer(one: &Settings, other: &Settings) -> bool {
    let with_equal_exposure = |settings: &Settings| {
        let mut render = settings.render.clone();
        // Given with each frame.
        render.output.exposure = 1.0;
        render
    };
    one.adapter == other.adapter
        && one.gpu == other.gpu
        && with_equal_exposure(one) == with_equal_exposure(other)
}

fn is_refused(refused: Option<&Arc<Settings>>, settings: &Settings) -> bool {
    refused.is_some_and(|refused| same_renderer(refused, settings))
}

/// For egui.
pub fn color_image(image: &ImageRgb8) -> ColorImage {
    let pixels = image
        .pixels
        .iter()
        .map(|[r, g, b]| Color32::from_rgb(*r, *g, *b))
        .collect();
    ColorImage::new([image.width as usize, image.height as usize], pixels)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_compiled_or_traced_otherwise_makes_a_new_renderer() {
        let base = Settings::default();
        let mut other = base.clone();
        other.size = Some([3, 4]);
        other.render.output.exposure = 2.0;
        other.environment.strength = 2.0;
        assert!(same_renderer(&base, &other));
        other.render.photon.count += 1;
        assert!(!same_renderer(&base, &other));
    }
}
