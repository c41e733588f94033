//! `cell_sort`: see `shaders/passes/cell_sort.wesl`.

use super::{Over, Pass};

/// Orders every run by photon number, so that sums have one order.
pub const PASS: Pass = Pass {
    name: "cell_sort",
    what: "Orders every run by photon number, so that sums have one order.",
    over: Over::Cells,
    traces: false,
    reads: &["photon_grid", "cell_starts"],
    writes: &["photon_order"],
};
