//! Hands both eyes' images to a runtime: one triangle per image, from the renderer's buffers straight into the
//! runtime's texture.

use crate::gpu::{GpuContext, GpuError, Resources, ShaderFeatures, ShaderLibrary, uniform_buffer};
use crate::renderer::records::submit::Submit;
use crate::xr::RuntimeTargets;

use crate::frame::plan::present;
use crate::frame::run::specialised;
use crate::frame::{FrameRun, Step, passes};
use crate::gpu::raster::{Raster, from_black, from_infinity};
use crate::settings::RenderSettings;

/// How the values of an image become display light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ShownLight {
    /// Factor before the tone curve.
    pub(super) scale: f32,
    /// Tone curve, by its number in the shaders.
    pub(super) tone: u32,
    /// Which of two buffers holds the last frame, where two take turns.
    pub(super) parity: usize,
}

/// One eye's bound passes.
struct BoundEye {
    uniform: wgpu::Buffer,
    /// By parity of the frame.
    color: [wgpu::BindGroup; 2],
    depth: Option<[wgpu::BindGroup; 2]>,
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
    pub(super) fn new(
        context: &GpuContext,
        library: &ShaderLibrary,
        frame: &mut FrameRun,
        given: &Resources<'_>,
        settings: &RenderSettings,
        targets: &RuntimeTargets,
    ) -> Result<Self, GpuError> {
        let formats = formats_of(targets);
        let [name, depth_name] = [&passes::xr_submit.name, &passes::xr_submit_depth.name];
        let features = specialised(&passes::xr_submit, frame.features(), false);
        let color = Raster::new(context, library, name, &features, formats.0)?;
        let deepening = ShaderFeatures {
            of_seen: settings.reconstruct.is_on(),
            ..features
        };
        let depth = formats
            .1
            .map(|format| Raster::new(context, library, depth_name, &deepening, format))
            .transpose()?;
        let steps = present(settings, &[&passes::xr_submit, &passes::xr_submit_depth]).steps;
        let mut bound = |[shows, deepens]: [&Step; 2]| {
            let uniform = uniform_buffer(context, name, size_of::<Submit>() as u64);
            let given = given.clone().with("submission", &uniform);
            let color = frame.bind_raster(context, &color, shows, &given)?;
            let depth = depth
                .as_ref()
                .map(|depth| frame.bind_raster(context, depth, deepens, &given))
                .transpose()?;
            Ok::<_, GpuError>(BoundEye {
                color,
                depth,
                uniform: uniform.clone(),
            })
        };
        Ok(Self {
            eyes: [
                bound([&steps[0], &steps[1]])?,
                bound([&steps[2], &steps[3]])?,
            ],
            color,
            depth,
            formats,
        })
    }

    /// Whether textures like these can be written.
    pub fn fits(&self, targets: &RuntimeTargets) -> bool {
        formats_of(targets) == self.formats
    }

    /// Records and submits both eyes, each into the upper left `width` x `height` pixels of its textures; does not wait for
    /// the device.
    ///
    /// # Errors
    /// [`GpuError`].
    pub(super) fn submit(
        &self,
        context: &GpuContext,
        targets: &RuntimeTargets,
        [width, height]: [u32; 2],
        light: ShownLight,
    ) -> Result<(), GpuError> {
        context.guarded(&passes::xr_submit.name, || {
            let mut encoder = context.encoder(&passes::xr_submit.name);
            for (index, eye) in self.eyes.iter().enumerate() {
                let uniform = Submit {
                    scale: light.scale,
                    near_m: targets.near_m,
                    eye: index as u32,
                    tone: light.tone,
                };
                context
                    .queue
                    .write_buffer(&eye.uniform, 0, bytemuck::bytes_of(&uniform));
                let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                    label: Some(&passes::xr_submit.name),
                    color_attachments: &[from_black(&targets.color[index])],
                    ..Default::default()
                });
                pass.set_scissor_rect(0, 0, width, height);
                self.color.draw(&mut pass, &eye.color[light.parity]);
                drop(pass);
                let (Some(depth), Some(bound), Some(views)) =
                    (&self.depth, &eye.depth, &targets.depth)
                else {
                    continue;
                };
                let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                    label: Some(&passes::xr_submit_depth.name),
                    depth_stencil_attachment: from_infinity(&views[index], wgpu::StoreOp::Store),
                    ..Default::default()
                });
                pass.set_scissor_rect(0, 0, width, height);
                depth.draw(&mut pass, &bound[light.parity]);
            }
            context.submit(encoder.finish());
            Ok(())
        })
    }
}
