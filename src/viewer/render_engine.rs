//! A scene with its edits, a renderer for it, and the frames that it has made: what the rendering thread keeps for each set
//! of settings.

use std::sync::Arc;

use egui::ColorImage;

use super::frames::{
    FrameReport, PicturePlace, PixelRadiance, Seen, ViewMode, Wanted, without_display,
};
use super::view_pictures::{Colored, NO_REFERENCE, ViewPictures, color, shared, with_legend};
use crate::false_color::{self, Coloring, Legend, Scale};
use crate::frame::user_passes::shader_library;
use crate::frame_loop::FrameStats;
use crate::gpu::{Gate, GpuContext, GpuError, ShaderLibrary};
use crate::images::{ImageError, ImageRgb};
use crate::metrics::MetricsError;
use crate::renderer::{
    Applied, Display, Eye, Inspected, InspectedValues, Inspection, RenderError, Renderer,
};
use crate::scene::Scene;
use crate::scene::edit::{Edit, EditError};
use crate::settings::{Eyes, Settings};

/// What can go wrong on the rendering thread.
#[derive(Debug, thiserror::Error)]
pub enum EngineError {
    /// A pass, the device, settings that do not go together.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// An edit that the scene refuses.
    #[error(transparent)]
    Edit(#[from] EditError),
    /// An image of a wrong size.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A picture and its reference do not go together.
    #[error(transparent)]
    ErrorMap(#[from] MetricsError),
    /// Settings were refused before; nothing is rendered until they change.
    #[error("nothing is rendered: the last settings or shaders were refused")]
    NoRenderer,
}

impl From<GpuError> for EngineError {
    fn from(error: GpuError) -> Self {
        Self::Render(error.into())
    }
}

impl EngineError {
    /// Whether the device is gone.
    pub fn is_lost(&self) -> bool {
        matches!(self, Self::Render(RenderError::Gpu(GpuError::Lost { .. })))
    }
}

/// See the module.
pub struct RenderEngine {
    scene: Scene,
    /// Edited since the renderer was told.
    is_edited: bool,
    /// The scene asks for a renderer of its own, such as one with another feature compiled in.
    is_outgrown: bool,
    compiled: Option<Compiled>,
    /// Settings that made no renderer; not tried again until something changes.
    refused: Option<Arc<Settings>>,
    /// Of the mean over frames, by eye; none of an eye that the last frame did not have.
    pictures: [Option<Arc<ColorImage>>; 2],
    /// What the pixels see, of the view in hand.
    seen: Option<[Arc<Seen>; 2]>,
    /// Says whether the frame under way is still wanted.
    gate: Gate,
}

struct Compiled {
    renderer: Renderer,
    library: ShaderLibrary,
    settings: Arc<Settings>,
    rendered: Eyes,
    size: [u32; 2],
    /// An animation has moved the renderer's scene.
    is_animated: bool,
}

impl RenderEngine {
    /// A scene without a renderer yet. `gate` is asked before every pass of a frame.
    pub fn new(scene: Scene, gate: Gate) -> Self {
        Self {
            scene,
            is_edited: false,
            is_outgrown: false,
            compiled: None,
            refused: None,
            pictures: [None, None],
            seen: None,
            gate,
        }
    }

    /// Another one beside it, which asks the same gate.
    pub fn beside(&self, scene: Scene) -> Self {
        Self::new(scene, Arc::clone(&self.gate))
    }

    /// The scene as edited.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Device memory in use, bytes.
    pub fn device_bytes(&self) -> Option<u64> {
        let compiled = self.compiled.as_ref()?;
        compiled.renderer.context().allocated_bytes()
    }

    /// Frames averaged so far.
    pub fn frames(&self) -> u32 {
        let compiled = self.compiled.as_ref();
        compiled.map_or(0, |compiled| compiled.renderer.mean_frames())
    }

    /// Forgets the frames: the view, the scene or the size has changed.
    pub fn clear(&mut self) {
        if let Some(compiled) = &mut self.compiled {
            compiled.renderer.forget_mean();
        }
        self.pictures = [None, None];
        self.seen = None;
    }

    /// Edits the scene; the renderer is told by [`RenderEngine::take_changes`].
    ///
    /// # Errors
    /// [`EngineError::Edit`]; the scene stays as it was.
    pub fn edit(&mut self, edit: &Edit) -> Result<(), EngineError> {
        edit.clone().apply(&mut self.scene)?;
        self.is_edited = true;
        self.refused = None;
        Ok(())
    }

    /// Whether [`RenderEngine::prepare`] has work to do.
    pub fn needs_renderer(&self, settings: &Settings, rendered: Eyes) -> bool {
        let fits = self.compiled.as_ref().is_some_and(|compiled| {
            same_renderer(&compiled.settings, settings)
                && compiled.rendered == rendered
                && !self.is_outgrown
        });
        let refused = self.refused.as_ref();
        !fits && !refused.is_some_and(|refused| same_renderer(refused, settings))
    }

    /// Makes a renderer. One that was there stays until the new one is whole.
    ///
    /// # Errors
    /// [`EngineError::Render`]: these settings, this scene or this shader make none. The same settings are not tried again
    /// until the scene or the shaders change.
    pub fn prepare(
        &mut self,
        settings: &Arc<Settings>,
        rendered: Eyes,
        size: [u32; 2],
    ) -> Result<(), EngineError> {
        let kept = self
            .compiled
            .as_ref()
            .filter(|compiled| compiled.settings.gpu.shader_folder == settings.gpu.shader_folder)
            .map(|compiled| compiled.library.clone());
        let made = match kept {
            Some(library) => Ok(library),
            None => library(settings),
        }
        .and_then(|library| self.make(settings, rendered, size, library));
        match made {
            Ok(compiled) => {
                self.take(compiled);
                Ok(())
            }
            Err(error) => {
                self.refused = Some(Arc::clone(settings));
                Err(error)
            }
        }
    }

    fn take(&mut self, compiled: Compiled) {
        self.compiled = Some(compiled);
        self.is_outgrown = false;
        self.is_edited = false;
        self.refused = None;
        self.clear();
    }

    fn make(
        &self,
        settings: &Arc<Settings>,
        rendered: Eyes,
        size: [u32; 2],
        library: ShaderLibrary,
    ) -> Result<Compiled, EngineError> {
        let mut context = GpuContext::open(Some(&settings.adapter))?;
        context.keep_pipelines();
        context.set_gate(Arc::clone(&self.gate));
        let renderer = Renderer::new(
            context,
            &library,
            &self.scene,
            &settings.render,
            rendered,
            size,
        )?;
        Ok(Compiled {
            renderer,
            library,
            settings: Arc::clone(settings),
            rendered,
            size,
            is_animated: false,
        })
    }

    /// Compiles everything again from other shaders.
    ///
    /// # Errors
    /// [`EngineError::Render`] naming the shader; what was there stays.
    pub fn reload(&mut self, library: ShaderLibrary) -> Result<(), EngineError> {
        self.refused = None;
        let Some(compiled) = &self.compiled else {
            return Ok(());
        };
        let settings = Arc::clone(&compiled.settings);
        let (rendered, size) = (compiled.rendered, compiled.size);
        let compiled = self.make(&settings, rendered, size, library)?;
        self.take(compiled);
        Ok(())
    }

    /// Tells the renderer of edits; true if there were any.
    ///
    /// # Errors
    /// [`EngineError::Render`].
    pub fn take_changes(&mut self) -> Result<bool, EngineError> {
        if !std::mem::take(&mut self.is_edited) {
            return Ok(false);
        }
        if let Some(compiled) = &mut self.compiled {
            match compiled.renderer.apply_scene(&self.scene)? {
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

    /// The frame that was just rendered was given up: nothing of it is kept. `mean_frames` before it are, with what their
    /// pixels see.
    pub fn give_up(&mut self, without_photons: bool, mean_frames: u32) {
        if let Some(compiled) = &mut self.compiled {
            let renderer = &mut compiled.renderer;
            renderer.give_up_frame(without_photons, mean_frames);
        }
        if mean_frames == 0 {
            self.clear();
        }
    }

    fn compiled(&mut self) -> Result<&mut Compiled, EngineError> {
        self.compiled.as_mut().ok_or(EngineError::NoRenderer)
    }

    /// One frame of `size`, added to the mean, which is shown as is `wanted`.
    ///
    /// # Errors
    /// [`EngineError`].
    pub fn frame(
        &mut self,
        index: u32,
        wanted: &Wanted,
        size: [u32; 2],
    ) -> Result<FrameStats, EngineError> {
        let compiled = self.compiled.as_mut().ok_or(EngineError::NoRenderer)?;
        if compiled.size != size {
            compiled.renderer.resize(size)?;
            compiled.size = size;
        }
        let time_ns = wanted.scene_time_ns;
        let was_animated = std::mem::replace(&mut compiled.is_animated, time_ns.is_some());
        match time_ns {
            Some(time_ns) => compiled.renderer.animate(time_ns),
            // Back to where its nodes have it.
            None if was_animated => compiled.renderer.set_pose(&self.scene.rest_pose()),
            None => {}
        }
        let result = compiled
            .renderer
            .render_frame(&wanted.views, index, |_| {})?;
        Ok(FrameStats {
            non_finite_pixels: self.average(wanted)?,
            ..FrameStats::of(index, result)
        })
    }

    /// Adds the frame that was just rendered to the mean; returns pixels that were not finite, which count as 0.
    fn average(&mut self, wanted: &Wanted) -> Result<usize, EngineError> {
        let display = Display {
            exposure: wanted.settings.render.output.exposure,
            tone: wanted.settings.render.output.tone,
        };
        let compiled = self.compiled()?;
        let shown = compiled.renderer.average(&compiled.library, display)?;
        let size = compiled.renderer.size().map(|edge| edge as usize);
        let non_finite = shown.iter().flatten().map(|eye| eye.non_finite).sum();
        self.pictures = shown.map(|eye| {
            eye.map(|eye| Arc::new(ColorImage::from_rgba_premultiplied(size, &eye.rgba)))
        });
        Ok(non_finite)
    }

    /// Mean radiance of an eye, 0 left or 1 right; `None` if the last frame did not have it.
    ///
    /// # Errors
    /// [`EngineError`].
    pub fn mean(&self, eye: usize) -> Result<Option<ImageRgb>, EngineError> {
        let compiled = self.compiled.as_ref().ok_or(EngineError::NoRenderer)?;
        let renderer = &compiled.renderer;
        let [width, height] = renderer.size();
        let mean = renderer.read_mean(Eye::ALL[eye])?;
        let image = mean.map(|pixels| ImageRgb::new(width, height, pixels));
        Ok(image.transpose()?)
    }

    /// Mean radiance at a place; `None` if the last frame did not have it.
    ///
    /// # Errors
    /// [`EngineError`].
    pub fn radiance_at(&self, place: PicturePlace) -> Result<Option<PixelRadiance>, EngineError> {
        let PicturePlace { eye, at } = place;
        let (Some(compiled), Some(seen)) = (&self.compiled, &self.seen) else {
            return Ok(None);
        };
        let Some(pixel) = seen[eye].pixel_at(at) else {
            return Ok(None);
        };
        let read = compiled.renderer.read_mean_at(Eye::ALL[eye], pixel)?;
        Ok(read.map(|radiance| PixelRadiance {
            eye,
            pixel,
            size: seen[eye].size,
            radiance,
        }))
    }

    /// The left eye's picture.
    pub fn picture(&self) -> Option<Arc<ColorImage>> {
        self.pictures[0].clone()
    }

    /// What pixels see, from the frame that was just rendered if the view is new.
    fn seen(&mut self, size: [u32; 2]) -> Result<[Arc<Seen>; 2], EngineError> {
        if let Some(seen) = &self.seen
            && seen.iter().any(|seen| seen.size == size)
        {
            return Ok(seen.clone());
        }
        let rendered = [0, 1].map(|eye| self.pictures[eye].is_some());
        let compiled = self.compiled()?;
        let mut found = Vec::with_capacity(2);
        for (eye, is_rendered) in Eye::ALL.into_iter().zip(rendered) {
            if !is_rendered {
                found.push(Arc::default());
                continue;
            }
            let surfaces = compiled.renderer.inspect_surfaces(&compiled.library, eye)?;
            found.push(Arc::new(Seen::of(size, &surfaces)));
        }
        let seen = [Arc::clone(&found[0]), Arc::clone(&found[1])];
        self.seen = Some(seen.clone());
        Ok(seen)
    }

    /// Everything that the window shows of the frame that was just rendered; `reference` if there is one.
    ///
    /// # Errors
    /// [`EngineError`].
    pub fn report(
        &mut self,
        wanted: &Wanted,
        size: [u32; 2],
        stats: FrameStats,
        reference: Option<&Self>,
    ) -> Result<FrameReport, EngineError> {
        let seen = self.seen(size)?;
        let shown = self.pictures(wanted.view_mode, size, reference)?;
        let renderer = &self.compiled()?.renderer;
        let is_dark = renderer.scene().light_count() == 0;
        let radii_m = [renderer.radius_m(), renderer.caustic_radius_m()];
        Ok(FrameReport {
            number: wanted.number,
            changes: 0,
            picture: 0,
            is_dark,
            view_mode: wanted.view_mode,
            index: stats.frame,
            rendered: wanted.rendered,
            shown,
            pictures: self.pictures.clone(),
            radiance: None,
            radii_m,
            other: None,
            seen,
            views: wanted.views,
            size,
            is_full: false,
            frames: self.frames(),
            stats,
            device_bytes: self.device_bytes(),
        })
    }

    /// Both eyes' pictures of a view of the frame that was just rendered.
    ///
    /// # Errors
    /// [`EngineError`].
    pub fn pictures(
        &mut self,
        mode: ViewMode,
        size: [u32; 2],
        reference: Option<&Self>,
    ) -> Result<ViewPictures, EngineError> {
        let made = ViewPictures::make(|eye, first| {
            let Some(picture) = self.pictures[eye].clone() else {
                return Ok(None);
            };
            let colored = self.colored(mode, eye, size, reference, first)?;
            let colored = colored.unwrap_or_else(|note| (picture, None, note));
            Ok::<_, EngineError>(Some(colored))
        })?;
        made.ok_or(EngineError::NoRenderer)
    }

    /// An eye in false colour, on the scale of `first`, if there is one; else the picture itself is shown, and a line may
    /// say why.
    fn colored(
        &mut self,
        mode: ViewMode,
        eye: usize,
        size: [u32; 2],
        reference: Option<&Self>,
        first: Option<&Legend>,
    ) -> Result<Result<Colored, Option<String>>, EngineError> {
        match mode {
            ViewMode::Picture => Ok(Err(None)),
            ViewMode::Inspection(inspection) => match self.inspect(inspection, eye, size) {
                Ok(inspected) => Ok(Ok(color(&inspected, first)?)),
                // Such as provenance, which the left eye does not have.
                Err(EngineError::Render(RenderError::Settings(why))) => Ok(Err(Some(why))),
                Err(error) => Err(error),
            },
            ViewMode::Error => {
                let (Some(reference), Some(mean)) = (reference, self.mean(eye)?) else {
                    return Ok(Err(Some(NO_REFERENCE.to_owned())));
                };
                let log = Coloring {
                    scale: Scale::Log,
                    range: None,
                };
                let Some(converged) = reference.mean(eye)? else {
                    return Ok(Err(None));
                };
                let map = false_color::relative_error(&mean, &converged, shared(log, first))?;
                Ok(Ok(with_legend(map)))
            }
        }
    }

    /// Whether a view of the last frame can be had without another renderer.
    pub fn can_inspect(&self, inspection: Inspection) -> bool {
        let compiled = self.compiled.as_ref();
        compiled.is_some_and(|compiled| {
            let settings = &compiled.settings.render;
            let has_map = inspection != Inspection::Caustic || self.forms_caustics();
            has_map && inspection.missing(settings).is_none()
        })
    }

    /// Whether the renderer has a map of caustics.
    pub fn forms_caustics(&self) -> bool {
        let compiled = self.compiled.as_ref();
        compiled.is_some_and(|compiled| compiled.renderer.caustic_map().is_some())
    }

    fn inspect(
        &mut self,
        inspection: Inspection,
        eye: usize,
        size: [u32; 2],
    ) -> Result<Inspected, EngineError> {
        if inspection == Inspection::Variance
            && let Some(compiled) = &self.compiled
            && inspection.missing(&compiled.settings.render).is_some()
        {
            let variance = compiled.renderer.read_mean_variance(Eye::ALL[eye])?;
            let values = variance.ok_or_else(|| {
                RenderError::Settings(
                    "variance needs two frames of a view that stands still".to_owned(),
                )
            })?;
            return Ok(Inspected {
                inspection,
                eye: Eye::ALL[eye],
                size,
                values: InspectedValues::Scalar(values),
                has_value: None,
            });
        }
        if let Some(inspected) = self
            .seen
            .as_ref()
            .filter(|seen| seen[eye].size == size)
            .and_then(|seen| seen[eye].inspected(inspection, Eye::ALL[eye]))
        {
            return Ok(inspected);
        }
        let compiled = self.compiled()?;
        Ok(compiled
            .renderer
            .inspect(&compiled.library, inspection, Eye::ALL[eye])?)
    }
}

/// Whether two sets of settings make the same renderer.
fn same_renderer(one: &Settings, other: &Settings) -> bool {
    one.adapter == other.adapter
        && one.gpu == other.gpu
        && without_display(one).render == without_display(other).render
}

/// Shaders of the program, or of the folder that the settings name.
///
/// # Errors
/// [`EngineError::Render`], naming the shader.
pub fn library(settings: &Settings) -> Result<ShaderLibrary, EngineError> {
    let passes = &settings.render.user_passes;
    Ok(shader_library(&settings.gpu.shader_folder, passes)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::{Method, RenderSettings, Tone};
    use crate::viewer::reference::{self, FIRST_FRAME};

    #[test]
    fn only_what_is_compiled_or_traced_otherwise_makes_a_new_renderer() {
        let base = Settings::default();
        let mut other = base.clone();
        other.size = Some([3, 4]);
        other.render.output.exposure = 2.0;
        other.render.output.tone = Tone::Neutral;
        other.environment.strength = 2.0;
        assert!(same_renderer(&base, &other));
        other.render.photon.count += 1;
        assert!(!same_renderer(&base, &other));
    }

    /// The picture from where a scene's head starts, by paths.
    fn wanted(
        scene: &Scene,
        rendered: Eyes,
        size: [u32; 2],
        change: impl FnOnce(&mut RenderSettings),
    ) -> Wanted {
        let mut settings = Settings::default();
        settings.render.method = Method::Path;
        change(&mut settings.render);
        let headset = crate::xr::Headset::load(&settings.headset).unwrap();
        Wanted {
            number: 0,
            settings: Arc::new(settings),
            other: None,
            views: headset.views_from_head(&scene.start_pose()),
            rendered,
            scene_time_ns: None,
            size,
            view_mode: ViewMode::Picture,
            stands: false,
        }
    }

    #[test]
    fn a_place_of_the_picture_has_the_radiance_of_its_pixel() {
        let scene = Scene::builtin("cornell").unwrap();
        let size = [12, 8];
        let wanted = wanted(&scene, Eyes::Right, size, |render| {
            render.output.exposure = 2.0;
            render.output.tone = Tone::Neutral;
        });
        let settings = Arc::clone(&wanted.settings);
        let mut engine = RenderEngine::new(scene, Arc::new(|_: &str| true));
        engine.prepare(&settings, Eyes::Right, size).unwrap();
        let place = PicturePlace {
            eye: 1,
            at: [0.3, 0.7],
        };
        assert_eq!(engine.radiance_at(place).unwrap(), None, "no frame yet");
        for index in 0..2 {
            let stats = engine.frame(index, &wanted, size).unwrap();
            let report = engine.report(&wanted, size, stats, None);
            assert_eq!(report.unwrap().frames, index + 1);
        }
        let mean = engine.mean(1).unwrap().unwrap();
        // Row 5, column 3.
        let found = engine.radiance_at(place).unwrap().unwrap();
        assert_eq!((found.eye, found.pixel, found.size), (1, 63, size));
        assert_eq!(found.radiance, mean.pixels[63]);
        let left = PicturePlace { eye: 0, ..place };
        assert_eq!(engine.radiance_at(left).unwrap(), None, "not rendered");
        let host = crate::tone::tone_map_by(&mean, 2.0, Tone::Neutral);
        let shown = engine.pictures[1].as_ref().unwrap();
        for (device, host) in shown.pixels.iter().zip(&host.pixels) {
            let [r, g, b, _] = device.to_array();
            // A step: `renderer::still` has where.
            let off = [0, 1, 2].map(|c| [r, g, b][c].abs_diff(host[c]));
            assert!(off.iter().all(|off| *off <= 1), "{device:?} for {host:?}");
        }
        engine.clear();
        assert_eq!(engine.radiance_at(place).unwrap(), None, "another view");
    }

    #[test]
    fn what_an_animation_has_moved_is_back_once_it_is_stopped() {
        let scene = Scene::builtin("parade").unwrap();
        let size = [24, 24];
        let mut wanted = wanted(&scene, Eyes::Left, size, |render| render.path.max_depth = 1);
        let settings = Arc::clone(&wanted.settings);
        let mut engine = RenderEngine::new(scene.clone(), Arc::new(|_: &str| true));
        engine.prepare(&settings, Eyes::Left, size).unwrap();
        let mut reference = engine.beside(scene);
        let of_reference = Arc::new(reference::settings(&settings));
        reference.prepare(&of_reference, Eyes::Both, size).unwrap();
        // One frame's noise everywhere: what stands alike is alike to the bit.
        let mut shown_at = |seconds: Option<f64>| {
            wanted.scene_time_ns = seconds.map(|seconds| (seconds * 1e9) as i64);
            for (engine, index) in [(&mut engine, 0), (&mut reference, FIRST_FRAME)] {
                engine.clear();
                engine.frame(index, &wanted, size).unwrap();
            }
            [engine.mean(0), reference.mean(0)].map(|mean| mean.unwrap().unwrap().pixels)
        };
        let rest = shown_at(None);
        shown_at(Some(0.0));
        let moved = shown_at(Some(0.7));
        let stopped = shown_at(None);
        for (one, two) in rest.iter().zip(&moved) {
            assert!(one != two, "nothing moves");
        }
        assert!(rest == stopped, "not where the nodes have it");
    }

    #[test]
    fn what_was_refused_is_tried_again_with_other_shaders() {
        let mut engine =
            RenderEngine::new(Scene::builtin("plane").unwrap(), Arc::new(|_: &str| true));
        let settings = Arc::new(Settings::default());
        engine.prepare(&settings, Eyes::Left, [8, 8]).unwrap();
        let mut broken = Settings::default();
        broken.render.photon.count = 1;
        broken.gpu.shader_folder = "no/such/folder".into();
        let broken = Arc::new(broken);
        assert!(engine.prepare(&broken, Eyes::Left, [8, 8]).is_err());
        assert!(!engine.needs_renderer(&broken, Eyes::Left));
        engine.reload(ShaderLibrary::embedded()).unwrap();
        assert!(engine.needs_renderer(&broken, Eyes::Left));
        assert!(!engine.needs_renderer(&settings, Eyes::Left));
    }
}
