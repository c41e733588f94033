//! Skins and morph targets on the device: their buffers and bounds.
//!
//! Every instance of a mesh that changes its shape has a copy of it. The host uploads joints' matrices and weights,
//! bounds the shape by its joints, and the device writes vertices, triangles and boxes. The tree over the triangles
//! stays until its cost has drifted by [`REBUILD_COST_RATIO`]; then the host builds it anew over its own f64 positions.

use std::borrow::Cow;
use std::ops::Range;

use glam::{DAffine3, DVec3};

use super::RenderError;
use crate::bvh::mesh::node_room;
use crate::bvh::parts::Grafted;
use crate::bvh::records::{BvhNode, Triangle};
use crate::bvh::{Bounds32, MaterialMarks, MeshHierarchies, MeshRange};
use crate::frame::ShapeCounts;
use crate::gpu::{FrameRecorder, GpuContext, Resources, storage_buffer, storage_buffer_with_data};
#[cfg(feature = "internals")]
use crate::gpu::{GpuError, PassTimes};
use crate::renderer::records::deform::{DeformMesh, RestVertex};
use crate::renderer::records::material::Vertex;
use crate::scene::{Bounds, Deformation, Mesh, Scene, ScenePose};

/// A hierarchy is built anew when a ray through its box costs this many times what it cost when it was built. Over the
/// clips of Khronos's Fox the ratio stays below 1.19 (docs/results.md), so that a walk rebuilds nothing; what goes
/// beyond is a shape that the tree was not built for.
pub const REBUILD_COST_RATIO: f64 = 1.5;
/// Frames in a new pose between two looks at the cost: it is read back from the device.
pub const COST_CHECK_FRAMES: u32 = 8;
/// No joints.
const NONE: u32 = u32::MAX;

/// `scene` with a mesh of its own for each instance that changes its shape.
pub fn with_own_meshes(scene: &Scene) -> Cow<'_, Scene> {
    let instances = scene.instances();
    let mut taken = vec![false; scene.meshes.len()];
    for placed in &instances {
        taken[placed.mesh] |= !scene.deforms(placed.node);
    }
    let mut own = Cow::Borrowed(scene);
    for placed in &instances {
        if scene.deforms(placed.node) && std::mem::replace(&mut taken[placed.mesh], true) {
            let scene = own.to_mut();
            scene.meshes.push(scene.meshes[placed.mesh].clone());
            scene.nodes[placed.node].mesh = Some(scene.meshes.len() - 1);
        }
    }
    own
}

/// One mesh that changes its shape.
struct Shape {
    node: usize,
    mesh: usize,
    record: DeformMesh,
    now: Deformation,
    /// Boxes of the vertices that each joint moves, mesh space; one of all vertices without a skin.
    joint_bounds: Vec<Option<Bounds>>,
    target_bounds: Vec<Bounds>,
    built_cost: f64,
    is_due: bool,
}

/// All meshes that change their shape.
pub struct Deformer {
    /// Nodes and skins, and the meshes that change.
    skeleton: Scene,
    pub(super) marks: Vec<MaterialMarks>,
    shapes: Vec<Shape>,
    joint_rows: Vec<[f32; 4]>,
    weights: Vec<f32>,
    vertex_count: u32,
    triangle_count: u32,
    levels: Vec<[u32; 2]>,
    buffers: Buffers,
    is_new: bool,
    was_new: bool,
    /// Frames in a new pose since the cost was read.
    unchecked: u32,
    rebuilds: u32,
}

struct Buffers {
    rest_vertices: wgpu::Buffer,
    meshes: wgpu::Buffer,
    deltas: wgpu::Buffer,
    weights: wgpu::Buffer,
    joint_rows: wgpu::Buffer,
    positions: wgpu::Buffer,
    previous_positions: wgpu::Buffer,
    triangles: wgpu::Buffer,
    nodes: wgpu::Buffer,
    costs: wgpu::Buffer,
}

/// A new placement and new bounds.
pub struct Reshaped {
    /// Scene node.
    pub node: usize,
    /// Index of its mesh.
    pub mesh: usize,
    /// Placement of the deformed space.
    pub world_from_object: DAffine3,
    /// Around the deformed vertices.
    pub bounds: Bounds32,
}

impl Deformer {
    /// For `scene`, whose deforming instances have meshes of their own ([`with_own_meshes`]); `None` if there are none.
    ///
    /// # Errors
    /// The adapter cannot bind a buffer.
    pub fn new(
        context: &GpuContext,
        scene: &Scene,
        hierarchies: &MeshHierarchies,
        marks: &[MaterialMarks],
    ) -> Result<Option<Self>, RenderError> {
        let mut skeleton = Scene {
            nodes: scene.nodes.clone(),
            roots: scene.roots.clone(),
            skins: scene.skins.clone(),
            meshes: vec![Mesh::default(); scene.meshes.len()],
            ..Scene::default()
        };
        let mut packed = Packed::default();
        let mut shapes = Vec::new();
        for placed in scene.instances() {
            if !scene.deforms(placed.node) {
                continue;
            }
            let mesh = &scene.meshes[placed.mesh];
            skeleton.meshes[placed.mesh] = mesh.clone();
            let joints = scene.nodes[placed.node]
                .skin
                .filter(|_| !mesh.joints.is_empty())
                .and_then(|skin| scene.skins.get(skin))
                .map(|skin| skin.joints.len());
            let first_vertex = hierarchies.meshes[placed.mesh].first_vertex;
            let record = packed.add(shapes.len() as u32, mesh, joints, first_vertex);
            shapes.push(Shape {
                node: placed.node,
                mesh: placed.mesh,
                record,
                now: Deformation::default(),
                joint_bounds: joint_bounds(mesh, joints),
                target_bounds: mesh
                    .targets
                    .iter()
                    .map(|target| bounds_of(target.positions.iter()).unwrap_or(NO_BOUNDS))
                    .collect(),
                built_cost: hierarchies.cost(placed.mesh),
                is_due: false,
            });
        }
        if shapes.is_empty() {
            return Ok(None);
        }
        let mut triangles = Vec::new();
        for shape in &shapes {
            let range = &hierarchies.meshes[shape.mesh];
            // Wraps: the shader adds it to a vertex number, which is not below the mesh's first.
            let shift = shape.record.first_vertex.wrapping_sub(range.first_vertex);
            let end = range.first_triangle + range.triangle_count;
            triangles.extend((range.first_triangle..end).map(|triangle| [triangle, shift]));
        }
        let records: Vec<DeformMesh> = shapes.iter().map(|shape| shape.record).collect();
        let vertex_count = packed.vertices.len() as u64;
        let node_count = hierarchies.nodes.len() as u64;
        let refitted: usize = shapes
            .iter()
            .map(|shape| hierarchies.meshes[shape.mesh].triangle_count as usize)
            .map(node_room)
            .sum();
        let data = |label, bytes| storage_buffer(context, label, bytes);
        let buffers = Buffers {
            rest_vertices: storage_buffer_with_data(context, "rest vertices", &packed.vertices)?,
            meshes: storage_buffer_with_data(context, "deforming meshes", &records)?,
            deltas: storage_buffer_with_data(context, "morph deltas", &packed.deltas)?,
            weights: data("morph weights", packed.weight_count as u64 * 4)?,
            joint_rows: data("joint matrices", packed.row_count as u64 * 16)?,
            positions: data("deformed positions", vertex_count * 16)?,
            previous_positions: data("previous positions", vertex_count * 16)?,
            triangles: storage_buffer_with_data(context, "deformed triangles", &triangles)?,
            nodes: data("refitted nodes", refitted as u64 * 4)?,
            costs: data("refitted costs", node_count * 8)?,
        };
        let mut deformer = Self {
            skeleton,
            marks: marks.to_vec(),
            shapes,
            joint_rows: vec![[0.0; 4]; packed.row_count],
            weights: vec![0.0; packed.weight_count],
            vertex_count: vertex_count as u32,
            triangle_count: triangles.len() as u32,
            levels: Vec::new(),
            buffers,
            is_new: false,
            was_new: false,
            unchecked: 0,
            rebuilds: 0,
        };
        deformer.write_levels(context, hierarchies);
        Ok(Some(deformer))
    }

    /// Takes a pose over; calls `reshaped` for each mesh whose shape or place it changes. Work in proportion to joints
    /// and targets.
    pub fn set_pose(&mut self, pose: &ScenePose, mut reshaped: impl FnMut(Reshaped)) {
        for shape in &mut self.shapes {
            let now = self.skeleton.deformation(shape.node, pose);
            if now == shape.now {
                continue;
            }
            let changes_shape = now.object_from_mesh != shape.now.object_from_mesh
                || now.weights != shape.now.weights;
            self.is_new |= changes_shape || shape.now == Deformation::default();
            shape.now = now;
            shape.write(&mut self.joint_rows, &mut self.weights);
            reshaped(Reshaped {
                node: shape.node,
                mesh: shape.mesh,
                world_from_object: shape.now.world_from_object,
                bounds: shape.bounds(),
            });
        }
    }

    /// Uploads the frame's pose, and builds anew the hierarchies that are due. Says which.
    ///
    /// # Errors
    /// Positions that no hierarchy can hold.
    pub fn begin_frame(
        &mut self,
        context: &GpuContext,
        hierarchies: &mut MeshHierarchies,
        bytes: &mut u64,
    ) -> Result<Vec<(usize, Grafted)>, RenderError> {
        let mut rebuilt = Vec::new();
        if !self.is_new {
            return Ok(rebuilt);
        }
        let rows: &[u8] = bytemuck::cast_slice(&self.joint_rows);
        let weights: &[u8] = bytemuck::cast_slice(&self.weights);
        for (buffer, data) in [
            (&self.buffers.joint_rows, rows),
            (&self.buffers.weights, weights),
        ] {
            if !data.is_empty() {
                context.queue.write_buffer(buffer, 0, data);
                *bytes += data.len() as u64;
            }
        }
        for shape in self.shapes.iter_mut().filter(|shape| shape.is_due) {
            shape.is_due = false;
            let mesh = &self.skeleton.meshes[shape.mesh];
            let positions = shape.now.positions(mesh);
            let now = Mesh {
                name: mesh.name.clone(),
                positions: positions
                    .iter()
                    .map(|position| position.as_vec3().to_array())
                    .collect(),
                triangles: mesh.triangles.clone(),
                ..Mesh::default()
            };
            let changed = hierarchies.rebuild(shape.mesh, &now, &self.marks)?;
            hierarchies.meshes[shape.mesh].bounds = Some(shape.bounds());
            shape.built_cost = hierarchies.cost(shape.mesh);
            rebuilt.push((shape.mesh, changed));
            self.rebuilds += 1;
        }
        if !rebuilt.is_empty() {
            self.write_levels(context, hierarchies);
        }
        Ok(rebuilt)
    }

    /// Lists the nodes of all meshes by height.
    fn write_levels(&mut self, context: &GpuContext, hierarchies: &MeshHierarchies) {
        let mut levels: Vec<Vec<u32>> = Vec::new();
        for shape in &self.shapes {
            for (height, nodes) in hierarchies.levels(shape.mesh).into_iter().enumerate() {
                if levels.len() <= height {
                    levels.resize(height + 1, Vec::new());
                }
                levels[height].extend(nodes);
            }
        }
        let all: Vec<u32> = levels.iter().flatten().copied().collect();
        let mut first = 0;
        self.levels = levels
            .iter()
            .map(|level| {
                let begins = first;
                first += level.len() as u32;
                [begins, level.len() as u32]
            })
            .collect();
        context
            .queue
            .write_buffer(&self.buffers.nodes, 0, bytemuck::cast_slice(&all));
    }

    /// The bytes of the scene's arrays, by name, among which lies all that the passes write or a rebuilt hierarchy changes.
    pub fn changed_bytes(&self, hierarchies: &MeshHierarchies) -> [(&'static str, Range<u64>); 4] {
        let around = |size: usize, of: &dyn Fn(&Shape, &MeshRange) -> (u32, usize)| {
            let ranges = self.shapes.iter().map(|shape| {
                let (first, count) = of(shape, &hierarchies.meshes[shape.mesh]);
                first as usize..first as usize + count
            });
            let all = ranges.reduce(|a, b| a.start.min(b.start)..a.end.max(b.end));
            let all = all.unwrap_or_default();
            (all.start * size) as u64..(all.end * size) as u64
        };
        let triangles = |_: &Shape, range: &MeshRange| {
            let count = range.triangle_count as usize;
            (range.first_triangle, count)
        };
        [
            (
                "mesh_nodes",
                around(size_of::<BvhNode>(), &|_, range| {
                    (range.root, node_room(range.triangle_count as usize))
                }),
            ),
            ("triangles", around(size_of::<Triangle>(), &triangles)),
            ("triangle_vertices", around(16, &triangles)),
            (
                "vertices",
                around(size_of::<Vertex>(), &|shape, range| {
                    (range.first_vertex, shape.record.vertex_count as usize)
                }),
            ),
        ]
    }

    /// The mesh of a node's own that shows its shape.
    pub fn mesh_of(&self, node: usize) -> Option<usize> {
        let shape = self.shapes.iter().find(|shape| shape.node == node)?;
        Some(shape.mesh)
    }

    /// The triangles of a mesh as the last pose has them, by number, in its deformed space; `None` for one that keeps its
    /// shape. Work in proportion to its vertices.
    pub fn triangles_now(&self, mesh: usize) -> Option<Vec<[DVec3; 3]>> {
        let shape = self.shapes.iter().find(|shape| shape.mesh == mesh)?;
        let mesh = &self.skeleton.meshes[mesh];
        let positions = shape.now.positions(mesh);
        let corners = |vertex: u32| positions[vertex as usize];
        let triangles = mesh.triangles.iter();
        Some(triangles.map(|t| t.vertices.map(corners)).collect())
    }

    /// The same for those that are asked for one by one.
    pub fn corners_now(&self, mesh: usize) -> Option<impl Fn(usize) -> [DVec3; 3]> {
        let shape = self.shapes.iter().find(|shape| shape.mesh == mesh)?;
        let mesh = &self.skeleton.meshes[mesh];
        Some(|triangle: usize| {
            let vertices = mesh.triangles[triangle].vertices;
            vertices.map(|vertex| shape.now.position(mesh, vertex as usize))
        })
    }

    /// The next pose counts as a new one for all meshes.
    pub fn forget_pose(&mut self) {
        for shape in &mut self.shapes {
            shape.now = Deformation::default();
        }
    }

    /// Where the previous frame's positions of a mesh begin.
    pub fn first_position(&self, mesh: usize) -> Option<u32> {
        let shape = self.shapes.iter().find(|shape| shape.mesh == mesh)?;
        Some(shape.record.first_vertex)
    }

    /// What shaders may ask for.
    pub fn resources<'a>(&'a self, resources: Resources<'a>) -> Resources<'a> {
        let buffers = &self.buffers;
        resources
            .with("previous_positions", &buffers.previous_positions)
            .with("rest_vertices", &buffers.rest_vertices)
            .with("deform_meshes", &buffers.meshes)
            .with("morph_deltas", &buffers.deltas)
            .with("morph_weights", &buffers.weights)
            .with("joint_rows", &buffers.joint_rows)
            .with("deformed_positions", &buffers.positions)
            .with("deformed_triangles", &buffers.triangles)
            .with("refit_nodes", &buffers.nodes)
            .with("refit_costs", &buffers.costs)
    }

    /// What the passes run over.
    pub fn counts(&self) -> ShapeCounts {
        ShapeCounts {
            vertices: self.vertex_count,
            triangles: self.triangle_count,
            levels: self.levels.clone(),
        }
    }

    /// Whether this frame has anything to record. `keeps_previous`: someone asks for the previous frame's positions.
    pub fn has_work(&self, keeps_previous: bool) -> bool {
        self.is_new || (self.was_new && keeps_previous)
    }

    /// Whether the frame has another pose than the one before.
    pub fn has_new_pose(&self) -> bool {
        self.is_new
    }

    /// The frame's pose is to be taken in the next one.
    pub fn pose_again(&mut self) {
        self.is_new = !self.shapes.is_empty();
    }

    /// The device has taken the frame's pose over. True if that changed shapes.
    pub fn note_posed(&mut self) -> bool {
        self.unchecked += u32::from(self.is_new);
        self.was_new = std::mem::take(&mut self.is_new);
        self.was_new
    }

    /// Asks what the refitted hierarchies cost, once in [`COST_CHECK_FRAMES`] frames in a new pose. Returns what they cost
    /// when they were built.
    pub fn ask_costs(
        &self,
        recorder: &mut FrameRecorder<'_>,
        hierarchies: &MeshHierarchies,
    ) -> Option<Vec<f64>> {
        if self.unchecked < COST_CHECK_FRAMES {
            return None;
        }
        recorder.read(&self.root_costs(hierarchies));
        Some(self.shapes.iter().map(|shape| shape.built_cost).collect())
    }

    /// The frame's last submission has gone, with what [`Deformer::ask_costs`] asked.
    pub fn note_asked(&mut self) {
        self.unchecked %= COST_CHECK_FRAMES;
    }

    /// Hierarchies that cost too much by `ratios`, what a ray through each mesh's box costs over what it cost when its
    /// hierarchy was built, are built anew with the next pose.
    pub fn note_costs(&mut self, ratios: &[f64]) {
        for (shape, ratio) in self.shapes.iter_mut().zip(ratios) {
            // NaN, from shapes without area, is none.
            shape.is_due = *ratio > REBUILD_COST_RATIO;
        }
    }

    /// Where the costs of the meshes' roots lie.
    fn root_costs(&self, hierarchies: &MeshHierarchies) -> Vec<(&wgpu::Buffer, u64, u64)> {
        let root = |shape: &Shape| u64::from(hierarchies.meshes[shape.mesh].root);
        let costs = &self.buffers.costs;
        let shapes = self.shapes.iter();
        shapes.map(|shape| (costs, root(shape) * 8, 8)).collect()
    }

    /// For each mesh what a ray through its box costs over what it cost when its hierarchy was built. Waits for the device.
    ///
    /// # Errors
    /// [`GpuError::Lost`] or [`GpuError::Validation`].
    #[cfg(feature = "internals")]
    pub fn cost_ratios(
        &self,
        context: &GpuContext,
        hierarchies: &MeshHierarchies,
    ) -> Result<Vec<f64>, GpuError> {
        let mut recorder = FrameRecorder::new(context, None, "refitted costs");
        recorder.read(&self.root_costs(hierarchies));
        let ticket = recorder.send("refitted costs")?;
        let values = ticket.arrive(context, &mut PassTimes::default())?;
        let built = self.shapes.iter().map(|shape| shape.built_cost);
        Ok(ratios(&values.concat(), built))
    }

    /// Hierarchies built anew so far.
    pub fn rebuilds(&self) -> u32 {
        self.rebuilds
    }

    /// Deformation of a node's mesh, as the last pose has it.
    pub fn deformation(&self, node: usize) -> Option<&Deformation> {
        let shape = self.shapes.iter().find(|shape| shape.node == node)?;
        Some(&shape.now)
    }
}

/// Costs of roots, as the device wrote them (a sum and an area each), over those when the hierarchies were `built`.
pub(super) fn ratios(costs: &[u8], built: impl IntoIterator<Item = f64>) -> Vec<f64> {
    let costs: Vec<[f32; 2]> = bytemuck::pod_collect_to_vec(costs);
    let ratio = |([sum, area], built): ([f32; 2], f64)| f64::from(sum) / f64::from(area) / built;
    costs.into_iter().zip(built).map(ratio).collect()
}

const NO_BOUNDS: Bounds = Bounds {
    min: DVec3::ZERO,
    max: DVec3::ZERO,
};

fn bounds_of<'a>(points: impl Iterator<Item = &'a [f32; 3]>) -> Option<Bounds> {
    Bounds::of_points(points.map(|point| DVec3::from_array(point.map(f64::from))))
}

fn joint_bounds(mesh: &Mesh, joints: Option<usize>) -> Vec<Option<Bounds>> {
    let Some(count) = joints else {
        return vec![bounds_of(mesh.positions.iter())];
    };
    let mut bounds: Vec<Option<Bounds>> = vec![None; count];
    for (position, influences) in mesh.positions.iter().zip(&mesh.joints) {
        let point = DVec3::from_array(position.map(f64::from));
        for (joint, weight) in influences.joints.iter().zip(influences.weights) {
            if weight > 0.0
                && let Some(around) = bounds.get_mut(usize::from(*joint))
            {
                let corners = around.iter().flat_map(|around| [around.min, around.max]);
                *around = Bounds::of_points(corners.chain([point]));
            }
        }
    }
    bounds
}

impl Shape {
    /// Matrices and weights in f32, where the shader reads them.
    fn write(&self, rows: &mut [[f32; 4]], weights: &mut [f32]) {
        if self.record.first_joint != NONE {
            let slots = rows[self.record.first_joint as usize..].chunks_exact_mut(3);
            for (slot, matrix) in slots.zip(&self.now.object_from_mesh) {
                slot.copy_from_slice(&crate::bvh::rows(matrix));
            }
        }
        let first = self.record.first_weight as usize;
        let last = first + self.record.target_count as usize;
        for (slot, weight) in weights[first..last].iter_mut().zip(&self.now.weights) {
            *slot = *weight as f32;
        }
    }

    /// A box around the shape without looking at its vertices: each lies among its joints' images of itself, because
    /// weights are shares, and its image by a joint lies in the image of that joint's box.
    fn bounds(&self) -> Bounds32 {
        let (mut low, mut high) = (DVec3::ZERO, DVec3::ZERO);
        for (weight, bounds) in self.now.weights.iter().zip(&self.target_bounds) {
            let (a, b) = (*weight * bounds.min, *weight * bounds.max);
            low += a.min(b);
            high += a.max(b);
        }
        let none = [DAffine3::IDENTITY];
        let matrices = if self.record.first_joint == NONE {
            &none[..]
        } else {
            &self.now.object_from_mesh[..]
        };
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let mut reach = 0.0f64;
        for (matrix, bounds) in matrices.iter().zip(&self.joint_bounds) {
            let Some(bounds) = bounds else { continue };
            let (from, to) = (bounds.min + low, bounds.max + high);
            let center = matrix.transform_point3(0.5 * (from + to));
            let linear = [0, 1, 2].map(|row| matrix.matrix3.row(row).abs());
            let spread = |v: DVec3| DVec3::from_array(linear.map(|row| row.dot(v)));
            let half = spread(0.5 * (to - from));
            min = min.min(center - half);
            max = max.max(center + half);
            let largest = spread(from.abs().max(to.abs())) + matrix.translation.abs();
            reach = reach.max(largest.max_element());
        }
        // A NaN fails too.
        if !(min.cmple(max).all() && reach.is_finite()) {
            return Bounds32::EMPTY;
        }
        // Some twenty roundings of terms up to `reach`, rounded weights and matrices included.
        let pad = DVec3::splat(32.0 * crate::bvh::bounds::ROUNDING_UNIT * reach);
        Bounds32::rounded_outward(min - pad, max + pad)
    }
}

#[derive(Default)]
struct Packed {
    vertices: Vec<RestVertex>,
    deltas: Vec<[f32; 4]>,
    row_count: usize,
    weight_count: usize,
}

impl Packed {
    fn add(
        &mut self,
        index: u32,
        mesh: &Mesh,
        joints: Option<usize>,
        first_vertex: u32,
    ) -> DeformMesh {
        let record = DeformMesh {
            first_joint: if joints.is_some() {
                self.row_count as u32
            } else {
                NONE
            },
            first_weight: self.weight_count as u32,
            target_count: mesh.targets.len() as u32,
            first_delta: self.deltas.len() as u32,
            first_vertex: self.vertices.len() as u32,
            vertex_count: mesh.positions.len() as u32,
            ..DeformMesh::default()
        };
        self.row_count += 3 * joints.unwrap_or(0);
        self.weight_count += mesh.targets.len();
        for target in &mesh.targets {
            for (position, normal) in target.positions.iter().zip(&target.normals) {
                self.deltas
                    .extend([position, normal].map(|[x, y, z]| [*x, *y, *z, 0.0]));
            }
        }
        let is_flat = |vertex: usize| {
            mesh.flat
                .iter()
                .any(|range| range.contains(&(vertex as u32)))
        };
        for (vertex, position) in mesh.positions.iter().enumerate() {
            let influences = mesh.joints.get(vertex).copied().unwrap_or_default();
            let normal = mesh.normals.get(vertex).copied().unwrap_or_default();
            self.vertices.push(RestVertex {
                position: *position,
                mesh: index,
                normal: if is_flat(vertex) { [0.0; 3] } else { normal },
                vertex: first_vertex + vertex as u32,
                tangent: mesh
                    .tangents
                    .get(vertex)
                    .copied()
                    .unwrap_or([1.0, 0.0, 0.0, 1.0]),
                joints: influences.joints.map(u32::from),
                weights: influences.weights,
            });
        }
        record
    }
}
