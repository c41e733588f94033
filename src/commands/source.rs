//! Where a run's views come from.

use super::Failure;
use crate::gpu::GpuContext;
use crate::mirror::MirrorWindow;
use crate::options::{RunOptions, SessionChoice, TraceOptions};
use crate::scene::Scene;
use crate::xr::{
    Actions, HandScript, Headset, Pacing, Pose, Quality, ReplayOptions, ReplaySession,
    SimulatedSession, Validated, XrSession,
};

/// Frames of a simulated run without `--frames`.
const SIMULATED_FRAMES: u64 = 100;

/// A session, and the device if the session dictates it.
pub(super) struct Source {
    pub(super) session: Box<dyn XrSession>,
    pub(super) context: Option<GpuContext>,
    /// Where the views come from, for people.
    pub(super) name: String,
    /// Said on stderr when the run begins.
    pub(super) announcement: Option<String>,
    /// The wearer's room was asked for, and the headset does not show it.
    pub(super) lacks_room: bool,
    pub(super) size: [u32; 2],
    /// How many frames there will be at most, where that is known.
    pub(super) frames: Option<u32>,
    /// Qualities that a recording will set, each with its frame.
    pub(super) qualities: Vec<(usize, Quality)>,
}

impl Source {
    /// A session that brings no device, named as it calls itself.
    pub(super) fn of(session: Box<dyn XrSession>, size: [u32; 2], frames: Option<u32>) -> Self {
        Self {
            name: session.info().source.clone(),
            session,
            context: None,
            announcement: None,
            lacks_room: false,
            size,
            frames,
            qualities: Vec::new(),
        }
    }
}

/// Opens the session that the options ask for.
pub(super) fn source(
    options: &RunOptions,
    headset: &Headset,
    start: Pose,
    hands: HandScript,
    actions: &Actions,
) -> Result<Source, Failure> {
    let unavailable = match options.session.choice {
        SessionChoice::Openxr | SessionChoice::Auto => match openxr_source(options, start, actions)
        {
            Ok(mut source) => {
                if options.session.choice == SessionChoice::Auto {
                    source.announcement = Some(format!("session: {}", source.name));
                }
                return Ok(source);
            }
            Err(failure) if options.session.choice == SessionChoice::Openxr => return Err(failure),
            Err(failure) => Some(failure.message),
        },
        SessionChoice::Simulated | SessionChoice::Replay | SessionChoice::Desktop => None,
    };
    let mut source = unpaced_source(options, headset, start, hands, actions)?;
    let name = &source.name;
    if let (Some(range), Some(frames)) = (&options.session.range, source.frames) {
        if range.start >= frames {
            return Err(Failure::unusable(format!(
                "--range {}..{}: {name} has {frames} frame{}, counted from 0; begin below that",
                range.start,
                range.end,
                if frames == 1 { "" } else { "s" },
            )));
        }
        if range.end > frames {
            log::warn!(
                "--range {0}..{1}: {name} has {frames} frames; {0}..{frames} is rendered",
                range.start,
                range.end
            );
        }
    }
    source.announcement = unavailable.map(|reason| format!("session: {name}; {reason}"));
    Ok(source)
}

/// The desktop, with the window that it is seen in.
#[cfg(feature = "viewer")]
pub(super) fn desktop_source(
    options: &RunOptions,
    headset: &Headset,
    start: Pose,
    scene: &Scene,
    actions: &Actions,
    window: &mut MirrorWindow,
) -> Result<Source, Failure> {
    let size = options.settings.size;
    let size = size.unwrap_or_else(|| window.eye_size(headset.size));
    let scene_size_m = scene
        .bounds_in_world()
        .map_or(0.0, |bounds| bounds.size().max_element());
    let frames = options.session.frames.map(u64::from);
    actions.warn_of_undriven();
    let session = crate::desktop::DesktopSession::new(
        headset.clone(),
        start,
        scene_size_m,
        size,
        actions.clone(),
        frames,
    );
    window.tell(session.desk());
    Ok(Source {
        announcement: Some(format!("session: desktop; {}", crate::desktop::controls())),
        ..Source::of(Box::new(session), size, options.session.frames)
    })
}

#[cfg(not(feature = "viewer"))]
pub(super) fn desktop_source(
    _: &RunOptions,
    _: &Headset,
    _: Pose,
    _: &Scene,
    _: &Actions,
    _: &mut MirrorWindow,
) -> Result<Source, Failure> {
    Err(Failure::unusable(
        "--session desktop: this build has no desktop; build with `--features viewer`",
    ))
}

#[cfg(not(target_vendor = "apple"))]
fn openxr_source(options: &RunOptions, start: Pose, actions: &Actions) -> Result<Source, Failure> {
    use crate::xr::openxr::{OpenXrSession, Runtime, SessionOptions};

    let settings = &options.settings;
    let runtime = Runtime::find()?;
    let size = runtime.size(settings.size)?;
    let wanted = Some(settings.adapter.as_str()).filter(|name| !name.is_empty());
    let context = runtime.open_device(wanted)?;
    let wants_room = settings.render.surroundings.passthrough;
    let session = OpenXrSession::create(
        runtime,
        &context,
        SessionOptions {
            size,
            start,
            frame_limit: options.session.frames.map(u64::from),
            settings: settings.openxr.clone(),
            passthrough: wants_room,
            actions: actions.clone(),
        },
    )?;
    if let Some((format, with_depth)) = session.image_format() {
        log::info!(
            "OpenXR images: {format:?}, {}",
            if with_depth { "with depth" } else { "no depth" }
        );
    }
    let lacks_room = wants_room && !session.shows_room();
    let session = Box::new(Validated::new(session));
    Ok(Source {
        lacks_room,
        context: Some(context),
        ..Source::of(session, size, options.session.frames)
    })
}

#[cfg(target_vendor = "apple")]
fn openxr_source(_: &RunOptions, _: Pose, _: &Actions) -> Result<Source, Failure> {
    Err(Failure::failed(
        "no OpenXR runtime for Metal exists; use --session simulated",
    ))
}

/// A session that no runtime paces.
fn unpaced_source(
    options: &RunOptions,
    headset: &Headset,
    start: Pose,
    hands: HandScript,
    actions: &Actions,
) -> Result<Source, Failure> {
    let source = |session: Box<dyn XrSession>, frames: u64, qualities| {
        let size = options.settings.size.or(session.info().recommended_size);
        let size = size.unwrap_or(headset.size);
        Source {
            qualities,
            ..Source::of(session, size, u32::try_from(frames).ok())
        }
    };
    let pacing = if options.session.realtime {
        Pacing::RealTime
    } else {
        Pacing::AsFastAsPossible
    };
    match (options.session.choice, &options.session.recording.trace) {
        (SessionChoice::Replay, Some(path)) => {
            let mut replay = replay_options(&options.session.recording, headset.clone(), start);
            replay.start_is_given = options.session.pose.is_some();
            replay.frame_limit = options.session.frames.map(u64::from);
            replay.pacing = pacing;
            let session = ReplaySession::open(path, replay)?;
            let (frames, qualities) = (session.frame_count(), session.qualities());
            Ok(source(Box::new(Validated::new(session)), frames, qualities))
        }
        (SessionChoice::Replay, None) => Err(Failure::unusable(
            "--session replay needs a recording: give one with --trace FILE",
        )),
        // The desktop has a source of its own.
        (
            SessionChoice::Auto
            | SessionChoice::Openxr
            | SessionChoice::Simulated
            | SessionChoice::Desktop,
            _,
        ) => {
            actions.warn_of_undriven();
            let frames = options.session.frames.map_or(SIMULATED_FRAMES, u64::from);
            let settings = &options.settings;
            let motion = settings.simulated.motion;
            let session = SimulatedSession::new(headset.clone(), motion, start, Some(frames))
                .with_seed(u64::from(settings.render.seed))
                .with_hands(hands)
                .with_actions(actions.clone())
                .with_pacing(pacing);
            Ok(source(Box::new(session), frames, Vec::new()))
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
