//! `caustic_trace`: see `shaders/passes/caustic_trace.wesl`.

use super::{Over, Pass};

/// Emits the photon paths of the caustic map and follows them over narrow lobes.
pub const PASS: Pass = Pass {
    name: "caustic_trace",
    what: "Emits the photon paths of the caustic map and follows them over narrow lobes.",
    over: Over::Batch,
    traces: true,
    reads: &[],
    writes: &["path_photons", "path_counts"],
};
