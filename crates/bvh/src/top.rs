//! The instance hierarchy: rebuilt each frame, relative to the head.
//!
//! Where meshes overlap, rays would enter one after the other at its root. So the largest of them are opened: leaves name parts
//! of them, subtrees in boxes of their own (Benthin, Woop, Wald and Áfra 2017, "Improved two-level BVHs using partial
//! re-braiding", there while the tree is built). What is opened, and the tree over all, is kept while it serves.

use std::collections::{BTreeSet, BinaryHeap};

use glam::{DAffine3, DMat3, DVec3};
use obvhs::BvhBuildParams;

use crate::bounds::{Bounds32, PAD_UNITS, ROUNDING_UNIT};
use crate::mesh::{self, MeshHierarchies};
use crate::records::{BvhNode, INSTANCE_MIRRORED, INSTANCE_NUMBER_SHIFT, Instance};
use crate::refit::sah_cost;
use crate::tree::{self, Flat, Scratch, Shape, Split, Tree};
use crate::{BvhError, MAX_INDEX, TOP_STACK};

/// `traversal.wesl` pads the instance boxes by this many times the mesh boxes' share of the ray's origin.
pub const RAY_CONDITION: f64 = 4.0;
/// Transforms that lose more than a few digits in f32 are left out: |R| |R^-1| row sums beyond this.
const MAX_CONDITION: f64 = 1e5;

/// Instances over which a tree is chosen with care; over more, a quick one is built in every frame.
const MOST_CHOSEN: usize = 1024;
/// How it is chosen: every node of so few may move to where it costs least.
const BUILD: BvhBuildParams = BvhBuildParams {
    reinsertion_batch_ratio: 1.0,
    max_prims_per_leaf: 1,
    ..mesh::BUILD
};
/// How far a kept tree's cost may rise, by what has moved since, before another is chosen.
const MOST_COST: f64 = 1.2;
/// Nodes that are opened at most. By 16, 64 and 256, paths in the gallery (56 instances) take 6, 8 and 8 % fewer steps, in the
/// FlightHelmet (6 instances) 13, 15 and 17 %.
pub const MOST_OPENED: usize = 64;

/// A placed mesh, as the scene knows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InstanceSource {
    /// Metres.
    pub world_from_object: DAffine3,
    /// Index of the mesh.
    pub mesh: u32,
    /// Index of the scene node that places it.
    pub node: u32,
    /// Where its emissive triangles begin in the table of lights.
    pub first_emitter: u32,
}

/// The instance hierarchy of one frame. Keep it between frames: it reuses its memory.
#[derive(Clone, Debug, Default)]
pub struct TopLevel {
    flat: Flat,
    /// One per source, then one per part.
    instances: Vec<Instance>,
    bounds: Vec<Bounds32>,
    sources: usize,
    /// Largest coordinate of an instance's box.
    scene_radius: f64,
    scratch: Scratch,
    chosen: Option<Chosen>,
}

/// A part of an opened instance.
#[derive(Clone, Copy, Debug)]
struct Part {
    instance: u32,
    /// Where rays begin in it, as [`MeshRange::entry`](mesh::MeshRange::entry) of a whole mesh.
    entry: u32,
    /// Object space.
    bounds: Bounds32,
}

/// What is kept between frames.
#[derive(Clone, Debug)]
struct Chosen {
    revision: u64,
    /// Mesh of every source, and whether rays can meet it.
    meshes: Vec<(u32, bool)>,
    parts: Vec<Part>,
    tree: Tree,
    /// By [`sah_cost`].
    cost: f64,
}

impl TopLevel {
    /// Builds the hierarchy with the render space's origin at `origin_in_world`.
    ///
    /// # Errors
    /// As [`TopLevel::rebuild`].
    pub fn build(
        origin_in_world: DVec3,
        sources: &[InstanceSource],
        meshes: &MeshHierarchies,
    ) -> Result<Self, BvhError> {
        let mut top = Self::default();
        top.rebuild(origin_in_world, sources, meshes)?;
        Ok(top)
    }

    /// Builds it anew: time in proportion to n log n instances, whatever the number of triangles.
    ///
    /// Instances whose matrix has no usable inverse (scaled to nothing, say, to hide them) keep their place in
    /// [`TopLevel::instances`], but no ray meets them.
    ///
    /// # Errors
    /// [`BvhError::MeshIndex`], [`BvhError::TooMany`].
    pub fn rebuild(
        &mut self,
        origin_in_world: DVec3,
        sources: &[InstanceSource],
        meshes: &MeshHierarchies,
    ) -> Result<(), BvhError> {
        // A balanced tree over one leaf per instance must fit the stack.
        let limit = 1 << TOP_STACK.min(MAX_INDEX.ilog2());
        if sources.len() > limit as usize {
            return Err(BvhError::TooMany {
                what: "instances",
                count: sources.len(),
                limit,
            });
        }
        self.instances.clear();
        self.bounds.clear();
        self.sources = sources.len();
        self.scene_radius = 0.0;
        let mut ill_conditioned = false;
        for (index, source) in sources.iter().enumerate() {
            let mesh = meshes
                .meshes
                .get(source.mesh as usize)
                .ok_or(BvhError::MeshIndex {
                    instance: index,
                    mesh: source.mesh,
                    count: meshes.meshes.len(),
                })?;
            let placed = place(origin_in_world, source, mesh.entry());
            let bounds = placed
                .zip(mesh.bounds)
                .map(|((_, placement), bounds)| placement.bounds(&bounds));
            let blank = Instance {
                blas_root: mesh.entry(),
                node: source.node,
                ..Instance::default()
            };
            let mut record = placed.map_or(blank, |(instance, _)| instance);
            record.flags |= (index as u32) << INSTANCE_NUMBER_SHIFT;
            self.instances.push(record);
            self.bounds.push(bounds.unwrap_or(Bounds32::EMPTY));
            let reach = bounds.map_or(0.0, |bounds| f64::from(bounds.max_magnitude()));
            self.scene_radius = self.scene_radius.max(reach);
            ill_conditioned |=
                placed.is_some_and(|(_, placement)| placement.condition > RAY_CONDITION);
        }
        if ill_conditioned {
            for (bounds, source) in self.bounds.iter_mut().zip(sources) {
                if let Some((_, placement)) = place(origin_in_world, source, 0) {
                    *bounds = placement.widened(*bounds, self.scene_radius);
                }
            }
        }
        self.keep_or_choose(origin_in_world, sources, meshes);
        Ok(())
    }

    /// Builds the tree: the kept one while it serves.
    fn keep_or_choose(
        &mut self,
        origin_in_world: DVec3,
        sources: &[InstanceSource],
        meshes: &MeshHierarchies,
    ) {
        let kept = self.chosen.take();
        if sources.len() > MOST_CHOSEN {
            self.flatten(None);
            return;
        }
        let visible = self.bounds.iter().map(|bounds| !bounds.is_empty());
        let identity: Vec<_> = sources
            .iter()
            .map(|source| source.mesh)
            .zip(visible)
            .collect();
        let serves = |kept: &Chosen| kept.revision == meshes.revision && kept.meshes == identity;
        if let Some(kept) = kept.filter(serves) {
            self.place_parts(origin_in_world, sources, &kept.parts);
            self.flatten(Some(&kept.tree));
            if sah_cost(&self.flat.nodes, 0) <= MOST_COST * kept.cost {
                self.chosen = Some(kept);
                return;
            }
        }
        let (parts, leaves) = self.open(origin_in_world, sources, meshes);
        self.place_parts(origin_in_world, sources, &parts);
        let boxes: Vec<_> = leaves
            .iter()
            .map(|&leaf| self.bounds[leaf as usize])
            .collect();
        let mut tree = mesh::quality_tree(&boxes, BUILD);
        for leaf in &mut tree.order {
            *leaf = leaves[*leaf as usize];
        }
        self.flatten(Some(&tree));
        self.chosen = Some(Chosen {
            revision: meshes.revision,
            meshes: identity,
            parts,
            tree,
            cost: sah_cost(&self.flat.nodes, 0),
        });
    }

    /// Which nodes of which meshes to open: the largest that share their box with another instance, one after the other.
    /// Returns the parts and what the tree's leaves are, as indices of records.
    fn open(
        &self,
        origin_in_world: DVec3,
        sources: &[InstanceSource],
        meshes: &MeshHierarchies,
    ) -> (Vec<Part>, Vec<u32>) {
        /// A node that may be opened; the largest first.
        #[derive(PartialEq, Eq, PartialOrd, Ord)]
        struct Candidate {
            /// Bits of its area, in the order of the areas.
            area: u64,
            /// Which part it is, if not a whole mesh.
            part: Option<usize>,
            instance: u32,
            node: u32,
        }
        let whole = &self.bounds[..sources.len()];
        let is_shared = |own: &Bounds32, instance: u32| {
            let others = (0..).zip(whole);
            let mut others = others.filter(|(other, _)| *other != instance);
            others.any(|(_, other)| other.overlaps(own))
        };
        let mut is_leaf: Vec<bool> = whole.iter().map(|bounds| !bounds.is_empty()).collect();
        let mut candidates = BinaryHeap::new();
        for (instance, (source, bounds)) in (0..).zip(sources.iter().zip(whole)) {
            let mesh = &meshes.meshes[source.mesh as usize];
            if mesh.is_rigid && mesh.entry() == mesh.root && is_shared(bounds, instance) {
                candidates.push(Candidate {
                    area: bounds.half_area().to_bits(),
                    part: None,
                    instance,
                    node: mesh.root,
                });
            }
        }
        let mut parts = Vec::new();
        for _ in 0..MOST_OPENED {
            let Some(opened) = candidates.pop() else {
                break;
            };
            let source = &sources[opened.instance as usize];
            let Some((_, placement)) = place(origin_in_world, source, 0) else {
                continue;
            };
            is_leaf[opened.instance as usize] = false;
            // The first of the two takes the place of what is opened.
            let mut free = opened.part;
            let children = tree::children(&meshes.nodes[opened.node as usize]);
            for (bounds, index, count) in children.into_iter().filter(|child| !child.0.is_empty()) {
                let part = Part {
                    instance: opened.instance,
                    entry: index | count << MAX_INDEX.ilog2(),
                    bounds,
                };
                let at = free.take().unwrap_or(parts.len());
                if at < parts.len() {
                    parts[at] = part;
                } else {
                    parts.push(part);
                }
                let bounds = placement.bounds(&bounds);
                if count == 0 && is_shared(&bounds, opened.instance) {
                    candidates.push(Candidate {
                        area: bounds.half_area().to_bits(),
                        part: Some(at),
                        instance: opened.instance,
                        node: index,
                    });
                }
            }
        }
        let whole = (0..)
            .zip(is_leaf)
            .filter_map(|(leaf, is_leaf)| is_leaf.then_some(leaf));
        let leaves = whole.chain(sources.len() as u32..(sources.len() + parts.len()) as u32);
        (parts, leaves.collect())
    }

    /// Adds the parts' records and boxes behind the instances' own.
    fn place_parts(&mut self, origin_in_world: DVec3, sources: &[InstanceSource], parts: &[Part]) {
        self.instances.truncate(sources.len());
        self.bounds.truncate(sources.len());
        for part in parts {
            let instance = part.instance as usize;
            let placed = place(origin_in_world, &sources[instance], part.entry);
            let bounds = placed.map_or(Bounds32::EMPTY, |(_, placement)| {
                placement.widened(placement.bounds(&part.bounds), self.scene_radius)
            });
            self.bounds.push(bounds);
            self.instances.push(Instance {
                blas_root: part.entry,
                ..self.instances[instance]
            });
        }
    }

    /// Makes nodes of a tree over records, or of none: then all are leaves.
    fn flatten(&mut self, tree: Option<&Tree>) {
        let shape = Shape {
            max_depth: TOP_STACK,
            leaf_size: 1,
            split: Split::BinnedSah,
            pad_units: 0.0,
        };
        tree::flatten_into(
            tree,
            &self.bounds,
            &shape,
            &mut self.scratch,
            &mut self.flat,
        );
        // One instance per leaf, so leaves can name instances themselves and need no order array.
        for node in &mut self.flat.nodes {
            if node.left_count > 0 {
                node.left_index = self.flat.order[node.left_index as usize];
            }
            if node.right_count > 0 {
                node.right_index = self.flat.order[node.right_index as usize];
            }
        }
    }

    /// Nodes; never empty. Node 0 is the root, leaves name instances.
    pub fn nodes(&self) -> &[BvhNode] {
        &self.flat.nodes
    }

    /// One entry per source, in their order, then one for every part that leaves name; empty for an empty scene.
    pub fn instances(&self) -> &[Instance] {
        &self.instances
    }

    /// Bounds of each instance in render space, rounded outward; empty boxes for those that rays cannot meet.
    pub fn bounds(&self) -> &[Bounds32] {
        &self.bounds[..self.sources]
    }

    /// Inner nodes on the longest path; at most [`TOP_STACK`].
    pub fn depth(&self) -> u32 {
        self.flat.depth
    }

    /// Proves that every visible instance lies in exactly one leaf, or each of its parts does, inside all boxes above them and
    /// within the depth limit.
    ///
    /// # Errors
    /// [`BvhError::Invalid`] with what is wrong.
    pub fn validate(&self) -> Result<(), BvhError> {
        let opened: BTreeSet<u32> = self.instances[self.sources..]
            .iter()
            .map(|part| part.flags >> INSTANCE_NUMBER_SHIFT)
            .collect();
        let records = self.instances.len() as u32;
        tree::check(&self.flat.nodes, 0, 0..records, TOP_STACK, |record| {
            let bounds = self.bounds[record as usize];
            let is_part = record as usize >= self.sources;
            (is_part || !(bounds.is_empty() || opened.contains(&record))).then_some(bounds)
        })
        .map_err(|reason| BvhError::Invalid(format!("instance hierarchy: {reason}")))
    }
}

/// What the bounds need to know of a transform.
#[derive(Clone, Copy)]
struct Placement {
    render_from_object: DAffine3,
    /// Largest row sum of |R| |R^-1|: how much larger an object-space rounding error is when seen from render space.
    condition: f64,
}

impl Placement {
    /// Box around the transformed box, with room for the errors of f32 matrices and transformed rays.
    fn bounds(&self, object: &Bounds32) -> Bounds32 {
        let linear = self.render_from_object.matrix3;
        let padded = object.padded(PAD_UNITS);
        let (min, max) = (padded.min.as_dvec3(), padded.max.as_dvec3());
        let center = self.render_from_object.transform_point3(0.5 * (min + max));
        let half = absolute(&linear) * (0.5 * (max - min));
        // The traversal takes a ray to object space with up to 5 units of |R^-1| (|origin| + |translation|) of error
        // and a direction off by 4 units over the distance; back in render space both grow by the condition number.
        let reach = (center.abs() + half).max_element();
        let translation = self.render_from_object.translation.abs().max_element();
        let pad =
            PAD_UNITS * ROUNDING_UNIT * self.condition.max(RAY_CONDITION) * (reach + translation);
        let half = half + DVec3::splat(pad);
        Bounds32::rounded_outward(center - half, center + half)
    }

    /// Rays' own padding assumes a moderate condition; in sheared instances boxes get the rest, for origins within the scene.
    fn widened(&self, bounds: Bounds32, scene_radius: f64) -> Bounds32 {
        let excess = self.condition - RAY_CONDITION;
        if excess <= 0.0 || bounds.is_empty() {
            return bounds;
        }
        let pad = DVec3::splat(PAD_UNITS * ROUNDING_UNIT * excess * scene_radius);
        Bounds32::rounded_outward(bounds.min.as_dvec3() - pad, bounds.max.as_dvec3() + pad)
    }
}

fn absolute(matrix: &DMat3) -> DMat3 {
    DMat3::from_cols(
        matrix.x_axis.abs(),
        matrix.y_axis.abs(),
        matrix.z_axis.abs(),
    )
}

/// The inverse of a placement and its [`Placement::condition`]; `None` if it has none that is of use.
pub(crate) fn inverse(outer_from_object: &DAffine3) -> Option<(DAffine3, f64)> {
    let determinant = outer_from_object.matrix3.determinant();
    if !(determinant.is_finite() && determinant != 0.0) {
        return None;
    }
    let object_from_outer = outer_from_object.inverse();
    let product = absolute(&outer_from_object.matrix3) * absolute(&object_from_outer.matrix3);
    let condition = (product * DVec3::ONE).max_element();
    // A NaN fails.
    (condition <= MAX_CONDITION).then_some((object_from_outer, condition))
}

fn place(
    origin_in_world: DVec3,
    source: &InstanceSource,
    root: u32,
) -> Option<(Instance, Placement)> {
    let render_from_object = DAffine3 {
        matrix3: source.world_from_object.matrix3,
        translation: source.world_from_object.translation - origin_in_world,
    };
    let (object_from_render, condition) = inverse(&render_from_object)?;
    let forward = rows(&render_from_object);
    let backward = rows(&object_from_render);
    let usable = forward
        .iter()
        .chain(&backward)
        .flatten()
        .all(|x| x.abs() < 1e15);
    // A NaN fails too.
    if !usable {
        return None;
    }
    let determinant = render_from_object.matrix3.determinant();
    let instance = Instance {
        render_from_object_0: forward[0],
        render_from_object_1: forward[1],
        render_from_object_2: forward[2],
        object_from_render_0: backward[0],
        object_from_render_1: backward[1],
        object_from_render_2: backward[2],
        blas_root: root,
        first_emitter: source.first_emitter,
        flags: if determinant < 0.0 {
            INSTANCE_MIRRORED
        } else {
            0
        },
        node: source.node,
    };
    Some((
        instance,
        Placement {
            render_from_object,
            condition,
        },
    ))
}

/// The rows of a 3x4 matrix in f32.
#[must_use]
pub fn rows(transform: &DAffine3) -> [[f32; 4]; 3] {
    let linear = transform.matrix3.transpose();
    [
        (linear.x_axis, transform.translation.x),
        (linear.y_axis, transform.translation.y),
        (linear.z_axis, transform.translation.z),
    ]
    .map(|(row, offset)| [row.x as f32, row.y as f32, row.z as f32, offset as f32])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{MeshSource, MeshTriangle};

    struct Bare(Vec<[f32; 3]>, Vec<MeshTriangle>);

    impl MeshSource for Bare {
        fn name(&self) -> &'static str {
            "bare"
        }

        fn positions(&self) -> &[[f32; 3]] {
            &self.0
        }

        fn triangles(&self) -> &[MeshTriangle] {
            &self.1
        }
    }

    #[test]
    fn a_lost_part_is_noticed() {
        let corner = |i: u16| [f32::from(i % 3 % 2), f32::from(i % 3 / 2), f32::from(i / 3)];
        let triangle = |i: u32| MeshTriangle {
            vertices: [3 * i, 3 * i + 1, 3 * i + 2],
            material: 0,
        };
        let strip = Bare(
            (0..30).map(corner).collect(),
            (0..10).map(triangle).collect(),
        );
        let meshes = MeshHierarchies::build(&[strip], &[]).unwrap();
        let source = InstanceSource {
            world_from_object: DAffine3::IDENTITY,
            mesh: 0,
            node: 0,
            first_emitter: 0,
        };
        let mut top = TopLevel::build(DVec3::ZERO, &[source; 2], &meshes).unwrap();
        top.validate().unwrap();
        assert!(top.instances.len() > top.sources, "both overlap");
        for part in &mut top.instances[top.sources..] {
            part.flags = 1 << INSTANCE_NUMBER_SHIFT;
        }
        top.validate().unwrap_err();
    }
}
