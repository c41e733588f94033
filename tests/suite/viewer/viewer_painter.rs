//! The viewer's painter against egui-wgpu's: the same picture from a shader with less in it.

use egui::{Color32, ColorImage, Context, RawInput, Rect, TextureOptions, pos2, vec2};
use stereolux::gpu::GpuContext;
use stereolux::viewer::painter::{Painter, Target};

use super::textures::{bytes, target_texture};
use crate::suite::support::adapter_name;

const SIZE: [u32; 2] = [192, 128];
const PIXELS_PER_POINT: f32 = 1.25;

/// What both painters are given: text, rounded and translucent shapes, a picture that is clipped and enlarged, and in the
/// second pass a part of that picture changed.
struct Interface {
    egui: Context,
    picture: Option<egui::TextureHandle>,
}

impl Interface {
    fn pass(&mut self, color: Color32) -> egui::FullOutput {
        let size = vec2(SIZE[0] as f32, SIZE[1] as f32) / PIXELS_PER_POINT;
        let mut input = RawInput {
            screen_rect: Some(Rect::from_min_size(pos2(0.0, 0.0), size)),
            ..RawInput::default()
        };
        input
            .viewports
            .entry(egui::ViewportId::ROOT)
            .or_default()
            .native_pixels_per_point = Some(PIXELS_PER_POINT);
        let picture = &mut self.picture;
        self.egui.run_ui(input, |ui| {
            let part = ColorImage::new([3, 2], vec![color; 6]);
            match picture {
                Some(picture) => picture.set_partial([2, 1], part, TextureOptions::LINEAR),
                None => {
                    let ramp = (0..64_u8).map(|i| Color32::from_rgb(4 * i, 255 - 3 * i, 90));
                    let image = ColorImage::new([8, 8], ramp.collect());
                    let options = TextureOptions::LINEAR;
                    *picture = Some(ui.ctx().load_texture("ramp", image, options));
                }
            }
            ui.painter()
                .rect_filled(ui.max_rect(), 0.0, Color32::from_gray(30));
            ui.heading("Photons 1,234");
            let _ = ui.button("Trace");
            let id = picture.as_ref().unwrap().id();
            let at = Rect::from_min_size(pos2(70.0, 50.0), vec2(120.0, 45.0));
            let clip = Rect::from_min_max(pos2(80.0, 40.0), pos2(140.0, 200.0));
            let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
            ui.painter()
                .with_clip_rect(clip)
                .image(id, at, whole, Color32::WHITE);
            let veil = Color32::from_rgba_unmultiplied(40, 200, 90, 120);
            ui.painter()
                .circle_filled(pos2(100.0, 60.0), 25.0, veil.gamma_multiply(0.7));
        })
    }
}

/// Draws two passes by egui-wgpu.
fn by_library(gpu: &GpuContext, format: wgpu::TextureFormat, color: Color32) -> Vec<u8> {
    let mut interface = Interface {
        egui: Context::default(),
        picture: None,
    };
    let options = egui_wgpu::RendererOptions {
        dithering: false,
        ..Default::default()
    };
    let mut painter = egui_wgpu::Renderer::new(&gpu.device, format, options);
    let view = target_texture(gpu, SIZE, format);
    for _ in 0..2 {
        let output = interface.pass(color);
        for (id, deltas) in &output.textures_delta.set {
            for delta in deltas {
                painter.update_texture(&gpu.device, &gpu.queue, *id, delta);
            }
        }
        let jobs = interface
            .egui
            .tessellate(output.shapes, output.pixels_per_point);
        let screen = egui_wgpu::ScreenDescriptor {
            size_in_pixels: SIZE,
            pixels_per_point: output.pixels_per_point,
        };
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        painter.update_buffers(&gpu.device, &gpu.queue, &mut encoder, &jobs, &screen);
        let pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations::default(),
            })],
            ..Default::default()
        });
        painter.render(&mut pass.forget_lifetime(), &jobs, &screen);
        gpu.queue.submit([encoder.finish()]);
    }
    bytes(gpu, &view, 4)
}

/// Draws two passes by the viewer's painter.
fn by_painter(gpu: &GpuContext, format: wgpu::TextureFormat, color: Color32) -> Vec<u8> {
    let mut interface = Interface {
        egui: Context::default(),
        picture: None,
    };
    let mut painter = Painter::new(gpu, format).unwrap();
    let view = target_texture(gpu, SIZE, format);
    for pass in 0..3 {
        let output = interface.pass(color);
        let jobs = interface
            .egui
            .tessellate(output.shapes, output.pixels_per_point);
        let target = Target {
            view: &view,
            size: SIZE,
            pixels_per_point: output.pixels_per_point,
        };
        // A window that is hidden takes the change of the second pass and draws nothing.
        let target = (pass != 1).then_some(&target);
        painter
            .paint(gpu, &output.textures_delta, &jobs, target)
            .unwrap();
    }
    bytes(gpu, &view, 4)
}

fn furthest(one: &[u8], other: &[u8]) -> u8 {
    let differences = one.iter().zip(other).map(|(a, b)| a.abs_diff(*b));
    differences.max().unwrap()
}

#[test]
fn the_painter_draws_what_egui_wgpu_draws() {
    let gpu = GpuContext::open(Some(adapter_name())).unwrap();
    for format in [
        wgpu::TextureFormat::Rgba8Unorm,
        wgpu::TextureFormat::Rgba8UnormSrgb,
    ] {
        let expected = by_library(&gpu, format, Color32::from_rgb(250, 10, 10));
        let painted = by_painter(&gpu, format, Color32::from_rgb(250, 10, 10));
        // Both compute the same in f32; corners are scaled on the host in place of the shader, whose rounding may take a
        // value over the border between two of the 256 levels.
        assert!(furthest(&expected, &painted) <= 1, "{format:?}");
        // Another colour in the picture's changed part is seen.
        let other = by_painter(&gpu, format, Color32::from_rgb(250, 40, 10));
        assert!(furthest(&expected, &other) > 10, "{format:?}");
    }
}
