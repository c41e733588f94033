//! The renderer: images from views.
//!
//! [`Renderer::render_frame`] is the whole frame. It moves the scene to the head ([`SceneBuffers::begin_frame`]), traces
//! photons if the map is missing or out of date, renders the left eye, reuses it in the right eye, renders the remaining
//! pixels, and reads back counters. Images stay on the device until they are asked for.

#[cfg(test)]
mod adaptive_radius_tests;
#[cfg(test)]
mod blend_tests;
pub mod deform;
pub mod driver_limits;
mod editing;
#[cfg(test)]
mod editing_tests;
#[cfg(test)]
mod emission_tests;
pub mod features;
mod frame_spec;
mod frame_uniform;
pub mod frames_in_flight;
#[cfg(test)]
mod guide_tests;
mod inspect;
pub mod inspection;
pub mod instance_table;
#[cfg(test)]
mod light_tree_tests;
pub mod mirror;
pub mod packing;
mod parts;
pub mod photon_map;
mod photons_over_time;
mod quality;
mod radii;
mod ray_cast;
mod read_back;
mod rebuild;
pub mod reconstruction;
pub mod records;
pub mod scene_buffers;
mod session;
pub mod stats;
pub mod still;
pub mod submit;
#[cfg(test)]
mod test_support;

use std::collections::VecDeque;
use std::ops::ControlFlow;
use std::time::Instant;

use glam::DVec3;
use thiserror::Error;

use crate::bvh::BvhError;
use crate::frame::user_passes;
use crate::frame::{
    FrameRun, FrameSpec, GatherSlices, ImageLayout, MapLayout, Only, PlannedStage, Play,
    SAMPLES_PER_SUBMISSION, plan,
};
use crate::gpu::timing::{Timed, Timer};
use crate::gpu::{
    FrameRecorder, GpuContext, GpuError, PassTimes, Resources, ShaderFeatures, ShaderLibrary,
    Submission, uniform_buffer,
};
use crate::renderer::packing::{PackError, check_user_bsdfs};
use crate::renderer::records::frame::Frame;
use crate::scene::{Needs, Player, Scene};
use crate::settings::{
    Eyes as EyeChoice, Kept, Loads, PhotonEstimate, Quality, RenderSettings, Reuse, Search,
    Timestamps,
};
use crate::xr::{SessionInfo, View};

pub use crate::frame::{Eye, MapKind, Stage};
pub use driver_limits::{WorkLimits, eye_paths_per_thread, photon_paths_per_thread};
pub use editing::{Applied, InPlace};
pub use features::{
    chooses_mips, forms_caustics, light_candidates, reuses_glossy, shader_features, splits_light,
};
pub use frame_spec::{PlannedScene, plan_of_scene};
pub use inspection::{Inspected, InspectedValues, Inspection, SeenSurface};
pub use instance_table::{InstanceId, InstanceTable};
pub use photon_map::{Photon, PhotonCounters, PhotonGrid, PhotonMap, SortedPhoton};
pub use radii::{automatic_radius_m, caustic_paths, progressive_radius_m};
pub use ray_cast::RayHit;
pub use read_back::{RadianceParts, SeenAndMotion};
use rebuild::MadeWith;
pub use rebuild::Rebuild;
pub use reconstruction::Reconstruction;
pub use scene_buffers::{PartPreparation, PreparedPart, SceneBuffers};
pub use stats::{
    CpuTimes, FilledBecause, FrameResult, MapStats, PhotonStats, Provenance, StereoStats,
};
pub use still::{Display, DisplayPixels};
pub use submit::Submitter;

pub use frames_in_flight::Flight;

use frame_spec::{adapter_limits, frame_features, photon_maps};

/// Frames at rest after which the map stays as it is: by then the mean over frames is.
const MOST_FRAMES_AT_REST: u32 = 65_536;
/// Stride of photon keys between frames; progressive mode numbers its samples in between.
const PHOTON_KEY_STRIDE: u32 = 1_000_003;

/// Errors of the renderer.
#[derive(Debug, Error)]
pub enum RenderError {
    /// The device or a pass.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The scene's geometry.
    #[error(transparent)]
    Bvh(#[from] BvhError),
    /// The scene's textures or materials.
    #[error(transparent)]
    Pack(#[from] PackError),
    /// Settings that cannot be combined.
    #[error("{0}")]
    Settings(String),
    /// Whoever follows a frame's samples wants no more of them.
    #[error("interrupted in the middle of a frame")]
    Interrupted,
}

/// Renders images of one scene with one set of settings.
pub struct Renderer {
    context: GpuContext,
    /// With the quality of the last frame.
    settings: RenderSettings,
    eye_choice: EyeChoice,
    /// Pixels of an eye's image at a scale of 1, for which images are allocated.
    full_size: [u32; 2],
    image: ImageLayout,
    quality: quality::Qualities,
    /// The scene's, where the radius is automatic.
    area_m2: f64,
    radius_m: f64,
    caustic_radius_m: f64,
    /// The pass of the current sample: radii shrink from pass to pass, in progressive mode and at rest.
    progressive_pass: u32,
    /// The pass that the photons were traced for.
    traced_pass: u32,
    refresh: photons_over_time::Refresh,
    /// Frames begun so far: what counts of earlier ones apply to is by this number.
    frames_begun: u64,
    /// Frames of the renderer whose place this one took: what they counted steers nothing here.
    frames_before: u64,
    /// What retired frames counted, with their numbers, until it steers later ones.
    steers: VecDeque<(u64, frames_in_flight::Steers)>,
    scene: SceneBuffers,
    frame: FrameRun,
    /// Current reuse mode.
    reuse: Reuse,
    eye_paths_per_thread: u32,
    work_limits: WorkLimits,
    /// Device milliseconds of a sample of both eyes, in the frame that was retired last.
    sample_ms: Option<f64>,
    gather_slices: GatherSlices,
    /// The photon map, and the caustic map if the scene has caustics.
    maps: Vec<PhotonMap>,
    reconstruction: Option<Reconstruction>,
    frame_buffer: wgpu::Buffer,
    timer: Option<Timer>,
    is_bound: bool,
    origin_in_world: DVec3,
    hidden: Option<session::Hidden>,
    submitter: Option<Submitter>,
    mirror: Option<mirror::MirrorPass>,
    still: still::StillView,
    inspector: inspect::Inspector,
    player: Option<Player>,
    edit_base: editing::EditBase,
}

impl Renderer {
    /// Uploads `scene`, compiles its passes and allocates images of `size` pixels per eye.
    ///
    /// # Errors
    /// [`RenderError`]: the scene does not fit, or the driver refuses a shader.
    pub fn new(
        context: GpuContext,
        library: &ShaderLibrary,
        scene: &Scene,
        settings: &RenderSettings,
        eye_choice: EyeChoice,
        size: [u32; 2],
    ) -> Result<Self, RenderError> {
        let made_with = MadeWith {
            context,
            settings: settings.clone(),
            eyes: eye_choice,
            size,
            hidden: None,
        };
        Self::made(made_with, library, scene, None)
    }

    /// As [`Renderer::new`], for a session: without rays for pixels that lenses hide, and with depth where it takes that.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn for_session(
        context: GpuContext,
        library: &ShaderLibrary,
        scene: &Scene,
        settings: &RenderSettings,
        eye_choice: EyeChoice,
        size: [u32; 2],
        session: &SessionInfo,
    ) -> Result<Self, RenderError> {
        let mut settings = settings.clone();
        let keeps_surfaces = settings.reconstruct.is_on();
        if session.takes_depth && !keeps_surfaces && settings.output.kept == Kept::Picture {
            settings.output.kept = Kept::Depth;
        }
        let made_with = MadeWith {
            context,
            settings,
            eyes: eye_choice,
            size,
            hidden: session.hidden.clone(),
        };
        Self::made(made_with, library, scene, None)
    }

    /// As [`Renderer::new`]; its shaders also do for a part of these needs.
    fn made(
        made_with: MadeWith,
        library: &ShaderLibrary,
        scene: &Scene,
        part: Option<&Needs>,
    ) -> Result<Self, RenderError> {
        let MadeWith {
            context,
            settings,
            eyes: eye_choice,
            size,
            hidden,
        } = made_with;
        let settings = &settings;
        check_user_bsdfs(library, scene)?;
        settings.check().map_err(RenderError::Settings)?;
        let edit_base = editing::EditBase::new(scene);
        let needs = part.map(|part| edit_base.needs.widened_by(part));
        let needs = needs.as_ref().unwrap_or(&edit_base.needs);
        let both = eye_choice == EyeChoice::Both;
        let mut features = frame_features(needs, settings, both, context.adapter.is_software());
        features.visibility_mask = hidden.is_some();
        let mut buffers = SceneBuffers::new(&context, scene, &features)?;
        let reconstruct = &settings.reconstruct;
        let follows_motion = reconstruct.follows_motion() || settings.output.motion;
        buffers.keep_previous(follows_motion);
        let animation = &settings.animation;
        let player = Player::new(scene, &animation.clip, animation.speed, animation.time_s)
            .map_err(|error| RenderError::Settings(error.to_string()))?;
        let area_m2 = radii::area_m2(settings, &edit_base.statistics, scene);
        let [radius_m, caustic_radius_m] = radii::radii_m(settings, area_m2);
        let reuse = if both { settings.reuse } else { Reuse::Off };
        let depth = buffers.hierarchy_depth();
        let mut renderer = Self {
            frame_buffer: uniform_buffer(&context, "frame", size_of::<Frame>() as u64),
            timer: match settings.gpu.timestamps {
                Timestamps::Off => None,
                Timestamps::Auto | Timestamps::On => Timer::new(&context, Timed::Passes),
                Timestamps::Stages => Timer::new(&context, Timed::Stages),
            },
            settings: settings.clone(),
            eye_choice,
            full_size: size,
            quality: quality::Qualities::new(Quality {
                reuse: reuse != Reuse::Off,
                ..Quality::of(settings)
            }),
            area_m2,
            image: ImageLayout {
                size,
                heap_bytes: 0,
            },
            radius_m,
            caustic_radius_m,
            progressive_pass: 0,
            traced_pass: 0,
            refresh: photons_over_time::Refresh::default(),
            frames_begun: 0,
            frames_before: 0,
            steers: VecDeque::new(),
            frame: FrameRun::new(features),
            reuse,
            eye_paths_per_thread: eye_paths_per_thread(
                settings,
                &features,
                depth,
                buffers.light_tree_depth(),
            ),
            work_limits: WorkLimits::of(context.adapter.is_software()),
            sample_ms: None,
            gather_slices: GatherSlices::ONE,
            maps: photon_maps(&context, settings, &features, &buffers)?,
            reconstruction: reconstruct.is_on().then(|| Reconstruction::new(&context)),
            scene: buffers,
            is_bound: false,
            origin_in_world: DVec3::ZERO,
            hidden: hidden.as_ref().map(session::Hidden::new),
            submitter: None,
            mirror: None,
            still: still::StillView::default(),
            inspector: inspect::Inspector::default(),
            player,
            edit_base,
            context,
        };
        renderer.warm_up(library)?;
        Ok(renderer)
    }

    /// Compiles all passes and dispatches each once over nothing: some drivers compile at the first dispatch, and that time
    /// should not count as a frame's.
    fn warm_up(&mut self, library: &ShaderLibrary) -> Result<(), RenderError> {
        self.scene.begin_frame(&self.context, DVec3::ZERO)?;
        let stages = self.plan();
        let given = self.given();
        let is_given = |name: &str| given.get(name).is_some();
        let passes = &self.settings.user_passes;
        user_passes::check(passes, &stages, library, self.features(), is_given)?;
        let planned: Vec<PlannedStage> = self.plans().into_iter().flatten().collect();
        let steps = planned.iter().flat_map(|planned| &planned.steps);
        self.frame.compile(&self.context, library, steps)?;
        self.allocate_at(self.full_size)?;
        self.bind()?;
        self.context
            .queue
            .write_buffer(&self.frame_buffer, 0, &[0; size_of::<Frame>()]);
        let mut flight = Flight::new(0, false);
        self.pose(&mut flight)?;
        flight.land(&self.context)?;
        self.scene.forget_previous();
        Ok(self.frame.warm_up(&self.context)?)
    }

    /// The current plan: the frame's stages in order.
    #[cfg_attr(not(feature = "internals"), doc(hidden))]
    #[must_use]
    pub fn plan(&self) -> Vec<PlannedStage> {
        self.plan_with(&self.settings, self.reuse)
    }

    /// Bytes of the frame's buffers on the device.
    #[cfg_attr(not(feature = "internals"), doc(hidden))]
    #[must_use]
    pub fn frame_bytes(&self) -> u64 {
        self.frame.buffers.bytes()
    }

    /// Lets no images share memory, for comparison with frames where they do.
    #[cfg(feature = "internals")]
    pub fn keep_images_apart(&mut self) {
        self.frame.buffers.keep_apart();
        self.is_bound = false;
    }

    /// Cuts the eyes' work otherwise than the adapter asks for.
    #[cfg_attr(not(feature = "internals"), doc(hidden))]
    pub fn limit_work(&mut self, limits: WorkLimits) {
        self.work_limits = limits;
    }

    /// The plan with other settings of the present passes.
    fn plan_with(&self, settings: &RenderSettings, reuse: Reuse) -> Vec<PlannedStage> {
        plan(&FrameSpec {
            settings,
            features: *self.frame.features(),
            both: self.has_both_eyes(),
            reuse,
            paths_per_thread: self.eye_paths_per_thread,
            maps: self.maps.iter().map(|map| map.layout).collect(),
            slices: self.gather_slices,
            shapes: self.scene.deformer().map(|deformer| deformer.counts()),
            keeps_previous: self.scene.keeps_previous(),
        })
    }

    /// Resources that passes bind besides the frame's buffers.
    fn given(&self) -> Resources<'_> {
        let given = self.scene.resources().with("frame", &self.frame_buffer);
        match &self.reconstruction {
            Some(reconstruction) => given.with("reconstruction", &reconstruction.uniform),
            None => given,
        }
    }

    fn bind(&mut self) -> Result<(), GpuError> {
        let stages = self.plan();
        let layouts: Vec<MapLayout> = self.maps.iter().map(|map| map.layout).collect();
        let mut frame = std::mem::take(&mut self.frame);
        let bound = frame.bind(&self.context, &stages, &self.given(), &self.image, &layouts);
        self.frame = frame;
        self.is_bound = bound.is_ok();
        bound
    }

    /// The device.
    pub fn context(&self) -> &GpuContext {
        &self.context
    }

    /// A photon map, with the photon method; the caustic map if the scene has caustics.
    #[cfg_attr(not(feature = "internals"), doc(hidden))]
    pub fn map(&self, kind: MapKind) -> Option<&PhotonMap> {
        self.maps.iter().find(|map| map.kind() == kind)
    }

    /// The photon map, with the photon method.
    #[cfg_attr(not(feature = "internals"), doc(hidden))]
    pub fn photon_map(&self) -> Option<&PhotonMap> {
        self.map(MapKind::Photons)
    }

    /// The caustic map, with the photon method, if the scene has caustics.
    #[cfg_attr(not(feature = "internals"), doc(hidden))]
    pub fn caustic_map(&self) -> Option<&PhotonMap> {
        self.map(MapKind::Caustics)
    }

    /// Whether the right eye reuses the left one now.
    pub fn reuses(&self) -> bool {
        self.reuse != Reuse::Off
    }

    pub(crate) fn has_both_eyes(&self) -> bool {
        self.eye_choice == EyeChoice::Both
    }

    fn pixels(&self) -> usize {
        self.image.pixels() as usize
    }

    /// Parity of the last frame: which of two double buffers it wrote.
    fn parity(&self) -> usize {
        let reconstruction = self.reconstruction.as_ref();
        reconstruction.map_or(0, Reconstruction::parity)
    }

    /// The scene on the device.
    #[cfg_attr(not(feature = "internals"), doc(hidden))]
    pub fn scene(&self) -> &SceneBuffers {
        &self.scene
    }

    /// Gather radius in use, metres.
    pub fn radius_m(&self) -> f64 {
        self.radius_m
    }

    /// Gather radius of caustics in use, metres.
    pub fn caustic_radius_m(&self) -> f64 {
        self.caustic_radius_m
    }

    /// Shader features that the passes were compiled with.
    #[cfg_attr(not(feature = "internals"), doc(hidden))]
    pub fn features(&self) -> &ShaderFeatures {
        self.frame.features()
    }

    /// Names of the compiled passes.
    pub fn pass_names(&self) -> Vec<String> {
        self.frame.pass_names()
    }

    /// Origin of the last frame's render space (world, metres).
    pub fn origin_in_world(&self) -> DVec3 {
        self.origin_in_world
    }

    /// Renders one frame and waits for it. `progress` receives the number of finished samples.
    ///
    /// # Errors
    /// [`RenderError::Gpu`] naming the pass.
    pub fn render_frame(
        &mut self,
        views: &[View; 2],
        frame_index: u32,
        progress: impl FnMut(u32),
    ) -> Result<FrameResult, RenderError> {
        let flight = self.send(views, frame_index, true, progress)?;
        self.retire(flight)
    }

    /// Hands one frame's work to the device and waits for it only where photons are all traced anew: the map was just made,
    /// it has grown, an edit asks for it, or it is progressive. [`Renderer::retire`] frames in their order; before
    /// another is sent, at most two may be on their way.
    ///
    /// # Errors
    /// [`RenderError::Gpu`] naming the pass.
    pub fn send_frame(
        &mut self,
        views: &[View; 2],
        frame_index: u32,
        progress: impl FnMut(u32),
    ) -> Result<Flight, RenderError> {
        self.send(views, frame_index, false, progress)
    }

    /// As [`Renderer::send_frame`]; `lands`: waits for the frame's end, as a part of rendering it.
    fn send(
        &mut self,
        views: &[View; 2],
        frame_index: u32,
        lands: bool,
        mut progress: impl FnMut(u32),
    ) -> Result<Flight, RenderError> {
        let flight = self.prepare_frame(views, frame_index)?;
        let goes_on = |done| {
            progress(done);
            ControlFlow::Continue(())
        };
        self.send_eyes(flight, views, frame_index, lands, goes_on)
    }

    /// The first part of a frame, all but the eyes: moves the scene to the head, deforms meshes, traces photons.
    /// [`Renderer::send_eyes`] is the other part.
    ///
    /// # Errors
    /// As [`Renderer::send_frame`].
    pub(crate) fn prepare_frame(
        &mut self,
        views: &[View; 2],
        frame_index: u32,
    ) -> Result<Flight, RenderError> {
        self.frames_begun += 1;
        let mut flight = Flight::new(self.frames_begun, self.settings.output.chrome_trace);
        let began = Instant::now();
        self.take_quality_over()?;
        self.settle();
        if let Some(reconstruction) = &mut self.reconstruction {
            // Images of all samples, and what photons are traced with, may lie there.
            reconstruction.take_turns();
        }
        self.origin_in_world = View::midpoint_in_world(views);
        let replaced = self
            .scene
            .begin_frame(&self.context, self.origin_in_world)?;
        if replaced || !self.is_bound {
            self.bind()?;
        }
        flight.result.cpu_ms.update = flight.result.note("update", began);

        let began = Instant::now();
        self.pose(&mut flight)?;
        self.trace_for_sample(views, frame_index, 0, &mut flight)?;
        flight.result.cpu_ms.render = flight.result.note("render", began);
        Ok(flight)
    }

    /// Whether photons are traced anew for every sample, with a smaller radius each time.
    fn is_progressive(&self) -> bool {
        !self.maps.is_empty() && self.settings.photon.progressive
    }

    /// Which pass of progressive photon mapping a frame is, so that the mean of frames at rest converges: one per frame that
    /// saw the same as those before, or per several where their pixels are fewer than the photons' paths, so that frames do not
    /// take many times as long. 0, and with it the whole radius, once anything moves.
    fn pass_at_rest(&self, views: &[View; 2]) -> u32 {
        let settings = &self.settings;
        let refines = settings.photon.refine_at_rest && settings.reconstruct.still.is_on();
        let Some(known) = self.reconstruction.as_ref().filter(|_| refines) else {
            return 0;
        };
        if self.edit_base.outdates_photons || self.scene.scene_moved() {
            return 0;
        }
        let eyes = if self.has_both_eyes() { 2 } else { 1 };
        let pixels = eyes * self.image.pixels();
        let paths = self.maps.iter().map(|map| map.layout.config.paths);
        let paths: u64 = paths.map(u64::from).sum();
        let frame = self.frame_uniform(views, 0, 0, None);
        let alike = known.frames_alike(&frame, self.origin_in_world);
        let frames = paths.div_ceil(pixels.max(1)).max(1);
        (u64::from(alike.min(MOST_FRAMES_AT_REST)) / frames) as u32
    }

    /// Traces what photons are due for a sample.
    fn trace_for_sample(
        &mut self,
        views: &[View; 2],
        frame_index: u32,
        sample: u32,
        flight: &mut Flight,
    ) -> Result<(), RenderError> {
        self.progressive_pass = if self.is_progressive() {
            sample
        } else {
            self.pass_at_rest(views)
        };
        let photon_key = frame_index
            .wrapping_mul(PHOTON_KEY_STRIDE)
            .wrapping_add(sample);
        let anew = std::mem::take(&mut self.edit_base.outdates_photons) || self.is_progressive();
        self.trace_photons(views, frame_index, photon_key, anew, flight)?;
        Ok(self.slice_gathers()?)
    }

    /// The eyes of a frame that was prepared, as `views` have them by now; they may have moved a little since.
    ///
    /// # Errors
    /// As [`Renderer::send_frame`].
    pub(crate) fn send_eyes(
        &mut self,
        mut flight: Flight,
        views: &[View; 2],
        frame_index: u32,
        lands: bool,
        mut progress: impl FnMut(u32) -> ControlFlow<()>,
    ) -> Result<Flight, RenderError> {
        let began = Instant::now();
        self.update_hidden(views);
        let samples = self.settings.spp;
        let progressive = self.is_progressive();
        let per_submission = if progressive {
            1
        } else {
            SAMPLES_PER_SUBMISSION
        };
        let mut first = 0;
        while first < samples {
            let count = per_submission.min(samples - first);
            if first > 0 && progressive {
                self.trace_for_sample(views, frame_index, first, &mut flight)?;
            }
            let photons = self.photon_map().and_then(PhotonMap::traced_at);
            let frame = self.frame_uniform(views, frame_index, first, photons);
            self.write_frame_uniform(&frame);
            self.render_samples(views, &frame, [first, count], &mut flight)?;
            flight.eyes_sent.get_or_insert_with(Instant::now);
            first += count;
            if progress(first).is_break() && first < samples {
                return Err(RenderError::Interrupted);
            }
        }
        if lands {
            flight.land(&self.context)?;
        }
        flight.result.cpu_ms.render += flight.result.note("render", began);
        Ok(flight)
    }

    /// Times passes that do nothing, each in a submission of its own: what the device's clock says while the host's is
    /// known. Empty without timestamps.
    ///
    /// # Errors
    /// [`RenderError::Gpu`].
    #[cfg_attr(not(feature = "internals"), doc(hidden))]
    pub fn compare_clocks(&self) -> Result<Vec<Submission>, RenderError> {
        const TIMES: usize = 8;
        let mut times = PassTimes {
            submissions: Some(Vec::new()),
            ..PassTimes::default()
        };
        for _ in 0..TIMES {
            let mut recorder = FrameRecorder::new(&self.context, self.timer.as_ref(), "clock");
            recorder.nothing("clock");
            recorder.submit("clock", &mut times)?;
        }
        Ok(times.submissions.unwrap_or_default())
    }

    /// Deforms skinned and morphed meshes for the frame.
    fn pose(&mut self, flight: &mut Flight) -> Result<(), RenderError> {
        let Some(is_new) = self.scene.pose_due() else {
            return Ok(());
        };
        let mut recorder = FrameRecorder::new(&self.context, self.timer.as_ref(), "pose");
        let how = Play {
            is_due: &|only| only == Only::Always || is_new,
            ..Play::default()
        };
        self.frame.play(&mut recorder, Stage::Pose, &how)?;
        flight.tickets.push(recorder.send("pose")?);
        self.scene.note_posed(&self.context)
    }

    /// Renders samples `first` to `first + count` of both eyes, and reconstructs after the last one.
    fn render_samples(
        &mut self,
        views: &[View; 2],
        frame: &Frame,
        [first, count]: [u32; 2],
        flight: &mut Flight,
    ) -> Result<(), RenderError> {
        let right = if views[0] == views[1] && self.frame.has(Stage::RightEqual) {
            Stage::RightEqual
        } else {
            Stage::Right
        };
        let is_last = first + count >= self.settings.spp;
        if let Some(reconstruction) = self.reconstruction.as_mut().filter(|_| is_last) {
            reconstruction.begin_frame(
                &self.context,
                frame,
                self.origin_in_world,
                &self.settings,
                self.scene.scene_moved() | self.scene.take_repainted_image(),
                self.scene.total_power_w(),
            );
        }
        let new_recorder = || FrameRecorder::new(&self.context, self.timer.as_ref(), "frame");
        let mut recorder = new_recorder();
        let mut how = Play {
            parity: self.parity(),
            ..Play::default()
        };
        if first == 0 {
            self.frame.play(&mut recorder, Stage::Begin, &how)?;
        }
        let longest = self.frame.length(Stage::Left) + self.frame.length(right);
        let [width, height] = self.image.size.map(u64::from);
        let submission = self
            .work_limits
            .samples(&self.settings, width * height, self.sample_ms);
        let mut recorded = 0;
        while how.sample < count {
            if recorder.room() < longest || recorded == submission {
                let full = std::mem::replace(&mut recorder, new_recorder());
                flight.tickets.push(full.send("frame")?);
                recorded = 0;
            }
            self.frame.play(&mut recorder, Stage::Left, &how)?;
            self.frame.play(&mut recorder, right, &how)?;
            recorded += 1;
            how.sample += 1;
        }
        if is_last {
            self.frame.play(&mut recorder, Stage::Reconstruct, &how)?;
        }
        if is_last {
            self.ask_counters(&mut recorder, flight);
        }
        flight.tickets.push(recorder.send("frame")?);
        if is_last {
            self.scene.note_asked();
            self.inspector.note(frame);
        }
        Ok(())
    }

    /// Sets the gather's slices by what the maps hold.
    fn slice_gathers(&mut self) -> Result<(), GpuError> {
        let of = |kind| self.map(kind).map_or(1, PhotonMap::steered_slices);
        let [photons, caustics] = MapKind::ALL.map(of);
        let photon = &self.settings.photon;
        let slices = if photon.search == Search::Grid && photon.loads == Loads::Direct {
            // Slices share out cells, and both maps' gathers count them alike.
            let most = photons.max(caustics);
            GatherSlices {
                photons: most,
                caustics: most,
            }
        } else {
            GatherSlices { photons, caustics }
        };
        if slices == self.gather_slices {
            return Ok(());
        }
        self.gather_slices = slices;
        if slices.photons > 1 && photon.estimate == PhotonEstimate::Nearest {
            self.image.heap_bytes = (u64::from(photon.nearest) + 1) * 8;
        }
        self.bind()
    }

    /// As [`Renderer::reconstruction`], to drop history.
    #[cfg(feature = "internals")]
    pub fn reconstruction_mut(&mut self) -> Option<&mut Reconstruction> {
        self.reconstruction.as_mut()
    }

    /// Denoising, if settings ask for it.
    #[cfg(feature = "internals")]
    pub fn reconstruction(&self) -> Option<&Reconstruction> {
        self.reconstruction.as_ref()
    }
}
