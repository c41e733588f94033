//! Every shader, without a driver: compiles for every kind of scene, validates, and declares what its pass says.

use std::collections::{BTreeSet, HashSet};
use std::sync::Arc;

use stereolux::frame::passes::{self, Domain};
use stereolux::frame::run::specialised;
use stereolux::gpu::features::{DecidedBy, WORDS, words_asked};
use stereolux::gpu::kernel::{Binding, BindingKind, reflect_bindings};
use stereolux::gpu::{ShaderFeatures, ShaderLibrary};

use super::layout::changed;
use super::support::assert_says;
use super::trace_probe::features;

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
    let (lambert, lit) = (features(&[]), features(&["emitters"]));
    let mut kinds = vec![lambert, lit, every_feature(), without];
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
    assert_eq!(strays(&ShaderLibrary::embedded()), (vec![], vec![]));
    // Negative control: one misspelt word, in the only place where it stands.
    let module = "shared/textures";
    let misspelt = changed(module, "@if(uv1)", "@if(!(glossy && uv_1))");
    let (unknown, unasked) = strays(&misspelt);
    assert_eq!(unknown, [(module.to_owned(), "uv_1".to_owned())]);
    assert_eq!(unasked, ["uv1"]);
    // It is not off in silence.
    let compiled = misspelt.compile(&passes::photon_trace.shader_name(), &every_feature());
    assert_says(&compiled.err().unwrap().to_string(), &["uv_1"]);
}

#[test]
fn every_pass_compiles_and_validates_for_every_kind_of_scene() {
    let library = ShaderLibrary::embedded();
    let mut seen = HashSet::new();
    for features in kinds_of_scene() {
        for pass in passes::ALL {
            for from_list in [false, true] {
                // Whoever runs over hits always has a list; passes over tiles run over some and over all.
                if from_list && pass.over != Domain::SeenTiles {
                    continue;
                }
                let own = specialised(pass, &features, from_list);
                let what = format!("{} (features {features:?})", pass.name);
                let shader = library.compile(&pass.shader_name(), &own).expect(&what);
                // The library compiles nothing twice.
                if !seen.insert(Arc::as_ptr(&shader)) {
                    continue;
                }
                shader.validate().expect(&what);
                let bindings = reflect_bindings(&shader).unwrap();
                let is_storage = |binding: &&Binding| {
                    matches!(binding.kind, BindingKind::Read | BindingKind::ReadWrite)
                };
                let storage = bindings.iter().filter(is_storage).count();
                // For comparison only; where it does not fit, the device refuses it in one line.
                let may_exceed = pass.name == "eye_fused";
                let fits = may_exceed || storage <= STORAGE_BUFFERS;
                assert!(fits, "{what} binds {storage} storage buffers");
            }
        }
    }
}

#[test]
fn every_shader_file_is_a_pass_or_is_imported_by_one() {
    let library = ShaderLibrary::embedded();
    let passes: BTreeSet<String> = passes::ALL.iter().map(|pass| pass.shader_name()).collect();
    let names = library.sources().map(|(name, _)| name.to_owned());
    let files: BTreeSet<String> = names.filter(|name| name.starts_with("passes/")).collect();
    assert_eq!(files, passes);
}
