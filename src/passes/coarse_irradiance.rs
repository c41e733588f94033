//! `coarse_irradiance`: see `shaders/passes/coarse_irradiance.wesl`.

use super::{Over, Pass};

/// Divides the gathered pixels' light by the reflectance that it came from.
pub const PASS: Pass = Pass {
    name: "coarse_irradiance",
    what: "Divides the gathered pixels' light by the reflectance that it came from.",
    over: Over::Hits,
    traces: true,
    reads: &["hit_rays", "hit_surfaces", "hit_paths", "indirect_light"],
    writes: &["carried_light"],
};
