//! What the controllers look like, where the runtime offers it: `XR_MSFT_controller_model`.
//!
//! Not `XR_FB_render_model`: who asks by it promises to read KTX2 textures (`KHR_texture_basisu`), which the importer does not.

use openxr as xr;

use super::runtime::is_gone;
use crate::controller_model::MOST_BYTES;
use crate::{ControllerModel, Input, Side};
use stereolux_gpu::vulkan_interop::openxr as interop;

/// In how many frames a model is asked for once a grip is tracked: a runtime may have it a little later.
const MOST_TRIES: u32 = 500;

/// Which models are known, and how often the others are still asked for.
pub(super) struct ControllerModels {
    /// Given, or refused for good; left, right.
    is_settled: [bool; 2],
    /// `None` while the grip is not tracked.
    tries_left: [Option<u32>; 2],
}

impl ControllerModels {
    pub(super) fn new(is_offered: bool) -> Self {
        Self {
            is_settled: [!is_offered; 2],
            tries_left: [None; 2],
        }
    }

    /// Notes what is tracked.
    pub(super) fn note(&mut self, input: &Input) {
        for (hand, tries) in input.hands.iter().zip(&mut self.tries_left) {
            *tries = hand.grip.map(|_| tries.unwrap_or(MOST_TRIES));
        }
    }

    /// The next one that the runtime has. Where it refuses one, a warning says so once.
    ///
    /// # Errors
    /// The session is lost, or the runtime gone.
    pub(super) fn next(
        &mut self,
        session: &xr::Session<xr::Vulkan>,
    ) -> xr::Result<Option<ControllerModel>> {
        for side in Side::BOTH {
            let is_settled = &mut self.is_settled[side as usize];
            let Some(tries @ 1..) = self.tries_left[side as usize].as_mut() else {
                continue;
            };
            if *is_settled {
                continue;
            }
            *tries -= 1;
            let hand = format!("/user/hand/{}", side.word());
            let hand = session.instance().string_to_path(&hand)?;
            match interop::controller_model(session, hand, MOST_BYTES) {
                Ok(None) => {}
                Ok(Some(glb)) => {
                    *is_settled = true;
                    return Ok(Some(ControllerModel { side, glb }));
                }
                Err(error) if error == xr::sys::Result::ERROR_SESSION_LOST || is_gone(error) => {
                    return Err(error);
                }
                Err(error) => {
                    *is_settled = true;
                    log::warn!(
                        "the runtime's model of the {} controller cannot be had ({error}; more than {} MiB are not \
                         taken): a plain one is shown",
                        side.word(),
                        MOST_BYTES >> 20
                    );
                }
            }
        }
        Ok(None)
    }
}
