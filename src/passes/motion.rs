//! `motion`: see `shaders/passes/motion.wesl`.

use super::{Over, Pass};

/// What every pixel sees, and where that was in the frame before.
pub const PASS: Pass = Pass {
    name: "motion",
    what: "What every pixel sees, and where that was in the frame before.",
    over: Over::Pixels,
    traces: true,
    reads: &["hit_rays", "first_surfaces", "scatter_winners", "provenance", "left_first_surfaces"],
    writes: &["seen_surfaces", "motion", "seen_emission"],
};
