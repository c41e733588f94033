//! Buffers of an eye's image on the device, and of what goes between the eyes.

use super::eye_plan::EyePlan;
use super::eyes::Eye;
use super::parts::PartBuffers;
use crate::gpu::texels::CopiedBuffer;
use crate::gpu::{GpuContext, GpuError, Resources, storage_buffer};

/// Buffers of one eye; 16 bytes per pixel each (see `shaders/shared/eye_hit.wesl`).
pub(super) struct EyeBuffers {
    pub(super) hit_rays: wgpu::Buffer,
    pub(super) end_rays: wgpu::Buffer,
    pub(super) hit_surfaces: wgpu::Buffer,
    pub(super) hit_paths: wgpu::Buffer,
    pub(super) first_surfaces: wgpu::Buffer,
    pub(super) emitted_light: wgpu::Buffer,
    pub(super) direct_light: wgpu::Buffer,
    pub(super) indirect_light: wgpu::Buffer,
    pub(super) caustic_light: wgpu::Buffer,
    pub(super) sample_radiance: wgpu::Buffer,
    pub(super) radiance_sum: wgpu::Buffer,
    /// One bit per pixel: hidden by the headset's lens. Bound only where a session knows of hidden pixels.
    pub(super) hidden_pixels: wgpu::Buffer,
    /// Only where they are asked for.
    pub(super) parts: Option<PartBuffers>,
    /// Pixels that see a surface: list, length, and the workgroups of passes over it.
    pub(super) hits: PixelList,
}

/// A list of pixels on the device.
pub(super) struct PixelList {
    pub(super) pixels: wgpu::Buffer,
    pub(super) count: wgpu::Buffer,
    pub(super) groups: wgpu::Buffer,
}

impl PixelList {
    pub(super) fn new(context: &GpuContext, name: &str, pixels: u64) -> Result<Self, GpuError> {
        Ok(Self {
            pixels: storage_buffer(context, &format!("{name} list"), pixels * 4)?,
            count: storage_buffer(context, &format!("{name} count"), 16)?,
            groups: storage_buffer(context, &format!("{name} groups"), 16)?,
        })
    }

    /// For passes that run over the list, and for the one that sizes their dispatch.
    pub(super) fn to_run_over(&self) -> Resources<'_> {
        Resources::new()
            .with("pixel_list", &self.pixels)
            .with("pixel_count", &self.count)
            .with("list_groups", &self.groups)
    }
}

impl EyeBuffers {
    pub(super) fn new(
        context: &GpuContext,
        eye: Eye,
        pixels: u64,
        plan: &EyePlan,
    ) -> Result<Self, GpuError> {
        let buffer =
            |name: &str, bytes| storage_buffer(context, &format!("{} {name}", eye.name()), bytes);
        let image = |name| buffer(name, pixels * 16);
        // The path method shades as it goes and keeps no parts.
        let part = |name| buffer(name, if plan.photon { pixels * 16 } else { 16 });
        // Samples that the other eye may take over: of both eyes, for the right one may render by itself all the same.
        let keeps = !plan.stereo.is_empty();
        let kept = |name, bytes| buffer(name, if keeps { pixels * bytes } else { 16 });
        let caustics = if plan.caustics { pixels * 16 } else { 16 };
        let parts = if plan.parts {
            Some(PartBuffers::new(context, eye.name(), pixels, plan, keeps)?)
        } else {
            None
        };
        Ok(Self {
            hit_rays: image("hit rays")?,
            hit_paths: image("hit paths")?,
            first_surfaces: image("first surfaces")?,
            end_rays: part("end rays")?,
            hit_surfaces: part("hit surfaces")?,
            emitted_light: part("emitted light")?,
            direct_light: part("direct light")?,
            indirect_light: part("indirect light")?,
            caustic_light: buffer("caustic light", caustics)?,
            sample_radiance: kept("sample radiance", 16)?,
            radiance_sum: image("radiance sum")?,
            hidden_pixels: buffer("hidden pixels", pixels.div_ceil(32) * 4)?,
            parts,
            hits: PixelList::new(context, &format!("{} hit", eye.name()), pixels)?,
        })
    }

    pub(super) fn resources(&self) -> Resources<'_> {
        let parts = match &self.parts {
            Some(parts) => parts.resources(),
            None => Resources::new(),
        };
        parts
            .with("hit_rays", &self.hit_rays)
            .with("end_rays", &self.end_rays)
            .with("hit_surfaces", &self.hit_surfaces)
            .with("hit_paths", &self.hit_paths)
            .with("first_surfaces", &self.first_surfaces)
            .with("emitted_light", &self.emitted_light)
            .with("direct_light", &self.direct_light)
            .with("indirect_light", &self.indirect_light)
            .with("caustic_light", &self.caustic_light)
            .with("sample_radiance", &self.sample_radiance)
            .with("radiance_sum", &self.radiance_sum)
            .with("hidden_pixels", &self.hidden_pixels)
            .with("hit_list", &self.hits.pixels)
            .with("hit_count", &self.hits.count)
    }
}

/// Buffers of the stereo passes.
pub(super) struct StereoBuffers {
    pub(super) targets: wgpu::Buffer,
    pub(super) nearest: wgpu::Buffer,
    pub(super) winners: wgpu::Buffer,
    pub(super) counters: wgpu::Buffer,
    pub(super) provenance: wgpu::Buffer,
    /// What the lookup reads of the left eye's samples: `shaders/shared/carried.wesl`.
    pub(super) irradiance: CopiedBuffer,
    /// Filled pixels that gather photons.
    pub(super) gathers: PixelList,
    pub(super) fill: PixelList,
}
