//! Files that mean harm: refused before they take memory, or read within bounds; never beyond the scene's own folder.

use std::path::Path;

use serde_json::{Value, json};
use stereolux::limits::{LoadBudget, LoadLimits};
use stereolux::scene::Scene;
use stereolux::scene::edit::Document;

use super::hostile::{black_png, cases, document, run};
use crate::suite::support::{Folder, assert_says, assert_success, json as json_of, run_into};

/// Refused files leave memory alone; MiB.
const REFUSED_PEAK_MIB: u64 = 1024;
/// Within the default budget; MiB.
const READ_PEAK_MIB: u64 = 4096;

#[test]
fn what_expands_is_refused_before_it_takes_memory_or_read_within_bounds() {
    let folder = Folder::new("hostile-files");
    let mut faults = Vec::new();
    for case in cases(&folder) {
        let bytes = std::fs::metadata(&case.path).unwrap().len();
        let outcome = case.run();
        println!(
            "| {} | {bytes} | {} | {:.1} | {:?} |",
            case.name, outcome.peak_mib, outcome.seconds, outcome.status
        );
        let is_right = match case.refused {
            Some(says) => outcome.refusal().contains(says) && outcome.peak_mib < REFUSED_PEAK_MIB,
            None => outcome.status == Some(0) && outcome.peak_mib < READ_PEAK_MIB,
        };
        if !is_right {
            faults.push(format!("{}: {outcome:?}", case.name));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn a_raised_limit_reads_what_a_lower_one_refuses() {
    let folder = Folder::new("hostile-limit");
    let path = folder.join("large.gltf");
    let text = document(json!({
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "accessors": [{ "componentType": 5126, "count": 30_000, "type": "VEC3" }],
    }));
    std::fs::write(&path, text).unwrap();
    let load = |memory_bytes| {
        let limits = LoadLimits {
            memory_bytes,
            allow_outside: false,
        };
        Scene::load_within(&path, &LoadBudget::new(limits))
    };
    let refused = load(1 << 20).unwrap_err().to_string();
    let counts = ["30000 elements", "30000 vertices"];
    assert!(
        counts.iter().any(|count| refused.contains(count)),
        "{refused}"
    );
    assert_says(&refused, &["limits.load_memory=1"]);
    assert_eq!(load(1 << 26).unwrap().triangle_count(), 10_000);
    let scene = path.to_str().unwrap();
    let low = run(&[
        "info",
        "--scene",
        scene,
        "--set",
        "limits.load_memory=0.001",
    ]);
    assert!(low.refusal().contains("limits.load_memory"), "{low:?}");
    let high = run(&["info", "--scene", scene, "--set", "limits.load_memory=1"]);
    assert_eq!(high.status, Some(0), "{high:?}");
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
    std::fs::write(&path, document(parts)).unwrap();
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
                assert_says(&message, &["--allow-outside"]);
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
fn the_flag_reads_files_outside_and_is_on_record() {
    let folder = with_secret("hostile-allowed");
    let path = scene_naming(&folder, "image", "../secret.png");
    let scene = path.to_str().unwrap();
    let refused = run(&["info", "--scene", scene]);
    assert!(refused.refusal().contains("--allow-outside"), "{refused:?}");
    let allowed = run(&["info", "--scene", scene, "--allow-outside"]);
    assert_eq!(allowed.status, Some(0), "{allowed:?}");
    let report: Value = serde_json::from_str(&allowed.stdout).unwrap();
    let named = report["scene"]["outside_files"][0].as_str().unwrap();
    assert!(named.ends_with("secret.png"), "{report}");

    let command = "render --allow-outside --size 8x8 --photons 64";
    assert_success(&run_into(&folder.join("out"), command, &["--scene", scene]));
    let record = json_of(&folder.join("out/run.json"));
    assert_eq!(record["settings"]["limits"]["allow_outside"], json!(true));
    let named = record["scene"]["outside_files"][0].as_str().unwrap();
    assert!(named.ends_with("secret.png"), "{record}");
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
