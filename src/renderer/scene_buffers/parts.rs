//! Parts of a scene that come and go: their places in arrays that others keep theirs in.

use std::ops::Range;

use super::SceneBuffers;
use crate::bvh::parts::{Grafted, Places, Room};
use crate::bvh::records::{BvhNode, Triangle};
use crate::bvh::{MaterialMarks, MeshHierarchies};
use crate::gpu::{ArrayBuffer, GpuContext};
use crate::renderer::RenderError;
use crate::renderer::packing::{PackedTextures, pack_textures, pack_vertices};
use crate::renderer::records::material::{TextureInfo, Vertex};
use crate::scene::{Scene, ScenePart, SceneStatistics};

/// How a renderer wants parts prepared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PartPreparation {
    pub(in crate::renderer) has_textures: bool,
    pub(in crate::renderer) has_mips: bool,
    pub(in crate::renderer) max_binding_bytes: u64,
}

/// What takes time of adding a scene: its hierarchies, packed vertices and textures, and what is known of its triangles.
pub struct PreparedPart {
    /// Whether it was prepared for shaders that read textures.
    pub(in crate::renderer) has_textures: bool,
    hierarchies: MeshHierarchies,
    vertices: Vec<Vertex>,
    textures: PackedTextures,
    pub(in crate::renderer) statistics: SceneStatistics,
}

impl PartPreparation {
    /// Prepares a scene that is to be added ([`Scene::add_part`]), on whatever thread. Work in proportion to its triangles and
    /// texels; cores are shared with others who use rayon.
    ///
    /// # Errors
    /// Geometry that no hierarchy can hold, textures that the adapter cannot bind.
    pub fn prepare(&self, part: &Scene) -> Result<PreparedPart, RenderError> {
        let marks: Vec<MaterialMarks> = part.materials.iter().map(MaterialMarks::from).collect();
        let textures = if self.has_textures {
            pack_textures(part, self.max_binding_bytes, self.has_mips)?
        } else {
            PackedTextures::default()
        };
        let statistics = SceneStatistics::of(part);
        statistics.look_at_images(part);
        Ok(PreparedPart {
            has_textures: self.has_textures,
            hierarchies: MeshHierarchies::build(&part.meshes, &marks)?,
            vertices: pack_vertices(part),
            textures,
            statistics,
        })
    }
}

/// Which places of the scene's arrays are taken, and by which parts.
pub(super) struct Taken {
    room: Room,
    vertices: Places,
    infos: Places,
    texels: Places,
    parts: Vec<Part>,
}

/// Where a part lies.
struct Part {
    part: ScenePart,
    grafted: Grafted,
    vertices: Range<usize>,
    infos: Range<usize>,
    texels: Range<usize>,
}

impl Taken {
    pub(super) fn of(
        hierarchies: &MeshHierarchies,
        vertices: &[Vertex],
        textures: &PackedTextures,
    ) -> Self {
        Self {
            room: Room::of(hierarchies),
            vertices: Places::new(vertices.len()),
            infos: Places::new(textures.infos.len()),
            texels: Places::new(textures.texels.len()),
            parts: Vec::new(),
        }
    }
}

impl SceneBuffers {
    /// Whether a part was added that has not been taken out.
    pub(in crate::renderer) fn holds_part(&self, part: &ScenePart) -> bool {
        self.places.parts.iter().any(|known| known.part == *part)
    }

    /// Whether the meshes of the buffers are those of a scene of `meshes` meshes, none copied for its shape.
    pub(in crate::renderer) fn has_meshes(&self, meshes: usize) -> bool {
        self.hierarchies.meshes.len() == meshes
    }

    /// Uploads a part of `scene`, which no instance shows yet. True if buffers were replaced, so that they must be bound again.
    /// The device copies what lies in those.
    ///
    /// # Errors
    /// More than the adapter binds; the buffers then hold what they held.
    pub(in crate::renderer) fn add_part(
        &mut self,
        context: &GpuContext,
        scene: &Scene,
        part: &ScenePart,
        prepared: &PreparedPart,
    ) -> Result<bool, RenderError> {
        let places = &mut self.places;
        let vertices = places.vertices.take(prepared.vertices.len());
        let material = part.materials.start as u32;
        let first_vertex = vertices.start as u32;
        let trees = &prepared.hierarchies;
        let grafted = self
            .hierarchies
            .graft(trees, &mut places.room, material, first_vertex);
        let grafted = match grafted {
            Ok(grafted) => grafted,
            Err(error) => {
                places.vertices.give_back(vertices);
                return Err(error.into());
            }
        };
        let own = Part {
            part: part.clone(),
            grafted,
            vertices,
            infos: places.infos.take(prepared.textures.infos.len()),
            texels: places.texels.take(prepared.textures.texels.len()),
        };
        let firsts = [part.textures.start, own.infos.start, own.texels.start];
        let firsts = firsts.map(|first| first as u32);
        self.packed_textures.add_part(&prepared.textures, firsts);
        self.packed_lights.set_mesh_count(scene.meshes.len());
        self.places.parts.push(own);
        let replaced = self
            .fit(context)
            .and_then(|fitted| self.write_part(context, prepared, fitted));
        match replaced {
            Ok(replaced) => {
                for mesh in part.meshes.clone() {
                    self.look_for_emitters(scene, mesh);
                }
                Ok(replaced)
            }
            Err(error) => {
                self.forget_part(part);
                self.shorten(part.meshes.start);
                Err(error)
            }
        }
    }

    /// Takes a part out that no instance shows any more; `meshes` meshes are left in the scene. True as [`Self::add_part`].
    ///
    /// # Errors
    /// [`RenderError::Gpu`].
    pub(in crate::renderer) fn remove_part(
        &mut self,
        context: &GpuContext,
        part: &ScenePart,
        meshes: usize,
    ) -> Result<bool, RenderError> {
        self.forget_part(part);
        self.shorten(meshes);
        let fitted = self.fit(context)?;
        let copied = self.copy_to_texels(context, |name| fitted.whole(name))?;
        Ok(copied | fitted.any)
    }

    fn shorten(&mut self, meshes: usize) {
        self.hierarchies.meshes.truncate(meshes);
        self.packed_lights.set_mesh_count(meshes);
    }

    /// Gives a part's places back.
    fn forget_part(&mut self, part: &ScenePart) {
        let Taken {
            room,
            vertices,
            infos,
            texels,
            parts,
        } = &mut self.places;
        let Some(at) = parts.iter().position(|known| known.part == *part) else {
            return;
        };
        let own = parts.remove(at);
        self.hierarchies
            .prune(part.meshes.clone(), &own.grafted, room);
        vertices.give_back(own.vertices);
        infos.give_back(own.infos);
        texels.give_back(own.texels);
        self.packed_textures
            .remove_part(&part.textures, infos.len());
        for mesh in part.meshes.clone() {
            self.packed_lights.forget_mesh(mesh);
        }
    }

    /// Gives the arrays' buffers the size that they need.
    fn fit(&mut self, context: &GpuContext) -> Result<Fitted, RenderError> {
        let places = &self.places;
        let (nodes, triangles) = (places.room.nodes.len(), places.room.triangles.len());
        let mut wanted = vec![
            (&mut self.mesh_nodes, nodes * size_of::<BvhNode>()),
            (&mut self.triangles, triangles * size_of::<Triangle>()),
            (&mut self.triangle_vertices, triangles * 16),
            (
                &mut self.vertices,
                places.vertices.len() * size_of::<Vertex>(),
            ),
        ];
        if let Some((infos, texels)) = &mut self.textures {
            wanted.push((infos, places.infos.len() * size_of::<TextureInfo>()));
            wanted.push((texels, places.texels.len() * 4));
        }
        let mut replaced = Vec::new();
        for (buffer, bytes) in wanted {
            replaced.push(buffer.fit(context, bytes as u64)?);
        }
        let names = ["mesh_nodes", "triangles", "triangle_vertices", "vertices"];
        let arrays = names.into_iter().zip(&replaced);
        Ok(Fitted {
            any: replaced.contains(&true),
            names: arrays
                .filter(|(_, is)| **is)
                .map(|(name, _)| name)
                .collect(),
        })
    }

    /// Writes the part that was added last.
    fn write_part(
        &mut self,
        context: &GpuContext,
        prepared: &PreparedPart,
        fitted: Fitted,
    ) -> Result<bool, RenderError> {
        let Some(own) = self.places.parts.last() else {
            return Ok(fitted.any);
        };
        let write_at = |buffer: &ArrayBuffer, bytes: &[u8], first: usize, size: usize| {
            let first = (first * size) as u64;
            context.queue.write_buffer(buffer.buffer(), first, bytes);
            first..first + bytes.len() as u64
        };
        let vertices: &[u8] = bytemuck::cast_slice(&prepared.vertices);
        let first = own.vertices.start;
        let vertices = write_at(&self.vertices, vertices, first, size_of::<Vertex>());
        let mut written = self.write_trees(context, &own.grafted).to_vec();
        written.push(("vertices", vertices));
        if let Some((infos, texels)) = &self.textures {
            infos.write(context, &self.packed_textures.infos, own.infos.clone());
            let data = bytemuck::cast_slice(&prepared.textures.texels);
            write_at(texels, data, own.texels.start, 4);
        }
        let copied = self.copy_to_texels(context, |name| {
            let found = written.iter().find(|(known, _)| *known == name)?;
            fitted.whole(name).or(Some(found.1.clone()))
        })?;
        Ok(copied | fitted.any)
    }
}

/// Buffers that are others now.
struct Fitted {
    any: bool,
    /// Those among the arrays that are copied into textures.
    names: Vec<&'static str>,
}

impl Fitted {
    /// All of an array, if its buffer is another one.
    fn whole(&self, name: &str) -> Option<Range<u64>> {
        self.names.contains(&name).then_some(super::WHOLE)
    }
}
