//! `direct_light`: see `shaders/passes/direct_light.wesl`.

use super::{Over, Pass};

/// Direct light at the gathered surfaces, by light samples and by the surface's own directions.
pub const PASS: Pass = Pass {
    name: "direct_light",
    what: "Direct light at the gathered surfaces, by light samples and by the surface's own directions.",
    over: Over::Hits,
    traces: true,
    reads: &["end_rays", "hit_surfaces", "hit_paths"],
    writes: &["direct_light"],
};
