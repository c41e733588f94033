//! `refit`: see `shaders/passes/refit.wesl`.

use super::{Over, Pass};

/// Boxes of deforming hierarchies.
pub const PASS: Pass = Pass {
    name: "refit",
    what: "Boxes of one level of the deforming meshes' hierarchies, from the leaves up.",
    over: Over::Deforming,
    traces: false,
    reads: &["refit_nodes"],
    writes: &["mesh_nodes", "refit_costs"],
};
