//! Command lines as a person types them: what is accepted, and one clear line for what is not.

use std::ffi::OsString;

use stereolux::options::{
    self, EarlyExit, Options, PoseOptions, RenderOptions, RunOptions, SessionChoice, SessionOptions,
};
use stereolux::scene::builtin;
use stereolux::settings::{Eyes, Light, Method, Motion, Reuse, Settings};
use stereolux::xr::{Fov, TraceBody, TraceUp};

use super::support::{assert_says, words};

fn parse(args: &[&str]) -> Result<Options, EarlyExit> {
    let args = std::iter::once("stereolux").chain(args.iter().copied());
    options::parse(args.map(OsString::from))
}

fn outcome(args: &[&str]) -> Result<Options, String> {
    parse(args).map_err(|EarlyExit { text, status }| {
        assert_eq!(status, 2, "{text}");
        assert!(text.starts_with("error: "), "{text}");
        text
    })
}

fn run(args: &[&str]) -> RunOptions {
    match outcome(&[&["run"], args].concat()) {
        Ok(Options::Run(options)) => *options,
        other => panic!("{other:?}"),
    }
}

#[test]
fn view_lights_what_has_no_light_unless_it_is_told() {
    let light = |args: &[&str]| match outcome(args) {
        Ok(Options::View(options)) => options.settings.light,
        Ok(Options::Run(options)) => options.settings.light,
        other => panic!("{other:?}"),
    };
    assert_eq!(light(&["view"]), Light::Auto);
    assert_eq!(light(&["view", "--light", "none"]), Light::None);
    assert_eq!(light(&["view", "--set", "light=sky"]), Light::Sky);
    assert_eq!(light(&["run"]), Light::None);
}

fn session(args: &[&str]) -> SessionOptions {
    run(args).session
}

fn view(args: &[&str]) -> PoseOptions {
    render(args).view
}

fn render(args: &[&str]) -> RenderOptions {
    match outcome(&[&["render"], args].concat()) {
        Ok(Options::Render(options)) => *options,
        other => panic!("{other:?}"),
    }
}

/// Fails unless these are refused in one line that says so.
fn refused(args: &[&str], says: &[&str]) {
    let message = outcome(args).expect_err("must be refused");
    let is_one_line = !message.contains('\n') && !message.is_empty();
    assert!(is_one_line, "{args:?}: {message:?}");
    assert_says(&message, says);
}

#[test]
fn defaults() {
    let options = run(&[]);
    assert_eq!(options.settings, Settings::default());
    assert_eq!(options.shared.out.to_str(), Some("out"));
    let session = options.session;
    assert_eq!(session.choice, SessionChoice::Auto);
    assert_eq!((session.recording.trace, session.record), (None, None));
    assert_eq!(session.frames, None);
    assert_eq!((session.every, session.realtime), (1, false));
    let view = render(&[]).view;
    assert_eq!((view.pose, view.ipd, view.fov), (None, None, None));
    assert_eq!(view.eyes, Eyes::Both);
}

#[test]
fn every_shared_flag() {
    let mut args = words(
        "--method path --reuse off --photons 1000 --radius 0.25 --spp 16 --size 640x480 --headset quest3 \
         --seed 4294967295 --adapter llvm --out o --motion walk",
    );
    args.extend(["--scene", "a b.glb"]);
    let settings = run(&args).settings;
    let render = &settings.render;
    assert_eq!(settings.scene, "a b.glb");
    assert_eq!((render.method, render.reuse), (Method::Path, Reuse::Off));
    assert_eq!((render.photon.count, render.photon.radius_m), (1000, 0.25));
    assert_eq!((render.spp, render.seed), (16, u32::MAX));
    assert_eq!(settings.size, Some([640, 480]));
    assert_eq!((&*settings.headset, &*settings.adapter), ("quest3", "llvm"));
    assert_eq!(settings.simulated.motion, Motion::Walk);
}

#[test]
fn values_may_begin_with_a_minus_sign_after_a_space() {
    let mut args = words("--set photon.normal_min_cos=-1 --scene -x.glb --out -o");
    args.extend(["--fov", "-40 45 30 -35", "--pose", "-1 2 -3 0 0 0 1"]);
    let options = render(&args);
    let fov = options.view.fov.unwrap();
    assert_eq!(fov, Fov::from_degrees(-40.0, 45.0, 30.0, -35.0));
    let pose = options.view.pose.unwrap();
    assert_eq!(pose.position.to_array(), [-1.0, 2.0, -3.0]);
    assert_eq!(options.settings.render.photon.normal_min_cos, -1.0);
    assert_eq!(options.settings.scene, "-x.glb");
    assert_eq!(options.shared.out.to_str(), Some("-o"));
    let turned = session(&["--trace", "t", "--trace-body", "-0.5 0.5 -0.5 0.5"]);
    assert!(matches!(turned.recording.trace_body, Some(TraceBody::Quaternion(q)) if q.x == -0.5));
    // A flag is not a value, though: this is a forgotten value.
    refused(
        &["run", "--scene", "--spp", "4"],
        &["--scene needs a value"],
    );
}

#[test]
fn poses_and_angles_are_checked() {
    // Off by less than 1e-3 is normalised, more is refused.
    let pose = view(&["--pose", "0 0 0 0 0 0 1.0005"]).pose.unwrap();
    assert_eq!(pose.orientation.w, 1.0);
    for (flag, value, says) in [
        ("--pose", "0 0 0 0 0 0 1.01", "length is 1.01"),
        ("--pose", "0 0 0 0 0 0 0", "length is 0"),
        ("--pose", "0 0 0 0 0 1", "6 numbers where 7"),
        ("--pose", "0 0 0 0 0 0 0 1", "8 numbers where 7"),
        ("--pose", "0 0 nan 0 0 0 1", "not finite"),
        ("--pose", "0 0 1e400 0 0 0 1", "not finite"),
        ("--pose", "a 0 0 0 0 0 1", "\"a\" is not a number"),
        ("--pose", "1e300 0 0 0 0 0 1", "farther than"),
        (
            "--fov",
            "40 -40 40 -40",
            "left (40) must be less than right (-40)",
        ),
        (
            "--fov",
            "-40 40 -40 40",
            "down (40) must be less than up (-40)",
        ),
        ("--fov", "-40 -40 40 -40", "must be less than"),
        ("--fov", "-90 40 40 -40", "beyond +-89"),
        ("--fov", "-40 40 40", "3 numbers where 4"),
        ("--fov", "", "0 numbers where 4"),
        ("--fov", "inf 1 1 1", "not finite"),
        ("--pose", "", "0 numbers where 7"),
        ("--ipd", "-0.06", "from 0 to 1"),
        ("--ipd", "nan", "from 0 to 1"),
        ("--ipd", "1.1", "from 0 to 1"),
        ("--ipd", "6cm", "in metres"),
    ] {
        refused(&["render", flag, value], &[says, flag]);
    }
    // Extremes pass: 170 degrees, 1 degree, half a metre, none.
    assert!(view(&["--fov", "-85 85 85 -85"]).fov.is_some());
    assert!(view(&["--fov", "-89 89 89 -89"]).fov.is_some());
    assert!(view(&["--fov", "-0.5,0.5,0.5,-0.5"]).fov.is_some());
    assert_eq!(view(&["--ipd", "0.5"]).ipd, Some(0.5));
    assert_eq!(view(&["--ipd", "0"]).ipd, Some(0.0));
}

#[test]
fn unusable_values_name_flag_value_and_range() {
    for (args, says) in [
        (["--size", "0x0"], "from 1 to 16384"),
        (["--size", "64"], "WIDTHxHEIGHT"),
        (["--size", "64x99999999999999999999"], "from 1 to 16384"),
        (["--size", "-64x64"], "from 1 to 16384"),
        (["--spp", "0"], "from 1 to 1048576"),
        (["--spp", "-1"], "from 1 to 1048576"),
        (["--spp", "1.5"], "whole number"),
        (["--photons", "67108865"], "from 0 to 67108864"),
        (["--photons", "many"], "whole number"),
        (["--radius", "-1"], "a number from 0"),
        (["--radius", "inf"], "a number from 0"),
        (["--seed", "4294967296"], "from 0 to 4294967295"),
        (["--scene", ""], "not empty"),
        (["--out", ""], "value is required"),
        (["--method", "raster"], "photon, path"),
        (["--reuse", "maybe"], "off, scatter, lookup"),
        (["--frames", "0"], "from 1"),
        (["--every", "0"], "from 1"),
        (["--every", "x"], "from 1"),
        (
            ["--session", "real"],
            "auto, simulated, replay, desktop, openxr",
        ),
        (["--motion", "jump"], "still, yaw, walk, sway"),
    ] {
        refused(&[&["run"][..], &args].concat(), &[says, args[0]]);
    }
}

#[test]
fn unknown_commands_and_flags() {
    for (args, says) in [
        (&[][..], "no command given"),
        (&["rnu"], "run, render, compare"),
        (&["run", "--bogus"], "--bogus"),
        (&["run", "--photon", "3"], "--photons"),
        (&["run", "stray"], "stray"),
        (&["run", "--spp"], "--spp"),
        (&["run", "--spp", "1", "--spp", "2"], "--spp"),
        (&["compare", "only-one.exr"], "<REFERENCE>"),
        (&["run", "--ipd", "0.06"], "--ipd"),
    ] {
        refused(args, &[says]);
    }
}

#[test]
fn sessions_and_traces_go_together() {
    assert_eq!(session(&["--trace", "t"]).choice, SessionChoice::Replay);
    let options = session(&words(
        "--session replay --trace t --trace-up y --trace-body optical --trace-recenter false --frames 7 --every 3 \
         --realtime --record r",
    ));
    let recording = options.recording;
    assert_eq!(recording.trace.unwrap().to_str(), Some("t"));
    assert_eq!(recording.trace_up, Some(TraceUp::Y));
    assert_eq!(recording.trace_body, Some(TraceBody::Optical));
    assert_eq!(recording.trace_recenter, Some(false));
    let (frames, every) = (options.frames, options.every);
    assert_eq!((frames, every, options.realtime), (Some(7), 3, true));
    let recenter = session(&["--trace", "t", "--trace-recenter"]).recording;
    assert_eq!(recenter.trace_recenter, Some(true));
    let on_replay = "--session replay";
    for (args, says) in [
        (&["--session", "replay"][..], "add --trace"),
        (&["--session", "simulated", "--trace", "t"], on_replay),
        (&["--session", "openxr", "--trace", "t"], on_replay),
        (&["--trace-up", "y"], "--trace-up"),
        (&["--trace-body", "optical"], "--trace-body"),
        (&["--trace-recenter"], "--trace-recenter"),
        (&["--trace", "t", "--trace-up", "x"], "y, z"),
        (&["--trace", "t", "--record", "t"], "another name"),
        (&["--trace", "t", "--motion", "yaw"], "--motion"),
        (&["--session", "openxr", "--realtime"], "--realtime"),
    ] {
        refused(&[&["run"], args].concat(), &[says]);
    }
    for (body, says) in [
        ("sideways", "openxr, optical or"),
        ("0 0 0 2", "length is 2"),
        ("0 0 0", "3 numbers where 4"),
        ("0 0 0 1 0", "5 numbers where 4"),
        ("nan 0 0 1", "not finite"),
        ("", "0 numbers where 4"),
    ] {
        refused(&["run", "--trace", "t", "--trace-body", body], &[says]);
    }
}

#[test]
fn compare_and_info() {
    let compared = outcome(&words(
        "compare a.exr b.exr --max-rel-mse 0.01 --mask m.png",
    ));
    let Ok(Options::Compare(options)) = compared else {
        panic!("{compared:?}")
    };
    assert_eq!(options.max_rel_mse, Some(0.01));
    assert_eq!((options.exposure, options.pixels_per_degree), (1.0, 67.0));
    for flags in [
        ["--max-rel-mse", "-1"],
        ["--max-rel-mse", "nan"],
        ["--exposure", "0"],
        ["--pixels-per-degree", "0"],
    ] {
        refused(&[&["compare", "a", "b"][..], &flags].concat(), &[]);
    }
    let scene = |args: &[&str]| match outcome(args) {
        Ok(Options::Info(options)) => options.names_scene.then_some(options.settings.scene),
        other => panic!("{other:?}"),
    };
    assert_eq!(scene(&["info"]), None);
    let given = scene(&["info", "--scene", "x.glb"]);
    assert_eq!(given.as_deref(), Some("x.glb"));
    let set = scene(&["info", "--set", "scene=y.glb"]);
    assert_eq!(set.as_deref(), Some("y.glb"));
}

#[test]
fn bench_takes_a_suite_and_its_sizes() {
    use stereolux::options::Suite;
    let bench = |line: &str| match outcome(&words(line)) {
        Ok(Options::Bench(options)) => options,
        other => panic!("{other:?}"),
    };
    let options = bench("bench pareto");
    assert_eq!(options.suite, Suite::Pareto);
    assert!(options.scenes.is_empty() && options.rounds.is_none());
    let options = bench(
        "bench stereo --scene a.glb --scene builtin:plane --size 32x24 --rounds 5 --frames 7 --reference-spp 64 \
         --references kept --set photon.count=9",
    );
    assert_eq!(options.scenes, ["a.glb", "builtin:plane"]);
    assert_eq!(options.settings.size, Some([32, 24]));
    assert_eq!(options.settings.render.photon.count, 9);
    assert_eq!((options.rounds, options.frames), (Some(5), Some(7)));
    assert_eq!(options.reference_spp, Some(64));
    assert_eq!(options.references.unwrap().to_str(), Some("kept"));
    // A scene from --set is the one to measure.
    assert_eq!(bench("bench smoke --set scene=x.glb").scenes, ["x.glb"]);
    for flags in [
        ["--rounds", "0"],
        ["--rounds", "1000000"],
        ["--frames", "x"],
        ["--reference-spp", "15"],
        ["--references", ""],
        ["--scene", ""],
    ] {
        refused(&[&["bench", "smoke"][..], &flags].concat(), &[]);
    }
}

#[test]
fn help_is_there_for_every_command_and_names_the_list_of_settings() {
    let help = |args: &[&str]| {
        let exit = parse(args).expect_err("help stops");
        assert_eq!(exit.status, 0);
        exit.text
    };
    for command in words("run render compare bench info view settings merge new") {
        assert_says(&help(&["--help"]), &[command]);
        assert_says(&help(&[command, "--help"]), &["Exit status"]);
    }
    let scenes = format!("NAME one of {} [default", builtin::NAMES.join(", "));
    for command in ["run", "render", "bench", "view"] {
        let text = help(&[command, "--help"]);
        assert_says(&text, &["stereolux settings WORD"]);
        assert!(command == "bench" || text.contains(&scenes), "{text}");
    }
    assert!(help(&["--version"]).starts_with("stereolux "));
}

#[test]
fn an_application_has_a_help_of_its_own() {
    let exit = |flag: &str| {
        let args = ["/somewhere/mine", flag].map(OsString::from);
        options::parse_run(&["--scene=room.glb"], args).expect_err(flag)
    };
    let help = exit("--help");
    assert_eq!(help.status, 0);
    assert_says(&help.text, &["mine [view] [OPTIONS]", "--scene=room.glb"]);
    let refused = exit("--scnee=x");
    assert_eq!(refused.status, 2);
    assert!(
        refused.text.ends_with("see `mine --help`"),
        "{}",
        refused.text
    );
}
