//! Buffers and images: from the GLB chunk, `data:` URIs, files beside the document, and buffer views.

use std::borrow::Cow;
use std::collections::HashMap;
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use image::ImageFormat;
use rayon::prelude::*;

use super::super::{Image, SceneError};
use super::Notes;
use super::accessors::Reader;
use super::container;
use super::document::Document;
use super::extensions;
use stereolux_base::decoding::Encoded;
use stereolux_base::files::{self, Unreachable};

/// Longest image edge; more is taken for a broken header.
const MAX_IMAGE_EDGE: u32 = 16_384;
/// What three pixels of an image take, bytes: in the scene, and packed for the device with a third more for coarser levels.
const THREE_PIXELS_BYTES: u64 = 28;

/// Where the files of a document lie: one entry per buffer and per image, `None` for those without a file. A file that
/// cannot be found is a fault only once it is needed.
pub struct Places {
    buffers: Vec<Option<Found>>,
    images: Vec<Option<Found>>,
}

impl Places {
    /// All that are there.
    pub fn files(&self) -> impl Iterator<Item = &PathBuf> {
        let files = self.buffers.iter().chain(&self.images).flatten();
        files.filter_map(|found| found.as_ref().ok())
    }
}

/// A file, or why there is none.
type Found = Result<PathBuf, String>;

/// Looks for every file that the document names, whether or not it is used.
///
/// # Errors
/// One of them lies outside the scene's folder, and that is not allowed.
pub fn locate(document: &Document<'_>, notes: &mut Notes) -> Result<Places, SceneError> {
    let mut of = |list: &str, index: usize, uri: Option<&String>| {
        let file = uri.filter(|uri| !container::is_data_uri(uri));
        let place = format!("{list}[{index}]");
        file.map(|uri| resolve(document, notes, &place, uri))
            .transpose()
    };
    let root = &document.root;
    let buffers = root.buffers.iter().enumerate();
    let images = root.images.iter().enumerate();
    Ok(Places {
        buffers: buffers
            .map(|(index, buffer)| of("buffers", index, buffer.uri.as_ref()))
            .collect::<Result<_, _>>()?,
        images: images
            .map(|(index, image)| of("images", index, image.uri.as_ref()))
            .collect::<Result<_, _>>()?,
    })
}

/// The file that a relative URI names, or why there is none.
fn resolve(
    document: &Document<'_>,
    notes: &mut Notes,
    place: &str,
    uri: &str,
) -> Result<Found, SceneError> {
    let scheme = uri.split_once(':').map(|(scheme, _)| scheme);
    if scheme.is_some_and(|scheme| {
        scheme.len() > 1 && scheme.bytes().all(|byte| byte.is_ascii_alphanumeric())
    }) {
        return Ok(Err(format!(
            "'{uri}' is not a file beside the scene; only relative paths and data URIs are read"
        )));
    }
    let decoded = match container::percent_decode(uri) {
        Ok(decoded) => decoded,
        Err(what) => return Ok(Err(what)),
    };
    let Ok(name) = String::from_utf8(decoded) else {
        return Ok(Err("the URI is not UTF-8".to_owned()));
    };
    let folder = document.path.parent().unwrap_or(document.path);
    let mut found = files::below(folder, Path::new(&name));
    if matches!(found, Err(Unreachable::Missing(_))) && name != uri {
        // Exporters that forget to percent-encode write file names with a bare percent sign.
        found = match files::below(folder, Path::new(uri)) {
            Err(Unreachable::Missing(_)) => found,
            otherwise => otherwise,
        };
    }
    match found {
        Ok(path) => Ok(Ok(path)),
        Err(Unreachable::Missing(reason)) => Ok(Err(format!(
            "{}: cannot be read: {reason}",
            folder.join(&name).display()
        ))),
        Err(Unreachable::Outside) if document.budget.limits().allow_outside => {
            let path = folder.join(&name);
            notes.read_outside(&path);
            Ok(Ok(path))
        }
        Err(Unreachable::Outside) => Err(SceneError::Outside {
            path: document.path.to_owned(),
            place: place.to_owned(),
            name,
        }),
    }
}

/// A buffer's bytes, cut to its declared length. A file that several name is held once.
pub struct Buffer<'a> {
    bytes: Arc<Cow<'a, [u8]>>,
    length: usize,
}

impl Deref for Buffer<'_> {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.bytes[..self.length]
    }
}

/// Reads the buffers, of each file no more than the document declares.
pub fn load_buffers<'a>(
    document: &Document<'_>,
    places: &Places,
    blob: Option<&'a [u8]>,
) -> Result<Vec<Buffer<'a>>, SceneError> {
    let sources = document.root.buffers.iter().zip(&places.buffers);
    // How much of each file is declared.
    let mut wanted: HashMap<&Path, u64> = HashMap::new();
    for (source, place) in sources.clone() {
        if let Some(Ok(path)) = place {
            let most = wanted.entry(path).or_default();
            *most = source.byte_length.0.max(*most);
        }
    }
    let mut file_of: HashMap<&Path, Arc<Cow<'a, [u8]>>> = HashMap::new();
    let mut loaded = Vec::new();
    for (index, (source, found)) in sources.enumerate() {
        let place = format!("buffers[{index}]");
        let fault = |what: String| document.fault(format!("{place}: {what}"));
        let declared = source.byte_length.0;
        let bytes = match (&source.uri, found, blob) {
            (Some(_), Some(found), _) => {
                let path = found.as_ref().map_err(|what| fault(what.clone()))?;
                if let Some(file) = file_of.get(path.as_path()) {
                    Arc::clone(file)
                } else {
                    let most = wanted.get(path.as_path()).copied().unwrap_or_default();
                    let file = Arc::new(Cow::Owned(read(document, &place, path, most)?));
                    file_of.insert(path, Arc::clone(&file));
                    file
                }
            }
            (Some(uri), None, _) => Arc::new(Cow::Owned(decode_uri(document, &place, uri)?)),
            (None, _, Some(blob)) if index == 0 => Arc::new(Cow::Borrowed(blob)),
            (None, ..) => {
                let raw = document.raw_item("buffers", index);
                return Err(fault(match extensions::compression_of(raw) {
                    Some(name) => format!(
                        "is compressed by {name}, which is not supported: decompress the file first"
                    ),
                    None => "has neither a URI nor a binary chunk".to_owned(),
                }));
            }
        };
        let length = usize::try_from(declared)
            .ok()
            .filter(|length| *length <= bytes.len());
        let Some(length) = length else {
            return Err(fault(format!(
                "declares {declared} bytes, its data has {}",
                bytes.len()
            )));
        };
        loaded.push(Buffer { bytes, length });
    }
    Ok(loaded)
}

/// Reads a file that the document names, at most `most` bytes.
fn read(
    document: &Document<'_>,
    place: &str,
    path: &Path,
    most: u64,
) -> Result<Vec<u8>, SceneError> {
    let fault = |reason: String| {
        document.fault(format!(
            "{place}: {}: cannot be read: {reason}",
            path.display()
        ))
    };
    let length = files::length(path).map_err(fault)?.min(most);
    document.take(length, place, "the file's bytes")?;
    files::read_regular(path, length).map_err(fault)
}

fn decode_uri(document: &Document<'_>, place: &str, uri: &str) -> Result<Vec<u8>, SceneError> {
    document.take(uri.len() as u64, place, "the data URI's bytes")?;
    container::decode_data_uri(uri).map_err(|what| document.fault(format!("{place}: {what}")))
}

/// The bytes of every image that lies in a file of its own and is a picture; none for those in a buffer or a `data:` URI.
/// What does not decode is no picture, whatever its name: it stays where it is, with a warning.
pub fn read_image_files(
    document: &Document<'_>,
    places: &Places,
) -> Result<Vec<Option<Vec<u8>>>, SceneError> {
    let read_one = |(index, found): (usize, &Option<Found>)| {
        let Some(found) = found else { return Ok(None) };
        let place = format!("images[{index}]");
        let stays = |what: &str| {
            let line = document.fault(format!(
                "{place}: {what}; it is not embedded on saving, and the saved scene still refers to its file"
            ));
            log::warn!("{line}");
            Ok(None)
        };
        let bytes = match found {
            Ok(path) => read(document, &place, path, u64::MAX)?,
            // Loading would have refused what a material uses.
            Err(what) => return stays(what),
        };
        let is_picture = open_picture(&bytes).and_then(|picture| {
            let what = format_args!("{place}: its pixels");
            let _held = document
                .budget
                .hold(picture.decoding_bytes(), what)
                .map_err(|error| error.to_string())?;
            picture.decode()
        });
        match is_picture {
            Ok(_) => Ok(Some(bytes)),
            Err(what) => stays(&what),
        }
    };
    places.images.iter().enumerate().map(read_one).collect()
}

/// The header of a PNG or JPEG. What the bytes say counts, whatever the media type or file name claims.
fn open_picture(bytes: &[u8]) -> Result<Encoded<'_>, String> {
    let format = image::guess_format(bytes)
        .ok()
        .filter(|format| matches!(format, ImageFormat::Png | ImageFormat::Jpeg));
    let picture = Encoded::open(bytes, format.ok_or("is neither PNG nor JPEG")?)?;
    let (width, height) = (picture.width, picture.height);
    if width.max(height) > MAX_IMAGE_EDGE {
        return Err(format!(
            "has {width}x{height} pixels; neither side may exceed {MAX_IMAGE_EDGE}"
        ));
    }
    Ok(picture)
}

/// An image of the document that is used.
struct Source<'a> {
    place: String,
    name: String,
    bytes: Cow<'a, [u8]>,
}

/// Decodes the images at `sources`, in that order, on all cores, once there is memory for all of them.
pub fn load_images(
    reader: &Reader<'_>,
    places: &Places,
    sources: &[usize],
    notes: &mut Notes,
) -> Result<Vec<Image>, SceneError> {
    let document = reader.document;
    let fault = |source: &Source<'_>, what: String| {
        document.fault(format!("{} '{}': {what}", source.place, source.name))
    };
    let sources: Vec<Source<'_>> = sources
        .iter()
        .map(|index| find_image(reader, places, *index))
        .collect::<Result<_, _>>()?;
    let mut pictures = Vec::with_capacity(sources.len());
    for source in &sources {
        let picture = open_picture(&source.bytes).map_err(|what| fault(source, what))?;
        let bytes = (picture.pixels() * THREE_PIXELS_BYTES).div_ceil(3);
        let what = format_args!("{}x{} pixels", picture.width, picture.height);
        document.take(bytes, &source.place, what)?;
        pictures.push((source, picture));
    }
    let decode = |(source, picture): &(&Source<'_>, Encoded<'_>)| {
        let decoded = picture.decode().map_err(|what| fault(source, what))?;
        let bits = decoded.color().bits_per_pixel() / u16::from(decoded.color().channel_count());
        let image = Image {
            name: source.name.clone(),
            width: picture.width,
            height: picture.height,
            rgba8: decoded.into_rgba8().into_raw(),
        };
        Ok((image, bits))
    };
    let mut images = Vec::with_capacity(sources.len());
    // As many at once as there is room for, which does not depend on how many cores there are.
    let budget = document.budget;
    let room = (budget.limits().memory_bytes / 4).min(budget.left());
    let mut rest = &pictures[..];
    while !rest.is_empty() {
        let mut bytes = 0;
        let fits = |(_, picture): &&(_, Encoded<'_>)| {
            bytes += picture.decoding_bytes();
            bytes <= room
        };
        let (group, others) = rest.split_at(rest.iter().take_while(fits).count().max(1));
        rest = others;
        let bytes = group.iter().map(|(_, picture)| picture.decoding_bytes());
        let _held = document
            .budget
            .hold(
                bytes.sum(),
                format_args!("{}: its pixels", group[0].0.place),
            )
            .map_err(|error| SceneError::over(document.path, &error))?;
        let decoded: Vec<Result<_, SceneError>> = group.par_iter().map(decode).collect();
        for ((source, _), result) in group.iter().zip(decoded) {
            let (image, bits) = result?;
            if bits > 8 {
                notes.warn(format_args!(
                    "{} '{}': {bits} bits per channel are reduced to 8",
                    source.place, source.name
                ));
            }
            images.push(image);
        }
    }
    Ok(images)
}

fn find_image<'a>(
    reader: &Reader<'a>,
    places: &Places,
    index: usize,
) -> Result<Source<'a>, SceneError> {
    let document = reader.document;
    let place = format!("images[{index}]");
    let fault = |what: String| document.fault(format!("{place}: {what}"));
    let Some(image) = document.root.images.get(index) else {
        let count = document.root.images.len();
        return Err(fault(format!("out of range, there are {count}")));
    };
    let file = places.images.get(index).and_then(Option::as_ref);
    let bytes = match (&image.uri, file, image.buffer_view) {
        (_, Some(Ok(path)), _) => Cow::Owned(read(document, &place, path, u64::MAX)?),
        (_, Some(Err(what)), _) => return Err(fault(what.clone())),
        (Some(uri), None, _) => Cow::Owned(decode_uri(document, &place, uri)?),
        (None, None, Some(view)) => {
            let bytes = reader.view(view.value(), &place)?;
            // No memory, but time: a view may be shared by many images, and each looks it through.
            document.take(bytes.len() as u64, &place, "the picture's bytes")?;
            Cow::Borrowed(bytes)
        }
        (None, None, None) => return Err(fault("has neither a URI nor a buffer view".to_owned())),
    };
    let file_name = image.uri.as_ref().filter(|_| file.is_some());
    let name = image.name.clone().or_else(|| file_name.cloned());
    Ok(Source {
        name: name.unwrap_or_else(|| format!("image {index}")),
        place,
        bytes,
    })
}
