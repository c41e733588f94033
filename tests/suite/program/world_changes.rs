//! What an application changes while it runs: clips, surroundings, what is shown already, what is gone.

use glam::DAffine3;
use stereolux::{
    App, AppError, EditError, Environment, FrameInput, LightKind, NewContent, PunctualLight, World,
    WorldError, load_environment,
};

use super::application::{EVERY_FRAME, RAW, left, replays_to_the_bit, run_well};
use super::support::Folder;

/// Frames without history, and more.
fn raw<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&RAW[..], &[EVERY_FRAME], more].concat()
}

/// Puts other surroundings around the scene: at the start, or in a frame.
struct Surrounds {
    at: Option<u32>,
    with: fn() -> Environment,
}

impl App for Surrounds {
    fn start(&mut self, world: &mut World) -> Result<(), AppError> {
        if self.at.is_none() {
            world.set_surroundings((self.with)())?;
        }
        let mut bad = (self.with)();
        bad.radiance[0][1] = -1.0;
        let mut none = bad.clone();
        none.radiance.clear();
        for bad in [bad, none] {
            let refused = world.set_surroundings(bad);
            assert!(matches!(refused, Err(WorldError::Surroundings(_))));
        }
        Ok(())
    }

    fn update(&mut self, frame: &FrameInput, world: &mut World) -> Result<(), AppError> {
        if self.at == Some(frame.frame) {
            world.set_surroundings((self.with)())?;
        }
        Ok(())
    }
}

/// From the frame on in which they come, surroundings are those of a run that had them from the start, bit for bit: twice
/// as bright, and a map of another size.
#[test]
fn other_surroundings_are_those_of_a_run_that_began_with_them() {
    let brighter = || {
        let sky = load_environment("builtin:sky", 1.0).unwrap().0;
        sky.scaled(2.0)
    };
    let small = || Environment {
        width: 4,
        height: 2,
        radiance: (0..8).map(|texel| [0.1 * texel as f32, 0.5, 0.2]).collect(),
        name: "small".to_owned(),
    };
    let sky = "--set=environment.path=builtin:sky";
    let args = raw(&["--scene=builtin:cornell", sky, "--frames=3"]);
    let surroundings: [(&str, fn() -> Environment); 2] = [("brighter", brighter), ("small", small)];
    for (name, with) in surroundings {
        let folder = Folder::new(&format!("surroundings_{name}"));
        let [early, late] = ["early", "late"].map(|name| folder.join(name));
        for (at, out) in [(None, &early), (Some(1), &late)] {
            let mut app = Surrounds { at, with };
            run_well(&mut app, &[], out, &args);
        }
        assert_ne!(left(&early, 0), left(&late, 0), "{name}");
        for frame in 1..3 {
            assert!(left(&early, frame) == left(&late, frame), "{name}, {frame}");
        }
    }
}

/// Begins the clip anew in frame 2, lets it stand from frame 4 on, and goes back to where frame 3 had it in frame 6.
#[derive(Default)]
struct Clips {
    times_s: Vec<f64>,
}

impl App for Clips {
    fn update(&mut self, frame: &FrameInput, world: &mut World) -> Result<(), AppError> {
        let (name, _) = world.clip().ok_or("no clip plays")?;
        let name = name.to_owned();
        match frame.frame {
            2 => world.play_clip(&name, 2.0, 1.0)?,
            4 => world.stop_clip()?,
            6 => world.play_clip(&name, 0.0, 1.0 + 2.0 / 90.0)?,
            _ => {}
        }
        let refused = world.play_clip("no such clip", 1.0, 0.0).unwrap_err();
        assert!(matches!(refused, WorldError::Unknown { what: "clip", .. }));
        assert!(world.play_clip(&name, f64::NAN, 0.0).is_err());
        self.times_s.push(world.clip().ok_or("no clip plays")?.1);
        Ok(())
    }
}

const PARADE: &str = "--scene=builtin:parade";

/// Times at 90 Hz, each within 2 ns (display times are whole nanoseconds, speed is 2).
#[test]
fn a_clip_plays_stands_and_is_sought() {
    let folder = Folder::new("clips");
    let mut app = Clips::default();
    run_well(&mut app, &[], folder.path(), &raw(&[PARADE, "--frames=7"]));
    let period_s = 1.0 / 90.0;
    let third = 1.0 + 2.0 * period_s;
    let fourth = 1.0 + 4.0 * period_s;
    let expected = [0.0, period_s, 1.0, third, fourth, fourth, third];
    for (frame, (time_s, expected)) in app.times_s.iter().zip(expected).enumerate() {
        let error = (time_s - expected).abs();
        assert!(error < 4e-9, "frame {frame}: {time_s}, not {expected}");
    }
    let picture = |frame| left(folder.path(), frame);
    assert_ne!(picture(3), picture(4), "it plays");
    assert_ne!(picture(1), picture(2), "it is sought");
}

#[test]
fn clips_replay_to_the_bit() {
    replays_to_the_bit::<Clips>("clips_replay", &raw(&[PARADE]), 7);
}

/// Asks in every frame for what is shown already, or else for something new.
struct Asks {
    something_new: bool,
}

impl App for Asks {
    fn update(&mut self, frame: &FrameInput, world: &mut World) -> Result<(), AppError> {
        let block = world.node("short block")?;
        let material = world.material("white")?;
        let time = f32::from(frame.frame as u16);
        world.set_visible(block, true)?;
        world.change_material(material, |white| {
            if self.something_new {
                white.base_color[1] = 0.5 + 0.1 * time;
            }
        })?;
        Ok(())
    }
}

#[test]
fn what_is_shown_already_costs_no_photons() {
    for (something_new, frames) in [(false, 1), (true, 4)] {
        let folder = Folder::new(&format!("asks_{something_new}"));
        let args = [&RAW[..], &["--scene=builtin:cornell", "--frames=4"]].concat();
        run_well(&mut Asks { something_new }, &[], folder.path(), &args);
        let lines = std::fs::read_to_string(folder.join("stats.jsonl")).unwrap();
        let traced = lines.matches("\"photons.photon_trace\"").count();
        assert_eq!(traced, frames, "something new: {something_new}");
    }
}

/// Adds a lit node, removes it, and adds another of its name.
#[derive(Default)]
struct Replaces(bool);

impl App for Replaces {
    fn update(&mut self, _: &FrameInput, world: &mut World) -> Result<(), AppError> {
        let shot = |world: &mut World| {
            let spark = PunctualLight {
                name: "spark".to_owned(),
                kind: LightKind::Point,
                intensity: [1.0; 3],
            };
            world.add("shot", DAffine3::IDENTITY, NewContent::Light(spark))
        };
        let first = shot(world)?;
        world.remove(first)?;
        for (what, found) in [
            ("node", world.node("shot")),
            ("light", world.light("spark")),
        ] {
            assert!(matches!(found, Err(WorldError::Unknown { what: of, .. }) if of == what));
        }
        let gone: Result<(), WorldError> = Err(EditError::Gone {
            name: "shot".to_owned(),
        }
        .into());
        assert_eq!(world.set_visible(first, false), gone);
        assert_eq!(world.place(first, DAffine3::IDENTITY), gone);
        let second = shot(world)?;
        assert_eq!(world.node("shot")?, second);
        let light = world.light("spark")?;
        assert_eq!(world.scene().nodes[second].light, Some(light));
        self.0 = true;
        Ok(())
    }
}

#[test]
fn names_are_of_what_is_there() {
    let folder = Folder::new("replaces");
    let mut app = Replaces::default();
    run_well(
        &mut app,
        &[],
        folder.path(),
        &raw(&["--scene=builtin:cornell", "--frames=1"]),
    );
    assert!(app.0);
}
