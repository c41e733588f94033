//! `inspect_photons`: see `shaders/passes/inspect_photons.wesl`.

use super::{Over, Pass};

/// Counts the photons around the surface that each pixel sees: within the gather radius, and in its cell of the grid.
pub const PASS: Pass = Pass {
    name: "inspect_photons",
    what: "Counts the photons around the surface that each pixel sees: within the gather radius, and in its cell of the grid.",
    over: Over::Pixels,
    traces: false,
    reads: &["photon_grid", "cell_starts", "sorted_photons", "inspected_normals", "inspected_marks"],
    writes: &["photons_around"],
};
