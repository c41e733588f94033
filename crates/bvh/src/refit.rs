//! Meshes that change their shape: the order in which boxes are refitted, what a hierarchy costs, and building one anew.

use crate::mesh::{self, MaterialMarks, MeshHierarchies, MeshSource, node_room};
use crate::parts::Grafted;
use crate::records::BvhNode;
use crate::tree::{self, children};
use crate::{Bounds32, BvhError, MESH_STACK};

impl MeshHierarchies {
    /// Nodes of a mesh by height above the leaves, the lowest first: refitted in this order, children come before
    /// their parents. At most [`MESH_STACK`] levels.
    pub fn levels(&self, mesh: usize) -> Vec<Vec<u32>> {
        let Some(range) = self.meshes.get(mesh) else {
            return Vec::new();
        };
        let mut order = Vec::new();
        let mut pending = vec![range.root];
        while let Some(node) = pending.pop() {
            order.push(node);
            pending.extend(inner_children(&self.nodes[node as usize]));
        }
        let mut heights = std::collections::HashMap::new();
        let mut levels: Vec<Vec<u32>> = Vec::new();
        // Parents come before their children in `order`.
        for node in order.into_iter().rev() {
            let height = inner_children(&self.nodes[node as usize])
                .filter_map(|child| heights.get(&child))
                .max()
                .map_or(0, |below: &usize| below + 1);
            heights.insert(node, height);
            if levels.len() <= height {
                levels.resize(height + 1, Vec::new());
            }
            levels[height].push(node);
        }
        for level in &mut levels {
            level.sort_unstable();
        }
        levels
    }

    /// The surface area heuristic's cost of a mesh's hierarchy, as if rays met its box: see [`sah_cost`].
    pub fn cost(&self, mesh: usize) -> f64 {
        self.meshes
            .get(mesh)
            .map_or(0.0, |range| sah_cost(&self.nodes, range.root))
    }

    /// Builds the hierarchy of one mesh anew over `shape`, which has its triangles and other positions. It was built
    /// with room for that; all other meshes stay where they are.
    ///
    /// # Errors
    /// As [`MeshHierarchies::build`]; [`BvhError::MeshIndex`] and [`BvhError::Invalid`] if `shape` is another mesh.
    pub fn rebuild(
        &mut self,
        mesh: usize,
        shape: &impl MeshSource,
        marks: &[MaterialMarks],
    ) -> Result<Grafted, BvhError> {
        let range = *self.meshes.get(mesh).ok_or(BvhError::MeshIndex {
            instance: 0,
            mesh: mesh as u32,
            count: self.meshes.len(),
        })?;
        let part = mesh::build_one(mesh, shape, mesh::BUILD)?;
        let mut alone = Self::default();
        alone.append(shape, &part, marks, range.first_vertex, 0);
        let first_triangle = range.first_triangle as usize;
        let triangles = first_triangle..first_triangle + alone.triangles.len();
        let root = range.root as usize;
        let nodes = root..root + alone.nodes.len();
        let fits = alone.triangles.len() == range.triangle_count as usize
            && alone.nodes.len() <= node_room(alone.triangles.len())
            && nodes.end <= self.nodes.len();
        if !fits {
            return Err(BvhError::Invalid(format!(
                "mesh {mesh} has other triangles than the one that is to replace it"
            )));
        }
        for (to, node) in self.nodes[nodes.clone()].iter_mut().zip(&alone.nodes) {
            *to = tree::shifted(node, range.root, range.first_triangle);
        }
        self.triangles[triangles.clone()].copy_from_slice(&alone.triangles);
        self.triangle_vertices[triangles.clone()].copy_from_slice(&alone.triangle_vertices);
        self.meshes[mesh].depth = part.depth;
        self.meshes[mesh].bounds = part.bounds;
        self.revision += 1;
        self.max_depth = self.max_depth.max(part.depth);
        debug_assert!(self.max_depth <= MESH_STACK);
        Ok(Grafted { nodes, triangles })
    }
}

fn inner_children(node: &BvhNode) -> impl Iterator<Item = u32> + use<> {
    children(node)
        .into_iter()
        .filter(|(bounds, _, count)| *count == 0 && !bounds.is_empty())
        .map(|(_, index, _)| index)
}

/// Expected cost of a ray that meets the box of `root`: the areas of all boxes below it, leaves times their triangles,
/// over its own area, with a step and a triangle test at 1 each (Wald 2007, "On fast construction of SAH-based bounding
/// volume hierarchies", eq. 1, summed over the tree).
pub fn sah_cost(nodes: &[BvhNode], root: u32) -> f64 {
    let (mut sum, mut own) = (0.0, 0.0);
    let mut pending = vec![root];
    while let Some(index) = pending.pop() {
        let Some(node) = nodes.get(index as usize) else {
            continue;
        };
        let mut around = Bounds32::EMPTY;
        for (bounds, child, count) in children(node) {
            if bounds.is_empty() {
                continue;
            }
            around = around.union(&bounds);
            sum += bounds.half_area() * f64::from(count.max(1));
            if count == 0 {
                pending.push(child);
            }
        }
        if index == root {
            own = around.half_area();
        }
    }
    if own > 0.0 { sum / own } else { 0.0 }
}
