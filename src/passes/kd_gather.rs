//! `kd_gather`: see `shaders/passes/kd_gather.wesl`.

use super::{Over, Pass};

/// Radiance estimate from the photons around the gathered surfaces, found in a kd-tree.
pub const PASS: Pass = Pass {
    name: "kd_gather",
    what: "Radiance estimate from the photons around the gathered surfaces, found in a kd-tree.",
    over: Over::Hits,
    traces: true,
    reads: &["end_rays", "hit_surfaces", "hit_paths", "photon_grid", "sorted_photons", "photon_counters", "kd_nodes"],
    writes: &["indirect_light"],
};
