//! Clean pictures of noisy frames: the passes of [`passes::RECONSTRUCT_SVGF`] and [`passes::RECONSTRUCT_SHOWN`], their
//! buffers, and what is kept from frame to frame.
//!
//! What a frame keeps lies in two buffers that take turns, so that no pass writes what it reads and nothing is copied or
//! allocated per frame; both turns are bound once.

use crate::gpu::buffers::read_buffer;
use crate::gpu::kernel::{Bound, dispatch_table};
use crate::gpu::types::frame::{Eye as EyeUniform, Frame};
use crate::gpu::types::reconstruction::Reconstruction as Uniform;
use crate::gpu::{FrameRecorder, GpuContext, GpuError, Resources, storage_buffer, uniform_buffer};
use crate::passes::{self, Pass};
use crate::settings::{ReconstructSettings, RenderSettings};

use super::eyes::{Eye, Eyes};
use super::kernels::KernelSet;
use glam::DVec3;

/// Dispatch table entries of an eye: one per a-trous pass.
const TURNS: u32 = 8;

/// What of it runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ReconstructionPlan {
    /// Filtering.
    pub svgf: bool,
    /// Sharing between the eyes.
    pub stereo: bool,
    /// Temporal anti-aliasing.
    pub taa: bool,
    /// The mean of still frames.
    pub still: bool,
    /// Passes of the wavelet.
    pub atrous_passes: u32,
}

impl ReconstructionPlan {
    /// What `settings` ask for; none if nothing. `both`: whether both eyes are rendered.
    #[must_use]
    pub fn of(settings: &ReconstructSettings, both: bool) -> Option<Self> {
        settings.is_on().then_some(Self {
            svgf: settings.svgf,
            stereo: settings.svgf && settings.stereo && both,
            taa: settings.taa,
            still: settings.still,
            atrous_passes: settings.atrous_passes,
        })
    }

    /// The passes that run, in order, each named once.
    #[must_use]
    pub fn passes(&self) -> Vec<&'static Pass> {
        let runs = |pass: &Pass| match pass.name {
            "motion" => self.svgf || self.taa,
            "stereo_share" => self.stereo,
            "taa" => self.taa,
            "recombine" => true,
            _ => self.svgf,
        };
        passes::RECONSTRUCT_SVGF
            .iter()
            .chain(passes::RECONSTRUCT_SHOWN)
            .copied()
            .filter(|pass| runs(pass))
            .collect()
    }
}

/// Light in two kinds with its variance: 16 bytes per pixel each.
struct LightBuffers {
    direct: wgpu::Buffer,
    indirect: wgpu::Buffer,
}

/// Buffers of one eye.
struct EyeBuffers {
    /// This frame's and the one's before, in turn.
    seen: [wgpu::Buffer; 2],
    motion: wgpu::Buffer,
    /// What surfaces send out by themselves, three numbers.
    emission: wgpu::Buffer,
    moments: [wgpu::Buffer; 2],
    lengths: [wgpu::Buffer; 2],
    /// Before the eyes share.
    own_moments: wgpu::Buffer,
    own_length: wgpu::Buffer,
    /// Two that the filter goes back and forth between, and the one that the next frame reads.
    light: [LightBuffers; 2],
    history: LightBuffers,
    still_sum: wgpu::Buffer,
    reconstructed: wgpu::Buffer,
    displayed: [wgpu::Buffer; 2],
}

/// One bound pass.
struct Step {
    pass: &'static Pass,
    eye: Eye,
    /// Which a-trous pass.
    turn: u32,
    bound: Bound,
}

/// Where light lies while it is filtered.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Slot {
    Light(usize),
    History,
}

impl Slot {
    /// A slot to write while this one is read.
    fn other(self) -> Self {
        match self {
            Self::Light(0) => Self::Light(1),
            _ => Self::Light(0),
        }
    }
}

/// The passes, their buffers and the memory from frame to frame.
pub struct Reconstruction {
    plan: ReconstructionPlan,
    eyes: Vec<(Eye, EyeBuffers)>,
    uniform: wgpu::Buffer,
    dispatch: wgpu::Buffer,
    /// By turn: the frame's number modulo 2.
    steps: [Vec<Step>; 2],
    turn: usize,
    before: Option<Before>,
    still_frames: u32,
}

/// What is remembered of the frame before.
#[derive(Clone, Copy, PartialEq)]
struct Before {
    left: EyeUniform,
    right: EyeUniform,
    origin_in_world: DVec3,
}

impl Reconstruction {
    /// Allocates what `plan` needs for images of `pixels` pixels.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`].
    pub fn new(
        context: &GpuContext,
        plan: ReconstructionPlan,
        pixels: u64,
        both: bool,
    ) -> Result<Self, GpuError> {
        let mut eyes = vec![(
            Eye::Left,
            EyeBuffers::new(context, Eye::Left, pixels, plan)?,
        )];
        if both {
            eyes.push((
                Eye::Right,
                EyeBuffers::new(context, Eye::Right, pixels, plan)?,
            ));
        }
        let entries: Vec<[u32; 4]> = (0..2)
            .flat_map(|eye| (0..TURNS).map(move |turn| [turn, eye, 0, 0]))
            .collect();
        Ok(Self {
            plan,
            eyes,
            uniform: uniform_buffer(context, "reconstruction", size_of::<Uniform>() as u64),
            dispatch: dispatch_table(context, "reconstruction", &entries),
            steps: [Vec::new(), Vec::new()],
            turn: 0,
            before: None,
            still_frames: 0,
        })
    }

    /// What runs.
    pub fn plan(&self) -> ReconstructionPlan {
        self.plan
    }

    /// Frames, this one included, since anything moved.
    pub fn still_frames(&self) -> u32 {
        self.still_frames
    }

    /// Forgets the frames before: the next one begins anew.
    pub fn reset(&mut self) {
        self.before = None;
        self.still_frames = 0;
    }

    /// Binds all passes; `scene` holds the scene's buffers and the frame uniform.
    ///
    /// # Errors
    /// As [`crate::gpu::Kernel::bind`].
    pub fn bind(
        &mut self,
        context: &GpuContext,
        kernels: &KernelSet,
        scene: &Resources<'_>,
        images: &Eyes,
    ) -> Result<(), GpuError> {
        for turn in 0..2 {
            self.steps[turn] = self.bind_turn(context, kernels, scene, images, turn)?;
        }
        Ok(())
    }

    fn bind_turn(
        &self,
        context: &GpuContext,
        kernels: &KernelSet,
        scene: &Resources<'_>,
        images: &Eyes,
        turn: usize,
    ) -> Result<Vec<Step>, GpuError> {
        let mut steps = Vec::new();
        let mut add = |eye: Eye, pass: &'static Pass, turn: u32, resources: Resources<'_>| {
            let shared = scene
                .clone()
                .and(&images.finished(eye).unwrap_or_default())
                .with("dispatch", &self.dispatch)
                .with("reconstruction", &self.uniform)
                .and(&resources);
            steps.push(Step {
                pass,
                eye,
                turn,
                bound: kernels.get(pass)?.bind(context, &shared)?,
            });
            Ok::<(), GpuError>(())
        };
        if self.plan.svgf || self.plan.taa {
            for (eye, own) in &self.eyes {
                let resources = own.seen_and_moved(turn);
                add(*eye, &passes::motion::PASS, 0, resources)?;
            }
        }
        // Where the light lies after each pass; the same for both eyes.
        let mut slot = Slot::Light(0);
        if self.plan.svgf {
            for (eye, own) in &self.eyes {
                let (moments, length) = if self.plan.stereo {
                    (&own.own_moments, &own.own_length)
                } else {
                    (&own.moments[turn], &own.lengths[turn])
                };
                let mean = own.slot(slot);
                let resources = own
                    .seen_and_moved(turn)
                    .with("seen_before", &own.seen[1 - turn])
                    .with("direct_history", &own.history.direct)
                    .with("indirect_history", &own.history.indirect)
                    .with("moments_before", &own.moments[1 - turn])
                    .with("length_before", &own.lengths[1 - turn])
                    .with("direct_mean", &mean.direct)
                    .with("indirect_mean", &mean.indirect)
                    .with("moments", moments)
                    .with("history_length", length);
                add(*eye, &passes::svgf_temporal::PASS, 0, resources)?;
            }
            if self.plan.stereo {
                for (eye, own, other) in self.pairs() {
                    let resources =
                        own.sharing(other, turn, slot, |eye| (&eye.own_moments, &eye.own_length));
                    let resources = resources
                        .with("shared_moments", &own.moments[turn])
                        .with("shared_length", &own.lengths[turn]);
                    add(eye, &passes::stereo_share::PASS, 0, resources)?;
                }
                slot = slot.other();
            }
            for index in 0..=self.plan.atrous_passes {
                // Variance first, then the wavelet; what its first pass leaves is what the next frame reads, and with no
                // pass at all the light as it was accumulated.
                let to = match index {
                    0 if self.plan.atrous_passes == 0 => Slot::History,
                    1 => Slot::History,
                    _ => slot.other(),
                };
                for (eye, own) in &self.eyes {
                    let (from, to) = (own.slot(slot), own.slot(to));
                    let resources = own.seen_and_moved(turn);
                    if index == 0 {
                        let resources = resources
                            .with("direct_mean", &from.direct)
                            .with("indirect_mean", &from.indirect)
                            .with("moments", &own.moments[turn])
                            .with("history_length", &own.lengths[turn])
                            .with("direct_filtered", &to.direct)
                            .with("indirect_filtered", &to.indirect);
                        add(*eye, &passes::svgf_variance::PASS, 0, resources)?;
                    } else {
                        let resources = resources
                            .with("direct_from", &from.direct)
                            .with("indirect_from", &from.indirect)
                            .with("direct_to", &to.direct)
                            .with("indirect_to", &to.indirect);
                        add(*eye, &passes::svgf_atrous::PASS, index - 1, resources)?;
                    }
                }
                slot = to;
            }
            if self.plan.stereo {
                // Each eye's own pixels have weighed the neighbours a little differently: agree once more.
                for (eye, own, other) in self.pairs() {
                    let resources = own.sharing(other, turn, slot, |eye| {
                        (&eye.moments[turn], &eye.lengths[turn])
                    });
                    // Moments and lengths stay as they are: what is written goes nowhere.
                    let resources = resources
                        .with("shared_moments", &own.own_moments)
                        .with("shared_length", &own.own_length);
                    add(eye, &passes::stereo_share::PASS, 1, resources)?;
                }
                slot = slot.other();
            }
        }
        for (eye, own) in &self.eyes {
            let filtered = own.slot(slot);
            let resources = own
                .seen_and_moved(turn)
                .with("direct_filtered", &filtered.direct)
                .with("indirect_filtered", &filtered.indirect)
                .with("still_sum", &own.still_sum)
                .with("reconstructed", &own.reconstructed);
            add(*eye, &passes::recombine::PASS, 0, resources)?;
            if self.plan.taa {
                let resources = own
                    .seen_and_moved(turn)
                    .with("reconstructed", &own.reconstructed)
                    .with("displayed_before", &own.displayed[1 - turn])
                    .with("displayed", &own.displayed[turn]);
                add(*eye, &passes::taa::PASS, 0, resources)?;
            }
        }
        Ok(steps)
    }

    /// Each eye with its buffers and the other's.
    fn pairs(&self) -> impl Iterator<Item = (Eye, &EyeBuffers, &EyeBuffers)> {
        let both = (self.eyes.first(), self.eyes.get(1));
        let pair = match both {
            (Some((left, a)), Some((right, b))) => Some([(*left, a, b), (*right, b, a)]),
            _ => None,
        };
        pair.into_iter().flatten()
    }

    /// Says what the frame that is about to be reconstructed has to do with the one before. `moved`: something in the
    /// scene has moved or changed since then.
    pub fn begin_frame(
        &mut self,
        context: &GpuContext,
        frame: &Frame,
        origin_in_world: DVec3,
        settings: &RenderSettings,
        carries_rays: bool,
        moved: bool,
    ) {
        self.turn = 1 - self.turn;
        let now = Before {
            left: frame.left,
            right: frame.right,
            origin_in_world,
        };
        let before = self.before.unwrap_or(now);
        self.still_frames = if self.before == Some(now) && !moved {
            self.still_frames.saturating_add(1)
        } else {
            1
        };
        let own = &settings.reconstruct;
        let uniform = Uniform {
            previous_left: before.left,
            previous_right: before.right,
            has_history: if self.before.is_some() { 1.0 } else { 0.0 },
            color_alpha: own.color_alpha as f32,
            moments_alpha: own.moments_alpha as f32,
            sigma_luminance: own.sigma_luminance as f32,
            sigma_normal: own.sigma_normal as f32,
            sigma_plane: own.sigma_plane_px as f32,
            still_frames: (self.still_frames - 1) as f32,
            still_from: own.still_from as f32,
            still_until: own.still_until as f32,
            exposure: settings.output.exposure as f32,
            taa_alpha: own.taa_alpha as f32,
            taa_clip: own.taa_clip as f32,
            carries_rays: u32::from(carries_rays),
            firefly_frames: own.firefly_frames as f32,
            padding: [0; 2],
        };
        context
            .queue
            .write_buffer(&self.uniform, 0, bytemuck::bytes_of(&uniform));
        self.before = Some(now);
    }

    /// Records all passes over images of `size` pixels, or over nothing to warm up.
    ///
    /// # Errors
    /// [`GpuError::Unbound`] if the frame's kernels lack a pass.
    pub fn record(
        &self,
        recorder: &mut FrameRecorder<'_>,
        kernels: &KernelSet,
        size: [u32; 2],
    ) -> Result<(), GpuError> {
        let groups = [size[0].div_ceil(8).max(1), size[1].div_ceil(8).max(1), 1];
        for step in &self.steps[self.turn] {
            let label = format!("reconstruction.{}.{}", step.eye.name(), step.pass.name);
            let entry = step.eye.index() * TURNS + step.turn;
            recorder.dispatch(&label, kernels.get(step.pass)?, &step.bound, entry, groups);
        }
        Ok(())
    }

    /// The buffer that holds an eye's picture after a frame of either turn.
    pub(super) fn shown(&self, eye: Eye) -> Option<[&wgpu::Buffer; 2]> {
        let own = self.buffers(eye)?;
        Some(if self.plan.taa {
            [&own.displayed[0], &own.displayed[1]]
        } else {
            [&own.reconstructed; 2]
        })
    }

    /// Which of the two [`Reconstruction::shown`] is the last frame's.
    pub(super) fn turn(&self) -> usize {
        self.turn
    }

    fn buffers(&self, eye: Eye) -> Option<&EyeBuffers> {
        self.eyes
            .iter()
            .find(|(name, _)| *name == eye)
            .map(|(_, buffers)| buffers)
    }

    /// An eye's picture, linear radiance; `None` for an eye that is not rendered.
    ///
    /// # Errors
    /// As [`read_buffer`].
    pub fn read_radiance(
        &self,
        context: &GpuContext,
        eye: Eye,
        pixels: usize,
    ) -> Result<Option<Vec<[f32; 3]>>, GpuError> {
        self.buffers(eye)
            .map(|own| read_colors(context, &own.reconstructed, pixels))
            .transpose()
    }

    /// An eye's picture in display light, 0 to 1, before the sRGB curve; `None` for an eye that is not rendered, or
    /// without temporal anti-aliasing.
    ///
    /// # Errors
    /// As [`read_buffer`].
    pub fn read_displayed(
        &self,
        context: &GpuContext,
        eye: Eye,
        pixels: usize,
    ) -> Result<Option<Vec<[f32; 3]>>, GpuError> {
        if !self.plan.taa {
            return Ok(None);
        }
        self.buffers(eye)
            .map(|own| read_colors(context, &own.displayed[self.turn], pixels))
            .transpose()
    }

    /// Variance of the luminance of light over albedo as accumulated over frames, direct and indirect light added; `None`
    /// for an eye that is not rendered, or without filtering.
    ///
    /// # Errors
    /// As [`read_buffer`].
    pub fn read_variance(
        &self,
        context: &GpuContext,
        eye: Eye,
        pixels: usize,
    ) -> Result<Option<Vec<f32>>, GpuError> {
        let Some(own) = self.buffers(eye).filter(|_| self.plan.svgf) else {
            return Ok(None);
        };
        let moments: Vec<[f32; 4]> =
            read_buffer(context, "moments", &own.moments[self.turn], pixels)?;
        Ok(Some(moments.iter().map(|m| m[1] + m[3]).collect()))
    }

    /// What every pixel of an eye saw: distance in metres (bits), normal, instance and flags, place in the pixel; and its
    /// motion: displacement in pixels, distance before, whether it is known. For tests and views.
    ///
    /// # Errors
    /// As [`read_buffer`].
    pub fn read_motion(
        &self,
        context: &GpuContext,
        eye: Eye,
        pixels: usize,
    ) -> Result<Option<SeenAndMotion>, GpuError> {
        let Some(own) = self
            .buffers(eye)
            .filter(|_| self.plan.svgf || self.plan.taa)
        else {
            return Ok(None);
        };
        Ok(Some((
            read_buffer(context, "seen surfaces", &own.seen[self.turn], pixels)?,
            read_buffer(context, "motion", &own.motion, pixels)?,
        )))
    }
}

/// What [`Reconstruction::read_motion`] reads: records of `shaders/shared/reconstruction.wesl` and of the pass `motion`.
pub type SeenAndMotion = (Vec<[u32; 4]>, Vec<[f32; 4]>);

fn read_colors(
    context: &GpuContext,
    buffer: &wgpu::Buffer,
    pixels: usize,
) -> Result<Vec<[f32; 3]>, GpuError> {
    let read: Vec<[f32; 4]> = read_buffer(context, "picture", buffer, pixels)?;
    Ok(read.iter().map(|c| [c[0], c[1], c[2]]).collect())
}

impl EyeBuffers {
    fn new(
        context: &GpuContext,
        eye: Eye,
        pixels: u64,
        plan: ReconstructionPlan,
    ) -> Result<Self, GpuError> {
        let buffer = |name: &str, wanted: bool, bytes: u64| {
            let name = format!("{} {name}", eye.name());
            storage_buffer(context, &name, if wanted { pixels * bytes } else { 16 })
        };
        let pair = |name: &str, wanted, bytes| {
            Ok::<_, GpuError>([buffer(name, wanted, bytes)?, buffer(name, wanted, bytes)?])
        };
        let light = |name: &str| {
            Ok::<_, GpuError>(LightBuffers {
                direct: buffer(&format!("{name} direct light"), plan.svgf, 16)?,
                indirect: buffer(&format!("{name} indirect light"), plan.svgf, 16)?,
            })
        };
        let moves = plan.svgf || plan.taa;
        Ok(Self {
            seen: pair("seen surfaces", moves, 16)?,
            motion: buffer("motion", moves, 16)?,
            emission: buffer("seen emission", plan.svgf, 12)?,
            moments: pair("moments", plan.svgf, 16)?,
            lengths: pair("history length", plan.svgf, 4)?,
            own_moments: buffer("own moments", plan.stereo, 16)?,
            own_length: buffer("own history length", plan.stereo, 4)?,
            light: [light("filtered")?, light("filtered")?],
            history: light("history of")?,
            still_sum: buffer("still sum", plan.still, 16)?,
            reconstructed: buffer("reconstructed", true, 16)?,
            displayed: pair("displayed", plan.taa, 16)?,
        })
    }

    fn slot(&self, slot: Slot) -> &LightBuffers {
        match slot {
            Slot::Light(index) => &self.light[index],
            Slot::History => &self.history,
        }
    }

    fn seen_and_moved(&self, turn: usize) -> Resources<'_> {
        Resources::new()
            .with("seen_surfaces", &self.seen[turn])
            .with("motion", &self.motion)
            .with("seen_emission", &self.emission)
    }

    /// What `stereo_share` reads of both eyes and where it puts the light that lies in `slot`.
    fn sharing<'a>(
        &'a self,
        other: &'a Self,
        turn: usize,
        slot: Slot,
        statistics: impl Fn(&'a Self) -> (&'a wgpu::Buffer, &'a wgpu::Buffer),
    ) -> Resources<'a> {
        let (from, theirs, to) = (self.slot(slot), other.slot(slot), self.slot(slot.other()));
        let (moments, length) = statistics(self);
        let (their_moments, their_length) = statistics(other);
        Resources::new()
            .with("seen_surfaces", &self.seen[turn])
            .with("direct_mean", &from.direct)
            .with("indirect_mean", &from.indirect)
            .with("moments", moments)
            .with("history_length", length)
            .with("other_surfaces", &other.seen[turn])
            .with("other_direct", &theirs.direct)
            .with("other_indirect", &theirs.indirect)
            .with("other_moments", their_moments)
            .with("other_length", their_length)
            .with("shared_direct", &to.direct)
            .with("shared_indirect", &to.indirect)
    }
}
