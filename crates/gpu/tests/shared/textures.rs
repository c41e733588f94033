//! Textures that stand in for a runtime's or a window's, and what was drawn into them.

use stereolux_gpu::GpuContext;
use stereolux_gpu::buffers::flat_texture;

/// A texture that stands in for a runtime's or a window's.
pub fn target_texture(
    context: &GpuContext,
    size: [u32; 2],
    format: wgpu::TextureFormat,
) -> wgpu::TextureView {
    let usage = wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC;
    let descriptor = flat_texture("stands in for another's", size, format, usage);
    let texture = context.device.create_texture(&descriptor);
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

/// The texture's bytes, rows from the top without padding.
pub fn bytes(context: &GpuContext, view: &wgpu::TextureView, texel: u32) -> Vec<u8> {
    let size = view.texture().size();
    let row = size.width * texel;
    let padded = row.next_multiple_of(256);
    let buffer = context.device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: u64::from(padded * size.height),
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let mut encoder = context
        .device
        .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_texture_to_buffer(
        view.texture().as_image_copy(),
        wgpu::TexelCopyBufferInfo {
            buffer: &buffer,
            layout: wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(padded),
                rows_per_image: None,
            },
        },
        view.texture().size(),
    );
    context.queue.submit([encoder.finish()]);
    buffer.map_async(wgpu::MapMode::Read, .., |result| result.unwrap());
    context.wait("read-back").unwrap();
    let mapped = buffer.slice(..).get_mapped_range().unwrap();
    mapped
        .chunks_exact(padded as usize)
        .flat_map(|padded| padded[..row as usize].to_vec())
        .collect()
}
