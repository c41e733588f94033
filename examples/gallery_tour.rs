//! A tour of the embedded gallery: the right hand takes what it points at of the vase and the two spheres, the left stick dims
//! and brightens the spots, a button of the left hand switches day and night, one of the right hand teleports along an arc.
//! Which buttons these are on which controller stands in examples/gallery_tour_actions.toml; simulated hands hold Touch
//! controllers: trigger, left stick, Y, A.
//!
//! `cargo run --release --example gallery_tour -- --frames 24 --size 256x256` plays what simulated hands do and writes its
//! images to out/. The flags are those of `stereolux run`:
//! `--session openxr` for a headset, `--record FILE`, `--trace FILE`.

use std::process::ExitCode;

use glam::{DAffine3, DVec3};
use stereolux::{Actions, App, AppError, FrameInput, Side, World, run_app};

/// Scene and settings, unless the command line has others.
pub const DEFAULTS: &[&str] = &[
    "--scene=builtin:gallery",
    "--set=simulated.motion=still",
    "--set=simulated.hands=examples/gallery_tour_hands.toml",
];

/// What may be taken.
const THINGS: [&str; 3] = ["vase", "mirror sphere", "glass sphere"];
/// How far the hand reaches, metres.
const REACH_M: f64 = 6.0;
/// Windows and skylights at night, as a share of the day.
const MOONLIGHT: f32 = 0.02;
/// By how much the stick changes the spots in a second.
const DIM_PER_S: f64 = 4.0;

/// How fast an arc leaves the hand; along it the wearer teleports.
const THROW_M_PER_S: f64 = 4.0;

/// The application's state.
#[derive(Default)]
pub struct Tour {
    things: Vec<usize>,
    /// Materials that shine by day, and how.
    sky: Vec<(usize, [f32; 3])>,
    spots: Vec<usize>,
    is_night: bool,
    /// What is held, and where it is in the hand.
    held: Option<(usize, DAffine3)>,
}

impl Tour {
    /// Takes what the right hand points at, carries it, lets it go.
    fn carry(&mut self, frame: &FrameInput, world: &mut World) -> Result<(), AppError> {
        let (Some(grip), Some((origin, direction))) =
            (frame.hand(Side::Right).grip, frame.aim(Side::Right))
        else {
            return Ok(());
        };
        let world_from_grip = grip.pose.affine();
        if frame.action_pressed("take")?
            && let Some(hit) = world.cast_ray(origin, direction, REACH_M)
            && let Some(thing) = hit.node.filter(|node| self.things.contains(node))
        {
            let grip_from_thing = world_from_grip.inverse() * world.world_from_node(thing)?;
            self.held = Some((thing, grip_from_thing));
            world.vibrate_action("taken", 0.05, 0.5)?;
        }
        if frame.action_released("take")? {
            self.held = None;
        }
        if let Some((thing, grip_from_thing)) = self.held {
            world.place(thing, world_from_grip * grip_from_thing)?;
        }
        Ok(())
    }
}

/// Takes the wearer to where an arc from the right hand comes down, if one can stand there.
fn teleport(frame: &FrameInput, world: &mut World) -> Result<(), AppError> {
    if let Some((origin, direction)) = frame.aim(Side::Right)
        && let Some(landing) = world.cast_arc(origin, THROW_M_PER_S * direction)
        && landing.normal_in_world.y > 0.7
    {
        let way = landing.point_in_world - frame.head().position;
        world.move_wearer(DVec3::new(way.x, 0.0, way.z))?;
    }
    Ok(())
}

impl App for Tour {
    fn actions(&self) -> Result<Actions, AppError> {
        let text = include_str!("gallery_tour_actions.toml");
        Ok(Actions::parse("gallery_tour_actions.toml", text)?)
    }

    fn start(&mut self, world: &mut World) -> Result<(), AppError> {
        for name in THINGS {
            self.things.push(world.node(name)?);
        }
        for name in ["window light", "skylight"] {
            let material = world.material(name)?;
            let emission = world.scene().materials[material].emission;
            self.sky.push((material, emission));
        }
        for name in [
            "spot on the glass",
            "spot on the mirror",
            "spot on the vase",
        ] {
            self.spots.push(world.light(name)?);
        }
        Ok(())
    }

    fn update(&mut self, frame: &FrameInput, world: &mut World) -> Result<(), AppError> {
        self.carry(frame, world)?;
        if frame.action_pressed("teleport")? {
            teleport(frame, world)?;
        }
        if frame.action_pressed("day_and_night")? {
            self.is_night = !self.is_night;
            let share = if self.is_night { MOONLIGHT } else { 1.0 };
            for (material, day) in &self.sky {
                world.change_material(*material, |sky| sky.emission = day.map(|c| c * share))?;
            }
        }
        let brighten = frame.input.actions.float("brighten")?;
        if brighten.abs() > 0.2 {
            let seconds = frame.period_ns as f64 * 1e-9;
            let factor = (DIM_PER_S * brighten * seconds).exp() as f32;
            for spot in &self.spots {
                world.change_light(*spot, |light| {
                    light.intensity = light.intensity.map(|c| c * factor);
                })?;
            }
        }
        Ok(())
    }
}

fn main() -> ExitCode {
    run_app(&mut Tour::default(), DEFAULTS)
}
