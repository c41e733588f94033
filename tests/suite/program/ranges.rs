//! `run --range`: parts of a run are the whole run's frames, and `merge` joins what they report.

use std::path::Path;
use std::process::Output;

use crate::suite::support::{
    Folder, RAW_FRAMES, assert_says, assert_success, json, run_into, stats, stderr, stereolux,
    words,
};

fn run(out: &Path, scene: &str, args: &[&str]) {
    // Raw frames know nothing of the frames before them; what a test switches on comes later and wins.
    let command = format!(
        "run --session simulated --motion walk --size 24x16 --photons 2000 --frames 6 --scene {scene} {}",
        RAW_FRAMES.join(" ")
    );
    assert_success(&run_into(out, &command, args));
}

fn merge(a: &Path, b: &Path, out: &Path) -> Output {
    run_into(out, "merge", &[a, b].map(|part| part.to_str().unwrap()))
}

#[test]
fn two_halves_are_the_whole_run_bit_for_bit() {
    let folder = Folder::new("range");
    // One stands still and keeps its photons; in the other everything moves.
    for scene in ["builtin:cornell", "builtin:parade"] {
        let [whole, first, second, merged] =
            ["whole", "first", "second", "merged"].map(|name| folder.join(name));
        run(&whole, scene, &[]);
        run(&first, scene, &["--range", "0..3"]);
        run(&second, scene, &["--range", "3..6"]);
        for frame in 0..6 {
            let part = if frame < 3 { &first } else { &second };
            let other = if frame < 3 { &second } else { &first };
            for eye in ["left", "right"] {
                let name = format!("frame_{frame:04}_{eye}.exr");
                let read = |folder: &Path| std::fs::read(folder.join(&name)).unwrap();
                assert!(read(&whole) == read(part), "{scene}: {name}");
                assert!(!other.join(&name).exists());
            }
        }
        let output = merge(&first, &second, &merged);
        assert_success(&output);
        assert!(output.stderr.is_empty(), "{output:?}");
        let (all, joined) = (stats(&whole), stats(&merged));
        assert_eq!(joined.len(), 6);
        for (a, b) in all.iter().zip(&joined) {
            for key in ["frame", "display_time_ns", "stereo", "non_finite_pixels"] {
                assert_eq!(a[key], b[key], "{key}");
            }
            assert_eq!(a["photons"]["stored"], b["photons"]["stored"]);
        }
        let [one, joined] = [&whole, &merged].map(|folder| json(&folder.join("run.json")));
        for key in words("frames settings settings_hash scene size error") {
            assert_eq!(one[key], joined[key], "{key}");
        }
        let [one, joined] = [one, joined].map(|run| run["medians"]["reuse_fraction"].clone());
        assert_eq!(one, joined);
        // What is missing is named.
        let part = merge(&second, &second, &folder.join("twice"));
        assert_eq!(part.status.code(), Some(2));
        let mut broken_off = json(&second.join("run.json"));
        broken_off["error"] = "interrupted".into();
        let cut = folder.join("cut");
        std::fs::create_dir_all(&cut).unwrap();
        std::fs::write(cut.join("run.json"), broken_off.to_string()).unwrap();
        let lines = std::fs::read_to_string(second.join("stats.jsonl")).unwrap();
        let (kept, moved) = lines.split_at(lines.find('\n').unwrap() + 1);
        std::fs::write(cut.join("stats.jsonl"), moved).unwrap();
        let lone = folder.join("lone");
        std::fs::create_dir_all(&lone).unwrap();
        std::fs::copy(second.join("run.json"), lone.join("run.json")).unwrap();
        std::fs::write(lone.join("stats.jsonl"), kept).unwrap();
        let output = merge(&lone, &cut, &folder.join("rest"));
        assert_success(&output);
        assert_says(
            &stderr(&output),
            &["cut is not whole: interrupted", "frames 0 to 2 are in none"],
        );
        let again = |a: &Path, b: &Path, says: &str| {
            let out = folder.join("no");
            let output = merge(a, b, &out);
            assert_eq!(output.status.code(), Some(2));
            assert!(!out.exists());
            assert_says(&stderr(&output), &[says]);
        };
        again(&whole, &first, "frame 0 is in");
        // A line that a full disk cut is left out, and a run's own statistics are not written over.
        let cut_line = lines.trim_end().rsplit_once('}').unwrap().0;
        std::fs::write(lone.join("stats.jsonl"), cut_line).unwrap();
        let output = merge(&first, &lone, &folder.join("rest"));
        assert_success(&output);
        assert_says(&stderr(&output), &["the last line is cut off"]);
        assert_eq!(stats(&folder.join("rest")).len(), 5);
        let output = merge(&first, &second, &whole);
        assert_eq!(output.status.code(), Some(2));
        assert_eq!(stats(&whole).len(), 6);
        // Nor a killed run's, which has nothing else.
        let killed = folder.join("killed");
        std::fs::create_dir_all(&killed).unwrap();
        std::fs::copy(whole.join("stats.jsonl"), killed.join("stats.jsonl")).unwrap();
        let output = merge(&first, &second, &killed);
        assert_eq!(output.status.code(), Some(2));
        assert_eq!(stats(&killed).len(), 6);
        std::fs::remove_dir_all(&killed).unwrap();
        let about = second.join("run.json");
        let mut elsewhere = json(&about);
        // Photons of a scene that stands still are traced before the second half.
        let (traced, stands) = (
            &elsewhere["medians"]["photons_ms"],
            scene == "builtin:cornell",
        );
        assert_eq!(traced.is_null(), stands, "{traced}");
        elsewhere["adapter"]["name"] = "another".into();
        std::fs::write(&about, elsewhere.to_string()).unwrap();
        again(&first, &second, "adapter.name");
        run(&second, scene, &["--range", "3..6", "--seed", "5"]);
        again(&first, &second, "settings_hash");
        let hands = "[[left]]\nat_s = 0.02\npress = ['primary']\n";
        let hands = folder.write("hands.toml", hands);
        let hands = format!("--set=simulated.hands={}", hands.display());
        run(&second, scene, &["--range", "3..6", &hands]);
        again(&first, &second, "settings.simulated");
    }
}

#[test]
fn motion_of_the_first_frame_is_that_since_the_frame_before() {
    let folder = Folder::new("range-motion");
    let [whole, part] = ["whole", "part"].map(|name| folder.join(name));
    let motion = "--set=output.aovs=motion";
    run(&whole, "builtin:cornell", &[motion]);
    run(&part, "builtin:cornell", &[motion, "--range", "4..6"]);
    let read = |folder: &Path| std::fs::read(folder.join("frame_0004_left.exr")).unwrap();
    assert!(read(&whole) == read(&part));
    assert!(!part.join("frame_0003_left.exr").exists());
}

#[test]
fn filters_need_the_frames_before_them() {
    let folder = Folder::new("warm-up");
    let filter = ["--set=reconstruct.svgf=true", "--set=reconstruct.taa=true"];
    let [whole, cold, warm] = ["whole", "cold", "warm"].map(|name| folder.join(name));
    let scene = "builtin:cornell";
    run(&whole, scene, &filter);
    let last = [&filter[..], &["--range", "4..6"]].concat();
    run(&cold, scene, &last);
    run(&warm, scene, &[&last[..], &["--warm-up", "4"]].concat());
    let read = |folder: &Path| std::fs::read(folder.join("frame_0005_left.exr")).unwrap();
    // All frames before it: nothing is missing. None of them: something is.
    assert!(read(&whole) == read(&warm));
    assert!(read(&whole) != read(&cold));
    assert_eq!(stats(&warm).len(), 2);
    for (args, says) in [
        (&["--range", "5..3"][..], "A..B"),
        (&["--warm-up", "3"], "--range"),
        (&["--range", "0..3", "--session", "openxr"], "--range"),
        (&["--range", "0..3", "--record", "x.jsonl"], "--record"),
        (
            &["--range", "5..9", "--frames", "5"],
            "has 5 frames, counted from 0",
        ),
    ] {
        let output = stereolux(&[&["run"], args].concat());
        assert_eq!(output.status.code(), Some(2), "{args:?}");
        assert_says(&stderr(&output), &[says]);
    }
}
