//! The scene on the device: what never changes is uploaded once, what depends on the head or moves when it does.

use std::ops::Range;

use glam::{DAffine3, DVec3};

mod edits;
mod parts;

use super::RenderError;
use super::deform::{Deformer, with_own_meshes};
use super::instance_table::{InstanceId, InstanceTable};
use crate::bvh::cast::{InstanceHit, Ray};

use crate::bvh::parts::Grafted;
use crate::bvh::{InstanceSource, MaterialMarks, MeshHierarchies, TopLevel};
use crate::gpu::texels::TexelCopy;
use crate::gpu::{
    ArrayBuffer, FrameRecorder, GpuContext, GpuError, GrowingBuffer, Resources, ShaderFeatures,
    storage_buffer, storage_buffer_with_data,
};
use crate::renderer::packing::{
    LightKinds, LightSources, PackedEnvironment, PackedLights, PackedTextures, SceneBox,
    pack_environment, pack_lights, pack_textures, pack_vertices,
};
use crate::renderer::records::material::Material;
use crate::scene::{Instance, Scene, ScenePose};

pub(super) use edits::{Edited, SceneChange};
pub use parts::{PartPreparation, PreparedPart};

/// The scene's buffers.
pub struct SceneBuffers {
    table: InstanceTable,
    /// Slot of each scene node's instance, or `u32::MAX`.
    slot_of_node: Vec<u32>,
    /// A light of a node has moved since the last frame.
    node_lights_moved: bool,
    lights_moved: bool,
    /// Any instance has left the place that it had in the scene.
    has_moved: bool,
    /// A texture has another picture since the last frame.
    has_repainted_image: bool,
    last_upload_bytes: u64,
    hierarchies: MeshHierarchies,
    deformer: Option<Deformer>,
    top: TopLevel,
    packed_lights: PackedLights,
    mesh_nodes: ArrayBuffer,
    triangles: ArrayBuffer,
    triangle_vertices: ArrayBuffer,
    vertices: ArrayBuffer,
    places: parts::Taken,
    materials: GrowingBuffer,
    packed_materials: Vec<Material>,
    /// Without texels.
    packed_textures: PackedTextures,
    textures: Option<(ArrayBuffer, ArrayBuffer)>,
    environment: Option<(wgpu::Buffer, wgpu::Buffer)>,
    top_nodes: GrowingBuffer,
    instances: GrowingBuffer,
    previous_instances: GrowingBuffer,
    lights: GrowingBuffer,
    light_alias: GrowingBuffer,
    texels: Option<[TexelCopy; COPIED.len()]>,
}

/// Arrays that the feature `record_texels` copies into textures, by the names that the shaders give the copies.
const COPIED: [(&str, &str); 10] = [
    ("top_nodes", "top_node_texels"),
    ("mesh_nodes", "mesh_node_texels"),
    ("instances", "instance_texels"),
    ("triangles", "triangle_texels"),
    ("triangle_vertices", "corner_texels"),
    ("vertices", "vertex_texels"),
    ("materials", "material_texels"),
    ("lights", "light_texels"),
    ("light_alias", "light_alias_texels"),
    ("environment_map", "environment_map_texels"),
];
/// Those of them that follow the head and what moves.
const PLACED: [&str; 4] = ["top_nodes", "instances", "lights", "light_alias"];
/// All of an array.
const WHOLE: Range<u64> = 0..u64::MAX;

/// Texels of the surroundings, and the tables that they are sampled by.
fn environment_buffers(
    context: &GpuContext,
    packed: &PackedEnvironment,
) -> Result<(wgpu::Buffer, wgpu::Buffer), GpuError> {
    Ok((
        storage_buffer_with_data(context, "environment map", &packed.texels)?,
        storage_buffer_with_data(context, "environment cdf", &packed.cdf)?,
    ))
}

/// What places an instance, its first emissive triangle the light of that number.
fn source_of(instance: &Instance, first_emitter: u32) -> InstanceSource {
    InstanceSource {
        world_from_object: instance.world_from_object,
        mesh: instance.mesh as u32,
        node: instance.node as u32,
        first_emitter,
    }
}

/// [`SceneBuffers::slot_of_node`] of instances in the order of their slots.
fn slots_of_nodes(instances: &[Instance], node_count: usize) -> Vec<u32> {
    let mut slots = vec![u32::MAX; node_count];
    for (slot, instance) in (0..).zip(instances) {
        slots[instance.node] = slot;
    }
    slots
}

impl SceneBuffers {
    /// Packs and uploads `scene`. What no feature asks for is not allocated.
    ///
    /// # Errors
    /// Scenes too large for the adapter, or with geometry that no hierarchy can hold.
    pub fn new(
        context: &GpuContext,
        scene: &Scene,
        features: &ShaderFeatures,
    ) -> Result<Self, RenderError> {
        let own = with_own_meshes(scene);
        let scene = own.as_ref();
        let marks: Vec<MaterialMarks> = scene.materials.iter().map(MaterialMarks::from).collect();
        let mut changes = vec![false; scene.meshes.len()];
        for placed in scene.instances() {
            changes[placed.mesh] |= scene.deforms(placed.node);
        }
        let hierarchies =
            MeshHierarchies::build_with_room(&scene.meshes, &marks, |mesh| changes[mesh])?;
        let deformer = Deformer::new(context, scene, &hierarchies, &marks)?;
        let mut packed_textures = if features.textures {
            pack_textures(scene, context.max_binding_bytes, features.mips)?
        } else {
            Default::default()
        };
        let packed_vertices = pack_vertices(scene);
        let environment = scene
            .environment
            .as_ref()
            .filter(|_| features.environment)
            .and_then(pack_environment);
        let meshes = 0..hierarchies.meshes.len();
        let leaf_of_triangle: Vec<_> = meshes
            .map(|mesh| hierarchies.leaf_of_triangles(mesh))
            .collect();
        let packed_lights = pack_lights(
            &LightSources {
                scene,
                environment: environment.as_ref(),
                leaf_of_triangle: &leaf_of_triangle,
                kinds: LightKinds {
                    emitters: features.emitters,
                    points: features.points,
                    spots: features.spots,
                    directionals: features.directionals,
                    environment: environment.is_some(),
                },
            },
            DVec3::ZERO,
        );
        let placed = scene.instances();
        let emitters = packed_lights.first_emitter.iter();
        let sources = placed.iter().zip(emitters);
        let sources = sources.map(|(instance, first)| source_of(instance, *first));
        let sources = sources.collect();
        let textures = if features.textures {
            Some((
                ArrayBuffer::with_data(context, "texture infos", &packed_textures.infos)?,
                ArrayBuffer::with_data(context, "texels", &packed_textures.texels)?,
            ))
        } else {
            None
        };
        let places = parts::Taken::of(&hierarchies, &packed_vertices, &packed_textures);
        packed_textures.texels = Vec::new();
        let environment = match &environment {
            Some(packed) => Some(environment_buffers(context, packed)?),
            // The map is black, or the feature is forced in without one: the shaders read no texel of it, but bind them.
            None if features.environment => Some((
                storage_buffer(context, "environment map", 16)?,
                storage_buffer(context, "environment cdf", 16)?,
            )),
            None => None,
        };
        let mut buffers = Self {
            mesh_nodes: ArrayBuffer::with_data(context, "mesh nodes", &hierarchies.nodes)?,
            triangles: ArrayBuffer::with_data(context, "triangles", &hierarchies.triangles)?,
            triangle_vertices: ArrayBuffer::with_data(
                context,
                "triangle vertices",
                &hierarchies.triangle_vertices,
            )?,
            vertices: ArrayBuffer::with_data(context, "vertices", &packed_vertices)?,
            places,
            materials: GrowingBuffer::new("materials"),
            packed_materials: Vec::new(),
            packed_textures,
            textures,
            environment,
            top_nodes: GrowingBuffer::new("top nodes"),
            instances: GrowingBuffer::new("instances"),
            previous_instances: GrowingBuffer::new("previous instances"),
            lights: GrowingBuffer::new("lights"),
            light_alias: GrowingBuffer::new("light alias"),
            texels: features
                .record_texels
                .then(|| COPIED.map(|(_, name)| TexelCopy::new(name))),
            table: InstanceTable::new(sources),
            slot_of_node: slots_of_nodes(&placed, scene.nodes.len()),
            node_lights_moved: false,
            lights_moved: false,
            has_moved: false,
            has_repainted_image: false,
            last_upload_bytes: 0,
            hierarchies,
            deformer,
            top: TopLevel::default(),
            packed_lights,
        };
        buffers.write_materials(context, scene)?;
        buffers.set_pose(&scene.rest_pose());
        buffers.node_lights_moved = false;
        buffers.copy_to_texels(context, |name| (!PLACED.contains(&name)).then_some(WHOLE))?;
        Ok(buffers)
    }

    /// Brings the copies of the arrays that `chosen` gives bytes of up to date with their buffers; to be called whenever
    /// one changes. True if textures were replaced.
    fn copy_to_texels(
        &mut self,
        context: &GpuContext,
        chosen: impl Fn(&str) -> Option<Range<u64>>,
    ) -> Result<bool, RenderError> {
        let Some(mut copies) = self.texels.take() else {
            return Ok(false);
        };
        let mut encoder = context.encoder("record texels");
        let mut replaced = Ok(false);
        for ((name, _), copy) in COPIED.into_iter().zip(&mut copies) {
            if let Some((buffer, bytes)) = self.buffer(name).zip(chosen(name)) {
                replaced = replaced.and_then(|any| {
                    Ok(any | copy.copy_from(context, &mut encoder, buffer, bytes)?)
                });
            }
        }
        context.submit(encoder.finish());
        // Also where one did not fit.
        self.texels = Some(copies);
        replaced
    }

    fn buffer(&self, name: &str) -> Option<&wgpu::Buffer> {
        match name {
            "top_nodes" => self.top_nodes.buffer(),
            "mesh_nodes" => Some(self.mesh_nodes.buffer()),
            "instances" => self.instances.buffer(),
            "triangles" => Some(self.triangles.buffer()),
            "triangle_vertices" => Some(self.triangle_vertices.buffer()),
            "vertices" => Some(self.vertices.buffer()),
            "materials" => self.materials.buffer(),
            "lights" => self.lights.buffer(),
            "light_alias" => self.light_alias.buffer(),
            "environment_map" => self.environment.as_ref().map(|(map, _)| map),
            _ => None,
        }
    }

    /// Takes a pose over: the instances and lights of nodes go where it has them. The next frame shows it.
    pub fn set_pose(&mut self, pose: &ScenePose) {
        let mut reshaped = Vec::new();
        if let Some(deformer) = &mut self.deformer {
            deformer.set_pose(pose, |shape| reshaped.push(shape));
        }
        self.has_moved |= !reshaped.is_empty();
        for shape in reshaped {
            self.hierarchies.meshes[shape.mesh].bounds = Some(shape.bounds);
            self.table.note_mesh(shape.mesh as u32);
            let deformer = self.deformer.as_ref();
            if let Some(corners) = deformer.and_then(|deformer| deformer.corners_now(shape.mesh)) {
                self.packed_lights.reshape_mesh(shape.mesh, corners);
            }
            if let Some(id) = self.instance_of_node(shape.node) {
                let place = shape.world_from_object;
                if !self.place_instance(id, place) {
                    // Lights lie elsewhere where only the shape has changed, too.
                    self.packed_lights.place_instance(id.0, &place);
                }
            }
        }
        for (node, world_from_node) in pose.world_from_node.iter().enumerate() {
            let is_deformed = || {
                let deformer = self.deformer.as_ref();
                deformer.is_some_and(|deformer| deformer.deformation(node).is_some())
            };
            if let Some(id) = self.instance_of_node(node).filter(|_| !is_deformed()) {
                self.place_instance(id, *world_from_node);
            }
        }
        self.node_lights_moved |= self
            .packed_lights
            .move_nodes(|node| pose.world_from_node.get(node).copied());
    }

    /// The scene node that places an instance; `None` for one that no node places, or if there is none of that number.
    pub fn node_of_instance(&self, id: InstanceId) -> Option<usize> {
        self.table.placement(id)?;
        let node = self.table.sources().get(id.0 as usize)?.node;
        (node != u32::MAX).then_some(node as usize)
    }

    /// The instance that a scene node places.
    pub fn instance_of_node(&self, node: usize) -> Option<InstanceId> {
        let slot = self.slot_of_node.get(node).copied();
        slot.filter(|slot| *slot != u32::MAX).map(InstanceId)
    }

    /// The scene node that the frame begun last placed an instance by; `None` for one that was added without.
    pub fn shown_node(&self, slot: u32) -> Option<u32> {
        let shown = self.top.instances().get(slot as usize)?;
        (shown.node != u32::MAX).then_some(shown.node)
    }

    /// Moves an instance; false if there is none of that number, or it stands there already.
    pub fn place_instance(&mut self, id: InstanceId, world_from_object: DAffine3) -> bool {
        let moved = self.table.place(id, world_from_object);
        if moved {
            self.has_moved = true;
            self.packed_lights.place_instance(id.0, &world_from_object);
        }
        moved
    }

    /// Adds an instance of a mesh of [`Scene::meshes`].
    ///
    /// # Errors
    /// No such mesh.
    pub fn add_instance(
        &mut self,
        mesh: usize,
        world_from_object: DAffine3,
    ) -> Result<InstanceId, RenderError> {
        let count = self.hierarchies.meshes.len();
        if mesh >= count {
            return Err(RenderError::Settings(format!(
                "no instance of mesh {mesh} can be added: the scene has {count} meshes"
            )));
        }
        self.has_moved = true;
        let id = self.table.add(InstanceSource {
            world_from_object,
            mesh: mesh as u32,
            node: u32::MAX,
            first_emitter: u32::MAX,
        });
        let first = self
            .packed_lights
            .add_instance(id.0, mesh, &world_from_object);
        self.table.set_first_emitter(id, first);
        Ok(id)
    }

    /// Takes an instance out; false if there is none of that number.
    pub fn remove_instance(&mut self, id: InstanceId) -> bool {
        let removed = self.table.remove(id);
        if removed {
            self.packed_lights.remove_instance(id.0);
            if let Some(slot) = self.slot_of_node.iter_mut().find(|slot| **slot == id.0) {
                *slot = u32::MAX;
            }
        }
        removed
    }

    /// What a ray meets first of the instances where they stand by now, those of the nodes `past` left aside.
    pub(super) fn cast_ray(&self, ray: &Ray, past: &[Range<usize>]) -> Option<InstanceHit> {
        let admits = |source: &InstanceSource| {
            let node = source.node as usize;
            !past.iter().any(|nodes| nodes.contains(&node))
        };
        let shape = |mesh| self.deformer.as_ref()?.triangles_now(mesh);
        let sources = self.table.sources();
        self.hierarchies.cast_at(sources, ray, admits, shape)
    }

    /// Where an instance stands; `None` if there is none of that number.
    pub fn placement(&self, id: InstanceId) -> Option<DAffine3> {
        self.table.placement(id)
    }

    /// Begins a frame with the origin of render space at `origin_in_world`. If that or any instance has moved, rebuilds
    /// the instance hierarchy and uploads it with the lights that changed: work in proportion to instances, whatever
    /// the number of triangles. True if buffers were replaced, so that they must be bound again.
    ///
    /// # Errors
    /// More instances than the hierarchy numbers, or than the adapter binds.
    pub fn begin_frame(
        &mut self,
        context: &GpuContext,
        origin_in_world: DVec3,
    ) -> Result<bool, RenderError> {
        let mut uploads = Uploads {
            context,
            bytes: 0,
            replaced: false,
        };
        uploads.replaced = self.begin_shapes(context, &mut uploads.bytes)?;
        let deformer = self.deformer.as_ref();
        let begun = self
            .table
            .begin_frame(origin_in_world, &self.hierarchies.meshes, |mesh| {
                deformer?.first_position(mesh)
            });
        self.lights_moved = std::mem::take(&mut self.node_lights_moved);
        if begun.previous_is_new {
            uploads.all(&mut self.previous_instances, self.table.previous())?;
        }
        let is_new = begun.is_new || self.lights_moved;
        if is_new {
            self.top
                .rebuild(origin_in_world, self.table.sources(), &self.hierarchies)?;
            self.widen_infinite_lights(origin_in_world);
            self.packed_lights.set_origin(origin_in_world);
            let changed = self.packed_lights.finish();
            uploads.all(&mut self.top_nodes, self.top.nodes())?;
            uploads.all(&mut self.instances, self.top.instances())?;
            let words = self.packed_lights.words();
            for range in self.packed_lights.changed_words(&changed) {
                uploads.range(&mut self.lights, words, range)?;
            }
            if changed.alias || self.light_alias.buffer().is_none() {
                uploads.all(&mut self.light_alias, &self.packed_lights.alias)?;
            }
        }
        let replaced = uploads.replaced;
        self.last_upload_bytes = uploads.bytes;
        let replaced_texels = is_new
            && self.copy_to_texels(context, |name| PLACED.contains(&name).then_some(WHOLE))?;
        Ok(replaced || replaced_texels)
    }

    /// Uploads the pose of what changes its shape, and the hierarchies that are built anew for it: true if there are such.
    fn begin_shapes(&mut self, context: &GpuContext, bytes: &mut u64) -> Result<bool, RenderError> {
        let Some(deformer) = &mut self.deformer else {
            return Ok(false);
        };
        let rebuilt_meshes = deformer.begin_frame(context, &mut self.hierarchies, bytes)?;
        let any = !rebuilt_meshes.is_empty();
        for (mesh, rebuilt) in rebuilt_meshes {
            let written = self.write_trees(context, &rebuilt);
            let sizes = written.map(|(_, range)| range.end - range.start);
            *bytes += sizes.iter().sum::<u64>();
            let leaf_of = self.hierarchies.leaf_of_triangles(mesh);
            self.packed_lights
                .reorder_mesh(mesh, |triangle| leaf_of[triangle]);
        }
        Ok(any)
    }

    /// Uploads the part of the hierarchies that lies there: names of arrays, and which of their bytes were written.
    fn write_trees(
        &self,
        context: &GpuContext,
        place: &Grafted,
    ) -> [(&'static str, Range<u64>); 3] {
        let Grafted { nodes, triangles } = place;
        let (trees, triangles) = (&self.hierarchies, || triangles.clone());
        let nodes = self.mesh_nodes.write(context, &trees.nodes, nodes.clone());
        let records = self.triangles.write(context, &trees.triangles, triangles());
        let corners = &self.triangle_vertices;
        let corners = corners.write(context, &trees.triangle_vertices, triangles());
        [
            ("mesh_nodes", nodes),
            ("triangles", records),
            ("triangle_vertices", corners),
        ]
    }

    /// Meshes that change their shape.
    pub fn deformer(&self) -> Option<&Deformer> {
        self.deformer.as_ref()
    }

    /// Whether the frame that has begun has shapes to take to another pose, and whether that pose is a new one.
    pub(super) fn pose_due(&self) -> Option<bool> {
        let keeps_previous = self.table.keeps_previous();
        let deformer = self.deformer.as_ref()?;
        let has_work = deformer.has_work(keeps_previous);
        has_work.then(|| deformer.has_new_pose())
    }

    /// The meshes that change their shape, if there are any.
    pub(super) fn deformer_mut(&mut self) -> Option<&mut Deformer> {
        self.deformer.as_mut()
    }

    /// Shapes have been taken to the frame's pose on the device.
    ///
    /// # Errors
    /// [`RenderError::Gpu`].
    pub(super) fn note_posed(&mut self, context: &GpuContext) -> Result<(), RenderError> {
        let Some(deformer) = &mut self.deformer else {
            return Ok(());
        };
        if deformer.note_posed() {
            // Never replaced: shapes keep their numbers of triangles and vertices.
            let shaped = deformer.changed_bytes(&self.hierarchies);
            self.copy_to_texels(context, |name| {
                let found = shaped.iter().find(|(changed, _)| *changed == name)?;
                Some(found.1.clone())
            })?;
        }
        Ok(())
    }

    /// Whether shaders may ask where points were in the frame before.
    pub(super) fn keeps_previous(&self) -> bool {
        self.table.keeps_previous()
    }

    /// As [`Deformer::ask_costs`].
    pub(super) fn ask_costs(&self, recorder: &mut FrameRecorder<'_>) -> Option<Vec<f64>> {
        let deformer = self.deformer.as_ref()?;
        deformer.ask_costs(recorder, &self.hierarchies)
    }

    /// Light from infinitely far comes in through a box around the scene; an instance may have left it.
    fn widen_infinite_lights(&mut self, origin_in_world: DVec3) {
        if !self.packed_lights.has_infinite_lights() {
            return;
        }
        // Function of this frame alone, so that frames can be rendered in any order.
        let packed = self.packed_lights.packed_box();
        if !self.has_moved {
            // Nor what had moved before an edit.
            self.packed_lights.set_box(packed);
            return;
        }
        let center = packed.center - origin_in_world;
        let corners = (center - packed.half_size, center + packed.half_size);
        let (mut min, mut max) = corners;
        for bounds in self.top.bounds().iter().filter(|bounds| !bounds.is_empty()) {
            min = min.min(bounds.min.as_dvec3());
            max = max.max(bounds.max.as_dvec3());
        }
        let wider = SceneBox {
            center: origin_in_world + 0.5 * (min + max),
            half_size: 0.5 * (max - min),
        };
        let is_inside = (min, max) == corners;
        let scene_box = if is_inside { packed } else { wider };
        self.packed_lights.set_box(scene_box);
    }

    /// Whether shaders may ask where points were in the frame before (`previous_instances`, `previous_positions`), from
    /// the next frame on. They may until something else is said; where nobody asks, a frame is prepared with less.
    pub fn keep_previous(&mut self, keeps: bool) {
        self.table.keep_previous(keeps);
    }

    /// Forgets the frames so far: the next one has no previous one.
    pub fn forget_previous(&mut self) {
        self.table.forget();
    }

    /// Whether anything of the scene, the head aside, differs between the frame begun last and the one before.
    pub fn scene_moved(&self) -> bool {
        self.lights_moved || !self.table.moved().is_empty()
    }

    /// Numbers of the instances that came, went, moved or changed their shape between these two frames.
    pub fn moved_instances(&self) -> &[u32] {
        self.table.moved()
    }

    /// Everything that shaders read of the scene, by binding name.
    pub fn resources(&self) -> Resources<'_> {
        let mut resources = Resources::new();
        for (index, (name, copy_name)) in COPIED.into_iter().enumerate() {
            if let Some(buffer) = self.buffer(name) {
                resources = resources.with(name, buffer);
            }
            let copy = self.texels.as_ref().and_then(|copies| copies[index].view());
            if let Some(view) = copy {
                resources = resources.with_texture(copy_name, view);
            }
        }
        if let Some((_, cdf)) = &self.environment {
            resources = resources.with("environment_cdf", cdf);
        }
        if let Some(buffer) = self.previous_instances.buffer() {
            resources = resources.with("previous_instances", buffer);
        }
        if let Some(deformer) = &self.deformer {
            resources = deformer.resources(resources);
        }
        if let Some((infos, texels)) = &self.textures {
            resources = resources
                .with("texture_infos", infos.buffer())
                .with("texels", texels.buffer());
        }
        resources
    }

    /// Bytes that the frame begun last uploaded of the scene: instance hierarchy, instances and lights, no triangles.
    pub fn upload_bytes(&self) -> u64 {
        self.last_upload_bytes
    }

    /// Total emitted power, W.
    pub fn total_power_w(&self) -> [f64; 3] {
        self.packed_lights.total_power
    }

    /// Levels of the tree by which lights are picked; 0 without.
    pub fn light_tree_depth(&self) -> u32 {
        self.packed_lights.tree_depth()
    }

    /// Number of lights, every emissive triangle of every instance counted.
    pub fn light_count(&self) -> usize {
        self.packed_lights.records.len()
    }

    /// Inner nodes on the longest path through both levels, the upper one's estimated: it is rebuilt as the head moves.
    pub fn hierarchy_depth(&self) -> u32 {
        let instances = self.table.sources().len();
        let instances = instances.max(1).ilog2();
        self.hierarchies.max_depth + instances + instances / 2
    }

    /// The mesh hierarchies, for figures and picking. Those of meshes that change their shape have the triangles and
    /// boxes for which they were built.
    pub fn hierarchies(&self) -> &MeshHierarchies {
        &self.hierarchies
    }
}

/// What a frame uploads.
struct Uploads<'a> {
    context: &'a GpuContext,
    bytes: u64,
    replaced: bool,
}

impl Uploads<'_> {
    fn all<T: bytemuck::NoUninit>(
        &mut self,
        buffer: &mut GrowingBuffer,
        data: &[T],
    ) -> Result<(), GpuError> {
        self.replaced |= buffer.upload(self.context, data)?;
        self.bytes += size_of_val(data) as u64;
        Ok(())
    }

    fn range<T: bytemuck::NoUninit>(
        &mut self,
        buffer: &mut GrowingBuffer,
        data: &[T],
        range: Range<usize>,
    ) -> Result<(), GpuError> {
        let count = range.len();
        let replaced = buffer.upload_range(self.context, data, range)?;
        let count = if replaced { data.len() } else { count };
        self.replaced |= replaced;
        self.bytes += (count * size_of::<T>()) as u64;
        Ok(())
    }
}
