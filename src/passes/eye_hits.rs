//! `eye_hits`: see `shaders/passes/eye_hits.wesl`.

use super::{Over, Pass};

/// Traces primary rays, over mirrors and through glass, to the first surface that gathers photons.
pub const PASS: Pass = Pass {
    name: "eye_hits",
    what: "Traces primary rays, over mirrors and through glass, to the first surface that gathers photons.",
    over: Over::Pixels,
    traces: true,
    reads: &[],
    writes: &["hit_list", "hit_count", "hit_rays", "end_rays", "hit_surfaces", "hit_paths", "first_surfaces", "emitted_light", "first_albedo"],
};
