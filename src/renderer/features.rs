//! What the shaders of a scene's frames are specialised by, and what follows from that. No device is needed to know.

use crate::gpu::features::{PerFeature, ShaderFeatures, WORDS};
use crate::scene::Needs;
use crate::settings::{
    DirectLight, Force, ForceSettings, Method, RenderSettings, Reuse, Sampler, Schedule, Technique,
};

/// Shader features for what a scene needs, with the settings' forces applied.
pub fn shader_features(needs: &Needs, settings: &RenderSettings) -> ShaderFeatures {
    let technique = settings.path.technique;
    // Photon mapping's direct light always uses both.
    let is_path = settings.method == Method::Path;
    let is_alone = |one: Technique| is_path && technique == one;
    let needed = ShaderFeatures {
        sobol: settings.path.sampler == Sampler::Sobol,
        light_only: is_alone(Technique::Light),
        bsdf_only: is_alone(Technique::Bsdf),
        parts: splits_light(settings),
        svgf: settings.reconstruct.svgf.is_on(),
        still_mean: settings.reconstruct.still.is_on(),
        // Their code comes with the library that the renderer is given (`install_user_bsdfs`).
        user_bsdf: needs.bsdfs.contains(&"user"),
        ..needs.shader_features()
    };
    let force = &settings.force;
    let mut features = needed.zip(forces(force), |needed, force| force.apply(needed));
    // Normal maps and second coordinates are read through textures: forced in they bring them, forced out they go.
    features.textures |= features.normal_maps && force.textures != Force::Off;
    features.normal_maps &= features.textures;
    features.uv1 &= features.textures;
    // Passes after the fused one shade the surface that it gathered at.
    features.keeps_ends = settings.photon.schedule == Schedule::Fused
        && (settings.photon.direct == DirectLight::Nee || features.caustics);
    features
}

/// `force.*` by feature; all others stay as they are needed.
fn forces(force: &ForceSettings) -> PerFeature<Force> {
    PerFeature {
        glossy: force.glossy,
        dielectric: force.dielectric,
        textures: force.textures,
        normal_maps: force.normal_maps,
        alpha: force.alpha,
        vertex_colors: force.vertex_colors,
        environment: force.environment,
        caustics: force.caustics,
        record_texels: force.record_texels,
        ..WORDS.zip(WORDS, |_, _| Force::Auto)
    }
}

/// Whether frames are split into direct and indirect light: to write them, or to filter them apart.
pub fn splits_light(settings: &RenderSettings) -> bool {
    settings.output.parts || settings.reconstruct.svgf.is_on()
}

/// Whether there is a caustic map: the scene can form caustics, or a setting forces it.
pub fn forms_caustics(features: &ShaderFeatures) -> bool {
    features.caustics
}

/// RIS candidates per shadow ray. A single light without size leaves nothing to choose.
pub fn light_candidates(
    lights: usize,
    features: &ShaderFeatures,
    settings: &RenderSettings,
) -> u32 {
    if lights <= 1 && !features.emitters && !features.environment {
        1
    } else {
        settings.path.light_candidates
    }
}

/// Whether the right eye's glossy surfaces take light over: direct light must come by samples of its own, apart from the rest.
pub fn reuses_glossy(settings: &RenderSettings, features: &ShaderFeatures) -> bool {
    (features.glossy || features.dielectric)
        && settings.method == Method::Photon
        && settings.photon.direct == DirectLight::Nee
        && settings.photon.schedule == Schedule::Split
        && settings.reuse != Reuse::Off
        && settings.stereo.max_lobe_shift > 0.0
}
