//! What the shaders of a scene's frames are specialised by, and what follows from that. No device is needed to know.

use crate::gpu::features::{PerFeature, ShaderFeatures, WORDS};
use crate::scene::Needs;
use crate::settings::{
    DirectLight, Force, ForceSettings, Method, Mips, RenderSettings, Reuse, Sampler, Schedule,
    Technique,
};

/// Shader features for what a scene needs, with the settings' forces applied.
pub fn shader_features(needs: &Needs, settings: &RenderSettings) -> ShaderFeatures {
    let technique = settings.path.technique;
    // Photon mapping's direct light always uses both.
    let is_path = settings.method == Method::Path;
    let is_alone = |one: Technique| is_path && technique == one;
    let of_scene = needs.shader_features();
    let needed = ShaderFeatures {
        // Most photons from afar pass by what is seen.
        guided_photons: of_scene.environment || of_scene.directionals,
        sobol: settings.path.sampler == Sampler::Sobol,
        light_only: is_alone(Technique::Light),
        bsdf_only: is_alone(Technique::Bsdf),
        parts: splits_light(settings),
        // Of one sample the filters know it themselves.
        albedo_sums: settings.output.parts || (splits_light(settings) && settings.spp > 1),
        svgf: settings.reconstruct.svgf.is_on(),
        anti_aliased: settings.reconstruct.taa.is_on(),
        counts_work: settings.output.work,
        passthrough: settings.surroundings.passthrough,
        still_mean: settings.reconstruct.still.is_on(),
        // Their code comes with the library that the renderer is given (`install_user_bsdfs`).
        user_bsdf: needs.bsdfs.contains(&"user"),
        ..of_scene
    };
    let force = &settings.force;
    let mut features = needed.zip(forces(force), |needed, force| force.apply(needed));
    // Normal maps and second coordinates are read through textures: forced in they bring them, forced out they go.
    features.textures |= features.normal_maps && force.textures != Force::Off;
    features.normal_maps &= features.textures;
    features.uv1 &= features.textures;
    // What a material has textures for: forced in, every use is.
    let uses = texture_uses();
    features = match force.textures {
        Force::Auto => features,
        Force::On => features.zip(uses, |on, is_use| on || is_use),
        Force::Off => features.without(uses),
    };
    features.mips = features.textures && chooses_mips(settings);
    features.images = needs.mirrors
        && (features.glossy || features.dielectric)
        && settings.reconstruct.follows_motion();
    // Passes after the fused one shade the surface that it gathered at, which without mirrors and glass is the first.
    features.keeps_ends = settings.photon.schedule == Schedule::Fused
        && (features.glossy || features.dielectric)
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
        guided_photons: force.guided_photons,
        record_texels: force.record_texels,
        wide_machine: force.wide_machine,
        ..WORDS.zip(WORDS, |_, _| Force::Auto)
    }
}

/// Whether textures have levels: as `textures.mips` says, of itself where frames are reconstructed. Frames that stand alone
/// read every texture at its finest, as other renderers do.
pub fn chooses_mips(settings: &RenderSettings) -> bool {
    let reconstruct = &settings.reconstruct;
    match settings.textures.mips {
        Mips::Auto => reconstruct.is_on(),
        Mips::On => true,
        Mips::Off => false,
    }
}

/// The features that each stand for one use of textures; normal maps have a setting of their own.
fn texture_uses() -> ShaderFeatures {
    ShaderFeatures {
        base_color_maps: true,
        metallic_roughness_maps: true,
        emissive_maps: true,
        specular_maps: true,
        specular_color_maps: true,
        transmission_maps: true,
        ..ShaderFeatures::default()
    }
}

/// Whether frames are split into direct and indirect light: to write them, or to filter them apart.
pub fn splits_light(settings: &RenderSettings) -> bool {
    settings.output.parts || settings.reconstruct.svgf.is_on()
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

/// Whether the right eye scatters the left one's light anew, on glossy surfaces or, with shadow rays, on all: the left eye
/// must know in which directions it found light.
pub fn reuses_glossy(settings: &RenderSettings, features: &ShaderFeatures) -> bool {
    let glossy = (features.glossy || features.dielectric) && settings.stereo.max_lobe_shift > 0.0;
    settings.no_light_samples().is_none()
        && settings.reuse != Reuse::Off
        && (glossy || settings.stereo.shadow_rays)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn textures_have_levels_where_frames_are_reconstructed_unless_a_setting_says() {
        let chosen = |mips, taa: bool, svgf: bool| {
            let mut settings = RenderSettings::default();
            settings.textures.mips = mips;
            settings.reconstruct.taa = taa.into();
            settings.reconstruct.svgf = svgf.into();
            chooses_mips(&settings)
        };
        for (taa, svgf) in [(false, false), (true, false), (false, true)] {
            assert_eq!(chosen(Mips::Auto, taa, svgf), taa || svgf);
            assert!(chosen(Mips::On, taa, svgf));
            assert!(!chosen(Mips::Off, taa, svgf));
        }
    }
}
