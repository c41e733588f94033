//! `run` and `render`: both are the frame loop, `render` over one frame of a still headset.

use std::path::Path;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

use super::{Failure, load_scene, report};
use crate::frame_loop::{self, FrameStats, LoopOptions, LoopProgress};
use crate::gpu::{GpuContext, ShaderLibrary};
use crate::options::{
    Eyes, Motion as MotionSetting, RenderOptions, RunOptions, SessionChoice, Settings,
    TraceBody as TraceBodyOption, TraceUp as TraceUpOption,
};
use crate::output::OutputFolder;
use crate::renderer::Renderer;
use crate::scene::{Needs, Scene};
use crate::xr::{
    Headset, Motion, Pacing, Pose, Recorder, ReplayOptions, ReplaySession, SimulatedSession,
    TraceBody, TraceUp, Validated, XrSession,
};

/// Frames of a simulated run without `--frames`.
const SIMULATED_FRAMES: u64 = crate::options::resolve::SIMULATED_FRAMES as u64;

/// The stereo frame loop.
pub fn run(options: &RunOptions) -> Result<(), Failure> {
    let settings = &options.settings;
    let headset = headset(settings)?;
    let scene = load_scene(settings)?;
    let start = start_pose(&scene);
    let (session, source): (Box<dyn XrSession>, String) = session(options, &headset, start)?;
    let context = GpuContext::open(Some(&settings.adapter))?;
    let output = OutputFolder::create(&options.out)?;
    let size = settings
        .size
        .or(session.info().recommended_size)
        .unwrap_or(headset.size);
    let session: Box<dyn XrSession> = match &options.record {
        Some(path) => Box::new(Recorder::create(path, session)?),
        None => session,
    };
    render_session(
        context,
        session,
        &source,
        &scene,
        settings,
        Eyes::Both,
        size,
        options.every,
        options.frames,
        output,
    )
}

/// One stereo pair from one pose.
pub fn render(options: &RenderOptions) -> Result<(), Failure> {
    let settings = &options.settings;
    let mut headset = headset(settings)?;
    if let Some(ipd_m) = options.ipd_m {
        headset = headset.with_ipd(ipd_m)?;
    }
    if let Some(fov) = options.fov {
        headset = headset.with_fov(
            fov.left_rad.to_degrees(),
            fov.right_rad.to_degrees(),
            fov.up_rad.to_degrees(),
            fov.down_rad.to_degrees(),
        )?;
    }
    let scene = load_scene(settings)?;
    let pose = match &options.pose {
        Some(pose) => Pose::new(pose.position, pose.orientation),
        None => start_pose(&scene),
    };
    let context = GpuContext::open(Some(&settings.adapter))?;
    let output = OutputFolder::create(&options.out)?;
    let size = settings.size.unwrap_or(headset.size);
    let session = SimulatedSession::new(headset, Motion::Still, pose, Some(1));
    render_session(
        context,
        Box::new(session),
        "one pose",
        &scene,
        settings,
        options.eyes,
        size,
        1,
        Some(1),
        output,
    )
}

fn start_pose(scene: &Scene) -> Pose {
    let pose = scene.start_pose();
    Pose::new(pose.position, pose.orientation)
}

fn headset(settings: &Settings) -> Result<Headset, Failure> {
    Ok(Headset::load(&settings.headset)?)
}

fn session(
    options: &RunOptions,
    headset: &Headset,
    start: Pose,
) -> Result<(Box<dyn XrSession>, String), Failure> {
    let pacing = if options.realtime {
        Pacing::RealTime
    } else {
        Pacing::AsFastAsPossible
    };
    match (options.session, &options.trace) {
        (SessionChoice::Replay, Some(trace)) => {
            let mut replay = ReplayOptions::new(headset.clone(), start);
            replay.up = trace.up.map(|up| match up {
                TraceUpOption::Y => TraceUp::Y,
                TraceUpOption::Z => TraceUp::Z,
            });
            replay.body = trace.body.map(|body| match body {
                TraceBodyOption::Openxr => TraceBody::OpenXr,
                TraceBodyOption::Optical => TraceBody::Optical,
                TraceBodyOption::EyeFromBody(rotation) => TraceBody::Quaternion(rotation),
            });
            replay.recenter = trace.recenter;
            replay.frame_limit = options.frames.map(u64::from);
            replay.pacing = pacing;
            let session = ReplaySession::open(&trace.path, replay)?;
            let source = session.info().source.clone();
            Ok((Box::new(Validated::new(session)), source))
        }
        (SessionChoice::Replay, None) => Err(Failure::unusable(
            "--session replay needs a recording: give one with --trace FILE",
        )),
        (SessionChoice::Openxr, _) => Err(Failure::failed(
            "--session openxr: this version cannot drive an OpenXR runtime yet; use --session simulated or --trace FILE",
        )),
        (choice @ (SessionChoice::Auto | SessionChoice::Simulated), _) => {
            if choice == SessionChoice::Auto {
                eprintln!(
                    "session: simulated headset (this version cannot drive an OpenXR runtime yet)"
                );
            }
            let frames = options.frames.map_or(SIMULATED_FRAMES, u64::from);
            let motion = match options.settings.simulated.motion {
                MotionSetting::Still => Motion::Still,
                MotionSetting::Yaw => Motion::YawSweep,
                MotionSetting::Walk => Motion::Walk,
                MotionSetting::Sway => Motion::Sway {
                    seed: u64::from(options.settings.seed),
                },
            };
            let session = SimulatedSession::new(headset.clone(), motion, start, Some(frames))
                .with_pacing(pacing);
            let source = session.info().source.clone();
            Ok((Box::new(session), source))
        }
    }
}

#[expect(
    clippy::too_many_arguments,
    reason = "both commands' meeting point, called twice"
)]
fn render_session(
    context: GpuContext,
    mut session: Box<dyn XrSession>,
    source: &str,
    scene: &Scene,
    settings: &Settings,
    eyes: Eyes,
    size: [u32; 2],
    every: u32,
    frames: Option<u32>,
    mut output: OutputFolder,
) -> Result<(), Failure> {
    if context.adapter.is_software() {
        log::info!(
            "{} computes on the CPU: timings are not a GPU's",
            context.adapter.name
        );
    }
    let library = match settings.gpu.shader_folder.as_str() {
        "" => ShaderLibrary::embedded(),
        folder => ShaderLibrary::with_folder(Path::new(folder)).map_err(Failure::unusable)?,
    };
    let needs = Needs::of(scene);
    let mut bar = Bar::new(settings.spp, frames);
    bar.say("compiling");
    let mut renderer = Renderer::new(context, &library, scene, settings, eyes, size)?;
    let stats = frame_loop::run(
        session.as_mut(),
        &mut renderer,
        &mut output,
        LoopOptions {
            every,
            images: settings.output.images,
            exposure: settings.output.exposure,
            size,
        },
        &mut bar,
    );
    bar.finish();
    let stats = stats?;
    let run = report::RunReport::new(
        settings,
        &renderer,
        scene,
        &needs,
        source,
        session.info(),
        size,
        &stats,
    );
    output.write_run(&run)?;
    eprintln!("{}", run.summary_line(output.path()));
    Ok(())
}

/// Progress on stderr, if that is a terminal.
struct Bar {
    bar: ProgressBar,
    samples: u32,
}

impl Bar {
    fn new(samples: u32, frames: Option<u32>) -> Self {
        let bar = match frames {
            Some(frames) => ProgressBar::new(u64::from(frames) * u64::from(samples)),
            None => ProgressBar::no_length(),
        };
        if let Ok(style) =
            ProgressStyle::with_template("{elapsed_precise} {wide_bar} {pos}/{len} {eta} {msg}")
        {
            bar.set_style(style);
        }
        bar.enable_steady_tick(Duration::from_millis(250));
        Self { bar, samples }
    }

    fn say(&self, message: &'static str) {
        self.bar.set_message(message);
    }

    fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

impl LoopProgress for Bar {
    fn sample(&mut self, frame: u32, done: u32) {
        self.bar
            .set_position(u64::from(frame) * u64::from(self.samples) + u64::from(done));
    }

    fn frame(&mut self, stats: &FrameStats) {
        self.bar.set_message(format!(
            "frame {}: {:.1} ms, reuse {:.2}",
            stats.frame, stats.gpu_ms.total, stats.stereo.reuse_fraction
        ));
    }
}
