//! What the tests build hierarchies over.

use stereolux_bvh::{MeshSource, MeshTriangle};

/// A mesh without anything but its triangles.
#[derive(Clone, Default)]
pub struct Mesh {
    pub positions: Vec<[f32; 3]>,
    pub triangles: Vec<MeshTriangle>,
}

impl MeshSource for Mesh {
    fn name(&self) -> &str {
        "mesh"
    }

    fn positions(&self) -> &[[f32; 3]] {
        &self.positions
    }

    fn triangles(&self) -> &[MeshTriangle] {
        &self.triangles
    }
}
