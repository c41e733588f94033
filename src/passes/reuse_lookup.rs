//! `reuse_lookup`: see `shaders/passes/reuse_lookup.wesl`.

use super::{Over, Pass};

/// Lights what the right eye sees by the left samples around it, and lists the rest.
pub const PASS: Pass = Pass {
    name: "reuse_lookup",
    what: "Lights what the right eye sees by the left samples around it, and lists the rest.",
    over: Over::Seen,
    traces: true,
    reads: &["hit_rays", "first_surfaces", "hit_paths", "left_irradiance", "left_sample_radiance", "left_hit_rays", "left_direct_irradiance"],
    writes: &["sample_radiance", "radiance_sum", "sample_parts", "parts_sum", "stereo_counters", "provenance", "fill_list", "fill_count"],
};
