//! `cell_scatter`: see `shaders/passes/cell_scatter.wesl`.

use super::{Over, Pass};

/// Gives every photon a place in its cell's run.
pub const PASS: Pass = Pass {
    name: "cell_scatter",
    what: "Gives every photon a place in its cell's run.",
    over: Over::Photons,
    traces: false,
    reads: &["photon_counters", "photons", "photon_grid", "cell_starts"],
    writes: &["cell_cursors", "photon_order"],
};
