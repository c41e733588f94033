//! An edited scene on the device: what differs is uploaded, and nothing else looked at.

use std::ops::Range;

use super::{SceneBuffers, WHOLE, environment_buffers, slots_of_nodes, source_of};
use crate::bvh::MaterialMarks;
use crate::gpu::GpuContext;
use crate::renderer::packing::{LightKinds, PackedEnvironment, image_levels, pack_materials};
use crate::renderer::records::material::Material;
use crate::renderer::{InstanceId, RenderError};
use crate::scene::{self, Instance, Scene, ScenePose, SceneStatistics};

/// What an edit asks of the buffers. Meshes, textures, images and skins are those that the buffers were made from.
pub(in crate::renderer) struct SceneChange<'a> {
    /// The edited scene.
    pub scene: &'a Scene,
    /// What is known of its triangles.
    pub statistics: &'a SceneStatistics,
    /// By mesh: other materials or marks are to be noted in its triangles.
    pub repainted: &'a [bool],
    /// By mesh: its emissive triangles, or how much they emit, may be others.
    pub glow: &'a [bool],
    /// Punctual lights, or the nodes that have them, are others.
    pub lights: bool,
    /// Kinds of punctual lights that shine.
    pub kinds: LightKinds,
    /// Where a clip that plays has the scene by now.
    pub pose: Option<&'a ScenePose>,
}

/// What an edit did.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::renderer) struct Edited {
    /// Instances have other numbers.
    pub renumbered: bool,
    /// Buffers or textures were replaced, so that they must be bound again.
    pub replaced: bool,
    /// Bytes uploaded by now: materials and triangles' materials. Instances and lights follow with the next frame.
    pub uploaded_bytes: u64,
    /// Materials, lights or emission are others, not only places.
    pub relit: bool,
}

impl SceneBuffers {
    /// Whether a texture that a material refers to under a name of its slots is on the device as it is needed there, or has
    /// no image at all.
    pub(in crate::renderer) fn holds_texture(
        &self,
        scene: &Scene,
        material: &scene::Material,
        (slot, texture): (&str, u32),
    ) -> bool {
        let packed = &self.packed_textures;
        let is_packed = packed.info(material, slot, texture).is_some();
        let image = scene.textures.get(texture as usize);
        let image = image.and_then(|texture| scene.images.get(texture.image as usize));
        is_packed || image.is_none_or(|image| image.width == 0 || image.height == 0)
    }

    /// Uploads another map of surroundings; light records follow with the next edit. True if its buffers are others now.
    ///
    /// # Errors
    /// A map that the adapter cannot bind.
    pub(in crate::renderer) fn write_environment(
        &mut self,
        context: &GpuContext,
        packed: &PackedEnvironment,
    ) -> Result<bool, RenderError> {
        let Some((map, cdf)) = &self.environment else {
            return Ok(false);
        };
        let bytes: [&[u8]; 2] = [
            bytemuck::cast_slice(&packed.texels),
            bytemuck::cast_slice(&packed.cdf),
        ];
        let fits = [map, cdf].map(wgpu::Buffer::size) == bytes.map(|of| of.len() as u64);
        let mut before = None;
        if fits {
            context.queue.write_buffer(map, 0, bytes[0]);
            context.queue.write_buffer(cdf, 0, bytes[1]);
        } else {
            let buffers = environment_buffers(context, packed)?;
            before = self.environment.replace(buffers);
        }
        let copied =
            self.copy_to_texels(context, |name| (name == "environment_map").then_some(WHOLE));
        if copied.is_err() && before.is_some() {
            self.environment = before;
        }
        let copied = copied?;
        self.packed_lights.set_environment(packed);
        Ok(!fits || copied)
    }

    /// Uploads an image of the scene that has other texels now, of the same size, with its coarser levels, to where textures
    /// in use have it.
    pub(in crate::renderer) fn write_image(
        &mut self,
        context: &GpuContext,
        scene: &Scene,
        image: usize,
    ) {
        let (Some((_, texels)), Some(source)) = (&self.textures, scene.images.get(image)) else {
            return;
        };
        for (offset, averaging) in self.packed_textures.places_of_image(scene, image) {
            let levels = image_levels(source, averaging);
            let first = u64::from(offset) * 4;
            let bytes = bytemuck::cast_slice(&levels);
            context.queue.write_buffer(texels.buffer(), first, bytes);
            self.has_repainted_image = true;
        }
    }

    /// Whether a texture has another picture than in the last frame.
    pub(in crate::renderer) fn has_repainted_image(&self) -> bool {
        self.has_repainted_image
    }

    /// The same, said once.
    pub(in crate::renderer) fn take_repainted_image(&mut self) -> bool {
        std::mem::take(&mut self.has_repainted_image)
    }

    /// Whether every instance is one of a node, as it is unless the application added or removed some.
    pub(in crate::renderer) fn has_nodes_alone(&self) -> bool {
        let sources = self.table.sources();
        self.table.live_count() == sources.len()
            && sources.iter().all(|source| source.node != u32::MAX)
    }

    /// The mesh that an instance of a node shows: its own copy, where it changes its shape.
    fn mesh_of(&self, instance: &Instance) -> usize {
        let deformer = self.deformer.as_ref();
        deformer
            .and_then(|deformer| deformer.mesh_of(instance.node))
            .unwrap_or(instance.mesh)
    }

    /// Uploads what differs of the materials.
    pub(super) fn write_materials(
        &mut self,
        context: &GpuContext,
        scene: &Scene,
    ) -> Result<Edited, RenderError> {
        let mut materials = pack_materials(scene, &self.packed_textures)?;
        if materials.is_empty() {
            // Nothing binds a buffer smaller than one record.
            materials.push(Material::default());
        }
        let before = &self.packed_materials;
        let differs = |at: &usize| before.get(*at) != materials.get(*at);
        let first = (0..materials.len()).find(differs);
        let Some(first) = first else {
            self.packed_materials = materials;
            return Ok(Edited::default());
        };
        let last = (0..materials.len()).rfind(differs).unwrap_or(first);
        let replaced = self
            .materials
            .upload_range(context, &materials, first..last + 1)?;
        let count = if replaced {
            materials.len()
        } else {
            last + 1 - first
        };
        self.packed_materials = materials;
        Ok(Edited {
            replaced,
            uploaded_bytes: (count * size_of::<Material>()) as u64,
            relit: true,
            renumbered: false,
        })
    }

    /// Takes an edited scene over, in the pose in which it is stored or in `change.pose`. The next frame shows it as buffers
    /// made from it would: records have the same values in the same order. Work in proportion to nodes, materials and
    /// lights; triangles only of meshes that `repainted` or `glow` name, vertices only of meshes that deform, where light
    /// comes from afar.
    ///
    /// # Errors
    /// More than the adapter binds.
    pub(in crate::renderer) fn edit(
        &mut self,
        context: &GpuContext,
        change: &SceneChange<'_>,
    ) -> Result<Edited, RenderError> {
        let scene = change.scene;
        let mut edited = self.write_materials(context, scene)?;
        let mut relights = change.lights;
        let painted = self.repaint(context, change, &mut edited, &mut relights);
        edited.relit |= relights;
        if edited.uploaded_bytes > 0 {
            edited.replaced |= self.copy_to_texels(context, |name| match name {
                "materials" => Some(WHOLE),
                "triangles" => painted.clone(),
                _ => None,
            })?;
        }
        let instances: Vec<Instance> = scene
            .instances()
            .into_iter()
            .map(|instance| Instance {
                mesh: self.mesh_of(&instance),
                ..instance
            })
            .collect();
        edited.renumbered = self.renumber(&instances, scene.nodes.len());
        let emits = |instance: &Instance| self.packed_lights.emits(instance.mesh);
        let moved = |(slot, instance): (usize, &Instance)| {
            let at = self.table.placement(InstanceId(slot as u32));
            emits(instance) && at != Some(instance.world_from_object)
        };
        relights |= if edited.renumbered {
            self.packed_lights.has_emitters()
        } else {
            instances.iter().enumerate().any(moved)
        };
        let is_afar = relights || self.packed_lights.has_infinite_lights();
        let bounds = is_afar
            .then(|| change.statistics.bounds_in_world(scene))
            .flatten();
        if relights || self.packed_lights.leaves_box(bounds) {
            self.packed_lights
                .repack(scene, change.kinds, &instances, bounds);
            for (slot, first) in self.packed_lights.first_emitter.iter().enumerate() {
                self.table
                    .set_first_emitter(InstanceId(slot as u32), *first);
            }
            if let Some(deformer) = &mut self.deformer {
                deformer.forget_pose();
            }
        }
        // First the stored pose: powers are those of a scene that was just read.
        self.set_pose(&scene.rest_pose());
        self.has_moved = self.deformer.is_some();
        if let Some(pose) = change.pose {
            self.set_pose(pose);
        }
        // Whatever it was, the next frame uploads it and photons are traced anew.
        self.node_lights_moved = true;
        Ok(edited)
    }

    /// Notes materials and marks in triangles, and looks at what emits. Returns the bytes of the triangles that changed.
    fn repaint(
        &mut self,
        context: &GpuContext,
        change: &SceneChange<'_>,
        edited: &mut Edited,
        relights: &mut bool,
    ) -> Option<Range<u64>> {
        let scene = change.scene;
        let marks: Vec<MaterialMarks> = scene.materials.iter().map(MaterialMarks::from).collect();
        let mut painted: Option<Range<u64>> = None;
        for (index, mesh) in scene.meshes.iter().enumerate() {
            let (repaints, glows) = (change.repainted[index], change.glow[index]);
            if !repaints && !glows {
                continue;
            }
            if repaints {
                let range = self.hierarchies.repaint(index, mesh, &marks);
                let all = &self.hierarchies.triangles;
                let written = self.triangles.write(context, all, range);
                edited.uploaded_bytes += written.end - written.start;
                edited.relit = true;
                painted = Some(match painted {
                    Some(known) => known.start.min(written.start)..known.end.max(written.end),
                    None => written,
                });
            }
            *relights |= self.packed_lights.emits(index);
            self.look_for_emitters(scene, index);
            *relights |= self.packed_lights.emits(index);
        }
        if let Some(deformer) = self.deformer.as_mut().filter(|_| painted.is_some()) {
            deformer.marks = marks;
        }
        painted
    }

    /// Looks at which of a mesh's triangles emit.
    pub(super) fn look_for_emitters(&mut self, scene: &Scene, mesh: usize) {
        let leaf_of = self.hierarchies.leaf_of_triangles(mesh);
        self.packed_lights.look_at_mesh(scene, mesh, &leaf_of);
    }

    /// Gives instances the numbers that they would have in a scene just read, unless they have them: true if not.
    fn renumber(&mut self, instances: &[Instance], node_count: usize) -> bool {
        let sources = self.table.sources();
        let is_same = sources.len() == instances.len()
            && sources.iter().zip(instances).all(|(source, instance)| {
                (source.node, source.mesh) == (instance.node as u32, instance.mesh as u32)
            });
        if is_same {
            self.slot_of_node.resize(node_count, u32::MAX);
            return false;
        }
        let made = instances.iter();
        let made = made.map(|instance| source_of(instance, u32::MAX)).collect();
        let was = |slot: usize| {
            let node = instances.get(slot)?.node;
            let old = self.slot_of_node.get(node).copied()?;
            (old != u32::MAX).then_some(old)
        };
        self.table.replace(made, was);
        self.slot_of_node = slots_of_nodes(instances, node_count);
        true
    }
}
