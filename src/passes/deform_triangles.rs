//! `deform_triangles`: see `shaders/passes/deform_triangles.wesl`.

use super::{Over, Pass};

/// Deformed vertices into triangles.
pub const PASS: Pass = Pass {
    name: "deform_triangles",
    what: "Puts the deformed vertices into the triangles that rays meet.",
    over: Over::Deforming,
    traces: false,
    reads: &["deformed_triangles", "deformed_positions"],
    writes: &["triangles"],
};
