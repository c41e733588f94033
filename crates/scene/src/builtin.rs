//! Embedded scenes. Most are files under `assets/`, made by code, `examples/make_assets`, which also says what is known of them
//! in closed form; large ones are made when they are asked for.

use std::borrow::Cow;
use std::path::Path;

use stereolux_base::limits::LoadBudget;

use super::{Environment, Scene, SceneError, generated, import, surroundings};

/// What names of embedded scenes and surroundings begin with where files might be meant.
pub const PREFIX: &str = "builtin:";

/// Where an embedded scene's binary glTF comes from.
enum Source {
    Stored(&'static [u8]),
    Generated(fn() -> Result<Vec<u8>, SceneError>),
}
use Source::{Generated, Stored};

/// Every embedded scene, in the order of listings.
const SCENES: [(&str, Source); 9] = [
    // The Cornell box with its published measurements.
    (
        "cornell",
        Stored(include_bytes!("../../../assets/cornell.glb")),
    ),
    // One Lambert plane that faces the viewer, lit by a point light.
    ("plane", Stored(include_bytes!("../../../assets/plane.glb"))),
    // A closed diffuse sphere seen from inside, with a point light at its centre.
    (
        "sphere",
        Stored(include_bytes!("../../../assets/sphere.glb")),
    ),
    // A glass ball over a diffuse floor, lit from above by a square lamp.
    (
        "caustic",
        Stored(include_bytes!("../../../assets/caustic.glb")),
    ),
    // A furnished interior with daylight, lamps, glass and metal.
    (
        "gallery",
        Stored(include_bytes!("../../../assets/gallery.glb")),
    ),
    // A room in which everything that can be animated moves.
    (
        "parade",
        Stored(include_bytes!("../../../assets/parade.glb")),
    ),
    // Mountains of 1.7 million triangles under clouds.
    ("terrain", Generated(generated::terrain)),
    // A pond under clouds: stones and posts seen through waves.
    ("water", Generated(generated::water)),
    // A glass bottle and a lemon on a table.
    ("bottle", Generated(generated::bottle)),
];
/// Scenes whose surroundings are clouds.
const UNDER_CLOUDS: [&str; 2] = ["terrain", "water"];

/// Names of all embedded scenes.
pub const NAMES: [&str; SCENES.len()] = {
    let mut names = [""; SCENES.len()];
    let mut at = 0;
    while at < names.len() {
        names[at] = SCENES[at].0;
        at += 1;
    }
    names
};

/// The binary glTF of an embedded scene; `name` with or without the prefix `builtin:`.
///
/// # Errors
/// An unknown name; the message lists [`NAMES`].
pub fn glb(name: &str) -> Result<Cow<'static, [u8]>, SceneError> {
    let name = bare(name);
    let found = SCENES.iter().find(|(known, _)| *known == name);
    match found {
        Some((_, Stored(bytes))) => Ok((*bytes).into()),
        Some((_, Generated(make))) => Ok(make()?.into()),
        None => Err(SceneError::UnknownBuiltin {
            name: name.to_owned(),
            known: NAMES.join(", "),
        }),
    }
}

fn bare(name: &str) -> &str {
    name.strip_prefix(PREFIX).unwrap_or(name)
}

/// See [`Scene::builtin`].
pub(super) fn load(name: &str, budget: &LoadBudget) -> Result<Scene, SceneError> {
    let name = bare(name);
    let path = format!("{PREFIX}{name}");
    let mut scene = import::from_bytes(Path::new(&path), &glb(name)?, budget)?;
    scene.environment = environment(name)?;
    Ok(scene)
}

/// The surroundings that belong to an embedded scene, which a file cannot hold; `name` as for [`glb`].
pub fn environment(name: &str) -> Result<Option<Environment>, SceneError> {
    let clouds = UNDER_CLOUDS.contains(&bare(name));
    clouds
        .then(|| surroundings::environment("clouds", 1.0))
        .transpose()
}
