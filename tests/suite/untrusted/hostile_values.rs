//! Values that are wrong in a quiet way, and text that steers a terminal: each is said.

use serde_json::{Value, json};
use stereolux::scene::load_environment;
use stereolux::xr::Headset;

use super::hostile::{data_uri, document, run};
use crate::suite::support::{Folder, assert_says};

/// What a setting of a terminal's title and a cleared screen look like.
const STEERING: &str = "\u{1b}]0;owned\u{7}\u{1b}[2J\u{9b}2J\u{202e}";

fn is_clean(text: &str) -> bool {
    !text
        .chars()
        .any(|c| (c.is_control() && c != '\n') || c == '\u{202e}')
}

#[test]
fn a_scene_of_huge_scale_has_a_finite_area() {
    let folder = Folder::new("hostile-scales");
    let corners = [[0.0_f32; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let bytes: Vec<u8> = corners
        .iter()
        .flatten()
        .flat_map(|c| c.to_le_bytes())
        .collect();
    let uri = data_uri("application/octet-stream", &bytes);
    let text = document(json!({
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0, "scale": [1e30, 1e30, 1e30] }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3" }],
        "bufferViews": [{ "buffer": 0, "byteLength": bytes.len() }],
        "buffers": [{ "byteLength": bytes.len(), "uri": uri }],
    }));
    let path = folder.write("large.gltf", text);
    let report = run(&["info", "--scene", path.to_str().unwrap()]);
    let report: Value = serde_json::from_str(&report.stdout).unwrap();
    // More than f32 holds.
    let area_m2 = report["scene"]["surface_area_m2"].as_f64().unwrap();
    assert!((area_m2 / 5e59 - 1.0).abs() < 1e-12, "{area_m2}");
}

#[test]
fn nothing_out_of_a_file_steers_the_terminal() {
    let folder = Folder::new("hostile-terminal");
    let write = |name: &str, bytes: &[u8]| folder.write(name, bytes).display().to_string();
    let long = "x".repeat(100_000);
    let uri = data_uri("image/png", &[0; 100_000]);
    let turned = |name: &str| json!({ "nodes": [{ "name": name, "rotation": [0, 0, 0, 0] }] });
    let wild_uri = format!("{STEERING}.bin");
    let outside = format!("../{STEERING}\n{long}");
    for (name, parts) in [
        ("name", turned(STEERING)),
        ("long", turned(&long)),
        ("extension", json!({ "extensionsRequired": [STEERING] })),
        (
            "uri",
            json!({ "buffers": [{ "byteLength": 9, "uri": wild_uri }] }),
        ),
        ("data", json!({ "scene": uri })),
        ("outside", json!({ "images": [{ "uri": outside }] })),
    ] {
        let path = write(&format!("{name}.gltf"), document(parts).as_bytes());
        let outcome = run(&["info", "--scene", &path]);
        let line = outcome.refusal();
        let is_short = !line.contains("AAAAAAAAAAAAAAAAAAAA");
        assert!(is_clean(line) && is_short, "{name}: {line:?}");
    }
    // Warnings, and what is printed as JSON.
    let warned = document(json!({
        "extensionsUsed": (0..300).map(|n| format!("{STEERING}{n}")).collect::<Vec<_>>(),
        "materials": [{ "name": format!("{STEERING}\n\r{long}"), "alphaCutoff": -1.0, "alphaMode": "MASK" }],
    }));
    let warned = write("warned.gltf", warned.as_bytes());
    let outcome = run(&["info", "--scene", &warned]);
    assert_eq!(outcome.status, Some(0), "{outcome:?}");
    let are_clean = is_clean(&outcome.stderr) && is_clean(&outcome.stdout);
    assert!(are_clean, "{outcome:?}");
    let lines: Vec<&str> = outcome.stderr.lines().collect();
    // A hundred warnings of the file, how many more there are, and one each of light and size.
    let are_short = lines.iter().all(|line| line.chars().count() < 320);
    assert!(lines.len() <= 103 && are_short, "{lines:?}");
    assert_says(&outcome.stderr, &["more warnings"]);

    let map = format!("#?RADIANCE\nFORMAT={STEERING}\n\n-Y 1 +X {STEERING}\n");
    let map = write("sky.hdr", map.as_bytes());
    let message = load_environment(&map, 1.0).unwrap_err().to_string();
    assert!(is_clean(&message) && !message.contains('\n'), "{message:?}");
    let profile = format!("{STEERING:?} = 1\nname = \"{long}\"\n");
    let refused = Headset::from_toml("profile.toml", &profile).unwrap_err();
    let message = refused.to_string();
    let is_short = message.chars().count() <= 300;
    assert!(is_clean(&message) && is_short, "{message:?}");
    let trace = format!("{{\"{STEERING}\":\"{long}\"}}\n");
    let trace = write("wild.jsonl", trace.as_bytes());
    let out = folder.join("out").display().to_string();
    let outcome = run(&["run", "--trace", &trace, "--out", &out]);
    assert!(is_clean(outcome.refusal()), "{outcome:?}");
    let config = write("wild.toml", format!("scene = \"{STEERING}\n").as_bytes());
    assert!(is_clean(run(&["info", "--config", &config]).refusal()));
}
