//! Equirectangular environment maps.

use std::path::Path;

use image::ImageFormat;

use super::builtin::PREFIX;
use super::check::is_light;
use super::{SceneError, surroundings};
use stereolux_base::decoding::{Encoded, with_known_signature};
use stereolux_base::files;
use stereolux_base::limits::{LoadBudget, OverBudget};
use stereolux_base::printable;

/// Radiance from infinitely far, over all directions.
///
/// Row 0 is +Y; the middle column is -Z, the column at three quarters of the width +X. Texel centres lie at half
/// integers; between them the map is bilinear.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width * height` texels, linear RGB radiance, strength applied; finite and not negative.
    pub radiance: Vec<[f32; 3]>,
    /// File name.
    pub name: String,
}

impl Environment {
    /// The same `strength` times as bright.
    #[must_use]
    pub fn scaled(mut self, strength: f32) -> Self {
        for channel in self.radiance.as_flattened_mut() {
            *channel *= strength;
        }
        self
    }

    /// Whether it has the texels that its size says, each with radiance that light can have.
    ///
    /// # Errors
    /// One line.
    pub fn check(&self) -> Result<(), String> {
        let Self {
            width,
            height,
            radiance,
            name,
        } = self;
        let texels = u64::from(*width) * u64::from(*height);
        if texels == 0 || radiance.len() as u64 != texels {
            let count = radiance.len();
            return Err(format!(
                "{name}: {count} texels are not {width} x {height}, or none"
            ));
        }
        if !is_light(radiance.as_flattened()) {
            return Err(format!("{name}: radiance that is negative or not finite"));
        }
        Ok(())
    }

    /// Whether it is not black all over.
    #[must_use]
    pub fn shines(&self) -> bool {
        self.radiance
            .as_flattened()
            .iter()
            .any(|radiance| *radiance > 0.0)
    }
}

/// Most texels: what a 16k x 8k map has.
const MAX_TEXELS: u64 = 1 << 27;

/// Radiance above which f32 runs out when it is divided by the chance of its texel.
const MOST_RADIANCE: f32 = 1e30;

/// What a texel takes, bytes: as decoded in floats, sorted into texels, and packed for the device with the tables that it is
/// sampled by.
const TEXEL_BYTES: u64 = 48;

/// Reads a `.hdr` (Radiance RGBE) or `.exr` (OpenEXR) equirectangular map, or makes the embedded one of `builtin:NAME`, and
/// multiplies it by `strength`. Takes as much memory as a load may by default.
///
/// Returns the map and warnings, one line each: negative texels are raised to 0, a shape other than 2:1 is stretched.
///
/// # Errors
/// One line that names the file: unreadable, another format, broken, larger than 2^27 texels or than the memory allows, with
/// texels that are not finite, or with a `strength` that is negative or not finite.
pub fn load_environment(
    path: impl AsRef<Path>,
    strength: f32,
) -> Result<(Environment, Vec<String>), SceneError> {
    load_environment_within(path, strength, &LoadBudget::default())
}

/// As [`load_environment`], taking what `budget` allows.
///
/// # Errors
/// As [`load_environment`].
pub fn load_environment_within(
    path: impl AsRef<Path>,
    strength: f32,
    budget: &LoadBudget,
) -> Result<(Environment, Vec<String>), SceneError> {
    let path = path.as_ref();
    if !(strength.is_finite() && strength >= 0.0) {
        return Err(SceneError::invalid(
            path,
            format!("environment.strength must be 0 or more, it is {strength}"),
        ));
    }
    if let Some(name) = path.to_str().and_then(|path| path.strip_prefix(PREFIX)) {
        return Ok((surroundings::environment(name, strength)?, Vec::new()));
    }
    let bytes =
        files::load_regular(path, budget).map_err(|reason| SceneError::read(path, reason))?;
    let bytes = with_known_signature(bytes);
    let format = if bytes.starts_with(b"#?") {
        ImageFormat::Hdr
    } else if bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
        ImageFormat::OpenExr
    } else {
        return Err(SceneError::invalid(
            path,
            "an environment must be Radiance .hdr or OpenEXR .exr, this is neither",
        ));
    };
    let fault = |reason: String| SceneError::invalid(path, reason);
    let encoded = Encoded::open(&bytes, format).map_err(fault)?;
    let (width, height) = (encoded.width, encoded.height);
    if encoded.pixels() > MAX_TEXELS {
        return Err(fault(format!(
            "{width}x{height} texels: an environment has 1 to {MAX_TEXELS}"
        )));
    }
    let over = |error: OverBudget| SceneError::over(path, &error);
    let what = format_args!("{width}x{height} texels");
    budget
        .take(encoded.pixels() * TEXEL_BYTES, what)
        .map_err(over)?;
    let _held = budget.hold(encoded.decoding_bytes(), what).map_err(over)?;
    let pixels = encoded.decode().map_err(fault)?.into_rgb32f();

    let mut warnings = Vec::new();
    if width != 2 * height {
        warnings.push(format!(
            "{}: {width}x{height} is not 2:1, the map is stretched over the sphere",
            path.display()
        ));
    }
    let mut negative = 0_usize;
    let mut radiance = Vec::with_capacity(width as usize * height as usize);
    for (column, row, texel) in pixels.enumerate_pixels() {
        let scaled = texel.0.map(|channel| channel * strength);
        if scaled.iter().any(|channel| !channel.is_finite()) {
            return Err(SceneError::invalid(
                path,
                format!("texel ({column}, {row}) is not finite: {:?}", texel.0),
            ));
        }
        negative += usize::from(scaled.iter().any(|channel| *channel < 0.0));
        radiance.push(scaled.map(|channel| channel.max(0.0)));
    }
    if negative > 0 {
        warnings.push(format!(
            "{}: {negative} negative texels are raised to 0",
            path.display()
        ));
    }
    let too_bright = radiance
        .iter()
        .filter(|texel| texel.iter().any(|channel| *channel > MOST_RADIANCE));
    match too_bright.count() {
        0 => {}
        count => warnings.push(format!(
            "{}: {count} texels are brighter than {MOST_RADIANCE:e}, more than can be rendered: pixels may be black or wrong; \
             lower environment.strength",
            path.display()
        )),
    }
    let warnings = warnings
        .iter()
        .map(|warning| printable::line(warning))
        .collect();
    let name = path.file_name().map_or_else(
        || path.display().to_string(),
        |name| name.to_string_lossy().into_owned(),
    );
    Ok((
        Environment {
            width,
            height,
            radiance,
            name,
        },
        warnings,
    ))
}

#[cfg(test)]
#[allow(dead_code)]
#[path = "../../base/tests/shared/folders.rs"]
mod folders;

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::folders::Folder;
    use super::*;

    /// 2x1 texels, flat RGBE: mantissa / 256 * 2^(exponent - 128).
    fn tiny_hdr() -> Vec<u8> {
        let mut bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n".to_vec();
        bytes.extend([128, 64, 32, 129, 128, 128, 128, 131]);
        bytes
    }

    fn exr(texels: [[f32; 3]; 2]) -> Vec<u8> {
        let image = image::Rgb32FImage::from_raw(2, 1, texels.as_flattened().to_vec()).unwrap();
        let mut bytes = Cursor::new(Vec::new());
        image.write_to(&mut bytes, ImageFormat::OpenExr).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn reads_radiance_and_applies_strength() {
        let folder = Folder::new("environment-read");
        let path = folder.write("ok.hdr", tiny_hdr());
        let (map, warnings) = load_environment(&path, 2.0).unwrap();
        assert!(warnings.is_empty(), "{warnings:?}");
        assert_eq!((map.width, map.height), (2, 1));
        assert_eq!(map.radiance, [[2.0, 1.0, 0.5], [8.0, 8.0, 8.0]]);
        let other = String::from_utf8_lossy(&tiny_hdr()[..10]).replace("RADIANCE", "RGBE");
        let path = folder.write("rgbe.hdr", [other.as_bytes(), &tiny_hdr()[10..]].concat());
        let other = load_environment(&path, 2.0).unwrap().0;
        assert_eq!(other.radiance, map.radiance);
    }

    #[test]
    fn reads_exr_and_raises_negative_texels() {
        let folder = Folder::new("environment-negative");
        let path = folder.write("negative.exr", exr([[1.5, -0.25, 1e6], [0.0, 0.5, 0.75]]));
        let (map, warnings) = load_environment(&path, 1.0).unwrap();
        assert_eq!(map.radiance, [[1.5, 0.0, 1e6], [0.0, 0.5, 0.75]]);
        assert_eq!(warnings.len(), 1);
        assert!(warnings[0].contains("1 negative texels"), "{warnings:?}");
    }

    #[test]
    fn refuses_what_is_no_environment() {
        let folder = Folder::new("environment-refused");
        let write = |name, bytes: &[u8]| folder.write(name, bytes);
        let cases = [
            (write("empty.hdr", b""), "neither"),
            (write("text.hdr", b"hello"), "neither"),
            (write("cut.hdr", &tiny_hdr()[..48]), "cannot be decoded"),
            (
                write(
                    "huge.hdr",
                    b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1000000 +X 2000000\n",
                ),
                "texels",
            ),
            (
                write("nan.exr", &exr([[f32::NAN, 0.0, 0.0], [0.0; 3]])),
                "texel (0, 0) is not finite",
            ),
            (std::env::temp_dir(), "directory"),
            (
                std::path::PathBuf::from("/nonexistent/sky.hdr"),
                "/nonexistent/sky.hdr",
            ),
        ];
        for (path, expected) in cases {
            let message = load_environment(&path, 1.0).unwrap_err().to_string();
            assert!(
                message.contains(expected) && !message.contains('\n'),
                "{}: {message}",
                path.display()
            );
        }
        let path = write("strength.hdr", &tiny_hdr());
        for strength in [-1.0, f32::NAN, f32::INFINITY] {
            assert!(
                load_environment(&path, strength)
                    .unwrap_err()
                    .to_string()
                    .contains("strength")
            );
        }
    }
}
