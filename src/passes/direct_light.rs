//! `direct_light`: see `shaders/passes/direct_light.wesl`.

use super::{Over, Pass};

/// Next-event estimation at the gathered surfaces.
pub const PASS: Pass = Pass {
    name: "direct_light",
    what: "Next-event estimation at the gathered surfaces.",
    over: Over::Hits,
    traces: true,
    reads: &["end_rays", "hit_surfaces", "hit_paths"],
    writes: &["direct_light"],
};
