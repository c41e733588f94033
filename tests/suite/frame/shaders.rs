//! Every shader, without a driver: compiles for every kind of scene, validates, and declares what its pass says.

use std::collections::{BTreeSet, HashSet};
use std::sync::Arc;

use stereolux::frame::passes;
use stereolux::frame::run::specialised;
use stereolux::gpu::features::{DecidedBy, WORDS, words_asked};
use stereolux::gpu::kernel::{Binding, BindingKind, reflect_bindings};
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

/// Lambert scenes, each feature alone, everything, with and without shadow rays of the right eye.
pub fn kinds_of_scene() -> Vec<ShaderFeatures> {
    let without = ShaderFeatures {
        reuse_shadow_rays: false,
        ..every_feature()
    };
    let mut kinds = vec![
        features(&[]),
        features(&["emitters"]),
        every_feature(),
        without,
    ];
    kinds.extend(every_feature().select(WORDS).map(|word| {
        // Maps and second coordinates come with textures.
        if word.ends_with("_maps") || matches!(word, "uv1" | "mips") {
            features(&[word, "textures", "emitters"])
        } else if word == "reuse_shadow_rays" {
            features(&[word, "reuse_glossy", "emitters"])
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
    let mut seen = HashSet::new();
    for features in kinds_of_scene() {
        for pass in passes::ALL {
            for from_list in [false, true] {
                // Whoever runs over hits always has a list; this one runs over the pixels that are to be filled, too.
                if from_list && *pass != passes::path_trace {
                    continue;
                }
                let shader = library
                    .compile(
                        &pass.shader_name(),
                        &specialised(pass, &features, from_list),
                    )
                    .unwrap_or_else(|error| panic!("{error} (features {features:?})"));
                // The library compiles nothing twice.
                if !seen.insert(Arc::as_ptr(&shader)) {
                    continue;
                }
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
fn what_was_compiled_is_remembered_as_long_as_it_is_the_same() {
    let library = ShaderLibrary::embedded();
    let compile = |library: &ShaderLibrary, name: &str, on: &[&str]| {
        library.compile(name, &features(on)).unwrap()
    };
    let same = |a: &Arc<_>, b: &Arc<_>| Arc::ptr_eq(a, b);
    let [scan, gather] = ["passes/scan_sums", "passes/photon_gather"];
    // A pass that asks for no feature is one shader, for every library that holds its modules as they are embedded.
    let plain = compile(&library, scan, &[]);
    assert!(same(
        &plain,
        &compile(&ShaderLibrary::embedded(), scan, &["glossy"])
    ));
    // One that asks for some is another with those, and no other with the rest.
    let lambert = compile(&library, gather, &[]);
    assert!(same(&lambert, &compile(&library, gather, &["keeps_ends"])));
    let glossy = compile(&library, gather, &["glossy"]);
    assert!(!same(&lambert, &glossy) && lambert.wgsl != glossy.wgsl);
    // A module put in place of one that it is made of makes another shader, and of others does not.
    let source = |name: &str| {
        let found = library.sources().find(|(module, _)| *module == name);
        found.unwrap().1.to_owned()
    };
    let mut changed = library.clone();
    let photon = source("shared/photon") + "const UNUSED: u32 = 1u;";
    changed.insert("shared/photon", photon.clone());
    assert!(same(&plain, &compile(&changed, scan, &[])));
    let other = compile(&changed, gather, &[]);
    assert!(!same(&lambert, &other));
    assert!(same(&other, &compile(&changed.clone(), gather, &[])));
    assert!(same(&lambert, &compile(&library, gather, &[])));
    changed.insert("shared/photon", photon.replace("UNUSED", "NOT_USED"));
    assert!(!same(&other, &compile(&changed, gather, &[])));
    changed.insert("shared/photon", source("shared/photon"));
    assert!(same(&lambert, &compile(&changed, gather, &[])));
}

#[test]
fn every_shader_file_is_a_pass_or_is_imported_by_one() {
    let library = ShaderLibrary::embedded();
    let passes: BTreeSet<String> = passes::ALL.iter().map(|pass| pass.shader_name()).collect();
    for name in library.sources().map(|(name, _)| name) {
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
            .all(|pass| library.sources().any(|(name, _)| name == pass))
    );
}

#[test]
fn no_pass_reads_both_a_record_and_its_copy() {
    let features = features(&["emitters", "record_texels"]);
    let shader = ShaderLibrary::embedded()
        .compile("passes/path_trace", &features)
        .unwrap();
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
