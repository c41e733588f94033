//! Buffers and images: from the GLB chunk, `data:` URIs, files beside the document, and buffer views.

use std::io::Cursor;
use std::path::PathBuf;

use image::{ImageFormat, ImageReader, Limits};
use rayon::prelude::*;

use super::super::{Image, SceneError};
use super::Notes;
use super::accessors::Reader;
use super::container;
use super::document::Document;
use super::extensions;

/// Longest image edge; more is taken for a broken header.
const MAX_IMAGE_EDGE: u32 = 16_384;

/// Every buffer of the document, cut to its declared length.
pub fn load_buffers(
    document: &Document<'_>,
    blob: Option<&[u8]>,
) -> Result<Vec<Vec<u8>>, SceneError> {
    let mut buffers = Vec::with_capacity(document.root.buffers.len());
    for (index, buffer) in document.root.buffers.iter().enumerate() {
        let place = format!("buffers[{index}]");
        let mut bytes = match (&buffer.uri, blob) {
            (Some(uri), _) => read_uri(document, &place, uri)?,
            (None, Some(blob)) if index == 0 => blob.to_vec(),
            (None, _) => {
                if let Some(name) = extensions::compression_of(document.raw_item("buffers", index))
                {
                    return Err(document.fault(format!("{place}: is compressed by {name}, which is not supported: decompress the file first")));
                }
                return Err(
                    document.fault(format!("{place}: has neither a URI nor a binary chunk"))
                );
            }
        };
        let declared = buffer.byte_length.0;
        if (bytes.len() as u64) < declared {
            return Err(document.fault(format!(
                "{place}: declares {declared} bytes, its data has {}",
                bytes.len()
            )));
        }
        bytes.truncate(declared as usize);
        buffers.push(bytes);
    }
    Ok(buffers)
}

/// The bytes of every image that lies in a file of its own; none for those in a buffer or a `data:` URI.
pub fn read_image_files(document: &Document<'_>) -> Result<Vec<Option<Vec<u8>>>, SceneError> {
    let images = document.root.images.iter().enumerate();
    images
        .map(|(index, image)| {
            let file = image.uri.as_ref().filter(|uri| !uri.starts_with("data:"));
            let read = |uri: &String| read_uri(document, &format!("images[{index}]"), uri);
            file.map(read).transpose()
        })
        .collect()
}

fn read_uri(document: &Document<'_>, place: &str, uri: &str) -> Result<Vec<u8>, SceneError> {
    match container::decode_data_uri(uri) {
        Some(Ok((_, bytes))) => Ok(bytes),
        Some(Err(what)) => Err(document.fault(format!("{place}: {what}"))),
        None => {
            container::read_file(&resolve(document, place, uri)?).map_err(|error| match error {
                SceneError::Read { path, reason } => {
                    document.fault(format!("{place}: {}: {reason}", path.display()))
                }
                other => other,
            })
        }
    }
}

/// The file that a relative URI names.
fn resolve(document: &Document<'_>, place: &str, uri: &str) -> Result<PathBuf, SceneError> {
    let scheme = uri.split_once(':').map(|(scheme, _)| scheme);
    if scheme.is_some_and(|scheme| {
        scheme.len() > 1 && scheme.bytes().all(|byte| byte.is_ascii_alphanumeric())
    }) {
        return Err(document.fault(format!("{place}: '{uri}' is not a file beside the scene; only relative paths and data URIs are read")));
    }
    let decoded = container::percent_decode(uri)
        .map_err(|what| document.fault(format!("{place}: {what}")))?;
    let relative = String::from_utf8(decoded)
        .map_err(|_| document.fault(format!("{place}: the URI is not UTF-8")))?;
    let folder = document.path.parent().unwrap_or(document.path);
    let path = folder.join(&relative);
    if path.exists() {
        return Ok(path);
    }
    // Exporters that forget to percent-encode write file names with a bare percent sign.
    let verbatim = folder.join(uri);
    Ok(if verbatim.exists() { verbatim } else { path })
}

/// Decodes the images at `sources`, in that order, on all cores.
pub fn load_images(
    document: &Document<'_>,
    buffers: &[Vec<u8>],
    sources: &[usize],
    notes: &mut Notes,
) -> Result<Vec<Image>, SceneError> {
    let reader = Reader { document, buffers };
    let decoded: Vec<Result<(Image, Option<String>), SceneError>> = sources
        .par_iter()
        .map(|source| load_image(&reader, *source))
        .collect();
    let mut images = Vec::with_capacity(decoded.len());
    for result in decoded {
        let (image, warning) = result?;
        images.push(image);
        if let Some(warning) = warning {
            notes.warn(warning);
        }
    }
    Ok(images)
}

fn load_image(reader: &Reader<'_>, index: usize) -> Result<(Image, Option<String>), SceneError> {
    let document = reader.document;
    let place = format!("images[{index}]");
    let Some(source) = document.root.images.get(index) else {
        return Err(document.fault(format!(
            "{place}: out of range, there are {}",
            document.root.images.len()
        )));
    };
    let owned;
    let bytes: &[u8] = match (&source.uri, source.buffer_view) {
        (Some(uri), _) => {
            owned = read_uri(document, &place, uri)?;
            &owned
        }
        (None, Some(view)) => reader.view(view.value(), &place)?,
        (None, None) => {
            return Err(document.fault(format!("{place}: has neither a URI nor a buffer view")));
        }
    };
    let file_name = source.uri.as_ref().filter(|uri| !uri.starts_with("data:"));
    let name = source
        .name
        .clone()
        .or_else(|| file_name.cloned())
        .unwrap_or_else(|| format!("image {index}"));
    let fault = |what: String| document.fault(format!("{place} '{name}': {what}"));

    // What the bytes say counts, whatever the media type or file name claims.
    let format = image::guess_format(bytes)
        .ok()
        .filter(|format| matches!(format, ImageFormat::Png | ImageFormat::Jpeg));
    let Some(format) = format else {
        return Err(fault("is neither PNG nor JPEG".to_owned()));
    };
    let mut decoder = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_IMAGE_EDGE);
    limits.max_image_height = Some(MAX_IMAGE_EDGE);
    limits.max_alloc = Some(4 * u64::from(MAX_IMAGE_EDGE) * u64::from(MAX_IMAGE_EDGE));
    decoder.limits(limits);
    let picture = decoder
        .decode()
        .map_err(|error| fault(format!("cannot be decoded: {error}")))?;
    let bits = picture.color().bits_per_pixel() / u16::from(picture.color().channel_count());
    let warning =
        (bits > 8).then(|| format!("{place} '{name}': {bits} bits per channel are reduced to 8"));
    let rgba = picture.into_rgba8();
    let (width, height) = rgba.dimensions();
    if width == 0 || height == 0 {
        return Err(fault("has no pixels".to_owned()));
    }
    Ok((
        Image {
            name,
            width,
            height,
            rgba8: rgba.into_raw(),
        },
        warning,
    ))
}
