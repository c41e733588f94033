//! The program as a user meets it: exit status, stderr, and the files that it leaves.

use std::path::Path;
use std::process::Output;

use serde_json::Value;
use stereolux::images::read_image;

use crate::suite::support::{
    Folder, assert_says, assert_success, exrs, json, printed, run_into, stats, stderr, stereolux,
    words,
};

/// What a run of one frame leaves, by name.
pub const ONE_FRAME: [&str; 6] = [
    "frame_0000.png",
    "frame_0000_left.exr",
    "frame_0000_reuse.png",
    "frame_0000_right.exr",
    "run.json",
    "stats.jsonl",
];

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
    let put = |name: &str, bytes: &[u8]| folder.write(name, bytes).display().to_string();
    let glb = stereolux::scene::builtin::glb("cornell").unwrap();
    let gltf = |nodes: &str, more: &str| {
        format!(
            r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":{nodes}{more}}}"#
        )
    };
    let mesh = |position: &str, count: &str| {
        let more = format!(
            r#","meshes":[{{"primitives":[{{"attributes":{{"POSITION":{position}}}}}]}}],
            "accessors":[{{"bufferView":0,"componentType":5126,"count":{count},"type":"VEC3"}}],
            "bufferViews":[{{"buffer":0,"byteLength":36}}],
            "buffers":[{{"byteLength":36,"uri":"nan.bin"}}]"#
        );
        gltf(r#"[{"mesh":0}]"#, &more)
    };
    put("nan.bin", [f32::NAN.to_le_bytes(); 9].as_flattened());
    let missing = folder.join("missing.glb").display().to_string();
    let directory = folder.path().display().to_string();
    let empty = put("empty.glb", b"");
    let truncated = put("truncated.glb", &glb[..glb.len() / 2]);
    let header = put("header.glb", &glb[..11]);
    let circle = gltf(r#"[{"children":[1]},{"children":[0]}]"#, "");
    let cyclic = put("cyclic.gltf", circle.as_bytes());
    let range = put("range.gltf", gltf(r#"[{"mesh":3}]"#, "").as_bytes());
    let accessor = put("accessor.gltf", mesh("9", "3").as_bytes());
    let not_finite = put("nan.gltf", mesh("0", "3").as_bytes());
    let huge = put("huge.gltf", mesh("0", "4611686018427387904").as_bytes());
    let head = r#"{"format":"stereolux-trace","version":1,"headset":"x","refresh_hz":90.0}"#;
    let broken = format!("{head}\n{{\"t_ns\":0\n{head}\n");
    let broken_trace = put("broken.jsonl", broken.as_bytes());
    let unknown_key = put("unknown.toml", b"[photon]\ncout = 3\n");
    let syntax = put("syntax.toml", b"seed = = 3\n");
    let file = put("a-file", b"in the way");
    let below_file = format!("{file}/below");
    let picture = put("picture.exr", b"no picture");
    let before = folder.files();

    let adapter = "no such adapter";
    let compare_missing = format!("compare {missing}");
    let compare_picture = format!("compare {picture}");
    // Words, and a last one that may hold spaces.
    let cases: [(&str, &str, &str); 48] = [
        ("render --scene", &missing, "missing.glb"),
        ("render --scene", &directory, "directory"),
        ("render --scene", &empty, "empty"),
        ("render --scene", &truncated, "truncated"),
        ("render --scene", &header, "header.glb"),
        ("render --scene", &cyclic, "cycle"),
        ("render --scene", &range, "nodes[0].mesh"),
        ("render --scene", &accessor, "accessor"),
        ("render --scene", &not_finite, "finite"),
        ("render --scene", &huge, "accessors[0]"),
        ("render --scene", "builtin:cornel", "cornell"),
        ("run --trace", &broken_trace, "line 2"),
        ("run --trace", &missing, "missing.glb"),
        ("run --trace", &directory, "directory"),
        ("render --fov", "-95 40 40 -40", "89"),
        ("render --fov", "40 -40 40 -40", "left"),
        ("render --fov", "-40 40 40", "--fov"),
        ("render --pose", "0 0 0 0 0 0 2", "--pose"),
        ("render --ipd", "-1", "--ipd"),
        ("render --size", "0x0", "--size"),
        ("render --size", "16384x16384", "--size"),
        ("render --spp", "0", "--spp"),
        ("render --headset", "nonsuch", "quest3"),
        ("render --set", "photon.cout=3", "photon.count"),
        (
            "render --set",
            "environment.path=nowhere.hdr",
            "nowhere.hdr",
        ),
        ("render --config", &unknown_key, "unknown.toml:2"),
        ("render --config", &syntax, "syntax.toml:1"),
        ("render --config", &missing, "missing.glb"),
        ("render --adapter", adapter, adapter),
        ("run --adapter", adapter, adapter),
        ("render --out", &file, "--out"),
        ("run --frames 1 --out", &file, "--out"),
        ("render --out", &below_file, "--out"),
        ("run --frames 1 --record", &below_file, "below"),
        (&compare_missing, &missing, "missing.glb"),
        (&compare_picture, &picture, "picture.exr"),
        ("info --scene", &missing, "missing.glb"),
        ("bench", "nonsuch", "tables, stereo, pareto, scaling, smoke"),
        ("bench smoke --scene", &missing, "missing.glb"),
        ("bench stereo --scene", "builtin:cornel", "cornell"),
        ("bench smoke --rounds", "0", "--rounds"),
        ("bench work --rounds", "2", "leave --rounds out"),
        ("bench smoke --reference-spp", "4", "--reference-spp"),
        ("bench smoke --size", "0x4", "--size"),
        ("bench smoke --set", "photon.cout=3", "photon.count"),
        ("bench smoke --set", "headset=nonsuch", "quest3"),
        ("bench smoke --adapter", adapter, adapter),
        ("bench smoke --out", &file, "--out"),
    ];
    let out = folder.join("out").display().to_string();
    let mut faults = Vec::new();
    for (command, last, says) in cases {
        let mut all = words(command);
        all.push(last);
        if matches!(all[0], "run" | "render" | "bench") && !all.contains(&"--out") {
            all.extend(["--out", &out]);
        }
        let output = stereolux(&all);
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
        if folder.files() != before {
            let mut left = folder.files();
            left.retain(|file| !before.contains(file));
            wrong.push(format!("left {left:?}"));
            let _ = std::fs::remove_dir_all(&out);
        }
        if !wrong.is_empty() {
            faults.push(format!("{all:?}: {}: {text:?}", wrong.join(", ")));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    assert_eq!(std::fs::read(folder.join("a-file")).unwrap(), b"in the way");
}

#[test]
fn a_rendering_writes_the_files_of_the_contract() {
    let folder = Folder::new("files");
    let eyes = ["--fov", "-40 40 40 -40", "--ipd", "0.063"];
    let pose = ["--pose", "-0.278 0.273 0.8 0 0 0 1"];
    assert_success(&render(&folder, &[&eyes[..], &pose].concat()));
    assert_eq!(folder.files(), ONE_FRAME.map(|name| format!("out/{name}")));
    let out = folder.join("out");
    for (name, size) in [
        ("frame_0000_left.exr", (16, 12)),
        ("frame_0000_right.exr", (16, 12)),
        ("frame_0000.png", (32, 12)),
        ("frame_0000_reuse.png", (16, 12)),
    ] {
        let image = read_image(&out.join(name)).unwrap();
        assert_eq!((image.width, image.height), size, "{name}");
        let is_lit = image.pixels.iter().flatten().any(|&channel| channel > 0.0);
        assert!(is_lit, "{name} is black");
    }
    let [stats] = &stats(&out)[..] else {
        panic!("one frame");
    };
    assert_eq!(stats["frame"], 0);
    assert!(stats["display_time_ns"].is_i64());
    assert_eq!(stats["non_finite_pixels"], 0);
    for key in ["pass_ms", "cpu_ms"] {
        let values = stats[key].as_object().unwrap();
        let are_times = values.values().all(|ms| ms.as_f64().unwrap() >= 0.0);
        assert!(!values.is_empty() && are_times, "{key}: {values:?}");
    }
    for key in ["emitted", "stored", "dropped"] {
        assert!(stats["photons"][key].is_u64(), "photons.{key}");
    }
    assert_eq!(stats["photons"]["emitted"], 500);
    assert_eq!(stats["photons"]["traced"], true);
    let stereo = &stats["stereo"];
    for key in ["left_hits", "scattered", "reused", "filled"] {
        assert!(stereo[key].is_u64(), "stereo.{key}");
    }
    let [reused, filled] = ["reused", "filled"].map(|key| stereo[key].as_f64().unwrap());
    let fraction = stereo["reuse_fraction"].as_f64().unwrap();
    assert_eq!(fraction, reused / (reused + filled));
    let reasons = stereo["filled_because"].as_object().unwrap();
    for key in words("out_of_left_view disoccluded edge view_dependent gap") {
        assert!(reasons[key].is_u64(), "filled_because.{key}");
    }
    let because = reasons.values().map(|count| count.as_f64().unwrap());
    assert_eq!(because.sum::<f64>(), filled);
    let run = json(&out.join("run.json"));
    for key in words("version adapter settings scene needs medians size session") {
        assert!(!run[key].is_null(), "run.json lacks {key}");
    }
    assert_eq!(run["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(run["size"], serde_json::json!([16, 12]));
    assert_eq!(run["settings"]["photon"]["count"], 500);
    assert!(run["adapter"]["driver"].is_string() && run["adapter"]["name"].is_string());
    let needs = &run["needs"];
    assert!(needs.get("left_out").is_some(), "{needs}");
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
    let command = "run --session simulated --frames 5 --every 2 --size 12x8 --photons 300";
    assert_success(&run_into(&out, command, &[]));
    let mut left = folder.files();
    left.retain(|name| name.ends_with("_left.exr"));
    assert_eq!(
        left,
        [0, 2, 4].map(|frame| format!("out/frame_000{frame}_left.exr"))
    );
    let frames = stats(&out);
    assert_eq!(frames.len(), 5);
    for (index, frame) in frames.iter().enumerate() {
        assert_eq!(frame["frame"], index);
        // A static scene: photons once.
        assert_eq!(frame["photons"]["traced"], index == 0);
    }
    let times = frames.iter().map(|frame| frame["display_time_ns"].as_i64());
    assert!(times.is_sorted_by(|a, b| a < b));
    assert_eq!(json(&out.join("run.json"))["frames"], 5);
    // Nothing half-written lies about.
    let files = folder.files();
    let kinds = [".exr", ".png", ".json", ".jsonl"];
    let is_whole = |name: &String| kinds.iter().any(|kind| name.ends_with(kind));
    assert!(files.iter().all(is_whole), "{files:?}");
}

#[test]
fn compare_answers_in_json_and_status() {
    let folder = Folder::new("compare");
    assert!(render(&folder, &[]).status.success());
    let [left, right, png] = ["_left.exr", "_right.exr", ".png"].map(|end| {
        folder
            .join(&format!("out/frame_0000{end}"))
            .display()
            .to_string()
    });
    let (left, right) = (&*left, &*right);
    let compare = |args: &[&str]| {
        let output = stereolux(&[&["compare"], args].concat());
        let said = serde_json::from_slice::<Value>(&output.stdout);
        (output.status.code(), said.unwrap_or_default())
    };
    let (status, same) = compare(&[left, left, "--max-rel-mse", "0"]);
    assert_eq!(status, Some(0));
    assert_eq!([&same["rel_mse"], &same["rmse"]], [0.0, 0.0]);
    let (status, other) = compare(&[left, right]);
    assert_eq!(status, Some(0), "without a limit the status says nothing");
    for key in ["rel_mse", "rmse", "mean_rel_bias", "flip"] {
        assert!(other[key].is_f64(), "{key}");
    }
    assert!(other["rel_mse"].as_f64().unwrap() > 0.0);
    assert_eq!(compare(&[left, right, "--max-rel-mse", "1e-9"]).0, Some(1));
    assert_eq!(compare(&[left, right, "--max-rel-mse", "1e9"]).0, Some(0));
    assert_eq!(compare(&[left, &png]).0, Some(2), "of different size");
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
    assert_success(&output);
    let info = printed(&output);
    assert!(!info["adapters"].as_array().unwrap().is_empty());
    assert!(info["openxr"]["reason"].is_string() || info["openxr"]["runtime"].is_string());
    assert!(info["scene"]["needs"].is_object());
    // The gallery holds glass.
    assert_says(&info["scene"].to_string(), &["dielectric"]);
    // One goes with software adapters, the other with cards.
    let features = &info["scene"]["shader_features"];
    assert_ne!(features["record_texels"], features["wide_machine"]);
}

#[test]
fn in_real_time_frames_wait_for_their_time_and_stay_the_same() {
    let folder = Folder::new("real-time");
    let trace = folder.join("trace.jsonl");
    let size = "--frames 3 --size 8x8 --photons 300";
    let record = format!(
        "run --session simulated {size} --record {}",
        trace.display()
    );
    assert_success(&run_into(&folder.join("recorded"), &record, &[]));
    // A third of a second apart.
    let text = std::fs::read_to_string(&trace).unwrap();
    let [first, second] = ["\"t_ns\":11111111,", "\"t_ns\":22222222,"];
    assert!(text.contains(first) && text.contains(second), "{text}");
    let slow = text.replace(first, "\"t_ns\":333333333,");
    folder.write("trace.jsonl", slow.replace(second, "\"t_ns\":666666666,"));
    let replay = format!(
        "run --session replay --trace {} --size 8x8 --photons 300",
        trace.display()
    );
    let [paced, hurried] = [&["--realtime"][..], &[]].map(|more| {
        let out = folder.join(&format!("replayed{}", more.len()));
        assert_success(&run_into(&out, &replay, more));
        (
            exrs(&out),
            json(&out.join("run.json"))["wall_s"].as_f64().unwrap(),
        )
    });
    // Not a limit on speed: a frame that comes early is a fault on any machine.
    assert!(paced.1 >= 0.666_666_666, "{} s", paced.1);
    assert_eq!(paced.0.len(), 6);
    assert!(paced.0 == hurried.0);
}
