//! The session layer: where frames, display times and eye poses come from.
//!
//! [`XrSession`] is the interface between a headset and the frame loop. A simulated headset
//! ([`SimulatedSession`]), the replay of a recording ([`ReplaySession`]) and an OpenXR runtime stand
//! behind it, and [`Recorder`] and [`Validated`] wrap any of them, so the frame loop cannot tell
//! them apart. One frame is always the same calls:
//!
//! ```text
//! while let Some(frame) = session.wait_frame()? {          // blocks; None = no more frames
//!     session.begin_frame()?;
//!     let mut views = if frame.should_render { session.locate_views(frame.predicted_display_time_ns)? } else { None };
//!     let input = session.locate_input(frame.predicted_display_time_ns)?; // hands, buttons, gaze
//!     let model = session.controller_model()?;             // if hands are shown
//!     match &views {
//!         Some(_) => {
//!             // Move things, trace photons; then where the eyes are by now.
//!             views = session.relocate_views(frame.predicted_display_time_ns)?.or(views);
//!             // Render both eyes, and only then take the images that they go to.
//!             let targets = session.acquire_targets()?;
//!         }
//!         None => {}                                       // nothing to draw, or no pose yet
//!     }
//!     session.end_frame(FrameSubmission::new(frame.predicted_display_time_ns, views.as_ref()))?;
//! }
//! ```
//!
//! Axes are OpenXR's: right-handed, +Y up, -Z forward, metres, radians, quaternions x, y, z, w. Times are
//! integer nanoseconds. Everything here is f64; positions become f32 only after the renderer has
//! subtracted its origin ([`LocatedViews::midpoint_in_world`]).
//!
//! Modules: [`view`] (poses, fields of view, projection), [`headset`] (profiles), [`simulated`],
//! [`input`] (hands, buttons, gaze), [`trace`] (the native recording and its reader), [`recorder`], [`trajectory`] (TUM and EuRoC head
//! motion), [`replay`], [`openxr`], [`hidden_area`], [`validation`].

mod action_values;
mod actions;
mod all_frames;
mod controller_model;
mod error;
mod frame_clock;
pub mod headset;
pub mod hidden_area;
pub mod input;
#[cfg(not(target_vendor = "apple"))]
pub mod openxr;
#[cfg_attr(
    target_vendor = "apple",
    allow(dead_code, reason = "no runtime to suggest all of it to")
)]
mod profiles;
pub mod recorder;
pub mod replay;
pub mod simulated;
pub mod simulated_hands;
mod simulated_joints;
mod text_lines;
mod toml_files;
pub mod trace;
pub mod trajectory;
pub mod validation;
pub mod view;

pub use action_values::{ActionValue, ActionValues};
pub use actions::{Action, ActionError, ActionKind, Actions};
pub use all_frames::all_frames;
pub use controller_model::ControllerModel;
pub use error::{ArgumentError, InputError, XrError};
pub use frame_clock::Pacing;
pub use headset::Headset;
pub use hidden_area::HiddenArea;
pub use input::{Button, Buttons, Hand, Input, Joint, Side, Tracked};
pub use recorder::Recorder;
pub use replay::{ReplayOptions, ReplaySession};
pub use simulated::SimulatedSession;
pub use simulated_hands::HandScript;
pub use trajectory::{TraceBody, TraceUp};
pub use validation::Validated;
pub use view::{Fov, Pose, RayInWorld, Tangents, View};

pub use stereolux_settings::{Motion, Quality};

use glam::DVec3;
use serde::Serialize;

/// A source of frames and eye poses. The module's text has the order of calls; a call out of that
/// order is [`XrError::CallOrder`], from every source, so that a loop that works with the simulated
/// headset also keeps to what OpenXR demands (OpenXR 1.1, section 10.5 "Frame Synchronization").
pub trait XrSession {
    /// What this session is and what it wants rendered.
    fn info(&self) -> &SessionInfo;

    /// Blocks until the next frame should be worked on and says when it will be seen.
    /// `None`: the stream has ended (frame limit, end of a recording, a runtime that asked to quit).
    ///
    /// # Errors
    /// The runtime is lost, or the call is out of order.
    fn wait_frame(&mut self) -> Result<Option<FrameState>, XrError>;

    /// Starts the frame that [`XrSession::wait_frame`] announced.
    ///
    /// # Errors
    /// The runtime is lost, or the call is out of order.
    fn begin_frame(&mut self) -> Result<(), XrError>;

    /// Both eyes as they will be at `display_time_ns`. `None`: no usable pose is known yet, so end the
    /// frame without a layer. Callable between wait and end, more than once.
    ///
    /// # Errors
    /// The runtime is lost, the call is out of order, or a replay is asked for a time it does not hold.
    fn locate_views(&mut self, display_time_ns: i64) -> Result<Option<LocatedViews>, XrError>;

    /// The same once more, as late as can be before the eyes are rendered: a tracker knows more by then. What was located
    /// first is what all but the eyes goes by. Called after begin and before end, at most once a frame.
    ///
    /// # Errors
    /// As [`XrSession::locate_views`].
    fn relocate_views(&mut self, display_time_ns: i64) -> Result<Option<LocatedViews>, XrError> {
        self.locate_views(display_time_ns)
    }

    /// Hands, buttons and gaze as they will be at `display_time_ns`; at rest from a source that has none. Called once a
    /// frame, between begin and end.
    ///
    /// # Errors
    /// As [`XrSession::locate_views`].
    fn locate_input(&mut self, display_time_ns: i64) -> Result<Input, XrError> {
        let _ = display_time_ns;
        Ok(Input::default())
    }

    /// What one of the controllers looks like, once and as soon as that is known. Called at most once a frame, after
    /// [`XrSession::locate_input`], by who shows it.
    ///
    /// # Errors
    /// The runtime is lost, or a recording cannot be written.
    fn controller_model(&mut self) -> Result<Option<ControllerModel>, XrError> {
        Ok(None)
    }

    /// Where to render this frame. Called after begin and before end, only for a frame that will carry a
    /// layer, and once its eyes are on their way: a runtime acquires its swapchain images here and releases them in
    /// [`XrSession::end_frame`].
    ///
    /// # Errors
    /// The runtime is lost, or the call is out of order.
    fn acquire_targets(&mut self) -> Result<RenderTargets, XrError>;

    /// Submits the frame. Every begun frame is ended exactly once, with or without a layer.
    ///
    /// # Errors
    /// The runtime is lost, the call is out of order, or a recording cannot be written.
    fn end_frame(&mut self, submission: FrameSubmission<'_>) -> Result<(), XrError>;

    /// Lets a controller vibrate; does nothing where there is none that can.
    ///
    /// # Errors
    /// The runtime is lost.
    fn vibrate(&mut self, pulse: &Pulse) -> Result<(), XrError> {
        let _ = pulse;
        Ok(())
    }

    /// Moves the wearer, eyes and hands, to another place in the world from the next frame on; called between frames. A
    /// replay shows what was recorded, moves and all, and does nothing here.
    fn move_wearer(&mut self, by_m: DVec3) {
        let _ = by_m;
    }
}

/// What vibrates.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PulseOf {
    /// The controller in a hand.
    Hand(Side),
    /// What the application's action of that name, of kind haptic, is bound to.
    Action(String),
}

/// A vibration.
#[derive(Clone, Debug, PartialEq)]
pub struct Pulse {
    /// Of what.
    pub of: PulseOf,
    /// How long, seconds; 0: the shortest that the controller can do.
    pub duration_s: f64,
    /// How strong, 0 to 1.
    pub amplitude: f64,
}

/// What a session is. Refresh rate and hidden areas may change while it waits for a frame, the rest is fixed for its life.
#[derive(Clone, Debug, PartialEq)]
pub struct SessionInfo {
    /// Kind and detail for messages and `run.json`, such as `simulated (sway)`.
    pub source: String,
    /// Headset name: a profile's, or what the recording or the runtime calls it.
    pub headset: String,
    /// Display refresh rate, hertz, positive.
    pub refresh_hz: f64,
    /// Pixels per eye (width, height) that the source asks for; a native recording does not say.
    pub recommended_size: Option<[u32; 2]>,
    /// Area hidden by each eye's lens, left and right, nothing as yet included; `None`: none, ever.
    pub hidden: Option<[HiddenArea; 2]>,
    /// Whether [`RenderTargets`] may ask for depth.
    pub takes_depth: bool,
}

impl SessionInfo {
    /// Of a source that shows a profile's headset.
    #[must_use]
    pub fn of_profile(source: String, headset: &Headset) -> Self {
        Self {
            source,
            headset: headset.name.clone(),
            refresh_hz: headset.refresh_hz,
            recommended_size: Some(headset.size),
            hidden: None,
            takes_depth: false,
        }
    }
}

/// Who says with what quality a session's frames are rendered.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum QualityFrom {
    /// The application.
    #[default]
    Application,
    /// The recording, whatever the application asks for: another one from this frame on, or as before.
    Recording(Option<Quality>),
}

/// One frame's timing, from [`XrSession::wait_frame`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameState {
    /// When this frame will be seen, nanoseconds on the session's own clock; strictly increasing.
    pub predicted_display_time_ns: i64,
    /// Nanoseconds between two refreshes, positive.
    pub period_ns: i64,
    /// False: nobody will see this frame; end it without a layer.
    pub should_render: bool,
    /// The wearer switches stereo reuse on or off from this frame on.
    pub switch_reuse: bool,
    /// Who says with what quality it is rendered.
    pub quality: QualityFrom,
}

/// Which parts of a pose the tracker vouches for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct ViewFlags {
    /// Positions may be used.
    pub position_valid: bool,
    /// Orientations may be used.
    pub orientation_valid: bool,
}

impl ViewFlags {
    /// Both valid.
    pub const VALID: Self = Self {
        position_valid: true,
        orientation_valid: true,
    };
}

/// Both eyes at one display time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LocatedViews {
    /// Left eye, right eye.
    pub views: [View; 2],
    /// Tracking flags.
    pub flags: ViewFlags,
    /// True if the tracker had no usable pose and these are the last good views.
    #[serde(skip)]
    pub repeated: bool,
}

impl LocatedViews {
    /// Views that are valid and fresh.
    #[must_use]
    pub fn valid(views: [View; 2]) -> Self {
        Self {
            views,
            flags: ViewFlags::VALID,
            repeated: false,
        }
    }

    /// As [`View::midpoint_in_world`].
    #[must_use]
    pub fn midpoint_in_world(&self) -> DVec3 {
        View::midpoint_in_world(&self.views)
    }
}

/// Images that belong to a runtime, one per eye, left and right, for one frame.
#[derive(Clone, Debug)]
pub struct RuntimeTargets {
    /// Colour; the texture's format says whether the hardware encodes sRGB. What is written is display light.
    pub color: [wgpu::TextureView; 2],
    /// Depth, where it is submitted: `near_m` / distance along the eye's axis, so 1 at `near_m` and 0 at infinity.
    pub depth: Option<[wgpu::TextureView; 2]>,
    /// Distance at which depth is 1, metres.
    pub near_m: f32,
}

/// Where a frame is rendered to.
#[derive(Debug)]
#[non_exhaustive]
pub enum RenderTargets {
    /// The source takes no images: the frame loop renders into textures of its own.
    FrameLoopOwned,
    /// The frame loop renders as always, and the result goes into these before the frame ends.
    Runtime(Box<RuntimeTargets>),
}

/// A finished frame, for [`XrSession::end_frame`].
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct FrameSubmission<'a> {
    /// The display time that [`XrSession::wait_frame`] predicted for this frame, nanoseconds.
    pub display_time_ns: i64,
    /// The views that the images were really rendered with; `None` if nothing was rendered.
    pub rendered: Option<&'a LocatedViews>,
    /// Pixels of each eye's image that were rendered, from its upper left corner: width, height. `None`: all.
    pub size: Option<[u32; 2]>,
    /// The quality that was set in this frame, if one was, and counts from it on.
    pub quality: Option<Quality>,
}

impl<'a> FrameSubmission<'a> {
    /// A frame rendered with `rendered`, or an empty one.
    #[must_use]
    pub fn new(display_time_ns: i64, rendered: Option<&'a LocatedViews>) -> Self {
        Self {
            display_time_ns,
            rendered,
            size: None,
            quality: None,
        }
    }

    /// The same with the quality that was set in the frame.
    #[must_use]
    pub fn with_quality(mut self, quality: Option<Quality>) -> Self {
        self.quality = quality;
        self
    }

    /// The same with images that were rendered only in part.
    #[must_use]
    pub fn of_size(mut self, size: [u32; 2]) -> Self {
        self.size = Some(size);
        self
    }
}
