//! `photon_count`: see `shaders/passes/photon_count.wesl`.

use super::{Over, Pass};

/// Books a batch: what was stored, dropped, kept.
pub const PASS: Pass = Pass {
    name: "photon_count",
    what: "Books a batch: what was stored, dropped, kept.",
    over: Over::Once,
    traces: false,
    reads: &["path_starts", "photon_kept"],
    writes: &["photon_counters"],
};
