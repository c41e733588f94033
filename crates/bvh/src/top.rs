//! The instance hierarchy: rebuilt each frame, relative to the head.

use glam::{DAffine3, DMat3, DVec3};

use crate::bounds::{Bounds32, PAD_UNITS, ROUNDING_UNIT};
use crate::mesh::MeshHierarchies;
use crate::records::{BvhNode, INSTANCE_MIRRORED, Instance};
use crate::tree::{self, Flat, Scratch, Shape, Split};
use crate::{BvhError, MAX_INDEX, TOP_STACK};

/// `traversal.wesl` pads the instance boxes by this many times the mesh boxes' share of the ray's origin.
pub const RAY_CONDITION: f64 = 4.0;
/// Transforms that lose more than a few digits in f32 are left out: |R| |R^-1| row sums beyond this.
const MAX_CONDITION: f64 = 1e5;

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
    instances: Vec<Instance>,
    bounds: Vec<Bounds32>,
    scratch: Scratch,
    skipped: u32,
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
        self.skipped = 0;
        let mut scene_radius = 0.0f64;
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
            self.skipped += u32::from(placed.is_none());
            let blank = Instance {
                blas_root: mesh.entry(),
                node: source.node,
                ..Instance::default()
            };
            self.instances
                .push(placed.map_or(blank, |(instance, _)| instance));
            self.bounds.push(bounds.unwrap_or(Bounds32::EMPTY));
            scene_radius =
                scene_radius.max(bounds.map_or(0.0, |bounds| f64::from(bounds.max_magnitude())));
            ill_conditioned |=
                placed.is_some_and(|(_, placement)| placement.condition > RAY_CONDITION);
        }
        if ill_conditioned {
            self.pad_ill_conditioned(origin_in_world, sources, scene_radius);
        }
        let shape = Shape {
            max_depth: TOP_STACK,
            leaf_size: 1,
            split: Split::BinnedSah,
            pad_units: 0.0,
        };
        tree::flatten_into(
            None,
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
        Ok(())
    }

    /// Rays' own padding assumes a moderate condition; sheared instances get the rest for origins within the scene.
    fn pad_ill_conditioned(
        &mut self,
        origin_in_world: DVec3,
        sources: &[InstanceSource],
        scene_radius: f64,
    ) {
        for (bounds, source) in self.bounds.iter_mut().zip(sources) {
            let Some((_, placement)) = place(origin_in_world, source, 0) else {
                continue;
            };
            let excess = placement.condition - RAY_CONDITION;
            if excess > 0.0 && !bounds.is_empty() {
                let pad = DVec3::splat(PAD_UNITS * ROUNDING_UNIT * excess * scene_radius);
                *bounds = Bounds32::rounded_outward(
                    bounds.min.as_dvec3() - pad,
                    bounds.max.as_dvec3() + pad,
                );
            }
        }
    }

    /// Nodes; never empty. Node 0 is the root, leaves name instances.
    pub fn nodes(&self) -> &[BvhNode] {
        &self.flat.nodes
    }

    /// One entry per source, in their order; empty for an empty scene.
    pub fn instances(&self) -> &[Instance] {
        &self.instances
    }

    /// Bounds of each instance in render space, rounded outward; empty boxes for those that rays cannot meet.
    pub fn bounds(&self) -> &[Bounds32] {
        &self.bounds
    }

    /// Inner nodes on the longest path; at most [`TOP_STACK`].
    pub fn depth(&self) -> u32 {
        self.flat.depth
    }

    /// Instances left out because their matrix has no usable inverse.
    pub fn skipped(&self) -> u32 {
        self.skipped
    }

    /// Proves that every visible instance lies in exactly one leaf, inside all boxes above it, within the depth limit.
    ///
    /// # Errors
    /// [`BvhError::Invalid`] with what is wrong.
    pub fn validate(&self) -> Result<(), BvhError> {
        let mut position = vec![u32::MAX; self.instances.len()];
        for (place, &instance) in self.flat.order.iter().enumerate() {
            position[instance as usize] = place as u32;
        }
        let renamed: Vec<BvhNode> = self
            .flat
            .nodes
            .iter()
            .map(|node| {
                let name = |index: u32, count: u32| {
                    if count > 0 {
                        position[index as usize]
                    } else {
                        index
                    }
                };
                BvhNode {
                    left_index: name(node.left_index, node.left_count),
                    right_index: name(node.right_index, node.right_count),
                    ..*node
                }
            })
            .collect();
        let visible = self
            .bounds
            .iter()
            .filter(|bounds| !bounds.is_empty())
            .count();
        tree::check(&renamed, 0, 0..visible as u32, TOP_STACK, |place| {
            self.bounds[self.flat.order[place as usize] as usize]
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
