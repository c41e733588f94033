//! Copies of storage buffers in textures of 16 bytes a texel, for adapters that read textures faster.
//!
//! llvmpipe reads storage buffers one word and one thread at a time, each through memory that it has just written
//! otherwise, which stalls; whole texels it reads at once.

use std::ops::Range;

use super::buffers::flat_texture;
use super::context::{GpuContext, GpuError};

/// Texels of a row. The shaders hold its logarithm, `ROW_SHIFT` in `shaders/shared/records.wesl`; a test compares them.
pub const ROW_TEXELS: u32 = 4096;
/// Bytes of a texel: four words.
pub const TEXEL_BYTES: u64 = 16;
const ROW_BYTES: u64 = ROW_TEXELS as u64 * TEXEL_BYTES;

/// A texture that holds what a buffer holds.
pub struct TexelCopy {
    label: &'static str,
    texture: Option<(wgpu::Texture, wgpu::TextureView)>,
}

impl TexelCopy {
    /// Nothing allocated yet.
    pub const fn new(label: &'static str) -> Self {
        Self {
            label,
            texture: None,
        }
    }

    /// Makes room for what a buffer of `bytes` bytes holds: true if the texture is another one now, so that all must be
    /// copied and it must be bound again.
    ///
    /// # Errors
    /// [`GpuError::Validation`], where the texture does not fit.
    pub fn fit(&mut self, context: &GpuContext, bytes: u64) -> Result<bool, GpuError> {
        let rows = rows_for(bytes, context.device.limits().max_texture_dimension_2d);
        let fits = |(texture, _): &(wgpu::Texture, _)| texture.height() == rows;
        if self.texture.as_ref().is_some_and(fits) {
            return Ok(false);
        }
        context.count_made();
        let texture = context.guarded(self.label, || {
            let usage = wgpu::TextureUsages::STORAGE_BINDING | wgpu::TextureUsages::COPY_DST;
            let format = wgpu::TextureFormat::Rgba32Uint;
            let descriptor = flat_texture(self.label, [ROW_TEXELS, rows], format, usage);
            Ok(context.device.create_texture(&descriptor))
        })?;
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        self.texture = Some((texture, view));
        Ok(true)
    }

    /// Records a copy of the rows that hold these bytes of the buffer, for which there is room.
    pub fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        buffer: &wgpu::Buffer,
        bytes: Range<u64>,
    ) {
        let Some((texture, _)) = &self.texture else {
            return;
        };
        let texels = (buffer.size() / TEXEL_BYTES) as u32;
        let (full, rest) = (texels / ROW_TEXELS, texels % ROW_TEXELS);
        let first = (bytes.start / ROW_BYTES) as u32;
        let last = bytes.end.min(buffer.size()).div_ceil(ROW_BYTES) as u32;
        // Whole rows, then what the last one has.
        let whole = last.min(full).saturating_sub(first);
        let end = if last > full { rest } else { 0 };
        for (row, width, height) in [(first, ROW_TEXELS, whole), (full, end, 1)] {
            if width == 0 || height == 0 {
                continue;
            }
            encoder.copy_buffer_to_texture(
                wgpu::TexelCopyBufferInfo {
                    buffer,
                    layout: wgpu::TexelCopyBufferLayout {
                        offset: u64::from(row) * ROW_BYTES,
                        bytes_per_row: Some(ROW_BYTES as u32),
                        rows_per_image: None,
                    },
                },
                wgpu::TexelCopyTextureInfo {
                    texture,
                    mip_level: 0,
                    origin: wgpu::Origin3d { x: 0, y: row, z: 0 },
                    aspect: wgpu::TextureAspect::All,
                },
                wgpu::Extent3d {
                    width,
                    height,
                    depth_or_array_layers: 1,
                },
            );
        }
    }

    /// Records a copy of the rows that hold these bytes of the buffer, or of all that it has where the texture is another
    /// one now: true, so that it must be bound again.
    ///
    /// # Errors
    /// [`GpuError::Validation`], where the texture does not fit.
    pub fn copy_from(
        &mut self,
        context: &GpuContext,
        encoder: &mut wgpu::CommandEncoder,
        buffer: &wgpu::Buffer,
        bytes: Range<u64>,
    ) -> Result<bool, GpuError> {
        let is_new = self.fit(context, buffer.size())?;
        let bytes = if is_new { 0..buffer.size() } else { bytes };
        context.guarded(self.label, || {
            self.record(encoder, buffer, bytes);
            Ok(())
        })?;
        Ok(is_new)
    }

    /// The texture, once something was copied.
    pub fn view(&self) -> Option<&wgpu::TextureView> {
        self.texture.as_ref().map(|(_, view)| view)
    }
}

/// Rows of a texture for `bytes` bytes. No power of two, as far as there is room: llvmpipe compiles a shader for textures of
/// such sizes and another one for all others, so that an array that grows from one to the other would make frames wait for
/// seconds.
fn rows_for(bytes: u64, most: u32) -> u32 {
    let rows = bytes.div_ceil(ROW_BYTES).max(1) as u32;
    let odd = rows.max(3);
    let odd = odd + u32::from(odd.is_power_of_two());
    if odd <= most { odd } else { rows }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_hold_the_bytes_and_are_no_power_of_two() {
        for rows in 0..300_u64 {
            let made = rows_for(rows * ROW_BYTES, 8192);
            assert!(u64::from(made) >= rows && !made.is_power_of_two());
            assert!(u64::from(made) <= rows.max(2) + 1);
        }
        // Where there is no room for more, as many as are needed; too many stay too many, for the driver to refuse.
        assert_eq!(rows_for(8192 * ROW_BYTES, 8192), 8192);
        assert_eq!(rows_for(9000 * ROW_BYTES, 8192), 9000);
    }
}
