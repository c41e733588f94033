//! What an eye's passes are, decided once for a scene and its settings.

use crate::passes::Pass;

/// What an eye's passes are for one method.
#[derive(Debug, Clone)]
pub struct EyePlan {
    /// Passes of one sample, in order.
    pub sample: Vec<&'static Pass>,
    /// Samples that one dispatch takes where that many are left, a power of two; above 1 for the path tracer alone, and
    /// only where no pass needs every sample's hits.
    pub run: u32,
    /// Whether the photon method's buffers are needed.
    pub photon: bool,
    /// Whether caustics have a map of their own.
    pub caustics: bool,
    /// Passes by which the right eye takes over what it can; none where it is rendered by itself.
    pub stereo: &'static [&'static Pass],
    /// Whether radiance is split into parts.
    pub parts: bool,
    /// Whether the right eye's glossy surfaces take indirect light over.
    pub carries_indirect: bool,
    /// Photons of the estimate from the nearest.
    pub nearest: u32,
    /// Whether photons are gathered at every other pixel in each direction.
    pub half_rate: bool,
    /// Whether what many threads read again is in textures: the feature `record_texels`.
    pub texels: bool,
}

impl EyePlan {
    pub(super) fn writes(&self, name: &str) -> bool {
        self.sample.iter().any(|pass| pass.writes.contains(&name))
    }

    /// Bytes for what one pixel keeps of its nearest photons from slice to slice.
    pub(super) fn heap_bytes(&self) -> u64 {
        (u64::from(self.nearest) + 1) * 8
    }
}

/// Slices in which photons are gathered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GatherSlices {
    /// From the map of photons.
    pub photons: u32,
    /// From the map of caustics.
    pub caustics: u32,
}

impl GatherSlices {
    pub(super) const ONE: Self = Self {
        photons: 1,
        caustics: 1,
    };
}
