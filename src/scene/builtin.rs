//! Embedded scenes: the files under `assets/`. They are made by code, `examples/make_assets`, which also
//! says what is known of them in closed form.

use super::{Scene, SceneError};
use crate::settings::BuiltinScene;
use crate::settings::Choice as _;

/// Names of all embedded scenes.
pub const NAMES: &[&str] = BuiltinScene::WORDS;

/// The binary glTF of an embedded scene; `name` with or without the prefix `builtin:`.
///
/// # Errors
/// An unknown name; the message lists [`NAMES`].
pub fn glb(name: &str) -> Result<&'static [u8], SceneError> {
    let name = name.strip_prefix("builtin:").unwrap_or(name);
    Ok(match BuiltinScene::from_word(name) {
        Some(BuiltinScene::Cornell) => include_bytes!("../../assets/cornell.glb"),
        Some(BuiltinScene::Plane) => include_bytes!("../../assets/plane.glb"),
        Some(BuiltinScene::Sphere) => include_bytes!("../../assets/sphere.glb"),
        Some(BuiltinScene::Caustic) => include_bytes!("../../assets/caustic.glb"),
        Some(BuiltinScene::Gallery) => include_bytes!("../../assets/gallery.glb"),
        Some(BuiltinScene::Parade) => include_bytes!("../../assets/parade.glb"),
        None => {
            return Err(SceneError::UnknownBuiltin {
                name: name.to_owned(),
                known: NAMES.join(", "),
            });
        }
    })
}

/// See [`Scene::builtin`].
pub(super) fn load(name: &str) -> Result<Scene, SceneError> {
    let name = name.strip_prefix("builtin:").unwrap_or(name);
    Scene::from_bytes(&format!("builtin:{name}"), glb(name)?)
}
