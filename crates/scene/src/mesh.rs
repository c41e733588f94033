//! Triangle meshes.

use glam::DVec3;

pub use stereolux_bvh::MeshTriangle;

use stereolux_bvh::MeshSource;

use super::import::tangents::any_tangent;
use super::{MorphTarget, VertexJoints, as_dvec3};

/// One glTF mesh, its primitives merged. Every vertex array has `positions.len()` entries.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Name in the file, or `mesh N`.
    pub name: String,
    /// Object space, metres, finite.
    pub positions: Vec<[f32; 3]>,
    /// Unit length, object space. Flat normals (vertices not shared) where the file has none.
    pub normals: Vec<[f32; 3]>,
    /// Unit tangent towards +u, object space, and handedness +-1: `bitangent = cross(normal, tangent) * w`.
    /// Where `has_tangents` is false, any tangent perpendicular to the normal.
    pub tangents: Vec<[f32; 4]>,
    /// Coordinate set 0; 0 where missing.
    pub uv0: Vec<[f32; 2]>,
    /// Coordinate set 1; 0 where missing.
    pub uv1: Vec<[f32; 2]>,
    /// Linear RGBA of `COLOR_0`; 1 where missing.
    pub colors: Vec<[f32; 4]>,
    /// Joints of `JOINTS_0` and `_1` and their weights, the four largest; empty where the mesh has none.
    pub joints: Vec<VertexJoints>,
    /// Morph targets.
    pub targets: Vec<MorphTarget>,
    /// Ranges of vertices whose normals are their triangle's own, because the file has none.
    pub flat: Vec<std::ops::Range<u32>>,
    /// Triangles, counter-clockwise seen from the front.
    pub triangles: Vec<MeshTriangle>,
    /// Whether tangents mean anything: read from the file, or derived because a normal texture needs them.
    pub has_tangents: bool,
    /// Whether any primitive has `TEXCOORD_1`.
    pub has_uv1: bool,
    /// Whether any primitive has `COLOR_0`.
    pub has_colors: bool,
    /// Materials that edits have replaced in its triangles, in that order: (before, after). Who keeps something made from
    /// the triangles sees by it, without looking at them, whether their materials are still the same.
    pub repainted: Vec<[u32; 2]>,
}

impl MeshSource for Mesh {
    fn name(&self) -> &str {
        &self.name
    }

    fn positions(&self) -> &[[f32; 3]] {
        &self.positions
    }

    fn triangles(&self) -> &[MeshTriangle] {
        &self.triangles
    }
}

impl Mesh {
    /// White, of one material, without textures; any tangents.
    pub fn plain(
        positions: Vec<[f32; 3]>,
        normals: Vec<[f32; 3]>,
        triangles: impl IntoIterator<Item = [u32; 3]>,
        material: u32,
    ) -> Self {
        let count = positions.len();
        let triangle = |vertices| MeshTriangle { vertices, material };
        Self {
            positions,
            tangents: normals.iter().copied().map(any_tangent).collect(),
            normals,
            uv0: vec![[0.0; 2]; count],
            uv1: vec![[0.0; 2]; count],
            colors: vec![[1.0; 4]; count],
            triangles: triangles.into_iter().map(triangle).collect(),
            ..Self::default()
        }
    }

    /// Corners of a triangle in object space.
    pub fn corners(&self, triangle: &MeshTriangle) -> [DVec3; 3] {
        triangle
            .vertices
            .map(|vertex| as_dvec3(self.positions[vertex as usize]))
    }
}
