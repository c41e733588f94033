//! `inspect_surfaces`: see `shaders/passes/inspect_surfaces.wesl`.

use super::{Over, Pass};

/// Notes what the ray through each pixel's centre meets: instance, triangle, material, distance, normals, base colour, nodes.
pub const PASS: Pass = Pass {
    name: "inspect_surfaces",
    what: "Notes what the ray through each pixel's centre meets: instance, triangle, material, distance, normals, base colour, nodes.",
    over: Over::Pixels,
    traces: true,
    reads: &[],
    writes: &["inspected_hits", "inspected_normals", "inspected_colors", "inspected_marks"],
};
