//! Draws egui's triangles, see `shaders/viewer/painter.wesl`.
//!
//! Textures are kept by egui-wgpu. Its own shader is not used: it holds a second way to filter textures behind a uniform,
//! which a software adapter computes for every pixel whether it is wanted or not. On llvmpipe that is two thirds of the
//! time from a click to its picture.

use std::collections::HashMap;

use bytemuck::{Pod, Zeroable};
use egui::TextureId;
use egui::epaint::{ClippedPrimitive, Primitive, textures::TextureFilter, textures::TexturesDelta};

use crate::gpu::kernel::layouts;
use crate::gpu::raster::{bind_group, from_black, stages, texture_type};
use crate::gpu::{
    CompiledShader, GpuContext, GpuError, GrowingBuffer, ShaderFeatures, ShaderLibrary,
};

const LABEL: &str = "window";

/// A corner of a triangle on the device.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Corner {
    /// From (-1, -1) at the lower left to (1, 1).
    clip: [f32; 2],
    /// Of the texture, from (0, 0) at the upper left.
    uv: [f32; 2],
    /// Gamma-encoded, premultiplied.
    color: [u8; 4],
}

/// Where a frame is drawn.
pub struct Target<'a> {
    /// All of it, in the painter's format.
    pub view: &'a wgpu::TextureView,
    /// Pixels.
    pub size: [u32; 2],
    /// Pixels per point of egui.
    pub pixels_per_point: f32,
}

/// A pipeline for one format of target, and egui's textures.
pub struct Painter {
    textures: egui_wgpu::Renderer,
    groups: HashMap<TextureId, wgpu::BindGroup>,
    layout: wgpu::BindGroupLayout,
    nearest: wgpu::Sampler,
    linear: wgpu::Sampler,
    pipeline: wgpu::RenderPipeline,
    corners: GrowingBuffer,
    indices: GrowingBuffer,
}

impl Painter {
    /// Compiles the shader for targets of `format`.
    ///
    /// # Errors
    /// [`GpuError`].
    pub fn new(gpu: &GpuContext, format: wgpu::TextureFormat) -> Result<Self, GpuError> {
        let features = ShaderFeatures {
            encodes: format.is_srgb(),
            ..ShaderFeatures::default()
        };
        let shader = ShaderLibrary::embedded().compile("viewer/painter", &features)?;
        gpu.guarded(LABEL, || {
            let device = &gpu.device;
            use wgpu::ShaderStages as S;
            let filter = wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering);
            let bindings = [
                (0, S::FRAGMENT, texture_type(true)),
                (1, S::FRAGMENT, filter),
            ];
            let (layout, pipeline_layout) = layouts(device, LABEL, bindings);
            Ok(Self {
                textures: egui_wgpu::Renderer::new(
                    device,
                    format,
                    egui_wgpu::RendererOptions::default(),
                ),
                groups: HashMap::new(),
                pipeline: pipeline(device, &pipeline_layout, &shader, format),
                layout,
                nearest: sampler(device, wgpu::FilterMode::Nearest),
                linear: sampler(device, wgpu::FilterMode::Linear),
                corners: GrowingBuffer::with_usage(LABEL, wgpu::BufferUsages::VERTEX),
                indices: GrowingBuffer::with_usage(LABEL, wgpu::BufferUsages::INDEX),
            })
        })
    }

    /// Takes the changes of textures that egui reports, then draws and submits `jobs`. Without a target, textures change
    /// all the same: egui reports each change once.
    ///
    /// # Errors
    /// [`GpuError`].
    pub fn paint(
        &mut self,
        gpu: &GpuContext,
        changes: &TexturesDelta,
        jobs: &[ClippedPrimitive],
        target: Option<&Target<'_>>,
    ) -> Result<(), GpuError> {
        gpu.guarded(LABEL, || {
            for (id, deltas) in &changes.set {
                for delta in deltas {
                    self.textures
                        .update_texture(&gpu.device, &gpu.queue, *id, delta);
                }
                self.bind(&gpu.device, *id);
            }
            if let Some(target) = target {
                self.draw(gpu, jobs, target)?;
            }
            for id in &changes.free {
                self.groups.remove(id);
                self.textures.free_texture(id);
            }
            Ok(())
        })
    }

    /// Binds a texture anew: a change of its size has made another.
    fn bind(&mut self, device: &wgpu::Device, id: TextureId) {
        let Some(kept) = self.textures.texture(&id) else {
            return;
        };
        let Some(texture) = &kept.texture else {
            return;
        };
        let sampler = match kept.options.map(|options| options.magnification) {
            Some(TextureFilter::Nearest) => &self.nearest,
            _ => &self.linear,
        };
        let view = texture.create_view(&Default::default());
        let group = self.group(device, &view, sampler);
        self.groups.insert(id, group);
    }

    /// Shows `view` where egui asks for the texture `id`, which is none of its own.
    pub fn bind_view(&mut self, device: &wgpu::Device, id: TextureId, view: &wgpu::TextureView) {
        let group = self.group(device, view, &self.linear);
        self.groups.insert(id, group);
    }

    fn group(
        &self,
        device: &wgpu::Device,
        view: &wgpu::TextureView,
        sampler: &wgpu::Sampler,
    ) -> wgpu::BindGroup {
        let resources = [
            wgpu::BindingResource::TextureView(view),
            wgpu::BindingResource::Sampler(sampler),
        ];
        bind_group(device, LABEL, &self.layout, resources)
    }

    fn draw(
        &mut self,
        gpu: &GpuContext,
        jobs: &[ClippedPrimitive],
        target: &Target<'_>,
    ) -> Result<(), GpuError> {
        let points = target
            .size
            .map(|edge| edge as f32 / target.pixels_per_point);
        let (mut corners, mut indices) = (Vec::new(), Vec::new());
        let mut ranges = Vec::with_capacity(jobs.len());
        for job in jobs {
            // The viewer draws nothing by callbacks.
            if let Primitive::Mesh(mesh) = &job.primitive
                && let Some(group) = self.groups.get(&mesh.texture_id)
                && let Some(scissor) = scissor(job.clip_rect, target)
            {
                let (first, base) = (indices.len() as u32, corners.len() as i32);
                indices.extend_from_slice(&mesh.indices);
                corners.extend(mesh.vertices.iter().map(|vertex| Corner {
                    clip: [
                        2.0 * vertex.pos.x / points[0] - 1.0,
                        1.0 - 2.0 * vertex.pos.y / points[1],
                    ],
                    uv: vertex.uv.into(),
                    color: vertex.color.to_array(),
                }));
                ranges.push((first..indices.len() as u32, base, group, scissor));
            }
        }
        self.corners.upload(gpu, &corners)?;
        self.indices.upload(gpu, &indices)?;
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(LABEL),
            color_attachments: &[from_black(target.view)],
            ..Default::default()
        });
        if let (Some(corners), Some(indices)) = (self.corners.buffer(), self.indices.buffer()) {
            pass.set_pipeline(&self.pipeline);
            pass.set_vertex_buffer(0, corners.slice(..));
            pass.set_index_buffer(indices.slice(..), wgpu::IndexFormat::Uint32);
        }
        for (range, base, group, [x, y, width, height]) in ranges {
            pass.set_scissor_rect(x, y, width, height);
            pass.set_bind_group(0, group, &[]);
            pass.draw_indexed(range, base, 0..1);
        }
        drop(pass);
        gpu.queue.submit([encoder.finish()]);
        Ok(())
    }
}

/// What a texture is read by.
pub fn sampler(device: &wgpu::Device, filter: wgpu::FilterMode) -> wgpu::Sampler {
    device.create_sampler(&wgpu::SamplerDescriptor {
        label: Some(LABEL),
        mag_filter: filter,
        min_filter: filter,
        ..Default::default()
    })
}

fn pipeline(
    device: &wgpu::Device,
    layout: &wgpu::PipelineLayout,
    shader: &CompiledShader,
    format: wgpu::TextureFormat,
) -> wgpu::RenderPipeline {
    let module = device.create_shader_module(shader.descriptor(LABEL));
    let corners = [Some(wgpu::VertexBufferLayout {
        array_stride: size_of::<Corner>() as u64,
        step_mode: wgpu::VertexStepMode::Vertex,
        attributes: &wgpu::vertex_attr_array![0 => Float32x2, 1 => Float32x2, 2 => Unorm8x4],
    })];
    let target = [Some(wgpu::ColorTargetState {
        format,
        blend: Some(wgpu::BlendState::PREMULTIPLIED_ALPHA_BLENDING),
        write_mask: wgpu::ColorWrites::ALL,
    })];
    let main = ["vertex_main", "fragment_main"];
    let mut described = stages(LABEL, layout, &module, main, &target);
    described.vertex.buffers = &corners;
    device.create_render_pipeline(&described)
}

/// Left, top, width and height in pixels of the part of the target in which a job may draw; none if there is none.
fn scissor(clip: egui::Rect, target: &Target<'_>) -> Option<[u32; 4]> {
    let [width, height] = target.size;
    // `as` takes what lies left of or above the target to 0.
    let pixel =
        |points: f32, most: u32| ((points * target.pixels_per_point).round() as u32).min(most);
    let (left, right) = (pixel(clip.min.x, width), pixel(clip.max.x, width));
    let (top, bottom) = (pixel(clip.min.y, height), pixel(clip.max.y, height));
    (left < right && top < bottom).then(|| [left, top, right - left, bottom - top])
}
