//! `coarse_spread`: see `shaders/passes/coarse_spread.wesl`.

use super::{Over, Pass};

/// Interpolates gathered light between the pixels that gathered, and lists what must gather by itself.
pub const PASS: Pass = Pass {
    name: "coarse_spread",
    what: "Interpolates gathered light between the pixels that gathered, and lists what must gather by itself.",
    over: Over::Hits,
    traces: true,
    reads: &["hit_rays", "hit_surfaces", "hit_paths", "carried_light"],
    writes: &["indirect_light", "gather_list", "gather_count"],
};
