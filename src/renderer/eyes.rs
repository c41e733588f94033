//! The images of both eyes: buffers, and the passes that fill them.

use crate::gpu::buffers::read_buffer;
use crate::gpu::kernel::{Bound, dispatch_table, linear_groups};
use crate::gpu::{FrameRecorder, GpuContext, GpuError, Resources, storage_buffer};
use crate::passes::{self, Over, Pass};

use super::kernels::KernelSet;

/// Samples that one submission holds; the dispatch table numbers them.
pub const SAMPLES_PER_SUBMISSION: u32 = 64;
/// Counters of the stereo passes; the shaders name the slots.
pub const STEREO_COUNTERS: usize = 16;

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

    fn index(self) -> u32 {
        match self {
            Self::Left => 0,
            Self::Right => 1,
        }
    }
}

/// Buffers of one eye; 16 bytes per pixel each (see `shaders/shared/eye_hit.wesl`).
pub struct EyeBuffers {
    hit_rays: wgpu::Buffer,
    hit_surfaces: wgpu::Buffer,
    hit_paths: wgpu::Buffer,
    first_surfaces: wgpu::Buffer,
    emitted_light: wgpu::Buffer,
    direct_light: wgpu::Buffer,
    indirect_light: wgpu::Buffer,
    sample_radiance: wgpu::Buffer,
    radiance_sum: wgpu::Buffer,
}

impl EyeBuffers {
    fn new(context: &GpuContext, eye: Eye, pixels: u64, photon: bool) -> Result<Self, GpuError> {
        let buffer =
            |name: &str, bytes| storage_buffer(context, &format!("{} {name}", eye.name()), bytes);
        let image = |name| buffer(name, pixels * 16);
        // The path method shades as it goes and keeps no parts.
        let part = |name| buffer(name, if photon { pixels * 16 } else { 16 });
        Ok(Self {
            hit_rays: image("hit rays")?,
            hit_paths: image("hit paths")?,
            first_surfaces: image("first surfaces")?,
            hit_surfaces: part("hit surfaces")?,
            emitted_light: part("emitted light")?,
            direct_light: part("direct light")?,
            indirect_light: part("indirect light")?,
            sample_radiance: image("sample radiance")?,
            radiance_sum: image("radiance sum")?,
        })
    }

    fn resources(&self) -> Resources<'_> {
        Resources::new()
            .with("hit_rays", &self.hit_rays)
            .with("hit_surfaces", &self.hit_surfaces)
            .with("hit_paths", &self.hit_paths)
            .with("first_surfaces", &self.first_surfaces)
            .with("emitted_light", &self.emitted_light)
            .with("direct_light", &self.direct_light)
            .with("indirect_light", &self.indirect_light)
            .with("sample_radiance", &self.sample_radiance)
            .with("radiance_sum", &self.radiance_sum)
    }
}

/// Buffers of the stereo passes.
struct StereoBuffers {
    targets: wgpu::Buffer,
    nearest: wgpu::Buffer,
    winners: wgpu::Buffer,
    counters: wgpu::Buffer,
    provenance: wgpu::Buffer,
    fill_list: wgpu::Buffer,
    fill_count: wgpu::Buffer,
    fill_groups: wgpu::Buffer,
}

/// What an eye's passes are for one method.
#[derive(Debug, Clone, Copy)]
pub struct EyePlan {
    /// Passes of one sample, in order.
    pub sample: &'static [&'static Pass],
    /// Whether the photon method's buffers are needed.
    pub photon: bool,
    /// Whether the right eye reuses the left.
    pub reuse: bool,
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
    bound_left: Vec<Bound>,
    bound_right: Vec<Bound>,
    bound_stereo: Vec<Bound>,
    bound_reasons: Vec<Bound>,
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
        let entries: Vec<[u32; 4]> = (0..SAMPLES_PER_SUBMISSION)
            .flat_map(|sample| [[sample, 0, 0, 0], [sample, 1, 0, 0]])
            .collect();
        let buffer = |name: &str, bytes| storage_buffer(context, name, bytes);
        let stereo = if both && plan.reuse {
            Some(StereoBuffers {
                targets: buffer("scatter targets", pixels * 8)?,
                nearest: buffer("scatter nearest", pixels * 4)?,
                winners: buffer("scatter winners", pixels * 4)?,
                counters: buffer("stereo counters", STEREO_COUNTERS as u64 * 4)?,
                provenance: buffer("provenance", pixels * 4)?,
                fill_list: buffer("fill list", pixels * 4)?,
                fill_count: buffer("fill count", 16)?,
                fill_groups: buffer("fill groups", 16)?,
            })
        } else {
            None
        };
        Ok(Self {
            width,
            height,
            plan,
            left: EyeBuffers::new(context, Eye::Left, pixels, plan.photon)?,
            right: both
                .then(|| EyeBuffers::new(context, Eye::Right, pixels, plan.photon))
                .transpose()?,
            stereo,
            dispatch: dispatch_table(context, "samples", &entries),
            bound_left: Vec::new(),
            bound_right: Vec::new(),
            bound_stereo: Vec::new(),
            bound_reasons: Vec::new(),
        })
    }

    /// Binds every pass anew; `shared` holds the scene, the frame uniform and the photon map.
    ///
    /// # Errors
    /// As [`crate::gpu::Kernel::bind`].
    pub fn bind(
        &mut self,
        context: &GpuContext,
        kernels: &KernelSet,
        shared: &Resources<'_>,
    ) -> Result<(), GpuError> {
        let base = shared.clone().with("dispatch", &self.dispatch);
        let left = base.clone().and(&self.left.resources());
        let sample = self.plan.sample;
        self.bound_left = sample
            .iter()
            .map(|pass| kernels.get(pass)?.bind(context, &left))
            .collect::<Result<_, _>>()?;
        let Some(right_buffers) = &self.right else {
            return Ok(());
        };
        let right = base.clone().and(&right_buffers.resources());
        let Some(stereo) = &self.stereo else {
            self.bound_right = sample
                .iter()
                .map(|pass| kernels.get(pass)?.bind(context, &right))
                .collect::<Result<_, _>>()?;
            return Ok(());
        };
        let right = right
            .with("left_hit_rays", &self.left.hit_rays)
            .with("left_hit_paths", &self.left.hit_paths)
            .with("left_first_surfaces", &self.left.first_surfaces)
            .with("left_sample_radiance", &self.left.sample_radiance)
            .with("scatter_targets", &stereo.targets)
            .with("scatter_nearest", &stereo.nearest)
            .with("scatter_winners", &stereo.winners)
            .with("stereo_counters", &stereo.counters)
            .with("provenance", &stereo.provenance)
            .with("fill_list", &stereo.fill_list)
            .with("fill_count", &stereo.fill_count)
            .with("fill_groups", &stereo.fill_groups);
        self.bound_stereo = passes::STEREO_SCATTER
            .iter()
            .map(|pass| kernels.get(pass)?.bind(context, &right))
            .collect::<Result<_, _>>()?;
        self.bound_right = sample
            .iter()
            .map(|pass| kernels.get_from_list(pass)?.bind(context, &right))
            .collect::<Result<_, _>>()?;
        self.bound_reasons = passes::FILL_REASONS
            .iter()
            .map(|pass| kernels.get_from_list(pass)?.bind(context, &right))
            .collect::<Result<_, _>>()?;
        Ok(())
    }

    fn tiles(&self) -> [u32; 3] {
        [self.width.div_ceil(8), self.height.div_ceil(8), 1]
    }

    /// Records the zeroing that precedes a frame's first sample.
    pub fn record_clear(&self, recorder: &mut FrameRecorder<'_>) {
        recorder.clear(&self.left.radiance_sum);
        if let Some(right) = &self.right {
            recorder.clear(&right.radiance_sum);
        }
        if let Some(stereo) = &self.stereo {
            recorder.clear(&stereo.counters);
        }
    }

    /// Records sample `sample` (of the submission) of one eye over all its pixels.
    ///
    /// # Errors
    /// [`GpuError::Unbound`] if the frame's kernels lack a pass.
    pub fn record_full(
        &self,
        recorder: &mut FrameRecorder<'_>,
        kernels: &KernelSet,
        eye: Eye,
        sample: u32,
    ) -> Result<(), GpuError> {
        let bound = match eye {
            Eye::Left => &self.bound_left,
            Eye::Right => &self.bound_right,
        };
        for (pass, bound) in self.plan.sample.iter().zip(bound) {
            recorder.dispatch(
                &format!("{}.{}", eye.name(), pass.name),
                kernels.get(pass)?,
                bound,
                sample * 2 + eye.index(),
                self.tiles(),
            );
        }
        Ok(())
    }

    /// Records sample `sample` of the right eye by reuse: scatter, then fill what is empty.
    ///
    /// # Errors
    /// [`GpuError::Unbound`] if the frame's kernels lack a pass.
    pub fn record_reuse(
        &self,
        recorder: &mut FrameRecorder<'_>,
        kernels: &KernelSet,
        sample: u32,
    ) -> Result<(), GpuError> {
        let Some(stereo) = &self.stereo else {
            return self.record_full(recorder, kernels, Eye::Right, sample);
        };
        let index = sample * 2 + Eye::Right.index();
        recorder.clear(&stereo.nearest);
        recorder.clear(&stereo.winners);
        for (pass, bound) in passes::STEREO_SCATTER.iter().zip(&self.bound_stereo) {
            let groups = if pass.over == Over::Pixels {
                self.tiles()
            } else {
                linear_groups(1, 1)
            };
            recorder.dispatch(
                &format!("right.{}", pass.name),
                kernels.get(pass)?,
                bound,
                index,
                groups,
            );
        }
        let sample_passes = self.plan.sample.iter().zip(&self.bound_right);
        let reason_passes = passes::FILL_REASONS.iter().zip(&self.bound_reasons);
        for (pass, bound) in sample_passes.chain(reason_passes) {
            recorder.dispatch_indirect(
                &format!("right.{}", pass.name),
                kernels.get_from_list(pass)?,
                bound,
                index,
                &stereo.fill_groups,
                0,
            );
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
        for (pass, bound) in self.plan.sample.iter().zip(&self.bound_left) {
            recorder.dispatch(pass.name, kernels.get(pass)?, bound, 0, [1, 1, 1]);
        }
        if self.stereo.is_none() {
            return Ok(());
        }
        for (pass, bound) in passes::STEREO_SCATTER.iter().zip(&self.bound_stereo) {
            recorder.dispatch(pass.name, kernels.get(pass)?, bound, 1, [1, 1, 1]);
        }
        let sample_passes = self.plan.sample.iter().zip(&self.bound_right);
        for (pass, bound) in sample_passes.chain(passes::FILL_REASONS.iter().zip(&self.bound_reasons)) {
            recorder.dispatch(pass.name, kernels.get_from_list(pass)?, bound, 1, [1, 1, 1]);
        }
        Ok(())
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
        self.stereo
            .as_ref()
            .map(|stereo| read_buffer(context, "provenance", &stereo.provenance, self.pixels()))
            .transpose()
    }

    /// Left pixel that each right pixel of the last sample was taken from (`u32::MAX`: none).
    ///
    /// # Errors
    /// As [`read_buffer`].
    pub fn read_winners(&self, context: &GpuContext) -> Result<Option<Vec<u32>>, GpuError> {
        let Some(stereo) = &self.stereo else {
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
        let Some(stereo) = &self.stereo else {
            return Ok(None);
        };
        let values: Vec<u32> =
            read_buffer(context, "stereo counters", &stereo.counters, STEREO_COUNTERS)?;
        let mut counters = [0; STEREO_COUNTERS];
        counters.copy_from_slice(&values);
        Ok(Some(counters))
    }

    fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }
}
