//! `photon_gather`: see `shaders/passes/photon_gather.wesl`.

use super::{Over, Pass};

/// Radiance estimate from the photons around the gathered surfaces.
pub const PASS: Pass = Pass {
    name: "photon_gather",
    what: "Radiance estimate from the photons around the gathered surfaces.",
    over: Over::Hits,
    traces: true,
    reads: &["end_rays", "hit_surfaces", "hit_paths", "photon_grid", "cell_starts", "sorted_photons", "photon_counters"],
    writes: &["indirect_light"],
};
