//! What stands under `--out`: nothing of older runs, `run.json` also after an error, pictures by the curve asked for.

use std::io::{BufRead as _, BufReader};
use std::process::{Command, Stdio};

use serde_json::Value;
use stereolux::images::{read_image, srgb_encode};

use super::commands::ONE_FRAME;
use crate::suite::support::{
    Folder, adapter_name, assert_says, assert_success, interrupt, json, run_into, stderr,
    wait_until, words,
};

fn run(folder: &Folder, frames: &str, more: &[&str]) -> std::process::Output {
    let command = format!("run --session simulated --size 12x8 --photons 300 --frames {frames}");
    run_into(&folder.join("out"), &command, more)
}

fn run_json(folder: &Folder) -> Value {
    json(&folder.join("out/run.json"))
}

#[test]
fn files_of_an_older_run_go_and_others_stay() {
    let folder = Folder::new("older-run");
    let more = ["--set=output.parts=true", "--set=output.chrome_trace=true"];
    let first = run(&folder, "3", &more);
    assert_success(&first);
    assert!(!stderr(&first).contains("removed"));
    // 3 frames of 2 eyes in 4 parts, 2 pictures each, run.json, trace.json.
    let old = folder.files().len();
    assert_eq!(old, 3 * (2 * 4 + 2) + 3);
    // What a run that was killed was writing.
    folder.write("out/.frame_0002_left.exr.77.partial", "half");
    let mine = ["frame_0001_left_mine.exr", "notes.txt", "view_0000.png"];
    for name in mine {
        folder.write(&format!("out/{name}"), "mine");
    }
    let second = run(&folder, "1", &[]);
    let removed = format!("removed {} files of an older run", old - 1 + 1);
    assert_says(&stderr(&second), &[&removed]);
    let left = ONE_FRAME.iter().chain(&mine);
    let mut left: Vec<String> = left.map(|name| format!("out/{name}")).collect();
    left.sort();
    assert_eq!(folder.files(), left);
    assert_eq!(run_json(&folder)["error"], Value::Null);
}

/// Other programs number frames alike: without a run's statistics nothing is taken for a run's.
#[test]
fn pictures_of_other_programs_are_not_removed() {
    let folder = Folder::new("other-programs");
    std::fs::create_dir_all(folder.join("out")).unwrap();
    folder.write("out/frame_0001.png", "mine");
    let output = run(&folder, "1", &[]);
    assert_eq!(output.status.code(), Some(2));
    assert_says(&stderr(&output), &["--out", "frame_0001.png"]);
    assert_eq!(folder.files(), ["out/frame_0001.png"]);
}

#[test]
fn a_run_that_fails_says_so_in_run_json() {
    let folder = Folder::new("failing-run");
    // Something of that name is in the way of the third frame.
    std::fs::create_dir_all(folder.join("out/frame_0002_left.exr/x")).unwrap();
    let output = run(&folder, "5", &[]);
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(stderr(&output).lines().count(), 1, "{}", stderr(&output));
    let run = run_json(&folder);
    assert_says(run["error"].as_str().unwrap(), &["frame_0002_left.exr"]);
    assert_eq!(run["frames"], 2);
    assert!(run["medians"]["left_ms"].is_f64());
}

#[test]
fn a_run_that_is_refused_takes_nothing_away() {
    let folder = Folder::new("refused-run");
    let mine = r#"{"format":"stereolux-trace","version":1,"headset":"mine"}"#;
    let recording = folder.write("recording.jsonl", mine);
    let record = ["--record", recording.to_str().unwrap()];
    // Nobody can make a folder there.
    let output = run_into(
        std::path::Path::new("/proc/nothing-here/out"),
        "run --session simulated --size 12x8 --photons 300 --frames 1",
        &record,
    );
    assert_eq!(output.status.code(), Some(2));
    assert_says(&stderr(&output), &["--out", "choose another folder"]);
    assert_eq!(std::fs::read_to_string(&recording).unwrap(), mine);
    // Another run is at work in the folder.
    assert_success(&run(&folder, "1", &[]));
    let before = folder.files();
    let stats = std::fs::File::open(folder.join("out/stats.jsonl")).unwrap();
    stats.lock().unwrap();
    let output = run(&folder, "2", &record);
    assert_eq!(output.status.code(), Some(2));
    assert_says(&stderr(&output), &["another run writes to it"]);
    assert_eq!(folder.files(), before);
    assert_eq!(std::fs::read_to_string(&recording).unwrap(), mine);
    drop(stats);
    assert_success(&run(&folder, "2", &[]));
}

/// A frame of so many samples takes long, and nobody waits for its end.
/// A link to somebody else's file, in place of the statistics.
#[cfg(unix)]
#[test]
fn nothing_is_written_through_a_link() {
    let folder = Folder::new("linked-statistics");
    folder.write("precious", "precious");
    std::fs::create_dir_all(folder.join("out")).unwrap();
    let link = folder.join("out/stats.jsonl");
    std::os::unix::fs::symlink(folder.join("precious"), link).unwrap();
    let output = run(&folder, "1", &[]);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    assert_says(&stderr(&output), &["error: --out", "stats.jsonl"]);
    let kept = std::fs::read_to_string(folder.join("precious")).unwrap();
    assert_eq!(kept, "precious");
}

#[test]
fn a_frame_is_broken_off_between_its_samples() {
    let folder = Folder::new("broken-off");
    for command in ["render", "run --session simulated --frames 3"] {
        let out = folder.join(&command[..3]);
        let mut child = Command::new(env!("CARGO_BIN_EXE_stereolux"))
            .args(words(command))
            .args(words("--method path --size 32x32 --spp 65536"))
            .args(["--adapter", adapter_name(), "--out"])
            .arg(&out)
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let stats = out.join("stats.jsonl");
        wait_until(&mut child, "statistics", || stats.exists());
        let output = interrupt(child);
        assert_eq!(output.status.code(), Some(1), "{output:?}");
        assert_says(&stderr(&output), &["interrupted after 0 frames"]);
        assert_eq!(json(&out.join("run.json"))["frames"], 0);
    }
}

#[test]
fn the_last_line_compares_with_the_headset() {
    let folder = Folder::new("last-line");
    let output = run(&folder, "4", &[]);
    let run = run_json(&folder);
    let number = |at: &str| run.pointer(at).unwrap().as_f64().unwrap();
    let (hz, budget_ms) = (number("/refresh_hz"), number("/budget_ms"));
    assert_eq!(budget_ms, 1e3 / hz);
    let total = number("/medians/total_ms");
    assert!(total >= number("/medians/left_ms"));
    let (speed, reused) = (
        number("/frames_per_second"),
        100.0 * number("/medians/reuse_fraction"),
    );
    let parts = [
        format!("both eyes {total:.1} ms of the {budget_ms:.1} ms that {hz:.0} Hz allow"),
        format!("{speed:.1} frames/s of wall time"),
        format!("{reused:.0} % of the right eye reused"),
    ];
    assert_says(&stderr(&output), &parts.each_ref().map(String::as_str));
    let per_second = 4.0 / number("/wall_s");
    assert!((speed - per_second).abs() < 1e-9 * per_second);
}

#[test]
fn pictures_have_the_curve_that_is_asked_for() {
    let folder = Folder::new("tone");
    let mut pictures = Vec::new();
    for tone in ["aces", "agx", "neutral", "linear"] {
        let set = format!("output.tone={tone}");
        assert!(run(&folder, "1", &["--set", &set]).status.success());
        assert_eq!(run_json(&folder)["settings"]["output"]["tone"], tone);
        pictures.push(std::fs::read(folder.join("out/frame_0000.png")).unwrap());
    }
    let distinct: std::collections::BTreeSet<_> = pictures.iter().collect();
    assert_eq!(distinct.len(), 4);
    // The last one is the radiance, clipped.
    let radiance = read_image(&folder.join("out/frame_0000_left.exr")).unwrap();
    let picture = image::open(folder.join("out/frame_0000.png"))
        .unwrap()
        .into_rgb8();
    for (at, pixel) in radiance.pixels.iter().enumerate() {
        let (x, y) = (at as u32 % 12, at as u32 / 12);
        let wanted = pixel.map(|c| (srgb_encode(c.clamp(0.0, 1.0)) * 255.0).round() as u8);
        assert_eq!(picture.get_pixel(x, y).0, wanted, "{x} {y}");
    }
}

#[test]
fn much_output_is_announced_before_it_is_written() {
    let folder = Folder::new("much-output");
    let mut child = Command::new(env!("CARGO_BIN_EXE_stereolux"))
        .args(words("run --session simulated --size 16x12 --photons 100"))
        .args(["--frames", "1000000", "--adapter", adapter_name(), "--out"])
        .arg(folder.join("out"))
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    let mut said = BufReader::new(child.stderr.take().unwrap());
    said.read_line(&mut line).unwrap();
    child.kill().unwrap();
    child.wait().unwrap();
    // Two eyes of 192 pixels, 12 bytes of radiance and 6 of pictures each.
    assert_says(&line, &["1000000 frames take up to 6.9 GB"]);
}
