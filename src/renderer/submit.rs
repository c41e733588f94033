//! Hands both eyes' images to a runtime: one triangle per image, from the renderer's buffers straight into the
//! runtime's texture.

use crate::gpu::types::submit::Submit;
use crate::gpu::{GpuContext, GpuError, ShaderLibrary};
use crate::passes;
use crate::xr::RuntimeTargets;

use super::eyes::{Eye, Eyes};
use super::raster::{Raster, eye_resources, eye_uniform};

/// One eye's bound passes.
struct BoundEye {
    uniform: wgpu::Buffer,
    color: wgpu::BindGroup,
    depth: Option<wgpu::BindGroup>,
}

/// The passes that hand images over, for one kind of texture.
pub struct Submitter {
    color: Raster,
    depth: Option<Raster>,
    eyes: [BoundEye; 2],
    formats: (wgpu::TextureFormat, Option<wgpu::TextureFormat>),
}

/// Formats of the textures in `targets`.
fn formats_of(targets: &RuntimeTargets) -> (wgpu::TextureFormat, Option<wgpu::TextureFormat>) {
    (
        targets.color[0].texture().format(),
        targets
            .depth
            .as_ref()
            .map(|[left, _]| left.texture().format()),
    )
}

impl Submitter {
    /// Compiles the passes for the formats of `targets` and binds both eyes' buffers.
    ///
    /// # Errors
    /// [`GpuError`], naming the pass.
    pub fn new(
        context: &GpuContext,
        library: &ShaderLibrary,
        eyes: &Eyes,
        frame_uniform: &wgpu::Buffer,
        targets: &RuntimeTargets,
    ) -> Result<Self, GpuError> {
        let formats = formats_of(targets);
        let color = Raster::new(context, library, &passes::xr_submit::PASS, formats.0)?;
        let depth = formats
            .1
            .map(|format| Raster::new(context, library, &passes::xr_submit_depth::PASS, format))
            .transpose()?;
        let bound = |eye: Eye| {
            let pass = &passes::xr_submit::PASS;
            let uniform = eye_uniform(context, pass, size_of::<Submit>());
            let resources =
                eye_resources(eyes, eye, pass, frame_uniform)?.with("submission", &uniform);
            let color = color.bind(context, &resources)?;
            let depth = depth
                .as_ref()
                .map(|depth| depth.bind(context, &resources))
                .transpose()?;
            Ok::<_, GpuError>(BoundEye {
                color,
                depth,
                uniform: uniform.clone(),
            })
        };
        Ok(Self {
            eyes: [bound(Eye::Left)?, bound(Eye::Right)?],
            color,
            depth,
            formats,
        })
    }

    /// Whether textures like these can be written.
    pub fn fits(&self, targets: &RuntimeTargets) -> bool {
        formats_of(targets) == self.formats
    }

    /// Records and submits both eyes; does not wait for the device.
    ///
    /// # Errors
    /// [`GpuError`].
    pub fn submit(
        &self,
        context: &GpuContext,
        targets: &RuntimeTargets,
        exposure: f32,
        reuse: bool,
    ) -> Result<(), GpuError> {
        context.guarded(passes::xr_submit::PASS.name, || {
            let mut encoder =
                context
                    .device
                    .create_command_encoder(&wgpu::CommandEncoderDescriptor {
                        label: Some(passes::xr_submit::PASS.name),
                    });
            for (index, eye) in self.eyes.iter().enumerate() {
                let uniform = Submit {
                    exposure,
                    near_m: targets.near_m,
                    eye: index as u32,
                    reuse: u32::from(reuse),
                };
                context
                    .queue
                    .write_buffer(&eye.uniform, 0, bytemuck::bytes_of(&uniform));
                let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                    label: Some(passes::xr_submit::PASS.name),
                    color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                        view: &targets.color[index],
                        depth_slice: None,
                        resolve_target: None,
                        ops: wgpu::Operations {
                            load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                            store: wgpu::StoreOp::Store,
                        },
                    })],
                    ..Default::default()
                });
                self.color.draw(&mut pass, &eye.color);
                drop(pass);
                let (Some(depth), Some(bound), Some(views)) =
                    (&self.depth, &eye.depth, &targets.depth)
                else {
                    continue;
                };
                let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                    label: Some(passes::xr_submit_depth::PASS.name),
                    depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                        view: &views[index],
                        depth_ops: Some(wgpu::Operations {
                            load: wgpu::LoadOp::Clear(0.0),
                            store: wgpu::StoreOp::Store,
                        }),
                        stencil_ops: None,
                    }),
                    ..Default::default()
                });
                depth.draw(&mut pass, bound);
            }
            context.queue.submit([encoder.finish()]);
            Ok(())
        })
    }
}
