//! Embedded scenes. Most are files under `assets/`, made by code, `examples/make_assets`, which also says what is known of them
//! in closed form; large ones are made when they are asked for.

use std::borrow::Cow;

use super::{Environment, Scene, SceneError, generated, surroundings};
use crate::settings::BuiltinScene;
use crate::settings::Choice as _;

/// Names of all embedded scenes.
pub const NAMES: &[&str] = BuiltinScene::WORDS;

/// The binary glTF of an embedded scene; `name` with or without the prefix `builtin:`.
///
/// # Errors
/// An unknown name; the message lists [`NAMES`].
pub fn glb(name: &str) -> Result<Cow<'static, [u8]>, SceneError> {
    let stored: &[u8] = match scene_of(name)? {
        BuiltinScene::Cornell => include_bytes!("../../assets/cornell.glb"),
        BuiltinScene::Plane => include_bytes!("../../assets/plane.glb"),
        BuiltinScene::Sphere => include_bytes!("../../assets/sphere.glb"),
        BuiltinScene::Caustic => include_bytes!("../../assets/caustic.glb"),
        BuiltinScene::Gallery => include_bytes!("../../assets/gallery.glb"),
        BuiltinScene::Parade => include_bytes!("../../assets/parade.glb"),
        BuiltinScene::Terrain => return Ok(generated::terrain()?.into()),
        BuiltinScene::Water => return Ok(generated::water()?.into()),
        BuiltinScene::Bottle => return Ok(generated::bottle()?.into()),
    };
    Ok(stored.into())
}

/// The surroundings that belong to an embedded scene, which a file cannot hold; `name` as for [`glb`].
pub(super) fn environment(name: &str) -> Result<Option<Environment>, SceneError> {
    Ok(match scene_of(name)? {
        BuiltinScene::Terrain | BuiltinScene::Water => {
            Some(surroundings::environment("clouds", 1.0)?)
        }
        _ => None,
    })
}

fn scene_of(name: &str) -> Result<BuiltinScene, SceneError> {
    let name = name.strip_prefix("builtin:").unwrap_or(name);
    BuiltinScene::from_word(name).ok_or_else(|| SceneError::UnknownBuiltin {
        name: name.to_owned(),
        known: NAMES.join(", "),
    })
}

/// See [`Scene::builtin`].
pub(super) fn load(name: &str) -> Result<Scene, SceneError> {
    let name = name.strip_prefix("builtin:").unwrap_or(name);
    let mut scene = Scene::from_bytes(&format!("builtin:{name}"), &glb(name)?)?;
    scene.environment = environment(name)?;
    Ok(scene)
}
