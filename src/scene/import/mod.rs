//! glTF 2.0 import.
//!
//! `container` reads the file and its chunks, `document` checks the JSON, `resources` fetches buffers and images,
//! `accessors` reads typed data out of buffers with every length checked first, and `geometry`, `materials` and `nodes`
//! turn the rest into a [`Scene`]. The `gltf` crate supplies the JSON types; its document wrapper is not used, because
//! it panics on some malformed files (a `POSITION` accessor out of range, for one).

mod accessors;
mod container;
mod document;
mod extensions;
mod geometry;
mod materials;
mod motion;
mod nodes;
mod resources;
mod tangents;

use std::path::Path;

use super::{Scene, SceneError, SourceFacts};
pub(super) use container::read_file;
use document::Document;
pub(super) use nodes::transform_fault;

/// What the importer has found so far, beside the scene itself.
#[derive(Default)]
pub(super) struct Notes {
    /// One line each.
    pub warnings: Vec<String>,
    /// Facts for the report of needs.
    pub source: SourceFacts,
}

impl Notes {
    pub fn warn(&mut self, line: impl Into<String>) {
        self.warnings.push(line.into());
    }
}

/// See [`Scene::load`].
pub(super) fn load(path: &Path) -> Result<Scene, SceneError> {
    let bytes = read_file(path)?;
    from_bytes(path, &bytes)
}

/// See [`Scene::from_bytes`].
pub(super) fn from_bytes(path: &Path, bytes: &[u8]) -> Result<Scene, SceneError> {
    let mut notes = Notes::default();
    let file = container::split(path, bytes, &mut notes)?;
    let document = Document::parse(path, file.json)?;
    extensions::check(&document, &mut notes)?;
    document.validate()?;

    let buffers = resources::load_buffers(&document, file.blob)?;
    let mut library = materials::Library::import(&document, &mut notes)?;
    let meshes = geometry::import_meshes(&document, &buffers, &mut library, &mut notes)?;
    let images = resources::load_images(&document, &buffers, &library.image_sources, &mut notes)?;
    let mut graph = nodes::import(&document, &meshes, &mut notes)?;
    let reader = accessors::Reader {
        document: &document,
        buffers: &buffers,
    };
    let skins = motion::import_skins(&document, &reader, &mut graph.nodes, &meshes, &mut notes)?;
    let animations =
        motion::import_animations(&document, &reader, &graph.nodes, &meshes, &mut notes)?;
    notes.source.motion = motion::summary(&graph.nodes, &meshes, &animations);

    let name = path.file_stem().map_or_else(
        || path.display().to_string(),
        |stem| stem.to_string_lossy().into_owned(),
    );
    Ok(Scene {
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
        environment: None,
        warnings: notes.warnings,
        source: notes.source,
    })
}

/// A file taken apart for writing it again.
pub(super) struct RawParts {
    /// All of its JSON, `extras` and all.
    pub json: serde_json::Value,
    /// One per buffer, cut to its declared length.
    pub buffers: Vec<Vec<u8>>,
    /// One per image: the bytes of those that lie in files of their own.
    pub images: Vec<Option<Vec<u8>>>,
}

/// Takes a file apart: its JSON as it stands, and the bytes that it refers to.
pub(super) fn raw_parts(path: &Path, bytes: &[u8]) -> Result<RawParts, SceneError> {
    let file = container::split(path, bytes, &mut Notes::default())?;
    let json = serde_json::from_slice(file.json)
        .map_err(|error| SceneError::invalid(path, format!("not glTF: JSON error: {error}")))?;
    let document = Document::parse(path, file.json)?;
    Ok(RawParts {
        json,
        buffers: resources::load_buffers(&document, file.blob)?,
        images: resources::read_image_files(&document)?,
    })
}
