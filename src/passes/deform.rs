//! `deform`: see `shaders/passes/deform.wesl`.

use super::{Over, Pass};

/// Vertices of skinned and morphed meshes.
pub const PASS: Pass = Pass {
    name: "deform",
    what: "Vertices of skinned and morphed meshes in their instance's object space.",
    over: Over::Deforming,
    traces: false,
    reads: &[
        "rest_vertices",
        "deform_meshes",
        "morph_deltas",
        "morph_weights",
        "joint_rows",
    ],
    writes: &["deformed_positions", "vertices"],
};
