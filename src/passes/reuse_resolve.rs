//! `reuse_resolve`: see `shaders/passes/reuse_resolve.wesl`.

use super::{Over, Pass};

/// Copies the winners' radiance and lists the pixels that are still empty.
pub const PASS: Pass = Pass {
    name: "reuse_resolve",
    what: "Copies the winners' radiance and lists the pixels that are still empty.",
    over: Over::Pixels,
    traces: true,
    reads: &["scatter_winners", "left_sample_radiance", "left_sample_parts"],
    writes: &["radiance_sum", "parts_sum", "stereo_counters", "provenance", "fill_list", "fill_count"],
};
