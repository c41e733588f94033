//! What goes wrong with a runtime that Monado cannot be made to do, on `crates/fake_runtime`: each fault is one line, an
//! exit status, and files that are whole up to the last frame.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use glam::{DQuat, DVec3, Quat, Vec3};
use openxr::Posef;
use serde_json::{Value, json};
use stereolux::images::read_image;
use stereolux::scene::Scene;
use stereolux::xr::trace::{Trace, TraceFrame};
use stereolux::xr::{Input, Pose};
use stereolux_fake_runtime as fake;

use super::openxr_support::{PROGRAM, assert_status, monado, stats, stderr};
use crate::suite::support::{
    Folder, RAW_FRAMES, Triangles, assert_begins, assert_says, exrs, json as json_of, placed,
    printed, words,
};

/// Fails unless the run went on without a headset, for this reason.
pub fn assert_fell_back(output: &Output, why: &str) {
    assert_status(output, 0);
    let text = stderr(output);
    let fell_back = |line: &str| line.starts_with("session: simulated") && line.contains(why);
    assert!(text.lines().any(fell_back), "{text}");
}

/// Frames with a layer after which the fake runtime fails.
const SHOWN_BEFORE: usize = stereolux_fake_runtime::SHOWN_BEFORE as usize;

/// The shared object that Cargo built beside this binary.
fn fake_library() -> PathBuf {
    let this = std::env::current_exe().unwrap();
    let library = this.with_file_name("libstereolux_fake_runtime.so");
    assert!(library.exists(), "{} is missing", library.display());
    library
}

/// Writes the runtime's manifest.
fn runtime_manifest(folder: &Folder) -> PathBuf {
    let path = folder.join("runtime.json");
    let manifest = json!({
        "file_format_version": "1.0.0",
        "runtime": {"name": "fake", "library_path": fake_library()},
    });
    std::fs::write(&path, manifest.to_string()).unwrap();
    path
}

/// Writes the layer's manifest; what to set for a program to lose its device at submission number `after`.
fn device_lost_after(folder: &Folder, after: u32) -> Vec<(&'static str, String)> {
    let layers = folder.join("layers");
    std::fs::create_dir_all(&layers).unwrap();
    let manifest = json!({
        "file_format_version": "1.2.0",
        "layer": {
            "name": "VK_LAYER_STEREOLUX_device_lost", "type": "INSTANCE", "library_path": fake_library(),
            "api_version": "1.3.0", "implementation_version": "1", "description": "loses the device",
        },
    });
    std::fs::write(layers.join("device_lost.json"), manifest.to_string()).unwrap();
    let layer = "VK_LAYER_STEREOLUX_device_lost".to_owned();
    vec![
        ("VK_LAYER_PATH", layers.display().to_string()),
        ("VK_INSTANCE_LAYERS", layer),
        ("FAKE_DEVICE_LOST_AFTER", after.to_string()),
    ]
}

/// Runs the program on the fake runtime with `behaviour`, the OpenXR loader and the driver being Monado's folder's.
fn on_fake(folder: &Folder, behaviour: &str, more: &[(&str, String)], args: &[&str]) -> Output {
    program_on_fake(PROGRAM, folder, behaviour, more, args)
}

/// As `on_fake`, another program.
pub fn program_on_fake(
    program: &str,
    folder: &Folder,
    behaviour: &str,
    more: &[(&str, String)],
    args: &[&str],
) -> Output {
    let manifest = runtime_manifest(folder);
    let mut command = monado(&["--no-service"]);
    command.arg("env");
    // Inside the script, which sets some of these itself.
    for (name, value) in more {
        command.arg(format!("{name}={value}"));
    }
    command
        .arg(format!("XR_RUNTIME_JSON={}", manifest.display()))
        .arg(format!("FAKE_RUNTIME={behaviour}"))
        .args(["bash", "-c"])
        .arg(format!("exec $MONADO_RUN {program} {}", args.join(" ")));
    command.output().unwrap()
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// The one line of ours; fails if there are more or anything panicked.
pub fn one_error(output: &Output) -> String {
    let text = stderr(output);
    assert!(!text.contains("panicked"), "{text}");
    let mut ours = text.lines().filter(|line| line.starts_with("error: "));
    let line = ours.next().unwrap_or_default().to_owned();
    assert!(!line.is_empty() && ours.next().is_none(), "{text}");
    line
}

#[test]
fn a_runtime_that_cannot_be_used_is_refused_and_auto_goes_on_without() {
    let folder = Folder::new("openxr-unusable");
    let vulkan = "Vulkan through the OpenXR runtime:";
    let no_format = format!("{vulkan} the runtime offers no sRGB or half-float");
    for (behaviour, says) in [
        ("no_headset", "OpenXR runtime \"Fake runtime\" has no"),
        ("no_vulkan", "the OpenXR runtime offers no Vulkan ("),
        ("no_stereo", "\"Fake headset\" offers no stereo view"),
        ("no_device", &format!("{vulkan} vkCreateDevice: ")),
        ("no_format", &no_format),
    ] {
        let out = folder.join(behaviour);
        let refused = ["run", "--session", "openxr", "--out", text(&out)];
        let output = on_fake(&folder, behaviour, &[], &refused);
        assert_status(&output, 1);
        assert_begins(&one_error(&output), &format!("error: {says}"));
        assert_eq!(stderr(&output).lines().count(), 1, "{}", stderr(&output));
        assert!(!out.exists(), "a refused run leaves no files");

        let auto =
            "run --session auto --frames 1 --size 8x8 --photons 10 --scene builtin:plane --out";
        let args = [&words(auto)[..], &[text(&out)]].concat();
        assert_fell_back(&on_fake(&folder, behaviour, &[], &args), says);
        assert_eq!(stats(&out).len(), 1);
    }
}

/// What `info` says of the fake runtime.
fn info(folder: &Folder, behaviour: &str) -> Value {
    let output = on_fake(folder, behaviour, &[], &["info"]);
    assert_status(&output, 0);
    printed(&output)["openxr"].clone()
}

#[test]
fn info_says_why_a_runtime_cannot_be_used() {
    let folder = Folder::new("openxr-unusable-info");
    let report = info(&folder, "no_headset");
    assert!(report["runtime"].is_null());
    assert_says(report["reason"].as_str().unwrap(), &["has no headset"]);
}

#[test]
fn info_says_what_a_runtime_does_not_offer() {
    let folder = Folder::new("openxr-not-offered");
    let missing = words("bare_hands hand_joints gaze controller_models passthrough");
    for (behaviour, expected) in [
        ("no_extensions", &missing[..]),
        ("profiles", &missing[1..]),
        ("trackers", &[missing[0], missing[3], missing[4]]),
        ("no_trackers", &missing),
        ("controller_model", &[&missing[..3], &missing[4..]].concat()),
        ("room_blended", &missing[..4]),
        ("room_layered", &missing[..4]),
        ("room_added", &missing[..4]),
        ("no_room", &missing),
    ] {
        let said = info(&folder, behaviour);
        assert_eq!(said["not_offered"], json!(expected), "{behaviour}");
    }
}

/// A library of the loader's name that is no library: no machine's own loader can help out.
#[test]
fn without_a_loader_the_run_says_so_and_auto_goes_on_without() {
    let folder = Folder::new("openxr-no-loader");
    std::fs::write(folder.join("libopenxr_loader.so.1"), "no library").unwrap();
    let out = folder.join("out");
    let run = |session: &str, more: &[&str]| {
        Command::new(PROGRAM)
            .args(["run", "--session", session, "--out", text(&out)])
            .args(more)
            .env("LD_LIBRARY_PATH", folder.join(""))
            .output()
            .unwrap()
    };
    let output = run("openxr", &[]);
    assert_status(&output, 1);
    assert_begins(&one_error(&output), "error: no OpenXR loader was found (");
    assert_eq!(stderr(&output).lines().count(), 1);
    assert!(!out.exists());
    let output = run("auto", &words("--frames 1 --size 8x8 --photons 10"));
    assert_fell_back(&output, "no OpenXR loader was found");
}

/// Arguments of a small run on the fake runtime with a recording.
fn small_run(out: &Path, trace: &Path, frames: usize) -> String {
    let (out, trace) = (out.display(), trace.display());
    format!(
        "run --session openxr --frames {frames} --scene builtin:plane --size 16x16 --photons 10 \
         --set output.images=false --out {out} --record {trace}"
    )
}

/// Arguments of a replay of its recording.
fn small_replay(out: &Path, trace: &Path, frames: usize) -> String {
    let run = small_run(out, trace, frames).replace("--record", "--trace");
    run.replace("--session openxr", "--session replay")
}

/// Runs with `args` and `more` of them, on the runtime's adapter, and well.
fn run_with(folder: &Folder, behaviour: &str, args: &str, more: &[&str]) -> Output {
    let logs = [("RUST_LOG", "info".to_owned())];
    let output = on_fake(folder, behaviour, &logs, &[&[args], more].concat());
    assert_status(&output, 0);
    output
}

/// Runs it, and gives the path of its recording too.
fn run_small(
    folder: &Folder,
    behaviour: &str,
    more: &[(&str, String)],
    frames: usize,
) -> (Output, PathBuf) {
    let trace = folder.join(&format!("{behaviour}.jsonl"));
    let args = small_run(&folder.join(behaviour), &trace, frames);
    (on_fake(folder, behaviour, more, &[&*args]), trace)
}

/// A run on the fake runtime: its output, frames in the statistics, frames in the recording.
fn recorded(
    folder: &Folder,
    behaviour: &str,
    more: &[(&str, String)],
    frames: usize,
) -> (Output, usize, usize) {
    let (output, trace) = run_small(folder, behaviour, more, frames);
    let counted = stats(&folder.join(behaviour)).len();
    let held = Trace::read(&trace).map_or(0, |trace| trace.frames.len());
    (output, counted, held)
}

/// A headset waits for no files and for no timestamps of single passes, and the right eye reuses by the best mode.
#[test]
fn a_headset_gets_defaults_of_its_own_and_settings_win() {
    let folder = Folder::new("openxr-defaults");
    let run = |name: &str, more: &[&str]| {
        let out = folder.join(name);
        let session = "run --session openxr --frames 2 --size 16x16 --photons 10 --out";
        let args = [&words(session)[..], &[text(&out)], more].concat();
        let output = on_fake(&folder, "none", &[], &args);
        assert_status(&output, 0);
        let run = json_of(&out.join("run.json"));
        let passes = stats(&out)[1]["pass_ms"].as_object().unwrap().clone();
        let said = stderr(&output);
        let images = out.join("frame_0000.png").exists();
        (run["settings"].clone(), passes, images, said)
    };
    let (settings, passes, images, said) = run("defaults", &[]);
    assert_eq!(settings["output"]["images"], "off");
    assert_eq!(settings["reuse"], "lookup");
    assert_eq!(settings["gpu"]["timestamps"], "stages");
    let stages: Vec<&str> = passes.keys().map(String::as_str).collect();
    let has_both = ["left.stage", "right.stage"]
        .iter()
        .all(|name| stages.contains(name));
    let are_stages = stages.iter().all(|name| name.ends_with(".stage"));
    assert!(has_both && are_stages, "{stages:?}");
    assert!(passes["left.stage"].as_f64().unwrap() > 0.0);
    assert!(!images && said.contains("; statistics in "), "{said}");
    let given = words("--reuse=scatter --set=output.images=true --set=gpu.timestamps=true");
    let (settings, passes, images, said) = run("given", &given);
    assert_eq!(settings["output"]["images"], "on");
    assert_eq!(settings["reuse"], "scatter");
    assert_eq!(settings["gpu"]["timestamps"], "on");
    assert!(passes.contains_key("left.first_hits"), "{passes:?}");
    assert!(images && said.contains("; pictures in "), "{said}");
}

/// Between frames or within one, which is kept then and is none of the 8 that were asked for.
#[test]
fn a_lost_session_is_made_anew_and_the_run_goes_on() {
    let folder = Folder::new("openxr-anew");
    let more = ["--light=sky", "--reuse=lookup", "--set=output.images=true"];
    for (behaviour, says, rendered) in [
        ("loss_pending", "the runtime announces it", 8),
        ("session_lost", "xrWaitFrame: ", 8),
        ("locate_lost", "xrLocateViews: ", 9),
        ("acquire_lost", "xrAcquireSwapchainImage: ", 9),
        ("end_frame_lost", "xrEndFrame: ", 9),
    ] {
        let [live, again, trace] =
            ["", "-again", ".jsonl"].map(|what| folder.join(&format!("{behaviour}{what}")));
        let output = run_with(&folder, behaviour, &small_run(&live, &trace, 8), &more);
        let said = stderr(&output);
        let lost = format!("the OpenXR session is lost ({says}");
        for says in [&*lost, "the OpenXR session is back after "] {
            assert_eq!(said.matches(says).count(), 1, "{behaviour}: {said}");
        }
        let frames = Trace::read(&trace).unwrap().frames;
        assert!(frames.is_sorted_by(|a, b| a.t_ns < b.t_ns), "{behaviour}");
        let args = small_replay(&again, &trace, rendered);
        run_with(&folder, behaviour, &args, &more);
        let images = exrs(&live);
        let counted = [frames.len(), stats(&live).len(), images.len() / 2];
        assert_eq!(counted, [rendered; 3], "{behaviour}");
        assert!(images == exrs(&again), "{behaviour}");
    }
}

#[test]
fn a_session_that_cannot_be_made_anew_ends_the_run_with_all_frames_kept() {
    let folder = Folder::new("openxr-lost");
    let lost = "the session was lost (xrWaitFrame: ";
    let instance = "the runtime announces the loss of the instance: ";
    let thrice = "the session was lost 3 times without a frame between (";
    for (behaviour, begins, says) in [
        ("instance_loss_pending", instance, "start it again"),
        ("lost_for_good", lost, "has no headset"),
        ("lost_and_changed", lost, "now has images of another size"),
        ("lost_again", thrice, "xrWaitFrame"),
    ] {
        let (output, counted, held) = recorded(&folder, behaviour, &[], 100);
        assert_status(&output, 1);
        let line = one_error(&output);
        assert_begins(&line, &format!("error: XR runtime: {begins}"));
        assert_says(&line, &[says]);
        let kept = format!("; {SHOWN_BEFORE} frames were shown and are kept");
        assert!(line.ends_with(&kept), "{line}");
        assert_eq!((counted, held), (SHOWN_BEFORE, SHOWN_BEFORE), "{behaviour}");
    }
}

#[test]
fn the_runtime_may_end_pause_or_hide_a_session() {
    let folder = Folder::new("openxr-wishes");
    for (behaviour, frames) in [
        ("exiting", SHOWN_BEFORE),
        ("pause", SHOWN_BEFORE + 3),
        ("unseen", SHOWN_BEFORE + 3),
    ] {
        let (output, counted, held) = recorded(&folder, behaviour, &[], SHOWN_BEFORE + 3);
        assert_status(&output, 0);
        assert_eq!((counted, held), (frames, frames), "{behaviour}");
        assert!(folder.join(behaviour).join("run.json").exists());
    }
}

#[test]
fn a_lost_device_ends_the_run_with_all_frames_kept() {
    let folder = Folder::new("openxr-device-lost");
    // A frame takes a handful of submissions, so these are some frames.
    let lost = device_lost_after(&folder, 60);
    let (output, counted, held) = recorded(&folder, "device_lost", &lost, 100);
    assert_status(&output, 1);
    assert_begins(&one_error(&output), "error: the device was lost in ");
    assert!((1..100).contains(&counted), "{counted} frames");
    assert!(held == counted || held == counted + 1, "{held} recorded");

    // Without a runtime.
    let out = folder.join("simulated");
    let simulated =
        "run --session simulated --frames 100 --scene builtin:plane --size 16x16 --photons 10";
    let output = Command::new(PROGRAM)
        .args(words(simulated))
        .args(["--set", "output.images=false", "--out", text(&out)])
        .envs(lost)
        .output()
        .unwrap();
    assert_status(&output, 1);
    assert_begins(&one_error(&output), "error: the device was lost in ");
    assert!((1..100).contains(&stats(&out).len()));
}

#[test]
fn answers_that_make_no_sense_are_refused_or_passed_over() {
    let folder = Folder::new("openxr-wild");
    // No size, no pair of views: nothing to render.
    for (behaviour, says) in [
        ("no_size", "asks for images of 0x0 pixels per eye"),
        ("huge_size", "asks for images of 4294967295x4294967295"),
        ("three_views", "offers no stereo view configuration"),
    ] {
        let out = folder.join(behaviour);
        let args = ["run", "--session", "openxr", "--out", text(&out)];
        let output = on_fake(&folder, behaviour, &[], &args);
        assert_status(&output, 1);
        assert_says(&one_error(&output), &[says]);
        assert!(!out.exists());
    }
    // Names are shown without what steers a terminal.
    let output = on_fake(&folder, "wild_name", &[], &["info"]);
    assert_status(&output, 0);
    let report = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        report.contains("Fake headset") && !report.chars().any(|c| c.is_control() && c != '\n'),
        "{report:?}"
    );
    // What is left of rates and masks is used.
    for (behaviour, refresh_hz) in [
        ("wild_rates", 75.0),
        ("no_rates", 90.0),
        ("wild_mask", 90.0),
        // Hands that are nowhere do nothing, and nothing of them is recorded.
        ("wild_hands", 90.0),
        ("wild_joints", 90.0),
    ] {
        let (output, trace) = run_small(&folder, behaviour, &[], 2);
        assert_status(&output, 0);
        let trace = Trace::read(&trace).unwrap();
        assert_eq!(trace.header.refresh_hz, refresh_hz, "{behaviour}");
        assert_eq!(trace.header.hidden.is_some(), behaviour == "wild_mask");
        let at_rest = |frame: &TraceFrame| frame.input == Input::default();
        assert!(trace.frames.iter().all(at_rest), "{behaviour}");
        for area in trace.header.hidden.iter().flatten() {
            assert!((1..=200).contains(&area.triangles().len()));
        }
    }
}

/// Applications see the period that a replay of the recording has.
#[test]
fn a_rate_that_frames_alone_tell_is_recorded() {
    let folder = Folder::new("openxr-slow-display");
    let (output, trace) = run_small(&folder, "slow_display", &[], 3);
    assert_status(&output, 0);
    let trace = Trace::read(&trace).unwrap();
    assert_eq!(trace.header.refresh_hz, 90.0);
    let rates: Vec<_> = trace.frames.iter().map(|frame| frame.refresh_hz).collect();
    assert_eq!(rates, [Some(1e9 / 13_888_889.0), None, None]);
}

/// A pose that is no number is repeated once, also under way: the walk does not go on from nowhere.
#[test]
fn who_is_lost_on_the_way_is_found_again() {
    let folder = Folder::new("openxr-lost-on-the-way");
    let (output, trace) = run_small(&folder, "lost_on_the_way", &[], 8);
    assert_status(&output, 0);
    let trace = Trace::read(&trace).unwrap();
    let ahead = trace
        .frames
        .iter()
        .map(|frame| -frame.views.midpoint_in_world().z);
    let ahead: Vec<f64> = ahead.collect();
    let stays: Vec<bool> = ahead.windows(2).map(|pair| pair[1] <= pair[0]).collect();
    // The first frame has no head to walk by.
    assert_eq!(stays.iter().filter(|stays| **stays).count(), 1, "{ahead:?}");
    assert!(!stays[6], "{ahead:?}");
}

/// The display's rate and what the lenses hide change after five frames.
#[test]
fn a_headset_that_changes_is_followed_recorded_and_replayed() {
    let folder = Folder::new("openxr-changes");
    let names = ["live", "again", "plain", "trace.jsonl", "other.jsonl"];
    let [live, again, plain, trace, other] = names.map(|name| folder.join(name));
    // Surroundings everywhere: what is hidden is black.
    let more = ["--light=sky", "--reuse=lookup", "--set=output.images=true"];
    run_with(&folder, "changes", &small_run(&live, &trace, 8), &more);
    let read = Trace::read(&trace).unwrap();
    assert_eq!((read.header.refresh_hz, &read.header.hidden), (75.0, &None));
    let rates: Vec<_> = read.frames.iter().map(|frame| frame.refresh_hz).collect();
    assert_eq!(
        rates,
        [None, None, None, None, None, Some(72.0), None, None]
    );
    let changes = |frame: &TraceFrame| frame.hidden.is_some();
    assert_eq!(read.frames.iter().position(changes), Some(5));
    // Negative control: the same without what the lenses hide.
    let without = std::fs::read_to_string(&trace).unwrap();
    let without = without.replace("\"hidden\":[[[[-1.0,1.0]", "\"hidden\":[[[[-1.0,-1.0]");
    std::fs::write(&other, without).unwrap();
    for (trace, out) in [(&trace, &again), (&other, &plain)] {
        run_with(&folder, "changes", &small_replay(out, trace, 8), &more);
    }
    let images = exrs(&live);
    assert_eq!(images.len(), 16);
    let differ = |out| {
        let (others, mut names) = (exrs(out), Vec::from_iter(images.keys().cloned()));
        names.retain(|name| images.get(name) != others.get(name));
        names
    };
    assert_eq!(differ(&again), Vec::<String>::new());
    // The right eye takes over what the left one sees.
    let from_there =
        |frame: u32| ["left", "right"].map(|eye| format!("frame_{frame:04}_{eye}.exr"));
    let from_there: Vec<_> = (5..8).flat_map(from_there).collect();
    assert_eq!(differ(&plain), from_there);
}

/// Which bindings are suggested, on a runtime that has every extension and on one that has none.
#[test]
fn bindings_are_suggested_for_the_profiles_that_the_runtime_has() {
    let folder = Folder::new("openxr-profiles");
    let suggested = |behaviour: &str| {
        let (output, _) = run_small(&folder, behaviour, &[], 2);
        assert_status(&output, 0);
        let text = stderr(&output);
        let lines = text.lines();
        let bindings = lines.filter_map(|line| line.strip_prefix("suggested: "));
        bindings.map(str::to_owned).collect::<Vec<_>>()
    };
    let all = suggested("profiles");
    let of = |profile: &str| -> Vec<&str> {
        let profile = format!("/interaction_profiles/{profile} ");
        let bindings = all.iter().filter_map(|line| line.strip_prefix(&*profile));
        bindings.collect()
    };
    let touch = of("oculus/touch_controller");
    assert_eq!(touch, of("meta/touch_controller_plus"));
    for expected in [
        "haptic /user/hand/right/output/haptic",
        "primary_click /user/hand/left/input/x/click",
        "walk /user/hand/left/input/thumbstick",
    ] {
        assert!(touch.contains(&expected), "{expected}: {touch:?}");
    }
    let mut hands = of("ext/hand_interaction_ext");
    hands.sort_unstable();
    // All of it: hands have no vibration, no sticks and no menu.
    let expected = [
        "advance /user/hand/left/input/grasp_ext/value",
        "aim /user/hand/left/input/aim/pose",
        "aim /user/hand/right/input/aim/pose",
        "grip /user/hand/left/input/grip/pose",
        "grip /user/hand/right/input/grip/pose",
        "squeeze /user/hand/left/input/grasp_ext/value",
        "squeeze /user/hand/right/input/grasp_ext/value",
        "trigger /user/hand/left/input/pinch_ext/value",
        "trigger /user/hand/right/input/pinch_ext/value",
        "turn_right /user/hand/right/input/grasp_ext/value",
    ];
    assert_eq!(hands, expected);
    let profiles = all.iter().filter_map(|line| line.split_whitespace().next());
    assert_eq!(profiles.collect::<BTreeSet<_>>().len(), 7);
    let plain = suggested("no_extensions");
    let without_extension = |line: &&String| !line.contains("/meta/") && !line.contains("/ext/");
    assert!(plain.iter().eq(all.iter().filter(without_extension)));
}

/// Where the runtime says, in the frames in which it tracks them; in others, and where it refuses them, all goes on without.
#[test]
fn joints_and_gaze_arrive_in_the_world() {
    let folder = Folder::new("openxr-trackers");
    let run = |behaviour: &str| {
        let trace = folder.join(&format!("{behaviour}.jsonl"));
        let args = small_run(&folder.join(behaviour), &trace, 6);
        // Turned, so that a pose left in the runtime's space is seen.
        let output = run_with(&folder, behaviour, &args, &["--pose='1 2 3 0 0.6 0 0.8'"]);
        (Trace::read(&trace).unwrap().frames, stderr(&output))
    };
    let assert_at = |seen: &Pose, there: Posef| {
        let (p, q) = (there.position, there.orientation);
        let turn = DQuat::from_rotation_y(2.0 * 0.6_f64.asin());
        let place = DVec3::new(1.0, 2.0, 3.0) + turn * Vec3::new(p.x, p.y, p.z).as_dvec3();
        let orientation = turn * Quat::from_xyzw(q.x, q.y, q.z, q.w).as_dquat();
        // f32 numbers under 1: some 1e-7.
        let is_near = (seen.position - place).length() < 1e-6;
        let is_turned = seen.orientation.dot(orientation).abs() > 1.0 - 1e-7;
        assert!(is_near && is_turned, "{seen:?}");
    };
    let (frames, said) = run("trackers");
    let gaze = "suggested: /interaction_profiles/ext/eye_gaze_interaction gaze /user/eyes_ext/";
    assert_says(&said, &[gaze]);
    assert_eq!(frames.len(), 6);
    for (frame, waited) in frames.iter().zip(1..) {
        let (is_tracked, seen) = (fake::is_tracked(waited), frame.input.gaze);
        assert_eq!(seen.is_some(), is_tracked, "{waited}");
        seen.iter().for_each(|gaze| assert_at(gaze, fake::GAZE));
        for (side, hand) in frame.input.hands.iter().enumerate() {
            assert_eq!(hand.joints.is_some(), is_tracked, "{waited}");
            let joints = hand.joints.iter().flat_map(|joints| joints.iter());
            for (index, joint) in joints.enumerate() {
                assert_at(&joint.pose, fake::joint_at(side, index));
                assert_eq!(joint.radius_m, 0.0078125);
            }
        }
    }
    let (frames, said) = run("refused_trackers");
    assert!(frames.iter().all(|frame| frame.input == Input::default()));
    let refused = |what: &str| format!("offers {what} and refuses to give it");
    assert_says(&said, &[&refused("joints of hands"), &refused("gaze")]);
}

/// The room behind the scene: by whatever the runtime has, also after a lost session, and not at all unless asked for.
#[test]
fn the_room_is_shown_as_the_runtime_can() {
    let folder = Folder::new("openxr-room");
    let opaque = "OPAQUE, layers [COMPOSITION_LAYER_PROJECTION], alpha [false]";
    let layered = "OPAQUE, layers [COMPOSITION_LAYER_PASSTHROUGH_FB, COMPOSITION_LAYER_PROJECTION], alpha [true, true]";
    for (behaviour, unasked, asked) in [
        (
            "room_blended",
            opaque,
            "ALPHA_BLEND, layers [COMPOSITION_LAYER_PROJECTION], alpha [true]",
        ),
        ("room_layered", opaque, layered),
        (
            "room_added",
            "ADDITIVE, layers [COMPOSITION_LAYER_PROJECTION], alpha [false]",
            "ADDITIVE, layers [COMPOSITION_LAYER_PROJECTION], alpha [false]",
        ),
        ("no_room", opaque, opaque),
        ("refused_room", opaque, opaque),
        ("room_taken", opaque, layered),
    ] {
        for (wish, expected) in [("false", unasked), ("true", asked)] {
            let setting = format!("--set environment.passthrough={wish}");
            let args = small_run(&folder.join("out"), &folder.join("views.jsonl"), 8);
            let said = stderr(&run_with(&folder, behaviour, &args, &[&setting]));
            let frames = said
                .lines()
                .filter_map(|line| line.strip_prefix("over the room: "));
            let frames: Vec<&str> = frames.collect();
            assert!(frames.len() >= 8, "{said}");
            for (frame, shown) in frames.iter().enumerate() {
                let is_taken = behaviour == "room_taken" && frame >= SHOWN_BEFORE;
                let expected = if is_taken { opaque } else { expected };
                assert_eq!(*shown, expected, "{behaviour} {frame}");
            }
            let is_asked = wish == "true";
            let refuses = ["no_room", "refused_room", "room_taken"].contains(&behaviour);
            let refusals = said.matches("environment.passthrough: ").count();
            assert_eq!(refusals, usize::from(is_asked && refuses), "{said}");
            // A room that is taken later is not known then.
            let is_shown = is_asked && (!refuses || behaviour == "room_taken");
            let run = json_of(&folder.join("out/run.json"));
            assert_eq!(run["settings"]["environment"]["passthrough"], is_shown);
        }
    }
}

/// A wedge in place of the plain controller, each face in its place and colour; what is no model leaves that.
#[test]
fn a_runtime_s_model_is_shown_at_the_grip_recorded_and_replayed() {
    let folder = Folder::new("openxr-model");
    let more = "--reuse=off --set=output.images=true --set=input.show_hands=true";
    let more = [&words(more)[..], &RAW_FRAMES].concat();
    let trace = |name: &str| folder.join(&format!("{name}.jsonl"));
    let run = |name: &str| {
        let args = small_run(&folder.join(name), &trace(name), 65).replace("16x16", "48x48");
        let said = stderr(&run_with(&folder, name, &args, &more));
        (exrs(&folder.join(name)), said)
    };
    let [(plain, _), (images, _)] = ["plain_controller", "controller_model"].map(run);
    let again = folder.join("again");
    let replay = small_replay(&again, &trace("controller_model"), 65).replace("16x16", "48x48");
    run_with(&folder, "none", &replay, &more);
    assert!(exrs(&again) == images);
    // Known in the third frame, shown 60 frames later.
    assert!(images["frame_0061_left.exr"] == plain["frame_0061_left.exr"]);
    let frame = &Trace::read(&trace("controller_model")).unwrap().frames[64];
    let wedge = Scene::from_bytes("wedge", &fake::controller_model::glb()).unwrap();
    let colors: Vec<_> = wedge.materials.iter().map(|m| m.emission).collect();
    let grip = frame.input.hands[1].grip.unwrap();
    let velocity = fake::controller_model::VELOCITY;
    let velocity = [velocity.x, velocity.y, velocity.z].map(f64::from);
    assert_eq!(grip.linear_velocity.to_array(), velocity);
    assert_eq!(grip.angular_velocity, DVec3::ZERO, "not known");
    let world_from_grip = grip.pose.affine();
    let wedge = Triangles::of(&placed(wedge, world_from_grip));
    let mut seen = BTreeSet::new();
    for (view, eye) in frame.views.views.iter().zip(["left", "right"]) {
        let [with, without] = ["controller_model", "plain_controller"].map(|run| {
            let path = folder.join(&format!("{run}/frame_0064_{eye}.exr"));
            read_image(&path).unwrap().pixels
        });
        for (pixel, radiance) in with.iter().enumerate() {
            let face_at = |corner: usize| {
                let (x, y) = (pixel % 48 + corner % 2, pixel / 48 + corner / 2);
                let ray = view.ray_through_pixel(x as f64, y as f64, 48, 48);
                Some(wedge.closest(ray.origin, ray.direction, 0.0)?.2)
            };
            // Its own light alone, by which nothing else is multiplied.
            if let Some(face) = face_at(0).filter(|_| (1..4).all(|k| face_at(k) == face_at(0))) {
                assert_eq!(*radiance, colors[face as usize]);
                assert_ne!(*radiance, without[pixel]);
                seen.insert((face, pixel));
            }
        }
    }
    let faces: BTreeSet<_> = seen.iter().map(|(face, _)| face).collect();
    assert!(faces.len() >= 2 && seen.len() > 30, "{seen:?}");
    for (name, says) in [("bad", "cannot be shown"), ("huge", "cannot be had (")] {
        let (images, said) = run(&format!("{name}_controller_model"));
        assert!(said.matches(says).count() == 1 && images == plain, "{said}");
    }
    std::fs::remove_file(folder.join("controller_model.right.glb")).unwrap();
    let refused = on_fake(&folder, "none", &[], &[&*replay]);
    assert_status(&refused, 2);
    assert_says(&one_error(&refused), &["model.jsonl, line 4, field"]);
}
