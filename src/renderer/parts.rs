//! Radiance in parts, which `output.parts` asks for: `shaders/shared/parts.wesl` says what they are.

use super::eye_plan::EyePlan;
use crate::gpu::buffers::read_buffer;
use crate::gpu::{GpuContext, GpuError, Resources, storage_buffer};

/// Bytes of a sample's parts: direct light and albedo, three f32 each.
const BYTES_PER_PIXEL: u64 = 24;

/// An eye's radiance in parts, means over a frame's samples, row 0 on top.
#[derive(Debug, Clone, PartialEq)]
pub struct RadianceParts {
    /// Emission and surroundings that the eye sees, and light that came from a light source and was scattered once, at
    /// the first surface that is no mirror and no smooth glass. The photon method counts lobes that eye paths follow
    /// among the mirrors; with `photon.direct=map` direct light is among the indirect.
    pub direct: Vec<[f32; 3]>,
    /// The rest of the radiance: exactly what `read_radiance` gives less `direct`, in f32, but never below 0.
    pub indirect: Vec<[f32; 3]>,
    /// Reflectance of the first surface towards the eye, by its Fresnel terms; 1 where a sample met no surface.
    pub albedo: Vec<[f32; 3]>,
}

/// Buffers of an eye's parts.
pub(super) struct PartBuffers {
    /// 16 bytes per pixel; photon method only.
    first_albedo: wgpu::Buffer,
    /// The sample's direct light and albedo.
    pub(super) sample: wgpu::Buffer,
    /// Their sums.
    pub(super) sum: wgpu::Buffer,
    /// 8 bytes per pixel: the left eye's direct light over reflectance, where the lookup carries it.
    pub(super) irradiance: wgpu::Buffer,
}

impl PartBuffers {
    /// `keeps`: the sample's parts, besides their sums.
    ///
    /// # Errors
    /// As [`storage_buffer`].
    pub(super) fn new(
        context: &GpuContext,
        eye: &str,
        pixels: u64,
        plan: &EyePlan,
        keeps: bool,
    ) -> Result<Self, GpuError> {
        let buffer = |name: &str, bytes| storage_buffer(context, &format!("{eye} {name}"), bytes);
        let carries = plan
            .stereo
            .iter()
            .any(|pass| pass.writes.contains(&"left_direct_irradiance"));
        let image_if = |wanted: bool| if wanted { pixels * 16 } else { 16 };
        Ok(Self {
            first_albedo: buffer("first albedo", image_if(plan.photon))?,
            sample: buffer(
                "sample parts",
                if keeps { pixels * BYTES_PER_PIXEL } else { 16 },
            )?,
            sum: buffer("parts sum", pixels * BYTES_PER_PIXEL)?,
            irradiance: buffer("direct irradiance", if carries { pixels * 8 } else { 16 })?,
        })
    }

    pub(super) fn resources(&self) -> Resources<'_> {
        Resources::new()
            .with("first_albedo", &self.first_albedo)
            .with("sample_parts", &self.sample)
            .with("parts_sum", &self.sum)
    }

    /// The parts of every pixel whose mean is `radiance`.
    ///
    /// # Errors
    /// As [`read_buffer`].
    pub(super) fn read(
        &self,
        context: &GpuContext,
        radiance: &[[f32; 3]],
        samples: u32,
    ) -> Result<RadianceParts, GpuError> {
        let sums: Vec<[[f32; 3]; 2]> = read_buffer(context, "parts", &self.sum, radiance.len())?;
        let scale = 1.0 / samples.max(1) as f32;
        let mean = |part: usize| -> Vec<[f32; 3]> {
            sums.iter()
                .map(|sums| sums[part].map(|channel| channel * scale))
                .collect()
        };
        let direct = mean(0);
        let indirect = radiance
            .iter()
            .zip(&direct)
            // Where nothing is indirect the two sums were rounded differently.
            .map(|(all, direct)| [0, 1, 2].map(|channel| (all[channel] - direct[channel]).max(0.0)))
            .collect();
        Ok(RadianceParts {
            direct,
            indirect,
            albedo: mean(1),
        })
    }
}
