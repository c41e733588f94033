//! Every shader, without a driver: compiles for every kind of scene, validates, and declares what its pass says.

use std::collections::BTreeSet;

use stereolux::frame::passes;
use stereolux::frame::run::specialised;
use stereolux::gpu::features::{DecidedBy, WORDS, words_asked};
use stereolux::gpu::kernel::{Binding, BindingKind, ROW_GROUPS, reflect_bindings};
use stereolux::gpu::texels::ROW_TEXELS;
use stereolux::gpu::{ShaderFeatures, ShaderLibrary};

use super::bvh_probe::features;

/// Storage buffers per stage that the README asks of an adapter.
const STORAGE_BUFFERS: usize = 24;

/// All that scene, settings and renderer can ask for together; a user's BSDF brings code of its own.
pub fn every_feature() -> ShaderFeatures {
    ShaderFeatures {
        user_bsdf: false,
        ..ShaderFeatures::decided_up_to(DecidedBy::Renderer)
    }
}

/// Lambert scenes, each feature alone, everything.
pub fn kinds_of_scene() -> Vec<ShaderFeatures> {
    let mut kinds = vec![features(&[]), features(&["emitters"]), every_feature()];
    kinds.extend(every_feature().select(WORDS).map(|word| {
        // Normal maps and second coordinates come with textures.
        if matches!(word, "normal_maps" | "uv1") {
            features(&[word, "textures", "emitters"])
        } else {
            features(&[word, "emitters"])
        }
    }));
    kinds
}

/// Words that shaders ask for and no feature is called by, with the shader; and features that no shader asks for.
fn strays(library: &ShaderLibrary) -> (Vec<(String, String)>, Vec<&'static str>) {
    let mut asked = ShaderFeatures::default();
    let mut unknown = Vec::new();
    for (name, source) in library.sources() {
        for word in words_asked(source) {
            match asked.by_word_mut(word) {
                Some(feature) => *feature = true,
                None => unknown.push((name.to_owned(), word.to_owned())),
            }
        }
    }
    let unasked = ShaderFeatures::ALL.without(asked).select(WORDS).collect();
    (unknown, unasked)
}

#[test]
fn shaders_ask_for_the_features_of_the_table_and_for_all_of_them() {
    let library = ShaderLibrary::embedded();
    assert_eq!(strays(&library), (vec![], vec![]));
    // Negative control: one misspelt word, in the only place where it stands.
    let module = "shared/textures";
    let (_, source) = library.sources().find(|(name, _)| *name == module).unwrap();
    let mut misspelt = library.clone();
    misspelt.insert(module, source.replace("@if(uv1)", "@if(!(glossy && uv_1))"));
    let (unknown, unasked) = strays(&misspelt);
    assert_eq!(unknown, [(module.to_owned(), "uv_1".to_owned())]);
    assert_eq!(unasked, ["uv1"]);
    // It is not off in silence.
    let error = misspelt
        .compile(&passes::path_trace.shader_name(), &every_feature())
        .err()
        .expect("an unknown feature");
    assert!(error.to_string().contains("uv_1"), "{error}");
}

#[test]
fn words_are_found_however_a_condition_is_written() {
    let source =
        "@if (a && (!b || c_1)) fn f() {} @elif(d) x @else y @compute @ if(true) @ifx(e)\n@if(f";
    let words: Vec<&str> = words_asked(source).collect();
    assert_eq!(words, ["a", "b", "c_1", "d", "f"]);
}

#[test]
fn every_pass_compiles_and_validates_for_every_kind_of_scene() {
    let library = ShaderLibrary::embedded();
    for features in kinds_of_scene() {
        for pass in passes::ALL {
            for from_list in [false, true] {
                // Whoever runs over hits always has a list; these run over the pixels that are to be filled, too.
                let fills = [
                    passes::eye_hits,
                    passes::eye_fused,
                    passes::path_trace,
                    passes::eye_combine,
                ];
                if from_list && !fills.contains(pass) {
                    continue;
                }
                let shader = library
                    .compile(
                        &pass.shader_name(),
                        &specialised(pass, &features, from_list),
                    )
                    .unwrap_or_else(|error| panic!("{error} (features {features:?})"));
                shader
                    .validate()
                    .unwrap_or_else(|error| panic!("{error} (features {features:?})"));
                let bindings = reflect_bindings(&shader).unwrap();
                let is_storage = |binding: &&Binding| {
                    matches!(binding.kind, BindingKind::Read | BindingKind::ReadWrite)
                };
                let storage = bindings.iter().filter(is_storage).count();
                // For comparison only; where it does not fit, the device refuses it in one line.
                let may_exceed = pass.name == "eye_fused";
                assert!(
                    may_exceed || storage <= STORAGE_BUFFERS,
                    "{} binds {storage} storage buffers (features {features:?})",
                    pass.name
                );
            }
        }
    }
}

#[test]
fn every_shader_file_is_a_pass_or_is_imported_by_one() {
    let library = ShaderLibrary::embedded();
    let passes: BTreeSet<String> = passes::ALL.iter().map(|pass| pass.shader_name()).collect();
    for name in library.names() {
        if name.starts_with("passes/") {
            assert!(
                passes.contains(name),
                "shaders/{name}.wesl belongs to no pass"
            );
        }
    }
    assert!(
        passes
            .iter()
            .all(|pass| library.names().any(|name| name == pass))
    );
}

#[test]
fn rows_of_workgroups_agree_between_host_and_shaders() {
    let library = ShaderLibrary::embedded();
    for name in [
        "passes/scan_blocks",
        "passes/grid_setup",
        "passes/list_setup",
        "passes/cell_count",
    ] {
        let shader = library.compile(name, &ShaderFeatures::default()).unwrap();
        assert!(
            shader
                .wgsl
                .contains(&format!("ROW_GROUPS: u32 = {ROW_GROUPS}u")),
            "{name} counts rows of another width than the host"
        );
    }
}

#[test]
fn rows_of_texels_agree_between_host_and_shaders() {
    let features = features(&["emitters", "record_texels"]);
    let shader = ShaderLibrary::embedded()
        .compile("passes/path_trace", &features)
        .unwrap();
    let shift = ROW_TEXELS.trailing_zeros();
    assert_eq!(1 << shift, ROW_TEXELS);
    assert!(shader.wgsl.contains(&format!("ROW_SHIFT: u32 = {shift}u")));
    // Nothing reads both a record's buffer and its copy.
    let bindings = reflect_bindings(&shader).unwrap();
    let texels = bindings.iter().filter(|b| b.kind == BindingKind::Texels);
    for copy in texels {
        let name = copy.name.trim_end_matches("_texels");
        assert!(
            !bindings.iter().any(|b| b.name == format!("{name}s")),
            "{name}"
        );
    }
}

#[test]
fn broken_shaders_are_errors_that_name_the_module() {
    let mut library = ShaderLibrary::embedded();
    library.insert("passes/scan_sums", "fn main() { let x = ; }");
    let error = library
        .compile("passes/scan_sums", &ShaderFeatures::default())
        .err()
        .expect("a syntax error");
    assert!(error.to_string().contains("passes/scan_sums"), "{error}");
    library.insert(
        "passes/scan_sums",
        "@compute @workgroup_size(1) fn main() { let x: u32 = 1.5; }",
    );
    assert!(
        library
            .compile("passes/scan_sums", &ShaderFeatures::default())
            .is_err()
    );
}
