//! Passes over the fragments of one triangle, which write textures of others: a runtime's, a window's.

use wgpu::util::DeviceExt as _;

use crate::gpu::kernel::{layout_entries, reflect_bindings};
use crate::gpu::{GpuContext, GpuError, Resources, ShaderFeatures, ShaderLibrary};
use crate::passes::Pass;

use super::eyes::{Eye, Eyes};
use super::kernels::shader_name;
use super::reconstruction::Reconstruction;

/// A uniform of `bytes` zeroes for one eye's run of `pass`.
pub(super) fn eye_uniform(context: &GpuContext, pass: &Pass, bytes: usize) -> wgpu::Buffer {
    context
        .device
        .create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some(pass.name),
            contents: &vec![0; bytes],
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
        })
}

/// The images that passes show: what the eyes' passes left, or what was reconstructed from it.
#[derive(Clone, Copy)]
pub(super) struct Shown<'a> {
    pub(super) eyes: &'a Eyes,
    pub(super) reconstruction: Option<&'a Reconstruction>,
    pub(super) frame_uniform: &'a wgpu::Buffer,
}

/// How the values of an image become display light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ShownLight {
    /// Factor before the filmic curve.
    pub(super) scale: f32,
    /// 1 if they are display light already.
    pub(super) is_display: u32,
    /// Which of the two bindings holds the last frame.
    pub(super) turn: usize,
}

impl<'a> Shown<'a> {
    /// What `pass` reads of an eye's image after frames of either turn.
    ///
    /// # Errors
    /// [`GpuError::Unbound`] if the eye is not rendered.
    pub(super) fn resources(&self, eye: Eye, pass: &Pass) -> Result<[Resources<'a>; 2], GpuError> {
        let finished = self.eyes.finished(eye).ok_or_else(|| GpuError::Unbound {
            pass: pass.name.to_owned(),
            binding: format!("{} eye", eye.name()),
        })?;
        let finished = finished.with("frame", self.frame_uniform);
        let light = self
            .reconstruction
            .and_then(|reconstruction| reconstruction.shown(eye))
            .or_else(|| self.eyes.radiance_sum(eye).map(|sum| [sum; 2]));
        Ok(match light {
            Some(light) => light.map(|light| finished.clone().with("shown_light", light)),
            None => [finished.clone(), finished],
        })
    }

    /// What its values are, for frames of `spp` samples.
    pub(super) fn light(&self, exposure: f64, spp: u32) -> ShownLight {
        match self.reconstruction {
            Some(reconstruction) => ShownLight {
                scale: exposure as f32,
                is_display: u32::from(reconstruction.plan().taa),
                turn: reconstruction.turn(),
            },
            None => ShownLight {
                scale: (exposure / f64::from(spp.max(1))) as f32,
                is_display: 0,
                turn: 0,
            },
        }
    }
}

/// A render pipeline over the fragments of one triangle, its bindings found by name.
pub(super) struct Raster {
    pass: &'static Pass,
    pipeline: wgpu::RenderPipeline,
    layout: wgpu::BindGroupLayout,
    bindings: Vec<(String, u32)>,
}

impl Raster {
    /// Compiles `pass` for images of `format`.
    ///
    /// # Errors
    /// [`GpuError`], naming the pass.
    pub(super) fn new(
        context: &GpuContext,
        library: &ShaderLibrary,
        pass: &'static Pass,
        format: wgpu::TextureFormat,
    ) -> Result<Self, GpuError> {
        let shader = library.compile(&shader_name(pass), &ShaderFeatures::default())?;
        let bindings = reflect_bindings(&shader)?;
        context.guarded(pass.name, || {
            let device = &context.device;
            let entries = layout_entries(&bindings, wgpu::ShaderStages::FRAGMENT);
            let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                label: Some(pass.name),
                entries: &entries,
            });
            let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(pass.name),
                bind_group_layouts: &[Some(&layout)],
                immediate_size: 0,
            });
            let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(pass.name),
                source: wgpu::ShaderSource::Wgsl(shader.wgsl.as_str().into()),
            });
            let is_depth = format.is_depth_stencil_format();
            let color = [Some(wgpu::ColorTargetState::from(format))];
            let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(pass.name),
                layout: Some(&pipeline_layout),
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some("vertex_main"),
                    compilation_options: wgpu::PipelineCompilationOptions::default(),
                    buffers: &[],
                },
                primitive: wgpu::PrimitiveState::default(),
                depth_stencil: is_depth.then_some(wgpu::DepthStencilState {
                    format,
                    depth_write_enabled: Some(true),
                    depth_compare: Some(wgpu::CompareFunction::Always),
                    stencil: wgpu::StencilState::default(),
                    bias: wgpu::DepthBiasState::default(),
                }),
                multisample: wgpu::MultisampleState::default(),
                fragment: Some(wgpu::FragmentState {
                    module: &module,
                    entry_point: Some("fragment_main"),
                    compilation_options: wgpu::PipelineCompilationOptions::default(),
                    targets: if is_depth { &[] } else { &color },
                }),
                multiview_mask: None,
                cache: None,
            });
            Ok(Self {
                pass,
                pipeline,
                layout,
                bindings: bindings
                    .iter()
                    .map(|binding| (binding.name.clone(), binding.slot))
                    .collect(),
            })
        })
    }

    /// Binds what the pass reads.
    ///
    /// # Errors
    /// [`GpuError::Unbound`], [`GpuError::Validation`].
    pub(super) fn bind(
        &self,
        context: &GpuContext,
        resources: &Resources<'_>,
    ) -> Result<wgpu::BindGroup, GpuError> {
        let entries = self
            .bindings
            .iter()
            .map(|(name, slot)| {
                resources
                    .get(name)
                    .map(|resource| wgpu::BindGroupEntry {
                        binding: *slot,
                        resource,
                    })
                    .ok_or_else(|| GpuError::Unbound {
                        pass: self.pass.name.to_owned(),
                        binding: name.clone(),
                    })
            })
            .collect::<Result<Vec<_>, _>>()?;
        context.guarded(self.pass.name, || {
            Ok(context
                .device
                .create_bind_group(&wgpu::BindGroupDescriptor {
                    label: Some(self.pass.name),
                    layout: &self.layout,
                    entries: &entries,
                }))
        })
    }

    /// Records the triangle.
    pub(super) fn draw(&self, pass: &mut wgpu::RenderPass<'_>, bound: &wgpu::BindGroup) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, bound, &[]);
        pass.draw(0..3, 0..1);
    }
}
