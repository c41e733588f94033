//! Files outside the scene's folder: never read unasked, and never saved with the scene.

use std::io::Cursor;
use std::path::Path;

use serde_json::json;
use stereolux_base::limits::{LoadBudget, LoadLimits};
use stereolux_scene::Scene;
use stereolux_scene::edit::Document;

use crate::folders::Folder;

fn black_png(width: u32, height: u32) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let image = image::GrayImage::new(width, height);
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

/// A folder with a file beside the scene's own, `secret`, and the same as a picture.
fn with_secret(name: &str) -> Folder {
    let folder = Folder::new(name);
    std::fs::create_dir_all(folder.join("scene/textures")).unwrap();
    std::fs::write(folder.join("secret"), [b'S'; 64]).unwrap();
    std::fs::write(folder.join("secret.png"), black_png(3, 2)).unwrap();
    std::fs::write(folder.join("scene/textures/own.png"), black_png(2, 2)).unwrap();
    std::fs::write(folder.join("scene/own.bin"), [0; 64]).unwrap();
    folder
}

/// Writes a scene that names `uri` as a buffer, or as an image that is or is not used.
fn scene_naming(folder: &Folder, what: &str, uri: &str) -> std::path::PathBuf {
    let mut parts = json!({
        "asset": { "version": "2.0" },
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "material": 0 }] }],
        "materials": [{}],
        "accessors": [{ "componentType": 5126, "count": 3, "type": "VEC3" }],
    });
    match what {
        "buffer" => parts["buffers"] = json!([{ "uri": uri, "byteLength": 64 }]),
        "unused image" => parts["images"] = json!([{ "uri": uri }]),
        _ => {
            parts["images"] = json!([{ "uri": uri }]);
            parts["textures"] = json!([{ "source": 0 }]);
            parts["materials"][0]["pbrMetallicRoughness"] =
                json!({ "baseColorTexture": { "index": 0 } });
        }
    }
    let path = folder.join("scene/scene.gltf");
    std::fs::write(&path, parts.to_string()).unwrap();
    path
}

/// Every way to name a file outside the scene's folder.
fn outside(folder: &Folder, file: &str) -> Vec<String> {
    let absolute = folder.join(file).display().to_string();
    let mut names = vec![
        format!("../{file}"),
        format!("textures/../../{file}"),
        format!("%2e%2e/{file}"),
        format!("%2E%2E%2F{file}"),
        format!(".%2e/{file}"),
        format!("../scene/../{file}"),
        absolute.clone(),
        absolute.replace('/', "%2F"),
        format!("//{absolute}"),
        // Neither says whether it exists.
        "/nonexistent/file".to_owned(),
        "../nonexistent".to_owned(),
        "/proc/self/environ".to_owned(),
        "//server/share/file".to_owned(),
    ];
    #[cfg(unix)]
    {
        let link = |to: &Path, name: &str| {
            let at = folder.join("scene").join(name);
            let _ = std::fs::remove_file(&at);
            std::os::unix::fs::symlink(to, at).unwrap();
            name.to_owned()
        };
        names.push(link(&folder.join(file), "link"));
        names.push(link(Path::new(&format!("../{file}")), "relative-link"));
        names.push(format!("{}/{file}", link(folder.path(), "folder-link")));
        names.push(link(Path::new("/nonexistent/file"), "dangling-link"));
    }
    names
}

#[test]
fn files_outside_the_scenes_folder_are_refused_in_every_spelling() {
    let folder = with_secret("hostile-outside");
    for (what, file) in [
        ("buffer", "secret"),
        ("image", "secret.png"),
        ("unused image", "secret"),
    ] {
        for uri in outside(&folder, file) {
            let path = scene_naming(&folder, what, &uri);
            let scene = Scene::load(&path).map(|_| ());
            let document = Document::load(path.to_str().unwrap()).map(|_| ());
            for refused in [scene.unwrap_err(), document.unwrap_err()] {
                let message = format!("{what} {uri}: {refused}");
                assert!(message.contains("--allow-outside"), "{message}");
                let tells = message.contains("64 bytes") || message.contains("No such");
                assert!(!tells, "{message}");
            }
        }
    }
    // Inside, links and detours are no harm.
    #[cfg(unix)]
    std::os::unix::fs::symlink("textures/own.png", folder.join("scene/inner-link")).unwrap();
    for uri in [
        "textures/own.png",
        "./textures/../textures/own.png",
        "textures%2Fown.png",
        "inner-link",
    ] {
        let scene = Scene::load(scene_naming(&folder, "image", uri)).unwrap();
        let image = &scene.images[0];
        assert_eq!((image.width, image.height), (2, 2), "{uri}");
    }
}

#[test]
fn saving_takes_along_what_decodes_as_what_it_is_used_for_and_nothing_else() {
    let folder = with_secret("hostile-saving");
    let saved = |path: &Path, allow_outside| {
        let limits = LoadLimits {
            allow_outside,
            ..LoadLimits::default()
        };
        let budget = LoadBudget::new(limits);
        let document = Document::load_within(path.to_str().unwrap(), &budget).unwrap();
        [document.to_glb().unwrap(), document.to_gltf().unwrap()]
    };
    let holds = |file: &[u8], part: &[u8]| file.windows(part.len()).any(|found| found == part);
    // Beside the scene, named as a picture, and none.
    std::fs::write(folder.join("scene/key"), [b'S'; 64]).unwrap();
    let path = scene_naming(&folder, "unused image", "key");
    for file in saved(&path, false) {
        assert!(!holds(&file, &[b'S'; 16]) && !holds(&file, b"U1NTU1NT"));
        // It goes on naming its file.
        assert!(holds(&file, b"\"key\""));
    }
    // Also where files outside are allowed.
    let path = scene_naming(&folder, "unused image", "../secret");
    for file in saved(&path, true) {
        assert!(!holds(&file, &[b'S'; 16]) && !holds(&file, b"U1NTU1NT"));
    }
    // A picture that has lost its end is none.
    let mut cut = black_png(64, 64);
    cut.truncate(60);
    std::fs::write(folder.join("scene/cut.png"), &cut).unwrap();
    let path = scene_naming(&folder, "unused image", "cut.png");
    assert!(!holds(&saved(&path, false)[0], b"IHDR"));
    // A whole one goes along.
    let path = scene_naming(&folder, "image", "textures/own.png");
    assert!(holds(&saved(&path, false)[0], &black_png(2, 2)));
    // Of a buffer no more than is declared.
    let longer = [[0_u8; 64], [b'S'; 64]].concat();
    std::fs::write(folder.join("scene/own.bin"), longer).unwrap();
    let path = scene_naming(&folder, "buffer", "own.bin");
    assert!(!holds(&saved(&path, false)[0], &[b'S'; 16]));
}
