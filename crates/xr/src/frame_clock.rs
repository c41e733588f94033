//! Frame times and the order of calls, shared by the sources that need no runtime.

use super::{FrameState, XrError};
use std::time::{Duration, Instant};

use stereolux_base::interrupt;

/// How long an end of the run may go unnoticed.
const LONGEST_NAP: Duration = Duration::from_millis(50);

/// Display time of frame `frame` at `refresh_hz`: `frame * 1e9 / refresh_hz` rounded to whole
/// nanoseconds. Computed from the index, so that rounding does not add up.
pub(super) fn display_time_ns(frame: u64, refresh_hz: f64) -> i64 {
    (frame as f64 * 1e9 / refresh_hz).round() as i64
}

/// Nanoseconds between refreshes, at least 1.
pub(super) fn period_ns(refresh_hz: f64) -> i64 {
    display_time_ns(1, refresh_hz).max(1)
}

/// Whether frames come as fast as the machine allows or when they are due.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Pacing {
    /// The next frame at once.
    #[default]
    AsFastAsPossible,
    /// Each frame no earlier than its display time, counted from the first frame. A slow machine falls
    /// behind; no frame is skipped.
    RealTime,
}

/// Waits for a frame's time under [`Pacing::RealTime`].
#[derive(Debug)]
pub(super) struct Pacer {
    pacing: Pacing,
    start: Option<(Instant, i64)>,
}

impl Pacer {
    pub(super) fn new(pacing: Pacing) -> Self {
        Self {
            pacing,
            start: None,
        }
    }

    /// Blocks until `display_time_ns` is due; the first call is due at once.
    pub(super) fn wait_until(&mut self, display_time_ns: i64) {
        if self.pacing == Pacing::AsFastAsPossible {
            return;
        }
        let (start, first_ns) = *self
            .start
            .get_or_insert_with(|| (Instant::now(), display_time_ns));
        let due_ns = display_time_ns.saturating_sub(first_ns);
        let due = Duration::from_nanos(u64::try_from(due_ns).unwrap_or(0));
        // A recording may pause for minutes; who ends the run then does not wait for it.
        while let Some(left) = due.checked_sub(start.elapsed())
            && !left.is_zero()
            && !interrupt::requested()
        {
            std::thread::sleep(left.min(LONGEST_NAP));
        }
    }
}

/// Holds callers to wait, begin, locate and acquire, end.
#[derive(Debug, Default)]
pub(super) struct FrameOrder {
    phase: Phase,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Phase {
    #[default]
    Idle,
    Waited(i64),
    Begun(i64),
}

impl Phase {
    fn now(self) -> &'static str {
        match self {
            Self::Idle => "no frame is under way",
            Self::Waited(_) => "a frame was waited for and not begun",
            Self::Begun(_) => "a frame was begun and not ended",
        }
    }
}

impl FrameOrder {
    fn refuse<T>(&self, call: &str) -> Result<T, XrError> {
        let now = self.phase.now();
        Err(XrError::CallOrder(format!("{call} while {now}")))
    }

    /// Checks that a wait is due now.
    pub(super) fn may_wait(&self) -> Result<(), XrError> {
        match self.phase {
            Phase::Idle => Ok(()),
            _ => self.refuse("wait_frame"),
        }
    }

    /// Notes that `frame` was announced.
    pub(super) fn waited(&mut self, frame: &FrameState) {
        self.phase = Phase::Waited(frame.predicted_display_time_ns);
    }

    pub(super) fn begin(&mut self) -> Result<(), XrError> {
        match self.phase {
            Phase::Waited(time_ns) => {
                self.phase = Phase::Begun(time_ns);
                Ok(())
            }
            _ => self.refuse("begin_frame"),
        }
    }

    /// Checks that a frame is under way, for a call of that name.
    pub(super) fn may_locate(&self, call: &'static str) -> Result<(), XrError> {
        match self.phase {
            Phase::Idle => self.refuse(call),
            _ => Ok(()),
        }
    }

    /// Checks that a frame was begun.
    pub(super) fn may_acquire(&self) -> Result<(), XrError> {
        match self.phase {
            Phase::Begun(_) => Ok(()),
            _ => self.refuse("acquire_targets"),
        }
    }

    /// Ends the frame that was announced for `display_time_ns`.
    pub(super) fn end(&mut self, display_time_ns: i64) -> Result<(), XrError> {
        match self.phase {
            Phase::Begun(time_ns) if time_ns == display_time_ns => {
                self.phase = Phase::Idle;
                Ok(())
            }
            Phase::Begun(time_ns) => Err(XrError::CallOrder(format!(
                "end_frame for {display_time_ns} ns in the frame of {time_ns} ns"
            ))),
            _ => self.refuse("end_frame"),
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::super::QualityFrom;
    use super::*;

    #[test]
    fn display_times_do_not_drift() {
        // 72 Hz: 13,888,888.8.. ns; adding the rounded period 72,000 times would be off by 8,000 ns.
        assert_eq!(display_time_ns(0, 72.0), 0);
        assert_eq!(display_time_ns(1, 72.0), 13_888_889);
        assert_eq!(display_time_ns(72_000, 72.0), 1_000_000_000_000);
        assert_ne!(72_000 * period_ns(72.0), 1_000_000_000_000);
        assert_eq!(display_time_ns(90 * 3600, 90.0), 3_600_000_000_000);
    }

    #[test]
    fn calls_out_of_order_are_refused() {
        let frame = FrameState {
            predicted_display_time_ns: 7,
            period_ns: 1,
            should_render: true,
            switch_reuse: false,
            quality: QualityFrom::Application,
        };
        let mut order = FrameOrder::default();
        assert!(order.begin().is_err());
        assert!(order.may_locate("locate_views").is_err());
        assert!(order.end(7).is_err());
        order.may_wait().unwrap();
        order.waited(&frame);
        assert!(order.may_wait().is_err());
        assert!(order.may_acquire().is_err());
        assert!(order.end(7).is_err());
        order.may_locate("locate_views").unwrap();
        order.begin().unwrap();
        assert!(order.begin().is_err());
        order.may_acquire().unwrap();
        assert!(order.end(8).is_err());
        order.end(7).unwrap();
        order.may_wait().unwrap();
        assert!(order.end(7).is_err());
    }

    #[test]
    fn pacing_waits_only_in_real_time() {
        let start = Instant::now();
        let mut pacer = Pacer::new(Pacing::AsFastAsPossible);
        pacer.wait_until(0);
        pacer.wait_until(3_600_000_000_000);
        assert!(start.elapsed() < Duration::from_secs(60));
        let mut pacer = Pacer::new(Pacing::RealTime);
        let start = Instant::now();
        pacer.wait_until(1_000_000_000);
        pacer.wait_until(1_030_000_000);
        // Sleep never wakes early; how late it wakes is up to the machine.
        assert!(start.elapsed() >= Duration::from_millis(30));
    }
}
