//! A loop of one's own, with the renderer in hand: the tall block of the Cornell box turns while a head looks around.
//! An application that only wants to change the scene is shorter: examples/minimal.rs.
//!
//! `cargo run --release --example own_loop` renders ten frames for a simulated headset and writes the last one to
//! out/own_loop.png; `cargo run --release --example own_loop -- openxr` runs on a headset until it is taken off.

use std::error::Error;
use std::path::Path;

use glam::{DAffine3, DQuat, DVec3};
use stereolux::{
    Eye, FrameInput, FrameLoop, GpuContext, Headset, Image, ImageRgb8, Motion, Pose,
    RenderSettings, Renderer, Scene, ShaderLibrary, SimulatedSession, XrSession,
    disable_device_select_layer, tone_map, write_png,
};

/// How fast the block turns.
const TURNS_PER_S: f64 = 0.25;

/// Runs until the session ends and returns what was seen last, left and right.
pub fn run<S: XrSession>(
    gpu: GpuContext,
    session: S,
    settings: &RenderSettings,
    size: [u32; 2],
) -> Result<ImageRgb8, Box<dyn Error>> {
    let scene = Scene::builtin("cornell")?;
    let block = scene
        .nodes
        .iter()
        .position(|node| node.name == "tall block");
    let block = block.ok_or("the scene has no tall block")?;
    let middle = DVec3::new(-0.368, 0.0, -0.351);

    let shaders = ShaderLibrary::embedded();
    let mut frames = FrameLoop::new(gpu, shaders, session, &scene, settings, size)?;
    let turn = |renderer: &mut Renderer, frame: &FrameInput| {
        let turns = TURNS_PER_S * frame.time_s();
        let rotation = DAffine3::from_quat(DQuat::from_rotation_y(turns * std::f64::consts::TAU));
        let world_from_block =
            DAffine3::from_translation(middle) * rotation * DAffine3::from_translation(-middle);
        if let Some(instance) = renderer.instance_of_node(block) {
            renderer.set_instance_transform(instance, world_from_block);
        }
    };
    while let Some(frame) = frames.next_frame(turn)? {
        println!(
            "frame {}: {:.1} ms, {:.0} % of the right eye reused",
            frame.frame,
            frame.cpu_ms.frame,
            100.0 * frame.stereo.reuse_fraction
        );
    }
    let eye = |eye| -> Result<ImageRgb8, Box<dyn Error>> {
        let pixels = frames.renderer().read_radiance(eye)?.ok_or("no image")?;
        Ok(tone_map(&Image::new(size[0], size[1], pixels)?, 1.0))
    };
    Ok(Image::side_by_side(&eye(Eye::Left)?, &eye(Eye::Right)?)?)
}

/// On the headset of the OpenXR runtime.
#[cfg(not(target_vendor = "apple"))]
fn on_headset(settings: &RenderSettings, start: Pose) -> Result<ImageRgb8, Box<dyn Error>> {
    use stereolux::{
        Actions, OpenXrOptions, OpenXrRuntime, OpenXrSession, OpenXrSettings, Validated,
    };
    let runtime = OpenXrRuntime::find()?;
    let (size, gpu) = (runtime.recommended_size(), runtime.open_device(None)?);
    let options = OpenXrOptions {
        size,
        start,
        frame_limit: None,
        settings: OpenXrSettings::default(),
        passthrough: false,
        actions: Actions::default(),
    };
    let session = OpenXrSession::create(runtime, &gpu, options)?;
    run(gpu, Validated::new(session), settings, size)
}

fn main() -> Result<(), Box<dyn Error>> {
    disable_device_select_layer();
    let settings = RenderSettings::default();
    let start = Scene::builtin("cornell")?.start_pose();
    let picture = match std::env::args().nth(1).as_deref() {
        #[cfg(not(target_vendor = "apple"))]
        Some("openxr") => on_headset(&settings, start)?,
        _ => {
            let headset = Headset::load("quest3")?;
            let session = SimulatedSession::new(headset, Motion::Yaw, start, Some(10));
            run(GpuContext::open(None)?, session, &settings, [512, 512])?
        }
    };
    std::fs::create_dir_all("out")?;
    write_png(Path::new("out/own_loop.png"), &picture)?;
    Ok(())
}
