//! What a scene does not need is not compiled: no driver needed.

use stereolux_gpu::ShaderLibrary;
use stereolux_gpu::kernel::reflect_bindings;

use crate::trace_probe::{features, probe_source};

const ROOTS: [(&str, &str); 3] = [
    (
        "tests/bsdf_probe",
        include_str!("../../../../tests/suite/transport/bsdf_probe.wesl"),
    ),
    (
        "tests/bsdf_surface",
        include_str!("../../../../tests/suite/transport/bsdf_surface.wesl"),
    ),
    (
        "tests/lights_probe",
        include_str!("../../../../tests/suite/transport/lights_probe.wesl"),
    ),
];

/// Words that betray each feature's code, and bindings that only it reads.
const TRACES: [(&str, &[&str], &[&str]); 7] = [
    ("glossy", &["ggx_", "schlick", "specular_f0"], &[]),
    (
        "dielectric",
        &["fresnel_dielectric", "refract", "glass"],
        &[],
    ),
    (
        "base_color_maps",
        &["fetch_texel", "sample_texture", "srgb"],
        &["texture_infos", "texels"],
    ),
    ("alpha", &["alpha_coverage", "alpha_lets_through"], &[]),
    (
        "environment",
        &["environment_radiance", "emit_from_afar"],
        &["environment_map", "environment_cdf"],
    ),
    ("emitters", &["emitter_radiance", "sample_triangle"], &[]),
    ("spots", &["spot_attenuation", "emit_from_spot"], &[]),
];

fn compiled(on: &[&str]) -> (String, Vec<String>) {
    let mut library = ShaderLibrary::embedded();
    let (mut text, mut names) = (String::new(), Vec::new());
    for (name, source) in ROOTS {
        for modes in [&[][..], &["probe_sampling", "probe_emit"]] {
            library.insert(name, probe_source(source, modes));
            // No map comes without textures; these alone bring coordinates.
            let on: Vec<&str> = on.iter().copied().chain(["textures"]).collect();
            let shader = library.compile(name, &features(&on)).unwrap();
            shader.validate().unwrap();
            names.extend(
                reflect_bindings(&shader)
                    .unwrap()
                    .into_iter()
                    .map(|binding| binding.name),
            );
            // Record types keep every field, whatever the scene: they are the host's structs.
            let code = shader
                .wgsl
                .split("struct ")
                .map(|part| part.split_once('}').map_or(part, |(_, rest)| rest));
            text.extend(code);
        }
    }
    (text, names)
}

#[test]
fn a_lambert_scene_holds_no_other_code() {
    let (text, names) = compiled(&[]);
    for (feature, words, bindings) in TRACES {
        for word in words {
            assert!(
                !text.contains(word),
                "{word} of {feature} is compiled into a Lambert scene"
            );
        }
        for binding in bindings {
            assert!(
                !names.iter().any(|name| name == binding),
                "{binding} of {feature} is bound by a Lambert scene"
            );
        }
    }
}

#[test]
fn each_feature_alone_brings_its_code_and_no_other() {
    for (index, (feature, words, bindings)) in TRACES.iter().enumerate() {
        let (text, names) = compiled(&[feature]);
        assert!(words.iter().all(|word| text.contains(word)), "{feature}");
        assert!(
            bindings
                .iter()
                .all(|binding| names.iter().any(|name| name == binding)),
            "{feature}"
        );
        for (other, (name, words, _)) in TRACES.iter().enumerate() {
            // Rough glass needs the microfacets, whose words are counted under glossy.
            if other == index || (*feature, *name) == ("dielectric", "glossy") {
                continue;
            }
            let found: Vec<_> = words.iter().filter(|word| text.contains(**word)).collect();
            assert!(
                found.is_empty(),
                "{feature} alone compiles {found:?} of {name}"
            );
        }
    }
}
