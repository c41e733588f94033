//! The two-level hierarchy that rays are traced through.
//!
//! - [`records`]: nodes, triangles and instances as they lie in memory;
//! - [`mesh`]: one hierarchy per mesh in its object space, built once with SAH quality;
//! - [`top`]: a hierarchy over the placed meshes, rebuilt each frame relative to the head;
//! - [`refit`]: hierarchies of meshes that change their shape;
//! - [`parts`]: meshes that come and go;
//! - [`cast`]: rays on the host;
//! - [`tree`]: turns any binary tree, or none, into our nodes within a bounded depth.
//!
//! Neither scene nor device is known here: a mesh is what implements [`MeshSource`].
//!
//! The GPU's part is `shaders/shared/traversal.wesl`. It keeps one fixed stack; [`MESH_STACK`] and [`TOP_STACK`] are
//! its two shares. A traversal pushes at most one entry per inner node on its path, so a hierarchy whose depth (inner
//! nodes on the longest path from its root) is within its share cannot overflow it. The builders guarantee that.

pub mod bounds;
pub mod cast;
pub mod mesh;
pub mod parts;
pub mod records;
pub mod refit;
pub mod top;
pub mod tree;

use thiserror::Error;

pub use bounds::Bounds32;
pub use mesh::{MaterialMarks, MeshHierarchies, MeshRange, MeshSource, MeshTriangle};
pub use top::{InstanceSource, TopLevel, rows};

/// Stack entries for one mesh hierarchy.
pub const MESH_STACK: u32 = 48;
/// Stack entries for the instance hierarchy.
pub const TOP_STACK: u32 = 24;
/// Primitives that one leaf may hold: a stack entry keeps the count in its upper four bits.
pub const MAX_LEAF: u32 = 15;
/// Nodes, triangles or instances that an index can tell apart: the lower 28 bits of a stack entry.
pub const MAX_INDEX: u32 = 1 << 28;
/// Largest vertex coordinate in metres. Products of three of them stay within f32.
pub const MAX_COORDINATE: f32 = 1e12;

/// Why no hierarchy could be built.
#[derive(Debug, Error, PartialEq)]
pub enum BvhError {
    /// A coordinate is not finite, or so large that products overflow.
    #[error(
        "mesh {mesh} ({name:?}), vertex {vertex}: position {position:?} is not finite or beyond 1e12; correct the mesh or scale it down"
    )]
    Coordinate {
        /// Index of the mesh.
        mesh: usize,
        /// Name of the mesh.
        name: String,
        /// Index of the vertex in its mesh.
        vertex: usize,
        /// What it holds.
        position: [f32; 3],
    },
    /// A triangle names a vertex that is not there.
    #[error(
        "mesh {mesh} ({name:?}), triangle {triangle}: vertex index {index} is out of range ({count} vertices)"
    )]
    VertexIndex {
        /// Index of the mesh.
        mesh: usize,
        /// Name of the mesh.
        name: String,
        /// Index of the triangle in its mesh.
        triangle: usize,
        /// The index it names.
        index: u32,
        /// Vertices that there are.
        count: usize,
    },
    /// An instance names a mesh that is not there.
    #[error("instance {instance}: mesh index {mesh} is out of range ({count} meshes)")]
    MeshIndex {
        /// Index of the instance.
        instance: usize,
        /// The index it names.
        mesh: u32,
        /// Meshes that there are.
        count: usize,
    },
    /// More primitives than a stack entry can number.
    #[error("{count} {what} are too many: at most {limit} fit; split or simplify the scene")]
    TooMany {
        /// `triangles`, `vertices` or `instances`.
        what: &'static str,
        /// How many there are.
        count: usize,
        /// How many fit.
        limit: u32,
    },
    /// A hierarchy failed its own check.
    #[error("hierarchy check failed: {0}")]
    Invalid(String),
}
