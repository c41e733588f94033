//! Saved scenes: what was edited is in the file and reads back the same, and nothing else has changed.

use glam::DAffine3;
use serde_json::{Value, json};
use stereolux_scene::Scene;
use stereolux_scene::edit::{Document, Edit, MaterialPreset, Placement};

use crate::edits::{edit_everything, node};
use crate::folders::Folder;

/// The scene without what a file does not hold: its own name, and what the editor notes for renderers.
fn plain(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    scene.name.clear();
    scene.warnings.clear();
    for mesh in &mut scene.meshes {
        mesh.repainted.clear();
    }
    scene
}

fn json_of(glb: &[u8]) -> Value {
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    serde_json::from_slice(&glb[20..20 + length]).unwrap()
}

fn assert_reads_back(document: &Document, what: &str) {
    for bytes in [document.to_glb().unwrap(), document.to_gltf().unwrap()] {
        let read = Scene::from_bytes("saved", &bytes).unwrap();
        let (read, wanted) = (plain(&read), plain(document.scene()));
        assert_eq!(read.nodes, wanted.nodes, "{what}");
        assert_eq!(read.materials, wanted.materials, "{what}");
        assert_eq!(read.lights, wanted.lights, "{what}");
        assert!(read == wanted, "{what}");
    }
}

#[test]
fn every_edit_is_saved_and_read_back() {
    let folder = Folder::new("saving");
    for (name, nodes) in [
        ("builtin:cornell", ["short block", "tall block", "ceiling"]),
        ("builtin:gallery", ["vase", "bench", "glass sphere"]),
        ("builtin:parade", ["floor", "box", "ball"]),
        ("../../tests/reference/textures.gltf", ["", "", ""]),
        ("../../tests/reference/lights.gltf", ["", "", ""]),
    ] {
        let mut document = Document::load(name).unwrap();
        assert_reads_back(&document, name);
        let named: Vec<String> = document
            .scene()
            .instances()
            .iter()
            .map(|placed| document.scene().nodes[placed.node].name.clone())
            .collect();
        let nodes: [&str; 3] = std::array::from_fn(|at| {
            let known = document.scene().nodes.iter().any(|n| n.name == nodes[at]);
            if known {
                nodes[at]
            } else {
                named[at % named.len()].as_str()
            }
        });
        edit_everything(&mut document, nodes);
        assert_reads_back(&document, name);
        assert!(document.is_modified());
        let path = folder.join("scene.glb");
        document.save(&path).unwrap();
        assert!(!document.is_modified());
        // Undone, the scene is the first one again, and so is its file.
        while document.undo().unwrap() {}
        let untouched = Document::load(name).unwrap();
        assert_eq!(document.to_glb().unwrap(), untouched.to_glb().unwrap());
        // And what was saved can be edited and saved on.
        let mut again = Document::load(path.to_str().unwrap()).unwrap();
        let hidden = again
            .scene()
            .nodes
            .iter()
            .position(|n| n.is_hidden)
            .unwrap();
        let show = Edit::Visibility {
            node: hidden,
            is_hidden: false,
        };
        again.edit(show).unwrap();
        assert_reads_back(&again, name);
    }
    assert_eq!(folder.files(), ["scene.glb"]);
}

#[test]
fn a_node_that_reading_cut_from_its_parent_is_cut_in_what_is_saved_after_it_was_deleted() {
    let folder = Folder::new("saving-cut");
    let json = json!({
        "asset": { "version": "2.0" },
        "scenes": [{ "nodes": [1] }],
        "nodes": [{ "name": "above", "children": [1] }, { "name": "thing" }],
    });
    let path = folder.write("cut.gltf", json.to_string());
    let mut document = Document::load(path.to_str().unwrap()).unwrap();
    assert_eq!(document.scene().warnings.len(), 1);
    document.edit(Edit::Delete { node: 1 }).unwrap();
    assert_reads_back(&document, "cut");
}

#[test]
fn presets_with_and_without_textures_are_read_back() {
    let mut document = Document::load("builtin:gallery").unwrap();
    let count = document.scene().materials.len();
    for material in 0..count {
        for preset in MaterialPreset::ALL {
            let to = preset.applied_to(&document.scene().materials[material]);
            let to = Box::new(to);
            document.edit(Edit::Material { material, to }).unwrap();
            let read = Scene::from_bytes("saved", &document.to_glb().unwrap()).unwrap();
            let (mut wanted, mut found) = (
                document.scene().materials[material].clone(),
                read.materials[material].clone(),
            );
            // Textures that no material reads are not numbered any more.
            assert_eq!(
                wanted.base_color_texture.is_some(),
                found.base_color_texture.is_some()
            );
            assert_eq!(
                wanted.normal_texture.is_some(),
                found.normal_texture.is_some()
            );
            for side in [&mut wanted, &mut found] {
                side.base_color_texture = None;
                side.normal_texture = None;
            }
            assert_eq!(wanted, found);
            document.undo().unwrap();
        }
    }
}

/// A file of several parts: data in two files and an image, a matrix, an animation, another scene, extras and extensions
/// that nobody knows.
fn patchwork(folder: &Folder) -> Value {
    let glb = stereolux_scene::builtin::glb("parade").unwrap();
    let mut root = json_of(&glb);
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    let bin = &glb[28 + length..];
    // The odd bytes in front of the second buffer make its place in the saved file another one.
    std::fs::write(folder.join("first.bin"), [1, 2, 3]).unwrap();
    std::fs::write(folder.join("the second.bin"), bin).unwrap();
    root["buffers"] = json!([
        { "byteLength": 3, "uri": "first.bin", "extras": { "keep": 1 } },
        { "byteLength": bin.len(), "uri": "the%20second.bin" },
    ]);
    for view in root["bufferViews"].as_array_mut().unwrap() {
        view["buffer"] = json!(1);
    }
    let pixel = image::RgbImage::from_pixel(2, 2, image::Rgb([200, 100, 50]));
    pixel.save(folder.join("dots.png")).unwrap();
    root["images"] = json!([{ "uri": "dots.png" }]);
    root["textures"] = json!([{ "source": 0 }]);
    root["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({ "index": 0 });
    root["materials"][0]["extensions"]["KHR_materials_clearcoat"] =
        json!({ "clearcoatFactor": 0.5 });
    root["extensionsUsed"] = json!(["KHR_materials_clearcoat", "ACME_unknown"]);
    root["extras"] = json!({ "author": "somebody", "list": [1, 2.5] });
    root["extensions"]["ACME_unknown"] = json!({ "nodes": [0, 1] });
    let still = root["nodes"].as_array().unwrap().len();
    root["nodes"].as_array_mut().unwrap().push(json!({
        "name": "by matrix", "mesh": 0, "extras": { "tag": "kept" },
        "matrix": [0.5, 0, 0, 0, 0, 0.25, 0, 0, 0, 0, 0.5, 0, 0.1, 2, 0.3, 1],
    }));
    root["scenes"][0]["nodes"]
        .as_array_mut()
        .unwrap()
        .push(json!(still));
    root["scenes"]
        .as_array_mut()
        .unwrap()
        .push(json!({ "name": "other", "nodes": [still] }));
    std::fs::write(folder.join("scene.gltf"), root.to_string()).unwrap();
    root
}

/// Integers that are written as 1.0: nothing is taken for the first buffer, material or scene.
#[test]
fn integers_with_a_fraction_of_zero_are_saved() {
    let folder = Folder::new("saving-fractions");
    let mut root = patchwork(&folder);
    for view in root["bufferViews"].as_array_mut().unwrap() {
        view["buffer"] = json!(1.0);
        view["byteOffset"] = json!(view["byteOffset"].as_f64().unwrap());
    }
    root["meshes"][0]["primitives"][0]["material"] = json!(1.0);
    root["scene"] = json!(1.0);
    // Called by its number, which its copy does not have.
    let unnamed = root["materials"][1].as_object_mut().unwrap();
    unnamed.remove("name");
    let path = folder.write("scene.gltf", root.to_string());
    let mut document = Document::load(path.to_str().unwrap()).unwrap();
    assert_eq!(document.scene().roots.len(), 1);
    assert_reads_back(&document, "unchanged");
    let own = Edit::OwnMaterial {
        mesh: 0,
        material: 1,
    };
    document.edit(own).unwrap();
    let node = document.scene().roots[0];
    document.edit(Edit::Duplicate { node }).unwrap();
    assert_reads_back(&document, "edited");
}

#[test]
fn what_was_not_edited_stays_and_the_file_stands_alone() {
    let folder = Folder::new("saving-patchwork");
    let before = patchwork(&folder);
    let source = folder.join("scene.gltf");
    let mut document = Document::load(source.to_str().unwrap()).unwrap();
    let box_node = node(document.scene(), "box");
    let mut parts = document.scene().nodes[box_node].trs();
    parts.translation.x = 0.1;
    let to = Placement::Parts(parts);
    document
        .edit(Edit::Transform { node: box_node, to })
        .unwrap();
    let mut material = document.scene().materials[0].clone();
    material.roughness = 0.3;
    document
        .edit(Edit::Material {
            material: 0,
            to: Box::new(material),
        })
        .unwrap();
    let saved = document.to_glb().unwrap();
    let wanted = plain(document.scene());
    // Another program's bytes are not what was edited; the same bytes with a new time are.
    for name in ["first.bin", "dots.png"] {
        let path = folder.join(name);
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, [&bytes[..], b"more"].concat()).unwrap();
        let error = document.to_glb().unwrap_err().to_string();
        assert!(error.contains(&format!("{name}: has changed")), "{error}");
        std::fs::remove_file(&path).unwrap();
        assert!(document.to_glb().is_err(), "{name} has gone");
        std::fs::write(&path, bytes).unwrap();
        assert!(document.to_glb().unwrap() == saved, "{name}");
    }
    // Alone: everything beside it is gone.
    for name in ["first.bin", "the second.bin", "dots.png", "scene.gltf"] {
        std::fs::remove_file(folder.join(name)).unwrap();
    }
    let read = Scene::from_bytes("alone", &saved).unwrap();
    assert!(plain(&read) == wanted);
    assert_eq!(wanted.images[0].name, "dots.png");
    // Only these differ in the JSON.
    let after = json_of(&saved);
    let mut expected = before.clone();
    expected["nodes"][box_node]["translation"] = json!(parts.translation.to_array());
    expected["materials"][0]["pbrMetallicRoughness"]["roughnessFactor"] = json!(0.3);
    for key in [
        "nodes",
        "materials",
        "meshes",
        "animations",
        "skins",
        "scenes",
        "extras",
        "extensions",
        "extensionsUsed",
        "accessors",
        "textures",
    ] {
        assert_eq!(after[key], expected[key], "{key}");
    }
    assert_eq!(after["buffers"].as_array().unwrap().len(), 1);
    assert_eq!(after["buffers"][0]["extras"]["keep"], 1);
    // A second file whose parts have gone says so.
    let error = document
        .save(&folder.join("late.glb"))
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("first.bin") && !error.contains('\n'),
        "{error}"
    );
    let error = document
        .save(&folder.join("scene.obj"))
        .unwrap_err()
        .to_string();
    assert!(error.contains(".glb or .gltf"), "{error}");
    assert_eq!(folder.files(), [""; 0]);
}

#[test]
fn deleted_nodes_show_nowhere_and_keep_everybodys_number() {
    let folder = Folder::new("saving-deleted");
    patchwork(&folder);
    let source = folder.join("scene.gltf");
    let mut document = Document::load(source.to_str().unwrap()).unwrap();
    let gone = node(document.scene(), "by matrix");
    let instances = document.scene().instances().len();
    document.edit(Edit::Delete { node: gone }).unwrap();
    assert_reads_back(&document, "deleted");
    let read = Scene::from_bytes("saved", &document.to_glb().unwrap()).unwrap();
    assert_eq!(read.instances().len(), instances - 1);
    assert_eq!(read.nodes.len(), document.scene().nodes.len());
    // A file without scenes shows every root; once one is deleted it needs a scene.
    let mut file = json!({
        "asset": { "version": "2.0" },
        "nodes": [{ "name": "a" }, { "name": "b", "children": [2] }, { "name": "c" }],
    });
    for _ in 0..2 {
        std::fs::write(&source, file.to_string()).unwrap();
        let mut document = Document::load(source.to_str().unwrap()).unwrap();
        document.edit(Edit::Delete { node: 2 }).unwrap();
        assert_reads_back(&document, "without scenes");
        document.edit(Edit::Delete { node: 0 }).unwrap();
        assert_reads_back(&document, "without scenes");
        document.edit(Edit::Delete { node: 1 }).unwrap();
        assert_reads_back(&document, "without anything");
        // The same of an empty list of them.
        file["scenes"] = json!([]);
    }
}

#[test]
fn the_default_material_is_written_where_it_is_edited() {
    let glb = stereolux_scene::builtin::glb("plane").unwrap();
    let folder = Folder::new("saving-default");
    let mut root = json_of(&glb);
    let bin = &glb[28 + u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize..];
    std::fs::write(folder.join("data.bin"), bin).unwrap();
    root["buffers"][0]["uri"] = json!("data.bin");
    let primitive = root["meshes"][0]["primitives"][0].as_object_mut().unwrap();
    primitive.remove("material");
    std::fs::write(folder.join("scene.gltf"), root.to_string()).unwrap();
    let path = folder.join("scene.gltf");
    let load = || Document::load(path.to_str().unwrap()).unwrap();
    let material = load().scene().meshes[0].triangles[0].material as usize;
    let mut document = load();
    let mut to = document.scene().materials[material].clone();
    assert_eq!(to.name, "default");
    to.roughness = 0.5;
    let to = Box::new(to);
    document.edit(Edit::Material { material, to }).unwrap();
    assert_reads_back(&document, "edited");
    let mut document = load();
    document
        .edit(Edit::OwnMaterial { mesh: 0, material })
        .unwrap();
    assert_reads_back(&document, "copied");
}

#[test]
fn the_extension_for_visibility_is_read() {
    let text = |visible: &str| {
        format!(
            r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],
            "extensionsUsed":["KHR_node_visibility"],"extensionsRequired":["KHR_node_visibility"],
            "nodes":[{{"extensions":{{"KHR_node_visibility":{{{visible}}}}}}}]}}"#
        )
    };
    let load = |visible: &str| Scene::from_bytes("v.gltf", text(visible).as_bytes());
    for (visible, is_hidden) in [
        (r#""visible":false"#, true),
        (r#""visible":true"#, false),
        ("", false),
    ] {
        let scene = load(visible).unwrap();
        assert_eq!(scene.nodes[0].is_hidden, is_hidden);
        assert!(scene.source.left_out.is_empty());
    }
    let error = load(r#""visible":1"#).unwrap_err().to_string();
    assert!(error.contains("'visible' must be true or false"), "{error}");
}

#[test]
fn what_a_file_cannot_hold_is_not_saved() {
    let mut scene = Scene::builtin("cornell").unwrap();
    let document = Document::load("builtin:cornell").unwrap();
    let sphere = Scene::builtin("sphere").unwrap();
    let at = Placement::of(DAffine3::IDENTITY);
    let part = scene.add_part(sphere, "sphere", None, at).unwrap();
    let refused = Document::new(scene.clone(), document.original().clone()).to_glb();
    let message = refused.unwrap_err().to_string();
    assert!(
        message.contains("take them out before it is saved"),
        "{message}"
    );
    scene.remove_part(&part).unwrap();
    Document::new(scene, document.original().clone())
        .to_glb()
        .unwrap();
}
