//! The program on Monado's null compositor: frames, record and replay, validation layers, failures.

use std::ffi::OsStr;
use std::process::{Child, Command, Output, Stdio};

use serde_json::Value;
use stereolux::xr::trace::Trace;

use super::openxr_failures::assert_fell_back;
use super::openxr_support::{
    PROGRAM, SERVICE_CRASHED, all_output, assert_status, frames_so_far, monado, output_on_monado,
    recorded_session, replayed_images, stats, stderr, stereolux_on_monado, wait_until,
};
use crate::suite::support::{Folder, assert_begins, assert_says, json, printed, stereolux, words};

/// Both validation layers, their words as text.
pub const VALIDATION: [(&str, &str); 3] = [
    ("XR_ENABLE_API_LAYERS", "XR_APILAYER_LUNARG_core_validation"),
    ("XR_CORE_VALIDATION_EXPORT_TYPE", "text"),
    ("VK_INSTANCE_LAYERS", "VK_LAYER_KHRONOS_validation"),
];

/// Lines in which a validation layer complains.
pub fn complaints(text: &str) -> Vec<&str> {
    text.lines()
        .filter(|line| {
            let speaks = ["VUID", "Validation", "BestPractices"];
            let speaks = speaks.iter().any(|word| line.contains(word));
            // The layer's greeting and farewell are all that it may say.
            speaks
                && !line.contains("VALID_DEBUG")
                && !line.starts_with("Core Validation output type")
        })
        .collect()
}

/// Runs the program on Monado under both validation layers, and gives all that it and they said.
fn validated<S: AsRef<OsStr>>(args: &[S]) -> String {
    let mut command = monado(&[]);
    command.arg(PROGRAM).args(args).envs(VALIDATION);
    let output = output_on_monado(command.env("RUST_LOG", "info"));
    assert_status(&output, 0);
    all_output(&output)
}

#[test]
fn a_hundred_frames_are_shown_recorded_replayed_and_valid() {
    let folder = Folder::new("openxr-frames");
    let live = folder.join("live");
    let common = ["--size", "48x40", "--photons", "2000", "--every", "33"];
    let session = "run --session openxr --frames 100";
    let text = validated(&recorded_session(&folder, session, &common));
    for state in words("ready synchronized visible focused stopping exiting") {
        assert_says(&text, &[&format!("OpenXR session: {state}")]);
    }
    // Both layers were there, and silent.
    let layer = "Core Validation Layer";
    let [began, ended] =
        ["is initialized", "will be destroyed"].map(|what| format!("{layer} {what}"));
    assert_says(&text, &[&began, &ended]);
    assert_eq!(complaints(&text), Vec::<&str>::new());
    let frames = stats(&live);
    assert_eq!(frames.len(), 100);
    for frame in &frames {
        assert!(frame["cpu_ms"]["submit"].as_f64() > Some(0.0), "{frame}");
        assert!(frame["cpu_ms"]["overhead"].is_f64(), "{frame}");
    }
    let run = json(&live.join("run.json"));
    assert_eq!(run["size"], serde_json::json!([48, 40]));
    assert_begins(run["session"].as_str().unwrap(), "openxr (Monado");
    assert_eq!(replayed_images(&folder, &common), 8);
    // The comparison can fail: the head moves, so frame 0 is not frame 99.
    let read = |frame: u32| std::fs::read(live.join(format!("frame_{frame:04}_left.exr"))).unwrap();
    assert_ne!(read(0), read(99));
}

/// The same run with the layer's advice on: if nothing came through, the silence above would prove nothing.
#[test]
fn the_validation_layers_would_speak() {
    let folder = Folder::new("openxr-control");
    let out = folder.join("out");
    let session = "run --session openxr --frames 2 --size 16x16 --photons 100";
    let output = monado(&[])
        .arg(PROGRAM)
        .args(words(session))
        .args([
            "--set",
            "output.images=false",
            "--out",
            out.to_str().unwrap(),
        ])
        .envs(VALIDATION)
        .env(
            "VK_LAYER_ENABLES",
            "VK_VALIDATION_FEATURE_ENABLE_BEST_PRACTICES_EXT",
        )
        .output()
        .unwrap();
    assert_status(&output, 0);
    assert!(!complaints(&all_output(&output)).is_empty());
    // The OpenXR layer: this binary itself makes a wrong call, inside the folder.
    let this = std::env::current_exe().unwrap();
    let wrong = "--exact suite::xr::openxr_runtime::a_wrong_call --ignored --nocapture";
    let mut command = monado(&[]);
    command.arg(this).args(words(wrong)).envs(VALIDATION);
    let text = all_output(&command.output().unwrap());
    assert_says(&complaints(&text).join("\n"), &["xrGetSystem"]);
}

#[test]
#[ignore = "run by `the_validation_layers_would_speak` against Monado"]
fn a_wrong_call() {
    let entry = stereolux::gpu::vulkan_interop::openxr::load_entry().unwrap();
    let application = openxr::ApplicationInfo {
        application_name: "control",
        application_version: 1,
        engine_name: "control",
        engine_version: 1,
        api_version: openxr::Version::new(1, 0, 0),
    };
    let instance = entry
        .create_instance(&application, &openxr::ExtensionSet::default(), &[], &())
        .unwrap();
    assert!(instance.system(openxr::FormFactor::from_raw(77)).is_err());
}

#[test]
fn formats_and_layers_can_be_chosen() {
    let folder = Folder::new("openxr-formats");
    for (settings, says) in [
        ("--set openxr.format=srgb", "Rgba8UnormSrgb, with depth"),
        (
            "--set openxr.format=half --set openxr.depth_layer=false",
            "Rgba16Float, no depth",
        ),
    ] {
        let out = folder.join(&says[..5]);
        let session = "run --session openxr --frames 3 --photons 100 --size 16x16";
        let out = ["--out", out.to_str().unwrap()];
        let text = validated(&[words(session), words(settings), out.to_vec()].concat());
        assert_says(&text, &[says]);
        assert_eq!(complaints(&text), Vec::<&str>::new());
    }
}

#[test]
fn every_failure_is_one_line_and_leaves_nothing() {
    let folder = Folder::new("openxr-failures");
    let out = folder.join("out");
    let out_text = out.to_str().unwrap();
    let run = |session: &str, more: &[&str]| {
        let mut args = vec!["run", "--session", session, "--out", out_text];
        args.extend(more);
        args.iter().map(|arg| (*arg).to_owned()).collect::<Vec<_>>()
    };
    let assert_last = |output: &Output, status: i32, says: &str| {
        assert_status(output, status);
        // The runtime prints whatever it likes on the same stream; ours is the last line.
        let text = stderr(output);
        assert_begins(text.trim_end().lines().last().unwrap_or_default(), says);
    };
    let without_runtime = |args: &[String]| {
        monado(&["--no-service"])
            .args([
                "env",
                "XR_RUNTIME_JSON=/nonexistent/runtime.json",
                "bash",
                "-c",
            ])
            .arg(format!("$MONADO_RUN {PROGRAM} {}", args.join(" ")))
            .output()
            .unwrap()
    };

    // No loader, or (where the machine has one) no runtime.
    let output = Command::new(PROGRAM)
        .args(run("openxr", &[]))
        .env("XR_RUNTIME_JSON", "/nonexistent/runtime.json")
        .output()
        .unwrap();
    assert_status(&output, 1);
    let text = stderr(&output);
    assert_eq!(text.lines().count(), 1, "{text}");
    assert_begins(&text, "error: no OpenXR ");

    // A loader and no runtime.
    let output = without_runtime(&run("openxr", &[]));
    let nobody = "error: no OpenXR runtime answers (";
    assert_last(&output, 1, nobody);

    // A runtime whose service is not there.
    let on_monado = |options: &[&str], more: &[&str]| {
        output_on_monado(monado(options).arg(PROGRAM).args(run("openxr", more)))
    };
    assert_last(&on_monado(&["--no-service"], &[]), 1, nobody);

    // A runtime that dictates another adapter, and one that takes no such size.
    for (more, says) in [
        (
            ["--adapter", "no such adapter"],
            "--adapter \"no such adapter\": the OpenXR runtime requires",
        ),
        (
            ["--size", "16384x16384"],
            "--size 16384x16384: the OpenXR runtime takes at most",
        ),
    ] {
        assert_last(&on_monado(&[], &more), 2, &format!("error: {says}"));
    }
    assert!(!out.exists(), "a refused run leaves no files");

    // `auto` falls back, says why, and succeeds.
    let small = words("--frames 1 --size 8x8 --photons 10");
    let output = without_runtime(&run("auto", &small));
    assert_fell_back(&output, "no OpenXR runtime answers");
    assert!(out.join("run.json").exists());
}

/// Monado knows every profile and checks each path against its own list of what the profile has.
#[test]
fn monado_takes_the_bindings_of_every_profile() {
    let folder = Folder::new("openxr-bindings");
    let out = folder.join("out");
    let session = "run --session openxr --frames 2 --size 16x16 --photons 10 --scene builtin:plane";
    let mut command = monado(&[]);
    command
        .arg(PROGRAM)
        .args(words(session))
        .arg("--out")
        .arg(out);
    command.env("RUST_LOG", "debug");
    let output = output_on_monado(&mut command);
    assert_status(&output, 0);
    let said = stderr(&output);
    assert_says(&said, &["OpenXR session: "]);
    assert!(!said.contains("/interaction_profiles/"), "{said}");
}

#[test]
fn info_names_the_runtime_or_why_there_is_none() {
    let report = |output: &Output| -> Value {
        assert_status(output, 0);
        printed(output)["openxr"].clone()
    };
    let there = report(&stereolux_on_monado(&[], &["info"]));
    assert_begins(there["runtime"].as_str().unwrap(), "Monado");
    assert_eq!(there["system"], "Monado: Simulated HMD");
    let size = &there["views"][1]["recommended_size"];
    assert_eq!(*size, serde_json::json!([320, 240]));
    assert!(there["extensions"].as_array().unwrap().len() > 10);
    let used = there["used_extensions"].as_array().unwrap();
    assert!(used.contains(&Value::from("XR_EXT_hand_interaction")));
    let missing = there["not_offered"].as_array().unwrap();
    assert!(!missing.contains(&Value::from("bare_hands")), "{missing:?}");
    let absent = report(&stereolux_on_monado(&["--no-service"], &["info"]));
    assert!(absent["runtime"].is_null());
    assert_begins(
        absent["reason"].as_str().unwrap(),
        "no OpenXR runtime answers",
    );
}

/// Starts an endless run whose process id is printed, and waits for some frames.
pub fn endless(folder: &Folder) -> Child {
    let (out, trace) = (folder.join("out"), folder.join("views.jsonl"));
    let mut child = monado(&[])
        .args(["bash", "-c"])
        .arg(format!(
            "$MONADO_RUN {PROGRAM} run --session openxr --size 16x16 --photons 100 --set output.images=false \
             --out {} --record {} & echo $MONADO_PID $! > {}; wait $!",
            out.display(),
            trace.display(),
            folder.join("pids").display(),
        ))
        .stderr(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    wait_until(&mut child, "ten frames", || frames_so_far(&out) >= 10);
    child
}

/// Process ids of the service and of the run.
pub fn pids(folder: &Folder) -> [String; 2] {
    let pids = std::fs::read_to_string(folder.join("pids")).unwrap();
    let pids: Vec<String> = words(&pids).into_iter().map(str::to_owned).collect();
    pids.try_into().unwrap()
}

pub fn kill(signal: &str, pid: &str) {
    let killed = Command::new("kill").args([signal, pid]).status();
    assert!(killed.unwrap().success());
}

/// Status of the run and its last line; every frame that was counted is on disk, whole.
pub fn ended(folder: &Folder, child: Child) -> (Option<i32>, String) {
    let output = child.wait_with_output().unwrap();
    let frames = stats(&folder.join("out"));
    let trace = Trace::read(&folder.join("views.jsonl")).unwrap();
    assert!(frames.len() >= 10);
    // The frame in whose end the runtime was lost was rendered and not shown: it is in neither, or not yet counted.
    assert!(trace.frames.len() == frames.len() || trace.frames.len() == frames.len() + 1);
    let text = stderr(&output);
    let ours = text.lines().rfind(|line| line.starts_with("error: "));
    (output.status.code(), ours.unwrap_or_default().to_owned())
}

#[test]
fn a_killed_runtime_ends_the_run_with_all_frames_kept() {
    let folder = Folder::new("openxr-killed");
    let mut child = endless(&folder);
    kill("-9", &pids(&folder)[0]);
    wait_until(&mut child, "end", || !running(&folder));
    let (status, line) = ended(&folder, child);
    assert_eq!(status, Some(1));
    assert_begins(&line, "error: XR runtime: xr");
    assert_says(&line, &["gone"]);
}

/// Whether the run's process is there.
fn running(folder: &Folder) -> bool {
    let [_, pid] = pids(folder);
    // A zombie has ended.
    std::fs::read_to_string(format!("/proc/{pid}/stat")).is_ok_and(|stat| !stat.contains(") Z "))
}

#[test]
fn an_interrupted_run_ends_in_order() {
    let folder = Folder::new("openxr-interrupted");
    let child = endless(&folder);
    kill("-TERM", &pids(&folder)[1]);
    let (status, line) = ended(&folder, child);
    assert_eq!(status, Some(1));
    assert_begins(&line, "error: interrupted after ");
    assert!(folder.join("out").join("run.json").exists());
}

/// A crash of the service's own is told from a kill and from a fault of the command.
#[test]
fn the_script_says_when_the_service_crashed() {
    let status = |command: &str| {
        let output = monado(&[]).args(["bash", "-c", command]).output().unwrap();
        output.status.code()
    };
    // Until it is gone: the script's own SIGTERM, sent when the command ends, must not overtake the crash.
    let gone = "for _ in $(seq 200); do kill -0 $MONADO_PID 2>/dev/null || break; sleep 0.1; done";
    let crashed = status(&format!("kill -SEGV $MONADO_PID; {gone}; exit 3"));
    assert_eq!(crashed, Some(SERVICE_CRASHED));
    assert_eq!(status("kill -KILL $MONADO_PID; exit 3"), Some(3));
    assert_eq!(status("exit 3"), Some(3));
}

#[test]
fn the_script_explains_itself() {
    let output = monado(&["--help"]).output().unwrap();
    assert_status(&output, 0);
    assert_says(&all_output(&output), &["--xvfb"]);
    assert_status(&monado(&["--no-such-option", "true"]).output().unwrap(), 2);
    assert_status(&stereolux(&["run", "--session", "openxr", "--realtime"]), 2);
}
