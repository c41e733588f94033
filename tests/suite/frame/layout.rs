//! Every struct that host and shaders share has one layout: size and each field's offset, by naga's reflection.

use std::collections::{BTreeMap, BTreeSet};
use std::mem::size_of;

use stereolux::bvh::records::{self, RecordLayout};
use stereolux::bvh::{self, bounds, top};
use stereolux::frame::passes;
use stereolux::frame::photon_layout::{self, SCAN_BLOCK};
use stereolux::frame::run::specialised;
use stereolux::gpu::kernel::ROW_GROUPS;
use stereolux::gpu::texels::ROW_TEXELS;
use stereolux::gpu::{ShaderFeatures, ShaderLibrary};
use stereolux::renderer::photon_map::{
    self, KD_TURNS_PER_SLICE, SHARED_BATCH, SHARED_BATCHES_PER_SLICE,
};
use stereolux::renderer::records::stereo::{self, Provenance as Is};
use stereolux::renderer::records::{
    deform, frame, light, material, mirror, reconstruction, still, submit,
};
use stereolux::scene::needs::CAUSTIC_ROUGHNESS;
use stereolux::settings::registry::{self, Kind};

use super::shaders::every_feature;
use super::support::words;

#[derive(Debug, Clone, PartialEq, Eq)]
struct Layout {
    size: usize,
    /// Name and offset, in order of offset; fields that only fill space are left out.
    fields: Vec<(String, usize)>,
}

fn is_filler(name: &str) -> bool {
    name.starts_with("padding") || name.starts_with("reserved")
}

fn host() -> BTreeMap<String, Layout> {
    let records = [
        frame::Eye::LAYOUT,
        frame::Frame::LAYOUT,
        mirror::Mirror::LAYOUT,
        reconstruction::Reconstruction::LAYOUT,
        stereo::StereoCounters::LAYOUT,
        still::Still::LAYOUT,
        submit::Submit::LAYOUT,
        records::BvhNode::LAYOUT,
        records::Instance::LAYOUT,
        records::PreviousInstance::LAYOUT,
        records::Triangle::LAYOUT,
        deform::RestVertex::LAYOUT,
        deform::DeformMesh::LAYOUT,
        light::Light::LAYOUT,
        light::LightAlias::LAYOUT,
        material::TextureSlot::LAYOUT,
        material::Material::LAYOUT,
        material::TextureInfo::LAYOUT,
        material::Vertex::LAYOUT,
        photon_map::Photon::LAYOUT,
        photon_map::SortedPhoton::LAYOUT,
        photon_map::PhotonCounters::LAYOUT,
        photon_map::PhotonGrid::LAYOUT,
    ];
    let layout = |record: RecordLayout| {
        let named = record.fields.iter().filter(|(name, _)| !is_filler(name));
        let fields = named.map(|&(name, offset)| (name.to_owned(), offset));
        let (size, fields) = (record.size, fields.collect());
        (record.name.to_owned(), Layout { size, fields })
    };
    records.map(layout).into()
}

/// Layouts of every struct in a buffer's type, directly or inside others.
fn collect(
    module: &naga::Module,
    handle: naga::Handle<naga::Type>,
    found: &mut BTreeMap<String, Layout>,
) {
    let ty = &module.types[handle];
    match &ty.inner {
        naga::TypeInner::Array { base, .. } => collect(module, *base, found),
        naga::TypeInner::Struct { members, span } => {
            let mut fields = Vec::new();
            for member in members {
                collect(module, member.ty, found);
                let name = member.name.clone().unwrap_or_default();
                if !is_filler(&name) {
                    fields.push((name, member.offset as usize));
                }
            }
            let name = ty.name.clone().expect("structs of buffers have names");
            let size = *span as usize;
            let layout = Layout { size, fields };
            if let Some(other) = found.insert(name.clone(), layout.clone()) {
                assert_eq!(other, layout, "{name} has two layouts");
            }
        }
        _ => {}
    }
}

/// Every struct that a buffer of any pass holds, with every feature on.
fn shaders(library: &ShaderLibrary) -> BTreeMap<String, Layout> {
    // Copies in textures take the place of buffers, and a single sample needs fewer.
    let buffers = ShaderFeatures {
        record_texels: false,
        one_sample: false,
        ..every_feature()
    };
    let mut found = BTreeMap::new();
    let mut library = library.clone();
    let source = include_str!("../../../crates/gpu/tests/shared/records_probe.wesl");
    let probe = "tests/records_probe";
    library.insert(probe, source);
    let compiled = passes::ALL
        .iter()
        .flat_map(|pass| {
            [every_feature(), buffers]
                .map(|features| (pass.shader_name(), specialised(pass, &features, true)))
        })
        .chain([(probe.to_owned(), ShaderFeatures::default())]);
    for (name, features) in compiled {
        let shader = library.compile(&name, &features).unwrap();
        for (_, variable) in shader.module.global_variables.iter() {
            if variable.binding.is_some() {
                collect(&shader.module, variable.ty, &mut found);
            }
        }
    }
    found
}

/// Names of the structs whose two layouts differ, and of those that one side lacks.
fn mismatches(host: &BTreeMap<String, Layout>, shaders: &BTreeMap<String, Layout>) -> Vec<String> {
    let names: BTreeSet<&String> = host.keys().chain(shaders.keys()).collect();
    let differ = names
        .into_iter()
        .filter(|name| host.get(*name) != shaders.get(*name));
    differ.cloned().collect()
}

#[test]
fn shared_structs_have_one_layout() {
    let host = host();
    let mut shaders = shaders(&ShaderLibrary::embedded());
    // Dispatch is written as four numbers; `gpu::kernel::DispatchTable` says which.
    let dispatch = shaders.remove("Dispatch").unwrap();
    assert_eq!(dispatch.size, 16);
    let names = dispatch.fields.iter().map(|field| field.0.as_str());
    assert!(names.eq(["index", "eye", "count", "slots_per_path"]));
    let wrong = mismatches(&host, &shaders);
    for name in &wrong {
        let [host, shaders] = [&host, &shaders].map(|all| all.get(name));
        eprintln!("{name}: host {host:#?}, shaders {shaders:#?}");
    }
    assert!(wrong.is_empty(), "{wrong:?}");
}

#[test]
fn a_wrong_layout_is_noticed() {
    // A field grown, two exchanged, one inserted: each must be found, and nothing else.
    let exchanged = "    frame_index: u32,\n    seed: u32,";
    let inserted = "hashed_rows: u32,\n    extra: u32,\n    // Table";
    for (module, from, to, name) in [
        (
            "shared/photon",
            "position: vec3<f32>,\n    // Direction",
            "@size(16) position: vec3<f32>,\n    // Direction",
            "Photon",
        ),
        (
            "shared/frame",
            "    seed: u32,\n    frame_index: u32,",
            exchanged,
            "Frame",
        ),
        (
            "shared/grid",
            "hashed_rows: u32,\n    // Table",
            inserted,
            "PhotonGrid",
        ),
    ] {
        // All of them still compile, or this fails.
        let mut found = shaders(&changed(module, from, to));
        found.remove("Dispatch");
        assert_eq!(mismatches(&host(), &found), [name]);
    }
    let mut host = host();
    host.remove("Vertex");
    let mut found = shaders(&ShaderLibrary::embedded());
    found.remove("Dispatch");
    // A struct that no test knows.
    assert_eq!(mismatches(&host, &found), ["Vertex"]);
}

/// The shaders with something exchanged that stands once in a module.
pub fn changed(module: &str, from: &str, to: &str) -> ShaderLibrary {
    let mut library = ShaderLibrary::embedded();
    let (_, source) = library.sources().find(|(name, _)| *name == module).unwrap();
    assert_eq!(source.matches(from).count(), 1, "{from:?} in {module}");
    library.insert(module, source.replace(from, to));
    library
}

/// Constants of a module, by the names that shaders give them too.
macro_rules! named {
    ($module:ident: $($name:ident),*) => { &[$((stringify!($name), $module::$name)),*] };
}

/// Numbers that the host and a shader's module both hold.
fn shared_numbers() -> Vec<(&'static str, &'static str, f64)> {
    let rounding_unit = bounds::ROUNDING_UNIT;
    let mesh_pad = bounds::PAD_UNITS * rounding_unit;
    let Kind::Whole { max: nearest, .. } = registry::find("photon.nearest").unwrap().kind else {
        panic!("photon.nearest is a whole number");
    };
    let narrow_alpha = f64::from(CAUSTIC_ROUGHNESS).powi(2);
    // A texel is 16 bytes.
    let material_words = size_of::<material::Material>() as f64 / 16.0;
    let mut numbers: Vec<(&str, &str, f64)> = vec![
        ("shared/bsdf_types", "NARROW_ALPHA", narrow_alpha),
        ("shared/traversal", "ROUNDING_UNIT", rounding_unit),
        ("shared/traversal", "MESH_PAD", mesh_pad),
        ("shared/traversal", "TOP_PAD", top::RAY_CONDITION * mesh_pad),
        ("passes/refit", "PAD", mesh_pad + rounding_unit),
        ("shared/scan", "SCAN_BLOCK", SCAN_BLOCK as f64),
        ("passes/shared_gather", "BATCH", SHARED_BATCH as f64),
        (
            "passes/shared_gather",
            "BATCHES_PER_SLICE",
            SHARED_BATCHES_PER_SLICE as f64,
        ),
        (
            "shared/kd_walk",
            "TURNS_PER_SLICE",
            KD_TURNS_PER_SLICE as f64,
        ),
        ("shared/nearest", "HEAP", nearest as f64),
        ("shared/records", "MATERIAL_WORDS", material_words),
        (
            "shared/surface",
            "MOST_MATERIALS",
            material::MOST_MATERIALS as f64,
        ),
    ];
    let row_shift = ROW_TEXELS.trailing_zeros();
    let words: &[(&str, &[(&str, u32)])] = &[
        (
            "shared/stereo",
            &[
                ("PROVENANCE_BACKGROUND", Is::Background as u32),
                ("PROVENANCE_REUSED", Is::Reused as u32),
                ("PROVENANCE_OUT_OF_LEFT_VIEW", Is::OutOfLeftView as u32),
                ("PROVENANCE_DISOCCLUDED", Is::Disoccluded as u32),
                ("PROVENANCE_EDGE", Is::Edge as u32),
                ("PROVENANCE_VIEW_DEPENDENT", Is::ViewDependent as u32),
                ("PROVENANCE_GAP", Is::Gap as u32),
                ("PROVENANCE_RESAMPLED", Is::Resampled as u32),
                ("SMALL_WINNER", stereo::SMALL_WINNER),
            ],
        ),
        (
            "shared/frame",
            named!(frame: FRAME_RUSSIAN_ROULETTE, FRAME_DIRECT_FROM_MAP, FRAME_KERNEL_EPANECHNIKOV, FRAME_KERNEL_CONE, FRAME_ADAPTIVE_RADIUS, FRAME_ADAPTIVE_CAUSTIC_RADIUS, FRAME_PROGRESSIVE),
        ),
        (
            "shared/bvh_types",
            named!(records: INSTANCE_MIRRORED, INSTANCE_NUMBER_SHIFT, TRIANGLE_ALPHA),
        ),
        (
            "shared/material_types",
            named!(material: MATERIAL_DOUBLE_SIDED, MATERIAL_ALPHA_MASK, MATERIAL_ALPHA_BLEND, MATERIAL_THIN_WALL, TEXTURE_UV1_BIT,
                TEXTURE_LEVELS_SHIFT, TEXTURE_WRAP_MIRROR, TEXTURE_WRAP_CLAMP, TEXTURE_NEAREST_BIT),
        ),
        (
            "shared/material_types",
            named!(light: LIGHT_TRIANGLE, LIGHT_POINT, LIGHT_SPOT, LIGHT_DIRECTIONAL, LIGHT_ENVIRONMENT),
        ),
        ("shared/invocation", &[("ROW_GROUPS", ROW_GROUPS)]),
        ("shared/photon", named!(photon_layout: RADIX_BLOCK)),
        ("shared/photon", named!(photon_layout: PATHS_PER_TRIED)),
        ("shared/guide_cells", named!(photon_layout: GUIDE_CELLS)),
        ("shared/photon_guide", named!(photon_layout: FIRST_PILOT)),
        ("shared/records", &[("ROW_SHIFT", row_shift)]),
        ("shared/math", &[("INVALID", records::NO_EMITTER)]),
        (
            "shared/traversal",
            &[
                ("MESH_STACK", bvh::MESH_STACK),
                ("TOP_STACK", bvh::TOP_STACK),
                ("COUNT_SHIFT", bvh::MAX_INDEX.ilog2()),
                ("INDEX_MASK", bvh::MAX_INDEX - 1),
            ],
        ),
    ];
    for (module, rows) in words {
        let rows = rows.iter();
        numbers.extend(rows.map(|&(name, word)| (*module, name, f64::from(word))));
    }
    numbers
}

/// The value of a constant expression of a module, by naga: a pass that does nothing else computes it.
fn number_in_shader(library: &ShaderLibrary, module: &str, expression: &str) -> naga::Literal {
    let names: Vec<&str> = expression.split(" * ").collect();
    let (module, names) = (module.replace('/', "::"), names.join(", "));
    let import = format!("import package::{module}::{{{names}}};");
    let code = format!(
        "const ANSWER = {expression}; @compute @workgroup_size(1) fn main() {{ _ = ANSWER; }}"
    );
    let mut library = library.clone();
    library.insert("tests/number", import + &code);
    let shader = library.compile("tests/number", &every_feature()).unwrap();
    let mut constants = shader.module.constants.iter().map(|(_, constant)| constant);
    let answer = constants.find(|constant| constant.name.as_deref() == Some("ANSWER"));
    let answer = answer.unwrap();
    match shader.module.global_expressions[answer.init] {
        naga::Expression::Literal(literal) => literal,
        ref other => panic!("{expression} of {module} is {other:?}"),
    }
}

/// Names of shared numbers that differ.
fn differing(library: &ShaderLibrary) -> Vec<&'static str> {
    let is_wrong = |module, name, host: f64| match number_in_shader(library, module, name) {
        naga::Literal::U32(word) => f64::from(word) != host,
        // The host's products are rounded once more.
        naga::Literal::F32(number) => (f64::from(number) - host).abs() > 1e-7 * host,
        other => panic!("{name} is {other:?}"),
    };
    let numbers = shared_numbers().into_iter();
    let wrong = numbers.filter(|&(module, name, host)| is_wrong(module, name, host));
    wrong.map(|(_, name, _)| name).collect()
}

#[test]
fn shared_numbers_are_equal() {
    let library = ShaderLibrary::embedded();
    assert!(differing(&library).is_empty(), "{:?}", differing(&library));
    // Turns of a batch of the gather by workgroups, and what its comment adds, within llvmpipe's limit.
    const { assert!(SHARED_BATCHES_PER_SLICE * (SHARED_BATCH + 2) + 144 < 65_535) };
    // All of the modules that hold nothing but shared numbers are compared.
    let numbers = shared_numbers();
    for (module, source) in library.sources() {
        let shared = words("stereo frame bvh_types material_types invocation scan");
        let name = module.strip_prefix("shared/");
        let is_shared = name.is_some_and(|name| shared.contains(&name));
        for line in source.lines().filter(|_| is_shared) {
            let after = line.strip_prefix("const ");
            let name = after.and_then(|line| line.split(':').next());
            let is_known = |name| numbers.iter().any(|row| (row.0, row.1) == (module, name));
            assert!(name.is_none_or(is_known), "{module}: {line}");
        }
    }
    // Negative controls: another word, a float that is off by two units in the last place.
    for (module, from, to, name) in [
        (
            "shared/stereo",
            "EDGE: u32 = 4u",
            "EDGE: u32 = 5u",
            "PROVENANCE_EDGE",
        ),
        (
            "shared/traversal",
            "f32 = 9.5367432e-7",
            "f32 = 9.536745e-7",
            "MESH_PAD",
        ),
    ] {
        assert_eq!(differing(&changed(module, from, to)), [name]);
    }
}
