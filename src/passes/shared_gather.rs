//! `shared_gather`: see `shaders/passes/shared_gather.wesl`.

use super::{Over, Pass};

/// Radiance estimate from photons that a workgroup loads together.
pub const PASS: Pass = Pass {
    name: "shared_gather",
    what: "Radiance estimate from photons that a workgroup loads together.",
    over: Over::Hits,
    traces: true,
    reads: &["end_rays", "hit_surfaces", "hit_paths", "photon_grid", "cell_starts", "sorted_photons", "photon_counters"],
    writes: &["indirect_light"],
};
