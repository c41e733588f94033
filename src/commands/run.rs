//! `run` and `render`: both are the frame loop, `render` over one frame of a still headset.

use std::path::Path;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

use super::{Failure, load_scene, report};
use crate::frame::user_passes::shader_library;
use crate::frame_loop::{self, FrameStats, LoopOptions, LoopProgress};
use crate::gpu::GpuContext;
use crate::interrupt;
use crate::mirror::{Mirror, MirrorWindow};
use crate::options::{RenderOptions, RunOptions, SessionChoice, TraceOptions};
use crate::output::OutputFolder;
use crate::renderer::Renderer;
use crate::scene::{Needs, Scene};
use crate::settings::{Eyes, Settings};
use crate::xr::{
    Headset, Motion, Pacing, Pose, Recorder, ReplayOptions, ReplaySession, SimulatedSession,
    Validated, XrSession,
};

/// Frames of a simulated run without `--frames`.
const SIMULATED_FRAMES: u64 = 100;

/// A session, and the device if the session dictates it.
struct Source {
    session: Box<dyn XrSession>,
    context: Option<GpuContext>,
    /// Where the views come from, for people.
    name: String,
    /// Said on stderr when the run begins.
    announcement: Option<String>,
    size: [u32; 2],
}

/// The stereo frame loop.
pub fn run(options: &RunOptions) -> Result<(), Failure> {
    let mut settings = options.settings.clone();
    settings.render.decide_reconstruction(true);
    let settings = &settings;
    let headset = headset(settings)?;
    let scene = load_scene(settings)?;
    let start = scene.start_pose();
    OutputFolder::check(&options.shared.out)?;
    // Before a session is opened: without a display there is nothing to close again.
    let window = options
        .session
        .mirror
        .then(MirrorWindow::open)
        .transpose()?;
    let source = source(options, &headset, start)?;
    interrupt::catch();
    render_session(
        source,
        &Job {
            scene: &scene,
            settings,
            eyes: Eyes::Both,
            every: options.session.every,
            frames: options.session.frames,
            out: &options.shared.out,
            record: options.session.record.as_deref(),
        },
        window,
    )
}

/// One stereo pair from one pose.
pub fn render(options: &RenderOptions) -> Result<(), Failure> {
    let mut settings = options.settings.clone();
    settings.render.decide_reconstruction(false);
    let settings = &settings;
    let mut headset = headset(settings)?;
    if let Some(ipd_m) = options.view.ipd {
        headset = headset.with_ipd(ipd_m)?;
    }
    if let Some(fov) = options.view.fov {
        headset = headset.with_fov(fov)?;
    }
    let scene = load_scene(settings)?;
    let pose = options.view.pose.unwrap_or_else(|| scene.start_pose());
    let size = settings.size.unwrap_or(headset.size);
    let session = SimulatedSession::new(headset, Motion::Still, pose, Some(1));
    render_session(
        Source {
            session: Box::new(session),
            context: None,
            name: "one pose".to_owned(),
            announcement: None,
            size,
        },
        &Job {
            scene: &scene,
            settings,
            eyes: options.view.eyes,
            every: 1,
            frames: Some(1),
            out: &options.shared.out,
            record: None,
        },
        None,
    )
}

/// What both commands ask of the frame loop.
struct Job<'a> {
    scene: &'a Scene,
    settings: &'a Settings,
    eyes: Eyes,
    every: u32,
    frames: Option<u32>,
    out: &'a Path,
    record: Option<&'a Path>,
}

fn headset(settings: &Settings) -> Result<Headset, Failure> {
    Ok(Headset::load(&settings.headset)?)
}

/// Opens the session that the options ask for.
fn source(options: &RunOptions, headset: &Headset, start: Pose) -> Result<Source, Failure> {
    let unavailable = match options.session.choice {
        SessionChoice::Openxr | SessionChoice::Auto => match openxr_source(options, start) {
            Ok(mut source) => {
                if options.session.choice == SessionChoice::Auto {
                    source.announcement = Some(format!("session: {}", source.name));
                }
                return Ok(source);
            }
            Err(failure) if options.session.choice == SessionChoice::Openxr => return Err(failure),
            Err(failure) => Some(failure.message),
        },
        SessionChoice::Simulated | SessionChoice::Replay => None,
    };
    let (session, name) = session(options, headset, start)?;
    let size = options
        .settings
        .size
        .or(session.info().recommended_size)
        .unwrap_or(headset.size);
    Ok(Source {
        session,
        context: None,
        announcement: unavailable.map(|reason| format!("session: {name}; {reason}")),
        name,
        size,
    })
}

#[cfg(not(target_vendor = "apple"))]
fn openxr_source(options: &RunOptions, start: Pose) -> Result<Source, Failure> {
    use crate::xr::openxr::{OpenXrSession, Runtime, SessionOptions};

    let settings = &options.settings;
    let runtime = Runtime::find()?;
    let size = runtime.size(settings.size)?;
    let wanted = Some(settings.adapter.as_str()).filter(|name| !name.is_empty());
    let context = runtime.open_device(wanted)?;
    let session = OpenXrSession::create(
        runtime,
        &context,
        SessionOptions {
            size,
            start,
            frame_limit: options.session.frames.map(u64::from),
            settings: settings.openxr.clone(),
        },
    )?;
    if let Some((format, with_depth)) = session.image_format() {
        log::info!(
            "OpenXR images: {format:?}, {}",
            if with_depth { "with depth" } else { "no depth" }
        );
    }
    let name = session.info().source.clone();
    Ok(Source {
        session: Box::new(Validated::new(session)),
        context: Some(context),
        name,
        announcement: None,
        size,
    })
}

#[cfg(target_vendor = "apple")]
fn openxr_source(_: &RunOptions, _: Pose) -> Result<Source, Failure> {
    Err(Failure::failed(
        "no OpenXR runtime for Metal exists; use --session simulated",
    ))
}

fn session(
    options: &RunOptions,
    headset: &Headset,
    start: Pose,
) -> Result<(Box<dyn XrSession>, String), Failure> {
    let pacing = if options.session.realtime {
        Pacing::RealTime
    } else {
        Pacing::AsFastAsPossible
    };
    match (options.session.choice, &options.session.recording.trace) {
        (SessionChoice::Replay, Some(path)) => {
            let mut replay = replay_options(&options.session.recording, headset.clone(), start);
            replay.frame_limit = options.session.frames.map(u64::from);
            replay.pacing = pacing;
            let session = ReplaySession::open(path, replay)?;
            let source = session.info().source.clone();
            Ok((Box::new(Validated::new(session)), source))
        }
        (SessionChoice::Replay, None) => Err(Failure::unusable(
            "--session replay needs a recording: give one with --trace FILE",
        )),
        (SessionChoice::Auto | SessionChoice::Openxr | SessionChoice::Simulated, _) => {
            let frames = options.session.frames.map_or(SIMULATED_FRAMES, u64::from);
            let settings = &options.settings;
            let motion = settings.simulated.motion;
            let session = SimulatedSession::new(headset.clone(), motion, start, Some(frames))
                .with_seed(u64::from(settings.render.seed))
                .with_pacing(pacing);
            let source = session.info().source.clone();
            Ok((Box::new(session), source))
        }
    }
}

/// How a recording is read.
pub(super) fn replay_options(trace: &TraceOptions, headset: Headset, start: Pose) -> ReplayOptions {
    ReplayOptions {
        up: trace.trace_up,
        body: trace.trace_body,
        recenter: trace.trace_recenter,
        ..ReplayOptions::new(headset, start)
    }
}

fn render_session(
    source: Source,
    job: &Job<'_>,
    window: Option<MirrorWindow>,
) -> Result<(), Failure> {
    let settings = job.settings;
    let Source {
        session,
        context,
        name,
        announcement,
        size,
    } = source;
    OutputFolder::check(job.out)?;
    let context = match context {
        Some(context) => context,
        None => GpuContext::open(Some(&settings.adapter))?,
    };
    let mut mirror = window
        .map(|window| Mirror::new(window, &context))
        .transpose()?;
    if context.adapter.is_software() {
        log::info!(
            "{} computes on the CPU: timings are not a GPU's",
            context.adapter.name
        );
    }
    let passes = &settings.render.user_passes;
    let library = shader_library(&settings.gpu.shader_folder, passes).map_err(Failure::unusable)?;
    let needs = Needs::of(job.scene);
    let mut bar = Bar::new(settings.render.spp, job.frames);
    bar.say("compiling");
    let hidden = session.info().hidden.clone();
    let mut renderer = Renderer::with_hidden_area(
        context,
        &library,
        job.scene,
        &settings.render,
        job.eyes,
        size,
        hidden.as_ref(),
    )?;
    // Everything that can be refused has been; only now do files appear.
    let mut session: Box<dyn XrSession> = match job.record {
        Some(path) => Box::new(Recorder::create(path, session)?),
        None => session,
    };
    let mut output = OutputFolder::create(job.out)?;
    if let Some(line) = &announcement {
        bar.print(line);
    }
    let outcome = frame_loop::run(
        session.as_mut(),
        &mut renderer,
        &library,
        &mut output,
        LoopOptions {
            every: job.every,
            images: settings.output.images,
            exposure: settings.render.output.exposure,
            size,
        },
        &mut bar,
        mirror.as_mut(),
    );
    // The window goes at once, also while files are still written.
    if let Some(mirror) = mirror {
        mirror.close();
    }
    bar.finish();
    let outcome = outcome?;
    let run = report::RunReport::new(
        settings,
        &renderer,
        job.scene,
        &needs,
        &name,
        session.info(),
        size,
        &outcome,
    );
    output.write_run(&run)?;
    eprintln!("{}", run.summary_line(output.path()));
    if interrupt::requested() {
        return Err(Failure::failed(format!(
            "interrupted after {} frames; files written so far are complete",
            outcome.frames
        )));
    }
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

    fn print(&self, line: &str) {
        self.bar.suspend(|| eprintln!("{line}"));
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
