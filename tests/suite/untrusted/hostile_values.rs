//! Values that are wrong in a quiet way, and text that steers a terminal: each is said.

use serde_json::{Value, json};
use stereolux::scene::{Scene, load_environment};
use stereolux::xr::Headset;

use super::hostile::{data_uri, document, run};
use super::scene_import::{Doc, assert_fault, with};
use crate::suite::support::Folder;

/// What a setting of a terminal's title and a cleared screen look like.
const STEERING: &str = "\u{1b}]0;owned\u{7}\u{1b}[2J\u{9b}2J\u{202e}";

fn is_clean(text: &str) -> bool {
    !text
        .chars()
        .any(|c| (c.is_control() && c != '\n') || c == '\u{202e}')
}

#[test]
fn indices_beyond_32_bits_and_wrong_kinds_are_faults() {
    const BEYOND: u64 = 1 << 32;
    let sampler = |key: &str, value: u64| {
        with(|doc| {
            doc.json["samplers"] = json!([{ key: value }]);
            doc.json["textures"] = json!([{ "sampler": 0, "source": 0 }]);
            doc.json["images"] = json!([{ "uri": "data:image/png;base64,AAAA" }]);
        })
    };
    let transform = |transform: Value| {
        with(|doc| {
            doc.json["images"] = json!([{ "uri": "data:image/png;base64,AAAA" }]);
            doc.json["textures"] = json!([{ "source": 0 }]);
            doc.json["materials"] = json!([{ "normalTexture": {
                "index": 0, "extensions": { "KHR_texture_transform": transform }
            } }]);
        })
    };
    let cases: Vec<(Doc, &str)> = vec![
        (
            with(|doc| doc.primitive()["targets"] = json!([{ "POSITION": BEYOND }])),
            "targets[0].POSITION: index out of range",
        ),
        (
            with(|doc| doc.primitive()["targets"] = json!([{ "NORMAL": BEYOND + 1 }])),
            "targets[0].NORMAL: index out of range",
        ),
        (
            with(|doc| doc.primitive()["attributes"]["NORMAL"] = json!(BEYOND)),
            "attributes.NORMAL: index out of range",
        ),
        (sampler("wrapS", BEYOND + 33071), "samplers[0].wrapS"),
        (sampler("wrapT", BEYOND + 33071), "samplers[0].wrapT"),
        (sampler("magFilter", BEYOND + 9728), "samplers[0].magFilter"),
        (sampler("minFilter", BEYOND + 9728), "samplers[0].minFilter"),
        (
            with(|doc| doc.json["animations"] = json!(5)),
            "animations: must be a list",
        ),
        (
            with(|doc| doc.json["skins"] = json!("x")),
            "skins: must be a list",
        ),
        (
            with(|doc| doc.json["animations"] = json!([{ "channels": 5, "samplers": [] }])),
            "animations[0].channels: must be a list",
        ),
        (
            with(|doc| doc.json["animations"] = json!([{ "channels": [], "samplers": 5 }])),
            "animations[0].samplers: must be a list",
        ),
        (
            with(|doc| doc.json["skins"] = json!([{ "joints": 5 }])),
            "skins[0].joints: must be a list",
        ),
        (
            transform(json!({ "offset": ["a", "b"] })),
            "KHR_texture_transform",
        ),
        (
            transform(json!({ "rotation": "0.5" })),
            "KHR_texture_transform",
        ),
        (transform(json!({ "scale": 2 })), "KHR_texture_transform"),
        (
            transform(json!({ "texCoord": "1" })),
            "KHR_texture_transform",
        ),
    ];
    for (doc, says) in cases {
        assert_fault(doc.load(), says);
    }
}

#[test]
fn a_key_that_stands_twice_is_a_fault() {
    for text in [
        r#"{"asset":{"version":"2.0"},"nodes":[{"mesh":0,"mesh":1}]}"#,
        r#"{"asset":{"version":"2.0"},"asset":{"version":"2.0"}}"#,
        r#"{"asset":{"version":"2.0"},"extras":{"a":1,"\u0061":2}}"#,
    ] {
        let message = Scene::from_bytes("twice.gltf", text.as_bytes())
            .unwrap_err()
            .to_string();
        assert!(message.contains("stands twice"), "{message}");
    }
}

#[test]
fn cameras_without_a_usable_angle_are_said() {
    for yfov in [-0.5, 0.0, 4.0, 1e30] {
        let doc = with(|doc| {
            doc.json["cameras"] = json!([{
                "type": "perspective", "perspective": { "yfov": yfov, "znear": 0.1 }
            }]);
        });
        let scene = doc.load().unwrap();
        assert_eq!(scene.cameras[0].yfov_rad, None, "{yfov}");
        assert!(
            scene.warnings.iter().any(|line| line.contains("yfov")),
            "{:?}",
            scene.warnings
        );
    }
}

#[test]
fn nested_transforms_stay_within_what_is_counted_in() {
    for (scale, levels) in [(1e100, 4), (1e20, 3), (1e-100, 4)] {
        let doc = with(|doc| {
            let mesh = doc.json["nodes"][0].take();
            let mut nodes: Vec<Value> = (0..levels)
                .map(|level| json!({ "scale": [scale, scale, scale], "children": [level + 1] }))
                .collect();
            nodes.push(mesh);
            doc.json["nodes"] = json!(nodes);
            doc.json["scenes"] = json!([{ "nodes": [0] }]);
        });
        assert_fault(
            doc.load(),
            "with those of its parents its transform is beyond",
        );
    }
    let folder = Folder::new("hostile-scales");
    let path = folder.join("large.gltf");
    let text = document(json!({
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0, "scale": [1e30, 1e30, 1e30] }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "accessors": [{ "componentType": 5126, "count": 3, "type": "VEC3" }],
    }));
    std::fs::write(&path, text).unwrap();
    let report = run(&["info", "--scene", path.to_str().unwrap()]);
    let report: Value = serde_json::from_str(&report.stdout).unwrap();
    assert!(report["scene"]["surface_area_m2"].is_number(), "{report}");
}

fn bright_scene(intensity: f64, lights: usize) -> String {
    document(json!({
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": { "KHR_lights_punctual": {
            "lights": [{ "type": "point", "intensity": intensity }]
        } },
        "scenes": [{ "nodes": (0..lights).collect::<Vec<_>>() }],
        "nodes": vec![json!({
            "extensions": { "KHR_lights_punctual": { "light": 0 } }
        }); lights],
    }))
}

#[test]
fn light_beyond_f32_is_counted_and_said() {
    let load = |intensity, lights| {
        Scene::from_bytes("bright.gltf", bright_scene(intensity, lights).as_bytes()).unwrap()
    };
    let scene = load(3e38, 20);
    assert_eq!(scene.source.too_bright_lights, 20);
    let said = scene
        .warnings
        .iter()
        .find(|line| line.contains("more than can be rendered"));
    assert!(
        said.is_some_and(|line| line.contains("20 of them")),
        "{:?}",
        scene.warnings
    );
    // The sum counts, too.
    let scene = load(5e28, 2000);
    assert_eq!(scene.source.too_bright_lights, 0);
    assert!(
        scene
            .warnings
            .iter()
            .any(|line| line.contains("more than can be rendered"))
    );
    assert!(load(1e6, 20).warnings.is_empty());
}

#[test]
fn nothing_out_of_a_file_steers_the_terminal() {
    let folder = Folder::new("hostile-terminal");
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.join(name);
        std::fs::write(&path, bytes).unwrap();
        path.display().to_string()
    };
    let long = "x".repeat(100_000);
    let uri = data_uri("image/png", &[0; 100_000]);
    let faulty: Vec<(String, Value)> = vec![
        (
            "name".to_owned(),
            json!({ "nodes": [{ "name": STEERING, "scale": [0, 0, 0] }] }),
        ),
        (
            "long".to_owned(),
            json!({ "nodes": [{ "name": long, "scale": [0, 0, 0] }] }),
        ),
        (
            "extension".to_owned(),
            json!({ "extensionsRequired": [STEERING] }),
        ),
        (
            "uri".to_owned(),
            json!({ "buffers": [{ "byteLength": 9, "uri": format!("{STEERING}.bin") }] }),
        ),
        ("data".to_owned(), json!({ "scene": uri })),
        (
            "outside".to_owned(),
            json!({ "images": [{ "uri": format!("../{STEERING}\n{long}") }] }),
        ),
    ];
    for (name, parts) in faulty {
        let path = write(&format!("{name}.gltf"), document(parts).as_bytes());
        let outcome = run(&["info", "--scene", &path]);
        let line = outcome.refusal();
        assert!(
            is_clean(line) && !line.contains("AAAAAAAAAAAAAAAAAAAA"),
            "{name}: {line:?}"
        );
    }
    // Warnings, and what is printed as JSON.
    let warned = write(
        "warned.gltf",
        document(json!({
            "extensionsUsed": (0..300).map(|n| format!("{STEERING}{n}")).collect::<Vec<_>>(),
            "materials": [{ "name": format!("{STEERING}\n\r{long}"), "alphaCutoff": -1.0, "alphaMode": "MASK" }],
        }))
        .as_bytes(),
    );
    let outcome = run(&["info", "--scene", &warned]);
    assert_eq!(outcome.status, Some(0), "{outcome:?}");
    assert!(
        is_clean(&outcome.stderr) && is_clean(&outcome.stdout),
        "{outcome:?}"
    );
    let lines: Vec<&str> = outcome.stderr.lines().collect();
    // A hundred warnings of the file, how many more there are, and one each of light and size.
    assert!(
        lines.len() <= 103 && lines.iter().all(|line| line.chars().count() < 320),
        "{lines:?}"
    );
    assert!(
        lines.iter().any(|line| line.contains("more warnings")),
        "{lines:?}"
    );

    let map = write(
        "sky.hdr",
        format!("#?RADIANCE\nFORMAT={STEERING}\n\n-Y 1 +X {STEERING}\n").as_bytes(),
    );
    let message = load_environment(&map, 1.0).unwrap_err().to_string();
    assert!(is_clean(&message) && !message.contains('\n'), "{message:?}");
    let profile = format!("{STEERING:?} = 1\nname = \"{long}\"\n");
    let message = Headset::from_toml("profile.toml", &profile)
        .unwrap_err()
        .to_string();
    assert!(
        is_clean(&message) && message.chars().count() <= 300,
        "{message:?}"
    );
    let trace = write(
        "wild.jsonl",
        format!("{{\"{STEERING}\":\"{long}\"}}\n").as_bytes(),
    );
    let outcome = run(&[
        "run",
        "--trace",
        &trace[..],
        "--out",
        folder.join("out").to_str().unwrap(),
    ]);
    assert!(is_clean(outcome.refusal()), "{outcome:?}");
    let config = write("wild.toml", format!("scene = \"{STEERING}\n").as_bytes());
    assert!(is_clean(run(&["info", "--config", &config]).refusal()));
}
