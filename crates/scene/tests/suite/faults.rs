//! glTF import: every fault is one clear line, and damage never panics.

use serde_json::json;
use stereolux_scene::{Needs, Scene};

use super::import::{Doc, assert_fault, png_1x1, set, with};
use crate::cases::cases;
use crate::folders::Folder;

#[test]
fn unsupported_extensions_are_errors_if_required_and_warnings_if_used() {
    let required =
        with(|doc| doc.json["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]));
    assert_fault(
        required.load(),
        "requires the extension KHR_draco_mesh_compression",
    );
    for name in ["ACME_something", "KHR_materials_unlit"] {
        let required = with(|doc| doc.json["extensionsRequired"] = json!([name]));
        assert_fault(required.load(), name);
    }
    let used = with(|doc| {
        doc.json["extensionsUsed"] = json!(["KHR_materials_sheen", "KHR_lights_punctual"])
    });
    let scene = used.load().unwrap();
    assert_eq!(scene.warnings.len(), 1);
    assert!(
        scene.warnings[0].contains("KHR_materials_sheen"),
        "{:?}",
        scene.warnings
    );
    // With a copy that is not compressed.
    let compressed = with(|doc| {
        doc.json["bufferViews"][0]["extensions"] = json!({ "EXT_meshopt_compression": {} })
    });
    assert_eq!(
        compressed.load().unwrap().meshes,
        with(|_| {}).load().unwrap().meshes
    );
}

/// Where the square is changed, to what, and what is said.
const FAULTS: &str = r#"
    /nodes/0/mesh | 7 | nodes[0].mesh: index out of range 7
    /nodes/0/mesh | 4294967296 | nodes[0].mesh: index out of range
    /meshes/0/primitives/0/attributes/POSITION | 50 | POSITION: accessor 50 is out of range
    /meshes/0/primitives/0/indices | 50 | indices
    /meshes/0/primitives/0/material | 1 | material
    /meshes/0/primitives/0/mode | 9 | mode
    /meshes/0/primitives/0/attributes | {} | POSITION
    /accessors/0/bufferView | 9 | accessors[0].bufferView
    /accessors/0/count | 5 | accessors[0]
    /accessors/0/count | 1152921504606846976 | elements need
    /accessors/0/count | 0 | count is 0
    /accessors/0/count | -4 | accessors[0]
    /accessors/0/byteOffset | 18446744073709551615 | elements need
    /accessors/0/componentType | 1234 | accessors[0].componentType: invalid value 1234
    /extensions | { "KHR_lights_punctual": { "lights": [{ "type": "lamp" }] } } | extensions.KHR_lights_punctual.lights[0].type: invalid value "lamp"
    /accessors/0/type | "VEC2" | components per element
    /accessors/1/componentType | 5122 | indices must be unsigned
    /bufferViews/0/byteLength | 18446744073709551615 | lie outside buffer 0
    /bufferViews/0/byteOffset | 1000 | lie outside buffer 0
    /bufferViews/0/buffer | 3 | bufferViews[0].buffer
    /bufferViews/0/byteStride | 4 | byteStride 4
    /buffers | [{ "byteLength": 60 }] | neither a URI nor a binary chunk
    /buffers | [{ "byteLength": 60, "uri": "data:;base64,AAAA" }] | declares 60 bytes, its data has 3
    /buffers | [{ "byteLength": 60, "uri": "data:;base64,A*AA" }] | not base64
    /buffers | [{ "byteLength": 60, "uri": "missing.bin" }] | missing.bin
    /buffers | [{ "byteLength": 60, "uri": "https://example.com/a.bin" }] | only relative paths
    /nodes/0/children | [0] | its own child
    /nodes/0/children | [8] | nodes[0].children[0]
    /nodes | [{ "children": [1] }, { "name": "b", "children": [2] }, { "children": [1] }] | child of both
    /nodes | [{}, { "name": "b", "children": [2] }, { "children": [1] }] | cycle
    /scenes/0/nodes | [0, 0] | listed twice
    /scenes/0/nodes | [4] | scenes[0].nodes[0]
    /scene | 2 | scene: index out of range
    /nodes/0/scale | [1e300, 1, 1] | nodes[0] 'thing'
    /nodes/0/rotation | [0, 0, 0, 0] | no length
    /nodes/0/matrix | [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0.5, 0, 0, 0, 1] | not affine
    /materials | [{ "emissiveFactor": [1e300, 0, 0] }] | emissiveFactor
    /materials | [{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }] | baseColorTexture
    /materials | [{ "pbrMetallicRoughness": { "baseColorFactor": "red" } }] | materials[0]
    /asset/version | "1.0" | version 1.0
    /asset/minVersion | "2.1" | version 2.1
    /asset | {} | asset.version
"#;

#[test]
fn every_fault_is_one_clear_line() {
    for [at, value, says] in cases(FAULTS) {
        let doc = with(|doc| set(&mut doc.json, at, value.parse().unwrap()));
        assert_fault(doc.load(), says);
    }
    let two = with(|doc| {
        doc.json["nodes"] = json!([{ "children": [1] }, {}]);
        doc.json["scenes"][0]["nodes"] = json!([0, 1]);
    });
    assert_fault(two.load(), "not a root");
    // An accessor without a view holds zeros (glTF 2.0, section 3.6.2.1): degenerate, not broken.
    let mut zeros = Doc::square();
    let accessor = zeros.json["accessors"][0].as_object_mut().unwrap();
    accessor.remove("bufferView").unwrap();
    let result = zeros.load();
    assert!(result.is_ok(), "{result:?}");
}

#[test]
fn vertices_must_be_finite_and_in_range() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut doc = Doc::square();
        doc.bin[12..16].copy_from_slice(&bad.to_le_bytes());
        assert_fault(
            doc.load(),
            "meshes[0].primitives[0]: POSITION of vertex 1 is not finite",
        );
    }
    let mut doc = Doc::square();
    let offset = doc.json["bufferViews"][1]["byteOffset"].as_u64().unwrap() as usize;
    doc.bin[offset + 4..offset + 6].copy_from_slice(&4_u16.to_le_bytes());
    assert_fault(doc.load(), "index 2 names vertex 4, there are 4");
}

#[test]
fn images_must_be_decodable() {
    let image = |bytes: &[u8]| {
        with(|doc| {
            let view = doc.view(bytes);
            doc.json["images"] = json!([{ "bufferView": view, "name": "leaf" }]);
            doc.json["textures"] = json!([{ "source": 0 }]);
            doc.json["materials"] = json!([{ "emissiveTexture": { "index": 0 } }]);
        })
        .load()
    };
    assert!(image(&png_1x1()).is_ok());
    assert_fault(
        image(b"RIFF____WEBP"),
        "images[0] 'leaf': is neither PNG nor JPEG",
    );
    assert_fault(
        image(&png_1x1()[..40]),
        "images[0] 'leaf': cannot be decoded",
    );
    // JPEG decoders fill up what is missing.
    let jpeg = {
        let mut bytes = std::io::Cursor::new(Vec::new());
        image::RgbImage::from_fn(64, 64, |x, y| image::Rgb([(x * y % 251) as u8, 7, 200]))
            .write_to(&mut bytes, image::ImageFormat::Jpeg)
            .unwrap();
        bytes.into_inner()
    };
    assert!(image(&jpeg).is_ok());
    assert!(image(&[&jpeg[..], b"more"].concat()).is_ok());
    for kept in [jpeg.len() / 2, jpeg.len() - 2] {
        assert_fault(image(&jpeg[..kept]), "no end marker");
    }
    // A header that claims 4 billion by 4 billion pixels.
    let mut huge = png_1x1();
    huge[16..24].fill(0x7f);
    assert_fault(image(&huge), "images[0] 'leaf': cannot be decoded");
    // An image that no material uses is not even read.
    let unused = with(|doc| {
        doc.json["images"] = json!([{ "uri": "missing.png" }]);
        doc.json["textures"] = json!([{ "source": 0 }]);
    });
    assert!(unused.load().unwrap().images.is_empty());
    let deep = {
        let mut bytes = std::io::Cursor::new(Vec::new());
        image::ImageBuffer::<image::Rgb<u16>, _>::from_raw(1, 1, vec![65535_u16, 32896, 0])
            .unwrap()
            .write_to(&mut bytes, image::ImageFormat::Png)
            .unwrap();
        bytes.into_inner()
    };
    let scene = image(&deep).unwrap();
    assert_eq!(scene.images[0].rgba8, [255, 128, 0, 255]);
    assert!(
        scene.warnings.iter().any(|line| line.contains("16 bits")),
        "{:?}",
        scene.warnings
    );
}

#[test]
fn files_that_are_no_scenes() {
    let folder = Folder::new("no-scenes");
    let glb = stereolux_scene::builtin::glb("cornell").unwrap();
    let mut other_magic = glb.to_vec();
    other_magic[0] = b'x';
    let mut version_1 = glb.to_vec();
    version_1[4] = 1;
    let files: [(&str, &[u8], &str); 7] = [
        ("empty.glb", b"", "empty"),
        ("cut.glb", &glb[..glb.len() / 2], "truncated"),
        ("header.glb", &glb[..9], "truncated"),
        ("magic.glb", &other_magic, "does not begin with 'glTF'"),
        ("version.glb", &version_1, "version 1"),
        ("text.gltf", b"hello", "JSON error"),
        ("list.gltf", b"[]", "not an object"),
    ];
    for (name, bytes, expected) in files {
        let path = folder.join(name);
        std::fs::write(&path, bytes).unwrap();
        let message = Scene::load(&path)
            .map(|scene| scene.name)
            .map_err(|error| error.to_string())
            .unwrap_err();
        assert!(
            message.contains(expected) && message.contains(name) && !message.contains('\n'),
            "{name}: {message}"
        );
    }
    for (path, expected) in [
        (folder.join("absent.glb"), "absent.glb"),
        (folder.path().to_owned(), "directory"),
    ] {
        let message = Scene::load(&path)
            .map(|scene| scene.name)
            .map_err(|error| error.to_string())
            .unwrap_err();
        assert!(message.contains(expected), "{message}");
    }
    // Whatever length a file is cut to, it is refused: every declared length is checked.
    for length in (0..glb.len()).step_by(61) {
        assert!(
            Scene::from_bytes("cut.glb", &glb[..length]).is_err(),
            "{length} bytes"
        );
    }
}

#[test]
fn random_damage_never_panics() {
    // xorshift64 (Marsaglia 2003), so that a failure can be repeated.
    let mut state = 0x5eed_u64 | 1;
    let mut next = |bound: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as usize % bound
    };
    let cornell = stereolux_scene::builtin::glb("cornell").unwrap();
    let json_end = 20 + u32::from_le_bytes(cornell[12..16].try_into().unwrap()) as usize;
    let rounds = std::env::var("STEREOLUX_FUZZ_ROUNDS")
        .ok()
        .and_then(|rounds| rounds.parse().ok())
        .unwrap_or(500);
    let (mut accepted, mut refused) = (0, 0);
    for round in 0..rounds {
        let mut glb = cornell.to_vec();
        for _ in 0..=next(3) {
            // Digits are replaced by digits half of the time, or hardly any file would get past the JSON parser.
            let at = if round % 4 == 0 {
                next(glb.len())
            } else {
                next(json_end)
            };
            let is_digit = glb[at].is_ascii_digit();
            glb[at] = if is_digit && round % 2 == 1 {
                b'0' + next(10) as u8
            } else {
                next(256) as u8
            };
        }
        match Scene::from_bytes("damaged.glb", &glb) {
            Ok(scene) => {
                accepted += 1;
                // What is accepted must be consistent.
                let _ = (
                    Needs::of(&scene),
                    scene.start_pose(),
                    scene.surface_area_m2(),
                );
            }
            Err(error) => {
                refused += 1;
                assert!(!error.to_string().contains('\n'), "{error}");
            }
        }
    }
    assert!(
        accepted > 0 && refused > 0,
        "{accepted} accepted, {refused} refused: the damage tests nothing"
    );
}
