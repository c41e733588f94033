//! `stereo_share`: see `shaders/passes/stereo_share.wesl`.

use super::{Over, Pass};

/// Takes in the other eye's accumulated light where both see a surface.
pub const PASS: Pass = Pass {
    name: "stereo_share",
    what: "Takes in the other eye's accumulated light where both see a surface.",
    over: Over::Pixels,
    traces: false,
    reads: &["seen_surfaces", "direct_mean", "indirect_mean", "moments", "history_length", "other_surfaces", "other_direct", "other_indirect", "other_moments", "other_length"],
    writes: &["shared_direct", "shared_indirect", "shared_moments", "shared_length"],
};
