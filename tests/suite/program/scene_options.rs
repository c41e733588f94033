//! Scenes as people bring them: without light, of odd sizes, with a camera; and where a run starts in them.

use std::path::Path;
use std::process::Output;

use glam::DVec3;
use stereolux::images::{ImageRgb, read_image};
use stereolux::scene::Scene;
use stereolux::scene::edit::Document;
use stereolux::xr::trace::Trace;

use super::commands::render_into;
use crate::suite::support::{
    Folder, assert_says, assert_success, json, printed, run_into, stderr, stereolux, words,
};

/// A triangle facing +Z, `size` units wide, without light; a camera of 0.5 rad before it if `camera` says so.
fn triangle(folder: &Folder, name: &str, size: f64, camera: bool) -> String {
    let corners = [-0.5_f32, -0.5, 0.0, 0.5, -0.5, 0.0, 0.0, 0.5, 0.0];
    let bytes = corners.map(|c| (c * size as f32).to_le_bytes());
    folder.write(&format!("{name}.bin"), bytes.as_flattened());
    let half = size / 2.0;
    let (nodes, cameras) = match camera {
        true => (
            format!(r#",{{"camera":0,"translation":[0,0,{}]}}"#, 2.0 * size),
            r#""cameras":[{"type":"perspective","name":"Front","perspective":{"yfov":0.5,"znear":0.1}}],"#,
        ),
        false => (String::new(), ""),
    };
    let roots = if camera { "0,1" } else { "0" };
    let text = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[{roots}]}}],{cameras}
        "nodes":[{{"mesh":0}}{nodes}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3",
            "min":[-{half},-{half},0],"max":[{half},{half},0]}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}}],"buffers":[{{"byteLength":36,"uri":"{name}.bin"}}]}}"#
    );
    let path = folder.write(&format!("{name}.gltf"), text);
    path.display().to_string()
}

fn render(out: &Path, args: &[&str]) -> (Output, String) {
    let output = render_into(out, args);
    let text = stderr(&output);
    (output, text)
}

fn left(out: &Path) -> ImageRgb {
    read_image(&out.join("frame_0000_left.exr")).unwrap()
}

fn sum(image: &ImageRgb) -> f32 {
    image.pixels.iter().flatten().sum()
}

#[test]
fn a_scene_without_light_is_lit_or_said_to_be_black() {
    let folder = Folder::new("unlit");
    let scene = triangle(&folder, "plain", 1.0, false);
    let out = folder.join("out");
    let (output, text) = render(&out, &["--scene", &scene]);
    assert!(output.status.success());
    let warnings: Vec<&str> = text.lines().filter(|line| line.contains("WARN")).collect();
    assert_eq!(warnings.len(), 1, "{text}");
    assert_says(warnings[0], &["--light", "black"]);
    assert_eq!(sum(&left(&out)), 0.0);
    for (light, name) in [("auto", "studio"), ("studio", "studio"), ("sky", "sky")] {
        let (output, text) = render(&out, &["--scene", &scene, "--light", light]);
        assert!(output.status.success() && !text.contains("WARN"), "{text}");
        assert_says(&text, &[&format!("light: builtin:{name}")]);
        assert!(sum(&left(&out)) > 1.0);
        let run = json(&out.join("run.json"));
        assert!(run["scene"]["light"].as_str().unwrap().contains(name));
        let path = &run["settings"]["environment"]["path"];
        assert_eq!(*path, format!("builtin:{name}"));
    }
    let lit = left(&out);
    // The same by its path; and half as strong.
    let sky = "environment.path=builtin:sky";
    render(&out, &["--scene", &scene, "--set", sky]);
    assert!(left(&out) == lit);
    // A scene with a light of its own stays as it is.
    let own = folder.join("own");
    render(&own, &[]);
    let alone = left(&own);
    let (_, text) = render(&own, &["--light", "auto"]);
    assert!(!text.contains("light:"), "{text}");
    assert!(left(&own) == alone);
    let (output, text) = render(&own, &["--light", "sky", "--set", sky]);
    assert_eq!(output.status.code(), Some(2), "{text}");
    let (output, text) = render(&own, &["--set", "environment.path=builtin:studo"]);
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert_says(&text, &["'studio'"]);
    let info = printed(&stereolux(&["info", "--scene", &scene, "--light", "auto"]));
    assert!(info["scene"]["light"].as_str().unwrap().contains("studio"));
}

#[test]
fn scale_takes_units_for_metres_and_odd_sizes_are_told() {
    let folder = Folder::new("scale");
    for (name, size, factor) in [
        ("huge", 556.0, "0.001"),
        ("tiny", 0.005, "100"),
        ("fine", 1.0, ""),
    ] {
        let scene = triangle(&folder, name, size, false);
        let out = folder.join("out");
        let lit = ["--scene", &scene, "--light", "studio"];
        let (_, text) = render(&out, &lit);
        let is_told = text.contains("--scene-scale");
        assert_eq!(is_told, !factor.is_empty(), "{name}: {text}");
        if factor.is_empty() {
            continue;
        }
        assert_says(&text, &[&format!("--scene-scale {factor}")]);
        let (output, text) = render(&out, &[&lit[..], &["--scene-scale", factor]].concat());
        assert_success(&output);
        assert!(!text.contains("WARN"), "{name}: {text}");
        let run = json(&out.join("run.json"));
        let wanted = size * factor.parse::<f64>().unwrap();
        let width = run["scene"]["bounds_in_world"][1][0].as_f64().unwrap() * 2.0;
        // Corners are f32.
        assert!((width - wanted).abs() < 1e-6 * wanted, "{name}: {width}");
        let key = format!("--set=scene.scale={factor}");
        let by_key = render(&folder.join("key"), &[&lit[..], &[&key]].concat());
        assert_success(&by_key.0);
        assert!(left(&folder.join("key")) == left(&out));
    }
    // What is advised is what is taken, however small the scene.
    let speck = triangle(&folder, "speck", 2e-12, false);
    let lit = ["--scene", &speck, "--light", "studio"];
    let (_, text) = render(&folder.join("speck_out"), &lit);
    let advice = "--scene-scale 100000000";
    assert_says(&text, &["2.0e-12 m", advice]);
    let scaled = [&lit[..], &advice.split(' ').collect::<Vec<_>>()].concat();
    assert_success(&render(&folder.join("speck_out"), &scaled).0);
}

/// Everything grows alike, and light is absorbed over lengths that grow too.
#[test]
fn scaling_keeps_the_tree_and_lengths_inside_materials() {
    for name in ["caustic", "parade"] {
        let plain = Scene::builtin(name).unwrap();
        let mut scaled = plain.clone();
        scaled.scale(0.5);
        let [a, b] = [&plain, &scaled].map(|scene| scene.bounds_in_world().unwrap());
        assert!((a.min * 0.5 - b.min).length() + (a.max * 0.5 - b.max).length() < 1e-9);
        assert!((plain.start_pose().position * 0.5 - scaled.start_pose().position).length() < 1e-9);
        for (before, after) in plain.materials.iter().zip(&scaled.materials) {
            let [before, after] = [before, after].map(|m| m.attenuation_distance_m);
            assert_eq!(before * 0.5, after);
        }
        // Saved, the scale is a node.
        let mut document = Document::load(&format!("builtin:{name}")).unwrap();
        document.scale(0.5);
        let saved = Scene::from_bytes("saved.glb", &document.to_glb().unwrap()).unwrap();
        let c = saved.bounds_in_world().unwrap();
        assert!((b.min - c.min).length() + (b.max - c.max).length() < 1e-6);
        let mut same = plain.clone();
        same.scale(1.0);
        assert!(same == plain);
    }
}

#[test]
fn a_cameras_angles_are_taken_unless_others_are_given() {
    let folder = Folder::new("camera");
    let scene = triangle(&folder, "seen", 1.0, true);
    let fov = |args: &[&str]| {
        let out = folder.join("out");
        let lit = ["--scene", &scene, "--light", "sky"];
        let (output, text) = render(&out, &[&lit, args].concat());
        assert_success(&output);
        let path = out.join("frame_0000_left.exr");
        let meta = exr::meta::MetaData::read_from_file(path, true).unwrap();
        let width = meta.headers[0].own_attributes.screen_window_width;
        (f64::from(width), text)
    };
    let near = |found: f64, wanted: f64| assert!((found - wanted).abs() < 1e-6, "{found} {wanted}");
    let (width, text) = fov(&[]);
    // 0.5 rad high, 16:12.
    near(width, 2.0 * 0.25_f64.tan() * 16.0 / 12.0);
    assert_says(&text, &["'Front'", "28.6 degrees"]);
    for args in [
        &["--headset", "symmetric"][..],
        &["--fov", "-45 45 45 -45"],
        &["--pose", "0 0 2 0 0 0 1"],
    ] {
        let (width, text) = fov(args);
        near(width, 2.0);
        assert!(!text.contains("Front"), "{text}");
    }
    let file = std::fs::read_to_string(&scene).unwrap();
    let perspective = r#""perspective","name":"Front","perspective":{"yfov":0.5,"znear":0.1}"#;
    let parallel =
        r#""orthographic","name":"Front","orthographic":{"xmag":1,"ymag":1,"znear":0.1,"zfar":9}"#;
    assert!(file.contains(perspective));
    std::fs::write(&scene, file.replace(perspective, parallel)).unwrap();
    assert_says(&fov(&[]).1, &["'Front', with the headset's angles"]);
}

#[test]
fn a_run_starts_where_it_is_told_and_the_box_fills_the_view() {
    let folder = Folder::new("start");
    let first = |args: &[&str]| {
        let trace = folder.join("trace.jsonl");
        let still = "run --session simulated --motion still --frames 1 --size 8x8 --photons 100";
        let record = ["--record", trace.to_str().unwrap()];
        let more = [&record[..], args].concat();
        assert_success(&run_into(&folder.join("out"), still, &more));
        let views = Trace::read(&trace).unwrap().frames[0].views.views;
        (views[0].position_in_world + views[1].position_in_world) / 2.0
    };
    let told = first(&["--pose", "1 2 3 0 0 0 1"]);
    let off = (told - DVec3::new(1.0, 2.0, 3.0)).length();
    assert!(off < 1e-9, "{told}");
    // 45 degrees up and down: what the camera sees of the opening fills the view.
    let scene = Scene::builtin("cornell").unwrap();
    let camera = scene.start_pose().position;
    let front = scene.bounds_in_world().unwrap().max.z;
    let angle = f64::from(scene.start_camera().unwrap().yfov_rad.unwrap());
    let start = first(&[]);
    let off = start.z - front - (camera.z - front) * (angle / 2.0).tan();
    assert!(off.abs() < 1e-9, "{start}");
    let native = folder.join("trace.jsonl");
    let trace = ["run", "--trace", native.to_str().unwrap()];
    let refused = stereolux(&[&trace[..], &["--pose", "1 2 3 0 0 0 1"]].concat());
    assert_eq!(refused.status.code(), Some(2));
    assert_says(&stderr(&refused), &["--pose"]);
}

#[test]
fn names_that_are_nearly_right_are_told() {
    let said = |args: &[&str]| {
        let output = stereolux(args);
        assert_eq!(output.status.code(), Some(2), "{args:?}");
        stderr(&output)
    };
    for (args, nearest) in [
        (["render", "--headset", "quest"], "quest3"),
        (["render", "--headset", "Quest3"], "quest3"),
        (["render", "--scene", "builtin:galery"], "gallery"),
        (["settings", "expsure", "--"], "exposure"),
    ] {
        let text = said(&args);
        assert_says(&text, &[&format!("nearest is '{nearest}'")]);
        assert_eq!(text.lines().count(), 1);
    }
    let parade = Scene::builtin("parade").unwrap();
    let clip = parade.animations[0].name.to_uppercase();
    let clip = format!("--set=animation.clip={clip}");
    let text = said(&["render", "--scene", "builtin:parade", &clip]);
    assert_says(&text, &["nearest is"]);
}

#[test]
fn settings_are_found_by_words_and_info_has_ten_lines() {
    let print = |args: &[&str]| {
        let output = stereolux(args);
        assert_success(&output);
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let all = print(&["settings"]);
    for setting in stereolux::settings::registry::all() {
        assert_says(&all, &[&format!("  {} = ", setting.key)]);
    }
    let some = print(&["settings", "tone"]);
    assert_says(&some, &["output.tone", "agx:"]);
    assert!(!some.contains("photon.count"), "{some}");
    let group = print(&["settings", "photon mapping"]);
    assert!(group.contains("photon.kernel") && !group.contains("output.tone"));
    let brief = print(&["info", "--brief", "--scene", "builtin:gallery"]);
    assert!((8..=12).contains(&brief.lines().count()), "{brief}");
    assert_says(
        &brief,
        &words("adapter OpenXR builtin:gallery triangles radius"),
    );
    assert_says(&brief, &["emissive triangles"]);
}

/// Lights of files made for real units are thousands of times brighter than white.
#[test]
fn a_picture_that_its_exposure_shows_white_or_black_says_which_one_to_try() {
    let folder = Folder::new("exposure");
    let scene = ["--scene", "builtin:cornell", "--eyes", "left"];
    let advised = |exposure: &str| {
        let set = format!("output.exposure={exposure}");
        let (output, text) = render(folder.path(), &[&scene[..], &["--set", &set]].concat());
        assert_success(&output);
        let advice = text.split_once("try --set output.exposure=");
        advice.map(|(before, better)| {
            let word = before.contains("brighter");
            (word, better.lines().next().unwrap_or_default().to_owned())
        })
    };
    assert_eq!(advised("1"), None);
    let (is_bright, better) = advised("100000").unwrap();
    assert!(is_bright);
    assert_eq!(advised("0.000001"), Some((false, better.clone())));
    assert_eq!(advised(&better), None);
}
