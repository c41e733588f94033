//! A scene as the settings ask for it: loaded, scaled, lit.

use crate::limits::LoadBudget;
use crate::renderer::packing::mean_glow;
use crate::scene::builtin::PREFIX;
#[cfg(feature = "viewer")]
use crate::scene::edit::Document;
use crate::scene::needs::LightCounts;
use crate::scene::{Environment, Needs, Scene, SceneError, load_environment_within};
use crate::settings::{Light, Settings};

/// A scene whose surfaces alone shine is lit if what they emit would give a white surface this radiance, were it spread evenly
/// over all surfaces: less is a picture nearly black. The embedded scenes with lamps have 0.078 and more, a helmet with glowing
/// displays 0.002.
const LEAST_GLOW: f64 = 0.01;
/// Light for a scene that has none.
const STUDIO: &str = "builtin:studio";

/// An environment that `light` stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChosenLight {
    /// Its path.
    pub path: &'static str,
    /// `auto` chose it, for this scene alone.
    pub is_auto: bool,
}

impl std::fmt::Display for ChosenLight {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let why = if self.is_auto {
            "the scene has no light to be seen by"
        } else {
            "asked for"
        };
        write!(f, "{} ({why})", self.path)
    }
}

/// A scene as it is rendered.
pub struct Loaded {
    /// The scene, scaled, with its environment.
    pub scene: Scene,
    /// With the environment that `light` stands for.
    pub settings: Settings,
    /// What lights the scene beside its own lights; `None`: nothing that was not asked for by its path.
    pub light: Option<ChosenLight>,
}

impl Loaded {
    /// Loads the settings' scene by `--scene`'s rules.
    ///
    /// # Errors
    /// [`SceneError`]: the scene, its environment or its clip.
    pub fn open(settings: &Settings) -> Result<Self, SceneError> {
        let budget = LoadBudget::new(settings.limits.load());
        let scene = match settings.scene.strip_prefix(PREFIX) {
            Some(name) => Scene::builtin_within(name, &budget)?,
            None => Scene::load_within(&settings.scene, &budget)?,
        };
        Self::of(scene, settings, &budget)
    }

    /// Scales and lights a scene as the settings say.
    ///
    /// # Errors
    /// [`SceneError`]: the environment or the clip.
    pub fn of(
        mut scene: Scene,
        settings: &Settings,
        budget: &LoadBudget,
    ) -> Result<Self, SceneError> {
        scene.scale(settings.scene_scale);
        let mut settings = settings.clone();
        let light = light_scene(&mut settings, &scene);
        let (environment, warnings) = surround(scene.environment.take(), &settings, budget)?;
        scene.environment = environment;
        scene.warnings.extend(warnings);
        scene.clip(&settings.render.animation.clip)?;
        scene.warnings.extend(unlit_or_odd(&scene, &settings));
        Ok(Self {
            scene,
            settings,
            light,
        })
    }
}

/// A scene that can be edited, as it is shown.
#[cfg(feature = "viewer")]
pub struct LoadedDocument {
    /// The scene, scaled, with its environment; its clip is not looked for.
    pub document: Document,
    /// With the environment that `light` stands for.
    pub settings: Settings,
    /// As [`Loaded::light`].
    pub light: Option<ChosenLight>,
    /// What is odd about the scene, one line each.
    pub warnings: Vec<String>,
}

#[cfg(feature = "viewer")]
impl LoadedDocument {
    /// Loads the settings' scene by `--scene`'s rules. `is_auto_lit`: their environment is what `auto` chose for an earlier
    /// scene, and does not count.
    ///
    /// # Errors
    /// [`SceneError`]: the scene or its environment.
    pub fn open(settings: &Settings, is_auto_lit: bool) -> Result<Self, SceneError> {
        let budget = LoadBudget::new(settings.limits.load());
        let mut document = Document::load_within(&settings.scene, &budget)?;
        document.scale(settings.scene_scale);
        let mut settings = settings.clone();
        if is_auto_lit {
            settings.environment.path.clear();
        }
        let light = light_scene(&mut settings, document.scene());
        let own = document.scene().environment.clone();
        let (environment, mut warnings) = surround(own, &settings, &budget)?;
        document.set_environment(environment);
        warnings.extend(document.scene().size_warning());
        warnings.extend_from_slice(&document.scene().warnings);
        Ok(Self {
            document,
            settings,
            light,
            warnings,
        })
    }
}

/// What the settings put around a scene, as strong as they say: the environment of their path, else the scene's own. And
/// warnings, one line each.
///
/// # Errors
/// As [`load_environment_within`].
fn surround(
    own: Option<Environment>,
    settings: &Settings,
    budget: &LoadBudget,
) -> Result<(Option<Environment>, Vec<String>), SceneError> {
    let chosen = &settings.environment;
    let strength = chosen.strength as f32;
    if chosen.path.is_empty() {
        return Ok((own.map(|own| own.scaled(strength)), Vec::new()));
    }
    let (environment, warnings) = load_environment_within(&chosen.path, strength, budget)?;
    Ok((Some(environment), warnings))
}

/// Puts the environment that `light` stands for into the settings.
fn light_scene(settings: &mut Settings, scene: &Scene) -> Option<ChosenLight> {
    let is_bare = settings.environment.path.is_empty();
    let (path, is_auto) = match settings.light {
        Light::Auto if is_bare && !is_lit(scene) => (STUDIO, true),
        Light::Studio => (STUDIO, false),
        Light::Sky => ("builtin:sky", false),
        Light::Auto | Light::None => return None,
    };
    path.clone_into(&mut settings.environment.path);
    if !is_auto {
        // Done: settings that name a path may not ask for studio or sky besides.
        settings.light = Light::None;
    }
    Some(ChosenLight { path, is_auto })
}

/// Whether more of a scene is to be seen than what glows.
fn is_lit(scene: &Scene) -> bool {
    let Needs {
        environment,
        lights,
        ..
    } = Needs::of(scene);
    let glowing = LightCounts {
        emissive_triangles: lights.emissive_triangles,
        ..LightCounts::default()
    };
    let glows = || lights != LightCounts::default() && mean_glow(scene) >= LEAST_GLOW;
    environment || lights != glowing || glows()
}

/// Warnings that the scene will be black, or is of a size that two eyes cannot make much of.
fn unlit_or_odd(scene: &Scene, settings: &Settings) -> Vec<String> {
    let mut warnings = Vec::new();
    if !is_lit(scene) {
        warnings.push(format!(
            "{} has no light to be seen by and will be black, but for what glows: give --light auto, --light sky or \
             environment.path",
            settings.scene
        ));
    }
    warnings.extend(scene.size_warning());
    warnings
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The box's lamp emits 0.47 W over 1.93 m^2: as a mean radiance 0.078, eight times the least.
    #[test]
    fn a_scene_that_only_glows_is_lit_as_one_without_light() {
        for (share, expected) in [
            (1.0, None),
            (0.2, None),
            (0.1, Some(STUDIO)),
            (0.0, Some(STUDIO)),
        ] {
            let mut scene = Scene::builtin("cornell").unwrap();
            for material in &mut scene.materials {
                material.emission = material.emission.map(|channel| share * channel);
            }
            let mut settings = Settings::default();
            let warned = unlit_or_odd(&scene, &settings);
            assert_eq!(warned.len(), usize::from(expected.is_some()));
            settings.light = Light::Auto;
            let chosen = light_scene(&mut settings, &scene);
            assert_eq!(
                chosen.map(|light| light.path),
                expected,
                "{share} of its lamp"
            );
        }
    }

    /// The viewer changes them one at a time, and saves them for `--config`.
    #[test]
    fn settings_of_a_scene_that_was_lit_are_accepted_again() {
        use crate::options;
        for light in [Light::Auto, Light::Studio, Light::Sky] {
            let mut settings = Settings {
                light,
                ..Settings::default()
            };
            let mut scene = Scene::builtin("cornell").unwrap();
            scene
                .materials
                .iter_mut()
                .for_each(|material| material.emission = [0.0; 3]);
            light_scene(&mut settings, &scene).unwrap();
            let changed = options::changed(&settings, "seed", &serde_json::json!(7)).unwrap();
            assert_eq!(changed.environment, settings.environment);
        }
    }

    #[test]
    fn a_scenes_own_surroundings_are_as_strong_as_the_settings_say() {
        let budget = LoadBudget::default();
        let own = Scene::builtin("water").unwrap().environment.unwrap();
        for (strength, path) in [(0.0, ""), (2.0, ""), (2.0, "builtin:clouds")] {
            let mut settings = Settings::default();
            settings.environment.strength = strength;
            settings.environment.path = path.to_owned();
            let (around, _) = surround(Some(own.clone()), &settings, &budget).unwrap();
            let around = around.unwrap();
            for (texel, own) in around.radiance.iter().zip(&own.radiance) {
                assert_eq!(*texel, own.map(|channel| channel * strength as f32));
            }
        }
    }
}
