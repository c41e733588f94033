//! Image files before they are decoded: what their headers say, and what decoding them will take.
//!
//! Decoders take memory by what a header claims, and a few bytes claim anything. So the header is read first, its size
//! asked for, and only then the picture is decoded.

use std::io::Cursor;

use image::codecs::hdr::HdrDecoder;
use image::{DynamicImage, ImageDecoder as _, ImageError, ImageFormat, ImageReader, Limits};

use crate::limits::product;

/// A file's bytes with a signature that decoders know: some Radiance files begin with `#?RGBE`.
#[must_use]
pub fn with_known_signature(bytes: Vec<u8>) -> Vec<u8> {
    match bytes.strip_prefix(b"#?RGBE\n") {
        Some(rest) => [b"#?RADIANCE\n", rest].concat(),
        None => bytes,
    }
}

/// An image file whose header makes sense.
pub struct Encoded<'a> {
    bytes: &'a [u8],
    /// By which it is decoded.
    pub format: ImageFormat,
    /// Columns, 1 or more.
    pub width: u32,
    /// Rows, 1 or more.
    pub height: u32,
    /// What comes out of the decoder, bytes.
    decoded_bytes: u64,
    /// What the decoder takes on the way, bytes.
    scratch_bytes: u64,
}

impl<'a> Encoded<'a> {
    /// Reads the header; `format` is what the content is known to be.
    ///
    /// # Errors
    /// One line, to follow the image's name.
    pub fn open(bytes: &'a [u8], format: ImageFormat) -> Result<Self, String> {
        let broken = |error: &dyn std::fmt::Display| format!("cannot be decoded: {error}");
        // Before the decoder, which would make room for what the file claims.
        let blocks = match format {
            ImageFormat::OpenExr => exr_scratch_bytes(bytes).map_err(|error| broken(&error))?,
            _ => 0,
        };
        let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
        reader.limits(Limits::default());
        let decoder = reader.into_decoder().map_err(|error| broken(&error))?;
        let (width, height) = decoder.dimensions();
        if width == 0 || height == 0 {
            return Err("has no pixels".to_owned());
        }
        // The decoder fills up what is missing with grey.
        if format == ImageFormat::Jpeg && !jpeg_ends(bytes) {
            return Err("cannot be decoded: the file has no end marker: it was cut off".to_owned());
        }
        let decoded_bytes = decoder.total_bytes();
        // JPEG: coefficients of progressive files, 16 bits each, and a copy of the picture. EXR: a copy, and blocks.
        let scratch_bytes = match format {
            ImageFormat::Jpeg => decoded_bytes.saturating_mul(4),
            ImageFormat::OpenExr => decoded_bytes.saturating_add(blocks),
            _ => 0,
        };
        Ok(Self {
            bytes,
            format,
            width,
            height,
            decoded_bytes,
            scratch_bytes,
        })
    }

    /// Number of pixels.
    pub fn pixels(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }

    /// What decoding takes until its picture is dropped, bytes.
    pub fn decoding_bytes(&self) -> u64 {
        self.decoded_bytes.saturating_add(self.scratch_bytes)
    }

    /// The picture. The caller has asked for [`Encoded::decoding_bytes`].
    ///
    /// # Errors
    /// One line, to follow the image's name.
    pub fn decode(&self) -> Result<DynamicImage, String> {
        let mut reader = ImageReader::with_format(Cursor::new(self.bytes), self.format);
        let mut limits = Limits::default();
        // Asked for already; this holds what text and colour profiles in the file may take.
        limits.max_alloc = Some(self.decoding_bytes().saturating_add(64 << 20));
        reader.limits(limits);
        let broken = |error: ImageError| format!("cannot be decoded: {error}");
        let mut picture = reader.decode().map_err(broken)?;
        if self.format == ImageFormat::Hdr {
            let file = HdrDecoder::new(Cursor::new(self.bytes)).map_err(broken)?;
            // By which the values have been multiplied.
            let exposure = file
                .metadata()
                .exposure
                .filter(|by| by.is_normal() && *by > 0.0);
            if let (Some(exposure), DynamicImage::ImageRgb32F(rgb)) = (exposure, &mut picture) {
                rgb.iter_mut().for_each(|value| *value /= exposure);
            }
        }
        Ok(picture)
    }
}

/// Whether a JPEG file has the marker of its end (ITU T.81, B.1.1): after the segments before it, and after their scans, in which
/// 0xff stands before 0 or a restart's number.
fn jpeg_ends(bytes: &[u8]) -> bool {
    const END: u8 = 0xd9;
    const SCAN: u8 = 0xda;
    let mut at = 2;
    let mut is_scan = false;
    while let Some(&[first, marker]) = bytes.get(at..at + 2) {
        let is_marker = first == 0xff && !matches!(marker, 0 | 0xff);
        at += match (is_marker, marker) {
            (true, END) => return true,
            // Restarts and others without a segment.
            (true, 0x01 | 0xd0..=0xd8) => 2,
            (true, _) => {
                is_scan = marker == SCAN;
                let Some(&[high, low]) = bytes.get(at + 2..at + 4) else {
                    return false;
                };
                2 + usize::from(u16::from_be_bytes([high, low]))
            }
            (false, _) if is_scan || first == 0xff => 1,
            // What no decoder knows either.
            (false, _) => return true,
        };
    }
    false
}

/// What an OpenEXR file takes beside its picture while it is decoded, bytes. The picture is sized by the display window; this
/// goes by data window, tiles, channels and compression. All of the data window counts: its blocks are decompressed one
/// by one, but few bytes can name the same block many times.
fn exr_scratch_bytes(bytes: &[u8]) -> Result<u64, exr::error::Error> {
    let file = exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), false)?;
    let part = |header: &exr::meta::header::Header| {
        let block = header.max_block_pixel_size();
        let pixel = header.channels.bytes_per_pixel as u64;
        let layer = header.layer_size;
        [
            // Compressed, decompressed, put in order, and samples of a row.
            product(&[4, pixel, block.width() as u64, block.height() as u64]),
            product(&[16, layer.width() as u64]),
            product(&[pixel, layer.width() as u64, layer.height() as u64]),
            // Tables of where the blocks lie.
            product(&[16, header.chunk_count as u64]),
        ]
        .into_iter()
        .fold(0, u64::saturating_add)
    };
    Ok(file.headers.iter().map(part).fold(0, u64::saturating_add))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exposure_of_a_radiance_file_is_taken_back() {
        let red = |header: &str| {
            let text = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n{header}\n-Y 1 +X 1\n");
            // 128 / 256 of 2^1.
            let file = [text.as_bytes(), &[128, 64, 0, 129]].concat();
            let picture = Encoded::open(&file, ImageFormat::Hdr).unwrap().decode();
            picture.unwrap().into_rgb32f().into_raw()[0]
        };
        assert_eq!(red(""), 1.0);
        assert_eq!(red("EXPOSURE=2\n"), 0.5);
        assert_eq!(red("EXPOSURE=0\n"), 1.0);
    }
}
