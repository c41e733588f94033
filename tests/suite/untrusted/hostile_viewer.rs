//! The viewer, fed files that mean harm: the old scene stays, and one message says why.

use serde_json::json;
use stereolux::viewer::App;

use super::hostile::{Way, black_png, cases, document};
use super::viewer_files::drop_file;
use super::viewer_support::{Viewer, errors, open, push, settle, until};
use crate::suite::support::{Folder, assert_says};

fn close_messages(viewer: &mut Viewer) {
    while !errors(viewer.state()).is_empty() {
        // An area is measured before it is shown.
        viewer.step();
        push(viewer, "Close");
    }
}

#[test]
fn the_old_scene_stays_and_one_message_says_why() {
    let folder = Folder::new("hostile-viewer");
    let mut viewer = open("builtin:cornell", &folder, |_| {});
    let files = cases(&folder);
    let refused = files
        .iter()
        .filter(|case| case.refused.is_some() && case.way != Way::Compare);
    for (index, case) in refused.enumerate() {
        // By turns dropped, and opened by its path as the dialog does it.
        if index % 2 == 0 {
            drop_file(&mut viewer, &case.path);
        } else {
            let context = viewer.ctx.clone();
            let path = case.path.display().to_string();
            viewer.state_mut().open(&context, path);
        }
        until(&mut viewer, case.name, |app| !errors(app).is_empty());
        let said = errors(viewer.state());
        assert_eq!(said.len(), 1, "{}: {said:?}", case.name);
        assert_says(said[0], &[case.name]);
        assert!(said[0].chars().count() <= 300, "{said:?}");
        let app = viewer.state();
        assert_eq!(app.document().scene().name, "builtin:cornell");
        assert_eq!(app.settings().scene, "builtin:cornell");
        assert!(app.settings().environment.path.is_empty(), "{}", case.name);
        close_messages(&mut viewer);
    }
    settle(&mut viewer);
}

#[test]
fn a_scene_that_names_files_outside_its_folder_is_asked_about() {
    let folder = Folder::new("hostile-viewer-outside");
    std::fs::create_dir_all(folder.join("scene")).unwrap();
    std::fs::write(folder.join("shared.png"), black_png(2, 2)).unwrap();
    let text = document(json!({
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "material": 0 }] }],
        "accessors": [{ "componentType": 5126, "count": 3, "type": "VEC3" }],
        "images": [{ "uri": "../shared.png" }],
        "textures": [{ "source": 0 }],
        "materials": [{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }],
    }));
    let scene = folder.write("scene/textured.gltf", text);
    let mut viewer = open("builtin:cornell", &folder, |_| {});
    for answer in ["Leave it", "Read them"] {
        drop_file(&mut viewer, &scene);
        until(&mut viewer, "the refusal", |app| !errors(app).is_empty());
        assert!(errors(viewer.state())[0].contains("--allow-outside"));
        assert_eq!(viewer.state().document().scene().name, "builtin:cornell");
        viewer.step();
        push(&mut viewer, answer);
        close_messages(&mut viewer);
    }
    let is_textured = |app: &App| app.document().scene().name == "textured";
    until(&mut viewer, "the scene", is_textured);
    // The answer was for this scene alone.
    assert!(!viewer.state().settings().limits.allow_outside);
}
