//! From views to images: the passes of a frame, recorded in order.
//!
//! [`Renderer::render_frame`] is the whole frame. It moves the scene to the head ([`SceneBuffers::begin_frame`]), traces
//! photons if the map is missing or out of date, renders the left eye, carries it over to the right eye, fills what is
//! left, and reads back counters. Images stay on the device until they are asked for.

pub mod choices;
pub mod deform;
mod editing;
mod eye_buffers;
mod eye_plan;
pub mod eyes;
pub mod frame_list;
mod half_rate;
mod inspect;
pub mod inspection;
pub mod instance_table;
pub mod kd_tree;
pub mod kernels;
mod map_config;
pub mod mirror;
mod moving;
mod own_meshes;
pub mod parts;
pub mod photon_map;
mod photon_records;
mod photons_over_time;
mod raster;
pub mod reconstruction;
pub mod scene_buffers;
mod session;
pub mod stats;
pub mod submit;

use std::time::Instant;

use glam::{DQuat, DVec3};
use thiserror::Error;

use crate::bvh::BvhError;
use crate::gpu::scene::{PackError, check_user_bsdfs};
use crate::gpu::shaders::ShaderFeatures;
use crate::gpu::timing::{Timer, milliseconds_since};
use crate::gpu::types::frame::{
    Eye as EyeUniform, FRAME_DIRECT_FROM_MAP, FRAME_KERNEL_CONE, FRAME_KERNEL_EPANECHNIKOV,
    FRAME_RUSSIAN_ROULETTE, Frame,
};
use crate::gpu::{FrameRecorder, GpuContext, GpuError, PassTimes, ShaderLibrary, uniform_buffer};
use crate::passes::{self, Pass};
use crate::scene::{Needs, Player, Scene};
use crate::settings::{
    DirectLight, Eyes as EyeChoice, Force, Kernel as DensityKernel, Loads, Method, RenderSettings,
    Search,
};
use crate::xr::{HiddenArea, View};

pub use choices::{
    automatic_radius_m, carries_indirect, caustic_paths, forms_caustics, light_candidates,
    photon_paths_per_thread, progressive_radius_m, sample_passes, samples_per_dispatch,
    shader_features, splits_light, stereo_passes,
};
pub use editing::{Applied, InPlace};
pub use eye_plan::{EyePlan, GatherSlices};
pub use eyes::{Eye, Eyes, SAMPLES_PER_SUBMISSION};
pub use inspection::{Inspected, InspectedValues, Inspection, SeenSurface};
pub use instance_table::{InstanceId, InstanceTable};
pub use kd_tree::KdTree;
pub use kernels::KernelSet;
pub use parts::RadianceParts;
pub use photon_map::{MapKind, Photon, PhotonCounters, PhotonGrid, PhotonMap, PhotonMapConfig};
pub use reconstruction::{Reconstruction, ReconstructionPlan};
pub use scene_buffers::SceneBuffers;
pub use stats::{
    CpuTimes, FilledBecause, FrameResult, MapStats, PhotonStats, Provenance, StereoStats,
};
pub use submit::Submitter;

use choices::{LEAST_RADIUS_M, radius_for_area_m};

/// Distance of two frames' photon keys: progressive mode numbers its samples in between.
const PHOTON_KEY_STRIDE: u32 = 1_000_003;
/// Caustic radius over the photons' radius, where both are automatic. In `caustic`, relMSE at shares of 1 and 0.5 was 2.98
/// and 0.39 with 2^12 photons (4 passes), 0.062 and 0.084 with 2^16, 0.023 and 0.034 with 2^19; in the gallery, the same:
/// half loses little where photons are many and gains most where the whole radius would smear the spot.
const AUTOMATIC_CAUSTIC_RADIUS: f64 = 0.5;
/// Passes that one sample records at most, gathering slices aside.
const PASSES_PER_SAMPLE: usize = 64;
/// GGX alpha up to which eye paths follow a reflection. Wider lobes gather photons.
const FOLLOW_MAX_ALPHA: f32 = 0.05;

/// What can go wrong while a frame is made.
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
    /// Settings that do not go together.
    #[error("{0}")]
    Settings(String),
}

/// Everything that turns views into images for one scene and one set of settings.
pub struct Renderer {
    context: GpuContext,
    settings: RenderSettings,
    features: ShaderFeatures,
    eye_choice: EyeChoice,
    width: u32,
    height: u32,
    radius_m: f64,
    caustic_radius_m: f64,
    /// The sample in hand; its radii are smaller in progressive mode.
    progressive_sample: u32,
    refresh: photons_over_time::Refresh,
    scene: SceneBuffers,
    kernels: KernelSet,
    photon_map: Option<PhotonMap>,
    caustic_map: Option<PhotonMap>,
    eyes: Eyes,
    reconstruction: Option<Reconstruction>,
    frame_uniform: wgpu::Buffer,
    timer: Option<Timer>,
    is_bound: bool,
    origin_in_world: DVec3,
    hidden: Option<session::Hidden>,
    submitter: Option<Submitter>,
    mirror: Option<mirror::MirrorPass>,
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
        Self::with_hidden_area(context, library, scene, settings, eye_choice, size, None)
    }

    /// As [`Renderer::new`], with no rays for the pixels that lie in `hidden`, left and right.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn with_hidden_area(
        context: GpuContext,
        library: &ShaderLibrary,
        scene: &Scene,
        settings: &RenderSettings,
        eye_choice: EyeChoice,
        size: [u32; 2],
        hidden: Option<&[HiddenArea; 2]>,
    ) -> Result<Self, RenderError> {
        check_user_bsdfs(library, scene)?;
        settings
            .photon
            .check_gather()
            .map_err(RenderError::Settings)?;
        let edit_base = editing::EditBase::new(scene);
        let needs = Needs::with_facts(scene, &edit_base.facts);
        let mut features = shader_features(&needs, settings);
        features.insert("visibility_mask".to_owned(), hidden.is_some());
        let texels = match settings.force.record_texels {
            Force::Auto => context.adapter.is_software(),
            forced => forced == Force::On,
        };
        features.insert(kernels::RECORD_TEXELS.to_owned(), texels);
        let mut buffers = SceneBuffers::new(&context, scene, &features)?;
        let animation = &settings.animation;
        let player = Player::new(scene, &animation.clip, animation.speed, animation.time_s)
            .map_err(|error| RenderError::Settings(error.to_string()))?;
        let photon = settings.method == Method::Photon;
        let both = eye_choice == EyeChoice::Both;
        let caustics = photon && forms_caustics(&features);
        let stereo = if both {
            stereo_passes(settings.reuse)
        } else {
            &[]
        };
        let plan = EyePlan {
            sample: sample_passes(settings, caustics),
            run: if photon || !stereo.is_empty() {
                1
            } else {
                samples_per_dispatch(settings, &features, buffers.hierarchy_depth())
            },
            photon,
            caustics,
            stereo,
            parts: splits_light(settings),
            carries_indirect: both && carries_indirect(settings, &features),
            nearest: settings.photon.nearest,
            half_rate: photon && settings.photon.half_rate,
            texels,
        };
        let has_lights = buffers.light_count() > 0;
        let map_config = |kind, paths| PhotonMapConfig {
            kind,
            // Without lights there is nothing to emit, and no path may be traced for it.
            paths: if has_lights { paths } else { 0 },
            shares: settings.photon.shares,
            max_depth: settings.photon.max_depth,
            paths_per_thread: photon_paths_per_thread(
                context.adapter.is_software(),
                settings.photon.max_depth,
                buffers.hierarchy_depth(),
            ),
            capacity: settings.photon.capacity,
            texels,
            cells: settings.photon.grid_cells_max,
            search: match kind {
                MapKind::Photons => settings.photon.search,
                MapKind::Caustics => Search::Grid,
            },
            loads: match kind {
                MapKind::Photons => settings.photon.loads,
                MapKind::Caustics => Loads::Direct,
            },
        };
        let photon_config = photon.then(|| map_config(MapKind::Photons, settings.photon.count));
        let caustic_config =
            caustics.then(|| map_config(MapKind::Caustics, caustic_paths(settings)));
        let mut wanted: Vec<&Pass> = plan.sample.clone();
        if plan.half_rate {
            wanted.extend(passes::COARSE_FIRST.iter().chain(passes::COARSE_SPREAD));
        }
        if buffers.deformer().is_some() {
            wanted.extend(passes::DEFORM);
        }
        for config in photon_config.iter().chain(&caustic_config) {
            wanted.extend(config.passes());
        }
        let mut filling: Vec<&Pass> = Vec::new();
        if !plan.stereo.is_empty() {
            wanted.extend(plan.stereo.iter().chain(passes::FILL_REASONS));
            wanted.extend(passes::STEREO_EQUAL);
            filling.extend(&plan.sample);
            if plan.carries_indirect {
                wanted.extend(passes::FILL_INDIRECT);
            }
        }
        let reconstruction_plan = ReconstructionPlan::of(&settings.reconstruct, both);
        if let Some(plan) = &reconstruction_plan {
            wanted.extend(plan.passes());
        }
        let follows_motion = wanted.contains(&&passes::motion::PASS);
        buffers.keep_previous(follows_motion || settings.output.motion);
        features.insert("carry_indirect".to_owned(), plan.carries_indirect);
        features.insert("one_sample".to_owned(), settings.spp == 1);
        features.insert("keeps_samples".to_owned(), !plan.stereo.is_empty());
        let kernels = KernelSet::new(&context, library, &features, &wanted, &filling)?;
        let map = |config| PhotonMap::new(&context, config);
        let photon_map = photon_config.map(map).transpose()?;
        let caustic_map = caustic_config.map(map).transpose()?;
        let radius_m = if settings.photon.radius_m > 0.0 {
            settings.photon.radius_m.max(LEAST_RADIUS_M)
        } else {
            radius_for_area_m(edit_base.facts.area_m2(scene), settings.photon.count)
        };
        let caustic_radius_m = if settings.photon.caustic_radius_m > 0.0 {
            settings.photon.caustic_radius_m.max(LEAST_RADIUS_M)
        } else {
            radius_m * AUTOMATIC_CAUSTIC_RADIUS
        };
        let eyes = Eyes::new(&context, size, plan, both)?;
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let reconstruction = reconstruction_plan
            .map(|plan| Reconstruction::new(&context, plan, pixels, both))
            .transpose()?;
        let mut renderer = Self {
            frame_uniform: uniform_buffer(&context, "frame", size_of::<Frame>() as u64),
            timer: Timer::new(&context).filter(|_| settings.gpu.timestamps),
            settings: settings.clone(),
            features,
            eye_choice,
            width: size[0],
            height: size[1],
            radius_m,
            caustic_radius_m,
            progressive_sample: 0,
            refresh: photons_over_time::Refresh::default(),
            scene: buffers,
            kernels,
            photon_map,
            caustic_map,
            eyes,
            reconstruction,
            is_bound: false,
            origin_in_world: DVec3::ZERO,
            hidden: hidden.map(session::Hidden::new),
            submitter: None,
            mirror: None,
            inspector: inspect::Inspector::default(),
            player,
            edit_base,
            context,
        };
        renderer.warm_up()?;
        Ok(renderer)
    }

    /// Runs every pass once over nothing: some drivers compile a shader only when it is first dispatched, and that
    /// time belongs to no frame.
    fn warm_up(&mut self) -> Result<(), RenderError> {
        self.scene.begin_frame(&self.context, DVec3::ZERO)?;
        self.bind()?;
        self.context
            .queue
            .write_buffer(&self.frame_uniform, 0, &[0; size_of::<Frame>()]);
        let recorder = FrameRecorder::new(&self.context, None, "warm-up");
        self.scene.deform(
            &self.context,
            recorder,
            &self.kernels,
            &mut PassTimes::default(),
        )?;
        self.scene.forget_previous();
        let mut recorder = FrameRecorder::new(&self.context, None, "warm-up");
        for map in self.maps() {
            map.record_warm_up(&mut recorder, &self.kernels)?;
        }
        self.eyes.record_warm_up(&mut recorder, &self.kernels)?;
        if let Some(reconstruction) = &self.reconstruction {
            reconstruction.record(&mut recorder, &self.kernels, [0, 0])?;
        }
        Ok(recorder.submit("warm-up", &mut PassTimes::default())?)
    }

    /// The device.
    pub fn context(&self) -> &GpuContext {
        &self.context
    }

    /// Images of both eyes.
    pub fn eyes(&self) -> &Eyes {
        &self.eyes
    }

    /// The photon map, with the photon method.
    pub fn photon_map(&self) -> Option<&PhotonMap> {
        self.photon_map.as_ref()
    }

    /// The map of caustics, with the photon method, where the scene can form them.
    pub fn caustic_map(&self) -> Option<&PhotonMap> {
        self.caustic_map.as_ref()
    }

    fn maps(&self) -> impl Iterator<Item = &PhotonMap> {
        self.photon_map.iter().chain(&self.caustic_map)
    }

    /// The scene on the device.
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
    pub fn features(&self) -> &ShaderFeatures {
        &self.features
    }

    /// Names of the compiled passes.
    pub fn pass_names(&self) -> Vec<String> {
        self.kernels.names()
    }

    /// Origin of the last frame's render space (world, metres).
    pub fn origin_in_world(&self) -> DVec3 {
        self.origin_in_world
    }

    /// Renders one frame. `progress` is told how many of the frame's samples are done.
    ///
    /// # Errors
    /// [`RenderError::Gpu`] naming the pass.
    pub fn render_frame(
        &mut self,
        views: &[View; 2],
        frame_index: u32,
        mut progress: impl FnMut(u32),
    ) -> Result<FrameResult, RenderError> {
        let mut result = FrameResult::default();
        let began = Instant::now();
        let origin = midpoint(views);
        self.origin_in_world = origin;
        self.update_hidden(views);
        let replaced = self.scene.begin_frame(&self.context, origin)?;
        if replaced || !self.is_bound {
            self.bind()?;
        }
        result.cpu_ms.update = milliseconds_since(began);

        let began = Instant::now();
        let scene_changed = self.scene.scene_moved();
        let recorder = FrameRecorder::new(&self.context, self.timer.as_ref(), "pose");
        self.scene
            .deform(&self.context, recorder, &self.kernels, &mut result.times)?;
        let samples = self.settings.spp;
        // Progressive mode traces photons anew for every sample, with a smaller radius each time.
        let progressive = self.photon_map.is_some() && self.settings.photon.progressive;
        let per_submission = if progressive {
            1
        } else {
            SAMPLES_PER_SUBMISSION
        };
        let mut first = 0;
        while first < samples {
            let count = per_submission.min(samples - first);
            if first == 0 || progressive {
                self.progressive_sample = first;
                let photon_key = frame_index
                    .wrapping_mul(PHOTON_KEY_STRIDE)
                    .wrapping_add(first);
                let anew = std::mem::take(&mut self.edit_base.outdates_photons) || progressive;
                self.trace_photons(views, frame_index, photon_key, anew, &mut result)?;
                let slices = self.gather_slices();
                if self.eyes.set_gather_slices(&self.context, slices)? {
                    self.bind()?;
                }
            }
            self.eyes.set_equal(views[0] == views[1]);
            let photons = self.photon_map.as_ref().and_then(PhotonMap::traced_at);
            let frame = self.write_frame_uniform(views, frame_index, first, photons);
            let is_last = first + count >= samples;
            if let Some(reconstruction) = self.reconstruction.as_mut().filter(|_| is_last) {
                reconstruction.begin_frame(
                    &self.context,
                    &frame,
                    origin,
                    &self.settings,
                    self.eyes.carries_rays(),
                    scene_changed,
                );
            }
            let mut recorder = FrameRecorder::new(&self.context, self.timer.as_ref(), "frame");
            if first == 0 {
                self.eyes.record_clear(&mut recorder);
            }
            let mut sample = 0;
            while sample < count {
                if recorder.room() < PASSES_PER_SAMPLE {
                    let full = std::mem::replace(
                        &mut recorder,
                        FrameRecorder::new(&self.context, self.timer.as_ref(), "frame"),
                    );
                    full.submit("frame", &mut result.times)?;
                }
                let run = self.eyes.next_run(count - sample);
                self.record_sample(&mut recorder, sample, run)?;
                sample += run;
            }
            first += count;
            if let Some(reconstruction) = self.reconstruction.as_ref().filter(|_| is_last) {
                let size = [self.width, self.height];
                reconstruction.record(&mut recorder, &self.kernels, size)?;
            }
            recorder.submit("frame", &mut result.times)?;
            if is_last {
                self.inspector.note(&frame);
            }
            progress(first);
        }
        result.cpu_ms.render = milliseconds_since(began);

        let began = Instant::now();
        if let Some(counters) = self.eyes.read_counters(&self.context)? {
            result.stereo = StereoStats::from_counters(&counters);
        }
        self.scene.check_cost(&self.context)?;
        result.cpu_ms.read_back = milliseconds_since(began);
        Ok(result)
    }

    fn gather_slices(&self) -> GatherSlices {
        let of = |map: &Option<PhotonMap>| map.as_ref().map_or(1, PhotonMap::gather_slices);
        let (photons, caustics) = (of(&self.photon_map), of(&self.caustic_map));
        let photon = &self.settings.photon;
        if photon.search == Search::Grid && photon.loads == Loads::Direct {
            // Slices share out cells, and both maps' gathers count them alike.
            let most = photons.max(caustics);
            return GatherSlices {
                photons: most,
                caustics: most,
            };
        }
        GatherSlices { photons, caustics }
    }

    fn record_sample(
        &self,
        recorder: &mut FrameRecorder<'_>,
        sample: u32,
        run: u32,
    ) -> Result<(), GpuError> {
        // A single eye is rendered into the left buffers through its own view.
        self.eyes
            .record_sample(recorder, &self.kernels, Eye::Left, sample, run)?;
        if self.eye_choice == EyeChoice::Both {
            self.eyes
                .record_sample(recorder, &self.kernels, Eye::Right, sample, run)?;
        }
        Ok(())
    }

    fn bind(&mut self) -> Result<(), GpuError> {
        self.scene.bind(&self.context, &self.kernels)?;
        let scene = self.scene.resources().with("frame", &self.frame_uniform);
        for map in self.photon_map.iter_mut().chain(&mut self.caustic_map) {
            map.bind(&self.context, &self.kernels, &scene)?;
        }
        if let Some(reconstruction) = &mut self.reconstruction {
            reconstruction.bind(&self.context, &self.kernels, &scene, &self.eyes)?;
        }
        let [photons, caustics] = [&self.photon_map, &self.caustic_map]
            .map(|map| map.as_ref().map(PhotonMap::resources).unwrap_or_default());
        self.eyes.bind(
            &self.context,
            &self.kernels,
            &scene.and(&photons),
            &caustics,
        )?;
        self.is_bound = true;
        Ok(())
    }

    fn write_frame_uniform(
        &self,
        views: &[View; 2],
        frame_index: u32,
        first_sample: u32,
        photons: Option<(DVec3, u32)>,
    ) -> Frame {
        let origin = self.origin_in_world;
        let settings = &self.settings;
        let mut views = *views;
        if self.eye_choice == EyeChoice::Right {
            views[0] = views[1];
        }
        let mut flags = 0;
        if settings.path.russian_roulette {
            flags |= FRAME_RUSSIAN_ROULETTE;
        }
        if settings.photon.direct == DirectLight::Map {
            flags |= FRAME_DIRECT_FROM_MAP;
        }
        flags |= match settings.photon.kernel {
            DensityKernel::Constant => 0,
            DensityKernel::Epanechnikov => FRAME_KERNEL_EPANECHNIKOV,
            DensityKernel::Cone => FRAME_KERNEL_CONE,
        };
        let radius_now_m = |first_radius_m| {
            let alpha = settings.photon.progressive_alpha;
            progressive_radius_m(first_radius_m, alpha, self.progressive_sample) as f32
        };
        let (photon_origin, photon_frame_index) = photons.unwrap_or((origin, frame_index));
        let frame = Frame {
            left: eye_uniform(&views[0], origin),
            right: eye_uniform(&views[1], origin),
            left_from_right: (views[0].position_in_world - views[1].position_in_world)
                .as_vec3()
                .to_array(),
            flags,
            photon_offset: (photon_origin - origin).as_vec3().to_array(),
            photon_radius: radius_now_m(self.radius_m),
            width: self.width,
            height: self.height,
            seed: settings.seed,
            frame_index,
            first_sample,
            sample_count: settings.spp,
            max_depth: match settings.method {
                Method::Path => settings.path.max_depth,
                Method::Photon => settings.photon.max_depth,
            },
            caustic_radius: radius_now_m(self.caustic_radius_m),
            photon_frame_index,
            normal_min_cos: settings.photon.normal_min_cos as f32,
            reuse_max_view_dependence: settings.stereo.max_view_dependence as f32,
            follow_max_alpha: FOLLOW_MAX_ALPHA,
            reuse_max_lobe_shift: settings.stereo.max_lobe_shift as f32,
            nearest_photons: settings.photon.nearest,
            light_candidates: light_candidates(self.scene.light_count(), &self.features, settings),
            padding: 0,
        };
        self.context
            .queue
            .write_buffer(&self.frame_uniform, 0, bytemuck::bytes_of(&frame));
        frame
    }

    /// Radiance of an eye's pixels, row 0 on top: the mean over the frame's samples, or what was reconstructed from it.
    ///
    /// # Errors
    /// [`RenderError::Gpu`].
    pub fn read_radiance(&self, eye: Eye) -> Result<Option<Vec<[f32; 3]>>, RenderError> {
        let Some(eye) = self.buffers_of(eye) else {
            return Ok(None);
        };
        let pixels = self.width as usize * self.height as usize;
        Ok(match &self.reconstruction {
            Some(reconstruction) => reconstruction.read_radiance(&self.context, eye, pixels)?,
            None => self.read_samples(eye)?,
        })
    }

    /// Mean radiance over the frame's samples alone, whatever is reconstructed from it. `eye` names the buffers: a single
    /// eye lies in the left ones.
    ///
    /// # Errors
    /// [`RenderError::Gpu`].
    pub fn read_samples(&self, eye: Eye) -> Result<Option<Vec<[f32; 3]>>, RenderError> {
        Ok(self
            .eyes
            .read_radiance(&self.context, eye, self.settings.spp)?)
    }

    /// An eye's picture in display light, 0 to 1, before the sRGB curve, with `reconstruct.taa`; `None` without, or for
    /// an eye that is not rendered.
    ///
    /// # Errors
    /// [`RenderError::Gpu`].
    pub fn read_displayed(&self, eye: Eye) -> Result<Option<Vec<[f32; 3]>>, RenderError> {
        let (Some(eye), Some(reconstruction)) = (self.buffers_of(eye), &self.reconstruction) else {
            return Ok(None);
        };
        let pixels = self.width as usize * self.height as usize;
        Ok(reconstruction.read_displayed(&self.context, eye, pixels)?)
    }

    /// As [`Renderer::reconstruction`], to forget the frames before.
    pub fn reconstruction_mut(&mut self) -> Option<&mut Reconstruction> {
        self.reconstruction.as_mut()
    }

    /// The passes that clean frames up, where settings ask for them.
    pub fn reconstruction(&self) -> Option<&Reconstruction> {
        self.reconstruction.as_ref()
    }

    /// Mean radiance of an eye split into direct and indirect light, and the albedo; `None` for an eye that is not
    /// rendered, or without `output.parts`.
    ///
    /// # Errors
    /// [`RenderError::Gpu`].
    pub fn read_parts(&self, eye: Eye) -> Result<Option<RadianceParts>, RenderError> {
        let Some(eye) = self.buffers_of(eye).filter(|_| self.settings.output.parts) else {
            return Ok(None);
        };
        Ok(self
            .eyes
            .read_parts(&self.context, eye, self.settings.spp)?)
    }

    /// Whose buffers hold an eye's image: a single eye is rendered into the left ones.
    fn buffers_of(&self, eye: Eye) -> Option<Eye> {
        match (self.eye_choice, eye) {
            (EyeChoice::Both, eye) => Some(eye),
            (EyeChoice::Left, Eye::Left) | (EyeChoice::Right, Eye::Right) => Some(Eye::Left),
            _ => None,
        }
    }
}

/// The point half way between the eyes: the origin of the frame's render space. Taken from the views alone, so that a
/// recorded trace replays bit for bit.
fn midpoint(views: &[View; 2]) -> DVec3 {
    let left = views[0].position_in_world;
    left + 0.5 * (views[1].position_in_world - left)
}

fn eye_uniform(view: &View, origin_in_world: DVec3) -> EyeUniform {
    let tangents = view.fov.tangents();
    let orientation: DQuat = view.orientation;
    EyeUniform {
        position: (view.position_in_world - origin_in_world)
            .as_vec3()
            .to_array(),
        tan_left: tangents.left as f32,
        axis_x: (orientation * DVec3::X).as_vec3().to_array(),
        tan_right: tangents.right as f32,
        axis_y: (orientation * DVec3::Y).as_vec3().to_array(),
        tan_up: tangents.up as f32,
        axis_z: (orientation * DVec3::Z).as_vec3().to_array(),
        tan_down: tangents.down as f32,
    }
}
