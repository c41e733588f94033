//! Shows both eyes' images side by side in a window, from the renderer's buffers straight into the window's texture.

use crate::gpu::{GpuContext, GpuError, Resources, ShaderFeatures, ShaderLibrary, uniform_buffer};
use crate::renderer::records::mirror::Mirror;

use super::submit::ShownLight;
use crate::frame::plan::present;
use crate::frame::{FrameRun, Step, passes};
use crate::gpu::raster::{Raster, from_black};
use crate::settings::RenderSettings;

/// Where an eye's image lies in the window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rectangle {
    /// Left edge, pixels.
    pub x: u32,
    /// Upper edge, pixels.
    pub y: u32,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
}

/// Rectangles of the left and the right eye in a window of `window` pixels: side by side about its middle, as large as
/// fits, square pixels kept square. `None` where the window has no room.
#[must_use]
pub fn rectangles(window: [u32; 2], image: [u32; 2]) -> Option<[Rectangle; 2]> {
    let half = window[0] / 2;
    if half == 0 || window[1] == 0 || image.contains(&0) {
        return None;
    }
    let enlarged =
        (f64::from(half) / f64::from(image[0])).min(f64::from(window[1]) / f64::from(image[1]));
    let side =
        |pixels: u32, most: u32| ((f64::from(pixels) * enlarged).round() as u32).clamp(1, most);
    let (width, height) = (side(image[0], half), side(image[1], window[1]));
    let y = (window[1] - height) / 2;
    Some([half - width, half].map(|x| Rectangle {
        x,
        y,
        width,
        height,
    }))
}

/// One eye's bound pass.
struct BoundEye {
    uniform: wgpu::Buffer,
    /// By parity of the frame.
    bound: [wgpu::BindGroup; 2],
}

/// The pass that draws into windows of one format.
pub(super) struct MirrorPass {
    raster: Raster,
    eyes: [BoundEye; 2],
    format: wgpu::TextureFormat,
}

impl MirrorPass {
    /// Compiles the pass and binds both eyes' buffers.
    ///
    /// # Errors
    /// [`GpuError`], naming the pass.
    pub(super) fn new(
        context: &GpuContext,
        library: &ShaderLibrary,
        frame: &mut FrameRun,
        given: &Resources<'_>,
        settings: &RenderSettings,
        format: wgpu::TextureFormat,
    ) -> Result<Self, GpuError> {
        let name = &passes::mirror.name;
        let raster = Raster::new(context, library, name, &ShaderFeatures::default(), format)?;
        let steps = present(settings, &[&passes::mirror]).steps;
        let mut bound = |step: &Step| {
            let uniform = uniform_buffer(context, name, size_of::<Mirror>() as u64);
            let given = given.clone().with("mirror", &uniform);
            Ok::<_, GpuError>(BoundEye {
                bound: frame.bind_raster(context, &raster, step, &given)?,
                uniform: uniform.clone(),
            })
        };
        Ok(Self {
            eyes: [bound(&steps[0])?, bound(&steps[1])?],
            raster,
            format,
        })
    }

    /// Format of the windows that it draws into.
    pub(super) fn format(&self) -> wgpu::TextureFormat {
        self.format
    }

    /// Records and submits both eyes' pictures over black; does not wait for the device.
    ///
    /// # Errors
    /// [`GpuError`].
    pub(super) fn draw(
        &self,
        context: &GpuContext,
        view: &wgpu::TextureView,
        image: [u32; 2],
        light: ShownLight,
    ) -> Result<(), GpuError> {
        let size = view.texture().size();
        let places = rectangles([size.width, size.height], image);
        context.guarded(&passes::mirror.name, || {
            let mut encoder = context.encoder(&passes::mirror.name);
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some(&passes::mirror.name),
                color_attachments: &[from_black(view)],
                ..Default::default()
            });
            for (eye, place) in self.eyes.iter().zip(places.iter().flatten()) {
                let uniform = Mirror {
                    corner: [place.x as f32, place.y as f32],
                    scale: image[0] as f32 / place.width as f32,
                    light_scale: light.scale,
                    encode: u32::from(!self.format.is_srgb()),
                    tone: light.tone,
                    unused_0: 0,
                    unused_1: 0,
                };
                context
                    .queue
                    .write_buffer(&eye.uniform, 0, bytemuck::bytes_of(&uniform));
                pass.set_scissor_rect(place.x, place.y, place.width, place.height);
                self.raster.draw(&mut pass, &eye.bound[light.parity]);
            }
            drop(pass);
            context.submit(encoder.finish());
            Ok(())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_fill_the_window_and_keep_their_shape() {
        let place = |x, y, width, height| Rectangle {
            x,
            y,
            width,
            height,
        };
        // As wide as the window.
        assert_eq!(
            rectangles([1280, 720], [64, 48]),
            Some([place(0, 120, 640, 480), place(640, 120, 640, 480)])
        );
        // As high as the window, shrunk, about its middle.
        assert_eq!(
            rectangles([1000, 300], [1200, 1000]),
            Some([place(140, 0, 360, 300), place(500, 0, 360, 300)])
        );
        // An odd column stays black.
        assert_eq!(
            rectangles([7, 3], [3, 3]),
            Some([place(0, 0, 3, 3), place(3, 0, 3, 3)])
        );
        // Never less than a pixel, never outside.
        assert_eq!(
            rectangles([2, 1], [1, 4000]),
            Some([place(0, 0, 1, 1), place(1, 0, 1, 1)])
        );
        assert_eq!(rectangles([1, 500], [8, 8]), None);
        assert_eq!(rectangles([500, 0], [8, 8]), None);
    }
}
