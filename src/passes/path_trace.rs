//! `path_trace`: see `shaders/passes/path_trace.wesl`.

use super::{Over, Pass};

/// Path tracing with next-event estimation: the reference.
pub const PASS: Pass = Pass {
    name: "path_trace",
    what: "Path tracing with next-event estimation: the reference.",
    over: Over::Pixels,
    traces: true,
    reads: &[],
    writes: &["hit_list", "hit_count", "hit_rays", "first_surfaces", "hit_paths", "sample_radiance", "radiance_sum", "sample_parts", "parts_sum"],
};
