//! One seed, one adapter: the same bytes. Through the program, so that nothing of an earlier run can survive.

use std::collections::BTreeMap;

use crate::suite::support::{Folder, assert_success, exrs, run_into};

fn run(folder: &Folder, name: &str, command: &str) -> BTreeMap<String, Vec<u8>> {
    let out = folder.join(name);
    let command = format!("run --size 32x24 --photons 4000 {command}");
    assert_success(&run_into(&out, &command, &[]));
    exrs(&out)
}

#[test]
fn one_seed_gives_the_same_bytes_twice() {
    let folder = Folder::new("seed");
    for (name, more) in [
        ("photon", "cornell"),
        ("anew", "cornell --set photon.every_frame=true --spp 2"),
        ("gallery", "gallery"),
        ("path", "cornell --method path --spp 2"),
    ] {
        let args = format!("--session simulated --frames 2 --seed 7 --scene builtin:{more}");
        let first = run(&folder, &format!("{name}-1"), &args);
        let second = run(&folder, &format!("{name}-2"), &args);
        assert_eq!(first.len(), 4, "{name}: two eyes of two frames");
        for (file, bytes) in &first {
            assert!(second[file] == *bytes, "{name}: {file} differs");
        }
        // Negative control: another seed is another picture of the same eyes (the seed moves the sway; keep still).
        let still = |seed: u32| {
            let still = "--session simulated --motion still --frames 1";
            let args = format!("{still} --seed {seed} --scene builtin:{more}");
            run(&folder, &format!("{name}-still-{seed}"), &args)
        };
        assert!(still(7) != still(8), "{name}: the seed does nothing");
    }
}

#[test]
fn a_recording_replays_to_the_same_bytes() {
    let folder = Folder::new("replay");
    let (trace, again) = (folder.join("trace.jsonl"), folder.join("again.jsonl"));
    let (trace, again) = (trace.to_str().unwrap(), again.to_str().unwrap());
    for headset in ["symmetric", "index"] {
        let walk = format!("--session simulated --motion walk --headset {headset} --frames 3");
        let recorded = format!("{walk} --record {trace}");
        let recorded = run(&folder, &format!("recorded-{headset}"), &recorded);
        // The replay takes eyes and angles from the recording, not from a profile.
        let replayed = format!("--session replay --trace {trace} --record {again}");
        let replayed = run(&folder, &format!("replayed-{headset}"), &replayed);
        assert_eq!(recorded.len(), 6);
        assert!(recorded == replayed, "{headset}: frames differ");
        let [trace, again] = [trace, again].map(|path| std::fs::read(path).unwrap());
        assert!(trace == again, "{headset}: traces differ");
        // Negative control: frames of a walk differ from each other.
        assert!(recorded["frame_0000_left.exr"] != recorded["frame_0002_left.exr"]);
    }
}
