//! Shaders as they are compiled: what is asked for, what is remembered, what is refused.

use std::sync::Arc;

use stereolux_gpu::features::words_asked;
use stereolux_gpu::kernel::{BindingKind, reflect_bindings};
use stereolux_gpu::{ShaderFeatures, ShaderLibrary};

use crate::trace_probe::features;

#[test]
fn words_are_found_however_a_condition_is_written() {
    let source =
        "@if (a && (!b || c_1)) fn f() {} @elif(d) x @else y @compute @ if(true) @ifx(e)\n@if(f";
    let words: Vec<&str> = words_asked(source).collect();
    assert_eq!(words, ["a", "b", "c_1", "d", "f"]);
}

#[test]
fn what_was_compiled_is_remembered_as_long_as_it_is_the_same() {
    let library = ShaderLibrary::embedded();
    let compile = |library: &ShaderLibrary, name: &str, on: &[&str]| {
        library.compile(name, &features(on)).unwrap()
    };
    let same = |a: &Arc<_>, b: &Arc<_>| Arc::ptr_eq(a, b);
    let [scan, gather] = ["passes/scan_add", "passes/photon_gather"];
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

/// Copies of records in textures, and what they are copies of.
const COPIES: [(&str, &str); 10] = [
    ("top_node_texels", "top_nodes"),
    ("mesh_node_texels", "mesh_nodes"),
    ("instance_texels", "instances"),
    ("triangle_texels", "triangles"),
    ("corner_texels", "triangle_vertices"),
    ("vertex_texels", "vertices"),
    ("material_texels", "materials"),
    ("light_texels", "lights"),
    ("light_alias_texels", "light_alias"),
    ("environment_map_texels", "environment_map"),
];

/// Copies that a shader reads, by slot, and those that it reads beside what they are copies of.
fn copies_read(library: &ShaderLibrary, name: &str) -> (Vec<String>, Vec<&'static str>) {
    let features = features(&[
        "emitters",
        "environment",
        "from_list",
        "inspects",
        "record_texels",
    ]);
    let bindings = reflect_bindings(&library.compile(name, &features).unwrap()).unwrap();
    let has = |name: &str| bindings.iter().any(|b| b.name == name);
    let both = COPIES.iter().filter(|(copy, own)| has(copy) && has(own));
    let both = both.map(|(copy, _)| *copy).collect();
    let texels = bindings.iter().filter(|b| b.kind == BindingKind::Texels);
    (texels.map(|b| b.name.clone()).collect(), both)
}

#[test]
fn no_pass_reads_both_a_record_and_its_copy() {
    let mut library = ShaderLibrary::embedded();
    // One that reads all copies, and none that the table lacks.
    let all = COPIES.map(|(copy, _)| copy);
    let (read, both) = copies_read(&library, "passes/path_trace");
    assert_eq!(read, all);
    assert!(both.is_empty(), "{both:?}");
    for (name, _) in library
        .sources()
        .filter(|(name, _)| name.starts_with("passes/"))
    {
        let (_, both) = copies_read(&library, name);
        assert!(both.is_empty(), "{name}: {both:?}");
    }
    // Negative control: a shader that reads all of them twice.
    let (mut declared, mut used) = (String::new(), String::new());
    for (slot, (copy, own)) in COPIES.iter().enumerate() {
        let at = 60 + slot;
        declared += &format!(
            "@group(0) @binding({slot}) var<storage, read> {own}: array<vec4u>;
            @group(0) @binding({at}) var {copy}: texture_storage_2d<rgba32uint, read>;"
        );
        used += &format!("sums[0] += {own}[0] + textureLoad({copy}, vec2u(0u));");
    }
    declared += "@group(0) @binding(80) var<storage, read_write> sums: array<vec4u>;";
    let text = format!("{declared} @compute @workgroup_size(1) fn main() {{ {used} }}");
    library.insert("tests/both", text);
    assert_eq!(copies_read(&library, "tests/both").1, all);
}

#[test]
fn shaders_of_others_are_known_whatever_module_of_theirs_they_import() {
    let mut library = ShaderLibrary::embedded();
    let is_embedded = |library: &ShaderLibrary, words: &[&str]| {
        let shader = library.compile("passes/photon_gather", &features(words));
        shader.unwrap().is_embedded
    };
    assert!(is_embedded(&library, &[]));
    let (_, model) = library
        .sources()
        .find(|(name, _)| *name == "shared/bsdf_user")
        .unwrap();
    let model = format!("{model}\n// An application's.\n");
    library.insert("shared/bsdf_user", model);
    assert!(is_embedded(&library, &[]), "it is not imported");
    assert!(!is_embedded(&library, &["user_bsdf"]));
}

#[test]
fn broken_shaders_are_errors_that_name_the_module() {
    let mut library = ShaderLibrary::embedded();
    library.insert("passes/scan_add", "fn main() { let x = ; }");
    let error = library
        .compile("passes/scan_add", &ShaderFeatures::default())
        .err()
        .expect("a syntax error");
    assert!(error.to_string().contains("passes/scan_add"), "{error}");
    library.insert(
        "passes/scan_add",
        "@compute @workgroup_size(1) fn main() { let x: u32 = 1.5; }",
    );
    assert!(
        library
            .compile("passes/scan_add", &ShaderFeatures::default())
            .is_err()
    );
}
