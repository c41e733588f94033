//! Writing OpenEXR: one part, scan lines from the top, ZIP ("OpenEXR File Layout" and "Storing Multi-View Images in OpenEXR
//! Files", openexr.com).
//!
//! The `exr` crate compresses and encodes attributes. Their order is ours: that crate promises none, and runs are compared
//! byte for byte.

use std::io::{self, Write};

use exr::compression::Compression;
use exr::error::Error;
use exr::meta::BlockDescription;
pub use exr::meta::attribute::AttributeValue as ExrAttribute;
use exr::meta::attribute::{self, ChannelDescription, IntegerBounds, LineOrder, SampleType, Text};
use exr::meta::header::Header;
use exr::prelude::f16;
use rayon::prelude::*;

use crate::images::ImageRgb;

/// Rows that are compressed together.
const ROWS: usize = 16;

/// A channel's samples, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub enum ExrSamples {
    /// Written as 16-bit floats: rounded to the nearest, and no farther from 0 than 65504.
    Half(Vec<f32>),
    /// 32-bit floats.
    Float(Vec<f32>),
    /// Whole numbers.
    Whole(Vec<u32>),
}

impl ExrSamples {
    /// Real numbers, of 16 bits or of 32.
    #[must_use]
    pub fn real(samples: Vec<f32>, as_half: bool) -> Self {
        match as_half {
            true => Self::Half(samples),
            false => Self::Float(samples),
        }
    }

    fn kind(&self) -> SampleType {
        match self {
            Self::Half(_) => SampleType::F16,
            Self::Float(_) => SampleType::F32,
            Self::Whole(_) => SampleType::U32,
        }
    }

    fn append_row(&self, row: usize, width: usize, bytes: &mut Vec<u8>) {
        let range = row * width..(row + 1) * width;
        // The compressor takes the machine's own byte order.
        match self {
            Self::Half(samples) => {
                for sample in samples.iter().take(range.end).skip(range.start) {
                    let half = f16::from_f32(*sample).clamp(f16::MIN, f16::MAX);
                    bytes.extend_from_slice(&half.to_bits().to_ne_bytes());
                }
            }
            Self::Float(samples) => bytes.extend_from_slice(bytemuck::cast_slice(&samples[range])),
            Self::Whole(samples) => bytes.extend_from_slice(bytemuck::cast_slice(&samples[range])),
        }
    }
}

/// A header's text: UTF-8, of which the format knows nothing.
#[must_use]
pub fn exr_text(text: &str) -> Text {
    Text::from_slice_unchecked(text.as_bytes())
}

/// An image with any channels and attributes.
#[derive(Clone, Debug, PartialEq)]
pub struct ExrFile {
    size: [u32; 2],
    channels: Vec<(String, ExrSamples)>,
    attributes: Vec<(String, ExrAttribute)>,
}

impl ExrFile {
    /// An image without channels; `size` is width and height in pixels.
    #[must_use]
    pub fn new(size: [u32; 2]) -> Self {
        let text = concat!("stereolux ", env!("CARGO_PKG_VERSION"));
        let mut file = Self {
            size,
            channels: Vec::new(),
            attributes: Vec::new(),
        };
        file.set("pixelAspectRatio", ExrAttribute::F32(1.0));
        file.set(
            "screenWindowCenter",
            ExrAttribute::FloatVec2((0.0, 0.0).into()),
        );
        file.set("screenWindowWidth", ExrAttribute::F32(1.0));
        file.set("software", ExrAttribute::Text(exr_text(text)));
        file
    }

    /// Width and height, pixels.
    #[must_use]
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Adds a channel, or replaces the one of that name. One of another length is an error when the file is written.
    pub fn add(&mut self, name: impl Into<String>, samples: ExrSamples) {
        let name = name.into();
        self.channels.retain(|(known, _)| *known != name);
        self.channels.push((name, samples));
        // The format wants them by name.
        self.channels.sort_by(|(a, _), (b, _)| a.cmp(b));
    }

    /// Adds red, green and blue after `prefix`, such as `albedo.`.
    pub fn add_rgb(&mut self, prefix: &str, image: &ImageRgb, as_half: bool) {
        for (at, name) in ["R", "G", "B"].into_iter().enumerate() {
            let samples = image.pixels.iter().map(|pixel| pixel[at]).collect();
            self.add(
                format!("{prefix}{name}"),
                ExrSamples::real(samples, as_half),
            );
        }
    }

    /// Sets an attribute; names are at most 31 bytes long.
    pub fn set(&mut self, name: &str, value: ExrAttribute) {
        match self.attributes.iter_mut().find(|(known, _)| known == name) {
            Some((_, known)) => *known = value,
            None => self.attributes.push((name.to_owned(), value)),
        }
    }

    /// Writes the file. Equal images with equal attributes give equal bytes.
    ///
    /// # Errors
    /// The writer's; channels that are missing or of another size.
    pub fn write(&self, out: &mut impl Write) -> io::Result<()> {
        let [width, height] = self.size.map(|side| side as usize);
        let fits = |samples: &ExrSamples| match samples {
            ExrSamples::Half(samples) | ExrSamples::Float(samples) => samples.len(),
            ExrSamples::Whole(samples) => samples.len(),
        } == width * height;
        if self.channels.is_empty() || !self.channels.iter().all(|(_, samples)| fits(samples)) {
            return Err(io::Error::other("the channels do not make an image"));
        }
        let failed = |error: Error| io::Error::other(error.to_string());
        let header = self.header();
        let blocks = self.blocks(&header).map_err(failed)?;
        let header = self.encoded(&header).map_err(failed)?;
        out.write_all(&header)?;
        let mut place = (header.len() + blocks.len() * size_of::<u64>()) as u64;
        for block in &blocks {
            out.write_all(&place.to_le_bytes())?;
            place += 8 + block.len() as u64;
        }
        for (index, block) in blocks.iter().enumerate() {
            out.write_all(&((index * ROWS) as i32).to_le_bytes())?;
            out.write_all(&(block.len() as i32).to_le_bytes())?;
            out.write_all(block)?;
        }
        Ok(())
    }

    fn encoded(&self, header: &Header) -> Result<Vec<u8>, Error> {
        let window = ExrAttribute::IntegerBounds(header.shared_attributes.display_window);
        let attributes = [
            (
                "channels",
                ExrAttribute::ChannelList(header.channels.clone()),
            ),
            ("compression", ExrAttribute::Compression(header.compression)),
            ("dataWindow", window.clone()),
            ("displayWindow", window),
            ("lineOrder", ExrAttribute::LineOrder(header.line_order)),
        ];
        let mut bytes = vec![0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0]; // magic number, version 2, no flags
        for (name, value) in &attributes {
            attribute::write(name.as_bytes(), value, &mut bytes)?;
        }
        for (name, value) in &self.attributes {
            attribute::write(name.as_bytes(), value, &mut bytes)?;
        }
        bytes.push(0);
        Ok(bytes)
    }

    fn header(&self) -> Header {
        let [width, height] = self.size.map(|side| side as usize);
        let channels = self
            .channels
            .iter()
            .map(|(name, samples)| ChannelDescription::new(exr_text(name), samples.kind(), false));
        Header::new(Text::default(), (width, height), channels.collect()).with_encoding(
            Compression::ZIP16,
            BlockDescription::ScanLines,
            LineOrder::Increasing,
        )
    }

    /// The rows, compressed.
    fn blocks(&self, header: &Header) -> Result<Vec<Vec<u8>>, Error> {
        let [width, height] = self.size.map(|side| side as usize);
        let block = |index: usize| {
            let rows = index * ROWS..height.min((index + 1) * ROWS);
            let mut bytes = Vec::new();
            for row in rows.clone() {
                for (_, samples) in &self.channels {
                    samples.append_row(row, width, &mut bytes);
                }
            }
            let section = IntegerBounds::new((0, rows.start as i32), (width, rows.len()));
            Compression::ZIP16.compress_image_section_to_le(header, bytes, section)
        };
        let count = height.div_ceil(ROWS);
        (0..count).into_par_iter().map(block).collect()
    }
}
