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

/// A texture of numbers as fragments read it.
#[must_use]
pub fn texture_type(filterable: bool) -> wgpu::BindingType {
    wgpu::BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Float { filterable },
        view_dimension: wgpu::TextureViewDimension::D2,
        multisampled: false,
    }
}

/// A group of resources at bindings 0, 1 and so on.
#[must_use]
pub fn bind_group<'a>(
    device: &wgpu::Device,
    label: &str,
    layout: &wgpu::BindGroupLayout,
    resources: impl IntoIterator<Item = wgpu::BindingResource<'a>>,
) -> wgpu::BindGroup {
    let resources = (0..).zip(resources);
    let entries = resources.map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource });
    device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some(label),
        layout,
        entries: &entries.collect::<Vec<_>>(),
    })
}

/// A pipeline of two stages that reads no vertices, knows no depth and is not kept; what is otherwise is put in.
#[must_use]
pub fn stages<'a>(
    label: &'a str,
    layout: &'a wgpu::PipelineLayout,
    module: &'a wgpu::ShaderModule,
    [vertex, fragment]: [&'a str; 2],
    targets: &'a [Option<wgpu::ColorTargetState>],
) -> wgpu::RenderPipelineDescriptor<'a> {
    wgpu::RenderPipelineDescriptor {
        label: Some(label),
        layout: Some(layout),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some(vertex),
            compilation_options: Default::default(),
            buffers: &[],
        },
        primitive: Default::default(),
        depth_stencil: None,
        multisample: Default::default(),
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some(fragment),
            compilation_options: Default::default(),
            targets,
        }),
        multiview_mask: None,
        cache: None,
    }
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
            let module = device.create_shader_module(shader.descriptor(name));
            let is_depth = format.is_depth_stencil_format();
            let color = [Some(wgpu::ColorTargetState::from(format))];
            let targets: &[_] = if is_depth { &[] } else { &color };
            let main = ["vertex_main", "fragment_main"];
            let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                depth_stencil: is_depth.then_some(wgpu::DepthStencilState {
                    format,
                    depth_write_enabled: Some(true),
                    depth_compare: Some(wgpu::CompareFunction::Always),
                    stencil: wgpu::StencilState::default(),
                    bias: wgpu::DepthBiasState::default(),
                }),
                cache: context.pipeline_cache(),
                ..stages(name, &pipeline_layout, &module, main, targets)
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
