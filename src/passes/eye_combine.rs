//! `eye_combine`: see `shaders/passes/eye_combine.wesl`.

use super::{Over, Pass};

/// Adds up a sample's light and accumulates samples.
pub const PASS: Pass = Pass {
    name: "eye_combine",
    what: "Adds up a sample's light and accumulates samples.",
    over: Over::Pixels,
    traces: true,
    reads: &["hit_rays", "emitted_light", "direct_light", "indirect_light", "caustic_light", "first_albedo"],
    writes: &["sample_radiance", "radiance_sum", "sample_parts", "parts_sum"],
};
