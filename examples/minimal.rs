//! A whole application: the short block of the Cornell box is picked up with the right hand.
//!
//! `cargo run --release --example minimal -- --frames 12 --size 256x256` plays what simulated hands do and writes its images
//! to out/. The flags are those of `stereolux run`: `--session openxr` for a headset, `--record FILE` to keep what the wearer did, `--trace FILE` to see
//! it again, pixel by pixel.

use std::process::ExitCode;

use glam::DAffine3;
use stereolux::{App, AppError, Button, FrameInput, Side, World, run_app};

/// Scene and settings, unless the command line has others.
pub const DEFAULTS: &[&str] = &[
    "--scene=builtin:cornell",
    "--set=simulated.motion=still",
    "--set=simulated.hands=examples/minimal_hands.toml",
];

/// How near the hand must be to the block's middle to take it, metres.
const REACH_M: f64 = 0.15;

/// The application's state.
#[derive(Default)]
pub struct PickUp {
    block: usize,
    /// Where the block is in the hand, while it is held.
    grip_from_block: Option<DAffine3>,
}

impl App for PickUp {
    fn start(&mut self, world: &mut World) -> Result<(), AppError> {
        self.block = world.node("short block")?;
        Ok(())
    }

    fn update(&mut self, frame: &FrameInput, world: &mut World) -> Result<(), AppError> {
        let Some(grip) = frame.hand(Side::Right).grip else {
            return Ok(());
        };
        let world_from_grip = grip.pose.affine();
        if frame.pressed(Side::Right, Button::Squeeze) {
            let middle = world.center_in_world(self.block)?;
            if middle.distance(grip.pose.position) < REACH_M {
                let world_from_block = world.world_from_node(self.block)?;
                self.grip_from_block = Some(world_from_grip.inverse() * world_from_block);
                world.vibrate(Side::Right, 0.05, 0.5);
            }
        }
        if frame.released(Side::Right, Button::Squeeze) {
            self.grip_from_block = None;
        }
        if let Some(grip_from_block) = self.grip_from_block {
            world.place(self.block, world_from_grip * grip_from_block)?;
        }
        Ok(())
    }
}

fn main() -> ExitCode {
    run_app(&mut PickUp::default(), DEFAULTS)
}
