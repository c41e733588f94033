//! `scatter_winner`: see `shaders/passes/scatter_winner.wesl`.

use super::{Over, Pass};

/// Settles ties: the lowest left pixel at the nearest distance wins.
pub const PASS: Pass = Pass {
    name: "scatter_winner",
    what: "Settles ties: the lowest left pixel at the nearest distance wins.",
    over: Over::Hits,
    traces: false,
    reads: &["scatter_targets", "scatter_nearest"],
    writes: &["scatter_winners"],
};
