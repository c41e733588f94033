//! Mesh hierarchies: one per mesh, in object space, built once.
//!
//! Topology comes from `obvhs`: PLOC (Meister and Bittner, "Parallel Locally-Ordered Clustering for Bounding Volume
//! Hierarchy Construction", 2018) followed by parallel reinsertion (the same authors, 2018) and leaf collapse by the
//! surface area heuristic. Boxes are computed here from the vertices themselves.

use std::collections::HashSet;

use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::ploc::{PlocSearchDistance, SortPrecision};
use rayon::prelude::*;

use crate::bounds::{Bounds32, PAD_UNITS};
use crate::records::{BvhNode, NO_EMITTER, Triangle};
use crate::tree::{self, Flat, Shape, Split, Tree, TreeNode};
use crate::{BvhError, MAX_COORDINATE, MAX_INDEX, MESH_STACK};

/// What the hierarchy notes about a material in its triangles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MaterialMarks {
    /// Its triangles are numbered as area lights.
    pub emits: bool,
    /// [`TRIANGLE_ALPHA`](crate::records::TRIANGLE_ALPHA).
    pub flags: u32,
}

/// A triangle of a mesh. Zero-area triangles are kept; rays never meet them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MeshTriangle {
    /// Indices into the vertex arrays.
    pub vertices: [u32; 3],
    /// Index into the scene's materials.
    pub material: u32,
}

/// A mesh to build a hierarchy over.
pub trait MeshSource: Sync {
    /// Its name, for messages.
    fn name(&self) -> &str;
    /// Its vertices in object space, metres.
    fn positions(&self) -> &[[f32; 3]];
    /// Its triangles.
    fn triangles(&self) -> &[MeshTriangle];
}

/// Meshes of so few triangles need no node: the instance's box has been met already. Cornell's walls gain 8 %; with 2 it is
/// 5 %, with 12 (its boxes too) 4 %.
const FEW_TRIANGLES: u32 = 4;

/// Nodes that a hierarchy over `triangles` can have: a binary tree has fewer inner nodes than leaves, and one at least.
pub fn node_room(triangles: usize) -> usize {
    triangles.max(1)
}

/// Where one mesh lies in the arrays of [`MeshHierarchies`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MeshRange {
    /// Its root node.
    pub root: u32,
    /// Its first triangle.
    pub first_triangle: u32,
    /// Its triangles.
    pub triangle_count: u32,
    /// Its first vertex, when the vertices of all meshes are concatenated in order.
    pub first_vertex: u32,
    /// Its emissive triangles.
    pub emitter_count: u32,
    /// Inner nodes on the longest path from its root.
    pub depth: u32,
    /// Its bounds in object space, without padding; `None` if it has no triangles.
    pub bounds: Option<Bounds32>,
    /// Whether its boxes lie where the host has them: it does not change its shape on the device.
    pub is_rigid: bool,
}

impl MeshRange {
    /// Where a ray begins in this mesh, as a stack entry of the traversal: its triangles, if they are few, else its root.
    pub fn entry(&self) -> u32 {
        if (1..=FEW_TRIANGLES).contains(&self.triangle_count) {
            self.first_triangle | self.triangle_count << MAX_INDEX.ilog2()
        } else {
            self.root
        }
    }
}

/// The hierarchies of all meshes in one set of arrays; all indices in them are global.
#[derive(Clone, Debug, Default)]
pub struct MeshHierarchies {
    /// Nodes.
    pub nodes: Vec<BvhNode>,
    /// Triangles in leaf order, mesh after mesh.
    pub triangles: Vec<Triangle>,
    /// For each triangle: its vertices in the concatenation of all meshes' vertex arrays, then its index in its mesh.
    pub triangle_vertices: Vec<[u32; 4]>,
    /// One entry per mesh.
    pub meshes: Vec<MeshRange>,
    /// Inner nodes on the longest path of any mesh; at most [`MESH_STACK`].
    pub max_depth: u32,
    /// Rises when nodes change.
    pub(crate) revision: u64,
}

impl MeshHierarchies {
    /// Of each of a mesh's triangles, by its own number, where it lies among all triangles, which are in the order of leaves.
    pub fn leaf_of_triangles(&self, mesh: usize) -> Vec<u32> {
        let range = &self.meshes[mesh];
        let mut leaf_of = vec![0; range.triangle_count as usize];
        for leaf in range.first_triangle..range.first_triangle + range.triangle_count {
            leaf_of[self.triangle_vertices[leaf as usize][3] as usize] = leaf;
        }
        leaf_of
    }

    /// Builds the hierarchies of `meshes` on all cores. `marks` holds one entry per material; a material beyond it
    /// has no marks.
    ///
    /// # Errors
    /// [`BvhError::Coordinate`], [`BvhError::VertexIndex`], [`BvhError::TooMany`].
    pub fn build(meshes: &[impl MeshSource], marks: &[MaterialMarks]) -> Result<Self, BvhError> {
        Self::build_with_room(meshes, marks, |_| false)
    }

    /// As [`MeshHierarchies::build`]; the meshes that `changes` names get room for every hierarchy that they can have,
    /// for [`MeshHierarchies::rebuild`].
    ///
    /// # Errors
    /// As [`MeshHierarchies::build`].
    pub fn build_with_room(
        meshes: &[impl MeshSource],
        marks: &[MaterialMarks],
        changes: impl Fn(usize) -> bool,
    ) -> Result<Self, BvhError> {
        let triangle_total: usize = meshes.iter().map(|mesh| mesh.triangles().len()).sum();
        let vertex_total: usize = meshes.iter().map(|mesh| mesh.positions().len()).sum();
        for (what, count) in [("triangles", triangle_total), ("vertices", vertex_total)] {
            // A quarter of the index space: two nodes per triangle at most, and one per empty mesh.
            if count + meshes.len() > (MAX_INDEX / 4) as usize {
                return Err(BvhError::TooMany {
                    what,
                    count,
                    limit: MAX_INDEX / 4,
                });
            }
        }
        let parts: Vec<Flat> = meshes
            .par_iter()
            .enumerate()
            .map(|(index, mesh)| build_one(index, mesh, careful(mesh.triangles().len())))
            .collect::<Result<_, _>>()?;

        let mut all = Self {
            triangles: Vec::with_capacity(triangle_total),
            triangle_vertices: Vec::with_capacity(triangle_total),
            nodes: Vec::with_capacity(parts.iter().map(|part| part.nodes.len()).sum()),
            ..Self::default()
        };
        let mut first_vertex = 0;
        for (index, (mesh, part)) in meshes.iter().zip(&parts).enumerate() {
            let room = if changes(index) {
                node_room(mesh.triangles().len())
            } else {
                0
            };
            all.append(mesh, part, marks, first_vertex, room);
            first_vertex += mesh.positions().len() as u32;
        }
        Ok(all)
    }

    pub(crate) fn append(
        &mut self,
        mesh: &impl MeshSource,
        part: &Flat,
        marks: &[MaterialMarks],
        first_vertex: u32,
        room: usize,
    ) {
        let root = self.nodes.len() as u32;
        let first_triangle = self.triangles.len() as u32;
        let nodes = part.nodes.iter();
        self.nodes
            .extend(nodes.map(|node| tree::shifted(node, root, first_triangle)));
        let end = self.nodes.len().max(root as usize + room);
        self.nodes.resize(end, BvhNode::default());
        for &index in &part.order {
            let triangle = &mesh.triangles()[index as usize];
            let [v0, v1, v2] = triangle
                .vertices
                .map(|vertex| mesh.positions()[vertex as usize]);
            let [a, b, c] = triangle.vertices.map(|vertex| vertex + first_vertex);
            self.triangles.push(Triangle {
                v0,
                v1,
                v2,
                ..Triangle::default()
            });
            self.triangle_vertices.push([a, b, c, index]);
        }
        self.meshes.push(MeshRange {
            root,
            first_triangle,
            triangle_count: part.order.len() as u32,
            first_vertex,
            emitter_count: 0,
            depth: part.depth,
            bounds: part.bounds,
            is_rigid: room == 0,
        });
        self.repaint(self.meshes.len() - 1, mesh, marks);
        self.revision += 1;
        self.max_depth = self.max_depth.max(part.depth);
    }

    /// Notes other materials or marks in a mesh's triangles; corners and boxes stay. Returns its range of triangles.
    pub fn repaint(
        &mut self,
        index: usize,
        mesh: &impl MeshSource,
        marks: &[MaterialMarks],
    ) -> std::ops::Range<usize> {
        let range = &mut self.meshes[index];
        let first = range.first_triangle as usize;
        let triangles = first..first + range.triangle_count as usize;
        let marks_of = |source: &MeshTriangle| {
            let marks = marks.get(source.material as usize);
            marks.copied().unwrap_or_default()
        };
        // Numbered in the mesh's order.
        range.emitter_count = 0;
        let numbers: Vec<u32> = mesh
            .triangles()
            .iter()
            .map(|source| match marks_of(source).emits {
                true => {
                    range.emitter_count += 1;
                    range.emitter_count - 1
                }
                false => NO_EMITTER,
            })
            .collect();
        for at in triangles.clone() {
            let source = self.triangle_vertices[at][3] as usize;
            let triangle = &mut self.triangles[at];
            triangle.material = mesh.triangles()[source].material;
            triangle.emitter = numbers[source];
            triangle.flags = marks_of(&mesh.triangles()[source]).flags;
        }
        triangles
    }

    /// Proves that every triangle lies in exactly one leaf of its mesh, inside all boxes above it, and that no path is
    /// deeper than the traversal's stack.
    ///
    /// # Errors
    /// [`BvhError::Invalid`] with the mesh and what is wrong.
    pub fn validate(&self) -> Result<(), BvhError> {
        for (index, mesh) in self.meshes.iter().enumerate() {
            let triangles = mesh.first_triangle..mesh.first_triangle + mesh.triangle_count;
            tree::check(
                &self.nodes,
                mesh.root,
                triangles,
                mesh.depth.min(MESH_STACK),
                |triangle| {
                    let triangle = &self.triangles[triangle as usize];
                    let corners = [triangle.v0, triangle.v1, triangle.v2].map(Vec3::from);
                    Some(Bounds32::of_points(corners))
                },
            )
            .map_err(|reason| BvhError::Invalid(format!("mesh {index}: {reason}")))?;
        }
        Ok(())
    }
}

pub(crate) fn build_one(
    index: usize,
    mesh: &impl MeshSource,
    build: BvhBuildParams,
) -> Result<Flat, BvhError> {
    let bad_vertex = mesh.positions().iter().position(|position| {
        // Written so that a NaN is refused too.
        !position.iter().all(|x| x.abs() <= MAX_COORDINATE)
    });
    if let Some(vertex) = bad_vertex {
        return Err(BvhError::Coordinate {
            mesh: index,
            name: mesh.name().to_owned(),
            vertex,
            position: mesh.positions()[vertex],
        });
    }
    let mut boxes = Vec::with_capacity(mesh.triangles().len());
    for (triangle_index, triangle) in mesh.triangles().iter().enumerate() {
        let mut bounds = Bounds32::EMPTY;
        for vertex in triangle.vertices {
            let position =
                mesh.positions()
                    .get(vertex as usize)
                    .ok_or_else(|| BvhError::VertexIndex {
                        mesh: index,
                        name: mesh.name().to_owned(),
                        triangle: triangle_index,
                        index: vertex,
                        count: mesh.positions().len(),
                    })?;
            bounds = bounds.union(&Bounds32::of_points([Vec3::from(*position)]));
        }
        boxes.push(bounds);
    }
    if is_uniform(&boxes) {
        let shape = Shape {
            split: Split::BinnedSah,
            ..MESH_SHAPE
        };
        return Ok(tree::flatten(None, &boxes, &shape));
    }
    let tree = quality_tree(&boxes, build);
    Ok(tree::flatten(Some(&tree), &boxes, &MESH_SHAPE))
}

/// Whether nearly all boxes have the same few sizes, as coincident triangles and regular strips do. Clustering takes
/// quadratic time over those, for it finds neighbours that are all equally near and merges one pair at a time: a quarter
/// of an hour for a million.
fn is_uniform(boxes: &[Bounds32]) -> bool {
    /// Few enough for quadratic time.
    const FEW: usize = 1024;
    /// Boxes per size. Mirror images of a symmetric mesh share theirs by eights.
    const SAME: usize = 64;
    if boxes.len() <= FEW {
        return false;
    }
    let most = boxes.len() / SAME;
    let mut sizes = HashSet::with_capacity(most + 1);
    boxes.iter().all(|bounds| {
        sizes.insert((bounds.max - bounds.min).to_array().map(f32::to_bits));
        sizes.len() <= most
    })
}

const MESH_SHAPE: Shape = Shape {
    max_depth: MESH_STACK,
    leaf_size: 4,
    split: Split::Median,
    pad_units: PAD_UNITS,
};

/// The best tree that `build` makes.
pub(crate) fn quality_tree(boxes: &[Bounds32], build: BvhBuildParams) -> Tree {
    if boxes.is_empty() {
        return Tree::default();
    }
    // Areas are products of two extents. Scaled to about 1 they neither overflow nor underflow, and a power of two
    // changes no comparison.
    let largest = boxes
        .iter()
        .map(Bounds32::max_magnitude)
        .fold(0.0f32, f32::max);
    let scale = if largest > 0.0 {
        (-largest.log2().ceil()).clamp(-100.0, 100.0).exp2()
    } else {
        1.0
    };
    let scaled: Vec<Aabb> = boxes
        .iter()
        .map(|bounds| {
            Aabb::new(
                Vec3A::from(bounds.min * scale),
                Vec3A::from(bounds.max * scale),
            )
        })
        .collect();
    let bvh = build_bvh2(&scaled, build, &mut std::time::Duration::default());
    Tree {
        nodes: bvh
            .nodes
            .iter()
            .map(|node| TreeNode {
                count: node.prim_count,
                first: node.first_index,
            })
            .collect(),
        order: bvh.primitive_indices,
    }
}

/// How meshes are built that are built once: in a small one every node may move to where it costs least, in a large one the
/// most expensive 15 % as in [`BUILD`], since 1.7 million triangles take 5 seconds more for 4 % fewer steps.
fn careful(triangles: usize) -> BvhBuildParams {
    /// Triangles up to which all nodes do.
    const FEW: f32 = 100_000.0;
    BvhBuildParams {
        reinsertion_batch_ratio: (FEW / triangles as f32).clamp(BUILD.reinsertion_batch_ratio, 1.0),
        ..BUILD
    }
}

/// How meshes are built anew while frames go on. No spatial splits: a triangle in two leaves would cost memory and could be met twice.
pub(crate) const BUILD: BvhBuildParams = BvhBuildParams {
    pre_split: false,
    ploc_search_distance: PlocSearchDistance::Medium,
    search_depth_threshold: 1,
    reinsertion_batch_ratio: 0.15,
    post_collapse_reinsertion_batch_ratio_multiplier: 1.0,
    sort_precision: SortPrecision::U64,
    max_prims_per_leaf: 4,
    collapse_traversal_cost: 1.0,
};
