//! `photon_trace`: see `shaders/passes/photon_trace.wesl`.

use super::{Over, Pass};

/// Emits photon paths, follows them, and leaves each path's photons in slots of its own.
pub const PASS: Pass = Pass {
    name: "photon_trace",
    what: "Emits photon paths, follows them, and leaves each path's photons in slots of its own.",
    over: Over::Batch,
    traces: true,
    reads: &[],
    writes: &["path_photons", "path_counts"],
};
