//! Meshes of the renderer's own tests.

use glam::DVec3;

use crate::scene::{Mesh, MeshTriangle};

/// A mesh of points and their normals, without textures.
pub(super) fn mesh(points: &[(DVec3, DVec3)], triangles: Vec<[u32; 3]>, material: u32) -> Mesh {
    let array = |v: DVec3| v.as_vec3().to_array();
    let tangent = |n: DVec3| n.any_orthonormal_vector().extend(1.0).as_vec4().to_array();
    Mesh {
        positions: points.iter().map(|(p, _)| array(*p)).collect(),
        normals: points.iter().map(|(_, n)| array(*n)).collect(),
        tangents: points.iter().map(|(_, n)| tangent(*n)).collect(),
        uv0: vec![[0.0; 2]; points.len()],
        uv1: vec![[0.0; 2]; points.len()],
        colors: vec![[1.0; 4]; points.len()],
        triangles: triangles
            .into_iter()
            .map(|vertices| MeshTriangle { vertices, material })
            .collect(),
        ..Mesh::default()
    }
}
