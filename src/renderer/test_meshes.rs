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

/// Rectangles, each from a corner along two sides whose product is the normal.
pub(super) fn walls(rectangles: &[[DVec3; 3]]) -> Mesh {
    let corners = |&[corner, across, up]: &[DVec3; 3]| {
        let normal = across.cross(up).normalize();
        [DVec3::ZERO, across, across + up, up].map(|side| (corner + side, normal))
    };
    let points: Vec<_> = rectangles.iter().flat_map(corners).collect();
    let firsts = (0..points.len() as u32).step_by(4);
    let triangles = firsts.flat_map(|a| [[a, a + 1, a + 2], [a, a + 2, a + 3]]);
    mesh(&points, triangles.collect(), 0)
}
