//! `scan_blocks`: see `shaders/passes/scan_blocks.wesl`.

use super::{Over, Pass};

/// Prefix sum, first step: scans blocks of 2,048 values.
pub const PASS: Pass = Pass {
    name: "scan_blocks",
    what: "Prefix sum, first step: scans blocks of 2,048 values.",
    over: Over::ScanBlocks,
    traces: false,
    reads: &[],
    writes: &["scan_values", "scan_sums"],
};
