//! `fill_setup`: see `shaders/passes/fill_setup.wesl`.

use super::{Over, Pass};

/// Turns the number of empty pixels into workgroups.
pub const PASS: Pass = Pass {
    name: "fill_setup",
    what: "Turns the number of empty pixels into workgroups.",
    over: Over::Once,
    traces: false,
    reads: &[],
    writes: &["stereo_counters", "fill_count", "fill_groups"],
};
