//! Applications as their users write them: the examples run, what they change is seen, and a recording drives them
//! through the same frames.

use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;

use glam::{DAffine3, DQuat, DVec3};
use stereolux::images::read_image;
use stereolux::{
    Actions, App, AppError, Edit, FrameInput, NewContent, PanelSpec, PartLoading, Pose, Quality,
    ScenePart, Side, World, WorldError, run_app_with,
};
use stereolux::{Fov, Headset, ImageRgb8, Motion, RenderSettings, Scene, SimulatedSession};

use super::gallery_tour_example::{self as gallery_tour, Tour};
use super::minimal_example::{self as minimal, PickUp};
use super::support::{assert_says, exrs, strays, words};
use super::{own_loop_example, support, template};

/// The example's last picture of so many frames, its head held still.
fn last_picture(frames: u64) -> ImageRgb8 {
    let mut settings = RenderSettings::default();
    settings.photon.count = 4096;
    let start = Scene::builtin("cornell").unwrap().start_pose();
    // Two frames a second, an eighth of a turn each, and no more to be seen than the box.
    let fov = Fov::from_degrees(-19.0, 19.0, 19.0, -19.0);
    let headset = Headset::load("symmetric").unwrap().with_refresh_hz(2.0);
    let headset = headset.unwrap().with_fov(fov).unwrap();
    let session = SimulatedSession::new(headset, Motion::Still, start, Some(frames));
    own_loop_example::run(support::context(), session, &settings, [48, 48]).unwrap()
}

#[test]
fn a_loop_of_ones_own_shows_what_turns() {
    let [first, second, again] = [1, 2, 2].map(last_picture);
    assert_eq!((first.width, first.height), (96, 48));
    assert_eq!(second.pixels, again.pixels);
    // The block's edges are elsewhere; the box around it stays.
    let differs =
        |(a, b): (&[u8; 3], &[u8; 3])| (0..3).any(|channel| a[channel].abs_diff(b[channel]) > 48);
    let pairs = first.pixels.iter().zip(&second.pixels);
    let changed = pairs.filter(|pair| differs(*pair)).count();
    assert!((40..96 * 48 / 4).contains(&changed), "{changed} pixels");
}

/// Runs an application at little cost, with more arguments; images of every frame go to `out`.
pub fn run(app: &mut dyn App, defaults: &[&str], out: &Path, more: &[&str]) -> ExitCode {
    let mut args = words("application --size=32x32 --photons=2048 --headset=symmetric");
    args.extend(["--adapter", support::adapter_name()]);
    args.extend(["--out", out.to_str().unwrap()]);
    // A replay brings its own views.
    let replays = more.iter().any(|word| word.starts_with("--trace"));
    args.extend((!replays).then_some("--session=simulated"));
    args.extend(more);
    run_app_with(app, defaults, args.into_iter().map(OsString::from))
}

/// As [`run`], and it succeeds.
pub fn run_well(app: &mut dyn App, defaults: &[&str], out: &Path, more: &[&str]) {
    assert_eq!(run(app, defaults, out, more), ExitCode::SUCCESS);
}

pub fn with_trace(word: &str, path: &Path) -> String {
    format!("--{word}={}", path.display())
}

/// The left eye's radiance in a frame: files of other frames differ by their attributes alone.
pub fn left(folder: &Path, frame: usize) -> Vec<[f32; 3]> {
    let path = folder.join(format!("frame_{frame:04}_left.exr"));
    read_image(&path).unwrap().pixels
}

/// Records a run, replays it, and compares the images of all frames.
pub fn replays_to_the_bit<A: App + Default>(name: &str, defaults: &[&str], frames: usize) {
    let folder = support::Folder::new(name);
    let [first, second, trace] =
        ["first", "second", "trace.jsonl"].map(|name| folder.path().join(name));
    let record = [
        &*with_trace("record", &trace),
        &format!("--frames={frames}"),
    ];
    run_well(&mut A::default(), defaults, &first, &record);
    // Without the hands' script: all that drives it is the recording.
    let mut bare = defaults.to_vec();
    bare.retain(|word| !word.contains("simulated.") && !word.starts_with("--motion"));
    let replay = [&*with_trace("trace", &trace)];
    run_well(&mut A::default(), &bare, &second, &replay);
    let [recorded, replayed] = [&first, &second].map(|folder| exrs(folder));
    assert_eq!(recorded.len(), 2 * frames);
    assert!(recorded == replayed, "a replay has other images");
    // Without the application the same frame is another.
    let idle = folder.join("idle");
    run_well(&mut nothing(), &bare, &idle, &replay);
    assert_ne!(left(&idle, frames - 1), left(&first, frames - 1));
}

#[test]
fn the_smallest_application_replays_to_the_bit() {
    replays_to_the_bit::<PickUp>("minimal", minimal::DEFAULTS, 12);
}

#[test]
fn the_tour_of_the_gallery_replays_to_the_bit() {
    replays_to_the_bit::<Tour>("gallery_tour", gallery_tour::DEFAULTS, 24);
}

/// Runs an application and notes where a node stands after each frame's update.
struct Watched<A> {
    inner: A,
    node: &'static str,
    /// Grip of the right hand and place of the node.
    seen: Vec<(DVec3, DAffine3)>,
}

impl<A: App> App for Watched<A> {
    fn actions(&self) -> Result<Actions, AppError> {
        self.inner.actions()
    }

    fn start(&mut self, world: &mut World) -> Result<(), AppError> {
        self.inner.start(world)
    }

    fn update(&mut self, frame: &FrameInput, world: &mut World) -> Result<(), AppError> {
        self.inner.update(frame, world)?;
        let grip = frame.hand(Side::Right).grip.unwrap().pose.position;
        let node = world.node(self.node)?;
        self.seen.push((grip, world.world_from_node(node)?));
        Ok(())
    }
}

/// The block goes with the hand from the frame in which the button goes down, in that very frame, and stays where it is let
/// go. The script's times at 90 Hz: frame 2 reaches the block, frame 3 (0.0333 s) presses, the hand moves by (0.1, 0.2,
/// 0.05) from 0.04 to 0.09 s, and frame 9 (0.1 s) lets go: the block stays where frame 8 had it. The hand only moves, so the block's offset is the hand's; 1e-6 m
/// is far above the rounding of two products of f64 transforms (1e-15 of a metre).
#[test]
fn what_a_simulated_hand_grabs_goes_where_the_hand_goes() {
    let folder = support::Folder::new("grabbed");
    let mut app = Watched {
        inner: PickUp::default(),
        node: "short block",
        seen: Vec::new(),
    };
    let hands = "--set=simulated.hands=examples/minimal_hands.toml";
    let silent = ["--frames=12", "--set=output.images=false", hands];
    run_well(&mut app, minimal::DEFAULTS, folder.path(), &silent);
    assert_eq!(app.seen.len(), 12);
    let whole = DVec3::new(0.1, 0.2, 0.05);
    for (frame, (grip, block)) in app.seen.iter().enumerate() {
        let seconds = frame.min(8) as f64 / 90.0;
        let share = ((seconds - 0.04) / 0.05).clamp(0.0, 1.0);
        let expected = whole * share;
        let moved = block.translation;
        let off = (moved - expected).length();
        assert!(off < 1e-6, "frame {frame}: {moved}, not {expected}");
        // The hand goes on alone.
        let hand_moved = *grip - app.seen[2].0;
        let is_held = (hand_moved - moved).length() <= 1e-3;
        let what = format!("frame {frame}: {hand_moved}, {moved}");
        assert_eq!(is_held, (2..=8).contains(&frame), "{what}");
    }
}

/// Changes the scene in a frame by what it is told.
struct Changes(fn(u32, &mut World) -> Result<(), AppError>);

impl App for Changes {
    fn update(&mut self, frame: &FrameInput, world: &mut World) -> Result<(), AppError> {
        self.0(frame.frame, world)
    }
}

/// Leaves the scene alone.
fn nothing() -> Changes {
    Changes(|_, _| Ok(()))
}

/// A head at rest and frames without history.
pub const RAW: [&str; 4] = [
    "--motion=still",
    "--set=reconstruct.taa=false",
    "--set=reconstruct.svgf=false",
    "--set=reconstruct.still=false",
];
/// Photons of a frame are the same whenever the renderer was made.
pub const EVERY_FRAME: &str = "--set=photon.every_frame=true";

/// Four frames of the box; images go to `out`.
fn run_still(app: &mut dyn App, out: &Path, more: &[&str]) -> ExitCode {
    let still = ["--scene=builtin:cornell", "--frames=4", EVERY_FRAME];
    run(app, &[&still[..], &RAW].concat(), out, more)
}

/// Which of the four frames an application changes by more than rounding: shaders that do for more round otherwise.
fn shows_change(folder: &support::Folder, app: &mut dyn App) -> [bool; 4] {
    let [with, without] = ["with", "without"].map(|name| folder.join(name));
    assert_eq!(run_still(app, &with, &[]), ExitCode::SUCCESS);
    assert_eq!(run_still(&mut nothing(), &without, &[]), ExitCode::SUCCESS);
    [0, 1, 2, 3].map(|frame| strays(&left(&with, frame), &left(&without, frame), 1e-4) > 0)
}

/// Glass is not compiled in for the box: the change shows one frame later, as the renderer's that knew it from the start.
#[test]
fn what_needs_compiling_shows_one_frame_later() {
    fn glass(world: &mut World) -> Result<(), AppError> {
        let material = world.material("white")?;
        world.change_material(material, |white| white.transmission = 1.0)?;
        Ok(())
    }
    let folder = support::Folder::new("compiled_later");
    let [late, early] = ["late", "early"].map(|name| folder.path().join(name));
    let mut from_second = Changes(|frame, world| if frame == 1 { glass(world) } else { Ok(()) });
    let mut from_first = Changes(|frame, world| if frame == 0 { glass(world) } else { Ok(()) });
    assert_eq!(run_still(&mut from_second, &late, &[]), ExitCode::SUCCESS);
    assert_eq!(run_still(&mut from_first, &early, &[]), ExitCode::SUCCESS);
    // The change of frame 0 shows in frame 1, that of frame 1 in frame 2.
    let are_same = [0, 1, 2].map(|frame| left(&late, frame) == left(&early, frame));
    assert_eq!(are_same, [true, false, true]);
}

/// Quality by what no recording holds: which frames are expensive, as an application that times them would find.
struct Steered {
    expensive: fn(u32) -> bool,
}

impl App for Steered {
    fn start(&mut self, world: &mut World) -> Result<(), AppError> {
        let refused = world.set_quality(&Quality::of(&RenderSettings::default()));
        assert!(matches!(refused, Err(WorldError::Quality(_))));
        Ok(())
    }

    fn update(&mut self, frame: &FrameInput, world: &mut World) -> Result<(), AppError> {
        let mut quality = world.most_quality()?;
        if (self.expensive)(frame.frame) {
            quality.resolution_scale = 0.5;
            quality.photons_per_frame /= 2;
            quality.filter_passes = 0;
            quality.reuse = false;
        }
        world.set_quality(&quality)?;
        assert_eq!(world.quality()?, quality);
        quality.photons_per_frame += 1_000_000;
        let refused = world.set_quality(&quality).unwrap_err().to_string();
        assert!(refused.contains("photon.count"), "{refused}");
        Ok(())
    }
}

/// Frames 2, 3 and 5 are expensive. A replay renders what was recorded, whatever its application asks for.
#[test]
fn quality_is_recorded_and_replayed_to_the_bit() {
    let folder = support::Folder::new("quality");
    let at = |name: &str| folder.path().join(name);
    let scene = ["--scene=builtin:cornell"];
    let mut steered = Steered {
        expensive: |frame| matches!(frame, 2 | 3 | 5),
    };
    let more = ["--frames=7", "--motion=sway"];
    let trace = at("trace.jsonl");
    let first = at("first");
    run_well(
        &mut steered,
        &scene,
        &first,
        &[&more[..], &[&*with_trace("record", &trace)]].concat(),
    );
    let sizes = (0..7).map(|frame| left(&first, frame).len());
    let [all, quarter] = [32 * 32, 16 * 16];
    assert!(sizes.eq([all, all, quarter, quarter, all, quarter, all]));
    let text = std::fs::read_to_string(&trace).unwrap();
    // The header, then frames: the first, and those from which on it is another.
    let told = text.lines().map(|line| line.contains("\"quality\":"));
    assert!(told.eq([false, true, false, true, false, true, true, true]));
    let replay = |app: &mut dyn App, trace: &Path, name: &str| {
        let again = at(&format!("{name}.jsonl"));
        let words = [with_trace("trace", trace), with_trace("record", &again)];
        run_well(
            app,
            &scene,
            &at(name),
            &words.each_ref().map(String::as_str),
        );
        (exrs(&at(name)), std::fs::read_to_string(&again).unwrap())
    };
    let mut other = Steered {
        expensive: |frame| frame % 2 == 0,
    };
    let mut idle = nothing();
    for (app, name) in [(&mut other as &mut dyn App, "other"), (&mut idle, "idle")] {
        let (replayed, again) = replay(app, &trace, name);
        assert!(replayed == exrs(&first), "{name}: other images");
        assert!(again == text, "{name}: another recording");
    }
    // A change that is not applied is seen: here that of frame 5, of which only the size is taken back, or the photons.
    for (name, from, to) in [
        ("resolution_scale", "0.5", "1.0"),
        ("photons_per_frame", "1024", "2048"),
        ("filter_passes", "0", "1"),
        ("reuse", "false", "true"),
    ] {
        let [from, to] = [from, to].map(|value| format!("\"{name}\":{value}"));
        let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
        assert_says(&lines[6], &[&from]);
        lines[6] = lines[6].replace(&from, &to);
        let changed = at(&format!("changed_{name}.jsonl"));
        std::fs::write(&changed, lines.join("\n") + "\n").unwrap();
        let without = format!("without_{name}");
        replay(&mut idle, &changed, &without);
        let differs = |frame: &usize| left(&at(&without), *frame) != left(&first, *frame);
        // Also of reuse: filtered light is shared between the eyes.
        assert_eq!((0..7).find(differs), Some(5), "{name}");
    }
    // What the renderer is not made for is refused before anything is lost.
    let text = text.replace("\"photons_per_frame\":1024", "\"photons_per_frame\":4096");
    let beyond = folder.write("beyond.jsonl", text);
    let kept = exrs(&at("other"));
    let words = [with_trace("trace", &beyond)];
    let words = words.each_ref().map(String::as_str);
    let refused = run(&mut idle, &scene, &at("other"), &words);
    assert_eq!(refused, ExitCode::from(2));
    assert!(exrs(&at("other")) == kept);
    // Of frames that the replay does not come to there is nothing to say.
    run_well(
        &mut idle,
        &scene,
        &at("short"),
        &[&words[..], &["--frames=2"]].concat(),
    );
    // A recording without any leaves it to the application.
    let plain = at("plain.jsonl");
    let record = with_trace("record", &plain);
    let record = [&more[..], &[&*record]].concat();
    run(&mut idle, &scene, &at("plain"), &record);
    assert!(!std::fs::read_to_string(&plain).unwrap().contains("quality"));
    let (replayed, _) = replay(&mut steered, &plain, "steered");
    assert!(replayed == exrs(&first));
}

#[test]
fn an_application_ends_its_run_and_its_errors_end_it_too() {
    let folder = support::Folder::new("ended");
    let mut quits = Changes(|frame, world| {
        if frame == 1 {
            world.quit();
        }
        Ok(())
    });
    let ended = |app: &mut dyn App, more: &[&str]| run_still(app, folder.path(), more);
    assert_eq!(ended(&mut quits, &[]), ExitCode::SUCCESS);
    assert_eq!(exrs(folder.path()).len(), 4);
    // Before the frames that are asked for come.
    let range = ["--range=3..4", "--warm-up=0"];
    assert_eq!(ended(&mut quits, &range), ExitCode::SUCCESS);
    assert_eq!(exrs(folder.path()).len(), 0);
    let mut fails = Changes(|frame, world| {
        if frame == 1 {
            world.node("tall blok")?;
        }
        Ok(())
    });
    assert_eq!(ended(&mut fails, &[]), ExitCode::from(1));
    assert_eq!(exrs(folder.path()).len(), 2);
    struct Lacks;
    impl App for Lacks {
        fn start(&mut self, world: &mut World) -> Result<(), AppError> {
            let error = world.node("tall blok").unwrap_err().to_string();
            let nearest = "the scene has no node 'tall blok'; the nearest is 'tall block'";
            assert_eq!(error, nearest);
            world.node("tall blok")?;
            Ok(())
        }
        fn update(&mut self, _: &FrameInput, _: &mut World) -> Result<(), AppError> {
            Ok(())
        }
    }
    for more in [&[][..], &["--speed=3"]] {
        assert_eq!(ended(&mut Lacks, more), ExitCode::from(2), "{more:?}");
    }
}

/// Starts a clip, then puts a node that it does not drive elsewhere in a frame whose panels ask for another renderer.
#[derive(Default)]
struct Elsewhere {
    is_met: bool,
}

impl App for Elsewhere {
    fn update(&mut self, frame: &FrameInput, world: &mut World) -> Result<(), AppError> {
        let scene = world.scene();
        let clip = &scene.animations[0];
        let is_own = |node: &usize| {
            let own = &scene.nodes[*node];
            let is_alone = own.parent.is_none() && own.children.is_empty() && own.skin.is_none();
            is_alone && own.mesh.is_some() && !clip.nodes.iter().any(|track| track.node == *node)
        };
        let node = (0..scene.nodes.len()).find(is_own).ok_or("no such node")?;
        let name = clip.name.clone();
        match frame.frame {
            0 => world.play_clip(&name, 1.0, 0.0)?,
            2 => {
                world.place(node, DAffine3::from_translation(50.0 * DVec3::X))?;
                for name in ["one", "another"] {
                    let panel = PanelSpec {
                        name: name.to_owned(),
                        world_from_panel: Pose::new(100.0 * DVec3::Y, DQuat::IDENTITY),
                        width_m: 0.3,
                        pixels: [16, 16],
                        radiance: 1.0,
                    };
                    world.add_panel(&panel)?;
                }
            }
            4 => {
                assert_eq!(world.clip().map(|(name, _)| name.to_owned()), Some(name));
                let middle = world.center_in_world(node)?;
                let meets = |at: i32| {
                    let aside = DVec3::new(f64::from(at % 30 - 15), 100.0, f64::from(at / 30 - 15));
                    let from = middle + aside * DVec3::new(0.1, 0.2, 0.1);
                    let hit = world.cast_ray(from, DVec3::NEG_Y, 60.0, &[]);
                    hit.is_some_and(|hit| hit.node == Some(node))
                };
                self.is_met = (0..900).any(meets);
            }
            _ => {}
        }
        Ok(())
    }
}

#[test]
fn a_clip_that_goes_on_in_another_renderer_leaves_edited_nodes_where_they_were_put() {
    let folder = support::Folder::new("elsewhere");
    let mut app = Elsewhere::default();
    let more = words("--scene=builtin:parade --frames=6 --set animation.clip=none");
    run_well(&mut app, &[], folder.path(), &more);
    assert!(app.is_met);
}

/// A file that is loaded, or a scene that is made, added in frame 1 and taken out in frame 3.
#[derive(Default)]
struct Comes {
    file: &'static str,
    is_early: bool,
    loading: Option<PartLoading>,
    part: Option<ScenePart>,
}

impl Comes {
    fn begin(&self, world: &mut World) -> PartLoading {
        match self.file.strip_prefix("builtin:") {
            Some(name) => world.make_part(move || Ok(Scene::builtin(name)?)),
            None => world.load_part(self.file),
        }
    }
}

impl App for Comes {
    fn start(&mut self, world: &mut World) -> Result<(), AppError> {
        self.loading = self.is_early.then(|| self.begin(world));
        Ok(())
    }

    fn update(&mut self, frame: &FrameInput, world: &mut World) -> Result<(), AppError> {
        let at = DAffine3::from_scale(DVec3::splat(0.2));
        match frame.frame {
            0 if !self.is_early => {
                self.loading = Some(self.begin(world));
                let missing = world.load_part("no such file.gltf");
                let error = world.add_part(missing, "missing", at).unwrap_err();
                assert_eq!(error.to_string().lines().count(), 1);
                // Time enough to ask for the scene as it is before it changes.
                std::thread::sleep(std::time::Duration::from_millis(200));
            }
            1 => {
                let wall = world.material("white")?;
                world.change_material(wall, |white| white.base_color[1] = 0.2)?;
                let loading = self.loading.take().unwrap();
                let part = world.add_part(loading, "guest", at)?;
                assert_eq!(world.node("guest")?, part.root());
                self.part = Some(part);
            }
            3 => {
                let wall = world.material("white")?;
                let green = Scene::builtin("cornell")?.materials[wall].base_color[1];
                world.change_material(wall, |white| white.base_color[1] = green)?;
                let part = self.part.take().unwrap();
                if self.is_early {
                    // Its memory is still there to be given back.
                    world.remove(part.root())?;
                }
                world.remove_part(&part)?;
                assert!(world.remove_part(&part).is_err());
                assert!(world.node("guest").is_err());
            }
            _ => {}
        }
        Ok(())
    }
}

/// Glass is not compiled in for the box: it shows one frame later. Frames are those of a file that was loaded before there was a
/// renderer for which to prepare it.
#[test]
fn a_file_is_loaded_on_a_thread_and_comes_and_goes() {
    let folder = support::Folder::new("part_application");
    for (file, changes) in [
        ("assets/template/scene.gltf", [false, true, true, false]),
        // Its point light is not compiled in either.
        ("builtin:sphere", [false, false, true, false]),
        ("assets/caustic.glb", [false, false, true, false]),
    ] {
        let comes = |is_early| Comes {
            file,
            is_early,
            ..Comes::default()
        };
        assert_eq!(shows_change(&folder, &mut comes(false)), changes, "{file}");
        let early = folder.join("early");
        assert_eq!(run_still(&mut comes(true), &early, &[]), ExitCode::SUCCESS);
        let same = |frame| left(&early, frame) == left(&folder.join("with"), frame);
        // What a renderer was made with goes with it, one frame later.
        assert_eq!([0, 1, 2].map(same), [true; 3], "{file}");
    }
}

/// With filters, which ask where points were before: the scene has nothing yet that deforms.
#[test]
fn a_file_whose_meshes_deform_comes_to_a_scene_that_stands() {
    let folder = support::Folder::new("part_deforms");
    let run = |app: &mut dyn App, name: &str| {
        let out = folder.join(name);
        let still = ["--scene=builtin:cornell", "--frames=4", EVERY_FRAME];
        assert_eq!(run(app, &still, &out, &[]), ExitCode::SUCCESS);
        [1, 2].map(|frame| left(&out, frame))
    };
    let file = "assets/parade.glb";
    let [late, early] = [false, true].map(|is_early| {
        let mut app = Comes {
            file,
            is_early,
            ..Comes::default()
        };
        run(&mut app, if is_early { "early" } else { "late" })
    });
    assert!(late == early);
    let without = run(&mut nothing(), "without");
    assert!(strays(&late[1], &without[1], 1e-4) > 0);
}

/// What a scene may take and reach goes for parts as well.
#[test]
fn a_part_is_loaded_within_the_runs_limits() {
    let folder = support::Folder::new("part_limits");
    let mut app = Changes(|_, world| {
        let loading = world.load_part("assets/gallery.glb");
        let error = world.add_part(loading, "guest", DAffine3::IDENTITY);
        let error = error.unwrap_err().to_string();
        assert_says(&error, &["gallery.glb", "limits.load_memory"]);
        Ok(())
    });
    let little = ["--frames=1", "--set=limits.load_memory=0.001"];
    assert_eq!(
        run_still(&mut app, folder.path(), &little),
        ExitCode::SUCCESS
    );
}

/// Instances that come and go, nodes that are hidden, edits that cannot be.
#[test]
fn the_world_changes_by_name_and_refuses_what_cannot_be() {
    let folder = support::Folder::new("changed_world");
    let mut app = Changes(|frame, world| {
        let block = world.node("short block")?;
        match frame {
            1 => {
                let mesh = world.scene().nodes[block].mesh.unwrap();
                let at = DAffine3::from_translation(DVec3::new(0.0, 0.2, 0.0));
                let added = world.add("second", at, NewContent::Mesh(mesh))?;
                assert_eq!(world.node("second")?, added);
                world.set_visible(block, false)?;
            }
            2 => {
                let second = world.node("second")?;
                world.remove(second)?;
                world.set_visible(block, true)?;
                assert!(world.remove(second).is_err());
                assert!(world.place(999, DAffine3::IDENTITY).is_err());
                let not_finite = DAffine3::from_translation(DVec3::NAN);
                assert!(world.place(block, not_finite).is_err());
                assert!(world.edit(Edit::Delete { node: 999 }).is_err());
                let wall = world.material("white")?;
                let unknown = world.change_material(wall, |white| white.user_bsdf = 7);
                assert_says(
                    &unknown.unwrap_err().to_string(),
                    &["white", "BSDF number 7"],
                );
            }
            _ => {}
        }
        Ok(())
    });
    // What was undone leaves nothing behind.
    let changed = shows_change(&folder, &mut app);
    assert_eq!(changed, [false, true, false, false]);
}

/// Counts its ends; fails in a frame, or quits in it.
struct Ending {
    ends: u32,
    fails: bool,
}

impl App for Ending {
    fn update(&mut self, frame: &FrameInput, world: &mut World) -> Result<(), AppError> {
        match frame.frame {
            1 if self.fails => Err("it is over".into()),
            1 => {
                world.quit();
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn end(&mut self, world: &mut World) {
        // What an application keeps for its next start.
        assert!(world.quality().is_ok());
        self.ends += 1;
    }
}

#[test]
fn an_application_ends_once_however_the_loop_does() {
    let folder = support::Folder::new("application-ends");
    let still = ["--scene=builtin:plane", "--set=output.images=false"];
    for (fails, frames, status) in [(false, 1, 0), (false, 4, 0), (true, 4, 1)] {
        let mut app = Ending { ends: 0, fails };
        let frames = format!("--frames={frames}");
        let found = run(&mut app, &still, folder.path(), &[&frames]);
        assert_eq!(
            (found, app.ends),
            (ExitCode::from(status), 1),
            "{frames}, fails {fails}"
        );
    }
}

/// What `stereolux new` writes, and its recording replayed by its own code: the cube goes with the hand. Cargo's part, building the crate, is not repeated here: it takes minutes.
#[test]
fn the_crate_that_new_writes_has_what_its_test_needs() {
    let folder = support::Folder::new("new-crate");
    let made = folder.join("my-app");
    let new = |more: &[&str]| {
        let args = ["new", made.to_str().unwrap()];
        support::stereolux(&[&args[..], more].concat())
    };
    let checkout = env!("CARGO_MANIFEST_DIR");
    for path in [
        "nowhere",
        concat!(env!("CARGO_MANIFEST_DIR"), "/crates/bvh"),
    ] {
        let output = new(&["--path", path]);
        assert_eq!(output.status.code(), Some(2));
        assert_eq!(support::stderr(&output).lines().count(), 1);
        assert!(!made.exists());
    }
    // By itself it takes the sources that the program was built from.
    assert_eq!(new(&[]).status.code(), Some(0));
    let manifest = std::fs::read_to_string(made.join("Cargo.toml")).unwrap();
    let manifest: toml::Table = manifest.parse().unwrap();
    assert_eq!(manifest["package"]["name"].as_str(), Some("my-app"));
    let path = &manifest["dependencies"]["stereolux"]["path"];
    assert_eq!(path.as_str(), Some(checkout));
    assert!(made.join("Cargo.lock").is_file() && made.join(".gitignore").is_file());
    let test = std::fs::read_to_string(made.join("tests/replay.rs")).unwrap();
    assert!(test.contains("CARGO_BIN_EXE_my-app"));
    // A name may be like a word of the template.
    let odd = folder.join("STEREOLUX-NAME");
    support::assert_success(&support::stereolux(&["new", odd.to_str().unwrap()]));
    let manifest = std::fs::read_to_string(odd.join("Cargo.toml")).unwrap();
    let manifest: toml::Table = manifest.parse().unwrap();
    assert_eq!(manifest["package"]["name"].as_str(), Some("STEREOLUX-NAME"));
    let path = &manifest["dependencies"]["stereolux"]["path"];
    assert_eq!(path.as_str(), Some(checkout));
    // Not over what is there, and not under a name that no crate has.
    assert_eq!(new(&[]).status.code(), Some(2));
    for name in ["9lives", "my app", "test", ".."] {
        let output = support::stereolux(&["new", folder.join(name).to_str().unwrap()]);
        assert_eq!(output.status.code(), Some(2), "{name}");
    }
    let files = folder.files();
    assert!(!files.iter().any(|f| f.contains(".part")), "{files:?}");

    let [scene, trace] = ["scene.gltf", "recording.jsonl"].map(|name| made.join(name));
    let out = folder.join("replayed");
    let mut app = Watched {
        inner: template::PickUp::default(),
        node: "cube",
        seen: Vec::new(),
    };
    let scene = with_trace("scene", &scene);
    run_well(&mut app, &[&scene], &out, &[&with_trace("trace", &trace)]);
    let place = |frame: usize| app.seen[frame].1.translation;
    // Taken at frame 3 (0.0333 s) and let go at 14 (0.156 s), when the hand has gone all its way, by 0.14 s.
    let moved = place(15) - place(0);
    let off = (moved - DVec3::new(0.4, 0.1, 0.0)).length();
    assert!(off < 1e-6, "{moved}");
    assert_eq!(place(2), place(0));
}
