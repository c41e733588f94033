//! Values that are wrong in a quiet way, and text that steers a terminal: each is said.

use serde_json::{Value, json};
use stereolux::scene::{Scene, load_environment};
use stereolux::xr::Headset;

use super::hostile::{data_uri, document, run};
use crate::suite::support::Folder;

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
