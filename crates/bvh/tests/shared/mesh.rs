//! What the tests build hierarchies over.

use glam::{DAffine3, Vec3};
use stereolux_bvh::{InstanceSource, MeshSource, MeshTriangle};

use super::shapes::{self, Random};

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

/// A mesh of triangles that share no vertex.
pub fn mesh_of(triangles: &[[Vec3; 3]]) -> Mesh {
    let (positions, triangles) = shapes::unshared(triangles);
    Mesh {
        positions,
        triangles,
    }
}

/// Triangles of about one size anywhere.
pub fn soup(random: &mut Random, count: usize, size: f64) -> Mesh {
    mesh_of(&shapes::soup(random, count, size))
}

/// A mesh at a place, without node or emitters of its own.
pub fn placed(world_from_object: DAffine3, mesh: u32) -> InstanceSource {
    InstanceSource {
        world_from_object,
        mesh,
        node: 0,
        first_emitter: 0,
    }
}
