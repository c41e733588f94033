//! Writing OpenEXR: one part, scan lines from the top, ZIP ("OpenEXR File Layout" and "Storing Multi-View Images in OpenEXR
//! Files", openexr.com).
//!
//! The `exr` crate compresses. The file around it is ours: that crate promises no order of a header's attributes, and runs
//! are compared byte for byte.

use std::io::{self, Write};

use exr::compression::Compression;
use exr::meta::BlockDescription;
use exr::meta::attribute::{ChannelDescription, IntegerBounds, LineOrder, SampleType, Text};
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

/// Value of a header's attribute.
#[derive(Clone, Debug, PartialEq)]
pub enum ExrAttribute {
    /// `string`.
    Text(String),
    /// `stringvector`.
    Texts(Vec<String>),
    /// `int`.
    Int(i32),
    /// `float`.
    Float(f32),
    /// `v2f`.
    Vector2([f32; 2]),
    /// `m44f`, for row vectors: the last four numbers move.
    Matrix([f32; 16]),
    /// `rational`.
    Rational(i32, u32),
}

impl ExrAttribute {
    fn encoded(&self) -> (&'static str, Vec<u8>) {
        let floats =
            |values: &[f32]| -> Vec<u8> { values.iter().flat_map(|v| v.to_le_bytes()).collect() };
        match self {
            Self::Text(text) => ("string", text.as_bytes().to_vec()),
            Self::Texts(texts) => {
                let mut bytes = Vec::new();
                for text in texts {
                    bytes.extend_from_slice(&(text.len() as i32).to_le_bytes());
                    bytes.extend_from_slice(text.as_bytes());
                }
                ("stringvector", bytes)
            }
            Self::Int(value) => ("int", value.to_le_bytes().to_vec()),
            Self::Float(value) => ("float", floats(&[*value])),
            Self::Vector2(value) => ("v2f", floats(value)),
            Self::Matrix(value) => ("m44f", floats(value)),
            Self::Rational(above, below) => {
                let bytes = [above.to_le_bytes(), below.to_le_bytes()];
                ("rational", bytes.concat())
            }
        }
    }
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
        file.set("pixelAspectRatio", ExrAttribute::Float(1.0));
        file.set("screenWindowCenter", ExrAttribute::Vector2([0.0; 2]));
        file.set("screenWindowWidth", ExrAttribute::Float(1.0));
        file.set("software", ExrAttribute::Text(text.to_owned()));
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
        let header = self.header();
        let blocks = self.blocks()?;
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

    fn header(&self) -> Vec<u8> {
        const ZIP: u8 = 3;
        let mut header: Vec<u8> = vec![0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0]; // magic number, version 2, no flags
        let mut attribute = |name: &str, kind: &str, value: &[u8]| {
            for text in [name, kind] {
                header.extend_from_slice(text.as_bytes());
                header.push(0);
            }
            header.extend_from_slice(&(value.len() as i32).to_le_bytes());
            header.extend_from_slice(value);
        };
        let mut channels = Vec::new();
        for (name, samples) in &self.channels {
            channels.extend_from_slice(name.as_bytes());
            channels.push(0);
            let kind = match samples.kind() {
                SampleType::U32 => 0,
                SampleType::F16 => 1,
                SampleType::F32 => 2,
            };
            // Type, "perceptually linear" with three reserved bytes, sampling steps in x and y.
            for word in [kind, 0, 1, 1_i32] {
                channels.extend_from_slice(&word.to_le_bytes());
            }
        }
        channels.push(0);
        let window = [0, 0, self.size[0] as i32 - 1, self.size[1] as i32 - 1];
        let window: Vec<u8> = window.iter().flat_map(|b| b.to_le_bytes()).collect();
        attribute("channels", "chlist", &channels);
        attribute("compression", "compression", &[ZIP]);
        attribute("dataWindow", "box2i", &window);
        attribute("displayWindow", "box2i", &window);
        attribute("lineOrder", "lineOrder", &[0]);
        for (name, value) in &self.attributes {
            let (kind, bytes) = value.encoded();
            attribute(name, kind, &bytes);
        }
        header.push(0);
        header
    }

    /// The rows, compressed.
    fn blocks(&self) -> io::Result<Vec<Vec<u8>>> {
        let [width, height] = self.size.map(|side| side as usize);
        let channels = self.channels.iter().map(|(name, samples)| {
            let name = Text::new_or_none(name).unwrap_or_default();
            ChannelDescription::new(name, samples.kind(), false)
        });
        let header = Header::new(Text::default(), (width, height), channels.collect());
        let header = header.with_encoding(
            Compression::ZIP16,
            BlockDescription::ScanLines,
            LineOrder::Increasing,
        );
        let block = |index: usize| {
            let rows = index * ROWS..height.min((index + 1) * ROWS);
            let mut bytes = Vec::new();
            for row in rows.clone() {
                for (_, samples) in &self.channels {
                    samples.append_row(row, width, &mut bytes);
                }
            }
            let section = IntegerBounds::new((0, rows.start as i32), (width, rows.len()));
            Compression::ZIP16
                .compress_image_section_to_le(&header, bytes, section)
                .map_err(|error| io::Error::other(error.to_string()))
        };
        let count = height.div_ceil(ROWS);
        (0..count).into_par_iter().map(block).collect()
    }
}
