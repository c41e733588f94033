//! `inspect_dots`: see `shaders/passes/inspect_dots.wesl`.

use super::{Over, Pass};

/// Counts the photons that an eye sees in each of its pixels.
pub const PASS: Pass = Pass {
    name: "inspect_dots",
    what: "Counts the photons that an eye sees in each of its pixels.",
    over: Over::Photons,
    traces: false,
    reads: &["sorted_photons", "photon_counters", "inspected_normals", "inspected_marks"],
    writes: &["photon_dots"],
};
