//! A tour of the embedded gallery: the right hand takes what it points at of the vase and the two spheres, the left stick dims
//! and brightens the spots, a button of the left hand switches day and night, one of the right hand teleports along an arc.
//! A panel has the frame's figures and switches day and night too, clicked by the trigger.
//! Which buttons these are on which controller stands in examples/gallery_tour_actions.toml; simulated hands hold Touch
//! controllers: trigger, left stick, Y, A.
//!
//! `cargo run --release --example gallery_tour -- --frames 24 --size 256x256` plays what simulated hands do and writes its
//! images to out/. The flags are those of `stereolux run`:
//! `--session openxr` for a headset, `--record FILE`, `--trace FILE`.

use std::process::ExitCode;

use glam::{DAffine3, DQuat, DVec3};
use stereolux::{
    Actions, App, AppError, FrameInput, Panel, PanelSpec, Pose, Side, World, egui, run_app,
};

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
    panel: Option<Panel>,
    /// How bright the spots are, as a share of the scene's.
    spots_share: f64,
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
            && let Some(hit) = world.cast_ray(origin, direction, REACH_M, &[])
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

impl Tour {
    /// Figures of the frame; true if its button was clicked. No time that a clock says: a replay shows the same.
    fn show_figures(&self, frame: &FrameInput, world: &mut World) -> Result<bool, AppError> {
        let Some(panel) = self.panel else {
            return Ok(false);
        };
        let head = frame.head().position;
        let quality = world.quality()?;
        let held = self.held.map(|(thing, _)| &world.scene().nodes[thing].name);
        let rows = [
            ("frame", frame.frame.to_string()),
            ("shown at", format!("{:.3} s", frame.time_s())),
            ("refresh", format!("{:.0} Hz", 1e9 / frame.period_ns as f64)),
            (
                "head",
                format!("{:.2}, {:.2}, {:.2} m", head.x, head.y, head.z),
            ),
            ("photons", quality.photons_per_frame.to_string()),
            ("triangles", world.scene().triangle_count().to_string()),
            ("spots", format!("{:.0} %", 100.0 * self.spots_share)),
            (
                "in the hand",
                held.map_or("nothing", |name| name).to_owned(),
            ),
        ];
        let label = if self.is_night { "Day" } else { "Night" };
        let mut is_clicked = false;
        world.panel(panel, |ui| {
            ui.heading("Gallery");
            egui::Grid::new("figures").striped(true).show(ui, |ui| {
                for (name, value) in &rows {
                    ui.label(*name);
                    ui.label(value);
                    ui.end_row();
                }
            });
            is_clicked |= ui.button(label).clicked();
        })?;
        Ok(is_clicked)
    }
}

/// Takes the wearer to where an arc from the right hand, past what that holds, comes down, if one can stand there.
fn teleport(frame: &FrameInput, world: &mut World, held: &[usize]) -> Result<(), AppError> {
    if let Some((origin, direction)) = frame.aim(Side::Right)
        && let Some(landing) = world.cast_arc(origin, THROW_M_PER_S * direction, held)
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
        self.spots_share = 1.0;
        self.panel = Some(world.add_panel(&PanelSpec {
            name: "figures".to_owned(),
            world_from_panel: Pose::new(DVec3::new(-0.1, 1.4, 4.4), DQuat::from_rotation_y(0.45)),
            width_m: 0.4,
            pixels: [240, 290],
            radiance: 3.0,
        })?);
        Ok(())
    }

    fn update(&mut self, frame: &FrameInput, world: &mut World) -> Result<(), AppError> {
        self.carry(frame, world)?;
        if frame.action_pressed("teleport")? {
            let held: Vec<usize> = self.held.iter().map(|(thing, _)| *thing).collect();
            teleport(frame, world, &held)?;
        }
        let is_clicked = self.show_figures(frame, world)?;
        if is_clicked || frame.action_pressed("day_and_night")? {
            self.is_night = !self.is_night;
            let share = if self.is_night { MOONLIGHT } else { 1.0 };
            for (material, day) in &self.sky {
                world.change_material(*material, |sky| sky.emission = day.map(|c| c * share))?;
            }
        }
        let brighten = frame.input.actions.float("brighten")?;
        if brighten.abs() > 0.2 {
            let seconds = frame.period_ns as f64 * 1e-9;
            let factor = (DIM_PER_S * brighten * seconds).exp();
            self.spots_share *= factor;
            for spot in &self.spots {
                world.change_light(*spot, |light| {
                    light.intensity = light.intensity.map(|c| c * factor as f32);
                })?;
            }
        }
        Ok(())
    }
}

fn main() -> ExitCode {
    run_app(&mut Tour::default(), DEFAULTS)
}
