//! `list_setup`: see `shaders/passes/list_setup.wesl`.

use super::{Over, Pass};

/// Turns the length of a pixel list into workgroups.
pub const PASS: Pass = Pass {
    name: "list_setup",
    what: "Turns the length of a pixel list into workgroups.",
    over: Over::Once,
    traces: false,
    reads: &["pixel_count"],
    writes: &["list_groups"],
};
