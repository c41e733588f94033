//! `nearest_gather`: see `shaders/passes/nearest_gather.wesl`.

use super::{Over, Pass};

/// Radiance estimate from the nearest photons, found in the grid.
pub const PASS: Pass = Pass {
    name: "nearest_gather",
    what: "Radiance estimate from the nearest photons, found in the grid.",
    over: Over::Hits,
    traces: true,
    reads: &["end_rays", "hit_surfaces", "hit_paths", "photon_grid", "cell_starts", "sorted_photons", "photon_counters"],
    writes: &["indirect_light", "nearest_heaps"],
};
