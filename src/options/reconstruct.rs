//! Settings of the passes that make a clean picture of noisy frames (`reconstruct.*`).

use serde::{Deserialize, Serialize};

/// Which reconstruction passes run, and their constants. All are off by default: a frame is then what its own samples
/// say.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReconstructSettings {
    /// Spatiotemporal variance-guided filtering of direct and indirect light (Schied et al. 2017); default off.
    pub svgf: bool,
    /// With `svgf`: the eyes share their accumulated light where both see a surface; default on.
    pub stereo: bool,
    /// Temporal anti-aliasing of what is shown, after the filmic curve; default off.
    pub taa: bool,
    /// While nothing moves, the mean over the still frames takes the picture over; default off.
    pub still: bool,
    /// Passes of the a-trous wavelet, 0 to 8; the last reaches 2^(passes + 1) pixels; default 5, as in the paper.
    pub atrous_passes: u32,
    /// Least share of a new frame in the accumulated light, 0 to 1; default 0.2, as in the paper.
    pub color_alpha: f64,
    /// The same for the luminance moments; default 0.2, as in the paper.
    pub moments_alpha: f64,
    /// Luminance difference, in standard deviations, at which a neighbour's weight is 1/e; default 4, as in the paper.
    pub sigma_luminance: f64,
    /// Exponent of the cosine between normals; default 128, as in the paper.
    pub sigma_normal: f64,
    /// Distance from the tangent plane, in pixel widths, at which a neighbour's weight is 1/e; default 1.
    pub sigma_plane_px: f64,
    /// Light with at most so many frames behind it is limited to its brightest neighbour's, 0: never; default 1. From 4 on
    /// mirrors and glass are always limited, since their histories are no longer (Hardie and Barner 1994).
    pub firefly_frames: u32,
    /// Share of a new frame in the displayed image, 0 to 1; default 0.1 (Karis 2014).
    pub taa_alpha: f64,
    /// How far from the mean of its 3x3 neighbours a history colour may lie, in their standard deviations; default 1
    /// (Salvi 2016).
    pub taa_clip: f64,
    /// Still frames up to which the filter alone is shown; default 16.
    pub still_from: u32,
    /// Still frames from which on the mean alone is shown; default 64.
    pub still_until: u32,
}

impl Default for ReconstructSettings {
    fn default() -> Self {
        Self {
            svgf: false,
            stereo: true,
            taa: false,
            still: false,
            atrous_passes: 5,
            color_alpha: 0.2,
            moments_alpha: 0.2,
            sigma_luminance: 4.0,
            sigma_normal: 128.0,
            sigma_plane_px: 1.0,
            firefly_frames: 1,
            taa_alpha: 0.1,
            taa_clip: 1.0,
            still_from: 16,
            still_until: 64,
        }
    }
}

impl ReconstructSettings {
    /// Whether any pass of it runs.
    #[must_use]
    pub fn is_on(&self) -> bool {
        self.svgf || self.taa || self.still
    }
}
