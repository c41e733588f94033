//! `xr_submit_depth`: see `shaders/passes/xr_submit_depth.wesl`.

use super::{Over, Pass};

/// Writes an eye's depth into a runtime's texture.
pub const PASS: Pass = Pass {
    name: "xr_submit_depth",
    what: "Writes an eye's depth into a runtime's texture.",
    over: Over::Fragments,
    traces: false,
    reads: &["hit_rays", "scatter_winners", "provenance", "left_hit_rays"],
    writes: &[],
};
