//! `svgf_atrous`: see `shaders/passes/svgf_atrous.wesl`.

use super::{Over, Pass};

/// One pass of the edge-avoiding wavelet filter.
pub const PASS: Pass = Pass {
    name: "svgf_atrous",
    what: "One pass of the edge-avoiding wavelet filter.",
    over: Over::Pixels,
    traces: false,
    reads: &["seen_surfaces", "direct_from", "indirect_from"],
    writes: &["direct_to", "indirect_to"],
};
