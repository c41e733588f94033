//! Replays recording.jsonl without a headset: the application does the same, pixel by pixel, and what it does is seen.

use std::path::{Path, PathBuf};
use std::process::Command;

use stereolux::read_image;

/// Runs the application on the recording; images go to a folder of that name.
fn replay(name: &str) -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let status = Command::new(env!("CARGO_BIN_EXE_NAME"))
        .arg("--trace")
        .arg(here.join("recording.jsonl"))
        .args(["--size", "32x32", "--photons", "4000", "--out"])
        .arg(&out)
        .status()
        .expect("the application starts");
    assert!(status.success(), "{status}");
    out
}

fn pixels(folder: &Path, frame: usize) -> Vec<[f32; 3]> {
    let path = folder.join(format!("frame_{frame:04}_left.exr"));
    read_image(&path).expect("an image of that frame").pixels
}

/// The cube's colour is red: how far to the right its pixels are on average, 0 to 31.
fn cube_column(image: &[[f32; 3]]) -> f32 {
    let is_red = |[r, g, b]: &[f32; 3]| *r > 2.0 * (g + b) && *r > 0.01;
    let pixels = image.iter().enumerate().filter(|(_, color)| is_red(color));
    let columns: Vec<f32> = pixels.map(|(index, _)| (index % 32) as f32).collect();
    assert!(columns.len() > 5, "the cube is seen");
    columns.iter().sum::<f32>() / columns.len() as f32
}

#[test]
fn the_recording_moves_the_cube_the_same_way_each_time() {
    let [first, second] = ["first", "second"].map(replay);
    for frame in [0, 8, 15] {
        assert!(pixels(&first, frame) == pixels(&second, frame), "frame {frame}");
    }
    let [before, after] = [0, 15].map(|frame| cube_column(&pixels(&first, frame)));
    assert!(after > before + 2.0, "the hand carries it to the right: {before}, {after}");
}
