//! Images on the CPU: linear RGB in 32-bit floats, files, tone mapping.
//!
//! Rows run from the top, pixels from the left. Files are written beside their place and then renamed, so that a
//! reader never sees half of one.

use std::collections::HashSet;
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

use exr::meta::MetaData;
use image::{ImageEncoder as _, ImageFormat};

use crate::exr_file::ExrFile;
use stereolux_base::decoding::{Encoded, with_known_signature};
use stereolux_base::files::{self, write_beside};
use stereolux_base::limits::{LoadBudget, OverBudget};
use stereolux_base::printable;

/// Largest width or height that is read or written, in pixels.
const MAX_SIDE: u32 = 32_768;
/// A pixel in floats, bytes.
const PIXEL_BYTES: u64 = 12;

/// What can go wrong with an image or its file. Each message is one line.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The file cannot be read.
    #[error("{}", printable::line(&format!("{}: cannot be read: {reason}", path.display())))]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system says.
        reason: String,
    },
    /// The file is no image of a known format, or is cut off or damaged.
    #[error("{}", printable::line(&format!("{}: {reason}", path.display())))]
    Undecodable {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The file cannot be written.
    #[error("{}", printable::line(&format!("{}: cannot be written: {reason}", path.display())))]
    Unwritable {
        /// The file.
        path: PathBuf,
        /// What the system says.
        reason: String,
    },
    /// Width, height and pixels do not make an image.
    #[error("an image of {width}x{height} pixels with {pixels} values: {reason}")]
    Shape {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
        /// Pixels given.
        pixels: usize,
        /// What is wrong.
        reason: &'static str,
    },
}

/// A picture with `width * height` pixels, row 0 on top; never empty.
#[derive(Clone, Debug, PartialEq)]
pub struct Image<P> {
    /// Width in pixels, 1 or more.
    pub width: u32,
    /// Height in pixels, 1 or more.
    pub height: u32,
    /// Pixels by rows from the top.
    pub pixels: Vec<P>,
}

/// Linear scene-referred RGB radiance.
pub type ImageRgb = Image<[f32; 3]>;
/// sRGB-encoded RGB for looking at.
pub type ImageRgb8 = Image<[u8; 3]>;

impl<P: Copy> Image<P> {
    /// An image of the same size, of as many pixels.
    #[must_use]
    pub fn like<Q>(&self, pixels: impl IntoIterator<Item = Q>) -> Image<Q> {
        let pixels: Vec<Q> = pixels.into_iter().collect();
        debug_assert_eq!(pixels.len(), self.pixels.len());
        Image {
            width: self.width,
            height: self.height,
            pixels,
        }
    }

    /// An image from its pixels.
    ///
    /// # Errors
    /// [`ImageError::Shape`] if a side is 0 or over 32768, or the number of pixels is not `width * height`.
    pub fn new(width: u32, height: u32, pixels: Vec<P>) -> Result<Self, ImageError> {
        let shape = |reason| ImageError::Shape {
            width,
            height,
            pixels: pixels.len(),
            reason,
        };
        if width == 0 || height == 0 {
            return Err(shape("neither side may be 0"));
        }
        if width > MAX_SIDE || height > MAX_SIDE {
            return Err(shape("neither side may exceed 32768"));
        }
        if pixels.len() as u64 != u64::from(width) * u64::from(height) {
            return Err(shape("there must be width times height"));
        }
        Ok(Self {
            width,
            height,
            pixels,
        })
    }

    /// An image of one colour.
    ///
    /// # Errors
    /// [`ImageError::Shape`] if a side is 0 or over 32768.
    pub fn filled(width: u32, height: u32, pixel: P) -> Result<Self, ImageError> {
        let count = if width > MAX_SIDE || height > MAX_SIDE {
            0
        } else {
            width as usize * height as usize
        };
        Self::new(width, height, vec![pixel; count])
    }

    /// The pixel in column `x` and row `y`, if there is one.
    #[must_use]
    pub fn get(&self, x: u32, y: u32) -> Option<P> {
        let inside = x < self.width && y < self.height;
        let index = y as usize * self.width as usize + x as usize;
        inside.then(|| self.pixels.get(index).copied()).flatten()
    }

    /// Two images of equal height next to each other.
    ///
    /// # Errors
    /// [`ImageError::Shape`] if the heights differ or the sum of the widths is over 32768.
    pub fn side_by_side(left: &Self, right: &Self) -> Result<Self, ImageError> {
        if left.height != right.height {
            return Err(ImageError::Shape {
                width: right.width,
                height: right.height,
                pixels: right.pixels.len(),
                reason: "must be as high as the image to its left",
            });
        }
        let mut pixels = Vec::with_capacity(left.pixels.len() + right.pixels.len());
        let rows = left
            .pixels
            .chunks_exact(left.width as usize)
            .zip(right.pixels.chunks_exact(right.width as usize));
        for (left_row, right_row) in rows {
            pixels.extend_from_slice(left_row);
            pixels.extend_from_slice(right_row);
        }
        Self::new(left.width + right.width, left.height, pixels)
    }
}

impl ImageRgb {
    /// Pixels with a channel that is NaN or infinite.
    #[must_use]
    pub fn non_finite(&self) -> usize {
        self.pixels
            .iter()
            .filter(|pixel| !pixel.iter().all(|channel| channel.is_finite()))
            .count()
    }
}

/// Rec. 709 luminance of linear RGB (ITU-R BT.709-6, item 3.2).
#[must_use]
pub fn luminance(rgb: [f64; 3]) -> f64 {
    0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]
}

/// sRGB encoding of a linear value in 0 to 1 (IEC 61966-2-1).
#[must_use]
pub fn srgb_encode(linear: f32) -> f32 {
    if linear <= 0.003_130_8 {
        12.92 * linear
    } else {
        1.055 * linear.powf(1.0 / 2.4) - 0.055
    }
}

/// Linear value of an sRGB-encoded one in 0 to 1 (IEC 61966-2-1).
#[must_use]
pub fn srgb_decode(encoded: f64) -> f64 {
    if encoded <= 0.040_45 {
        encoded / 12.92
    } else {
        ((encoded + 0.055) / 1.055).powf(2.4)
    }
}

/// Filmic curve from linear radiance to display light in 0 to 1: the rational fit of the ACES RRT and ODT by
/// K. Narkowicz, "ACES Filmic Tone Mapping Curve", 2015. Negative values and NaN give 0, infinity gives 1.
#[must_use]
pub fn aces_filmic(linear: f32) -> f32 {
    // The curve reaches 1 near 8; the upper clamp only keeps x^2 finite.
    let x = if linear.is_nan() {
        0.0
    } else {
        linear.clamp(0.0, 1e4)
    };
    ((x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14)).clamp(0.0, 1.0)
}

/// The image as a screen shows it: times `exposure`, filmic curve, sRGB, 8 bits.
#[must_use]
pub fn tone_map(image: &ImageRgb, exposure: f64) -> ImageRgb8 {
    let exposure = exposure as f32;
    to_bytes(image, |pixel| pixel.map(|c| aces_filmic(c * exposure)))
}

/// The image by what each pixel shows, sRGB, 8 bits.
pub fn to_bytes(image: &ImageRgb, display_light: impl Fn([f32; 3]) -> [f32; 3]) -> ImageRgb8 {
    let encode = |light: f32| (srgb_encode(light) * 255.0).round() as u8;
    let pixels = image.pixels.iter();
    image.like(pixels.map(|pixel| display_light(*pixel).map(encode)))
}

/// Reads EXR and Radiance HDR as they are, PNG and JPEG decoded from sRGB; alpha is dropped. The content decides about
/// the format, not the name. Takes as much memory as a load may by default.
///
/// # Errors
/// [`ImageError::Unreadable`] for a missing file or a directory, [`ImageError::Undecodable`] for anything that is not
/// a whole image of these formats, or larger than the memory allows.
pub fn read_image(path: &Path) -> Result<ImageRgb, ImageError> {
    let budget = LoadBudget::default();
    ImageFile::open(path, &budget)?.decode(&budget)
}

/// An image file in memory, not yet decoded.
pub struct ImageFile<'a> {
    path: &'a Path,
    bytes: Vec<u8>,
    format: ImageFormat,
}

impl<'a> ImageFile<'a> {
    /// Reads the file.
    ///
    /// # Errors
    /// As [`read_image`].
    pub fn open(path: &'a Path, budget: &LoadBudget) -> Result<Self, ImageError> {
        let bytes = files::load(path, budget).map_err(|reason| ImageError::Unreadable {
            path: path.to_owned(),
            reason,
        })?;
        let bytes = with_known_signature(bytes);
        let known = [
            ImageFormat::OpenExr,
            ImageFormat::Hdr,
            ImageFormat::Png,
            ImageFormat::Jpeg,
        ];
        let format = image::guess_format(&bytes)
            .ok()
            .filter(|format| known.contains(format));
        match format {
            Some(format) => Ok(Self {
                path,
                bytes,
                format,
            }),
            None => Err(undecodable(path, "is not an EXR, HDR, PNG or JPEG image")),
        }
    }

    fn encoded(&self) -> Result<Encoded<'_>, ImageError> {
        let encoded = Encoded::open(&self.bytes, self.format)
            .map_err(|reason| undecodable(self.path, reason))?;
        if encoded.width > MAX_SIDE || encoded.height > MAX_SIDE {
            let (width, height) = (encoded.width, encoded.height);
            let reason = format!("{width}x{height} pixels: neither side may exceed {MAX_SIDE}");
            return Err(undecodable(self.path, reason));
        }
        Ok(encoded)
    }

    /// Number of pixels by its header.
    ///
    /// # Errors
    /// As [`read_image`].
    pub fn pixels(&self) -> Result<u64, ImageError> {
        Ok(self.encoded()?.pixels())
    }

    /// A file of several views has the first one's picture in its plain channels, and others would not be looked at.
    fn check_views(&self) -> Result<(), ImageError> {
        if self.format != ImageFormat::OpenExr {
            return Ok(());
        }
        // What cannot be read is left to the decoder.
        let Ok(meta) = MetaData::read_from_buffered(&*self.bytes, false) else {
            return Ok(());
        };
        // In one part that names them, or each in a part of its own.
        let own = || meta.headers.iter().map(|header| &header.own_attributes);
        let listed = own().filter_map(|own| own.multi_view_names.as_ref());
        let views: HashSet<_> = own().filter_map(|own| own.view_name.as_ref()).collect();
        if listed.map(Vec::len).max() > Some(1) || views.len() > 1 {
            let reason = "it holds several views, of which one would be read; give one file per view (output.layout=files)";
            return Err(undecodable(self.path, reason));
        }
        Ok(())
    }

    /// The picture, which `budget` keeps for good.
    ///
    /// # Errors
    /// As [`read_image`].
    pub fn decode(&self, budget: &LoadBudget) -> Result<ImageRgb, ImageError> {
        let encoded = self.encoded()?;
        self.check_views()?;
        let (width, height) = (encoded.width, encoded.height);
        let what = format_args!("{width}x{height} pixels");
        let over = |error: OverBudget| undecodable(self.path, error.to_string());
        let floats = encoded.pixels() * PIXEL_BYTES;
        budget.take(floats, what).map_err(over)?;
        // As decoded, and in floats before they are sorted into pixels.
        let on_the_way = encoded.decoding_bytes().saturating_add(floats);
        let _held = budget.hold(on_the_way, what).map_err(over)?;
        let decoded = encoded
            .decode()
            .map_err(|reason| undecodable(self.path, reason))?
            .into_rgb32f();
        let mut pixels: Vec<[f32; 3]> = decoded.pixels().map(|pixel| pixel.0).collect();
        if !matches!(self.format, ImageFormat::OpenExr | ImageFormat::Hdr) {
            for pixel in &mut pixels {
                *pixel = pixel.map(|channel| srgb_decode(f64::from(channel)) as f32);
            }
        }
        Image::new(width, height, pixels).map_err(|error| undecodable(self.path, error.to_string()))
    }
}

fn undecodable(path: &Path, reason: impl Into<String>) -> ImageError {
    ImageError::Undecodable {
        path: path.to_owned(),
        reason: reason.into(),
    }
}

/// Writes linear RGB as OpenEXR: 32-bit float, scan lines from the top, ZIP. Equal pixels give equal bytes.
///
/// # Errors
/// [`ImageError::Unwritable`]; nothing is left behind.
pub fn write_exr(path: &Path, image: &ImageRgb) -> Result<(), ImageError> {
    let mut file = ExrFile::new([image.width, image.height]);
    file.add_rgb("", image, false);
    write_atomically(path, |out| file.write(out))
}

/// Writes 8-bit RGB as PNG.
///
/// # Errors
/// [`ImageError::Unwritable`]; nothing is left behind.
pub fn write_png(path: &Path, image: &ImageRgb8) -> Result<(), ImageError> {
    write_atomically(path, |out| encode_png(out, image))
}

/// 8-bit RGB as PNG.
pub fn encode_png(out: impl io::Write, image: &ImageRgb8) -> io::Result<()> {
    image::codecs::png::PngEncoder::new(out)
        .write_image(
            image.pixels.as_flattened(),
            image.width,
            image.height,
            image::ExtendedColorType::Rgb8,
        )
        .map_err(|error| match error {
            image::ImageError::IoError(error) => error,
            other => io::Error::other(other.to_string()),
        })
}

/// Writes a file beside its place and renames it there when it is whole; on failure what was written is removed.
///
/// # Errors
/// [`ImageError::Unwritable`].
pub fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), ImageError> {
    write_beside(path, write).map_err(|error| ImageError::Unwritable {
        path: path.to_owned(),
        reason: error.to_string(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_round_trip_and_known_values() {
        // Middle grey 0.5 decodes to 0.2140.
        assert!((srgb_decode(0.5) - 0.214_041).abs() < 1e-6);
        assert!((srgb_decode(188.0 / 255.0) - 0.502_886_458_033).abs() < 1e-9);
        assert_eq!(srgb_decode(0.0), 0.0);
        assert!((srgb_decode(1.0) - 1.0).abs() < 1e-15);
        // The two pieces of IEC 61966-2-1 differ by less than 1e-7 at the joint.
        assert!((srgb_decode(0.04045) - srgb_decode(0.04045 + 1e-12)).abs() < 1e-7);
        for step in 0..=255_u16 {
            let encoded = f64::from(step) / 255.0;
            let there_and_back = srgb_encode(srgb_decode(encoded) as f32);
            assert!((f64::from(there_and_back) - encoded).abs() < 1e-5);
        }
    }

    #[test]
    fn filmic_curve_is_monotonic_and_bounded() {
        let mut last = -1.0;
        for step in 0..4000 {
            let value = aces_filmic(step as f32 * 0.01);
            assert!(value >= last && (0.0..=1.0).contains(&value));
            last = value;
        }
        // The fit at 1: (2.51 + 0.03) / (2.43 + 0.59 + 0.14).
        assert!((aces_filmic(1.0) - 2.54 / 3.16).abs() < 1e-6);
        assert_eq!(aces_filmic(0.0), 0.0);
        assert_eq!(aces_filmic(f32::NAN), 0.0);
        assert_eq!(aces_filmic(f32::NEG_INFINITY), 0.0);
        assert_eq!(aces_filmic(f32::INFINITY), 1.0);
        assert_eq!(aces_filmic(f32::MAX), 1.0);
    }

    #[test]
    fn shapes_are_checked() {
        assert!(ImageRgb::filled(0, 4, [0.0; 3]).is_err());
        assert!(ImageRgb::filled(40_000, 1, [0.0; 3]).is_err());
        assert!(ImageRgb::new(2, 2, vec![[0.0; 3]; 3]).is_err());
        let image = ImageRgb::new(2, 1, vec![[1.0; 3], [f32::NAN, 0.0, 0.0]]).unwrap();
        assert_eq!(image.non_finite(), 1);
        assert_eq!(image.get(0, 0), Some([1.0; 3]));
        assert_eq!(image.get(2, 0), None);
    }

    #[test]
    fn side_by_side_keeps_rows() {
        let left = Image::new(1, 2, vec![1, 2]).unwrap();
        let right = Image::new(2, 2, vec![3, 4, 5, 6]).unwrap();
        let both = Image::side_by_side(&left, &right).unwrap();
        assert_eq!((both.width, both.height), (3, 2));
        assert_eq!(both.pixels, [1, 3, 4, 2, 5, 6]);
        assert!(Image::side_by_side(&left, &Image::new(1, 1, vec![0]).unwrap()).is_err());
    }
}
