//! `photon_bounds`: see `shaders/passes/photon_bounds.wesl`.

use super::{Over, Pass};

/// Finds the box around the photons.
pub const PASS: Pass = Pass {
    name: "photon_bounds",
    what: "Finds the box around the photons.",
    over: Over::PhotonSixteenths,
    traces: false,
    reads: &["photon_counters", "photons"],
    writes: &["photon_bounds"],
};
