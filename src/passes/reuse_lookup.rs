//! `reuse_lookup`: see `shaders/passes/reuse_lookup.wesl`.

use super::{Over, Pass};

/// Traces the right eye's primary rays, lights what they meet by the left samples around it, and lists the rest.
pub const PASS: Pass = Pass {
    name: "reuse_lookup",
    what: "Traces the right eye's primary rays, lights what they meet by the left samples around it, and lists the rest.",
    over: Over::Pixels,
    traces: true,
    reads: &["carried_light", "left_direct_irradiance"],
    writes: &["hit_rays", "first_surfaces", "radiance_sum", "parts_sum", "stereo_counters", "provenance", "fill_list", "fill_count"],
};
