//! The scene on the device: what never changes is uploaded once, what depends on the head each time the head moves.

use glam::DVec3;

use super::RenderError;
use crate::bvh::{InstanceSource, MaterialMarks, MeshHierarchies, TopLevel};
use crate::gpu::scene::{
    LightKinds, LightSources, PackedLights, TriangleOrder, pack_environment, pack_lights,
    pack_materials, pack_textures, pack_vertices,
};
use crate::gpu::shaders::ShaderFeatures;
use crate::gpu::texels::TexelCopy;
use crate::gpu::{GpuContext, GrowingBuffer, Resources, storage_buffer, storage_buffer_with_data};
use crate::scene::Scene;

/// The scene's buffers.
pub struct SceneBuffers {
    sources: Vec<InstanceSource>,
    hierarchies: MeshHierarchies,
    top: TopLevel,
    packed_lights: PackedLights,
    origin_in_world: Option<DVec3>,
    mesh_nodes: wgpu::Buffer,
    triangles: wgpu::Buffer,
    triangle_vertices: wgpu::Buffer,
    vertices: wgpu::Buffer,
    materials: wgpu::Buffer,
    textures: Option<(wgpu::Buffer, wgpu::Buffer)>,
    environment: Option<(wgpu::Buffer, wgpu::Buffer)>,
    light_alias: wgpu::Buffer,
    top_nodes: GrowingBuffer,
    instances: GrowingBuffer,
    lights: GrowingBuffer,
    texels: Option<[TexelCopy; COPIED.len()]>,
}

/// Arrays that the feature `record_texels` copies into textures, by the names that the shaders give the copies.
const COPIED: [(&str, &str); 9] = [
    ("top_nodes", "top_node_texels"),
    ("mesh_nodes", "mesh_node_texels"),
    ("instances", "instance_texels"),
    ("triangles", "triangle_texels"),
    ("triangle_vertices", "corner_texels"),
    ("vertices", "vertex_texels"),
    ("materials", "material_texels"),
    ("lights", "light_texels"),
    ("light_alias", "light_alias_texels"),
];
/// Those of them that follow the head.
const FOLLOW_HEAD: [&str; 3] = ["top_nodes", "instances", "lights"];

fn is_on(features: &ShaderFeatures, name: &str) -> bool {
    features.get(name).copied().unwrap_or(false)
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
        let marks: Vec<MaterialMarks> = scene.materials.iter().map(MaterialMarks::of).collect();
        let hierarchies = MeshHierarchies::build(&scene.meshes, &marks)?;
        let packed_textures = if is_on(features, "textures") {
            pack_textures(scene, context.max_binding_bytes)?
        } else {
            Default::default()
        };
        let materials = pack_materials(scene, &packed_textures);
        let packed_vertices = pack_vertices(scene);
        let environment = scene
            .environment
            .as_ref()
            .filter(|_| is_on(features, "environment"))
            .and_then(pack_environment);
        let first_triangle: Vec<u32> = hierarchies
            .meshes
            .iter()
            .map(|range| range.first_triangle)
            .collect();
        let order =
            TriangleOrder::from_leaf_order(scene, &first_triangle, &hierarchies.triangle_vertices);
        let packed_lights = pack_lights(
            &LightSources {
                scene,
                environment: environment.as_ref(),
                order: &order,
                kinds: LightKinds {
                    emitters: is_on(features, "emitters"),
                    points: is_on(features, "points"),
                    spots: is_on(features, "spots"),
                    directionals: is_on(features, "directionals"),
                    environment: environment.is_some(),
                },
            },
            DVec3::ZERO,
        );
        let sources = scene
            .instances()
            .iter()
            .zip(&packed_lights.first_emitter)
            .map(|(instance, &first_emitter)| InstanceSource {
                world_from_object: instance.world_from_object,
                mesh: instance.mesh as u32,
                node: instance.node as u32,
                first_emitter,
            })
            .collect();
        let textures = if is_on(features, "textures") {
            Some((
                storage_buffer_with_data(context, "texture infos", &packed_textures.infos)?,
                storage_buffer_with_data(context, "texels", &packed_textures.texels)?,
            ))
        } else {
            None
        };
        let environment = match &environment {
            Some(packed) => Some((
                storage_buffer_with_data(context, "environment texels", &packed.texels)?,
                storage_buffer_with_data(context, "environment cdf", &packed.cdf)?,
            )),
            // The map is black, or the feature is forced in without one: the shaders read no texel of it, but bind them.
            None if is_on(features, "environment") => Some((
                storage_buffer(context, "environment texels", 16)?,
                storage_buffer(context, "environment cdf", 16)?,
            )),
            None => None,
        };
        // Two entries to a texel.
        let mut light_alias = packed_lights.alias.clone();
        light_alias.resize(light_alias.len().next_multiple_of(2), Default::default());
        let mut buffers = Self {
            mesh_nodes: storage_buffer_with_data(context, "mesh nodes", &hierarchies.nodes)?,
            triangles: storage_buffer_with_data(context, "triangles", &hierarchies.triangles)?,
            texels: is_on(features, "record_texels")
                .then(|| COPIED.map(|(_, name)| TexelCopy::new(name))),
            triangle_vertices: storage_buffer_with_data(
                context,
                "triangle vertices",
                &hierarchies.triangle_vertices,
            )?,
            vertices: storage_buffer_with_data(context, "vertices", &packed_vertices.vertices)?,
            materials: storage_buffer_with_data(context, "materials", &materials)?,
            textures,
            environment,
            light_alias: storage_buffer_with_data(context, "light alias", &light_alias)?,
            top_nodes: GrowingBuffer::new("top nodes"),
            instances: GrowingBuffer::new("instances"),
            lights: GrowingBuffer::new("lights"),
            sources,
            hierarchies,
            top: TopLevel::default(),
            packed_lights,
            origin_in_world: None,
        };
        buffers.copy_to_texels(context, |name| !FOLLOW_HEAD.contains(&name))?;
        Ok(buffers)
    }

    /// Brings the copies of the arrays that `chosen` names up to date with their buffers; to be called whenever one
    /// changes. True if textures were replaced.
    fn copy_to_texels(
        &mut self,
        context: &GpuContext,
        chosen: impl Fn(&str) -> bool,
    ) -> Result<bool, RenderError> {
        let Some(mut copies) = self.texels.take() else {
            return Ok(false);
        };
        let mut encoder = context
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor {
                label: Some("record texels"),
            });
        let mut replaced = false;
        for ((name, _), copy) in COPIED.into_iter().zip(&mut copies) {
            if let Some(buffer) = self.buffer(name).filter(|_| chosen(name)) {
                replaced |= copy.copy_from(context, &mut encoder, buffer)?;
            }
        }
        context.queue.submit([encoder.finish()]);
        self.texels = Some(copies);
        Ok(replaced)
    }

    fn buffer(&self, name: &str) -> Option<&wgpu::Buffer> {
        match name {
            "top_nodes" => self.top_nodes.buffer(),
            "mesh_nodes" => Some(&self.mesh_nodes),
            "instances" => self.instances.buffer(),
            "triangles" => Some(&self.triangles),
            "triangle_vertices" => Some(&self.triangle_vertices),
            "vertices" => Some(&self.vertices),
            "materials" => Some(&self.materials),
            "lights" => self.lights.buffer(),
            "light_alias" => Some(&self.light_alias),
            _ => None,
        }
    }

    /// Moves the origin of render space: rebuilds and uploads the instance hierarchy and the lights. True if buffers
    /// were replaced, so that they must be bound again.
    ///
    /// # Errors
    /// More instances than the hierarchy numbers, or than the adapter binds.
    pub fn set_origin(
        &mut self,
        context: &GpuContext,
        origin_in_world: DVec3,
    ) -> Result<bool, RenderError> {
        if self.origin_in_world == Some(origin_in_world) {
            return Ok(false);
        }
        self.top
            .rebuild(origin_in_world, &self.sources, &self.hierarchies)?;
        self.packed_lights.set_origin(origin_in_world);
        self.origin_in_world = Some(origin_in_world);
        let replaced_nodes = self.top_nodes.upload(context, self.top.nodes())?;
        let replaced_instances = self.instances.upload(context, self.top.instances())?;
        let replaced_lights = self.lights.upload(context, &self.packed_lights.records)?;
        let replaced_texels = self.copy_to_texels(context, |name| FOLLOW_HEAD.contains(&name))?;
        Ok(replaced_nodes || replaced_instances || replaced_lights || replaced_texels)
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
        if let Some((infos, texels)) = &self.textures {
            resources = resources
                .with("texture_infos", infos)
                .with("texels", texels);
        }
        if let Some((texels, cdf)) = &self.environment {
            resources = resources
                .with("environment_texels", texels)
                .with("environment_cdf", cdf);
        }
        resources
    }

    /// Bytes that a move of the origin uploads: instance hierarchy, instances and lights, no triangles.
    pub fn upload_bytes(&self) -> u64 {
        let bytes = size_of_val(self.top.nodes())
            + size_of_val(self.top.instances())
            + size_of_val(self.packed_lights.records.as_slice());
        bytes as u64
    }

    /// Total emitted power, W.
    pub fn total_power_w(&self) -> [f64; 3] {
        self.packed_lights.total_power
    }

    /// Number of lights, every emissive triangle of every instance counted.
    pub fn light_count(&self) -> usize {
        self.packed_lights.records.len()
    }

    /// Inner nodes on the longest path through both levels, the upper one's estimated: it is rebuilt as the head moves.
    pub fn hierarchy_depth(&self) -> u32 {
        let instances = self.sources.len().max(1).ilog2();
        self.hierarchies.max_depth + instances + instances / 2
    }

    /// The mesh hierarchies, for figures and picking.
    pub fn hierarchies(&self) -> &MeshHierarchies {
        &self.hierarchies
    }
}
