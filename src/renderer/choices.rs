//! What a scene and its settings ask for: shader features, passes, radii. No device is needed to know.

use crate::gpu::shaders::ShaderFeatures;
use crate::passes::{self, Pass};
use crate::scene::{Needs, Scene, SceneFacts};
use crate::settings::{
    DirectLight, Force, Loads, Method, PhotonEstimate, RenderSettings, Reuse, Sampler, Schedule,
    Search, Technique,
};

/// Photons that an automatic radius gathers on average: enough that one photon more or less does not show, few enough
/// that the bias stays small.
const AUTOMATIC_GATHER: f64 = 60.0;
/// Photon paths that land nowhere when the automatic radius is estimated: about one photon is stored per path.
const AUTOMATIC_STORED_PER_PATH: f64 = 1.0;
/// Gather radii below this are raised to it: their square would leave f32's range.
pub(super) const LEAST_RADIUS_M: f64 = 1e-12;

/// Shader features for what a scene needs, with the settings' forces applied.
pub fn shader_features(needs: &Needs, settings: &RenderSettings) -> ShaderFeatures {
    let mut features: ShaderFeatures = needs
        .shader_features()
        .into_iter()
        .map(|(name, on)| (name.to_owned(), on))
        .collect();
    features.insert("sobol".to_owned(), settings.path.sampler == Sampler::Sobol);
    let technique = settings.path.technique;
    // Photon mapping's direct light always uses both.
    let is_path = settings.method == Method::Path;
    let is_alone = |one: Technique| is_path && technique == one;
    features.insert("light_only".to_owned(), is_alone(Technique::Light));
    features.insert("bsdf_only".to_owned(), is_alone(Technique::Bsdf));
    features.insert("parts".to_owned(), splits_light(settings));
    features.insert("svgf".to_owned(), settings.reconstruct.svgf);
    features.insert("still_mean".to_owned(), settings.reconstruct.still);
    // Their code comes with the library that the renderer is given (`install_user_bsdfs`).
    features.insert("user_bsdf".to_owned(), needs.bsdfs.contains(&"user"));
    let fused = settings.photon.schedule == Schedule::Fused;
    for (name, force) in settings.force.by_feature() {
        let needed = features.get(name).copied().unwrap_or(false);
        features.insert(name.to_owned(), force.apply(needed));
    }
    // Normal maps and second coordinates are read through textures: forced in they bring them, forced out they go.
    let is_on = |features: &ShaderFeatures, name: &str| features.get(name) == Some(&true);
    if is_on(&features, "normal_maps") && settings.force.textures != Force::Off {
        features.insert("textures".to_owned(), true);
    }
    if !is_on(&features, "textures") {
        features.insert("normal_maps".to_owned(), false);
        features.insert("uv1".to_owned(), false);
    }
    if fused {
        // Passes after the fused one shade the surface that it gathered at.
        let later = settings.photon.direct == DirectLight::Nee || forms_caustics(&features);
        features.insert("keeps_ends".to_owned(), later);
    }
    features
}

/// Whether frames are split into direct and indirect light: to write them, or to filter them apart.
pub fn splits_light(settings: &RenderSettings) -> bool {
    settings.output.parts || settings.reconstruct.svgf
}

/// Turns of loops that one thread may take on llvmpipe, all of its loops together; beyond them it ends loops silently.
const LOOP_TURNS: u32 = 65_535;
/// Turns of the two searches that find a place in the sky: it has fewer than 2^16 rows and columns.
const ENVIRONMENT_TURNS: u32 = 32;
/// Most samples of one dispatch of the path tracer, and most photon paths of one thread: more than this brings next to
/// nothing.
const MOST_PATHS_PER_THREAD: u32 = 16;

/// Samples of lights that the one of a shadow ray is chosen from. A single light without size leaves nothing to choose.
pub fn light_candidates(
    lights: usize,
    features: &ShaderFeatures,
    settings: &RenderSettings,
) -> u32 {
    let is_on = |name: &str| features.get(name) == Some(&true);
    if lights <= 1 && !is_on("emitters") && !is_on("environment") {
        1
    } else {
        settings.path.light_candidates
    }
}

/// Samples that one dispatch of the path tracer takes. A thread that begins its next path where one ends does not wait for
/// the longest path among the threads that run as one.
#[must_use]
pub fn samples_per_dispatch(
    settings: &RenderSettings,
    features: &ShaderFeatures,
    hierarchy_depth: u32,
) -> u32 {
    let has_environment = features.get("environment") == Some(&true);
    let per_light = if has_environment {
        ENVIRONMENT_TURNS
    } else {
        1
    };
    let per_segment =
        2 * turns_per_ray(hierarchy_depth) + settings.path.light_candidates * per_light;
    // A power of two, so that submissions are whole runs.
    1 << paths_within_turns(per_segment, settings.path.max_depth).ilog2()
}

/// Photon paths that one thread traces, one after the other, for the same reason. On a GPU one: fewer threads than paths
/// would leave it idle.
#[must_use]
pub fn photon_paths_per_thread(is_software: bool, max_depth: u32, hierarchy_depth: u32) -> u32 {
    if is_software {
        paths_within_turns(turns_per_ray(hierarchy_depth), max_depth)
    } else {
        1
    }
}

/// A ray takes eight turns per level and some 32 for leaves, in the worst of threads that run as one (measured: the
/// gallery's paths of 12 segments of two rays take 2,048 to 4,096 turns at depth 17, the Cornell box's 1,024 to 2,048 at
/// depth 3).
fn turns_per_ray(hierarchy_depth: u32) -> u32 {
    32 + 8 * hierarchy_depth
}

/// Paths that keep well within [`LOOP_TURNS`].
fn paths_within_turns(per_segment: u32, max_depth: u32) -> u32 {
    let per_path = per_segment.saturating_mul(max_depth.max(1));
    (LOOP_TURNS / 2 / per_path).clamp(1, MOST_PATHS_PER_THREAD)
}

/// Whether caustics get a map of their own: the scene can form them, or a setting forces it.
pub fn forms_caustics(features: &ShaderFeatures) -> bool {
    features.get("caustics").copied().unwrap_or(false)
}

/// Radius in metres that gathers about [`AUTOMATIC_GATHER`] photons on a scene's mean square metre.
pub fn automatic_radius_m(scene: &Scene, paths: u32) -> f64 {
    radius_for_area_m(SceneFacts::of(scene).area_m2(scene), paths)
}

/// As [`automatic_radius_m`], for a scene whose area is known.
pub(super) fn radius_for_area_m(area_m2: f64, paths: u32) -> f64 {
    let photons = f64::from(paths.max(1)) * AUTOMATIC_STORED_PER_PATH;
    let radius = (AUTOMATIC_GATHER * area_m2 / (std::f64::consts::PI * photons)).sqrt();
    if radius.is_finite() && radius > 0.0 {
        radius
    } else {
        0.1
    }
}

/// The passes by which the right eye takes over what it can.
pub fn stereo_passes(reuse: Reuse) -> &'static [&'static Pass] {
    match reuse {
        Reuse::Off => &[],
        Reuse::Scatter => passes::STEREO_SCATTER,
        Reuse::Lookup => passes::STEREO_LOOKUP,
    }
}

/// Whether the right eye's glossy surfaces take their indirect light over: lamps must be shaded apart from it.
pub fn carries_indirect(settings: &RenderSettings, features: &ShaderFeatures) -> bool {
    let depends_on_view = ["glossy", "dielectric"]
        .into_iter()
        .any(|name| features.get(name) == Some(&true));
    depends_on_view
        && settings.method == Method::Photon
        && settings.photon.direct == DirectLight::Nee
        && settings.photon.schedule == Schedule::Split
        && settings.reuse == Reuse::Lookup
        && settings.stereo.max_lobe_shift > 0.0
}

/// Paths emitted for the map of caustics.
pub fn caustic_paths(settings: &RenderSettings) -> u32 {
    match settings.photon.caustic_count {
        0 => settings.photon.count,
        count => count,
    }
}

/// Radius of progressive pass `pass` (from 0): r_(i+1)^2 = r_i^2 (i + alpha) / (i + 1), i from 1. The mean over passes
/// then converges, its bias falling with the radius: Knaus and Zwicker 2011, "Progressive photon mapping: a
/// probabilistic approach", eq. 15.
pub fn progressive_radius_m(first_radius_m: f64, alpha: f64, pass: u32) -> f64 {
    let mut squared = first_radius_m * first_radius_m;
    for i in 1..=pass {
        squared *= (f64::from(i) + alpha) / (f64::from(i) + 1.0);
    }
    squared.sqrt().max(LEAST_RADIUS_M)
}

/// The passes of one sample of an eye, in a scene that can form `caustics` or not.
pub fn sample_passes(settings: &RenderSettings, caustics: bool) -> Vec<&'static Pass> {
    let photon = &settings.photon;
    let gather: &Pass = match (photon.search, photon.estimate, photon.loads) {
        (Search::Grid, PhotonEstimate::Radius, Loads::Direct) => &passes::photon_gather::PASS,
        (Search::Grid, PhotonEstimate::Radius, Loads::Cooperative) => &passes::shared_gather::PASS,
        (Search::Grid, PhotonEstimate::Nearest, _) => &passes::nearest_gather::PASS,
        (Search::KdTree, PhotonEstimate::Radius, _) => &passes::kd_gather::PASS,
        (Search::KdTree, PhotonEstimate::Nearest, _) => &passes::kd_nearest_gather::PASS,
    };
    let fused = photon.schedule == Schedule::Fused;
    plain_sample_passes(settings, caustics)
        .iter()
        .filter_map(|&pass| match pass.name {
            name if name == passes::photon_gather::PASS.name => (!fused).then_some(gather),
            name if fused && name == passes::eye_hits::PASS.name => Some(&passes::eye_fused::PASS),
            _ => Some(pass),
        })
        .collect()
}

fn plain_sample_passes(settings: &RenderSettings, caustics: bool) -> &'static [&'static Pass] {
    match (settings.method, settings.photon.direct, caustics) {
        (Method::Path, ..) => passes::EYE_PATH,
        (Method::Photon, DirectLight::Nee, false) => passes::EYE_PHOTON,
        (Method::Photon, DirectLight::Nee, true) => passes::EYE_PHOTON_CAUSTICS,
        (Method::Photon, DirectLight::Map, false) => passes::EYE_PHOTON_MAP_ONLY,
        (Method::Photon, DirectLight::Map, true) => passes::EYE_PHOTON_MAP_ONLY_CAUSTICS,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::PathSettings;

    #[test]
    fn dispatches_stay_within_the_turns_of_a_thread() {
        let sky: ShaderFeatures = [("environment".to_owned(), true)].into();
        let samples = |max_depth, features: &ShaderFeatures, depth| {
            let path = PathSettings {
                max_depth,
                light_candidates: 16,
                ..PathSettings::default()
            };
            let settings = RenderSettings {
                path,
                ..RenderSettings::default()
            };
            samples_per_dispatch(&settings, features, depth)
        };
        let lamps = ShaderFeatures::new();
        assert_eq!(samples(12, &lamps, 5), 16);
        assert_eq!(samples(12, &lamps, 6), 8);
        assert_eq!(samples(12, &lamps, 15), 8);
        assert_eq!(samples(12, &sky, 6), 4);
        assert_eq!(samples(2, &lamps, 6), MOST_PATHS_PER_THREAD);
        assert_eq!(samples(u32::MAX, &sky, 72), 1);
        for max_depth in [1, 5, 12, 64, 1000] {
            for depth in 0..72 {
                for (features, per_light) in [(&lamps, 1), (&sky, 32)] {
                    let run = samples(max_depth, features, depth);
                    let per_segment = 2 * (32 + 8 * depth) + 16 * per_light;
                    assert!(run == 1 || run * max_depth * per_segment <= LOOP_TURNS / 2);
                    assert!(run.is_power_of_two());
                }
                let paths = photon_paths_per_thread(true, max_depth, depth);
                assert!(paths == 1 || paths * max_depth * (32 + 8 * depth) <= LOOP_TURNS / 2);
            }
        }
        assert_eq!(photon_paths_per_thread(true, 12, 6), MOST_PATHS_PER_THREAD);
        assert_eq!(photon_paths_per_thread(false, 12, 6), 1);
    }
}
