//! glTF import: every fault is one clear line, and damage never panics.

use serde_json::json;
use stereolux_scene::{Needs, Scene};

use super::import::{Doc, assert_fault, png_1x1, with};
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

#[test]
fn every_fault_is_one_clear_line() {
    let cases: Vec<(Doc, &str)> = vec![
        (
            with(|doc| doc.json["nodes"][0]["mesh"] = json!(7)),
            "nodes[0].mesh: index out of range",
        ),
        (
            with(|doc| doc.json["nodes"][0]["mesh"] = json!(4_294_967_296_u64)),
            "nodes[0].mesh: index out of range",
        ),
        (
            with(|doc| doc.primitive()["attributes"]["POSITION"] = json!(50)),
            "POSITION: accessor 50 is out of range",
        ),
        (
            with(|doc| doc.primitive()["indices"] = json!(50)),
            "indices",
        ),
        (
            with(|doc| doc.primitive()["material"] = json!(1)),
            "material",
        ),
        (with(|doc| doc.primitive()["mode"] = json!(9)), "mode"),
        (
            with(|doc| doc.primitive()["attributes"] = json!({})),
            "POSITION",
        ),
        (
            with(|doc| doc.json["accessors"][0]["bufferView"] = json!(9)),
            "accessors[0].bufferView",
        ),
        (
            with(|doc| doc.json["accessors"][0]["count"] = json!(5)),
            "accessors[0]",
        ),
        (
            with(|doc| doc.json["accessors"][0]["count"] = json!(1_u64 << 60)),
            "elements need",
        ),
        (
            with(|doc| doc.json["accessors"][0]["count"] = json!(0)),
            "count is 0",
        ),
        (
            with(|doc| doc.json["accessors"][0]["count"] = json!(-4)),
            "accessors[0]",
        ),
        (
            with(|doc| doc.json["accessors"][0]["byteOffset"] = json!(u64::MAX)),
            "elements need",
        ),
        (
            with(|doc| doc.json["accessors"][0]["componentType"] = json!(1234)),
            "accessors[0].componentType",
        ),
        (
            with(|doc| doc.json["accessors"][0]["type"] = json!("VEC2")),
            "components per element",
        ),
        (
            with(|doc| {
                doc.json["accessors"][0]
                    .as_object_mut()
                    .unwrap()
                    .remove("bufferView")
                    .map_or((), drop)
            }),
            "",
        ),
        (
            with(|doc| doc.json["accessors"][1]["componentType"] = json!(5122)),
            "indices must be unsigned",
        ),
        (
            with(|doc| doc.json["bufferViews"][0]["byteLength"] = json!(u64::MAX)),
            "lie outside buffer 0",
        ),
        (
            with(|doc| doc.json["bufferViews"][0]["byteOffset"] = json!(1000)),
            "lie outside buffer 0",
        ),
        (
            with(|doc| doc.json["bufferViews"][0]["buffer"] = json!(3)),
            "bufferViews[0].buffer",
        ),
        (
            with(|doc| doc.json["bufferViews"][0]["byteStride"] = json!(4)),
            "byteStride 4",
        ),
        (
            with(|doc| doc.json["buffers"] = json!([{ "byteLength": 60 }])),
            "neither a URI nor a binary chunk",
        ),
        (
            with(|doc| {
                doc.json["buffers"] = json!([{ "byteLength": 60, "uri": "data:;base64,AAAA" }])
            }),
            "declares 60 bytes, its data has 3",
        ),
        (
            with(|doc| {
                doc.json["buffers"] = json!([{ "byteLength": 60, "uri": "data:;base64,A*AA" }])
            }),
            "not base64",
        ),
        (
            with(|doc| doc.json["buffers"] = json!([{ "byteLength": 60, "uri": "missing.bin" }])),
            "missing.bin",
        ),
        (
            with(|doc| {
                doc.json["buffers"] =
                    json!([{ "byteLength": 60, "uri": "https://example.com/a.bin" }])
            }),
            "only relative paths",
        ),
        (
            with(|doc| doc.json["nodes"][0]["children"] = json!([0])),
            "its own child",
        ),
        (
            with(|doc| doc.json["nodes"][0]["children"] = json!([8])),
            "nodes[0].children[0]",
        ),
        (
            with(
                |doc| doc.json["nodes"] = json!([{ "children": [1] }, { "name": "b", "children": [2] }, { "children": [1] }]),
            ),
            "child of both",
        ),
        (
            with(|doc| {
                doc.json["nodes"] =
                    json!([{}, { "name": "b", "children": [2] }, { "children": [1] }])
            }),
            "cycle",
        ),
        (
            with(|doc| doc.json["nodes"] = json!([{ "children": [1] }, {}])).roots(json!([0, 1])),
            "not a root",
        ),
        (with(|_| ()).roots(json!([0, 0])), "listed twice"),
        (with(|_| ()).roots(json!([4])), "scenes[0].nodes[0]"),
        (
            with(|doc| doc.json["scene"] = json!(2)),
            "scene: index out of range",
        ),
        (
            with(|doc| doc.json["nodes"][0]["scale"] = json!([1e300, 1, 1])),
            "nodes[0] 'thing'",
        ),
        (
            with(|doc| doc.json["nodes"][0]["rotation"] = json!([0, 0, 0, 0])),
            "no length",
        ),
        (
            with(|doc| {
                doc.json["nodes"][0]["matrix"] =
                    json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0.5, 0, 0, 0, 1])
            }),
            "not affine",
        ),
        (
            with(|doc| doc.json["materials"] = json!([{ "emissiveFactor": [1e300, 0, 0] }])),
            "emissiveFactor",
        ),
        (
            with(|doc| {
                doc.json["materials"] =
                    json!([{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }])
            }),
            "baseColorTexture",
        ),
        (
            with(|doc| {
                doc.json["materials"] =
                    json!([{ "pbrMetallicRoughness": { "baseColorFactor": "red" } }])
            }),
            "materials[0]",
        ),
        (
            with(|doc| doc.json["asset"]["version"] = json!("1.0")),
            "version 1.0",
        ),
        (
            with(|doc| doc.json["asset"]["minVersion"] = json!("2.1")),
            "version 2.1",
        ),
        (with(|doc| doc.json["asset"] = json!({})), "asset.version"),
    ];
    for (number, (doc, expected)) in cases.into_iter().enumerate() {
        let result = doc.load();
        if expected.is_empty() {
            // An accessor without a view holds zeros (glTF 2.0, section 3.6.2.1): degenerate, not broken.
            assert!(result.is_ok(), "case {number}: {result:?}");
        } else {
            assert_fault(result, expected);
        }
    }
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
