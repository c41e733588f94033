//! Actions of an application's own: declared, driven by simulated Touch controllers and by runtimes, recorded, replayed.

use std::ffi::OsString;
use std::path::Path;
use std::process::{ExitCode, Output};

use glam::{DVec2, DVec3};
use stereolux::xr::trace::Trace;
use stereolux::{
    ActionKind, Actions, App, AppError, FrameInput, Side, Tracked, World, run_app_with,
};

use super::openxr_failures::{one_error, program_on_fake};
use super::openxr_remote::scripted;
use super::openxr_support::{
    Remote, assert_status, drive, monado, output_on_monado, remote_port, stderr,
};
use crate::suite::support::{self, Folder, assert_says};

const TOUCH: &str = "/interaction_profiles/oculus/touch_controller";
const INDEX: &str = "/interaction_profiles/valve/index_controller";
const TRIGGER: &str = "/user/hand/right/input/trigger/value";

/// By how much the wearer is moved in the twentieth frame.
const MOVE_M: DVec3 = DVec3::new(1.0, 0.5, -2.0);

/// What an application saw of its actions in a frame.
type Seen = (bool, bool, bool, f64, DVec2, Option<Tracked>);

/// Has one action of each kind and notes what they are.
struct Marks {
    /// Suggested for Index controllers beside the left A.
    also: String,
    seen: Vec<Seen>,
}

impl Marks {
    fn new() -> Self {
        Self {
            also: TRIGGER.to_owned(),
            seen: Vec::new(),
        }
    }
}

impl App for Marks {
    fn actions(&self) -> Result<Actions, AppError> {
        let mark = [
            (TOUCH, TRIGGER),
            (TOUCH, "/user/hand/left/input/x/click"),
            (INDEX, "/user/hand/left/input/a/click"),
            (INDEX, self.also.as_str()),
        ];
        let stick = "/user/hand/left/input/thumbstick";
        let turn = [(TOUCH, "/user/hand/left/input/thumbstick/x")];
        let buzz = [(INDEX, "/user/hand/left/output/haptic")];
        let tip = [
            (TOUCH, "/user/hand/right/input/aim/pose"),
            (INDEX, "/user/hand/left/input/aim/pose"),
        ];
        Ok(Actions::default()
            .with("mark", ActionKind::Bool, &mark)?
            .with("turn", ActionKind::Float, &turn)?
            .with("go", ActionKind::Vec2, &[(TOUCH, stick), (INDEX, stick)])?
            .with("tip", ActionKind::Pose, &tip)?
            .with("buzz", ActionKind::Haptic, &buzz)?
            .without_locomotion())
    }

    fn update(&mut self, frame: &FrameInput, world: &mut World) -> Result<(), AppError> {
        let actions = &frame.input.actions;
        let pressed = frame.action_pressed("mark")?;
        self.seen.push((
            actions.held("mark")?,
            pressed,
            frame.action_released("mark")?,
            actions.float("turn")?,
            actions.vec2("go")?,
            actions.pose("tip")?,
        ));
        if pressed {
            world.vibrate_action("buzz", 0.01, 1.0)?;
        }
        if self.seen.len() == 20 {
            world.vibrate(Side::Right, 0.25, 2.0);
            world.vibrate_action("buzz", 0.0, 0.5)?;
            world.move_wearer(MOVE_M)?;
        }
        let vibrated = world
            .vibrate_action("mark", 0.0, 0.0)
            .unwrap_err()
            .to_string();
        for wrong in [
            actions.held("marc").unwrap_err().to_string(),
            actions.float("mark").unwrap_err().to_string(),
            vibrated,
        ] {
            assert_says(&wrong, &["'mark'"]);
        }
        Ok(())
    }
}

/// Runs it without files but a recording.
fn run(app: &mut dyn App, out: &Path, more: &[String]) -> ExitCode {
    let fixed =
        "application --size=8x8 --photons=10 --set=output.images=false --scene=builtin:plane";
    let out = ["--out", out.to_str().unwrap()];
    let fixed = support::words(fixed).into_iter().chain(out);
    let args = fixed.chain(more.iter().map(String::as_str));
    run_app_with(app, &[], args.map(OsString::from))
}

/// The script's times at 90 Hz: X from frame 2 (0.0222 s) on, the trigger besides from frame 4, nothing from frame 6; the
/// stick from frame 3.
#[test]
fn simulated_touch_controllers_drive_actions_and_recordings_replay_them() {
    let folder = Folder::new("actions-simulated");
    let script = "[[left]]\nat_s = 0.02\npress = ['primary']\n[[left]]\nat_s = 0.03\nstick = [0.25, -1]\n\
                  [[left]]\nat_s = 0.06\npress = []\n[[right]]\nat_s = 0.0\nposition_m = [1, 2, 3]\n\
                  [[right]]\nat_s = 0.04\npress = ['trigger']\n[[right]]\nat_s = 0.06\npress = []\n";
    let (hands, trace) = (folder.join("hands.toml"), folder.join("trace.jsonl"));
    std::fs::write(&hands, script).unwrap();
    let adapter = format!("--adapter={}", support::adapter_name());
    let mut live = Marks::new();
    let simulated = [
        "--session=simulated".to_owned(),
        "--frames=8".to_owned(),
        "--headset=symmetric".to_owned(),
        format!("--set=simulated.hands={}", hands.display()),
        format!("--record={}", trace.display()),
        adapter.clone(),
    ];
    let out = folder.join("out");
    assert_eq!(run(&mut live, &out, &simulated), ExitCode::SUCCESS);
    let held: Vec<bool> = live.seen.iter().map(|seen| seen.0).collect();
    assert_eq!(held, [false, false, true, true, true, true, false, false]);
    let edges = |of: fn(&Seen) -> bool| live.seen.iter().position(of);
    assert_eq!(edges(|seen| seen.1), Some(2), "pressed once");
    assert_eq!(edges(|seen| seen.2), Some(6), "released once");
    let (.., turn, go, tip) = live.seen[3];
    assert_eq!((turn, go), (0.25, DVec2::new(0.25, -1.0)));
    assert_eq!(tip.unwrap().pose.position, DVec3::new(1.0, 2.0, 3.0));
    assert_eq!(live.seen[0].4, DVec2::ZERO);

    let mut again = Marks::new();
    let replay = |file: &Path| [format!("--trace={}", file.display()), adapter.clone()];
    assert_eq!(run(&mut again, &out, &replay(&trace)), ExitCode::SUCCESS);
    assert_eq!(again.seen, live.seen);
    // The recording decides, not the hands in it.
    let text = std::fs::read_to_string(&trace).unwrap();
    assert_says(&text, &[r#""mark":true"#]);
    assert!(!text.contains("false,\"mark"), "{text}");
    let other = folder.join("other.jsonl");
    std::fs::write(&other, text.replace(r#""mark":true,"#, "")).unwrap();
    let mut unmarked = Marks::new();
    assert_eq!(run(&mut unmarked, &out, &replay(&other)), ExitCode::SUCCESS);
    assert!(unmarked.seen.iter().all(|seen| !seen.0) && unmarked.seen[3].3 == 0.25);
    // One that was made by an application in which the name means something else.
    std::fs::write(&other, text.replace(r#""mark":true,"#, r#""mark":0.5,"#)).unwrap();
    let refused = run(&mut Marks::new(), &out, &replay(&other));
    assert_eq!(refused, ExitCode::from(1));
}

#[test]
fn a_declaration_that_cannot_be_is_refused_before_a_run() {
    struct Refused;
    impl App for Refused {
        fn actions(&self) -> Result<Actions, AppError> {
            Ok(Actions::default().with("take", ActionKind::Bool, &[])?)
        }
        fn update(&mut self, _: &FrameInput, _: &mut World) -> Result<(), AppError> {
            Ok(())
        }
    }
    let folder = Folder::new("actions-refused");
    let frames = ["--session=simulated".to_owned(), "--frames=1".to_owned()];
    assert_eq!(run(&mut Refused, folder.path(), &frames), ExitCode::from(2));
}

/// Arguments by which this binary runs [`on_a_runtime`] and nothing else.
const ON_A_RUNTIME: [&str; 4] = [
    "--exact",
    "suite::xr::actions::on_a_runtime",
    "--ignored",
    "--nocapture",
];

/// The application in a process of its own, as runtimes want it. `ACTIONS_OUT` has the folder, `ACTIONS_ALSO` the source that
/// is suggested besides, `ACTIONS_STATUS` the exit status that it should have.
#[test]
#[ignore = "run by the tests below with a runtime"]
fn on_a_runtime() {
    let given = |name: &str| std::env::var(name).unwrap();
    let out = given("ACTIONS_OUT");
    let mut app = Marks {
        also: given("ACTIONS_ALSO"),
        seen: Vec::new(),
    };
    let args = [
        "--session=openxr".to_owned(),
        "--frames=40".to_owned(),
        format!("--record={out}/trace.jsonl"),
    ];
    let status: u8 = given("ACTIONS_STATUS").parse().unwrap();
    let ended = run(&mut app, &Path::new(&out).join("out"), &args);
    assert_eq!(ended, ExitCode::from(status));
    assert_eq!(app.seen.len(), if status == 0 { 40 } else { 0 });
}

/// The application on Monado; `options` are the script's.
fn on_monado(options: &[&str], given: &[(&'static str, String)]) -> Output {
    let mut command = monado(options);
    command
        .arg(std::env::current_exe().unwrap())
        .args(ON_A_RUNTIME);
    let output = output_on_monado(command.envs(given.iter().cloned()));
    assert_status(&output, 0);
    output
}

fn given(folder: &Folder, also: &str, status: u8) -> [(&'static str, String); 3] {
    [
        ("ACTIONS_OUT", folder.path().display().to_string()),
        ("ACTIONS_ALSO", also.to_owned()),
        ("ACTIONS_STATUS", status.to_string()),
    ]
}

#[test]
fn an_applications_bindings_are_suggested_and_the_programs_own_dropped() {
    let folder = Folder::new("actions-suggested");
    let this = std::env::current_exe().unwrap();
    let given = given(&folder, TRIGGER, 0);
    let this = this.to_str().unwrap();
    let output = program_on_fake(this, &folder, "profiles", &given, &ON_A_RUNTIME);
    assert_status(&output, 0);
    let text = stderr(&output);
    for expected in [
        format!("{TOUCH} mark {TRIGGER}"),
        format!("{INDEX} mark /user/hand/left/input/a/click"),
        format!("{INDEX} buzz /user/hand/left/output/haptic"),
        format!("{TOUCH} tip /user/hand/right/input/aim/pose"),
        format!("{TOUCH} quit /user/hand/left/input/menu/click"),
    ] {
        assert_says(&text, &[&format!("suggested: {expected}\n")]);
    }
    // Strength in range; no time at all is the shortest that there is.
    for expected in ["haptic /user/hand/right 250000000 ns 1", "buzz ? -1 ns 0.5"] {
        assert_says(&text, &[&format!("vibrates: {expected}\n")]);
    }
    assert_eq!(text.matches("vibrates: ").count(), 2, "{text}");
    // A button that an action is bound to is the application's alone.
    let plus = "/interaction_profiles/meta/touch_controller_plus";
    let switches = [plus, TOUCH, INDEX].map(|of| text.contains(&format!("{of} switch_reuse ")));
    assert_eq!(switches, [true, false, false], "{text}");
    let walks = text.contains(" walk ") || text.contains(" advance ");
    assert!(!walks, "{text}");
    // The runtime's head stands still.
    let trace = Trace::read(&folder.join("trace.jsonl")).unwrap();
    let place = |frame: usize| trace.frames[frame].views.midpoint_in_world();
    for (frame, by_m) in [(19, DVec3::ZERO), (20, MOVE_M), (39, MOVE_M)] {
        assert!(place(frame).distance(place(0) + by_m) < 1e-12, "{frame}");
    }
}

/// The left A is down from frame 10 to 20, and the left stick ahead: nobody walks.
#[test]
fn actions_come_from_monados_controllers_and_are_recorded() {
    let _port = remote_port();
    let folder = Folder::new("actions-monado");
    let _sent = drive(&folder.join("out"), |frame| Remote {
        sticks: [[0.0, 1.0], [0.0; 2]],
        a: (10..20).contains(&frame),
        ..scripted(0)
    });
    on_monado(&["--remote"], &given(&folder, TRIGGER, 0));
    let trace = Trace::read(&folder.join("trace.jsonl")).unwrap();
    let actions = |frame: usize| &trace.frames[frame].input.actions;
    let held: Vec<usize> = (0..40)
        .filter(|frame| actions(*frame).held("mark") == Ok(true))
        .collect();
    assert!(!held.is_empty() && held.len() < 30, "{held:?}");
    let last = actions(39);
    assert_eq!(last.vec2("go"), Ok(DVec2::new(0.0, 1.0)));
    let aim = trace.frames[39].input.hands[0].aim;
    assert_eq!(last.pose("tip").unwrap(), aim);
    let place = |frame: usize| trace.frames[frame].views.midpoint_in_world();
    assert!(place(39).distance(place(30)) < 1e-6, "nobody walks");
}

#[test]
fn a_source_that_the_profile_lacks_is_one_error_that_names_it() {
    let folder = Folder::new("actions-refused-by-monado");
    let nowhere = "/user/hand/right/input/nowhere/click";
    let output = on_monado(&[], &given(&folder, nowhere, 2));
    assert_says(&one_error(&output), &["'mark'", nowhere, INDEX]);
}
