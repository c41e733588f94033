//! Embedded scenes: the files under `assets/`. They are made by code, `examples/make_assets`; what is known of them in closed
//! form stands here.

pub mod caustic;
pub mod cornell;
pub mod parade;
pub mod plane;
pub mod sphere;

use super::{Scene, SceneError};

/// Names of all embedded scenes.
pub const NAMES: [&str; 6] = ["cornell", "plane", "sphere", "caustic", "gallery", "parade"];

/// The binary glTF of an embedded scene; `name` with or without the prefix `builtin:`.
///
/// # Errors
/// An unknown name; the message lists [`NAMES`].
pub fn glb(name: &str) -> Result<&'static [u8], SceneError> {
    Ok(match name.strip_prefix("builtin:").unwrap_or(name) {
        "cornell" => include_bytes!("../../../assets/cornell.glb"),
        "plane" => include_bytes!("../../../assets/plane.glb"),
        "sphere" => include_bytes!("../../../assets/sphere.glb"),
        "caustic" => include_bytes!("../../../assets/caustic.glb"),
        "gallery" => include_bytes!("../../../assets/gallery.glb"),
        "parade" => include_bytes!("../../../assets/parade.glb"),
        unknown => {
            return Err(SceneError::UnknownBuiltin {
                name: unknown.to_owned(),
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
