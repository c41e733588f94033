//! `primary_hits`: see `shaders/passes/primary_hits.wesl`.

use super::{Over, Pass};

/// Traces the right eye's primary rays, without shading.
pub const PASS: Pass = Pass {
    name: "primary_hits",
    what: "Traces the right eye's primary rays, without shading.",
    over: Over::Pixels,
    traces: true,
    reads: &["left_sample_radiance"],
    writes: &["hit_rays", "first_surfaces", "hit_paths", "sample_radiance", "radiance_sum", "sample_parts", "parts_sum", "provenance", "seen_list", "seen_count"],
};
