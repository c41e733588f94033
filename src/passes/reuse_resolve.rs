//! `reuse_resolve`: see `shaders/passes/reuse_resolve.wesl`.

use super::{Over, Pass};

/// Copies the winners' radiance and lists the pixels that are still empty.
pub const PASS: Pass = Pass {
    name: "reuse_resolve",
    what: "Copies the winners' radiance and lists the pixels that are still empty.",
    over: Over::Pixels,
    traces: false,
    reads: &["scatter_winners", "left_sample_radiance"],
    writes: &["sample_radiance", "radiance_sum", "stereo_counters", "provenance", "fill_list", "fill_count"],
};
