//! Saving an edited scene: the original glTF with what was edited changed in it.
//!
//! Buffers, images, animations, skins, unknown extensions and `extras` stay as they are, and so does every number that no
//! edit has touched. Buffers and pictures beside the original go into the new one, which therefore stands alone; a file that
//! is named as a picture and is none is not carried along. Read back it gives the same
//! scene: transforms are written with all digits of f64, colours and factors with those that f32 needs. JSON values are
//! edited, not the types of `gltf-json`: those know no foreign extensions and would write every number anew.
//!
//! A deleted node stays in the file without a parent and in no scene, so that no number that names a node changes; readers
//! show nothing of it. Environment and scattering models of the user's are no part of glTF and are not saved.

mod materials;
mod nodes;

use std::io::Write as _;
use std::path::Path;

use base64::prelude::{BASE64_STANDARD, Engine as _};
use serde_json::{Value, json};

use super::edit::{Document, Original};
use super::import::{Buffer, RawParts, raw_parts};
use super::{Scene, SceneError, gltf_writer};
use stereolux_base::files::write_beside;
use stereolux_base::limits::LoadBudget;

impl Document {
    /// Writes the scene as `.glb`, or as `.gltf` with its data in it, by the path's extension. It is written beside its place
    /// and renamed. The scene then counts as saved.
    ///
    /// # Errors
    /// One line: another extension, the original's files have gone, parts that were added ([`Scene::add_part`]) are in the
    /// scene, the place cannot be written.
    pub fn save(&mut self, path: &Path) -> Result<(), SceneError> {
        let is = |wanted: &str| {
            path.extension()
                .is_some_and(|found| found.eq_ignore_ascii_case(wanted))
        };
        let bytes = if is("glb") {
            self.to_glb()?
        } else if is("gltf") {
            self.to_gltf()?
        } else {
            return Err(SceneError::Write {
                what: format!(
                    "{}: scenes are saved as .glb or .gltf; give the file one of these extensions",
                    path.display()
                ),
            });
        };
        write_beside(path, |out| out.write_all(&bytes)).map_err(|error| SceneError::Write {
            what: format!("{}: cannot be written: {error}", path.display()),
        })?;
        self.mark_saved();
        Ok(())
    }

    /// The scene as binary glTF.
    ///
    /// # Errors
    /// As [`Document::save`].
    pub fn to_glb(&self) -> Result<Vec<u8>, SceneError> {
        let (root, bin) = patched(self.original(), self.scene())?;
        gltf_writer::assemble(root.to_string().into_bytes(), bin)
    }

    /// The scene as glTF, its data embedded as base64.
    ///
    /// # Errors
    /// As [`Document::save`].
    pub fn to_gltf(&self) -> Result<Vec<u8>, SceneError> {
        let (mut root, bin) = patched(self.original(), self.scene())?;
        if !bin.is_empty() {
            root["buffers"][0]["uri"] = json!(format!(
                "data:application/octet-stream;base64,{}",
                BASE64_STANDARD.encode(&bin)
            ));
        }
        let mut text = serde_json::to_string_pretty(&root).map_err(|error| SceneError::Write {
            what: error.to_string(),
        })?;
        text.push('\n');
        Ok(text.into_bytes())
    }
}

/// The edited JSON, and the bytes of its only buffer.
fn patched(original: &Original, scene: &Scene) -> Result<(Value, Vec<u8>), SceneError> {
    let budget = LoadBudget::new(original.limits);
    if let Some(file) = original.files.iter().find(|file| !file.is_unchanged()) {
        return Err(SceneError::Write {
            what: format!(
                "{}: has changed or gone since the scene was read; put it back as it was, or open the scene again",
                file.path.display()
            ),
        });
    }
    if !scene.parts.is_empty() {
        return Err(SceneError::Write {
            what: format!(
                "{}: the scene has parts that are not its file's (other files, panels, hands); take them out before it is saved",
                original.path().display()
            ),
        });
    }
    let RawParts {
        mut json,
        buffers,
        images,
    } = raw_parts(original.path(), &original.bytes, &budget)?;
    let pictures = images.iter().flatten().map(Vec::len);
    let embedded: usize = buffers
        .iter()
        .map(|buffer| buffer.len())
        .chain(pictures)
        .sum();
    // Gathered in one buffer, and written into a file behind the JSON, as base64 at worst.
    budget
        .take(3 * embedded as u64, "the bytes of its buffers and images")
        .map_err(|error| SceneError::over(original.path(), &error))?;
    let bin = embed(&mut json, &buffers, images);
    nodes::patch(&mut json, original, scene);
    materials::patch(&mut json, original, scene)?;
    Ok((json, bin))
}

/// Whether an extension says where a compressed copy of a view lies.
fn is_compression(extension: &str) -> bool {
    extension.ends_with("_meshopt_compression")
}

/// A number that was read as an integer; it may be written as 1.0 (glTF 2.0, section 2.7).
fn whole(object: &Value, key: &str) -> Option<u64> {
    let value = object.get(key)?;
    value
        .as_u64()
        .or_else(|| value.as_f64().map(|value| value as u64))
}

/// Gathers all buffers, and images that lie in other files, into one buffer.
fn embed(root: &mut Value, buffers: &[Buffer<'_>], images: Vec<Option<Vec<u8>>>) -> Vec<u8> {
    let mut bin = Vec::new();
    let mut starts = Vec::new();
    for buffer in buffers {
        bin.resize(bin.len().next_multiple_of(4), 0);
        starts.push(bin.len());
        bin.extend_from_slice(buffer);
    }
    // The copies that are not compressed were read; the others would point into buffers that are no more.
    if let Some(used) = root.get_mut("extensionsUsed").and_then(Value::as_array_mut) {
        used.retain(|name| !name.as_str().is_some_and(is_compression));
    }
    for view in list_mut(root, "bufferViews") {
        if let Some(extensions) = view.get_mut("extensions").and_then(Value::as_object_mut) {
            extensions.retain(|name, _| !is_compression(name));
        }
        let buffer = whole(view, "buffer").unwrap_or(0) as usize;
        let start = starts.get(buffer).copied().unwrap_or_default();
        if buffer > 0 {
            view["buffer"] = json!(0);
        }
        if start > 0 {
            let offset = whole(view, "byteOffset").unwrap_or(0);
            view["byteOffset"] = json!(offset + start as u64);
        }
    }
    let mut views = root
        .get("bufferViews")
        .and_then(Value::as_array)
        .map_or(0, Vec::len);
    let mut added = Vec::new();
    for (image, bytes) in list_mut(root, "images").iter_mut().zip(images) {
        let Some(bytes) = bytes else { continue };
        bin.resize(bin.len().next_multiple_of(4), 0);
        added.push(json!({ "buffer": 0, "byteOffset": bin.len(), "byteLength": bytes.len() }));
        bin.extend_from_slice(&bytes);
        if let Some(object) = image.as_object_mut() {
            let uri = object.shift_remove("uri");
            // The importer calls an image by its file where it has no name.
            if let Some(uri) = uri
                && !object.contains_key("name")
            {
                object.insert("name".to_owned(), uri);
            }
            object.insert("bufferView".to_owned(), json!(views));
            if !object.contains_key("mimeType")
                && let Some(kind) = media_type(&bytes)
            {
                object.insert("mimeType".to_owned(), json!(kind));
            }
        }
        views += 1;
    }
    if !added.is_empty() {
        entry(root, "bufferViews", || json!([]));
        if let Some(list) = root["bufferViews"].as_array_mut() {
            list.extend(added);
        }
    }
    if !bin.is_empty() {
        let mut only = list_mut(root, "buffers").first().cloned();
        let only = only.get_or_insert_with(|| json!({}));
        if let Some(object) = only.as_object_mut() {
            object.shift_remove("uri");
            object.insert("byteLength".to_owned(), json!(bin.len()));
        }
        root["buffers"] = json!([only]);
    }
    bin
}

fn media_type(bytes: &[u8]) -> Option<&'static str> {
    match image::guess_format(bytes).ok()? {
        image::ImageFormat::Png => Some("image/png"),
        image::ImageFormat::Jpeg => Some("image/jpeg"),
        _ => None,
    }
}

/// The entries of a list of the document; empty if it has none.
fn list_mut<'a>(root: &'a mut Value, key: &str) -> &'a mut [Value] {
    match root.get_mut(key).and_then(Value::as_array_mut) {
        Some(list) => list,
        None => &mut [],
    }
}

/// Takes keys out of an object.
fn remove(object: &mut Value, keys: &[&str]) {
    if let Some(object) = object.as_object_mut() {
        for key in keys {
            object.shift_remove(*key);
        }
    }
}

/// The value under a key, made by `default` where there is none.
fn entry<'a>(object: &'a mut Value, key: &str, default: impl FnOnce() -> Value) -> &'a mut Value {
    if object.get(key).is_none() {
        object[key] = default();
    }
    &mut object[key]
}

/// An extension's object in `object`, made where there is none; the document says then that it is used.
fn extension<'a>(
    object: &'a mut Value,
    name: &'static str,
    used: &mut Vec<&'static str>,
) -> &'a mut Value {
    if !used.contains(&name) {
        used.push(name);
    }
    let extensions = entry(object, "extensions", || json!({}));
    entry(extensions, name, || json!({}))
}

/// Notes extensions as used.
fn note_used(root: &mut Value, used: &[&'static str]) {
    if used.is_empty() {
        return;
    }
    entry(root, "extensionsUsed", || json!([]));
    if let Some(list) = root["extensionsUsed"].as_array_mut() {
        for name in used {
            if !list.iter().any(|known| known == name) {
                list.push(json!(name));
            }
        }
    }
}

/// Shares a colour out to a factor within 0 to 1 and a strength of at least 1 whose products are the colour exactly: the
/// strength is a power of two.
fn factor_and_strength(color: [f32; 3]) -> ([f32; 3], f32) {
    let most = color.iter().copied().fold(0.0_f32, f32::max);
    let mut strength = 1.0_f32;
    while strength < most {
        strength *= 2.0;
    }
    (color.map(|channel| channel / strength), strength)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_survive_being_shared_out() {
        for color in [
            [0.0; 3],
            [0.3, 0.7, 1.0],
            [17.3, 4.1, 0.1],
            [3.0e7, 1.0, 0.0],
        ] {
            let (factor, strength) = factor_and_strength(color);
            assert!(factor.iter().all(|channel| (0.0..=1.0).contains(channel)));
            assert_eq!(factor.map(|channel| channel * strength), color);
        }
    }
}
