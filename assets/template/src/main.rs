//! A headset application on stereolux: the right hand's squeeze picks up the cube.
//!
//! `cargo run -- --session openxr` runs it on a headset, `cargo run -- --session simulated --frames 30` with simulated
//! hands (hands.toml); images go to out/. `cargo run -- --help` lists the flags: those of `stereolux run`.

use std::process::ExitCode;

use stereolux::glam::DAffine3;
use stereolux::{App, AppError, Button, FrameInput, Side, World, run_app};

/// What the command line need not say.
const DEFAULTS: &[&str] = &[
    concat!("--scene=", env!("CARGO_MANIFEST_DIR"), "/scene.gltf"),
    concat!(
        "--set=simulated.hands=",
        env!("CARGO_MANIFEST_DIR"),
        "/hands.toml"
    ),
    "--set=simulated.motion=still",
];

/// How near the hand must be to the cube's middle, metres.
const REACH_M: f64 = 0.2;

/// The application's state.
#[derive(Default)]
pub struct PickUp {
    cube: usize,
    /// Where the cube is in the hand, while it is held.
    grip_from_cube: Option<DAffine3>,
}

impl App for PickUp {
    fn start(&mut self, world: &mut World) -> Result<(), AppError> {
        self.cube = world.node("cube")?;
        Ok(())
    }

    fn update(&mut self, frame: &FrameInput, world: &mut World) -> Result<(), AppError> {
        let Some(grip) = frame.hand(Side::Right).grip else {
            return Ok(());
        };
        let world_from_grip = grip.pose.affine();
        if frame.pressed(Side::Right, Button::Squeeze)
            && world
                .center_in_world(self.cube)?
                .distance(grip.pose.position)
                < REACH_M
        {
            let world_from_cube = world.world_from_node(self.cube)?;
            self.grip_from_cube = Some(world_from_grip.inverse() * world_from_cube);
            world.vibrate(Side::Right, 0.05, 0.5);
        }
        if frame.released(Side::Right, Button::Squeeze) {
            self.grip_from_cube = None;
        }
        if let Some(grip_from_cube) = self.grip_from_cube {
            world.place(self.cube, world_from_grip * grip_from_cube)?;
        }
        Ok(())
    }
}

fn main() -> ExitCode {
    run_app(&mut PickUp::default(), DEFAULTS)
}
