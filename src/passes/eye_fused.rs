//! `eye_fused`: see `shaders/passes/eye_fused.wesl`.

use super::{Over, Pass};

/// Traces the eye's paths and gathers photons where they end, in one kernel.
pub const PASS: Pass = Pass {
    name: "eye_fused",
    what: "Traces the eye's paths and gathers photons where they end, in one kernel.",
    over: Over::Pixels,
    traces: true,
    reads: &["photon_grid", "cell_starts", "sorted_photons", "photon_counters"],
    writes: &["hit_list", "hit_count", "hit_rays", "end_rays", "hit_surfaces", "hit_paths", "first_surfaces", "emitted_light", "indirect_light", "first_albedo"],
};
