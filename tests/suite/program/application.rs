//! Applications as their users write them: the examples run, what they change is seen, and a recording drives them
//! through the same frames.

use std::path::Path;
use std::process::ExitCode;

use glam::{DAffine3, DVec3};
use stereolux::{App, AppError, Edit, FrameInput, NewContent, Side, World, run_app_with};
use stereolux::{Fov, Headset, ImageRgb8, Motion, RenderSettings, Scene, SimulatedSession};

use super::gallery_tour_example::{self as gallery_tour, Tour};
use super::minimal_example::{self as minimal, PickUp};
use super::{own_loop_example, support};

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
fn run(app: &mut dyn App, defaults: &[&str], out: &Path, more: &[&str]) -> ExitCode {
    let out = out.to_str().unwrap();
    let adapter = support::adapter_name();
    let fixed = [
        "application",
        "--session=simulated",
        "--size=32x32",
        "--photons=2048",
        "--adapter",
        adapter,
        "--out",
        out,
        "--headset=symmetric",
    ];
    // A replay brings its own views.
    let fixed = fixed.iter().filter(|word| {
        let replays = more.iter().any(|word| word.starts_with("--trace"));
        !(replays && word.starts_with("--session"))
    });
    let args = fixed.chain(more).map(std::ffi::OsString::from);
    run_app_with(app, defaults, args)
}

fn with_trace(word: &str, path: &Path) -> String {
    format!("--{word}={}", path.display())
}

/// Every image in the folder, by name.
fn images(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let files = std::fs::read_dir(folder).unwrap().map(Result::unwrap);
    let mut images: Vec<_> = files
        .filter(|file| file.path().extension().is_some_and(|kind| kind == "exr"))
        .map(|file| {
            (
                file.file_name().into_string().unwrap(),
                std::fs::read(file.path()).unwrap(),
            )
        })
        .collect();
    images.sort();
    images
}

/// Records a run, replays it, and compares the images of all frames.
fn replays_to_the_bit<A: App + Default>(name: &str, defaults: &[&str], frames: usize) {
    let folder = support::Folder::new(name);
    let [first, second, trace] =
        ["first", "second", "trace.jsonl"].map(|name| folder.path().join(name));
    let recorded = run(
        &mut A::default(),
        defaults,
        &first,
        &[&with_trace("record", &trace)],
    );
    assert_eq!(recorded, ExitCode::SUCCESS);
    // Without the hands' script: all that drives it is the recording.
    let bare: Vec<&str> = defaults
        .iter()
        .copied()
        .filter(|word| word.starts_with("--scene"))
        .collect();
    let replayed = run(
        &mut A::default(),
        &bare,
        &second,
        &[&with_trace("trace", &trace)],
    );
    assert_eq!(replayed, ExitCode::SUCCESS);
    let [recorded, replayed] = [&first, &second].map(|folder| images(folder));
    assert_eq!(recorded.len(), 2 * frames);
    assert!(recorded == replayed, "a replay has other images");
    assert_ne!(
        recorded[0].1,
        recorded[2 * frames - 2].1,
        "nothing has changed in the picture"
    );
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
    let silent = [
        "--set=output.images=false",
        "--set=simulated.hands=examples/minimal_hands.toml",
    ];
    assert_eq!(
        run(&mut app, minimal::DEFAULTS, folder.path(), &silent),
        ExitCode::SUCCESS
    );
    assert_eq!(app.seen.len(), 12);
    let whole = DVec3::new(0.1, 0.2, 0.05);
    for (frame, (grip, block)) in app.seen.iter().enumerate() {
        let seconds = frame.min(8) as f64 / 90.0;
        let share = ((seconds - 0.04) / 0.05).clamp(0.0, 1.0);
        let expected = whole * share;
        let moved = block.translation;
        assert!(
            (moved - expected).length() < 1e-6,
            "frame {frame}: {moved}, not {expected}"
        );
        // The hand goes on alone.
        let hand_moved = *grip - app.seen[2].0;
        let is_alone = (hand_moved - moved).length() > 1e-3;
        assert_eq!(
            is_alone,
            frame < 2 || frame > 8,
            "frame {frame}: {hand_moved}, {moved}"
        );
    }
}

/// Changes the scene in a frame by what it is told.
struct Changes(fn(u32, &mut World) -> Result<(), AppError>);

impl App for Changes {
    fn update(&mut self, frame: &FrameInput, world: &mut World) -> Result<(), AppError> {
        self.0(frame.frame, world)
    }
}

const STILL: &[&str] = &[
    "--scene=builtin:cornell",
    "--motion=still",
    "--frames=4",
    "--set=reconstruct.taa=false",
    "--set=reconstruct.svgf=false",
    "--set=reconstruct.still=false",
    // Photons of a frame are the same whenever the renderer was made.
    "--set=photon.every_frame=true",
];

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
    assert_eq!(run(&mut from_second, STILL, &late, &[]), ExitCode::SUCCESS);
    assert_eq!(run(&mut from_first, STILL, &early, &[]), ExitCode::SUCCESS);
    let [late, early] = [&late, &early].map(|folder| images(folder));
    let left = |images: &[(String, Vec<u8>)], frame: usize| images[2 * frame].1.clone();
    assert_eq!(left(&late, 0), left(&early, 0));
    assert!(
        left(&late, 1) != left(&early, 1),
        "the change of frame 0 shows in frame 1"
    );
    assert!(
        left(&late, 2) == left(&early, 2),
        "the change of frame 1 shows in frame 2"
    );
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
    assert_eq!(
        run(&mut quits, STILL, folder.path(), &[]),
        ExitCode::SUCCESS
    );
    assert_eq!(images(folder.path()).len(), 4);
    let mut fails = Changes(|frame, world| {
        if frame == 1 {
            world.node("tall blok")?;
        }
        Ok(())
    });
    assert_eq!(
        run(&mut fails, STILL, folder.path(), &[]),
        ExitCode::from(1)
    );
    assert_eq!(images(folder.path()).len(), 2);
    struct Lacks;
    impl App for Lacks {
        fn start(&mut self, world: &mut World) -> Result<(), AppError> {
            let error = world.node("tall blok").unwrap_err().to_string();
            assert_eq!(
                error,
                "the scene has no node 'tall blok'; the nearest is 'tall block'"
            );
            world.node("tall blok")?;
            Ok(())
        }
        fn update(&mut self, _: &FrameInput, _: &mut World) -> Result<(), AppError> {
            Ok(())
        }
    }
    assert_eq!(
        run(&mut Lacks, STILL, folder.path(), &[]),
        ExitCode::from(2)
    );
    let flag = run(&mut Lacks, STILL, folder.path(), &["--speed=3"]);
    assert_eq!(flag, ExitCode::from(2));
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
            }
            _ => {}
        }
        Ok(())
    });
    assert_eq!(run(&mut app, STILL, folder.path(), &[]), ExitCode::SUCCESS);
    let images = images(folder.path());
    let left = |frame: usize| &images[2 * frame].1;
    assert!(left(0) != left(1) && left(1) != left(2));
}
