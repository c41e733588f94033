//! `kd_nearest_gather`: see `shaders/passes/kd_nearest_gather.wesl`.

use super::{Over, Pass};

/// Radiance estimate from the nearest photons, found in a kd-tree.
pub const PASS: Pass = Pass {
    name: "kd_nearest_gather",
    what: "Radiance estimate from the nearest photons, found in a kd-tree.",
    over: Over::Hits,
    traces: true,
    reads: &["end_rays", "hit_surfaces", "hit_paths", "photon_grid", "sorted_photons", "photon_counters", "kd_nodes"],
    writes: &["indirect_light", "nearest_heaps"],
};
