//! glTF 2.0 import.
//!
//! `container` reads the file and its chunks, `document` checks the JSON, `resources` fetches buffers and images,
//! `accessors` reads typed data out of buffers with every length checked first, and `geometry`, `materials` and `nodes`
//! turn the rest into a [`Scene`]. The `gltf` crate supplies the JSON types; its document wrapper is not used, because
//! it panics on some malformed files (a `POSITION` accessor out of range, for one).

mod accessors;
mod brightness;
mod container;
mod document;
mod extensions;
mod geometry;
mod materials;
mod motion;
mod nodes;
mod resources;
pub(crate) mod tangents;

use std::fmt::Display;
use std::path::{Path, PathBuf};

use super::needs::LeftOut;
use super::{Scene, SceneError, SourceFacts, demand};
pub(super) use container::read_file;
use document::Document;
pub(super) use nodes::{NOT_FINITE, fits_f32, transform_fault};
pub(super) use resources::Buffer;
use stereolux_base::limits::LoadBudget;
use stereolux_base::printable;

/// Warnings that are kept of one file; the others are counted.
const MOST_WARNINGS: usize = 100;

/// What the importer has found so far, beside the scene itself.
#[derive(Default)]
pub(super) struct Notes {
    warnings: Vec<String>,
    unsaid: usize,
    /// Facts for the report of needs.
    pub source: SourceFacts,
}

impl Notes {
    /// Keeps a warning, as one line fit for a terminal. What is beyond the hundredth is not even put into words.
    pub fn warn(&mut self, line: impl Display) {
        if self.warnings.len() < MOST_WARNINGS {
            self.warnings.push(printable::line(&line.to_string()));
        } else {
            self.unsaid += 1;
        }
    }

    /// Notes something of the file that is not modelled; of very many the first.
    pub fn leave_out(&mut self, what: &str, why: impl Into<String>) {
        if self.source.left_out.len() < MOST_WARNINGS {
            let what = printable::line(what);
            self.source.left_out.push(LeftOut::new(what, why));
        }
    }

    /// Notes a file outside the scene's folder that is read.
    pub fn read_outside(&mut self, path: &Path) {
        let path = path.display().to_string();
        if !self.source.outside_files.contains(&path)
            && self.source.outside_files.len() < MOST_WARNINGS
        {
            self.warn(format_args!(
                "{path} lies outside the scene's folder and is read (--allow-outside)"
            ));
            self.source.outside_files.push(path);
        }
    }

    fn into_warnings(mut self) -> (Vec<String>, SourceFacts) {
        if self.unsaid > 0 {
            self.warnings
                .push(format!("{} more warnings are not shown", self.unsaid));
        }
        (self.warnings, self.source)
    }
}

/// What the file calls something, or else its kind and number.
fn named(name: &Option<String>, kind: &str, index: usize) -> String {
    name.clone().unwrap_or_else(|| format!("{kind} {index}"))
}

/// See [`Scene::from_bytes`].
pub(super) fn from_bytes(
    path: &Path,
    bytes: &[u8],
    budget: &LoadBudget,
) -> Result<Scene, SceneError> {
    let mut notes = Notes::default();
    let file = container::split(path, bytes, &mut notes)?;
    let document = Document::parse(path, file.json, budget)?;
    extensions::check(&document, &mut notes)?;
    document.validate()?;

    let places = resources::locate(&document, &mut notes)?;
    let buffers = resources::load_buffers(&document, &places, file.blob)?;
    let reader = accessors::Reader {
        document: &document,
        buffers: &buffers,
    };
    let mut library = materials::Library::import(&document, &mut notes)?;
    let meshes = geometry::import_meshes(&reader, &mut library, &mut notes)?;
    library.find_panes(&meshes, &mut notes);
    let images = resources::load_images(&reader, &places, &library.image_sources, &mut notes)?;
    let mut graph = nodes::import(&document, &meshes, &mut notes)?;
    let skins = motion::import_skins(&document, &reader, &mut graph.nodes, &meshes, &mut notes)?;
    let animations =
        motion::import_animations(&document, &reader, &graph.nodes, &meshes, &mut notes)?;
    notes.source.motion = motion::summary(&graph.nodes, &meshes, &animations);

    let name = path.file_stem().map_or_else(
        || path.display().to_string(),
        |stem| stem.to_string_lossy().into_owned(),
    );
    let mut scene = Scene {
        name,
        nodes: graph.nodes,
        roots: graph.roots,
        meshes,
        materials: library.materials,
        textures: library.textures,
        images,
        lights: graph.lights,
        cameras: graph.cameras,
        skins,
        animations,
        ..Scene::default()
    };
    nodes::check_placements(&document, &scene, &mut notes)?;
    demand::take(&scene, budget).map_err(|error| SceneError::over(path, &error))?;
    brightness::check(&scene, &mut notes);
    (scene.warnings, scene.source) = notes.into_warnings();
    Ok(scene)
}

/// See [`Scene::self_contained`].
pub(super) fn self_contained(path: &Path, bytes: &[u8]) -> Result<Scene, SceneError> {
    let file = container::split(path, bytes, &mut Notes::default())?;
    let own_budget = LoadBudget::default();
    let document = Document::parse(path, file.json, &own_budget)?;
    let root = &document.root;
    let buffers = root.buffers.iter().map(|buffer| &buffer.uri);
    let mut uris = buffers.chain(root.images.iter().map(|image| &image.uri));
    match uris.find_map(|uri| uri.as_ref().filter(|uri| !container::is_data_uri(uri))) {
        Some(uri) => {
            Err(document.fault(format!("names the file '{uri}' and must hold all itself")))
        }
        None => from_bytes(path, bytes, &LoadBudget::default()),
    }
}

/// A file taken apart for writing it again.
pub(super) struct RawParts<'a> {
    /// All of its JSON, `extras` and all.
    pub json: serde_json::Value,
    /// Its buffers.
    pub buffers: Vec<Buffer<'a>>,
    /// One per image: the bytes of those that lie in files of their own and are pictures.
    pub images: Vec<Option<Vec<u8>>>,
}

/// The files that a file's buffers and images lie in.
pub(super) fn files(
    path: &Path,
    bytes: &[u8],
    budget: &LoadBudget,
) -> Result<Vec<PathBuf>, SceneError> {
    let mut notes = Notes::default();
    let file = container::split(path, bytes, &mut notes)?;
    let document = Document::parse(path, file.json, budget)?;
    let places = resources::locate(&document, &mut notes)?;
    Ok(places.files().cloned().collect())
}

/// Takes a file apart: its JSON as it stands, and the bytes that it refers to.
pub(super) fn raw_parts<'a>(
    path: &Path,
    bytes: &'a [u8],
    budget: &LoadBudget,
) -> Result<RawParts<'a>, SceneError> {
    let mut notes = Notes::default();
    let file = container::split(path, bytes, &mut notes)?;
    let document = Document::parse(path, file.json, budget)?;
    let json = serde_json::from_slice(file.json)
        .map_err(|error| SceneError::invalid(path, format!("not glTF: JSON error: {error}")))?;
    let places = resources::locate(&document, &mut notes)?;
    Ok(RawParts {
        json,
        buffers: resources::load_buffers(&document, &places, file.blob)?,
        images: resources::read_image_files(&document, &places)?,
    })
}
