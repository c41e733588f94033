//! `fill_reasons`: see `shaders/passes/fill_reasons.wesl`.

use super::{Over, Pass};

/// Says of every filled pixel that sees a surface why it could not be reused.
pub const PASS: Pass = Pass {
    name: "fill_reasons",
    what: "Says of every filled pixel that sees a surface why it could not be reused.",
    over: Over::Hits,
    traces: true,
    reads: &["hit_rays", "first_surfaces", "hit_paths", "left_hit_rays"],
    writes: &["stereo_counters", "provenance"],
};
