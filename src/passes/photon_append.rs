//! `photon_append`: see `shaders/passes/photon_append.wesl`.

use super::{Over, Pass};

/// Appends a batch's photons to the list in path order, whole paths only.
pub const PASS: Pass = Pass {
    name: "photon_append",
    what: "Appends a batch's photons to the list in path order, whole paths only.",
    over: Over::Batch,
    traces: false,
    reads: &["path_photons", "path_starts", "photon_counters"],
    writes: &["photons", "photon_kept"],
};
