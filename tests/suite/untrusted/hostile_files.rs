//! Files that mean harm: refused before they take memory, or read within bounds; never beyond the scene's own folder.

use serde_json::{Value, json};
use stereolux::limits::{LoadBudget, LoadLimits};
use stereolux::scene::Scene;

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
    let text = document(json!({
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "accessors": [{ "componentType": 5126, "count": 30_000, "type": "VEC3" }],
    }));
    let path = folder.write("large.gltf", text);
    let load = |memory_bytes| {
        let limits = LoadLimits {
            memory_bytes,
            allow_outside: false,
        };
        Scene::load_within(&path, &LoadBudget::new(limits))
    };
    let refused = load(1 << 20).unwrap_err().to_string();
    let counts = ["30000 elements", "30000 vertices"];
    let is_said = counts.iter().any(|count| refused.contains(count));
    assert!(is_said, "{refused}");
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

#[test]
fn the_flag_reads_files_outside_and_is_on_record() {
    let folder = Folder::new("hostile-allowed");
    std::fs::write(folder.join("secret.png"), black_png(3, 2)).unwrap();
    std::fs::create_dir(folder.join("scene")).unwrap();
    let image = json!({ "images": [{ "uri": "../secret.png" }] });
    let path = folder.write("scene/scene.gltf", document(image));
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
