//! `grid_setup`: see `shaders/passes/grid_setup.wesl`.

use super::{Over, Pass};

/// Lays the grid over the photons' box.
pub const PASS: Pass = Pass {
    name: "grid_setup",
    what: "Lays the grid over the photons' box.",
    over: Over::Once,
    traces: false,
    reads: &["photon_counters", "photon_bounds", "cell_starts"],
    writes: &["photon_grid"],
};
