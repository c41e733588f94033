//! No branch within a loop, and no loop's end, is decided by uniforms alone: lavapipe puts the values of such uniforms into
//! the shader and compiles it anew for every dispatch, which took the path tracer over 300 times as long as
//! its work (docs/lavapipe.md, the first trap). Timing is no test; naga's view of the shaders is. The search has tests of its
//! own where it stands, in crates/gpu/tests.

use std::collections::{BTreeSet, HashSet};
use std::sync::Arc;

use stereolux::frame::passes;
use stereolux::frame::run::specialised;
use stereolux::gpu::ShaderLibrary;

use super::layout::changed;
use super::shaders::kinds_of_scene;
use crate::suite::branches::uniform_branches;

#[test]
fn no_loop_is_decided_by_uniforms_alone() {
    let library = ShaderLibrary::embedded();
    let mut found = BTreeSet::new();
    let mut seen = HashSet::new();
    for features in kinds_of_scene() {
        // Over the tiles of a list, and over whole images.
        for (pass, from_list) in passes::ALL
            .iter()
            .flat_map(|pass| [(pass, true), (pass, false)])
        {
            let features = specialised(pass, &features, from_list);
            let shader = library.compile(&pass.shader_name(), &features).unwrap();
            // The library compiles nothing twice.
            if !seen.insert(Arc::as_ptr(&shader)) {
                continue;
            }
            let lines = uniform_branches(&shader.module, &shader.wgsl).into_iter();
            found.extend(lines.map(|line| format!("{}, {line}", pass.name)));
        }
    }
    assert!(found.is_empty(), "{found:#?}");
}

#[test]
fn the_search_finds_russian_roulette_behind_its_flag() {
    let name = passes::path_trace.shader_name();
    let library = changed(
        &name,
        "if u_roulette >= survival {",
        "if is_roulette { if u_roulette >= survival { return false; } } if u_roulette > 1.0 {",
    );
    let features = specialised(&passes::path_trace, &kinds_of_scene().remove(1), true);
    let shader = library.compile(&name, &features).unwrap();
    let found = uniform_branches(&shader.module, &shader.wgsl);
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(found[0].contains("is_roulette"), "{found:?}");
}
