//! Passes of the user's own: they run where the config file puts them, and every fault is one line.

use std::process::Output;

use stereolux::images::read_image;

use super::support::{
    Folder, RAW_FRAMES, assert_says, assert_success, run_into, stderr, stereolux,
};

/// Runs `command` with a config file of this text; `files` lie beside it.
fn start(folder: &Folder, command: &str, text: &str, files: &[(&str, &str)]) -> Output {
    for (name, source) in files {
        folder.write(name, source);
    }
    let config = folder.write("own.toml", text);
    let more = ["--config", config.to_str().unwrap()];
    run_into(&folder.join("out"), command, &more)
}

fn render(folder: &Folder, passes: &str, files: &[(&str, &str)]) -> Output {
    let command = "render --scene builtin:cornell --size 16x16 --reuse lookup --photons 500";
    start(folder, command, passes, files)
}

fn pass(name: &str, after: &str, file: &str) -> String {
    format!("[[pass]]\nfile = {file:?}\nname = {name:?}\nafter = {after:?}\n")
}

/// A pass that paints every pixel of the eye green and reads `read`.
fn green(read: &str) -> String {
    format!(
        "import package::shared::math::{{INVALID}};
         import package::shared::pixel::{{Thread, pixel_of_thread}};
         @group(0) @binding(90) var<storage, read> {read}: array<vec4<f32>>;
         @group(0) @binding(33) var<storage, read_write> radiance_sum: array<vec4<f32>>;
         @compute @workgroup_size(64)
         fn main(thread: Thread) {{
             let pixel = pixel_of_thread(thread);
             if pixel == INVALID {{ return; }}
             radiance_sum[pixel] = vec4<f32>(0.0, 0.5 + 0.0 * {read}[pixel].x, 0.0, 1.0);
         }}"
    )
}

#[test]
fn a_pass_of_ones_own_runs_after_the_one_that_it_names_in_both_eyes() {
    let folder = Folder::new("own_pass");
    let passes = pass("second", "first", "green.wesl") + &pass("first", "eye_combine", "red.wesl");
    let red = green("hit_rays").replace("0.0, 0.5 +", "0.5, 0.0 +");
    let files = [("green.wesl", green("hit_rays")), ("red.wesl", red)];
    let files = files.each_ref().map(|(name, text)| (*name, text.as_str()));
    assert_success(&render(&folder, &passes, &files));
    for eye in ["left", "right"] {
        let path = folder.join(&format!("out/frame_0000_{eye}.exr"));
        let image = read_image(&path).unwrap();
        // The second one painted over the first.
        let is_green = |pixel: &[f32; 3]| *pixel == [0.0, 0.5, 0.0];
        assert!(image.pixels.iter().all(is_green), "{eye}");
    }
    let stats = std::fs::read_to_string(folder.join("out/stats.jsonl")).unwrap();
    assert_says(
        &stats,
        &["left.first", "left.second", "right.first", "right.second"],
    );
    let report = std::fs::read_to_string(folder.join("out/run.json")).unwrap();
    assert_says(&report, &["green.wesl", "\"after\""]);
}

/// Anti-aliasing leaves tiles out that have long seen nothing but surroundings, unless a pass may have changed them.
#[test]
fn tiles_that_anti_aliasing_leaves_out_are_as_it_would_have_them() {
    const GREEN: &str = "0.0, 0.5 + 0.0 * hit_rays[pixel].x, 0.0, 1.0";
    let shown = |written: &str, passes: &str| {
        let folder = Folder::new("idle_pass");
        let source = green("hit_rays").replace("radiance_sum", "reconstructed");
        let source = source.replace(GREEN, written);
        let sky = "reconstruct.taa_alpha = 0.5\nenvironment.path = 'builtin:sky'\n".to_owned();
        let command = "run --scene builtin:parade --size 64x24 --photons 500 --frames 10";
        let files = [("own.wesl", source.as_str())];
        assert_success(&start(&folder, command, &(sky + passes), &files));
        let path = |eye| folder.join(&format!("out/frame_0009_{eye}.exr"));
        ["left", "right"].map(|eye| read_image(&path(eye)).unwrap().pixels)
    };
    let own = pass("own", "remodulate", "own.wesl");
    let idle = "reconstructed[pixel].rgb + 0.0 * hit_rays[pixel].x, 1.0";
    assert!(shown("", "") == shown(idle, &own));
    let is_green = |c: &[f32; 3]| c[0] == 0.0 && (c[1] - 0.5).abs() < 1e-5 && c[2] == 0.0;
    assert!(shown(GREEN, &own).iter().flatten().all(is_green));
}

#[test]
fn every_fault_of_a_pass_is_one_line_and_leaves_nothing() {
    let good = green("hit_rays");
    let no_buffer = green("hit_rayz");
    let unwritten = green("seen_surfaces");
    let broken = good.replace("let pixel =", "let pixel :=");
    let no_main = good.replace("fn main", "fn mine");
    let own = |after: &str| pass("mine", after, "mine.wesl");
    let named = |name: &str| pass(name, "eye_combine", "mine.wesl");
    let circle = pass("a", "b", "mine.wesl") + &pass("b", "a", "mine.wesl");
    let no_file = pass("mine", "eye_combine", "other.wesl");
    let misspelt = named("mine").replace("after", "afther");
    let mine = named("mine");
    let no_table = "\npass = 3\n".to_owned();
    // Names that are unknown, not in this plan, over no image; a circle; names that are taken and no names; faults of the
    // shader; files that are not there, misspelt, no table.
    for (passes, source, says) in [
        (&own("eye_combin"), &good, "eye_combin; 'eye_combine'"),
        (&own("svgf_atrous"), &good, "svgf_atrous; does not run"),
        (&own("photon_append"), &good, "photon_append; does not run"),
        (&circle, &good, "circle of a, b"),
        (&named("taa"), &good, "another pass"),
        (&named("Mine!"), &good, "small letters"),
        (&mine, &no_buffer, "hit_rayz; no buffer"),
        (&mine, &unwritten, "seen_surfaces; no pass writes"),
        (&mine, &broken, "mine.wesl"),
        (&mine, &no_main, "main"),
        (&no_file, &good, "other.wesl; cannot be read"),
        (&misspelt, &good, "own.toml:1; afther"),
        (&no_table, &good, "own.toml:2; [[pass]]"),
    ] {
        println!("{says}");
        let words: Vec<&str> = says.split("; ").collect();
        let folder = Folder::new("own_pass_fault");
        let output = render(&folder, passes, &[("mine.wesl", source)]);
        let error = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{says}: {error}");
        assert_says(error.lines().last().unwrap_or_default(), &words);
        let errors = error.lines().filter(|line| line.contains("error"));
        assert_eq!(errors.count(), 1, "{says}: {error}");
        assert!(!folder.join("out").exists(), "{says} left files");
        let config = folder.join("own.toml").display().to_string();
        // `info` shows the frame of `run`, which has filters where `render` has none.
        let command = ["info", "--scene=builtin:cornell", "--config", &config];
        let info = stereolux(&[&command[..], &RAW_FRAMES].concat());
        // Which buffers there are besides the frame's own, a renderer knows.
        let is_of_buffers = [&no_buffer, &unwritten].contains(&source);
        let status = if is_of_buffers { 0 } else { 2 };
        let error = stderr(&info);
        assert_eq!(info.status.code(), Some(status), "{says}: {error}");
    }
}

#[test]
fn the_viewer_refuses_a_pass_that_follows_nothing_before_it_opens_a_window() {
    let folder = Folder::new("own_pass_view");
    folder.write("mine.wesl", green("hit_rays"));
    let config = folder.write("own.toml", pass("mine", "eye_combin", "mine.wesl"));
    let output = stereolux(&["view", "--config", config.to_str().unwrap()]);
    let error = stderr(&output);
    assert_eq!(output.status.code(), Some(2), "{error}");
    assert_says(&error, &["eye_combin", "eye_combine"]);
}

#[test]
fn the_examples_change_the_picture_as_they_say() {
    let folder = Folder::new("own_pass_examples");
    let examples = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/user_passes");
    let example = |config: &str, out: &str| {
        let out = folder.join(out);
        let command = "run --session simulated --frames 1 --every 1 --scene builtin:gallery --size 48x48 \
                       --photons 2000";
        assert_success(&run_into(&out, command, &["--config", config]));
        let path = out.join("frame_0000_right.exr");
        read_image(&path).unwrap().pixels
    };
    let black = |image: &[[f32; 3]]| image.iter().filter(|pixel| **pixel == [0.0; 3]).count();
    let plain = folder.write("plain.toml", "reconstruct.taa = true\n");
    let plain = black(&example(plain.to_str().unwrap(), "plain"));
    let outlined = black(&example(&format!("{examples}/outline.toml"), "outline"));
    // Columns, arches and exhibits: a good part of so small a picture, and not most of it.
    let what = format!("{plain} black pixels without and {outlined} with outlines, of 2304");
    assert!(plain < 20 && (200..1400).contains(&outlined), "{what}");
    let distances = example(&format!("{examples}/distance.toml"), "distance");
    // Blue goes from near to far, red from far to near; nothing else has such colours.
    let is_ramp = |&[r, g, b]: &[f32; 3]| r.max(g).max(b) == 0.0 || r < 0.11 || b < 0.21;
    assert!(distances.iter().all(is_ramp));
    assert!(distances.iter().any(|[_, _, b]| *b > 0.3) || distances.iter().any(|[r, ..]| *r > 0.3));
}
