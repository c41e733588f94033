//! A session on an OpenXR runtime.
//!
//! [`Runtime`] finds the loader, the runtime and its headset and opens the device that the runtime dictates;
//! [`OpenXrSession`] runs the session on it, and another one where `recovery` puts one in the place of a lost one. The
//! runtime's poses are in its LOCAL or STAGE space; `locomotion` holds where that space lies in the world, and everything
//! that leaves this module is in the world.
//!
//! Calls into Vulkan and whatever else cannot be checked by the compiler are in
//! [`stereolux_gpu::vulkan_interop::openxr`].

mod controller_models;
mod controls;
mod display_clock;
mod hands;
mod lifecycle;
mod live;
mod locomotion;
mod own_actions;
mod passthrough;
mod recovery;
mod runtime;
mod states;
mod swapchain;
mod trackers;

use std::time::{Duration, Instant};

use glam::{DQuat, DVec3};
use openxr as xr;

pub use runtime::{Runtime, RuntimeError};

use self::controller_models::ControllerModels;
use self::controls::Wishes;
use self::display_clock::DisplayClock;
use self::hands::Asked;
use self::lifecycle::Step;
use self::live::{Live, UnderWay};
use self::locomotion::Locomotion;
use self::runtime::{STEREO, is_gone};
use super::frame_clock::{FrameOrder, period_ns};
use super::hidden_area::HiddenArea;
use super::view::{Fov, Pose, View};
use super::{
    Actions, ControllerModel, FrameState, FrameSubmission, Input, LocatedViews, Pulse, QualityFrom,
    RenderTargets, RuntimeTargets, SessionInfo, ViewFlags, XrError, XrSession,
};
use stereolux_gpu::GpuContext;
use stereolux_gpu::vulkan_interop::openxr::{self as interop, LayerView};
use stereolux_settings::{OpenXrSettings, Space};

/// Height of the eyes above the floor at the scene's start, metres, for STAGE space: a standing adult's.
const EYE_HEIGHT_M: f64 = 1.6;
/// Refresh rate that is written down if the runtime does not tell its own, hertz.
const UNKNOWN_REFRESH_HZ: f64 = 90.0;
/// Share by which periods of one rate may differ: runtimes round, and measure.
const SAME_RATE: f64 = 0.02;
/// How long the runtime may take to end a session.
const LONGEST_GOODBYE: Duration = Duration::from_secs(3);
/// Pause between two looks at the events of a session that shows nothing.
const IDLE_PAUSE: Duration = Duration::from_millis(10);
/// After so long without frames the wearer is told what is waited for.
const LONGEST_SILENCE: Duration = Duration::from_secs(2);
/// Distance at which the depth image holds 1, metres.
const NEAR_M: f32 = 0.05;

/// How a session is to be run.
#[derive(Clone, Debug)]
pub struct SessionOptions {
    /// Pixels per eye.
    pub size: [u32; 2],
    /// Head pose in the world at which the wearer starts; only its heading turns the space.
    pub start: Pose,
    /// Frames with a layer after which the session ends; `None`: when the wearer or the runtime ends it.
    pub frame_limit: Option<u64>,
    /// Space, format, layers, locomotion.
    pub settings: OpenXrSettings,
    /// Whether the wearer's room is shown where images are transparent, if the runtime can ([`OpenXrSession::shows_room`]).
    pub passthrough: bool,
    /// The application's own actions.
    pub actions: Actions,
}

/// The session of a run. Fields are dropped in order: the runtime's session before its instance.
pub struct OpenXrSession {
    info: SessionInfo,
    order: FrameOrder,
    locomotion: Locomotion,
    options: SessionOptions,
    /// `None`: it was lost, and none took its place.
    live: Option<Live>,
    context: GpuContext,
    runtime: Runtime,
    /// The runtime wants this program to quit, or has gone.
    is_over: bool,
    /// The wearer pressed the button.
    wants_to_quit: bool,
    /// Frames that were shown.
    frames: u64,
    /// Sessions that were lost since the last frame.
    losses: u32,
    models: ControllerModels,
    clock: DisplayClock,
    last_head: Option<Pose>,
}

impl OpenXrSession {
    /// Creates the session and its swapchains on the device of [`Runtime::open_device`].
    ///
    /// # Errors
    /// [`RuntimeError::Call`], [`RuntimeError::Vulkan`] and [`RuntimeError::Binding`].
    pub fn create(
        runtime: Runtime,
        context: &GpuContext,
        mut options: SessionOptions,
    ) -> Result<Self, RuntimeError> {
        let live = Live::new(&runtime, context, &options)?;
        if let Some(reason) = &live.behind.lacks {
            log::warn!(
                "environment.passthrough: {} does not show the room ({reason}); surroundings are shown as they are",
                runtime.name()
            );
            options.passthrough = false;
        }
        let settings = &options.settings;
        let world_from_space = match settings.space {
            Space::Local => options.start.position,
            Space::Stage => options.start.position - DVec3::Y * EYE_HEIGHT_M,
        };
        let info = SessionInfo {
            source: format!("openxr ({})", runtime.name()),
            headset: runtime.headset().to_owned(),
            refresh_hz: refresh_rate(&runtime, &live.session, settings.refresh_hz),
            recommended_size: Some(runtime.recommended_size()),
            hidden: hidden_areas(&runtime, &live.session, settings),
            takes_depth: live.image_format().1,
        };
        let locomotion = Locomotion::new(
            Pose::new(
                world_from_space,
                DQuat::from_rotation_y(options.start.heading_rad()),
            ),
            settings,
        );
        Ok(Self {
            info,
            order: FrameOrder::default(),
            locomotion,
            options,
            live: Some(live),
            models: ControllerModels::new(runtime.used.msft_controller_model),
            context: context.clone(),
            runtime,
            is_over: false,
            wants_to_quit: false,
            frames: 0,
            losses: 0,
            clock: DisplayClock::default(),
            last_head: None,
        })
    }

    /// The colour format of the images, and whether depth goes with them.
    #[must_use]
    pub fn image_format(&self) -> Option<(wgpu::TextureFormat, bool)> {
        self.live.as_ref().map(Live::image_format)
    }

    /// Whether images are to be transparent where the wearer's room is seen: it was asked for, and the runtime shows it.
    #[must_use]
    pub fn shows_room(&self) -> bool {
        self.options.passthrough
    }

    /// The runtime's session, unless it is lost.
    fn usable(&mut self) -> Option<&mut Live> {
        self.live.as_mut().filter(|live| live.loss.is_none())
    }

    /// Whether frames are waited for, begun and ended.
    fn is_running(&mut self) -> bool {
        self.usable().is_some_and(|live| live.lifecycle.running())
    }

    /// Notes that the session is lost, by what `loss` says: another takes its place before the next frame.
    fn note_loss(&mut self, loss: String) {
        if let Some(live) = self.usable() {
            log::debug!("the OpenXR session is lost: {loss}");
            live.loss = Some(loss);
        }
    }

    /// Takes what `call` said: a lost session is noted, and anything else is an error of this run.
    ///
    /// # Errors
    /// Any other failure. A runtime that is gone needs no more calls.
    fn fail(&mut self, call: &'static str, result: xr::sys::Result) -> Result<(), XrError> {
        if result == xr::sys::Result::ERROR_SESSION_LOST {
            self.note_loss(format!("{call}: {result}"));
            return Ok(());
        }
        let gone = if is_gone(result) {
            self.is_over = true;
            " (the OpenXR runtime is gone; start it again)"
        } else {
            ""
        };
        Err(self.with_frames_kept(&format!("{call}: {result}{gone}")))
    }

    fn with_frames_kept(&self, what: &str) -> XrError {
        let frames = self.frames;
        XrError::Runtime(format!("{what}; {frames} frames were shown and are kept"))
    }

    /// Reads the runtime's events and does what they ask for. Those of a lost session ask for nothing.
    fn poll_events(&mut self) -> Result<(), XrError> {
        let mut buffer = xr::EventDataBuffer::new();
        loop {
            let event = match self.runtime.instance.poll_event(&mut buffer) {
                Ok(Some(event)) => event,
                Ok(None) => return Ok(()),
                Err(error) => return self.fail("xrPollEvent", error),
            };
            let usable = self.live.as_mut().filter(|live| live.loss.is_none());
            match (event, usable) {
                (xr::Event::SessionStateChanged(change), Some(live))
                    if change.session() == live.session.as_raw() =>
                {
                    log::info!("OpenXR session: {}", lifecycle::name(change.state()));
                    match live.lifecycle.enter(change.state()) {
                        Step::None => {}
                        Step::Begin => {
                            if let Err(error) = live.session.begin(STEREO) {
                                self.fail("xrBeginSession", error)?;
                            }
                        }
                        Step::End => {
                            if let Err(error) = live.session.end() {
                                self.fail("xrEndSession", error)?;
                            }
                        }
                        Step::Quit => self.is_over = true,
                        Step::Lost => self.note_loss("the runtime announces it".to_owned()),
                    }
                }
                (xr::Event::InstanceLossPending(_), _) => {
                    return self.fail(
                        "the runtime announces the loss of the instance",
                        xr::sys::Result::ERROR_INSTANCE_LOST,
                    );
                }
                (xr::Event::VisibilityMaskChangedKHR(change), Some(live))
                    if change.session() == live.session.as_raw() =>
                {
                    log::info!("the runtime changed its visibility mask");
                    let session = live.session.clone();
                    self.follow_hidden(&session);
                }
                (xr::Event::DisplayRefreshRateChangedFB(change), Some(_)) => {
                    let rate = change.to_display_refresh_rate();
                    if is_usable_rate(&rate) {
                        log::info!("the display now refreshes at {rate} Hz");
                        self.info.refresh_hz = f64::from(rate);
                    }
                }
                (xr::Event::ReferenceSpaceChangePending(_), Some(_)) => {
                    log::info!("the runtime recentred its space");
                }
                (xr::Event::EventsLost(lost), _) => {
                    log::warn!("the runtime dropped {} events", lost.lost_event_count());
                }
                _ => {}
            }
        }
    }

    /// Takes over what the lenses hide now, if anything may be hidden.
    fn follow_hidden(&mut self, session: &xr::Session<xr::Vulkan>) {
        if let Some(hidden) = &mut self.info.hidden
            && let Some(now) = hidden_areas(&self.runtime, session, &self.options.settings)
        {
            *hidden = now;
        }
    }

    /// Asks the runtime to end the session and follows until it has: without frames some never get there. A session that
    /// is lost meanwhile has ended.
    fn finish(&mut self) -> Result<(), XrError> {
        let Some(live) = self.usable().filter(|live| live.lifecycle.running()) else {
            return Ok(());
        };
        if let Err(error) = live.session.request_exit() {
            return self.fail("xrRequestExitSession", error);
        }
        let began = Instant::now();
        while !self.is_over && began.elapsed() < LONGEST_GOODBYE {
            self.poll_events()?;
            let Some(live) = self.usable() else {
                return Ok(());
            };
            if live.lifecycle.running() {
                let state = match live.waiter.wait() {
                    Ok(state) => state,
                    Err(error) => return self.fail("xrWaitFrame", error),
                };
                if let Err(error) = live.begin() {
                    return self.fail("xrBeginFrame", error);
                }
                self.end_empty(state.predicted_display_time)?;
            } else if !self.is_over {
                std::thread::sleep(IDLE_PAUSE);
            }
        }
        Ok(())
    }

    fn end_empty(&mut self, time: xr::Time) -> Result<(), XrError> {
        let Some(live) = self.usable() else {
            return Ok(());
        };
        live.under_way = UnderWay::Nothing;
        let ended = {
            let _turn = live.queue_turn.take();
            live.stream.end(time, live.behind.mode, &[])
        };
        match ended {
            Ok(()) => {
                self.losses = 0;
                Ok(())
            }
            Err(error) => self.fail("xrEndFrame", error),
        }
    }

    /// Waits for a frame of the session and reads the controls; `None`: it was lost over that.
    fn next_frame(&mut self) -> Result<Option<FrameState>, XrError> {
        let Some(live) = self.usable() else {
            return Ok(None);
        };
        let state = match live.waiter.wait() {
            Ok(state) => state,
            Err(error) => return self.fail("xrWaitFrame", error).map(|()| None),
        };
        live.under_way = UnderWay::Waited;
        let input = match live.controls.read(&live.session) {
            Ok(input) => input,
            Err(error) => return self.fail("xrSyncActions", error).map(|()| None),
        };
        let predicted_ns = state.predicted_display_period.as_nanos().max(1);
        if !self.runtime.used.fb_display_refresh_rate {
            self.follow_period(predicted_ns);
        }
        let last_ns = self.clock.last_ns();
        let time_ns = self
            .clock
            .next_ns(state.predicted_display_time, predicted_ns);
        let seconds = last_ns.map_or(0.0, |last| time_ns.saturating_sub(last) as f64 * 1e-9);
        self.follow_controls(&input, seconds);
        Ok(Some(FrameState {
            predicted_display_time_ns: time_ns,
            // Of the rate, which recordings hold.
            period_ns: period_ns(self.info.refresh_hz),
            should_render: state.should_render,
            switch_reuse: input.switch_reuse,
            quality: QualityFrom::Application,
        }))
    }

    /// A runtime that tells no refresh rate tells it by its frames.
    fn follow_period(&mut self, period_ns: i64) {
        let rate_hz = 1e9 / period_ns as f64;
        let is_other = (rate_hz / self.info.refresh_hz - 1.0).abs() > SAME_RATE;
        if is_other && super::headset::REFRESH_RANGE_HZ.contains(&rate_hz) {
            self.info.refresh_hz = rate_hz;
        }
    }

    /// Moves, turns, and notes what else the wearer wants, `seconds` after the frame before.
    fn follow_controls(&mut self, input: &Wishes, seconds: f64) {
        if let Some(head) = self.last_head {
            // Turned first: the head stays where it is, and the walk goes where it then looks.
            let in_space = inverse(&self.locomotion.world_from_space()).then(&head);
            self.locomotion.turn(&head, input.turn, seconds);
            let head = self.locomotion.world_from_space().then(&in_space);
            self.locomotion.walk(&head, input.walk, seconds);
            // The head of this frame is not known yet; the last one has moved along.
            self.last_head = Some(self.locomotion.world_from_space().then(&in_space));
        }
        if input.quit {
            log::info!("the wearer quits");
            self.wants_to_quit = true;
        }
    }
}

impl XrSession for OpenXrSession {
    fn info(&self) -> &SessionInfo {
        &self.info
    }

    fn wait_frame(&mut self) -> Result<Option<FrameState>, XrError> {
        self.order.may_wait()?;
        let enough = self
            .options
            .frame_limit
            .is_some_and(|limit| self.frames >= limit);
        if enough || self.wants_to_quit || stereolux_base::interrupt::requested() {
            self.finish()?;
            return Ok(None);
        }
        let (began, mut told) = (Instant::now(), false);
        loop {
            // The one place where a session is replaced, whichever call said that it is lost.
            let loss = self.live.as_ref().and_then(|live| live.loss.clone());
            if let Some(loss) = loss {
                self.recover(&loss)?;
            }
            self.poll_events()?;
            if self.is_over || stereolux_base::interrupt::requested() {
                self.finish()?;
                return Ok(None);
            }
            if !self.is_running() {
                if !told && began.elapsed() > LONGEST_SILENCE {
                    told = true;
                    log::warn!(
                        "{} has not begun to show frames; put the headset on, or end with Ctrl-C",
                        self.info.source
                    );
                }
                std::thread::sleep(IDLE_PAUSE);
            } else if let Some(frame) = self.next_frame()? {
                self.order.waited(&frame);
                return Ok(Some(frame));
            }
        }
    }

    fn begin_frame(&mut self) -> Result<(), XrError> {
        self.order.begin()?;
        let Some(live) = self.usable() else {
            return Ok(());
        };
        if let Err(error) = live.begin() {
            return self.fail("xrBeginFrame", error);
        }
        live.under_way = UnderWay::Begun;
        Ok(())
    }

    fn locate_views(&mut self, display_time_ns: i64) -> Result<Option<LocatedViews>, XrError> {
        self.order.may_locate("locate_views")?;
        let time = self.clock.of_runtime(display_time_ns);
        let Some(live) = self.usable() else {
            return Ok(None);
        };
        let (flags, views) = match live.session.locate_views(STEREO, time, &live.space) {
            Ok(located) => located,
            Err(error) => return self.fail("xrLocateViews", error).map(|()| None),
        };
        let [left, right] = views.as_slice() else {
            return Ok(None);
        };
        let world_from_space = self.locomotion.world_from_space();
        let located = LocatedViews {
            views: [left, right].map(|view| view_in_world(&world_from_space, view)),
            flags: ViewFlags {
                position_valid: flags.contains(xr::ViewStateFlags::POSITION_VALID),
                orientation_valid: flags.contains(xr::ViewStateFlags::ORIENTATION_VALID),
            },
            repeated: false,
        };
        // Walking by a head that is nowhere would leave the wearer nowhere for good.
        if super::validation::check_views(&located).is_ok() {
            self.last_head = Some(Pose::new(
                located.midpoint_in_world(),
                located.views[0].orientation,
            ));
        }
        Ok(Some(located))
    }

    fn locate_input(&mut self, display_time_ns: i64) -> Result<Input, XrError> {
        self.order.may_locate("locate_input")?;
        let time = self.clock.of_runtime(display_time_ns);
        let world_from_base = self.locomotion.world_from_space();
        let Some(live) = self.usable() else {
            return Ok(Input::default());
        };
        let at = Asked {
            base: &live.space,
            world_from_base,
            time,
        };
        let input = live.controls.locate(&live.session, &at).or_else(|error| {
            self.fail("reading the hands", error)
                .map(|()| Input::default())
        })?;
        self.models.note(&input);
        Ok(input)
    }

    fn controller_model(&mut self) -> Result<Option<ControllerModel>, XrError> {
        let Some(live) = self.live.as_ref().filter(|live| live.loss.is_none()) else {
            return Ok(None);
        };
        let next = self.models.next(&live.session);
        next.or_else(|error| self.fail("the controllers' models", error).map(|()| None))
    }

    fn vibrate(&mut self, pulse: &Pulse) -> Result<(), XrError> {
        let Some(live) = self.usable() else {
            return Ok(());
        };
        let sent = live.controls.vibrate(&live.session, pulse);
        sent.or_else(|error| self.fail("xrApplyHapticFeedback", error))
    }

    fn move_wearer(&mut self, by_m: DVec3) {
        self.locomotion.move_by(by_m);
        if let Some(head) = &mut self.last_head {
            head.position += by_m;
        }
    }

    fn acquire_targets(&mut self) -> Result<RenderTargets, XrError> {
        self.order.may_acquire()?;
        let Some(live) = self.usable() else {
            return Ok(RenderTargets::FrameLoopOwned);
        };
        let mut acquire = || {
            let [left, right] = &mut live.eyes;
            Ok((left.acquire()?, right.acquire()?))
        };
        match acquire() {
            Ok(((left, left_depth), (right, right_depth))) => {
                Ok(RenderTargets::Runtime(Box::new(RuntimeTargets {
                    color: [left, right],
                    depth: left_depth
                        .zip(right_depth)
                        .map(|(left, right)| [left, right]),
                    near_m: NEAR_M,
                })))
            }
            Err((call, error)) => {
                self.fail(call, error)?;
                Ok(RenderTargets::FrameLoopOwned)
            }
        }
    }

    fn end_frame(&mut self, submission: FrameSubmission<'_>) -> Result<(), XrError> {
        self.order.end(submission.display_time_ns)?;
        let time = self.clock.of_runtime(submission.display_time_ns);
        let Some(rendered) = submission.rendered else {
            return self.end_empty(time);
        };
        let size = submission.size.unwrap_or(self.options.size);
        let space_from_world = inverse(&self.locomotion.world_from_space());
        // A frame in which the session was lost is not shown, and does not count.
        let Some(live) = self.usable() else {
            return Ok(());
        };
        let mut release = || {
            let [left, right] = &mut live.eyes;
            left.release()?;
            right.release()
        };
        if let Err((call, error)) = release() {
            return self.fail(call, error);
        }
        live.under_way = UnderWay::Nothing;
        // The views that were rendered, back in the runtime's space: f64 until the last step, so that they round to the
        // f32 numbers that the runtime gave.
        let [left, right] = &live.eyes;
        let [left_view, right_view] = &rendered.views;
        let layers = [(left, left_view), (right, right_view)].map(|(eye, view)| {
            let (pose, fov) = pose_in_space(&space_from_world, view);
            LayerView {
                pose,
                fov,
                color: eye.color(),
                depth: eye.depth(),
            }
        });
        let turn = live.queue_turn.take();
        let ended = interop::end_frame_with_layer(
            &mut live.stream,
            time,
            &live.behind.over(),
            &live.space,
            size,
            NEAR_M,
            layers,
        );
        drop(turn);
        match ended {
            Ok(()) => {
                self.frames += 1;
                self.losses = 0;
                Ok(())
            }
            Err(error) => self.fail("xrEndFrame", error),
        }
    }
}

impl Drop for OpenXrSession {
    fn drop(&mut self) {
        // After an error the session may still be running: leave it in order, as far as the runtime plays along.
        if self.is_over || !self.is_running() {
            return;
        }
        let Some(live) = self.usable() else { return };
        let under_way = live.under_way;
        if under_way == UnderWay::Waited
            && let Err(error) = live.begin()
        {
            log::debug!("xrBeginFrame: {error}");
            return;
        }
        let has_frame = under_way != UnderWay::Nothing;
        let ended = match self.clock.last_ns().filter(|_| has_frame) {
            Some(time_ns) => self.end_empty(self.clock.of_runtime(time_ns)),
            None => Ok(()),
        };
        if let Err(error) = ended.and_then(|()| self.finish()) {
            log::debug!("{error}");
        }
    }
}

fn inverse(pose: &Pose) -> Pose {
    let orientation = pose.orientation.conjugate();
    Pose::new(-(orientation * pose.position), orientation)
}

fn vector_of(v: xr::Vector3f) -> DVec3 {
    DVec3::new(f64::from(v.x), f64::from(v.y), f64::from(v.z))
}

/// A runtime's pose; its quaternion is as long as the runtime has it.
fn pose_of(pose: &xr::Posef) -> Pose {
    let q = pose.orientation;
    let orientation = DQuat::from_xyzw(
        f64::from(q.x),
        f64::from(q.y),
        f64::from(q.z),
        f64::from(q.w),
    );
    Pose::new(vector_of(pose.position), orientation)
}

fn view_in_world(world_from_space: &Pose, view: &xr::View) -> View {
    let eye = world_from_space.then(&pose_of(&view.pose));
    View {
        position_in_world: eye.position,
        orientation: eye.orientation,
        fov: Fov {
            angle_left: f64::from(view.fov.angle_left),
            angle_right: f64::from(view.fov.angle_right),
            angle_up: f64::from(view.fov.angle_up),
            angle_down: f64::from(view.fov.angle_down),
        },
    }
}

fn pose_in_space(space_from_world: &Pose, view: &View) -> (xr::Posef, xr::Fovf) {
    let eye = space_from_world.then(&Pose::new(view.position_in_world, view.orientation));
    let position = eye.position.as_vec3();
    let orientation = eye.orientation.normalize().as_quat();
    (
        xr::Posef {
            orientation: xr::Quaternionf {
                x: orientation.x,
                y: orientation.y,
                z: orientation.z,
                w: orientation.w,
            },
            position: xr::Vector3f {
                x: position.x,
                y: position.y,
                z: position.z,
            },
        },
        xr::Fovf {
            angle_left: view.fov.angle_left as f32,
            angle_right: view.fov.angle_right as f32,
            angle_up: view.fov.angle_up as f32,
            angle_down: view.fov.angle_down as f32,
        },
    )
}

/// Asks for `wanted_hz` (0: leaves it to the runtime) and says what the display does.
fn refresh_rate(runtime: &Runtime, session: &xr::Session<xr::Vulkan>, wanted_hz: f64) -> f64 {
    if !runtime.used.fb_display_refresh_rate {
        if wanted_hz > 0.0 {
            log::warn!(
                "openxr.refresh_hz: the runtime does not let programs choose the refresh rate"
            );
        }
        return UNKNOWN_REFRESH_HZ;
    }
    let mut rates = session
        .enumerate_display_refresh_rates()
        .unwrap_or_default();
    // What is no number, or no rate of a display.
    rates.retain(is_usable_rate);
    if wanted_hz > 0.0 {
        let nearest = rates.iter().copied().min_by(|a, b| {
            (f64::from(*a) - wanted_hz)
                .abs()
                .total_cmp(&(f64::from(*b) - wanted_hz).abs())
        });
        match nearest {
            Some(rate) => {
                if (f64::from(rate) - wanted_hz).abs() > 0.5 {
                    log::warn!(
                        "openxr.refresh_hz = {wanted_hz}: the nearest that the display can do is {rate} Hz"
                    );
                }
                if let Err(error) = session.request_display_refresh_rate(rate) {
                    log::warn!("openxr.refresh_hz = {wanted_hz}: {error}");
                }
            }
            None => log::warn!("openxr.refresh_hz: the runtime lists no refresh rates"),
        }
    }
    session
        .get_display_refresh_rate()
        .ok()
        .filter(is_usable_rate)
        .or(rates.first().copied())
        .map_or(UNKNOWN_REFRESH_HZ, f64::from)
}

fn is_usable_rate(rate_hz: &f32) -> bool {
    super::headset::REFRESH_RANGE_HZ.contains(&f64::from(*rate_hz))
}

/// What the lenses hide, if the runtime tells and the settings want it; where that is nothing, it may become something.
fn hidden_areas(
    runtime: &Runtime,
    session: &xr::Session<xr::Vulkan>,
    settings: &OpenXrSettings,
) -> Option<[HiddenArea; 2]> {
    if !settings.visibility_mask || !runtime.used.khr_visibility_mask {
        return None;
    }
    let area = |eye| {
        let mask = session
            .get_visibility_mask_khr(STEREO, eye, xr::VisibilityMaskTypeKHR::HIDDEN_TRIANGLE_MESH)
            .map_err(|error| log::warn!("xrGetVisibilityMaskKHR: {error}"))
            .ok()?;
        let vertices: Vec<[f64; 2]> = mask
            .vertices
            .iter()
            .map(|v| [f64::from(v.x), f64::from(v.y)])
            .collect();
        Some(HiddenArea::from_mesh(&vertices, &mask.indices))
    };
    Some([area(0)?, area(1)?])
}
