//! Values that are wrong in a quiet way: each is said.

use serde_json::{Value, json};
use stereolux_scene::Scene;

use super::import::{Doc, assert_fault, with};

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
    let nested = |scale: f64, levels: usize| {
        let doc = with(|doc| {
            let mesh = doc.json["nodes"][0].take();
            let mut nodes: Vec<Value> = (0..levels)
                .map(|level| json!({ "scale": [scale, scale, scale], "children": [level + 1] }))
                .collect();
            nodes.push(mesh);
            doc.json["nodes"] = json!(nodes);
            doc.json["scenes"] = json!([{ "nodes": [0] }]);
        });
        doc.load()
    };
    for (scale, levels) in [(1e100, 4), (1e20, 3)] {
        assert_fault(
            nested(scale, levels),
            "with those of its parents its transform is beyond",
        );
    }
    // As good as a scale of 0.
    let vanished = nested(1e-100, 4).unwrap();
    let flat = vanished.warnings.iter().filter(|w| w.contains("flattens"));
    assert_eq!(flat.count(), 1, "{:?}", vanished.warnings);
}

fn bright_scene(intensity: f64, lights: usize) -> String {
    let document = json!({
        "asset": { "version": "2.0" },
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": { "KHR_lights_punctual": {
            "lights": [{ "type": "point", "intensity": intensity }]
        } },
        "scenes": [{ "nodes": (0..lights).collect::<Vec<_>>() }],
        "nodes": vec![json!({
            "extensions": { "KHR_lights_punctual": { "light": 0 } }
        }); lights],
    });
    document.to_string()
}

#[test]
fn light_beyond_f32_is_counted_and_said() {
    let load = |intensity, lights| {
        Scene::from_bytes("bright.gltf", bright_scene(intensity, lights).as_bytes()).unwrap()
    };
    let too_bright = |scene: &Scene| {
        let mut lines = scene.warnings.iter();
        let found = lines.find(|line| line.contains("more than can be rendered"));
        found.cloned().unwrap_or_default()
    };
    let scene = load(3e38, 20);
    assert_eq!(scene.source.too_bright_lights, 20);
    assert!(too_bright(&scene).contains("20 of them"));
    // The sum counts, too.
    let scene = load(5e28, 2000);
    assert_eq!(scene.source.too_bright_lights, 0);
    assert_ne!(too_bright(&scene), "");
    assert!(load(1e6, 20).warnings.is_empty());
}
