//! `indirect_lookup`: see `shaders/passes/indirect_lookup.wesl`.

use super::{Over, Pass};

/// Takes the indirect light of glossy surfaces over from the left samples around them, and lists the rest.
pub const PASS: Pass = Pass {
    name: "indirect_lookup",
    what: "Takes the indirect light of glossy surfaces over from the left samples around them, and lists the rest.",
    over: Over::Hits,
    traces: true,
    reads: &["hit_rays", "hit_surfaces", "hit_paths", "carried_light"],
    writes: &["indirect_light", "stereo_counters", "gather_list", "gather_count"],
};
