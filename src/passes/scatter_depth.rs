//! `scatter_depth`: see `shaders/passes/scatter_depth.wesl`.

use super::{Over, Pass};

/// Projects left hits into the right eye and keeps the nearest distance per right pixel.
pub const PASS: Pass = Pass {
    name: "scatter_depth",
    what: "Projects left hits into the right eye and keeps the nearest distance per right pixel.",
    over: Over::Hits,
    traces: true,
    reads: &["left_hit_rays", "left_first_surfaces", "left_hit_paths"],
    writes: &["scatter_targets", "scatter_nearest", "stereo_counters"],
};
