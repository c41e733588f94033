//! Photons gathered at every other pixel in each direction, and light between them interpolated (`photon.half_rate`).

use super::eye_buffers::PixelList;
use crate::gpu::texels::CopiedBuffer;
use crate::gpu::{FrameRecorder, GpuContext, GpuError, Resources};

/// What an eye's passes need besides its images; both eyes take turns with it.
pub(super) struct HalfRate {
    /// Pixels that gather first.
    pub(super) coarse: PixelList,
    /// Pixels between them that found nothing to interpolate.
    pub(super) rest: PixelList,
    /// What was gathered, over reflectance: `shaders/shared/carried.wesl`.
    light: CopiedBuffer,
}

impl HalfRate {
    /// For images of `pixels` pixels. `texels`: light is read from a copy in a texture.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`], [`GpuError::Validation`]: it does not fit.
    pub(super) fn new(context: &GpuContext, pixels: u64, texels: bool) -> Result<Self, GpuError> {
        Ok(Self {
            coarse: PixelList::new(context, "coarse", pixels)?,
            rest: PixelList::new(context, "rest", pixels)?,
            light: CopiedBuffer::new(context, "coarse light", pixels * 16, texels)?,
        })
    }

    /// `resources` with what the passes write.
    pub(super) fn written<'a>(&'a self, resources: &Resources<'a>) -> Resources<'a> {
        resources
            .clone()
            .with("coarse_list", &self.coarse.pixels)
            .with("coarse_count", &self.coarse.count)
            .with("gather_list", &self.rest.pixels)
            .with("gather_count", &self.rest.count)
            .with("carried_light", &self.light.buffer)
    }

    /// The same for the pass that reads the light.
    pub(super) fn read<'a>(&'a self, resources: &Resources<'a>) -> Resources<'a> {
        self.light.read_by(self.written(resources), "carried_light")
    }

    /// Empties the lists and the light, before each eye's sample.
    pub(super) fn clear(&self, recorder: &mut FrameRecorder<'_>) {
        recorder.clear(&self.coarse.count);
        recorder.clear(&self.rest.count);
        recorder.clear(&self.light.buffer);
    }

    /// Brings the light's copy up to date; its time counts as `label`'s.
    pub(super) fn copy_light(&self, recorder: &mut FrameRecorder<'_>, label: &str) {
        self.light.record(recorder, label);
    }
}
