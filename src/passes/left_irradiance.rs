//! `left_irradiance`: see `shaders/passes/left_irradiance.wesl`.

use super::{Over, Pass};

/// Divides the left samples' radiance by the reflectance that it came from.
pub const PASS: Pass = Pass {
    name: "left_irradiance",
    what: "Divides the left samples' radiance by the reflectance that it came from.",
    over: Over::Hits,
    traces: true,
    reads: &["left_hit_rays", "left_first_surfaces", "left_hit_paths", "left_sample_radiance", "left_sample_parts", "left_indirect_light"],
    writes: &["carried_light", "left_direct_irradiance", "stereo_counters"],
};
