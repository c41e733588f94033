//! What is shown at once while the renderer is at work: the scene's triangles from where the head is now, drawn on the
//! window's own device in a few milliseconds, see `shaders/viewer/sketch.wesl`.
//!
//! A surface that the last frame saw takes its colour from there (by the place where it stood then, so that an object that
//! is dragged takes its light along), times the change of its base colour; any other is shaded by a light at the eye. Before
//! the first frame, all are.

use std::cell::LazyCell;
use std::collections::HashMap;
use std::mem::offset_of;

use bytemuck::{Pod, Zeroable};
use glam::{DAffine3, DMat4, Mat4, Vec4};
use wgpu::util::{DeviceExt as _, TextureDataOrder};

use super::frames::{FrameReport, ViewMode};
use super::painter::sampler;
use crate::gpu::buffers::flat_texture;
use crate::gpu::kernel::layouts;
use crate::gpu::raster::{bind_group, from_black, from_infinity, stages, texture_type};
use crate::gpu::{GpuContext, GpuError, ShaderFeatures, ShaderLibrary};
use crate::scene::{Deformation, Material, Scene};
use crate::xr::View;

const LABEL: &str = "sketch";
/// Format of what is drawn: display values, as egui's textures have them.
pub const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
/// Space between two draws' uniforms, bytes: what every adapter takes as a dynamic offset.
const STRIDE: u64 = 256;
/// Texels of an image that its mean colour is taken from, at most.
const MEAN_OF: usize = 1024;
/// A base colour below this share of display white says nothing about what another one would look like.
const DARK: f32 = 0.08;

/// Where everything stood in a frame, and its colours: what the frame's light belongs to.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stand {
    /// By node.
    world_from_object: HashMap<usize, DAffine3>,
    /// By material, display values.
    base_colors: Vec<[f32; 3]>,
}

impl Stand {
    /// Of the scene now.
    pub fn of(scene: &Scene) -> Self {
        Self {
            world_from_object: scene
                .instances()
                .iter()
                .map(|instance| (instance.node, instance.world_from_object))
                .collect(),
            base_colors: scene.materials.iter().map(factor).collect(),
        }
    }
}

/// Base colour without its texture, display values.
fn factor(material: &Material) -> [f32; 3] {
    let [r, g, b, _] = material.base_color;
    if material.is_emissive() {
        [1.0; 3]
    } else {
        [r, g, b].map(|channel| channel.clamp(0.0, 1.0).powf(1.0 / 2.2))
    }
}

/// What is drawn.
pub struct Wish<'a> {
    /// The scene now.
    pub scene: &'a Scene,
    /// Another number for every scene that was opened.
    pub scene_number: u64,
    /// A frame whose light is taken over, and what stood where in it.
    pub source: Option<(&'a FrameReport, &'a Stand)>,
    /// The views now.
    pub views: [View; 2],
    /// Pixels of an image.
    pub size: [u32; 2],
    /// Nearest distance that is drawn, metres.
    pub near_m: f64,
    /// Nodes that get a rim.
    pub selected: Option<Vec<bool>>,
}

/// As the shader has it.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Draw {
    clip_from_object: Mat4,
    source_from_object: Mat4,
    base: Vec4,
    tint: Vec4,
    tangents: Vec4,
}
const _: () = assert!(size_of::<Draw>() as u64 <= STRIDE && offset_of!(Draw, tangents) == 160);

/// A mesh on the device: positions, and indices in the order of materials.
struct MeshOnDevice {
    positions: wgpu::Buffer,
    indices: wgpu::Buffer,
    /// Material and its range of indices.
    parts: Vec<(u32, std::ops::Range<u32>)>,
    /// Repainted so often.
    repainted: usize,
    deformation: Option<Deformation>,
}

/// Images of one size.
struct Images {
    size: [u32; 2],
    drawn: [wgpu::TextureView; 2],
    rimmed: [wgpu::TextureView; 2],
    depth: wgpu::TextureView,
}

/// The last frame on the device, both eyes.
struct SourceOnDevice {
    /// Number of the frame, and the view that it shows.
    of: Option<(u32, ViewMode)>,
    /// Picture and distances.
    eyes: [[wgpu::TextureView; 2]; 2],
}

/// Pipelines, and what is kept on the device.
pub struct Sketcher {
    layout: wgpu::BindGroupLayout,
    surface: wgpu::RenderPipeline,
    sky: wgpu::RenderPipeline,
    rim: wgpu::RenderPipeline,
    sampler: wgpu::Sampler,
    scene_number: u64,
    /// By mesh, and by node where a node deforms its mesh.
    meshes: HashMap<(usize, Option<usize>), MeshOnDevice>,
    /// Mean colours of the scene's images, display values, as they are needed.
    means: HashMap<u32, [f32; 3]>,
    images: Option<Images>,
    source: Option<SourceOnDevice>,
}

impl Sketcher {
    /// Compiles the shader.
    ///
    /// # Errors
    /// [`GpuError`].
    pub fn new(gpu: &GpuContext) -> Result<Self, GpuError> {
        let compiled =
            ShaderLibrary::embedded().compile("viewer/sketch", &ShaderFeatures::default())?;
        gpu.guarded(LABEL, || {
            let device = &gpu.device;
            use wgpu::ShaderStages as S;
            let draw = wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Uniform,
                has_dynamic_offset: true,
                min_binding_size: wgpu::BufferSize::new(size_of::<Draw>() as u64),
            };
            let filter = wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering);
            let bindings = [
                (0, S::VERTEX_FRAGMENT, draw),
                (1, S::FRAGMENT, texture_type(true)),
                (2, S::FRAGMENT, texture_type(false)),
                (3, S::FRAGMENT, filter),
            ];
            let (layout, pipeline_layout) = layouts(device, LABEL, bindings);
            let module = device.create_shader_module(compiled.descriptor(LABEL));
            let pipeline = |name, depth| pipeline(device, &pipeline_layout, &module, name, depth);
            Ok(Self {
                surface: pipeline("surface", Some(true)),
                sky: pipeline("sky", Some(false)),
                rim: pipeline("rim", None),
                layout,
                sampler: sampler(device, wgpu::FilterMode::Linear),
                scene_number: u64::MAX,
                meshes: HashMap::new(),
                means: HashMap::new(),
                images: None,
                source: None,
            })
        })
    }

    /// Draws both eyes; they stay valid until the next call.
    ///
    /// # Errors
    /// [`GpuError`].
    pub fn draw(
        &mut self,
        gpu: &GpuContext,
        wish: &Wish<'_>,
    ) -> Result<[wgpu::TextureView; 2], GpuError> {
        gpu.guarded(LABEL, || {
            if self.scene_number != wish.scene_number {
                self.scene_number = wish.scene_number;
                self.meshes.clear();
                self.means.clear();
            }
            if self
                .images
                .as_ref()
                .is_none_or(|images| images.size != wish.size)
            {
                self.images = Some(Images::new(gpu, wish.size));
            }
            self.take_source(gpu, wish.source.map(|(frame, _)| frame));
            for eye in 0..2 {
                self.draw_eye(gpu, wish, eye);
            }
            let rimmed = self.images.as_ref().map(|images| images.rimmed.clone());
            rimmed.ok_or_else(|| GpuError::Validation {
                pass: LABEL.to_owned(),
                reason: "no images".to_owned(),
            })
        })
    }

    /// Brings the last frame to the device, unless it is there.
    fn take_source(&mut self, gpu: &GpuContext, source: Option<&FrameReport>) {
        let of = source.map(|frame| (frame.index, frame.view_mode));
        if self.source.as_ref().is_some_and(|known| known.of == of) {
            return;
        }
        let eyes = [0, 1].map(|eye| match source {
            None => [FORMAT, wgpu::TextureFormat::R32Float]
                .map(|format| upload(gpu, [1, 1], format, &[0; 4])),
            Some(frame) => {
                let eye = frame.stands_for(eye);
                let seen = &frame.seen[eye];
                let picture = &frame.shown.eyes[eye];
                let texels: Vec<u8> = picture
                    .pixels
                    .iter()
                    .flat_map(|pixel| pixel.to_array())
                    .collect();
                let distances = bytemuck::cast_slice(&seen.distances_m);
                let size = picture.size.map(|edge| edge as u32);
                [
                    upload(gpu, size, FORMAT, &texels),
                    upload(gpu, seen.size, wgpu::TextureFormat::R32Float, distances),
                ]
            }
        });
        self.source = Some(SourceOnDevice { of, eyes });
    }

    fn draw_eye(&mut self, gpu: &GpuContext, wish: &Wish<'_>, eye: usize) {
        let (scene, view) = (wish.scene, &wish.views[eye]);
        let of_eye = |(frame, _): (&FrameReport, &Stand)| frame.views[frame.stands_for(eye)];
        let source_view = wish.source.map_or(*view, of_eye);
        let tangents = |view: &View| {
            let t = view.fov.tangents();
            Vec4::new(t.left as f32, t.right as f32, t.up as f32, t.down as f32)
        };
        let has_source = f32::from(u8::from(wish.source.is_some()));
        let source_from_eye = source_view.eye_from_world().matrix3 * view.world_from_eye().matrix3;
        let mut draws = vec![Draw {
            clip_from_object: Mat4::IDENTITY,
            source_from_object: DMat4::from_mat3(source_from_eye).as_mat4(),
            base: tangents(view),
            tint: Vec4::splat(has_source),
            tangents: tangents(&source_view),
        }];
        let clip_from_eye = view.clip_from_eye(wish.near_m);
        let mut placed = Vec::new();
        // Few scenes need it.
        let pose = LazyCell::new(|| scene.rest_pose());
        for instance in scene.instances() {
            let now = instance.world_from_object;
            let stand = wish.source.map(|(_, stand)| stand);
            let then = stand.and_then(|stand| stand.world_from_object.get(&instance.node));
            let source_from_object = source_view.eye_from_world() * *then.unwrap_or(&now);
            let is_selected = wish
                .selected
                .as_ref()
                .is_some_and(|selected| selected.get(instance.node).copied().unwrap_or(false));
            let node = instance.node;
            let deformation = scene.deforms(node).then(|| scene.deformation(node, &pose));
            let key = self.mesh(gpu, scene, instance.mesh, node, deformation);
            let Some(mesh) = self.meshes.get(&key) else {
                continue;
            };
            for (part, (material, _)) in mesh.parts.iter().enumerate() {
                let index = *material as usize;
                let base = scene.materials.get(index).map_or([0.8; 3], factor);
                let was = stand.and_then(|stand| stand.base_colors.get(index).copied());
                let mean = mean_color(&mut self.means, scene, index);
                let tint = [0, 1, 2].map(|k| match was {
                    Some(was) if was[k] > DARK => base[k] / was[k],
                    Some(was) if was[k] != base[k] => base[k] / DARK,
                    _ => 1.0,
                });
                // What was not there then was not seen.
                let is_known = has_source * f32::from(u8::from(then.is_some()));
                placed.push((key, part));
                draws.push(Draw {
                    clip_from_object: (clip_from_eye * DMat4::from(view.eye_from_world() * now))
                        .as_mat4(),
                    source_from_object: DMat4::from(source_from_object).as_mat4(),
                    base: Vec4::new(
                        base[0] * mean[0],
                        base[1] * mean[1],
                        base[2] * mean[2],
                        if is_selected { 0.5 } else { 1.0 },
                    ),
                    tint: Vec4::new(tint[0], tint[1], tint[2], is_known),
                    tangents: tangents(&source_view),
                });
            }
        }
        let mut bytes = vec![0; draws.len() * STRIDE as usize];
        for (slot, draw) in bytes.chunks_exact_mut(STRIDE as usize).zip(&draws) {
            slot[..size_of::<Draw>()].copy_from_slice(bytemuck::bytes_of(draw));
        }
        let uniforms = buffer(gpu, wgpu::BufferUsages::UNIFORM, &bytes);
        let (Some(images), Some(source)) = (&self.images, &self.source) else {
            return;
        };
        let bind = |picture: &wgpu::TextureView, distances: &wgpu::TextureView| {
            let draw = wgpu::BufferBinding {
                buffer: &uniforms,
                offset: 0,
                size: wgpu::BufferSize::new(size_of::<Draw>() as u64),
            };
            let resources = [
                wgpu::BindingResource::Buffer(draw),
                wgpu::BindingResource::TextureView(picture),
                wgpu::BindingResource::TextureView(distances),
                wgpu::BindingResource::Sampler(&self.sampler),
            ];
            bind_group(&gpu.device, LABEL, &self.layout, resources)
        };
        let [picture, distances] = &source.eyes[eye];
        let [by_source, by_drawn] = [
            bind(picture, distances),
            bind(&images.drawn[eye], distances),
        ];
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(LABEL),
            color_attachments: &[from_black(&images.drawn[eye])],
            depth_stencil_attachment: from_infinity(&images.depth, wgpu::StoreOp::Discard),
            ..Default::default()
        });
        pass.set_pipeline(&self.sky);
        pass.set_bind_group(0, &by_source, &[0]);
        pass.draw(0..3, 0..1);
        pass.set_pipeline(&self.surface);
        for (index, (key, part)) in placed.iter().enumerate() {
            let Some(mesh) = self.meshes.get(key) else {
                continue;
            };
            pass.set_bind_group(0, &by_source, &[(index as u32 + 1) * STRIDE as u32]);
            pass.set_vertex_buffer(0, mesh.positions.slice(..));
            pass.set_index_buffer(mesh.indices.slice(..), wgpu::IndexFormat::Uint32);
            pass.draw_indexed(mesh.parts[*part].1.clone(), 0, 0..1);
        }
        drop(pass);
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(LABEL),
            color_attachments: &[from_black(&images.rimmed[eye])],
            ..Default::default()
        });
        pass.set_pipeline(&self.rim);
        pass.set_bind_group(0, &by_drawn, &[0]);
        pass.draw(0..3, 0..1);
        drop(pass);
        gpu.queue.submit([encoder.finish()]);
    }

    /// Brings a mesh to the device, unless it is there as it is; where it is kept.
    fn mesh(
        &mut self,
        gpu: &GpuContext,
        scene: &Scene,
        index: usize,
        node: usize,
        deformation: Option<Deformation>,
    ) -> (usize, Option<usize>) {
        let key = (index, deformation.as_ref().map(|_| node));
        let mesh = &scene.meshes[index];
        let known = self.meshes.get(&key);
        if known.is_some_and(|known| {
            known.repainted == mesh.repainted.len() && known.deformation == deformation
        }) {
            return key;
        }
        let positions: Vec<[f32; 3]> = match &deformation {
            Some(deformation) => {
                let deformed = deformation.positions(mesh);
                deformed.iter().map(|at| at.as_vec3().to_array()).collect()
            }
            None => mesh.positions.clone(),
        };
        let mut triangles: Vec<_> = mesh.triangles.iter().collect();
        triangles.sort_by_key(|triangle| triangle.material);
        let mut parts: Vec<(u32, std::ops::Range<u32>)> = Vec::new();
        let mut indices = Vec::with_capacity(3 * triangles.len());
        for triangle in triangles {
            let from = indices.len() as u32;
            indices.extend(triangle.vertices);
            match parts.last_mut() {
                Some((material, range)) if *material == triangle.material => range.end = from + 3,
                _ => parts.push((triangle.material, from..from + 3)),
            }
        }
        let made = MeshOnDevice {
            positions: buffer(
                gpu,
                wgpu::BufferUsages::VERTEX,
                bytemuck::cast_slice(&positions),
            ),
            indices: buffer(
                gpu,
                wgpu::BufferUsages::INDEX,
                bytemuck::cast_slice(&indices),
            ),
            parts,
            repainted: mesh.repainted.len(),
            deformation,
        };
        self.meshes.insert(key, made);
        key
    }
}

/// Mean colour of a material's base colour texture, display values; white without one.
fn mean_color(means: &mut HashMap<u32, [f32; 3]>, scene: &Scene, material: usize) -> [f32; 3] {
    let image = scene
        .materials
        .get(material)
        .and_then(|material| material.base_color_texture.as_ref())
        .and_then(|of| scene.textures.get(of.texture as usize))
        .map(|texture| texture.image);
    let Some(image) = image else {
        return [1.0; 3];
    };
    *means.entry(image).or_insert_with(|| {
        let texels = scene.images.get(image as usize).map(|image| &image.rgba8);
        let texels = texels.map_or(&[][..], Vec::as_slice);
        let step = (texels.len() / 4 / MEAN_OF).max(1);
        let mut sum = [0.0_f32; 3];
        let mut count = 0.0;
        for texel in texels.chunks_exact(4).step_by(step) {
            for (sum, channel) in sum.iter_mut().zip(texel) {
                *sum += f32::from(*channel) / 255.0;
            }
            count += 1.0;
        }
        sum.map(|sum| if count > 0.0 { sum / count } else { 1.0 })
    })
}

impl Images {
    fn new(gpu: &GpuContext, size: [u32; 2]) -> Self {
        use wgpu::TextureUsages as U;
        let color = U::RENDER_ATTACHMENT | U::TEXTURE_BINDING | U::COPY_SRC;
        let image = |format, usage| {
            let descriptor = flat_texture(LABEL, size, format, usage);
            let texture = gpu.device.create_texture(&descriptor);
            texture.create_view(&Default::default())
        };
        Self {
            size,
            drawn: [(); 2].map(|()| image(FORMAT, color)),
            rimmed: [(); 2].map(|()| image(FORMAT, color)),
            depth: image(DEPTH, U::RENDER_ATTACHMENT),
        }
    }
}

/// A texture of four bytes each texel.
fn upload(
    gpu: &GpuContext,
    size: [u32; 2],
    format: wgpu::TextureFormat,
    texels: &[u8],
) -> wgpu::TextureView {
    let texture = gpu.device.create_texture_with_data(
        &gpu.queue,
        &flat_texture(LABEL, size, format, wgpu::TextureUsages::TEXTURE_BINDING),
        TextureDataOrder::default(),
        texels,
    );
    texture.create_view(&Default::default())
}

fn buffer(gpu: &GpuContext, usage: wgpu::BufferUsages, bytes: &[u8]) -> wgpu::Buffer {
    let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(LABEL),
        size: (bytes.len() as u64).max(4),
        usage: usage | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    gpu.queue.write_buffer(&buffer, 0, bytes);
    buffer
}

/// `depth`: whether it is written; none where there is none.
fn pipeline(
    device: &wgpu::Device,
    layout: &wgpu::PipelineLayout,
    module: &wgpu::ShaderModule,
    name: &str,
    depth: Option<bool>,
) -> wgpu::RenderPipeline {
    let positions = [Some(wgpu::VertexBufferLayout {
        array_stride: 12,
        step_mode: wgpu::VertexStepMode::Vertex,
        attributes: &wgpu::vertex_attr_array![0 => Float32x3],
    })];
    let [vertex, fragment] = ["vertex", "fragment"].map(|stage| format!("{name}_{stage}"));
    let target = [Some(FORMAT.into())];
    let mut described = wgpu::RenderPipelineDescriptor {
        depth_stencil: depth.map(|writes| wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(writes),
            depth_compare: Some(if writes {
                wgpu::CompareFunction::Greater
            } else {
                wgpu::CompareFunction::Always
            }),
            stencil: Default::default(),
            bias: Default::default(),
        }),
        ..stages(LABEL, layout, module, [&vertex, &fragment], &target)
    };
    if depth == Some(true) {
        described.vertex.buffers = &positions;
    }
    device.create_render_pipeline(&described)
}
