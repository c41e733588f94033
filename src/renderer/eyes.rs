//! The images of both eyes: buffers, and the passes that fill them.

use crate::gpu::buffers::read_buffer;
use crate::gpu::kernel::{Bound, dispatch_table};
use crate::gpu::texels::CopiedBuffer;
use crate::gpu::{FrameRecorder, GpuContext, GpuError, Kernel, Resources, storage_buffer};
use crate::passes::{self, Over, Pass};

use super::eye_buffers::{EyeBuffers, PixelList, StereoBuffers};
use super::eye_plan::{EyePlan, GatherSlices};
use super::half_rate::HalfRate;
use super::kernels::KernelSet;
use super::parts::RadianceParts;
use super::records::stereo::StereoCounters;

/// Samples that one submission holds; the dispatch table numbers them.
pub const SAMPLES_PER_SUBMISSION: u32 = 64;
/// Words of the stereo passes' counters.
pub const STEREO_COUNTERS: usize = size_of::<StereoCounters>() / 4;

/// Which eye.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Eye {
    /// The eye that is rendered in full.
    Left,
    /// The eye that takes over what it can.
    Right,
}

impl Eye {
    /// `left` or `right`, as in file names and pass labels.
    pub fn name(self) -> &'static str {
        match self {
            Self::Left => "left",
            Self::Right => "right",
        }
    }

    pub(super) fn index(self) -> u32 {
        match self {
            Self::Left => 0,
            Self::Right => 1,
        }
    }
}

/// How a step's dispatch is sized.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Extent {
    Once,
    Tiles,
    LeftHits,
    RightHits,
    /// Pixels that gather first at half rate.
    Coarse,
    /// Pixels between them that gather after all.
    Rest,
    /// Filled pixels of the right eye whose indirect light was not taken over.
    RightGathers,
    Fill,
}

/// Workgroups of a dispatch, or the buffer that holds them.
enum Groups<'a> {
    Direct([u32; 3]),
    Indirect(&'a wgpu::Buffer),
}

/// One bound pass of an eye.
struct Step {
    pass: &'static Pass,
    bound: Bound,
    extent: Extent,
}

/// The dispatch table of a submission: sample, eye, gathering slice. The path tracer has one slice, whose number stands
/// for the samples of the dispatch: entries for one, then for two, four and so on up to `run`.
fn sample_table(context: &GpuContext, slices: u32, run: u32) -> wgpu::Buffer {
    let mut entries = Vec::new();
    for length in (0..=run.max(1).ilog2()).map(|power| 1 << power) {
        for sample in 0..SAMPLES_PER_SUBMISSION {
            for eye in [Eye::Left, Eye::Right] {
                for slice in 0..slices {
                    entries.push([sample, eye.index(), slice, slices.max(length)]);
                }
            }
        }
    }
    dispatch_table(context, "samples", &entries)
}

/// Both eyes.
pub struct Eyes {
    width: u32,
    height: u32,
    plan: EyePlan,
    left: EyeBuffers,
    right: Option<EyeBuffers>,
    stereo: Option<StereoBuffers>,
    dispatch: wgpu::Buffer,
    /// The same with the slices of caustics.
    caustic_dispatch: wgpu::Buffer,
    half_rate: Option<HalfRate>,
    /// What pixels keep of their nearest photons between slices.
    nearest_heaps: wgpu::Buffer,
    gather_slices: GatherSlices,
    /// The right eye reuses the left; only ever true where the plan says so.
    reuse: bool,
    left_steps: Vec<Step>,
    right_steps: Vec<Step>,
    /// Instead of `right_steps` where the eyes see the same; none where the right eye does not reuse.
    equal_steps: Vec<Step>,
    are_equal: bool,
}

impl Eyes {
    /// Allocates images of `width` x `height` pixels; the right eye only if `both`.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] if an image does not fit the adapter's binding limit.
    pub fn new(
        context: &GpuContext,
        size: [u32; 2],
        plan: EyePlan,
        both: bool,
    ) -> Result<Self, GpuError> {
        let [width, height] = size;
        let pixels = u64::from(width) * u64::from(height);
        let buffer = |name: &str, bytes| storage_buffer(context, name, bytes);
        let stereo = if both && !plan.stereo.is_empty() {
            let writes = |name| plan.stereo.iter().any(|pass| pass.writes.contains(&name));
            // What this kind of reuse does not touch gets a token size.
            let used = |name, bytes| if writes(name) { bytes } else { 16 };
            Some(StereoBuffers {
                targets: buffer("scatter targets", used("scatter_targets", pixels * 8))?,
                nearest: buffer("scatter nearest", used("scatter_nearest", pixels * 4))?,
                winners: buffer("scatter winners", used("scatter_winners", pixels * 4))?,
                irradiance: CopiedBuffer::new(
                    context,
                    "left irradiance",
                    used("carried_light", pixels * 16),
                    plan.texels,
                )?,
                gathers: PixelList::new(
                    context,
                    "gather",
                    if plan.carries_indirect { pixels } else { 4 },
                )?,
                counters: buffer("stereo counters", STEREO_COUNTERS as u64 * 4)?,
                provenance: buffer("provenance", pixels * 4)?,
                fill: PixelList::new(context, "fill", pixels)?,
            })
        } else {
            None
        };
        Ok(Self {
            width,
            height,
            left: EyeBuffers::new(context, Eye::Left, pixels, &plan)?,
            right: both
                .then(|| EyeBuffers::new(context, Eye::Right, pixels, &plan))
                .transpose()?,
            stereo,
            half_rate: plan
                .half_rate
                .then(|| HalfRate::new(context, pixels, plan.texels))
                .transpose()?,
            dispatch: sample_table(context, 1, plan.run),
            caustic_dispatch: sample_table(context, 1, 1),
            nearest_heaps: buffer("nearest photons", 16)?,
            gather_slices: GatherSlices::ONE,
            reuse: both && !plan.stereo.is_empty(),
            plan,
            left_steps: Vec::new(),
            right_steps: Vec::new(),
            equal_steps: Vec::new(),
            are_equal: false,
        })
    }

    /// Sets in how many slices photons are gathered; true if passes must be bound again.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] if what is kept between slices does not fit.
    pub fn set_gather_slices(
        &mut self,
        context: &GpuContext,
        slices: GatherSlices,
    ) -> Result<bool, GpuError> {
        if slices == self.gather_slices {
            return Ok(false);
        }
        if slices.photons > 1 && self.plan.writes("nearest_heaps") {
            // Both eyes take turns with it.
            let bytes = self.pixels() as u64 * self.plan.heap_bytes();
            if self.nearest_heaps.size() < bytes {
                self.nearest_heaps = storage_buffer(context, "nearest photons", bytes)?;
            }
        }
        self.gather_slices = slices;
        self.dispatch = sample_table(context, slices.photons, self.plan.run);
        self.caustic_dispatch = sample_table(context, slices.caustics, 1);
        Ok(true)
    }

    /// The stereo passes' buffers while the right eye reuses the left.
    fn stereo(&self) -> Option<&StereoBuffers> {
        self.stereo.as_ref().filter(|_| self.reuse)
    }

    /// What the eyes' passes are.
    pub fn plan(&self) -> &EyePlan {
        &self.plan
    }

    /// Whether both eyes have images.
    pub(super) fn has_right(&self) -> bool {
        self.right.is_some()
    }

    /// Whether the right eye reuses the left.
    pub fn reuse(&self) -> bool {
        self.reuse
    }

    /// Whether reused pixels of the right eye have no ray of their own, but the left eye's.
    pub fn carries_rays(&self) -> bool {
        self.reuse && !self.are_equal && self.plan.stereo.contains(&&passes::scatter_winner::PASS)
    }

    /// Says whether both eyes of the frame to come have one pose and the same angles.
    pub fn set_equal(&mut self, are_equal: bool) {
        self.are_equal = are_equal;
    }

    /// Whether the right eye is the left one's copy.
    fn takes_all(&self) -> bool {
        self.are_equal && !self.equal_steps.is_empty()
    }

    /// Switches reuse, on only if the plan has it; true if passes must be bound again.
    pub fn set_reuse(&mut self, on: bool) -> bool {
        let on = on && self.stereo.is_some();
        std::mem::replace(&mut self.reuse, on) != on
    }

    /// Sets which pixels of an eye are hidden, one bit each.
    pub fn write_hidden(&self, context: &GpuContext, eye: Eye, bits: &[u32]) {
        if let Some(buffers) = self.buffers(eye) {
            context
                .queue
                .write_buffer(&buffers.hidden_pixels, 0, bytemuck::cast_slice(bits));
        }
    }

    /// What passes read of an eye's finished image: those that reconstruct, hand over or show it.
    pub fn finished(&self, eye: Eye) -> Option<Resources<'_>> {
        let buffers = self.buffers(eye)?;
        // Without reuse its buffers are not read, but the passes declare them.
        let (winners, provenance) = match &self.stereo {
            Some(stereo) => (&stereo.winners, &stereo.provenance),
            None => (&buffers.hits.pixels, &buffers.hits.pixels),
        };
        Some(
            buffers
                .resources()
                .with("left_hit_rays", &self.left.hit_rays)
                .with("left_first_surfaces", &self.left.first_surfaces)
                .with("scatter_winners", winners)
                .with("provenance", provenance),
        )
    }

    /// An eye's radiance, summed over the frame's samples.
    pub(super) fn radiance_sum(&self, eye: Eye) -> Option<&wgpu::Buffer> {
        self.buffers(eye).map(|buffers| &buffers.radiance_sum)
    }

    /// Binds every pass anew; `shared` holds the scene, the frame uniform and the photon map. The pass that gathers
    /// caustics finds the map in `caustics` under the same names.
    ///
    /// # Errors
    /// As [`crate::gpu::Kernel::bind`].
    pub fn bind(
        &mut self,
        context: &GpuContext,
        kernels: &KernelSet,
        shared: &Resources<'_>,
        caustics: &Resources<'_>,
    ) -> Result<(), GpuError> {
        let base = shared
            .clone()
            .with("dispatch", &self.dispatch)
            .with("nearest_heaps", &self.nearest_heaps);
        let caustics = caustics.clone().with("dispatch", &self.caustic_dispatch);
        let bind = |pass: &'static Pass, extent: Extent, resources: &Resources<'_>| {
            let kernel = if extent == Extent::Fill {
                kernels.get_from_list(pass)?
            } else {
                kernels.get(pass)?
            };
            let bound = if pass.name == passes::caustic_gather::PASS.name {
                kernel.bind(context, &resources.clone().and(&caustics))?
            } else {
                kernel.bind(context, resources)?
            };
            Ok::<Step, GpuError>(Step {
                pass,
                bound,
                extent,
            })
        };
        // A whole eye: tiles of pixels, then the pixels that see something.
        let whole = |buffers: &EyeBuffers, hits: Extent| {
            let resources = base
                .clone()
                .and(&buffers.resources())
                .and(&buffers.hits.to_run_over());
            let extent_of = |pass: &Pass| match pass.over {
                Over::Pixels => Extent::Tiles,
                Over::Hits => hits,
                _ => Extent::Once,
            };
            let mut steps = Vec::new();
            for pass in &self.plan.sample {
                let half_rate = self.half_rate.as_ref();
                let Some(half_rate) = half_rate.filter(|_| passes::GATHERS.contains(pass)) else {
                    steps.push(bind(pass, extent_of(pass), &resources)?);
                    continue;
                };
                let over_hits = half_rate.written(&resources);
                let over_coarse = over_hits.clone().and(&half_rate.coarse.to_run_over());
                let over_rest = over_hits.clone().and(&half_rate.rest.to_run_over());
                steps.push(bind(&passes::coarse_list::PASS, hits, &over_hits)?);
                steps.push(bind(&passes::list_setup::PASS, Extent::Once, &over_coarse)?);
                for pass in [pass, &passes::coarse_irradiance::PASS] {
                    steps.push(bind(pass, Extent::Coarse, &over_coarse)?);
                }
                let reading = half_rate.read(&resources);
                steps.push(bind(&passes::coarse_spread::PASS, hits, &reading)?);
                steps.push(bind(&passes::list_setup::PASS, Extent::Once, &over_rest)?);
                steps.push(bind(pass, Extent::Rest, &over_rest)?);
            }
            Ok::<Vec<Step>, GpuError>(steps)
        };
        let left_steps = whole(&self.left, Extent::LeftHits)?;
        let mut equal_steps = Vec::new();
        let right_steps = match (&self.right, self.stereo()) {
            (None, _) => Vec::new(),
            (Some(right), None) => whole(right, Extent::RightHits)?,
            (Some(right), Some(stereo)) => {
                let resources = base
                    .clone()
                    .and(&right.resources())
                    .with("left_hit_rays", &self.left.hit_rays)
                    .with("left_hit_paths", &self.left.hit_paths)
                    .with("left_first_surfaces", &self.left.first_surfaces)
                    .with("left_sample_radiance", &self.left.sample_radiance)
                    .with("scatter_targets", &stereo.targets)
                    .with("scatter_nearest", &stereo.nearest)
                    .with("scatter_winners", &stereo.winners)
                    .with("stereo_counters", &stereo.counters)
                    .with("provenance", &stereo.provenance)
                    .with("left_indirect_light", &self.left.indirect_light)
                    .with("gather_list", &stereo.gathers.pixels)
                    .with("gather_count", &stereo.gathers.count)
                    .with("left_hit_count", &self.left.hits.count)
                    .with("fill_list", &stereo.fill.pixels)
                    .with("fill_count", &stereo.fill.count);
                let resources = stereo.irradiance.read_by(resources, "carried_light");
                let resources = match &self.left.parts {
                    Some(parts) => resources
                        .with("left_sample_parts", &parts.sample)
                        .with("left_direct_irradiance", &parts.irradiance),
                    None => resources,
                };
                // Passes over the left hits write what the others read a copy of.
                let over_left_hits = resources
                    .clone()
                    .with("carried_light", &stereo.irradiance.buffer)
                    .and(&self.left.hits.to_run_over());
                let over_fill = resources.clone().and(&stereo.fill.to_run_over());
                let over_gathers = resources.clone().and(&stereo.gathers.to_run_over());
                for pass in passes::STEREO_EQUAL {
                    equal_steps.push(bind(pass, Extent::Tiles, &resources)?);
                }
                let over_right_hits = resources.and(&right.hits.to_run_over());
                let mut steps = Vec::new();
                for pass in self.plan.stereo {
                    steps.push(match pass.over {
                        Over::Hits => bind(pass, Extent::LeftHits, &over_left_hits)?,
                        Over::Pixels => bind(pass, Extent::Tiles, &over_fill)?,
                        _ => bind(pass, Extent::Once, &over_fill)?,
                    });
                }
                for pass in self.plan.sample.iter().chain(passes::FILL_REASONS) {
                    if self.plan.carries_indirect && passes::GATHERS.contains(pass) {
                        for pass in passes::FILL_INDIRECT {
                            steps.push(match pass.over {
                                Over::Hits => bind(pass, Extent::RightHits, &over_right_hits)?,
                                _ => bind(pass, Extent::Once, &over_gathers)?,
                            });
                        }
                        steps.push(bind(pass, Extent::RightGathers, &over_gathers)?);
                        continue;
                    }
                    steps.push(match pass.over {
                        Over::Hits => bind(pass, Extent::RightHits, &over_right_hits)?,
                        Over::Pixels => bind(pass, Extent::Fill, &over_fill)?,
                        _ => bind(pass, Extent::Once, &over_right_hits)?,
                    });
                }
                steps
            }
        };
        self.left_steps = left_steps;
        self.right_steps = right_steps;
        self.equal_steps = equal_steps;
        Ok(())
    }

    /// Records the zeroing that precedes a frame's first sample.
    pub fn record_clear(&self, recorder: &mut FrameRecorder<'_>) {
        for eye in [Some(&self.left), self.right.as_ref()]
            .into_iter()
            .flatten()
        {
            recorder.clear(&eye.radiance_sum);
            if let Some(parts) = &eye.parts {
                recorder.clear(&parts.sum);
            }
        }
        if let Some(stereo) = self.stereo() {
            recorder.clear(&stereo.counters);
        }
    }

    /// How many samples the next dispatches take, with `left` of them to go.
    pub fn next_run(&self, left: u32) -> u32 {
        1 << left.clamp(1, self.plan.run).ilog2()
    }

    /// Records sample `sample` (of the submission) of one eye, or as many from there on as [`Self::next_run`] said; the
    /// right eye reuses the left if the plan says so.
    ///
    /// # Errors
    /// [`GpuError::Unbound`] if the frame's kernels lack a pass.
    pub fn record_sample(
        &self,
        recorder: &mut FrameRecorder<'_>,
        kernels: &KernelSet,
        eye: Eye,
        sample: u32,
        run: u32,
    ) -> Result<(), GpuError> {
        let Some(buffers) = self.buffers(eye) else {
            return Ok(());
        };
        recorder.clear(&buffers.hits.count);
        if let Some(half_rate) = &self.half_rate {
            half_rate.clear(recorder);
        }
        if let (Eye::Right, Some(stereo)) = (eye, self.stereo()) {
            recorder.clear(&stereo.nearest);
            recorder.clear(&stereo.winners);
            recorder.clear(&stereo.irradiance.buffer);
            recorder.clear(&stereo.gathers.count);
            recorder.clear(&stereo.fill.count);
        }
        let entries_before = run.ilog2() * SAMPLES_PER_SUBMISSION;
        let turn = (entries_before + sample) * 2 + eye.index();
        let steps = match eye {
            Eye::Left => &self.left_steps,
            Eye::Right if self.takes_all() => &self.equal_steps,
            Eye::Right => &self.right_steps,
        };
        for step in steps {
            let label = format!("{}.{}", eye.name(), step.pass.name);
            let kernel = Self::kernel(kernels, step)?;
            let is = |pass: &Pass| pass.name == step.pass.name;
            let GatherSlices { photons, caustics } = self.gather_slices;
            let gathers = passes::GATHERS.iter().any(|pass| is(pass));
            let (first, slices) = if is(&passes::caustic_gather::PASS) {
                (turn * caustics, caustics)
            } else if gathers || is(&passes::eye_fused::PASS) {
                (turn * photons, photons)
            } else {
                (turn * photons, 1)
            };
            for index in first..first + slices {
                match self.groups(step.extent) {
                    Groups::Direct(groups) => {
                        recorder.dispatch(&label, kernel, &step.bound, index, groups);
                    }
                    Groups::Indirect(groups) => {
                        recorder.dispatch_indirect(&label, kernel, &step.bound, index, groups, 0);
                    }
                }
            }
            if let (true, Some(stereo)) = (is(&passes::left_irradiance::PASS), &self.stereo) {
                stereo.irradiance.record(recorder, &label);
            }
            if let (true, Some(half_rate)) = (is(&passes::coarse_irradiance::PASS), &self.half_rate)
            {
                half_rate.copy_light(recorder, &label);
            }
        }
        Ok(())
    }

    /// Records every pass over nothing; the frame uniform must say that images have no pixels.
    ///
    /// # Errors
    /// [`GpuError::Unbound`] if the frame's kernels lack a pass.
    pub fn record_warm_up(
        &self,
        recorder: &mut FrameRecorder<'_>,
        kernels: &KernelSet,
    ) -> Result<(), GpuError> {
        let steps = [&self.left_steps, &self.right_steps, &self.equal_steps];
        for step in steps.into_iter().flatten() {
            recorder.dispatch(
                step.pass.name,
                Self::kernel(kernels, step)?,
                &step.bound,
                0,
                [1, 1, 1],
            );
        }
        Ok(())
    }

    fn kernel<'k>(kernels: &'k KernelSet, step: &Step) -> Result<&'k Kernel, GpuError> {
        if step.extent == Extent::Fill {
            kernels.get_from_list(step.pass)
        } else {
            kernels.get(step.pass)
        }
    }

    fn groups(&self, extent: Extent) -> Groups<'_> {
        let list = match extent {
            Extent::Once => None,
            Extent::Tiles => {
                return Groups::Direct([self.width.div_ceil(8), self.height.div_ceil(8), 1]);
            }
            Extent::LeftHits => Some(&self.left.hits),
            Extent::Coarse => self.half_rate.as_ref().map(|half_rate| &half_rate.coarse),
            Extent::Rest => self.half_rate.as_ref().map(|half_rate| &half_rate.rest),
            Extent::RightHits => self.right.as_ref().map(|right| &right.hits),
            Extent::RightGathers => self.stereo.as_ref().map(|stereo| &stereo.gathers),
            Extent::Fill => self.stereo.as_ref().map(|stereo| &stereo.fill),
        };
        match list {
            Some(list) => Groups::Indirect(&list.groups),
            None => Groups::Direct([1, 1, 1]),
        }
    }

    fn buffers(&self, eye: Eye) -> Option<&EyeBuffers> {
        match eye {
            Eye::Left => Some(&self.left),
            Eye::Right => self.right.as_ref(),
        }
    }

    /// Mean radiance of every pixel of an eye, row 0 on top; `None` for an eye that is not rendered.
    ///
    /// # Errors
    /// As [`read_buffer`].
    pub fn read_radiance(
        &self,
        context: &GpuContext,
        eye: Eye,
        samples: u32,
    ) -> Result<Option<Vec<[f32; 3]>>, GpuError> {
        let Some(buffers) = self.buffers(eye) else {
            return Ok(None);
        };
        let sums: Vec<[f32; 4]> =
            read_buffer(context, "radiance", &buffers.radiance_sum, self.pixels())?;
        let scale = 1.0 / samples.max(1) as f32;
        Ok(Some(
            sums.iter()
                .map(|sum| [sum[0] * scale, sum[1] * scale, sum[2] * scale])
                .collect(),
        ))
    }

    /// The parts of every pixel's mean radiance; `None` for an eye that is not rendered, or if none were asked for.
    ///
    /// # Errors
    /// As [`read_buffer`].
    pub fn read_parts(
        &self,
        context: &GpuContext,
        eye: Eye,
        samples: u32,
    ) -> Result<Option<RadianceParts>, GpuError> {
        let Some(parts) = self.buffers(eye).and_then(|buffers| buffers.parts.as_ref()) else {
            return Ok(None);
        };
        let Some(radiance) = self.read_radiance(context, eye, samples)? else {
            return Ok(None);
        };
        parts.read(context, &radiance, samples).map(Some)
    }

    /// Ray direction (unit, render space) and distance of every pixel's first hit in the last sample; 0 is a miss.
    ///
    /// # Errors
    /// As [`read_buffer`].
    pub fn read_hit_rays(
        &self,
        context: &GpuContext,
        eye: Eye,
    ) -> Result<Option<Vec<[f32; 4]>>, GpuError> {
        self.buffers(eye)
            .map(|buffers| read_buffer(context, "hit rays", &buffers.hit_rays, self.pixels()))
            .transpose()
    }

    /// Where the right eye's pixels of the last sample came from (`PROVENANCE_*`), or `None` without reuse.
    ///
    /// # Errors
    /// As [`read_buffer`].
    pub fn read_provenance(&self, context: &GpuContext) -> Result<Option<Vec<u32>>, GpuError> {
        self.stereo()
            .map(|stereo| read_buffer(context, "provenance", &stereo.provenance, self.pixels()))
            .transpose()
    }

    /// Left pixel that each right pixel of the last sample was taken from (`u32::MAX`: none).
    ///
    /// # Errors
    /// As [`read_buffer`].
    pub fn read_winners(&self, context: &GpuContext) -> Result<Option<Vec<u32>>, GpuError> {
        let Some(stereo) = self.stereo() else {
            return Ok(None);
        };
        let complements: Vec<u32> =
            read_buffer(context, "scatter winners", &stereo.winners, self.pixels())?;
        Ok(Some(complements.iter().map(|value| !value).collect()))
    }

    /// The stereo passes' counters over all samples of the frame.
    ///
    /// # Errors
    /// As [`read_buffer`].
    pub fn read_counters(
        &self,
        context: &GpuContext,
    ) -> Result<Option<[u32; STEREO_COUNTERS]>, GpuError> {
        let Some(stereo) = self.stereo() else {
            return Ok(None);
        };
        let values: Vec<u32> = read_buffer(
            context,
            "stereo counters",
            &stereo.counters,
            STEREO_COUNTERS,
        )?;
        let mut counters = [0; STEREO_COUNTERS];
        counters.copy_from_slice(&values);
        Ok(Some(counters))
    }

    fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }
}
