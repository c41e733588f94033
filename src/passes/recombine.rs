//! `recombine`: see `shaders/passes/recombine.wesl`.

use super::{Over, Pass};

/// Puts the filtered light, the albedo and the mean of still frames together.
pub const PASS: Pass = Pass {
    name: "recombine",
    what: "Puts the filtered light, the albedo and the mean of still frames together.",
    over: Over::Pixels,
    traces: true,
    reads: &["radiance_sum", "parts_sum", "seen_surfaces", "seen_emission", "direct_filtered", "indirect_filtered"],
    writes: &["still_sum", "reconstructed"],
};
