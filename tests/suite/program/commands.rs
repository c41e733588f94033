//! The program as a user meets it: exit status, stderr, and the files that it leaves.

use std::path::Path;
use std::process::Output;
use std::time::{Duration, Instant};

use serde_json::Value;
use stereolux::images::read_image;

use crate::suite::support::{Folder, assert_success, json, run_into, stats, stderr, stereolux};

fn render(folder: &Folder, args: &[&str]) -> Output {
    render_into(&folder.join("out"), args)
}

/// A small picture by few photons, with its files in `out`.
pub fn render_into(out: &Path, args: &[&str]) -> Output {
    run_into(out, "render --size 16x12 --photons 500", args)
}

/// Every fault a user can make: status 2 in seconds, one line that begins with `error:`, and no file that was not there.
#[test]
fn bad_input_is_one_clear_line_and_leaves_nothing() {
    let folder = Folder::new("bad-input");
    let put = |name: &str, bytes: &[u8]| {
        std::fs::write(folder.join(name), bytes).unwrap();
        folder.join(name).display().to_string()
    };
    let glb = stereolux::scene::builtin::glb("cornell").unwrap();
    let gltf = |nodes: &str, more: &str| {
        format!(
            r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":{nodes}{more}}}"#
        )
    };
    let mesh = |position: &str, count: &str| {
        gltf(
            r#"[{"mesh":0}]"#,
            &format!(
                r#","meshes":[{{"primitives":[{{"attributes":{{"POSITION":{position}}}}}]}}],
                "accessors":[{{"bufferView":0,"componentType":5126,"count":{count},"type":"VEC3"}}],
                "bufferViews":[{{"buffer":0,"byteLength":36}}],
                "buffers":[{{"byteLength":36,"uri":"nan.bin"}}]"#
            ),
        )
    };
    let nan: Vec<u8> = [f32::NAN; 9]
        .iter()
        .flat_map(|value| value.to_le_bytes())
        .collect();
    put("nan.bin", &nan);
    let missing = folder.join("missing.glb").display().to_string();
    let directory = folder.path().display().to_string();
    let empty = put("empty.glb", b"");
    let truncated = put("truncated.glb", &glb[..glb.len() / 2]);
    let header = put("header.glb", &glb[..11]);
    let cyclic = put(
        "cyclic.gltf",
        gltf(r#"[{"children":[1]},{"children":[0]}]"#, "").as_bytes(),
    );
    let range = put("range.gltf", gltf(r#"[{"mesh":3}]"#, "").as_bytes());
    let accessor = put("accessor.gltf", mesh("9", "3").as_bytes());
    let not_finite = put("nan.gltf", mesh("0", "3").as_bytes());
    let huge = put("huge.gltf", mesh("0", "4611686018427387904").as_bytes());
    let head = r#"{"format":"stereolux-trace","version":1,"headset":"x","refresh_hz":90.0}"#;
    let broken_trace = put(
        "broken.jsonl",
        format!("{head}\n{{\"t_ns\":0\n{head}\n").as_bytes(),
    );
    let unknown_key = put("unknown.toml", b"[photon]\ncout = 3\n");
    let syntax = put("syntax.toml", b"seed = = 3\n");
    let file = put("a-file", b"in the way");
    let below_file = format!("{file}/below");
    let picture = put("picture.exr", b"no picture");
    let before = folder.files();

    let cases: Vec<(Vec<&str>, &str)> = vec![
        (vec!["render", "--scene", &missing], "missing.glb"),
        (vec!["render", "--scene", &directory], "directory"),
        (vec!["render", "--scene", &empty], "empty"),
        (vec!["render", "--scene", &truncated], "truncated"),
        (vec!["render", "--scene", &header], "header.glb"),
        (vec!["render", "--scene", &cyclic], "cycle"),
        (vec!["render", "--scene", &range], "nodes[0].mesh"),
        (vec!["render", "--scene", &accessor], "accessor"),
        (vec!["render", "--scene", &not_finite], "finite"),
        (vec!["render", "--scene", &huge], "accessors[0]"),
        (vec!["render", "--scene", "builtin:cornel"], "cornell"),
        (vec!["run", "--trace", &broken_trace], "line 2"),
        (vec!["run", "--trace", &missing], "missing.glb"),
        (vec!["run", "--trace", &directory], "directory"),
        (vec!["render", "--fov", "-95 40 40 -40"], "89"),
        (vec!["render", "--fov", "40 -40 40 -40"], "left"),
        (vec!["render", "--fov", "-40 40 40"], "--fov"),
        (vec!["render", "--pose", "0 0 0 0 0 0 2"], "--pose"),
        (vec!["render", "--ipd", "-1"], "--ipd"),
        (vec!["render", "--size", "0x0"], "--size"),
        (vec!["render", "--size", "16384x16384"], "--size"),
        (vec!["render", "--spp", "0"], "--spp"),
        (vec!["render", "--headset", "nonsuch"], "quest3"),
        (vec!["render", "--set", "photon.cout=3"], "photon.count"),
        (
            vec!["render", "--set", "environment.path=nowhere.hdr"],
            "nowhere.hdr",
        ),
        (vec!["render", "--config", &unknown_key], "unknown.toml:2"),
        (vec!["render", "--config", &syntax], "syntax.toml:1"),
        (vec!["render", "--config", &missing], "missing.glb"),
        (
            vec!["render", "--adapter", "no such adapter"],
            "no such adapter",
        ),
        (
            vec!["run", "--adapter", "no such adapter"],
            "no such adapter",
        ),
        (vec!["render", "--out", &file], "--out"),
        (vec!["run", "--out", &file, "--frames", "1"], "--out"),
        (vec!["render", "--out", &below_file], "--out"),
        (
            vec!["run", "--record", &below_file, "--frames", "1"],
            "below",
        ),
        (vec!["compare", &missing, &missing], "missing.glb"),
        (vec!["compare", &picture, &picture], "picture.exr"),
        (vec!["info", "--scene", &missing], "missing.glb"),
        (
            vec!["bench", "nonsuch"],
            "tables, stereo, pareto, scaling, smoke",
        ),
        (vec!["bench", "smoke", "--scene", &missing], "missing.glb"),
        (
            vec!["bench", "stereo", "--scene", "builtin:cornel"],
            "cornell",
        ),
        (vec!["bench", "smoke", "--rounds", "0"], "--rounds"),
        (vec!["bench", "work", "--rounds", "2"], "leave --rounds out"),
        (
            vec!["bench", "smoke", "--reference-spp", "4"],
            "--reference-spp",
        ),
        (vec!["bench", "smoke", "--size", "0x4"], "--size"),
        (
            vec!["bench", "smoke", "--set", "photon.cout=3"],
            "photon.count",
        ),
        (vec!["bench", "smoke", "--set", "headset=nonsuch"], "quest3"),
        (
            vec!["bench", "smoke", "--adapter", "no such adapter"],
            "no such adapter",
        ),
        (vec!["bench", "smoke", "--out", &file], "--out"),
    ];
    let out = folder.join("out").display().to_string();
    let mut faults = Vec::new();
    for (args, says) in &cases {
        let mut all = args.clone();
        if matches!(args[0], "run" | "render" | "bench") && !args.contains(&"--out") {
            all.extend(["--out", &out]);
        }
        let began = Instant::now();
        let output = stereolux(&all);
        let took = began.elapsed();
        let text = stderr(&output);
        let mut wrong = Vec::new();
        if output.status.code() != Some(2) {
            wrong.push(format!("status {:?}", output.status.code()));
        }
        if text.lines().count() != 1 || !text.starts_with("error: ") {
            wrong.push("not one line".to_owned());
        }
        if !text.contains(says) {
            wrong.push(format!("does not say {says:?}"));
        }
        if text.contains("panicked") {
            wrong.push("panic".to_owned());
        }
        if took > Duration::from_secs(10) {
            wrong.push(format!("took {took:?}"));
        }
        if folder.files() != before {
            wrong.push(format!(
                "left {:?}",
                folder
                    .files()
                    .into_iter()
                    .filter(|f| !before.contains(f))
                    .collect::<Vec<_>>()
            ));
            let _ = std::fs::remove_dir_all(&out);
        }
        if !wrong.is_empty() {
            faults.push(format!("{args:?}: {}: {text:?}", wrong.join(", ")));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    assert_eq!(std::fs::read(folder.join("a-file")).unwrap(), b"in the way");
}

#[test]
fn a_rendering_writes_the_files_of_the_contract() {
    let folder = Folder::new("files");
    let output = render(
        &folder,
        &[
            "--fov",
            "-40 40 40 -40",
            "--pose",
            "-0.278 0.273 0.8 0 0 0 1",
            "--ipd",
            "0.063",
        ],
    );
    assert_success(&output);
    assert_eq!(
        folder.files(),
        [
            "frame_0000.png",
            "frame_0000_left.exr",
            "frame_0000_reuse.png",
            "frame_0000_right.exr",
            "run.json",
            "stats.jsonl"
        ]
        .map(|name| format!("out/{name}"))
    );
    let out = folder.join("out");
    for (name, size) in [
        ("frame_0000_left.exr", (16, 12)),
        ("frame_0000_right.exr", (16, 12)),
        ("frame_0000.png", (32, 12)),
        ("frame_0000_reuse.png", (16, 12)),
    ] {
        let image = read_image(&out.join(name)).unwrap();
        assert_eq!((image.width, image.height), size, "{name}");
        assert!(
            image.pixels.iter().flatten().any(|&channel| channel > 0.0),
            "{name} is black"
        );
    }
    let text = std::fs::read_to_string(out.join("stats.jsonl")).unwrap();
    assert_eq!(text.lines().count(), 1);
    let stats: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(stats["frame"], 0);
    assert!(stats["display_time_ns"].is_i64());
    assert_eq!(stats["non_finite_pixels"], 0);
    for key in ["pass_ms", "cpu_ms"] {
        let values = stats[key].as_object().unwrap();
        assert!(
            !values.is_empty() && values.values().all(|ms| ms.as_f64().unwrap() >= 0.0),
            "{key}: {values:?}"
        );
    }
    for key in ["emitted", "stored", "dropped"] {
        assert!(stats["photons"][key].is_u64(), "photons.{key}");
    }
    assert_eq!(stats["photons"]["emitted"], 500);
    assert_eq!(
        stats["photons"]["traced"], true,
        "stats say which frames traced photons"
    );
    let stereo = &stats["stereo"];
    for key in ["left_hits", "scattered", "reused", "filled"] {
        assert!(stereo[key].is_u64(), "stereo.{key}");
    }
    let (reused, filled) = (
        stereo["reused"].as_f64().unwrap(),
        stereo["filled"].as_f64().unwrap(),
    );
    assert_eq!(
        stereo["reuse_fraction"].as_f64().unwrap(),
        reused / (reused + filled)
    );
    let reasons = stereo["filled_because"].as_object().unwrap();
    for key in [
        "out_of_left_view",
        "disoccluded",
        "edge",
        "view_dependent",
        "gap",
    ] {
        assert!(reasons[key].is_u64(), "filled_because.{key}");
    }
    assert_eq!(
        reasons
            .values()
            .map(|count| count.as_f64().unwrap())
            .sum::<f64>(),
        filled
    );
    let run = json(&out.join("run.json"));
    for key in [
        "version", "adapter", "settings", "scene", "needs", "medians", "size", "session",
    ] {
        assert!(!run[key].is_null(), "run.json lacks {key}");
    }
    assert_eq!(run["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(run["size"], serde_json::json!([16, 12]));
    assert_eq!(run["settings"]["photon"]["count"], 500);
    assert!(run["adapter"]["driver"].is_string() && run["adapter"]["name"].is_string());
    assert!(
        run["needs"]["left_out"].is_array() || run["needs"].get("left_out").is_some(),
        "{}",
        run["needs"]
    );
}

#[test]
fn one_eye_alone_is_the_same_picture() {
    let folder = Folder::new("one-eye");
    for eyes in ["both", "left", "right"] {
        let out = folder.join(eyes);
        assert_success(&render_into(&out, &["--reuse", "off", "--eyes", eyes]));
    }
    let read = |name: &str| std::fs::read(folder.join(name)).unwrap();
    assert!(!folder.join("left/frame_0000_right.exr").exists());
    assert!(!folder.join("right/frame_0000_left.exr").exists());
    assert!(read("left/frame_0000_left.exr") == read("both/frame_0000_left.exr"));
    assert!(read("right/frame_0000_right.exr") == read("both/frame_0000_right.exr"));
    assert!(read("both/frame_0000_left.exr") != read("both/frame_0000_right.exr"));
}

#[test]
fn runs_write_every_kth_frame_and_statistics_of_all() {
    let folder = Folder::new("every");
    let out = folder.join("out");
    let output = run_into(
        &out,
        "run --session simulated --frames 5 --every 2 --size 12x8 --photons 300",
        &[],
    );
    assert_success(&output);
    let left: Vec<String> = folder
        .files()
        .into_iter()
        .filter(|name| name.ends_with("_left.exr"))
        .collect();
    assert_eq!(
        left,
        [
            "out/frame_0000_left.exr",
            "out/frame_0002_left.exr",
            "out/frame_0004_left.exr"
        ]
    );
    let frames = stats(&out);
    assert_eq!(frames.len(), 5);
    for (index, frame) in frames.iter().enumerate() {
        assert_eq!(frame["frame"], index);
        assert_eq!(
            frame["photons"]["traced"],
            index == 0,
            "static scene, photons once"
        );
        assert!(
            index == 0
                || frame["display_time_ns"].as_i64()
                    > frames[index - 1]["display_time_ns"].as_i64()
        );
    }
    assert_eq!(json(&out.join("run.json"))["frames"], 5);
    // Nothing half-written lies about.
    assert!(
        folder.files().iter().all(|name| name.ends_with(".exr")
            || name.ends_with(".png")
            || name.ends_with(".json")
            || name.ends_with(".jsonl")),
        "{:?}",
        folder.files()
    );
}

#[test]
fn compare_answers_in_json_and_status() {
    let folder = Folder::new("compare");
    assert!(render(&folder, &[]).status.success());
    let (left, right) = (
        folder.join("out/frame_0000_left.exr"),
        folder.join("out/frame_0000_right.exr"),
    );
    let (left, right) = (left.to_str().unwrap(), right.to_str().unwrap());
    let compare = |args: &[&str]| {
        let output = stereolux(&[&["compare"], args].concat());
        (
            output.status.code(),
            serde_json::from_slice::<Value>(&output.stdout).unwrap_or_default(),
        )
    };
    let (status, same) = compare(&[left, left, "--max-rel-mse", "0"]);
    assert_eq!(
        (status, &same["rel_mse"], &same["rmse"]),
        (Some(0), &0.0.into(), &0.0.into())
    );
    let (status, other) = compare(&[left, right]);
    assert_eq!(status, Some(0), "without a limit the status says nothing");
    for key in ["rel_mse", "rmse", "mean_rel_bias", "flip"] {
        assert!(other[key].is_f64(), "{key}");
    }
    assert!(other["rel_mse"].as_f64().unwrap() > 0.0);
    assert_eq!(compare(&[left, right, "--max-rel-mse", "1e-9"]).0, Some(1));
    assert_eq!(compare(&[left, right, "--max-rel-mse", "1e9"]).0, Some(0));
    let png = folder.join("out/frame_0000.png");
    assert_eq!(
        compare(&[left, png.to_str().unwrap()]).0,
        Some(2),
        "images of different size"
    );
}

#[test]
fn a_reader_that_leaves_early_is_no_failure() {
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_stereolux"))
        .args(["info", "--settings"])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    // Closed long before the adapters are known.
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(stderr(&output), "");
}

#[test]
fn info_is_json() {
    let output = stereolux(&["info", "--scene", "builtin:gallery"]);
    assert!(output.status.success());
    let info: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(!info["adapters"].as_array().unwrap().is_empty());
    assert!(info["openxr"]["reason"].is_string() || info["openxr"]["runtime"].is_string());
    assert!(info["scene"]["needs"].is_object());
    assert!(
        info["scene"].to_string().contains("dielectric"),
        "the gallery holds glass"
    );
}
