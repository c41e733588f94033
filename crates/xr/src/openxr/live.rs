//! What hangs on one session of the runtime: made in one go, for the run's first session and for each that takes the place of
//! a lost one.

use openxr as xr;

use super::controls::Controls;
use super::lifecycle::Lifecycle;
use super::passthrough::Behind;
use super::runtime::{Runtime, RuntimeError, failed};
use super::swapchain::EyeSwapchains;
use super::{SessionOptions, Space};
use stereolux_gpu::vulkan_interop::openxr as interop;
use stereolux_gpu::{GpuContext, QueueTurn};

/// Calls of a frame that the runtime waits for: a frame that was waited for has to be begun before another is (OpenXR 1.1,
/// xrWaitFrame), and one that was begun has to be ended.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum UnderWay {
    Nothing,
    Waited,
    Begun,
}

/// A session of the runtime. Fields are dropped in order: images before their session. Its action sets go with it: sets are
/// the instance's, names are taken while a set is there, and bindings can be suggested only for sets that were never
/// attached (OpenXR 1.1, section 11 "Input and Haptics").
pub(super) struct Live {
    pub(super) lifecycle: Lifecycle,
    /// What said that it is lost. It is left alone then, until another takes its place.
    pub(super) loss: Option<String>,
    /// How far the frame under way has come.
    pub(super) under_way: UnderWay,
    pub(super) eyes: [EyeSwapchains; 2],
    pub(super) controls: Controls,
    pub(super) space: xr::Space,
    pub(super) behind: Behind,
    pub(super) stream: xr::FrameStream<xr::Vulkan>,
    pub(super) waiter: xr::FrameWaiter,
    pub(super) session: xr::Session<xr::Vulkan>,
    pub(super) queue_turn: QueueTurn,
    device: wgpu::Device,
}

impl Live {
    /// Makes all of it on the device that the runtime dictates.
    ///
    /// # Errors
    /// [`RuntimeError::Call`], [`RuntimeError::Vulkan`] and [`RuntimeError::Binding`].
    pub(super) fn new(
        runtime: &Runtime,
        context: &GpuContext,
        options: &SessionOptions,
    ) -> Result<Self, RuntimeError> {
        let settings = &options.settings;
        let device = &context.device;
        let (session, waiter, stream) =
            interop::create_session(&runtime.instance, runtime.system.id, device)
                .map_err(failed("xrCreateSession"))?;
        let kind = match settings.space {
            Space::Local => xr::ReferenceSpaceType::LOCAL,
            Space::Stage => xr::ReferenceSpaceType::STAGE,
        };
        let space = session
            .create_reference_space(kind, xr::Posef::IDENTITY)
            .map_err(failed("xrCreateReferenceSpace"))?;
        let controls = Controls::new(runtime, &session, settings.locomotion, &options.actions)?;
        let behind = Behind::new(runtime, &session, options.passthrough);
        let with_depth = settings.depth_layer && runtime.used.khr_composition_layer_depth;
        let eyes =
            EyeSwapchains::pair(&session, context, options.size, settings.format, with_depth)?;
        Ok(Self {
            lifecycle: Lifecycle::default(),
            loss: None,
            under_way: UnderWay::Nothing,
            eyes,
            controls,
            space,
            behind,
            stream,
            waiter,
            session,
            queue_turn: context.queue_turn(),
            device: device.clone(),
        })
    }

    /// Begins a frame, in the queue's turn.
    pub(super) fn begin(&mut self) -> xr::Result<()> {
        let _turn = self.queue_turn.take();
        self.stream.begin()
    }

    /// The colour format of the images, and whether depth goes with them.
    pub(super) fn image_format(&self) -> (wgpu::TextureFormat, bool) {
        let [left, _] = &self.eyes;
        (left.format(), left.depth().is_some())
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        // wgpu lets go of a texture once the device is done with it; only then may the runtime destroy its image.
        for eye in &mut self.eyes {
            eye.forget_images();
        }
        if let Err(error) = stereolux_gpu::context::finish(&self.device) {
            log::debug!("at the session's end: {error}");
        }
    }
}
