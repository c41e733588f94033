//! Nodes, the scene's roots, and lights.

use glam::DMat4;
use serde_json::{Value, json};

use super::super::gltf_writer::{number, numbers, put_light_kind};
use super::super::{Node, PunctualLight, Scene};
use super::{Original, entry, extension, factor_and_strength, list_mut, note_used, remove, whole};

const VISIBILITY: &str = "KHR_node_visibility";
const LIGHTS: &str = "KHR_lights_punctual";

/// Writes what was edited of nodes, roots and lights.
pub fn patch(root: &mut Value, original: &Original, scene: &Scene) {
    let mut used = Vec::new();
    if !scene.nodes.is_empty() {
        entry(root, "nodes", || json!([]));
    }
    let mut regrouped = scene.roots != original.roots;
    for (index, node) in scene.nodes.iter().enumerate() {
        let before = original.nodes.get(index);
        if before == Some(node) {
            continue;
        }
        regrouped |= before.is_none_or(|before| before.children != node.children);
        if before.is_none()
            && let Some(list) = root["nodes"].as_array_mut()
        {
            list.push(json!({}));
        }
        if let Some(value) = list_mut(root, "nodes").get_mut(index) {
            patch_node(value, before, node, &mut used);
        }
    }
    if regrouped {
        // All of them: a file may have had children that reading cut off.
        for (value, node) in list_mut(root, "nodes").iter_mut().zip(&scene.nodes) {
            set_list(value, "children", &node.children);
        }
    }
    // Without a scene every node without a parent is shown, deleted ones too.
    if regrouped && list_mut(root, "scenes").is_empty() {
        root["scenes"] = json!([{ "nodes": original.roots }]);
        root["scene"] = json!(0);
    }
    if scene.roots != original.roots {
        let chosen = whole(root, "scene").unwrap_or(0) as usize;
        if let Some(shown) = list_mut(root, "scenes").get_mut(chosen) {
            set_list(shown, "nodes", &scene.roots);
        }
    }
    for (index, light) in scene.lights.iter().enumerate() {
        let before = original.lights.get(index);
        if before == Some(light) {
            continue;
        }
        let all = entry(extension(root, LIGHTS, &mut used), "lights", || json!([]));
        if let Some(all) = all.as_array_mut() {
            while all.len() <= index {
                all.push(json!({}));
            }
            patch_light(&mut all[index], before, light);
        }
    }
    note_used(root, &used);
}

/// glTF has no empty lists.
fn set_list(object: &mut Value, key: &str, list: &[usize]) {
    if list.is_empty() {
        remove(object, &[key]);
    } else {
        object[key] = json!(list);
    }
}

fn patch_node(value: &mut Value, before: Option<&Node>, node: &Node, used: &mut Vec<&'static str>) {
    if before.is_none_or(|before| before.name != node.name) {
        value["name"] = json!(node.name);
    }
    let is_placed_anew = |before: &Node| {
        before.parent_from_node != node.parent_from_node || before.parts != node.parts
    };
    if before.is_none_or(is_placed_anew) {
        patch_transform(value, before, node);
    }
    if before.is_some_and(|before| before.is_hidden) != node.is_hidden {
        extension(value, VISIBILITY, used)["visible"] = json!(!node.is_hidden);
    }
    if before.is_some() {
        return;
    }
    for (key, index) in [("mesh", node.mesh), ("camera", node.camera)] {
        if let Some(index) = index {
            value[key] = json!(index);
        }
    }
    if !node.morph_weights.is_empty() {
        value["weights"] = json!(node.morph_weights);
    }
    if let Some(light) = node.light {
        extension(value, LIGHTS, used)["light"] = json!(light);
    }
}

fn patch_transform(value: &mut Value, before: Option<&Node>, node: &Node) {
    let Some(parts) = node.exact_parts() else {
        remove(value, &["translation", "rotation", "scale"]);
        value["matrix"] = json!(DMat4::from(node.parent_from_node).to_cols_array());
        return;
    };
    remove(value, &["matrix"]);
    // A new node stands at its parent's place where nothing is said; so does one that had a matrix.
    let known = match before {
        Some(before) => before.exact_parts(),
        None => Some(super::super::Trs::default()),
    };
    let same = known.unwrap_or_default();
    let all = before.is_some() && known.is_none();
    if all || parts.translation != same.translation {
        value["translation"] = json!(parts.translation.to_array());
    }
    if all || parts.rotation != same.rotation {
        value["rotation"] = json!(parts.rotation.to_array());
    }
    if all || parts.scale != same.scale {
        value["scale"] = json!(parts.scale.to_array());
    }
}

fn patch_light(value: &mut Value, before: Option<&PunctualLight>, light: &PunctualLight) {
    if before.is_none_or(|before| before.name != light.name) {
        value["name"] = json!(light.name);
    }
    if before.is_none_or(|before| before.intensity != light.intensity) {
        let (color, intensity) = factor_and_strength(light.intensity);
        value["color"] = numbers(&color);
        value["intensity"] = number(intensity);
    }
    if before.is_none_or(|before| before.kind != light.kind) {
        put_light_kind(value, light.kind);
    }
}
