//! Passes of the user's own: they run where the config file puts them, and every fault is one line.

use std::path::Path;

use super::support::stereolux;

/// Runs `render` with a config file of these passes; `files` lie beside it.
fn render(folder: &Path, passes: &str, files: &[(&str, &str)]) -> std::process::Output {
    for (name, source) in files {
        std::fs::write(folder.join(name), source).unwrap();
    }
    let config = folder.join("own.toml");
    std::fs::write(&config, passes).unwrap();
    let out = folder.join("out");
    stereolux(&[
        "render",
        "--scene",
        "builtin:cornell",
        "--size",
        "16x16",
        "--reuse",
        "lookup",
        "--photons",
        "500",
        "--config",
        config.to_str().unwrap(),
        "--out",
        out.to_str().unwrap(),
    ])
}

fn pass(name: &str, after: &str, file: &str) -> String {
    format!("[[pass]]\nfile = {file:?}\nname = {name:?}\nafter = {after:?}\n")
}

/// A pass that paints every pixel of the eye green and reads `read`.
fn green(read: &str) -> String {
    format!(
        "import package::shared::math::{{INVALID}};
         import package::shared::pixel::{{pixel_of_thread}};
         @group(0) @binding(90) var<storage, read> {read}: array<vec4<f32>>;
         @group(0) @binding(33) var<storage, read_write> radiance_sum: array<vec4<f32>>;
         @compute @workgroup_size(64)
         fn main(
             @builtin(global_invocation_id) global_id: vec3<u32>,
             @builtin(workgroup_id) group_id: vec3<u32>,
             @builtin(local_invocation_index) thread: u32,
         ) {{
             let pixel = pixel_of_thread(global_id, group_id, thread);
             if pixel == INVALID {{ return; }}
             radiance_sum[pixel] = vec4<f32>(0.0, 0.5 + 0.0 * {read}[pixel].x, 0.0, 1.0);
         }}"
    )
}

#[test]
fn a_pass_of_ones_own_runs_after_the_one_that_it_names_in_both_eyes() {
    let folder = tempfile_folder("own_pass");
    let passes = pass("second", "first", "green.wesl") + &pass("first", "eye_combine", "red.wesl");
    let red = green("hit_rays").replace("0.0, 0.5 +", "0.5, 0.0 +");
    let files = [("green.wesl", green("hit_rays")), ("red.wesl", red)];
    let files = files.each_ref().map(|(name, text)| (*name, text.as_str()));
    let output = render(&folder, &passes, &files);
    assert!(output.status.success(), "{output:?}");
    for eye in ["left", "right"] {
        let path = folder.join(format!("out/frame_0000_{eye}.exr"));
        let image = stereolux::images::read_image(&path).unwrap();
        // The second one painted over the first.
        assert!(
            image.pixels.iter().all(|pixel| *pixel == [0.0, 0.5, 0.0]),
            "{eye}"
        );
    }
    let stats = std::fs::read_to_string(folder.join("out/stats.jsonl")).unwrap();
    for label in ["left.first", "left.second", "right.first", "right.second"] {
        assert!(stats.contains(label), "{label} in {stats}");
    }
    let report = std::fs::read_to_string(folder.join("out/run.json")).unwrap();
    assert!(report.contains("green.wesl") && report.contains("\"after\""));
}

#[test]
fn every_fault_of_a_pass_is_one_line_and_leaves_nothing() {
    let good = green("hit_rays");
    let no_buffer = green("hit_rayz");
    let unwritten = green("seen_surfaces");
    let broken = good.replace("let pixel =", "let pixel :=");
    let no_main = good.replace("fn main", "fn mine");
    let own = |after: &str| pass("mine", after, "mine.wesl");
    let cases: &[(&str, String, &str, &[&str])] = &[
        (
            "unknown name",
            own("eye_combin"),
            &good,
            &["eye_combin", "\"eye_combine\""],
        ),
        (
            "not in this plan",
            own("svgf_atrous"),
            &good,
            &["svgf_atrous", "does not run"],
        ),
        (
            "over no image",
            own("photon_append"),
            &good,
            &["photon_append", "does not run"],
        ),
        (
            "a circle",
            pass("a", "b", "mine.wesl") + &pass("b", "a", "mine.wesl"),
            &good,
            &["circle of a, b"],
        ),
        (
            "a name that is taken",
            pass("taa", "eye_combine", "mine.wesl"),
            &good,
            &["another pass"],
        ),
        (
            "a name that is none",
            pass("Mine!", "eye_combine", "mine.wesl"),
            &good,
            &["small letters"],
        ),
        (
            "no such buffer",
            own("eye_combine"),
            &no_buffer,
            &["hit_rayz", "no buffer"],
        ),
        (
            "nobody writes it",
            own("eye_combine"),
            &unwritten,
            &["seen_surfaces", "no pass writes"],
        ),
        (
            "a broken shader",
            own("eye_combine"),
            &broken,
            &["mine.wesl"],
        ),
        ("no entry point", own("eye_combine"), &no_main, &["main"]),
        (
            "no such file",
            pass("mine", "eye_combine", "other.wesl"),
            &good,
            &["other.wesl", "cannot be read"],
        ),
        (
            "a misspelt key",
            "[[pass]]\nfile = \"mine.wesl\"\nname = \"mine\"\nafther = \"eye_combine\"\n"
                .to_owned(),
            &good,
            &["own.toml:1", "afther"],
        ),
        ("no table", "pass = 3\n".to_owned(), &good, &["[[pass]]"]),
    ];
    for (index, (case, passes, source, words)) in cases.iter().enumerate() {
        let folder = tempfile_folder(&format!("own_pass_fault_{index}"));
        let output = render(&folder, passes, &[("mine.wesl", source)]);
        let error = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{case}: {error}");
        let last = error.lines().last().unwrap_or_default();
        assert!(
            words.iter().all(|word| last.contains(word)),
            "{case}: {error}"
        );
        assert_eq!(
            error.lines().filter(|line| line.contains("error")).count(),
            1,
            "{case}: {error}"
        );
        assert!(!folder.join("out").exists(), "{case} left files");
    }
}

#[test]
fn the_viewer_refuses_a_pass_that_follows_nothing_before_it_opens_a_window() {
    let folder = tempfile_folder("own_pass_view");
    let config = folder.join("own.toml");
    std::fs::write(folder.join("mine.wesl"), green("hit_rays")).unwrap();
    std::fs::write(&config, pass("mine", "eye_combin", "mine.wesl")).unwrap();
    let output = stereolux(&["view", "--config", config.to_str().unwrap()]);
    let error = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{error}");
    assert!(
        error.contains("eye_combin") && error.contains("eye_combine"),
        "{error}"
    );
}

#[test]
fn the_examples_change_the_picture_as_they_say() {
    let folder = tempfile_folder("own_pass_examples");
    let examples = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/user_passes");
    let example = |config: &str, out: &str| {
        let out = folder.join(out);
        let output = stereolux(&[
            "run",
            "--session",
            "simulated",
            "--frames",
            "1",
            "--every",
            "1",
            "--scene",
            "builtin:gallery",
            "--size",
            "48x48",
            "--photons",
            "2000",
            "--config",
            config,
            "--out",
            out.to_str().unwrap(),
        ]);
        assert!(output.status.success(), "{config}: {output:?}");
        stereolux::images::read_image(&out.join("frame_0000_right.exr"))
            .unwrap()
            .pixels
    };
    let black = |image: &[[f32; 3]]| image.iter().filter(|pixel| **pixel == [0.0; 3]).count();
    let plain = folder.join("plain.toml");
    std::fs::write(&plain, "reconstruct.taa = true\n").unwrap();
    let plain = black(&example(plain.to_str().unwrap(), "plain"));
    let outlined = black(&example(&format!("{examples}/outline.toml"), "outline"));
    // Columns, arches and exhibits: a good part of so small a picture, and not most of it.
    assert!(
        plain < 20 && (200..1400).contains(&outlined),
        "{plain} black pixels without and {outlined} with outlines, of 2304"
    );
    let distances = example(&format!("{examples}/distance.toml"), "distance");
    // Blue goes from near to far, red from far to near; nothing else has such colours.
    let is_ramp = |&[r, g, b]: &[f32; 3]| r.max(g).max(b) == 0.0 || r < 0.11 || b < 0.21;
    assert!(distances.iter().all(is_ramp));
    assert!(distances.iter().any(|[_, _, b]| *b > 0.3) || distances.iter().any(|[r, ..]| *r > 0.3));
}

fn tempfile_folder(name: &str) -> std::path::PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}
