//! The renderer: images from views.
//!
//! [`Renderer::render_frame`] is the whole frame. It moves the scene to the head ([`SceneBuffers::begin_frame`]), traces
//! photons if the map is missing or out of date, renders the left eye, reuses it in the right eye, renders the remaining
//! pixels, and reads back counters. Images stay on the device until they are asked for.

pub mod deform;
pub mod driver_limits;
mod editing;
pub mod features;
mod frame_spec;
mod frame_uniform;
pub mod frames_in_flight;
mod inspect;
pub mod inspection;
pub mod instance_table;
pub mod mirror;
mod one_frame;
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

use std::collections::VecDeque;

use glam::DVec3;
use thiserror::Error;

use crate::bvh::BvhError;
use crate::frame::user_passes;
use crate::frame::{FrameRun, FrameSpec, GatherSlices, ImageLayout, MapLayout, PlannedStage, plan};
use crate::gpu::timing::{Timed, Timer};
use crate::gpu::{GpuContext, GpuError, Resources, ShaderFeatures, ShaderLibrary, uniform_buffer};
use crate::renderer::packing::{PackError, check_user_bsdfs};
use crate::renderer::records::frame::Frame;
use crate::scene::{Needs, Player, Scene, SceneError};
use crate::settings::{Eyes as EyeChoice, Kept, Quality, RenderSettings, Reuse, Timestamps};
use crate::xr::SessionInfo;

pub use crate::frame::{Eye, MapKind, Stage};
pub use driver_limits::{WorkLimits, eye_paths_per_thread, photon_paths_per_thread};
pub use editing::{Applied, InPlace};
pub use features::{chooses_mips, light_candidates, reuses_glossy, shader_features, splits_light};
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
    /// A scene that does not hold together.
    #[error(transparent)]
    Scene(#[from] SceneError),
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
    progressive_pass: radii::ProgressivePass,
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
    /// Device milliseconds of a sample of a pixel of both eyes, in the frame that was retired last.
    pixel_ms: Option<f64>,
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
        session::check_size(size)?;
        scene.check()?;
        check_user_bsdfs(library, &scene.materials)?;
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
            progressive_pass: radii::ProgressivePass::first(settings.photon.progressive_alpha),
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
            pixel_ms: None,
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
