//! Display times as the frame loop gets them.

use openxr as xr;

/// The runtime's clock, moved on where it would stand or run back: a new session may begin its times anew, and those of the
/// frame loop, and of a recording, increase.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct DisplayClock {
    ahead_ns: i64,
    last_ns: Option<i64>,
}

impl DisplayClock {
    /// The time of the last frame.
    pub(super) fn last_ns(&self) -> Option<i64> {
        self.last_ns
    }

    /// The time of the next frame, which the runtime shows at `time`.
    pub(super) fn next_ns(&mut self, time: xr::Time, period_ns: i64) -> i64 {
        let runtime_ns = time.as_nanos();
        let mut next_ns = runtime_ns.saturating_add(self.ahead_ns);
        if let Some(last_ns) = self.last_ns
            && next_ns <= last_ns
        {
            next_ns = last_ns.saturating_add(period_ns);
            self.ahead_ns = next_ns.saturating_sub(runtime_ns);
        }
        self.last_ns = Some(next_ns);
        next_ns
    }

    /// The runtime's time of a frame since the clock was moved last.
    pub(super) fn of_runtime(&self, time_ns: i64) -> xr::Time {
        xr::Time::from_nanos(time_ns.saturating_sub(self.ahead_ns))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_increase_over_sessions_and_lead_back_to_the_runtimes() {
        let mut clock = DisplayClock::default();
        // Two sessions that begin anew, one that repeats a time, and one whose clock has gone on.
        for (runtime_ns, expected_ns) in [
            (100, 100),
            (110, 110),
            (50, 120),
            (60, 130),
            (60, 140),
            (50, 150),
            (900, 1000),
        ] {
            let time = xr::Time::from_nanos(runtime_ns);
            let next_ns = clock.next_ns(time, 10);
            assert_eq!((next_ns, clock.last_ns()), (expected_ns, Some(next_ns)));
            assert_eq!(clock.of_runtime(next_ns), time);
        }
    }
}
