//! A session on an OpenXR runtime.
//!
//! [`Runtime`] finds the loader, the runtime and its headset and opens the device that the runtime dictates;
//! [`OpenXrSession`] runs the session on it. The runtime's poses are in its LOCAL or STAGE space; `locomotion` holds where
//! that space lies in the world, and everything that leaves this module is in the world.
//!
//! Calls into Vulkan and whatever else cannot be checked by the compiler are in
//! [`stereolux_gpu::vulkan_interop::openxr`].

mod controls;
mod hands;
mod lifecycle;
mod locomotion;
mod own_actions;
mod runtime;
mod states;
mod swapchain;
mod trackers;

use std::time::{Duration, Instant};

use glam::{DQuat, DVec3};
use openxr as xr;

pub use runtime::{Runtime, RuntimeError};

use self::controls::Controls;
use self::lifecycle::{Lifecycle, Step};
use self::locomotion::Locomotion;
use self::runtime::{STEREO, failed};
use self::swapchain::EyeSwapchains;
use super::frame_clock::FrameOrder;
use super::hidden_area::HiddenArea;
use super::view::{Fov, Pose, View};
use super::{
    Actions, FrameState, FrameSubmission, Input, LocatedViews, Pulse, QualityFrom, RenderTargets,
    RuntimeTargets, SessionInfo, ViewFlags, XrError, XrSession,
};
use stereolux_gpu::GpuContext;
use stereolux_gpu::vulkan_interop::openxr::{self as interop, LayerView};
use stereolux_settings::{OpenXrSettings, Space};

/// Height of the eyes above the floor at the scene's start, metres, for STAGE space: a standing adult's.
const EYE_HEIGHT_M: f64 = 1.6;
/// Refresh rate that is written down if the runtime does not tell its own, hertz.
const UNKNOWN_REFRESH_HZ: f64 = 90.0;
/// How long the runtime may take to end a session.
const LONGEST_GOODBYE: Duration = Duration::from_secs(3);
/// Pause between two looks at the events of a session that shows nothing.
const IDLE_PAUSE: Duration = Duration::from_millis(10);
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
    /// The application's own actions.
    pub actions: Actions,
}

/// A session. Fields are dropped in order: images before their session, the session before its instance.
pub struct OpenXrSession {
    info: SessionInfo,
    order: FrameOrder,
    lifecycle: Lifecycle,
    locomotion: Locomotion,
    options: SessionOptions,
    eyes: Option<[EyeSwapchains; 2]>,
    controls: Controls,
    space: xr::Space,
    stream: xr::FrameStream<xr::Vulkan>,
    waiter: xr::FrameWaiter,
    session: xr::Session<xr::Vulkan>,
    device: wgpu::Device,
    runtime: Runtime,
    /// The runtime wants this program to quit, or has gone.
    is_over: bool,
    /// The wearer pressed the button.
    wants_to_quit: bool,
    /// A frame was begun and not ended.
    in_frame: bool,
    frames: u64,
    last_time_ns: Option<i64>,
    last_head: Option<Pose>,
}

impl OpenXrSession {
    /// Creates the session and its swapchains on the device of [`Runtime::open_device`].
    ///
    /// # Errors
    /// [`RuntimeError::Call`] and [`RuntimeError::Vulkan`].
    pub fn create(
        runtime: Runtime,
        context: &GpuContext,
        options: SessionOptions,
    ) -> Result<Self, RuntimeError> {
        let (session, waiter, stream) =
            interop::create_session(&runtime.instance, runtime.system, &context.device)
                .map_err(failed("xrCreateSession"))?;
        let (kind, world_from_space) = match options.settings.space {
            Space::Local => (xr::ReferenceSpaceType::LOCAL, options.start.position),
            Space::Stage => (
                xr::ReferenceSpaceType::STAGE,
                options.start.position - DVec3::Y * EYE_HEIGHT_M,
            ),
        };
        let space = session
            .create_reference_space(kind, xr::Posef::IDENTITY)
            .map_err(failed("xrCreateReferenceSpace"))?;
        let refresh_hz = refresh_rate(&runtime, &session, options.settings.refresh_hz);
        let hidden = hidden_areas(&runtime, &session, &options.settings);
        let moves = options.settings.locomotion;
        let controls = Controls::new(&runtime, &session, moves, &options.actions)?;
        let with_depth = options.settings.depth_layer && runtime.offered.depth_layer;
        let eyes = EyeSwapchains::pair(
            &session,
            &context.device,
            options.size,
            options.settings.format,
            with_depth,
        )?;
        let info = SessionInfo {
            source: format!("openxr ({})", runtime.name()),
            headset: runtime.headset().to_owned(),
            refresh_hz,
            recommended_size: Some(runtime.recommended_size()),
            hidden,
        };
        let locomotion = Locomotion::new(
            Pose::new(
                world_from_space,
                DQuat::from_rotation_y(options.start.heading_rad()),
            ),
            &options.settings,
        );
        Ok(Self {
            info,
            order: FrameOrder::default(),
            lifecycle: Lifecycle::new(),
            locomotion,
            options,
            eyes: Some(eyes),
            controls,
            space,
            stream,
            waiter,
            session,
            device: context.device.clone(),
            runtime,
            is_over: false,
            wants_to_quit: false,
            in_frame: false,
            frames: 0,
            last_time_ns: None,
            last_head: None,
        })
    }

    /// The colour format of the images, and whether depth goes with them.
    #[must_use]
    pub fn image_format(&self) -> Option<(wgpu::TextureFormat, bool)> {
        let [left, _] = self.eyes.as_ref()?;
        Some((left.format(), left.depth().is_some()))
    }

    /// What `call` said as an error of this run. A lost session or instance needs no more calls.
    fn lost(&mut self, call: &'static str, result: xr::sys::Result) -> XrError {
        use xr::sys::Result as R;
        let gone = matches!(
            result,
            R::ERROR_INSTANCE_LOST | R::ERROR_SESSION_LOST | R::ERROR_RUNTIME_FAILURE
        );
        if gone {
            self.is_over = true;
            self.lifecycle.enter(xr::SessionState::LOSS_PENDING);
        }
        XrError::Runtime(format!(
            "{call}: {result}{}; {} frames were shown and are kept",
            if gone {
                " (the OpenXR runtime or its session is gone; start it again)"
            } else {
                ""
            },
            self.frames
        ))
    }

    /// Reads the runtime's events and does what they ask for.
    fn poll_events(&mut self) -> Result<(), XrError> {
        let mut buffer = xr::EventDataBuffer::new();
        loop {
            let event = match self.runtime.instance.poll_event(&mut buffer) {
                Ok(Some(event)) => event,
                Ok(None) => return Ok(()),
                Err(error) => return Err(self.lost("xrPollEvent", error)),
            };
            match event {
                xr::Event::SessionStateChanged(change)
                    if change.session() == self.session.as_raw() =>
                {
                    log::info!("OpenXR session: {}", lifecycle::name(change.state()));
                    match self.lifecycle.enter(change.state()) {
                        Step::None => {}
                        Step::Begin => {
                            if let Err(error) = self.session.begin(STEREO) {
                                return Err(self.lost("xrBeginSession", error));
                            }
                        }
                        Step::End => {
                            if let Err(error) = self.session.end() {
                                return Err(self.lost("xrEndSession", error));
                            }
                        }
                        Step::Quit => self.is_over = true,
                        Step::Lost => {
                            return Err(self.lost(
                                "the runtime announces the loss of the session",
                                xr::sys::Result::ERROR_SESSION_LOST,
                            ));
                        }
                    }
                }
                xr::Event::InstanceLossPending(_) => {
                    return Err(self.lost(
                        "the runtime announces the loss of the instance",
                        xr::sys::Result::ERROR_INSTANCE_LOST,
                    ));
                }
                xr::Event::VisibilityMaskChangedKHR(_) => {
                    log::info!("the runtime changed its visibility mask");
                    let settings = &self.options.settings;
                    let hidden = hidden_areas(&self.runtime, &self.session, settings);
                    self.info.hidden = hidden.or_else(|| self.info.hidden.take());
                }
                xr::Event::DisplayRefreshRateChangedFB(change) => {
                    let rate = change.to_display_refresh_rate();
                    if is_usable_rate(&rate) {
                        log::info!("the display now refreshes at {rate} Hz");
                        self.info.refresh_hz = f64::from(rate);
                    }
                }
                xr::Event::ReferenceSpaceChangePending(_) => {
                    log::info!("the runtime recentred its space");
                }
                xr::Event::EventsLost(lost) => {
                    log::warn!("the runtime dropped {} events", lost.lost_event_count());
                }
                _ => {}
            }
        }
    }

    /// Asks the runtime to end the session and follows until it has: without frames some never get there.
    fn finish(&mut self) -> Result<(), XrError> {
        if !self.lifecycle.running() {
            return Ok(());
        }
        if let Err(error) = self.session.request_exit() {
            return Err(self.lost("xrRequestExitSession", error));
        }
        let began = Instant::now();
        while !self.is_over && began.elapsed() < LONGEST_GOODBYE {
            self.poll_events()?;
            if self.lifecycle.running() {
                let state = match self.waiter.wait() {
                    Ok(state) => state,
                    Err(error) => return Err(self.lost("xrWaitFrame", error)),
                };
                if let Err(error) = self.stream.begin() {
                    return Err(self.lost("xrBeginFrame", error));
                }
                self.end_empty(state.predicted_display_time)?;
            } else if !self.is_over {
                std::thread::sleep(IDLE_PAUSE);
            }
        }
        Ok(())
    }

    fn end_empty(&mut self, time: xr::Time) -> Result<(), XrError> {
        self.in_frame = false;
        match self.stream.end(time, self.runtime.blend_mode, &[]) {
            Ok(()) => Ok(()),
            Err(error) => Err(self.lost("xrEndFrame", error)),
        }
    }

    /// Moves, turns, and notes what else the wearer wants; true if reuse is to be switched.
    fn follow_controls(&mut self, time_ns: i64) -> Result<bool, XrError> {
        let input = match self.controls.read(&self.session) {
            Ok(input) => input,
            Err(error) => return Err(self.lost("xrSyncActions", error)),
        };
        let seconds = self
            .last_time_ns
            .map_or(0.0, |last| time_ns.saturating_sub(last) as f64 * 1e-9);
        self.last_time_ns = Some(time_ns);
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
        Ok(input.switch_reuse)
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
        loop {
            self.poll_events()?;
            if self.is_over || stereolux_base::interrupt::requested() {
                self.finish()?;
                return Ok(None);
            }
            if self.lifecycle.running() {
                break;
            }
            std::thread::sleep(IDLE_PAUSE);
        }
        let state = match self.waiter.wait() {
            Ok(state) => state,
            Err(error) => return Err(self.lost("xrWaitFrame", error)),
        };
        let time_ns = state.predicted_display_time.as_nanos();
        let switch_reuse = self.follow_controls(time_ns)?;
        let frame = FrameState {
            predicted_display_time_ns: time_ns,
            period_ns: state.predicted_display_period.as_nanos().max(1),
            should_render: state.should_render,
            switch_reuse,
            quality: QualityFrom::Application,
        };
        self.order.waited(&frame);
        Ok(Some(frame))
    }

    fn begin_frame(&mut self) -> Result<(), XrError> {
        self.order.begin()?;
        if let Err(error) = self.stream.begin() {
            return Err(self.lost("xrBeginFrame", error));
        }
        self.in_frame = true;
        Ok(())
    }

    fn locate_views(&mut self, display_time_ns: i64) -> Result<Option<LocatedViews>, XrError> {
        self.order.may_locate()?;
        let time = xr::Time::from_nanos(display_time_ns);
        let (flags, views) = match self.session.locate_views(STEREO, time, &self.space) {
            Ok(located) => located,
            Err(error) => return Err(self.lost("xrLocateViews", error)),
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
        if flags
            .contains(xr::ViewStateFlags::POSITION_VALID | xr::ViewStateFlags::ORIENTATION_VALID)
        {
            self.last_head = Some(Pose::new(
                located.midpoint_in_world(),
                located.views[0].orientation,
            ));
        }
        Ok(Some(located))
    }

    fn locate_input(&mut self, display_time_ns: i64) -> Result<Input, XrError> {
        self.order.may_locate()?;
        let read = self.controls.locate(
            &self.session,
            &self.space,
            &self.locomotion.world_from_space(),
            xr::Time::from_nanos(display_time_ns),
        );
        read.map_err(|error| self.lost("reading the hands", error))
    }

    fn vibrate(&mut self, pulse: &Pulse) -> Result<(), XrError> {
        let sent = self.controls.vibrate(&self.session, pulse);
        sent.map_err(|error| self.lost("xrApplyHapticFeedback", error))
    }

    fn move_wearer(&mut self, by_m: DVec3) {
        self.locomotion.move_by(by_m);
        if let Some(head) = &mut self.last_head {
            head.position += by_m;
        }
    }

    fn acquire_targets(&mut self) -> Result<RenderTargets, XrError> {
        self.order.may_acquire()?;
        let Some(eyes) = &mut self.eyes else {
            return Err(XrError::CallOrder("acquire_targets after the end".into()));
        };
        let mut acquire = || {
            let [left, right] = eyes;
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
            Err((call, error)) => Err(self.lost(call, error)),
        }
    }

    fn end_frame(&mut self, submission: FrameSubmission<'_>) -> Result<(), XrError> {
        self.order.end(submission.display_time_ns)?;
        let time = xr::Time::from_nanos(submission.display_time_ns);
        let Some(rendered) = submission.rendered else {
            return self.end_empty(time);
        };
        let Some(eyes) = &mut self.eyes else {
            return Err(XrError::CallOrder("end_frame after the end".into()));
        };
        let mut release = || {
            let [left, right] = eyes;
            left.release()?;
            right.release()
        };
        if let Err((call, error)) = release() {
            return Err(self.lost(call, error));
        }
        self.in_frame = false;
        // The views that were rendered, back in the runtime's space: f64 until the last step, so that they round to the
        // f32 numbers that the runtime gave.
        let space_from_world = inverse(&self.locomotion.world_from_space());
        let layers =
            [(&eyes[0], rendered.left()), (&eyes[1], rendered.right())].map(|(eye, view)| {
                let (pose, fov) = pose_in_space(&space_from_world, view);
                LayerView {
                    pose,
                    fov,
                    color: eye.color(),
                    depth: eye.depth(),
                }
            });
        let ended = interop::end_frame_with_layer(
            &mut self.stream,
            time,
            self.runtime.blend_mode,
            &self.space,
            submission.size.unwrap_or(self.options.size),
            NEAR_M,
            layers,
        );
        match ended {
            Ok(()) => {
                self.frames += 1;
                Ok(())
            }
            Err(error) => Err(self.lost("xrEndFrame", error)),
        }
    }
}

impl Drop for OpenXrSession {
    fn drop(&mut self) {
        // After an error the session may still be running: leave it in order, as far as the runtime plays along.
        if self.lifecycle.running() && !self.is_over {
            let time = self.last_time_ns.map(xr::Time::from_nanos);
            let ended = match (self.in_frame, time) {
                (true, Some(time)) => self.end_empty(time),
                _ => Ok(()),
            };
            if let Err(error) = ended.and_then(|()| self.finish()) {
                log::debug!("{error}");
            }
        }
        // wgpu lets go of a texture once the device is done with it; only then may the runtime destroy its image.
        if let Some(eyes) = &mut self.eyes {
            for eye in eyes {
                eye.forget_images();
            }
        }
        if let Err(error) = stereolux_gpu::context::finish(&self.device) {
            log::debug!("at the session's end: {error}");
        }
        self.eyes = None;
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
    if !runtime.offered.refresh_rate {
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
    if !settings.visibility_mask || !runtime.offered.visibility_mask {
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
