//! What lies behind the scene: nothing, or the room around the wearer.

use openxr as xr;
use openxr::EnvironmentBlendMode as Mode;

use super::runtime::{Runtime, RuntimeError, failed};
use stereolux_gpu::vulkan_interop::openxr as interop;

impl Runtime {
    /// The blend mode by which the wearer's room can be shown where the scene is transparent: OPAQUE with a layer of
    /// XR_FB_passthrough below the scene's, ADDITIVE where black is transparent. `None`: not at all.
    #[must_use]
    pub fn passthrough(&self) -> Option<Mode> {
        let ways = [Mode::ALPHA_BLEND, Mode::OPAQUE, Mode::ADDITIVE];
        let is_one = |mode: &Mode| *mode != Mode::OPAQUE || self.used.fb_passthrough;
        let mut ways = ways.into_iter().filter(is_one);
        ways.find(|mode| self.system.modes.contains(mode))
    }
}

/// The wearer's room as a layer. Fields are dropped in order: the layer before what it shows.
struct Room {
    layer: xr::PassthroughLayerFB,
    _passthrough: xr::Passthrough,
}

impl Room {
    /// Begins to show it.
    fn open(session: &xr::Session<xr::Vulkan>) -> Result<Self, RuntimeError> {
        let running = xr::PassthroughFlagsFB::IS_RUNNING_AT_CREATION;
        // Not by `Passthrough::start`, which in the bindings (0.22) pauses it.
        let passthrough = session
            .create_passthrough(running)
            .map_err(failed("xrCreatePassthroughFB"))?;
        let purpose = xr::PassthroughLayerPurposeFB::RECONSTRUCTION;
        let layer = session
            .create_passthrough_layer(&passthrough, running, purpose)
            .map_err(failed("xrCreatePassthroughLayerFB"))?;
        Ok(Self {
            layer,
            _passthrough: passthrough,
        })
    }
}

/// What a session's frames lie over.
pub(super) struct Behind {
    /// How frames are blended with the room.
    pub(super) mode: Mode,
    /// Why the room is not shown, where it is wanted.
    pub(super) lacks: Option<String>,
    with_alpha: bool,
    room: Option<Room>,
}

impl Behind {
    /// The room, if it is wanted and the runtime can; else nothing, by the mode that does not show the room or, where there is
    /// none, what there is.
    pub(super) fn new(
        runtime: &Runtime,
        session: &xr::Session<xr::Vulkan>,
        is_wanted: bool,
    ) -> Self {
        let modes = &runtime.system.modes;
        let opaque = if modes.contains(&Mode::OPAQUE) {
            Mode::OPAQUE
        } else {
            modes[0]
        };
        let mut behind = Self {
            mode: opaque,
            lacks: None,
            with_alpha: false,
            room: None,
        };
        if !is_wanted {
            return behind;
        }
        match runtime.passthrough() {
            Some(Mode::OPAQUE) => match Room::open(session) {
                Ok(room) => (behind.room, behind.with_alpha) = (Some(room), true),
                Err(error) => behind.lacks = Some(error.to_string()),
            },
            Some(mode) => (behind.mode, behind.with_alpha) = (mode, mode == Mode::ALPHA_BLEND),
            None => behind.lacks = Some("it offers no way to".to_owned()),
        }
        behind
    }

    /// How a projection layer lies over it.
    pub(super) fn over(&self) -> interop::Over<'_> {
        interop::Over {
            blend_mode: self.mode,
            with_alpha: self.with_alpha,
            room: self.room.as_ref().map(|room| &room.layer),
        }
    }
}
