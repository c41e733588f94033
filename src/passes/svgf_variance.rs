//! `svgf_variance`: see `shaders/passes/svgf_variance.wesl`.

use super::{Over, Pass};

/// Estimates the variance of the accumulated light.
pub const PASS: Pass = Pass {
    name: "svgf_variance",
    what: "Estimates the variance of the accumulated light.",
    over: Over::Pixels,
    traces: false,
    reads: &["seen_surfaces", "direct_mean", "indirect_mean", "moments", "history_length"],
    writes: &["direct_filtered", "indirect_filtered"],
};
