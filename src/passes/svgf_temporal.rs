//! `svgf_temporal`: see `shaders/passes/svgf_temporal.wesl`.

use super::{Over, Pass};

/// Averages light over the frames in which its surface was seen.
pub const PASS: Pass = Pass {
    name: "svgf_temporal",
    what: "Averages light over the frames in which its surface was seen.",
    over: Over::Pixels,
    traces: false,
    reads: &["radiance_sum", "parts_sum", "seen_surfaces", "seen_emission", "motion", "seen_before", "direct_history", "indirect_history", "moments_before", "length_before"],
    writes: &["direct_mean", "indirect_mean", "moments", "history_length"],
};
