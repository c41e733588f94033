//! `scan_add`: see `shaders/passes/scan_add.wesl`.

use super::{Over, Pass};

/// Prefix sum, last step: adds each block's start.
pub const PASS: Pass = Pass {
    name: "scan_add",
    what: "Prefix sum, last step: adds each block's start.",
    over: Over::ScanValues,
    traces: false,
    reads: &["scan_sums"],
    writes: &["scan_values"],
};
