//! Plays a recording back as if it were a headset.

use super::controller_model;
use super::frame_clock::{FrameOrder, Pacer, Pacing, display_time_ns, period_ns};
use super::text_lines;
use super::trace::{Trace, TraceFrame};
use super::trajectory::{HeadMotion, RecordedTrajectory, TraceBody, TraceUp};
use super::view::Pose;
use super::{
    ArgumentError, ControllerModel, FrameState, FrameSubmission, Headset, Input, InputError,
    LocatedViews, Quality, QualityFrom, RenderTargets, SessionInfo, Side, XrError, XrSession,
};
use std::collections::VecDeque;
use std::path::Path;

/// How to play a recording back.
#[derive(Clone, Debug)]
pub struct ReplayOptions {
    /// Adds the eyes to a head trajectory; a native trace has its own.
    pub headset: Headset,
    /// Where a recentred head trajectory starts, world from head.
    pub start: Pose,
    /// The recording's up axis; `None`: z, as both formats have it. Only for head trajectories.
    pub up: Option<TraceUp>,
    /// The recording's body axes; `None`: the format's default. Only for head trajectories.
    pub body: Option<TraceBody>,
    /// Move the first pose onto `start`; `None`: yes for head trajectories. A native trace replays as it
    /// stands.
    pub recenter: Option<bool>,
    /// Whether somebody asked for `start`, which a native trace cannot follow.
    pub start_is_given: bool,
    /// Stop after this many frames.
    pub frame_limit: Option<u64>,
    /// At once or when due.
    pub pacing: Pacing,
}

impl ReplayOptions {
    /// Defaults for everything but headset and start pose.
    #[must_use]
    pub fn new(headset: Headset, start: Pose) -> Self {
        Self {
            headset,
            start,
            up: None,
            body: None,
            recenter: None,
            start_is_given: false,
            frame_limit: None,
            pacing: Pacing::default(),
        }
    }
}

/// Replays a native trace frame by frame, or a head trajectory at the headset's refresh times. Files
/// are told apart by content and read in full when opened.
#[derive(Debug)]
pub struct ReplaySession {
    info: SessionInfo,
    recording: Recording,
    /// Controllers' models that were not asked for yet, and the frames in which they became known.
    models: VecDeque<(u64, ControllerModel)>,
    /// Quality was set while it was recorded: it goes by that alone.
    sets_quality: bool,
    frame_limit: u64,
    next_frame: u64,
    order: FrameOrder,
    pacer: Pacer,
}

#[derive(Debug)]
enum Recording {
    Native(Trace),
    Head(HeadMotion, Box<Headset>),
}

impl ReplaySession {
    /// Opens a recording. Warnings about the file go to the log and to [`ReplaySession::warnings`].
    ///
    /// # Errors
    /// An unreadable or unknown file, the first fault in it (with file, line and field; a controller's model that it names is
    /// a field), or options that a native trace has no use for.
    pub fn open(path: &Path, options: ReplayOptions) -> Result<Self, XrError> {
        let mut lines = text_lines::open(path)?;
        let native = match lines.next_uncommented()? {
            Some(first) => {
                let native = first.text.starts_with('{');
                lines.push_back(first);
                native
            }
            None => false,
        };
        if native {
            Self::native(path, Trace::from_lines(&mut lines)?, options)
        } else {
            let recorded = RecordedTrajectory::from_lines(&mut lines)?;
            Ok(Self::head(path, &recorded, options))
        }
    }

    fn native(path: &Path, trace: Trace, options: ReplayOptions) -> Result<Self, XrError> {
        let unused = [
            ("--trace-up", options.up.is_some()),
            ("--trace-body", options.body.is_some()),
            ("--trace-recenter", options.recenter == Some(true)),
            ("--pose", options.start_is_given),
        ];
        if let Some((flag, _)) = unused.iter().find(|(_, given)| *given) {
            return Err(ArgumentError(format!(
                "{flag} is for TUM and EuRoC recordings; {} is a native trace, which replays as it stands: leave the flag out",
                path.display()
            ))
            .into());
        }
        for warning in &trace.warnings {
            log::warn!("{warning}");
        }
        let models = load_models(path, &trace)?;
        let info = SessionInfo {
            source: format!("replay of {}", path.display()),
            headset: trace.header.headset.clone(),
            refresh_hz: trace.header.refresh_hz,
            recommended_size: None,
            // Where nothing is hidden yet, room is made for what will be.
            hidden: trace.header.hidden.clone().or_else(|| {
                let changes = trace.frames.iter().any(|frame| frame.hidden.is_some());
                changes.then(Default::default)
            }),
            takes_depth: false,
        };
        let frames = trace.frames.len() as u64;
        let sets_quality = trace.frames.iter().any(|frame| frame.quality.is_some());
        let recording = Recording::Native(trace);
        Ok(Self {
            models,
            sets_quality,
            ..Self::new(info, recording, frames, &options)
        })
    }

    fn head(path: &Path, recorded: &RecordedTrajectory, options: ReplayOptions) -> Self {
        let format = recorded.format;
        let up = options.up.unwrap_or(TraceUp::Z);
        let body = options.body.unwrap_or(format.default_body());
        let mut motion = recorded.to_head_motion(up, body);
        if options.recenter.unwrap_or(true) {
            motion = motion.recentered(&options.start);
        }
        let headset = options.headset.clone();
        let source = format!("replay of {} ({})", path.display(), format.name());
        let info = SessionInfo::of_profile(source, &headset);
        let frames = frames_within(motion.duration_ns(), headset.refresh_hz);
        let recording = Recording::Head(motion, Box::new(headset));
        Self::new(info, recording, frames, &options)
    }

    fn new(info: SessionInfo, recording: Recording, frames: u64, options: &ReplayOptions) -> Self {
        Self {
            info,
            recording,
            models: VecDeque::new(),
            sets_quality: false,
            frame_limit: options
                .frame_limit
                .map_or(frames, |limit| limit.min(frames)),
            next_frame: 0,
            order: FrameOrder::default(),
            pacer: Pacer::new(options.pacing),
        }
    }

    /// What is wrong with the file and does not keep it from being replayed: an end that was cut off.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        match &self.recording {
            Recording::Native(trace) => &trace.warnings,
            Recording::Head(..) => &[],
        }
    }

    /// How many frames this replay has.
    #[must_use]
    pub fn frame_count(&self) -> u64 {
        self.frame_limit
    }

    /// Every quality that this replay will set, with the number of its frame from 0.
    #[must_use]
    pub fn qualities(&self) -> Vec<(usize, Quality)> {
        let Recording::Native(trace) = &self.recording else {
            return Vec::new();
        };
        let frames = trace.frames.iter().enumerate();
        frames
            .take_while(|(number, _)| (*number as u64) < self.frame_limit)
            .filter_map(|(number, frame)| Some((number, frame.quality?)))
            .collect()
    }

    /// What a native trace holds of a frame.
    fn recorded(&self, frame: u64) -> Option<&TraceFrame> {
        match &self.recording {
            Recording::Native(trace) => trace.frames.get(usize::try_from(frame).ok()?),
            Recording::Head(..) => None,
        }
    }

    fn display_time_ns(&self, frame: u64) -> Option<i64> {
        match &self.recording {
            Recording::Native(_) => self.recorded(frame).map(|frame| frame.t_ns),
            Recording::Head(..) => Some(display_time_ns(frame, self.info.refresh_hz)),
        }
    }

    /// Views at a time: `of` the frame of a native trace.
    fn views_at(
        &self,
        display_time_ns: i64,
        of: impl FnOnce(&TraceFrame) -> LocatedViews,
    ) -> Result<Option<LocatedViews>, XrError> {
        self.order.may_locate("locate_views")?;
        match &self.recording {
            Recording::Native(trace) => {
                let frame = trace
                    .frames
                    .binary_search_by_key(&display_time_ns, |frame| frame.t_ns)
                    .ok()
                    .and_then(|index| trace.frames.get(index));
                match frame {
                    Some(frame) => Ok(Some(of(frame))),
                    None => Err(XrError::CallOrder(format!(
                        "locate_views at {display_time_ns} ns, a time that the trace does not hold"
                    ))),
                }
            }
            Recording::Head(motion, headset) => {
                let head = motion.pose_at(display_time_ns);
                Ok(Some(LocatedViews::valid(headset.views_from_head(&head))))
            }
        }
    }

    fn quality(&self, frame: u64) -> QualityFrom {
        if !self.sets_quality {
            return QualityFrom::Application;
        }
        QualityFrom::Recording(self.recorded(frame).and_then(|frame| frame.quality))
    }
}

/// Reads the controllers' models that a trace names.
fn load_models(path: &Path, trace: &Trace) -> Result<VecDeque<(u64, ControllerModel)>, InputError> {
    let mut lines = trace.model_lines.iter();
    let mut models = VecDeque::new();
    let budget = controller_model::budget();
    for (number, frame) in (0..).zip(&trace.frames) {
        let names = Side::BOTH.into_iter().zip(&frame.controller_model);
        let mut names = names
            .filter_map(|(side, name)| Some((side, name.as_ref()?)))
            .peekable();
        let line = names.peek().and_then(|_| lines.next()).copied();
        for (side, name) in names {
            let glb = controller_model::load(path, name, &budget).map_err(|what| InputError {
                line,
                field: Some(format!("controller_model.{}", side.word())),
                ..InputError::file(&path.display().to_string(), what)
            })?;
            models.push_back((number, ControllerModel { side, glb }));
        }
    }
    Ok(models)
}

/// How many refresh times lie within [0, `duration_ns`].
fn frames_within(duration_ns: i64, refresh_hz: f64) -> u64 {
    let mut frames = (duration_ns as f64 * refresh_hz * 1e-9) as u64 + 2;
    // The estimate is within 2 of the count; the rounded display times decide.
    while frames > 1 && display_time_ns(frames - 1, refresh_hz) > duration_ns {
        frames -= 1;
    }
    frames
}

impl XrSession for ReplaySession {
    fn info(&self) -> &SessionInfo {
        &self.info
    }

    fn wait_frame(&mut self) -> Result<Option<FrameState>, XrError> {
        self.order.may_wait()?;
        if self.next_frame >= self.frame_limit {
            return Ok(None);
        }
        let Some(predicted_display_time_ns) = self.display_time_ns(self.next_frame) else {
            return Ok(None);
        };
        if let Some(recorded) = self.recorded(self.next_frame) {
            let (refresh_hz, hidden) = (recorded.refresh_hz, recorded.hidden.clone());
            self.info.refresh_hz = refresh_hz.unwrap_or(self.info.refresh_hz);
            self.info.hidden = hidden.or_else(|| self.info.hidden.take());
        }
        let frame = FrameState {
            predicted_display_time_ns,
            period_ns: period_ns(self.info.refresh_hz),
            should_render: true,
            switch_reuse: self
                .recorded(self.next_frame)
                .is_some_and(|frame| frame.switch_reuse),
            quality: self.quality(self.next_frame),
        };
        self.pacer.wait_until(predicted_display_time_ns);
        self.next_frame += 1;
        self.order.waited(&frame);
        Ok(Some(frame))
    }

    fn begin_frame(&mut self) -> Result<(), XrError> {
        self.order.begin()
    }

    fn locate_views(&mut self, display_time_ns: i64) -> Result<Option<LocatedViews>, XrError> {
        let first = |frame: &TraceFrame| LocatedViews {
            views: frame.located.unwrap_or(frame.views.views),
            ..frame.views
        };
        self.views_at(display_time_ns, first)
    }

    fn relocate_views(&mut self, display_time_ns: i64) -> Result<Option<LocatedViews>, XrError> {
        self.views_at(display_time_ns, |frame| frame.views)
    }

    fn locate_input(&mut self, display_time_ns: i64) -> Result<Input, XrError> {
        self.order.may_locate("locate_input")?;
        // Head trajectories have no hands, and a frame at another time is refused by `locate_views`.
        let Recording::Native(trace) = &self.recording else {
            return Ok(Input::default());
        };
        let frame = trace
            .frames
            .binary_search_by_key(&display_time_ns, |frame| frame.t_ns);
        Ok(frame.map_or_else(
            |_| Input::default(),
            |index| trace.frames[index].input.clone(),
        ))
    }

    fn controller_model(&mut self) -> Result<Option<ControllerModel>, XrError> {
        let is_known = |(frame, _): &mut (u64, _)| *frame < self.next_frame;
        Ok(self.models.pop_front_if(is_known).map(|(_, model)| model))
    }

    fn acquire_targets(&mut self) -> Result<RenderTargets, XrError> {
        self.order.may_acquire()?;
        Ok(RenderTargets::FrameLoopOwned)
    }

    fn end_frame(&mut self, submission: FrameSubmission<'_>) -> Result<(), XrError> {
        self.order.end(submission.display_time_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::frames_within;

    #[test]
    fn frames_are_counted_to_the_last_refresh_within() {
        assert_eq!(frames_within(0, 90.0), 1);
        // 90 Hz: frames at 0, 11,111,111, 22,222,222, 33,333,333 ns.
        assert_eq!(frames_within(11_111_110, 90.0), 1);
        assert_eq!(frames_within(11_111_111, 90.0), 2);
        assert_eq!(frames_within(33_333_333, 90.0), 4);
        assert_eq!(frames_within(1_000_000_000, 90.0), 91);
        assert_eq!(frames_within(999_999_999, 1.0), 1);
        assert_eq!(frames_within(3_600_000_000_000, 72.0), 72 * 3600 + 1);
    }
}
