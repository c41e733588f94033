//! Values that are wrong in a quiet way: each is said.

use serde_json::{Value, json};
use stereolux_scene::Scene;

use super::import::{assert_fault, png_1x1, set, with};
use crate::cases::cases;

/// Where a textured square is changed, to what, and what is said; 4294967296 is 2^32.
const FAULTS: &str = r#"
    /meshes/0/primitives/0/targets | [{ "POSITION": 4294967296 }] | targets[0].POSITION: index out of range
    /meshes/0/primitives/0/targets | [{ "NORMAL": 4294967297 }] | targets[0].NORMAL: index out of range
    /meshes/0/primitives/0/attributes/NORMAL | 4294967296 | attributes.NORMAL: index out of range
    /animations | 5 | animations: must be a list
    /skins | "x" | skins: must be a list
    /animations | [{ "channels": 5, "samplers": [] }] | animations[0].channels: must be a list
    /animations | [{ "channels": [], "samplers": 5 }] | animations[0].samplers: must be a list
    /skins | [{ "joints": 5 }] | skins[0].joints: must be a list
    /samplers/0/wrapS | 4295000367 | samplers[0].wrapS
    /samplers/0/wrapT | 4295000367 | samplers[0].wrapT
    /samplers/0/magFilter | 4294977024 | samplers[0].magFilter
    /samplers/0/minFilter | 4294977024 | samplers[0].minFilter
    /materials/0/normalTexture/extensions | {"KHR_texture_transform": {"offset": ["a", "b"]}} | KHR_texture_transform
    /materials/0/normalTexture/extensions | {"KHR_texture_transform": {"rotation": "0.5"}} | KHR_texture_transform
    /materials/0/normalTexture/extensions | {"KHR_texture_transform": {"scale": 2}} | KHR_texture_transform
    /materials/0/normalTexture/extensions | {"KHR_texture_transform": {"texCoord": "1"}} | KHR_texture_transform
"#;

#[test]
fn indices_beyond_32_bits_and_wrong_kinds_are_faults() {
    let textured = with(|doc| {
        let png = doc.view(&png_1x1());
        doc.json["images"] = json!([{ "bufferView": png }]);
        doc.json["samplers"] = json!([{}]);
        doc.json["textures"] = json!([{ "sampler": 0, "source": 0 }]);
        doc.json["materials"] = json!([{ "normalTexture": { "index": 0 } }]);
    });
    textured.load().unwrap();
    for [at, value, says] in cases(FAULTS) {
        let mut doc = textured.clone();
        set(&mut doc.json, at, value.parse().unwrap());
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
