//! Records the views that were really used, around any session.

use super::controller_model::{self, ModelNames};
use super::hidden_area::HiddenArea;
use super::trace::{self, TraceFrame, TraceHeader};
use super::validation::{self, Fault};
use super::view::View;
use super::{
    ControllerModel, FrameState, FrameSubmission, Input, LocatedViews, Pulse, Quality,
    RenderTargets, SessionInfo, XrError, XrSession,
};
use std::fs::File;
use std::io::{Error, ErrorKind, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use glam::DVec3;
use stereolux_base::files;

/// Any session, with each frame's views written to a native trace (`trace`) as the frame ends. A
/// frame that rendered nothing leaves no line. Each line is handed to the system in one write before the
/// frame ends, so a killed run loses at most the line that it was writing. Controllers' models lie beside the trace.
pub struct Recorder {
    inner: Box<dyn XrSession>,
    path: PathBuf,
    file: File,
    frames: u64,
    /// Reuse was switched since the last line.
    switch_reuse: bool,
    /// What the wearer does in the frame under way.
    input: Input,
    /// What was located first in it.
    located: Option<[View; 2]>,
    /// Files of controllers' models that became known since the last line.
    models: ModelNames,
    /// The quality that was set since the last line, and the last one written.
    quality: [Option<Quality>; 2],
    /// The refresh rate and the hidden areas that were written last.
    refresh_hz: f64,
    hidden: [HiddenArea; 2],
    /// The version that the header states.
    version: u64,
}

impl Recorder {
    /// Creates the file at `path`, replacing what was there, and writes the header from `inner`'s
    /// [`SessionInfo`].
    ///
    /// # Errors
    /// [`XrError::RecordCreate`] if the file cannot be created or written.
    pub fn create(path: &Path, inner: Box<dyn XrSession>) -> Result<Self, XrError> {
        let header = TraceHeader {
            headset: inner.info().headset.clone(),
            refresh_hz: inner.info().refresh_hz,
            // What may come to hide something is written when it does.
            hidden: inner
                .info()
                .hidden
                .clone()
                .filter(|areas| !areas.iter().all(HiddenArea::is_empty)),
        };
        let written = File::create(path).and_then(|mut file| {
            // In a pipe nothing is changed later: there the last version stands from the start.
            let version = match file.stream_position() {
                Ok(_) => header.version(),
                Err(_) => trace::VERSIONS[1],
            };
            file.write_all(trace::header_line(&header, version)?.as_bytes())?;
            Ok((file, version))
        });
        match written {
            Ok((file, version)) => Ok(Self {
                inner,
                path: path.to_owned(),
                file,
                frames: 0,
                switch_reuse: false,
                input: Input::default(),
                located: None,
                models: ModelNames::default(),
                quality: [None; 2],
                refresh_hz: header.refresh_hz,
                hidden: header.hidden.unwrap_or_default(),
                version,
            }),
            Err(cause) => Err(XrError::RecordCreate {
                path: path.to_owned(),
                cause,
            }),
        }
    }

    /// States a later version in the header, in place: the number has one digit, whatever it is. Before the first line
    /// that needs it, so that a killed run leaves a file that is what it says.
    fn raise_version(&mut self, version: u64) -> std::io::Result<()> {
        self.file.seek(SeekFrom::Start(trace::VERSION_AT as u64))?;
        self.file.write_all(version.to_string().as_bytes())?;
        self.file.seek(SeekFrom::End(0))?;
        self.version = version;
        Ok(())
    }

    fn broken_off(&self, cause: Error) -> XrError {
        XrError::RecordWrite {
            path: self.path.clone(),
            frames: self.frames,
            cause,
        }
    }

    /// Writes only what [`trace::Trace::read`] will take back.
    fn write(&mut self, t_ns: i64, views: &LocatedViews) -> std::io::Result<()> {
        let invalid = |fault: Fault| Error::new(ErrorKind::InvalidData, fault.to_string());
        validation::check_views(views).map_err(invalid)?;
        let located = self.located.filter(|located| *located != views.views);
        if let Some(views_first) = located {
            let first = LocatedViews {
                views: views_first,
                ..*views
            };
            validation::check_views(&first).map_err(invalid)?;
        }
        let input = std::mem::take(&mut self.input).checked().map_err(invalid)?;
        let [set, known] = self.quality;
        let info = self.inner.info();
        let hidden = info.hidden.as_ref().filter(|areas| **areas != self.hidden);
        let frame = TraceFrame {
            refresh_hz: Some(info.refresh_hz).filter(|rate_hz| *rate_hz != self.refresh_hz),
            hidden: hidden.cloned(),
            quality: set.filter(|_| set != known),
            t_ns,
            located,
            views: *views,
            switch_reuse: std::mem::take(&mut self.switch_reuse),
            controller_model: std::mem::take(&mut self.models),
            input,
        };
        if frame.version() > self.version {
            self.raise_version(frame.version())?;
        }
        self.file.write_all(trace::frame_line(&frame)?.as_bytes())?;
        self.quality = [None, set.or(known)];
        self.refresh_hz = frame.refresh_hz.unwrap_or(self.refresh_hz);
        if let Some(hidden) = frame.hidden {
            self.hidden = hidden;
        }
        self.frames += 1;
        Ok(())
    }
}

impl XrSession for Recorder {
    fn info(&self) -> &SessionInfo {
        self.inner.info()
    }

    fn wait_frame(&mut self) -> Result<Option<FrameState>, XrError> {
        let frame = self.inner.wait_frame()?;
        self.input = Input::default();
        self.located = None;
        // A frame that renders nothing has no line; the switch then shows in the next. Twice is not at all.
        if frame.is_some_and(|frame| frame.switch_reuse) {
            self.switch_reuse = !self.switch_reuse;
            // It is no longer the quality that was written last.
            self.quality[1] = None;
        }
        Ok(frame)
    }

    fn begin_frame(&mut self) -> Result<(), XrError> {
        self.inner.begin_frame()
    }

    fn locate_views(&mut self, display_time_ns: i64) -> Result<Option<LocatedViews>, XrError> {
        let located = self.inner.locate_views(display_time_ns)?;
        self.located = located.map(|located| located.views);
        Ok(located)
    }

    fn relocate_views(&mut self, display_time_ns: i64) -> Result<Option<LocatedViews>, XrError> {
        self.inner.relocate_views(display_time_ns)
    }

    fn locate_input(&mut self, display_time_ns: i64) -> Result<Input, XrError> {
        self.input = self.inner.locate_input(display_time_ns)?;
        Ok(self.input.clone())
    }

    fn controller_model(&mut self) -> Result<Option<ControllerModel>, XrError> {
        let model = self.inner.controller_model()?;
        if let Some(ControllerModel { side, glb }) = &model {
            let name = controller_model::file_name(&self.path, *side);
            files::write_beside(&self.path.with_file_name(&name), |out| out.write_all(glb))
                .map_err(|cause| self.broken_off(cause))?;
            self.models[*side as usize] = Some(name);
        }
        Ok(model)
    }

    fn vibrate(&mut self, pulse: &Pulse) -> Result<(), XrError> {
        self.inner.vibrate(pulse)
    }

    fn move_wearer(&mut self, by_m: DVec3) {
        self.inner.move_wearer(by_m);
    }

    fn acquire_targets(&mut self) -> Result<RenderTargets, XrError> {
        self.inner.acquire_targets()
    }

    fn end_frame(&mut self, submission: FrameSubmission<'_>) -> Result<(), XrError> {
        // The inner session first: a runtime must get its frame even if the disk is full.
        self.inner.end_frame(submission)?;
        // As with reuse: if this frame has no line, the next has it.
        self.quality[0] = submission.quality.or(self.quality[0]);
        if let Some(views) = submission.rendered {
            self.write(submission.display_time_ns, views)
                .map_err(|cause| self.broken_off(cause))?;
        }
        Ok(())
    }
}
