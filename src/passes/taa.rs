//! `taa`: see `shaders/passes/taa.wesl`.

use super::{Over, Pass};

/// Averages what is shown over frames, after the filmic curve.
pub const PASS: Pass = Pass {
    name: "taa",
    what: "Averages what is shown over frames, after the filmic curve.",
    over: Over::Pixels,
    traces: false,
    reads: &["motion", "reconstructed", "displayed_before"],
    writes: &["displayed"],
};
