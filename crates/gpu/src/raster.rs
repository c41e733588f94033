//! Passes over the fragments of one triangle, which write textures of others: a runtime's, a window's.

use super::kernel::{Interface, reflect_bindings};
use super::{GpuContext, GpuError, ShaderFeatures, ShaderLibrary};

/// A colour attachment that begins black.
pub fn from_black(view: &wgpu::TextureView) -> Option<wgpu::RenderPassColorAttachment<'_>> {
    Some(wgpu::RenderPassColorAttachment {
        view,
        depth_slice: None,
        resolve_target: None,
        ops: wgpu::Operations {
            load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
            store: wgpu::StoreOp::Store,
        },
    })
}

/// An attachment of reversed depth that begins infinitely far away.
pub fn from_infinity(
    view: &wgpu::TextureView,
    store: wgpu::StoreOp,
) -> Option<wgpu::RenderPassDepthStencilAttachment<'_>> {
    Some(wgpu::RenderPassDepthStencilAttachment {
        view,
        depth_ops: Some(wgpu::Operations {
            load: wgpu::LoadOp::Clear(0.0),
            store,
        }),
        stencil_ops: None,
    })
}

/// A render pipeline over the fragments of one triangle, its bindings found by name.
pub struct Raster {
    /// What it is bound to.
    pub interface: Interface,
    pipeline: wgpu::RenderPipeline,
}

impl Raster {
    /// Compiles pass `name` with `features` for images of `format`.
    ///
    /// # Errors
    /// [`GpuError`], naming the pass.
    pub fn new(
        context: &GpuContext,
        library: &ShaderLibrary,
        name: &str,
        features: &ShaderFeatures,
        format: wgpu::TextureFormat,
    ) -> Result<Self, GpuError> {
        let shader = library.compile(&format!("passes/{name}"), features)?;
        let bindings = reflect_bindings(&shader)?;
        context.count_made();
        context.guarded(name, || {
            let device = &context.device;
            let (interface, pipeline_layout) =
                Interface::new(context, name, bindings, wgpu::ShaderStages::FRAGMENT);
            let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(name),
                source: wgpu::ShaderSource::Wgsl(shader.wgsl.as_str().into()),
            });
            let is_depth = format.is_depth_stencil_format();
            let color = [Some(wgpu::ColorTargetState::from(format))];
            let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(name),
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
                cache: context.pipeline_cache(),
            });
            Ok(Self {
                interface,
                pipeline,
            })
        })
    }

    /// Records the triangle.
    pub fn draw(&self, pass: &mut wgpu::RenderPass<'_>, bound: &wgpu::BindGroup) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, bound, &[]);
        pass.draw(0..3, 0..1);
    }
}
