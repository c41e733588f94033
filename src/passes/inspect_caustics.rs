//! `inspect_caustics`: see `shaders/passes/inspect_caustics.wesl`.

use super::{Over, Pass};

/// Gathers the map of caustics alone, where the path of each pixel's centre ends.
pub const PASS: Pass = Pass {
    name: "inspect_caustics",
    what: "Gathers the map of caustics alone, where the path of each pixel's centre ends.",
    over: Over::Pixels,
    traces: true,
    reads: &["photon_grid", "cell_starts", "sorted_photons", "photon_counters"],
    writes: &["inspected_light"],
};
