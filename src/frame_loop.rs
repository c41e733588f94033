//! The frame loop: renders a session's views to images, statistics and files.
//!
//! The loop knows the session only through [`XrSession`]: it cannot tell a simulated headset from a replay or a
//! runtime. [`run`] is that of the program and of applications, with files and a mirror; who wants the renderer to
//! himself runs a [`FrameLoop`].

mod images;
mod stats;

use std::collections::VecDeque;
use std::ops::{ControlFlow, Range};
use std::time::Instant;

use crate::app::{AppError, Application, FrameInput, Held};
use crate::gpu::timing::milliseconds_since;
use crate::gpu::{GpuContext, HostSpan, ShaderLibrary};
use crate::images::ImageError;
use crate::mirror::Mirror;
use crate::output::{FrameFacts, OutputError, OutputFolder};
use crate::printable::line;
use crate::renderer::frames_in_flight::MOST;
use crate::renderer::{Flight, FrameResult, RenderError, Renderer};
use crate::scene::Scene;
use crate::settings::{Aov, Eyes, Quality, RenderSettings};
use crate::xr::{
    FrameState, FrameSubmission, LocatedViews, QualityFrom, RenderTargets, XrError, XrSession,
};

use images::read_aovs;
pub use images::{inspection, read_images};
pub use stats::{CpuMs, FrameStats, GpuSums};

/// Frames kept for the medians of `run.json`; a session may run for hours.
pub const KEPT_FRAMES: usize = 1000;

/// Result of a loop.
#[derive(Debug, Default)]
pub struct Outcome {
    /// Frames rendered.
    pub frames: usize,
    /// Statistics of the last of them, at most [`KEPT_FRAMES`].
    pub last: VecDeque<FrameStats>,
    /// How long the loop took, seconds of wall time.
    pub wall_s: f64,
}

/// Errors that end a loop.
#[derive(Debug, thiserror::Error)]
pub enum LoopError {
    /// The session.
    #[error(transparent)]
    Session(#[from] XrError),
    /// A pass or the device.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// A file.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// The application.
    #[error("application: {}", line(&.0.to_string()))]
    App(AppError),
}

impl From<ImageError> for LoopError {
    fn from(error: ImageError) -> Self {
        Self::Output(error.into())
    }
}

/// Options of a loop.
#[derive(Debug, Clone, Copy)]
pub struct LoopOptions<'a> {
    /// Frames of the session that are rendered, with how many before them for what they leave; `None`: all.
    pub range: Option<(&'a Range<u32>, u32)>,
    /// Images are written every this many frames.
    pub every: u32,
    /// Whether images are written at all.
    pub images: bool,
    /// Further layers of the images.
    pub aovs: &'a [Aov],
    /// Frames on their way to the device at once, 1 to 3.
    pub in_flight: usize,
}

/// What becomes of a frame of the session.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Role {
    /// It is not rendered.
    Skipped,
    /// It is rendered for the frames after it.
    WarmUp,
    /// It is rendered and written.
    Written,
    /// The loop ends before it.
    Last,
}

impl LoopOptions<'_> {
    fn role(&self, index: u32) -> Role {
        match self.range {
            None => Role::Written,
            Some((range, _)) if index >= range.end => Role::Last,
            Some((range, _)) if index >= range.start => Role::Written,
            // The first frame's photons serve all of a scene that stands still, and clips begin with it.
            Some((range, warm_up)) if index == 0 || range.start - index <= warm_up => Role::WarmUp,
            Some(_) => Role::Skipped,
        }
    }
}

/// Lets a frame of the session pass; the application sees it.
fn skip(
    session: &mut dyn XrSession,
    renderer: &mut Renderer,
    index: u32,
    application: &mut Application<'_>,
) -> Result<Step, LoopError> {
    let Some(state) = session.wait_frame()? else {
        return Ok(Step::Ended);
    };
    if state.switch_reuse {
        renderer.switch_reuse();
    }
    session.begin_frame()?;
    let time_ns = state.predicted_display_time_ns;
    let before = renderer.quality();
    if let Some(located) = session.locate_views(time_ns)? {
        let input = session.locate_input(time_ns)?;
        // Also where nothing is shown: rays are cast at what stands there.
        let frame = FrameInput::new(index, &state, &located, input);
        application.update(session, renderer, frame)?;
        renderer.flush_uploads();
    }
    let quality = settle_quality(renderer, &state, before)?;
    session.end_frame(FrameSubmission::new(time_ns, None).with_quality(quality))?;
    Ok(Step::Hidden)
}

/// Lets the recording have its way with the frame's quality, `before` being that from before the application's update; the
/// quality that was set in the frame, if one was.
fn settle_quality(
    renderer: &mut Renderer,
    state: &FrameState,
    before: Quality,
) -> Result<Option<Quality>, RenderError> {
    if let QualityFrom::Recording(recorded) = state.quality {
        renderer.set_quality(&recorded.unwrap_or(before))?;
        renderer.take_told_quality();
        return Ok(recorded);
    }
    Ok(renderer.take_told_quality())
}

/// Progress reports of a loop.
pub trait LoopProgress {
    /// `done` samples of frame `frame` are rendered.
    fn sample(&mut self, frame: u32, done: u32);
    /// A frame is finished.
    fn frame(&mut self, stats: &FrameStats);
}

/// Result of one iteration of the loop.
pub enum Step {
    /// The session has ended.
    Ended,
    /// The session shows nothing now, or has no pose; the frame was ended without images.
    Hidden,
    /// A frame was rendered and submitted; the renderer keeps its images until the next one.
    Rendered(Box<Rendered>),
}

/// A submitted frame. It may be on its way still ([`Rendered::retire`]).
pub struct Rendered {
    flight: Option<Flight>,
    /// Display time, nanoseconds.
    pub display_time_ns: i64,
    /// Views it was rendered with.
    pub located: LocatedViews,
    /// The renderer's result, once the frame is retired.
    pub result: FrameResult,
    /// Host times up to submission.
    pub cpu_ms: CpuMs,
    /// The host's stages, those of the renderer too.
    pub stages: Vec<HostSpan>,
    /// As in [`FrameStats`].
    pub pose_age_ms: f64,
    /// As in [`FrameStats`].
    pub host_waits: u64,
}

impl Rendered {
    /// Waits for the frame's end, unless that is known already, and takes over what the renderer reports of it.
    ///
    /// # Errors
    /// As [`Renderer::retire`].
    pub fn retire(&mut self, renderer: &mut Renderer) -> Result<(), RenderError> {
        if let Some(flight) = self.flight.take() {
            self.result = renderer.retire(flight)?;
            self.stages.append(&mut self.result.stages);
            self.cpu_ms.renderer = self.result.cpu_ms;
        }
        Ok(())
    }

    /// Notes a stage that ends now; milliseconds.
    pub fn note(&mut self, stage: &'static str, began: Instant) -> f64 {
        let span = HostSpan::since(stage, began);
        self.stages.push(span);
        span.ms()
    }

    /// The frame's statistics, `frame_ms` being the host's time for it; call it last, so that `cpu_ms.write` and
    /// `cpu_ms.mirror` are filled in, of a retired frame.
    pub fn into_stats(self, frame: u32, non_finite_pixels: usize, frame_ms: f64) -> FrameStats {
        let mut cpu_ms = self.cpu_ms;
        cpu_ms.frame = frame_ms;
        let stages = cpu_ms.wait + cpu_ms.session + cpu_ms.submit + cpu_ms.mirror + cpu_ms.write;
        let rendering = cpu_ms.renderer.update + cpu_ms.renderer.render + cpu_ms.renderer.read_back;
        cpu_ms.overhead = (cpu_ms.frame - stages - rendering).max(0.0);
        FrameStats {
            display_time_ns: self.display_time_ns,
            cpu_ms,
            non_finite_pixels,
            pose_repeated: self.located.repeated,
            pose_age_ms: self.pose_age_ms,
            host_waits: self.host_waits,
            ..FrameStats::of(frame, self.result)
        }
    }
}

/// One turn of the loop: waits for the session's next frame, renders it and hands it over. `update` takes the scene to where
/// it is in that frame; `sample` is told how many of the frame's samples are done, and may break the frame off. With more than
/// one frame `in_flight`, 2 or 3, the frame is on its way then, and as many less one may be before it.
///
/// # Errors
/// [`LoopError::Session`], [`LoopError::Render`], and those of `update`.
pub fn step(
    session: &mut dyn XrSession,
    renderer: &mut Renderer,
    library: &ShaderLibrary,
    index: u32,
    in_flight: usize,
    update: impl FnOnce(&mut dyn XrSession, &mut Renderer, FrameInput) -> Result<(), LoopError>,
    sample: impl FnMut(u32) -> ControlFlow<()>,
) -> Result<Step, LoopError> {
    let began = Instant::now();
    let waits_before = renderer.context().host_waits();
    let Some(state) = session.wait_frame()? else {
        return Ok(Step::Ended);
    };
    let mut stages = vec![HostSpan::since("wait", began)];
    renderer.follow_hidden(session.info().hidden.as_ref());
    if state.switch_reuse && !renderer.switch_reuse() {
        log::info!("reuse is off in this run's settings; there is nothing to switch");
    }
    let called = Instant::now();
    session.begin_frame()?;
    let views = if state.should_render {
        session.locate_views(state.predicted_display_time_ns)?
    } else {
        None
    };
    let Some(located) = views else {
        session.end_frame(FrameSubmission::new(state.predicted_display_time_ns, None))?;
        return Ok(Step::Hidden);
    };
    let input = session.locate_input(state.predicted_display_time_ns)?;
    stages.push(HostSpan::since("session", called));
    let before = renderer.quality();
    let frame = FrameInput::new(index, &state, &located, input);
    update(session, renderer, frame)?;
    let quality = settle_quality(renderer, &state, before)?;
    let flight = renderer.prepare_frame(&located.views, index)?;
    // Where the eyes are by now.
    let asked = Instant::now();
    let again = session.relocate_views(state.predicted_display_time_ns)?;
    let located = again.unwrap_or(located);
    stages.push(HostSpan::since("session", asked));
    let lands = in_flight == 1;
    let flight = renderer.send_eyes(flight, &located.views, index, lands, sample)?;
    let pose_age_ms = flight
        .eyes_sent()
        .map_or(0.0, |sent| (sent - asked).as_secs_f64() * 1e3);
    let (mut result, flight) = if lands {
        (renderer.retire(flight)?, None)
    } else {
        (FrameResult::default(), Some(flight))
    };
    stages.append(&mut result.stages);
    let called = Instant::now();
    let targets = session.acquire_targets()?;
    stages.push(HostSpan::since("session", called));
    if let RenderTargets::Runtime(targets) = &targets {
        let recorded = Instant::now();
        renderer.submit_to(library, targets)?;
        stages.push(HostSpan::since("submit", recorded));
    }
    drop(targets);
    let called = Instant::now();
    let submission = FrameSubmission::new(state.predicted_display_time_ns, Some(&located));
    session.end_frame(submission.with_quality(quality).of_size(renderer.size()))?;
    stages.push(HostSpan::since("session", called));
    let ms = |name| {
        let of_name = stages.iter().filter(|span| span.stage == name);
        of_name.fold(0.0, |sum, span| sum + span.ms())
    };
    let cpu_ms = CpuMs {
        renderer: result.cpu_ms,
        wait: ms("wait"),
        session: ms("session"),
        submit: ms("submit"),
        ..CpuMs::default()
    };
    Ok(Step::Rendered(Box::new(Rendered {
        flight,
        display_time_ns: state.predicted_display_time_ns,
        located,
        result,
        cpu_ms,
        stages,
        pose_age_ms,
        host_waits: renderer.context().host_waits() - waits_before,
    })))
}

/// Frames of a loop of one's own: a session and the renderer of a scene, frame by frame.
pub struct FrameLoop<S> {
    session: S,
    renderer: Renderer,
    library: ShaderLibrary,
    next_frame: u32,
    held: Held,
}

impl<S: XrSession> FrameLoop<S> {
    /// A loop over the frames of `session`, both eyes of `size` pixels (width, height) each. `context` is the runtime's
    /// device where the session is a runtime's. What `settings` leave to `auto` is decided as for [`crate::run_app`]: frames of one
    /// sample per pixel are reconstructed.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn new(
        context: GpuContext,
        library: ShaderLibrary,
        session: S,
        scene: &Scene,
        settings: &RenderSettings,
        size: [u32; 2],
    ) -> Result<Self, RenderError> {
        let (both, info) = (Eyes::Both, session.info());
        let mut settings = settings.clone();
        settings.decide_switches(true);
        let renderer =
            Renderer::for_session(context, &library, scene, &settings, both, size, info)?;
        Ok(Self {
            session,
            renderer,
            library,
            next_frame: 0,
            held: Held::default(),
        })
    }

    /// Waits for the session's next frame, lets `update` change what is shown in it, renders it and hands it over. The
    /// scene's own animation has gone on when `update` is called; [`FrameInput::display_time_ns`] is the time
    /// to move things by. `None`: the session has ended.
    ///
    /// # Errors
    /// [`LoopError::Session`], [`LoopError::Render`].
    pub fn next_frame(
        &mut self,
        update: impl FnOnce(&mut Renderer, &FrameInput),
    ) -> Result<Option<FrameStats>, LoopError> {
        let mut update = Some(update);
        loop {
            let began = Instant::now();
            let index = self.next_frame;
            let held = &mut self.held;
            let turn = step(
                &mut self.session,
                &mut self.renderer,
                &self.library,
                index,
                1,
                |_, renderer, frame| {
                    renderer.animate(frame.display_time_ns);
                    if let Some(update) = update.take() {
                        update(renderer, &frame.after(held));
                    }
                    Ok(())
                },
                |_| ControlFlow::Continue(()),
            )?;
            match turn {
                Step::Ended => return Ok(None),
                Step::Hidden => {}
                Step::Rendered(rendered) => {
                    self.next_frame += 1;
                    let frame_ms = milliseconds_since(began);
                    return Ok(Some(rendered.into_stats(index, 0, frame_ms)));
                }
            }
        }
    }

    /// What has rendered the last frame, and holds its images.
    pub fn renderer(&self) -> &Renderer {
        &self.renderer
    }

    /// Where frames come from.
    pub fn session(&self) -> &S {
        &self.session
    }

    /// The same, to let controllers vibrate or move the wearer.
    pub fn session_mut(&mut self) -> &mut S {
        &mut self.session
    }
}

/// Runs until the session ends or the user interrupts. A `mirror` shows the frames. What was done is in `outcome`, also
/// when an error ends the loop.
///
/// # Errors
/// [`LoopError`]; files and statistics of the frames before it are on disk.
#[expect(
    clippy::too_many_arguments,
    reason = "one call site; a struct of the same fields would only be moved"
)]
pub fn run(
    session: &mut dyn XrSession,
    renderer: &mut Renderer,
    library: &ShaderLibrary,
    output: &mut OutputFolder,
    options: LoopOptions<'_>,
    progress: &mut dyn LoopProgress,
    mirror: Option<&mut Mirror>,
    application: &mut Application<'_>,
    outcome: &mut Outcome,
) -> Result<(), LoopError> {
    let mut way = OnTheirWay {
        in_flight: options.in_flight,
        turns: VecDeque::new(),
        retired_ms: 0.0,
        progress,
        output,
        outcome,
    };
    let ended = run_frames(
        session,
        renderer,
        library,
        &mut way,
        options,
        mirror,
        application,
    );
    application.end(renderer);
    // Frames before an error have statistics too.
    let retired = way.retire(renderer, 0);
    ended.and(retired)
}

/// A frame that was sent.
struct Turn {
    index: u32,
    is_written: bool,
    frame: Box<Rendered>,
    non_finite_pixels: usize,
    /// Host milliseconds without retiring frames.
    own_ms: f64,
}

/// Frames on their way, the oldest first, and where their statistics go.
struct OnTheirWay<'a> {
    in_flight: usize,
    turns: VecDeque<Turn>,
    /// Milliseconds that retiring frames has taken since the present one began.
    retired_ms: f64,
    progress: &'a mut dyn LoopProgress,
    output: &'a mut OutputFolder,
    outcome: &'a mut Outcome,
}

impl OnTheirWay<'_> {
    /// Retires the oldest until `left` are on their way.
    fn retire(&mut self, renderer: &mut Renderer, left: usize) -> Result<(), LoopError> {
        let began = Instant::now();
        while self.turns.len() > left {
            if let Some(turn) = self.turns.pop_front() {
                self.finish(turn, renderer)?;
            }
        }
        self.retired_ms += milliseconds_since(began);
        Ok(())
    }

    /// Writes a frame's statistics, when it is done.
    fn finish(&mut self, turn: Turn, renderer: &mut Renderer) -> Result<(), LoopError> {
        let began = Instant::now();
        let mut frame = turn.frame;
        frame.retire(renderer)?;
        let frame_ms = turn.own_ms + milliseconds_since(began);
        if !turn.is_written {
            return Ok(());
        }
        let index = turn.index;
        let submissions = frame.result.times.submissions.take().unwrap_or_default();
        let stages = std::mem::take(&mut frame.stages);
        let slot = (self.in_flight > 1).then_some(index % MOST as u32);
        self.output
            .trace_frame(index, slot, &stages, &submissions)?;
        let stats = frame.into_stats(index, turn.non_finite_pixels, frame_ms);
        self.output.append_stats(&stats)?;
        self.progress.frame(&stats);
        if self.outcome.last.len() == KEPT_FRAMES {
            self.outcome.last.pop_front();
        }
        self.outcome.last.push_back(stats);
        self.outcome.frames += 1;
        Ok(())
    }
}

/// The loop of [`run`]; frames are left on their way at its end.
fn run_frames(
    session: &mut dyn XrSession,
    renderer: &mut Renderer,
    library: &ShaderLibrary,
    way: &mut OnTheirWay<'_>,
    options: LoopOptions<'_>,
    mut mirror: Option<&mut Mirror>,
    application: &mut Application<'_>,
) -> Result<(), LoopError> {
    let mut index = 0;
    loop {
        let began = Instant::now();
        way.retired_ms = 0.0;
        if crate::interrupt::requested() {
            return Ok(());
        }
        if let Some(mirror) = &mut mirror {
            // Also while the session shows nothing.
            mirror.serve();
        }
        application.kept.rebuild(renderer)?;
        let role = options.role(index);
        if role == Role::Last {
            return Ok(());
        }
        way.retire(renderer, options.in_flight - 1)?;
        let told = |done| {
            way.progress.sample(index, done);
            match crate::interrupt::requested() {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        };
        let in_flight = options.in_flight;
        let update = |session: &mut dyn XrSession, renderer: &mut Renderer, frame| {
            application.update(session, renderer, frame)
        };
        let turn = match role {
            Role::Skipped => skip(session, renderer, index, application),
            _ => step(session, renderer, library, index, in_flight, update, told),
        };
        let turn = match turn {
            Err(LoopError::Render(RenderError::Interrupted)) => return Ok(()),
            turn => turn?,
        };
        for pulse in std::mem::take(&mut application.kept.pulses) {
            session.vibrate(&pulse)?;
        }
        session.move_wearer(std::mem::take(&mut application.kept.moved_m));
        let mut frame = match turn {
            Step::Ended => return Ok(()),
            Step::Hidden => {
                if application.kept.is_over {
                    return Ok(());
                }
                index += u32::from(role == Role::Skipped);
                continue;
            }
            Step::Rendered(frame) => frame,
        };
        let mut non_finite_pixels = 0;
        let is_written = role == Role::Written;
        if is_written {
            // After the runtime has got its frame: the window must not delay it.
            if let Some(mirror) = &mut mirror {
                let shown = Instant::now();
                mirror.show(renderer, library)?;
                frame.cpu_ms.mirror = frame.note("mirror", shown);
            }
            let has_images = options.images && index % options.every.max(1) == 0;
            if has_images {
                // Reading images waits for the device anyway, and views of the photons know their number then.
                way.retire(renderer, 0)?;
                frame.retire(renderer)?;
            }
            let written = Instant::now();
            if has_images {
                let mut images = read_images(renderer, &mut non_finite_pixels)?;
                images.aovs = read_aovs(renderer, library, options.aovs, &images)?;
                let facts = FrameFacts {
                    frame: index,
                    display_time_ns: frame.display_time_ns,
                    refresh_hz: session.info().refresh_hz,
                    views: &frame.located.views,
                };
                way.output.write_frame(&facts, &images)?;
            }
            frame.cpu_ms.write = frame.note("write", written);
        }
        frame.stages.insert(0, HostSpan::since("frame", began));
        way.turns.push_back(Turn {
            index,
            is_written,
            frame,
            non_finite_pixels,
            own_ms: milliseconds_since(began) - way.retired_ms,
        });
        if in_flight == 1 {
            way.retire(renderer, 0)?;
        }
        if application.kept.is_over {
            return Ok(());
        }
        index += 1;
    }
}
