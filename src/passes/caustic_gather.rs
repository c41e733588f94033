//! `caustic_gather`: see `shaders/passes/caustic_gather.wesl`.

use super::{Over, Pass};

/// Radiance estimate from the caustic photons around the gathered surfaces.
pub const PASS: Pass = Pass {
    name: "caustic_gather",
    what: "Radiance estimate from the caustic photons around the gathered surfaces.",
    over: Over::Hits,
    traces: true,
    reads: &["end_rays", "hit_surfaces", "hit_paths", "photon_grid", "cell_starts", "sorted_photons", "photon_counters"],
    writes: &["caustic_light"],
};
