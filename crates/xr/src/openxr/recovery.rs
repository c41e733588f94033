//! A lost session is made anew: OpenXR 1.1, section 9.3, leaves the instance and the device as they were.

use std::time::{Duration, Instant};

use super::live::Live;
use super::runtime::RuntimeError;
use super::{OpenXrSession, refresh_rate};
use crate::XrError;

/// How long the runtime may take to give another session.
const LONGEST_ABSENCE: Duration = Duration::from_secs(10);
/// Pause between two tries.
const RETRY_PAUSE: Duration = Duration::from_millis(100);
/// Losses without a frame between that end the run.
const MOST_LOSSES: u32 = 3;

impl OpenXrSession {
    /// Puts another session in the place of the one that is lost by what `loss` says; none if the user wants the run to end
    /// meanwhile.
    pub(super) fn recover(&mut self, loss: &str) -> Result<(), XrError> {
        self.losses += 1;
        if self.losses == MOST_LOSSES {
            return Err(self.stays_lost(format!(
                "the session was lost {MOST_LOSSES} times without a frame between ({loss})"
            )));
        }
        log::warn!("the OpenXR session is lost ({loss}) and made anew");
        let Some(lost) = self.live.take() else {
            return Ok(());
        };
        let images = lost.image_format();
        drop(lost);
        self.last_head = None;
        let began = Instant::now();
        let live = loop {
            if stereolux_base::interrupt::requested() {
                return Ok(());
            }
            // What is left of the lost session's: a runtime may give its handle to the next.
            self.poll_events()?;
            match self.made_anew(images) {
                Ok(live) => break live,
                Err(error) if error.may_pass() && began.elapsed() < LONGEST_ABSENCE => {
                    std::thread::sleep(RETRY_PAUSE);
                }
                Err(error) => {
                    return Err(self.stays_lost(format!(
                        "the session was lost ({loss}) and cannot be made anew: {error}"
                    )));
                }
            }
        };
        if let Some(reason) = &live.behind.lacks {
            // Images go on leaving the surroundings out: what shades them was not compiled.
            log::warn!(
                "environment.passthrough: {} no longer shows the room ({reason}); it is black from here on",
                self.runtime.name()
            );
        }
        let wanted_hz = self.options.settings.refresh_hz;
        self.info.refresh_hz = refresh_rate(&self.runtime, &live.session, wanted_hz);
        self.follow_hidden(&live.session);
        self.live = Some(live);
        let seconds = began.elapsed().as_secs_f64();
        log::info!("the OpenXR session is back after {seconds:.1} s");
        Ok(())
    }

    /// Another session whose images, of this format and with or without depth, take what is rendered.
    fn made_anew(&mut self, images: (wgpu::TextureFormat, bool)) -> Result<Live, RuntimeError> {
        self.runtime.find_again(&self.context.device)?;
        let live = Live::new(&self.runtime, &self.context, &self.options)?;
        if live.image_format() == images {
            Ok(live)
        } else {
            Err(RuntimeError::Changed("images of another format"))
        }
    }

    fn stays_lost(&mut self, what: String) -> XrError {
        self.is_over = true;
        self.with_frames_kept(&what)
    }
}
