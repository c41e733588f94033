//! `left_copy`: see `shaders/passes/left_copy.wesl`.

use super::{Over, Pass};

/// Gives the right eye the left eye's sample, where both see the same.
pub const PASS: Pass = Pass {
    name: "left_copy",
    what: "Gives the right eye the left eye's sample, where both see the same.",
    over: Over::Pixels,
    traces: true,
    reads: &["left_hit_rays", "left_first_surfaces", "left_sample_radiance", "left_sample_parts", "left_hit_count"],
    writes: &["hit_rays", "first_surfaces", "radiance_sum", "parts_sum", "stereo_counters", "provenance"],
};
