//! `trace.json`: host stages and device passes on one clock, as complete events of the Trace Event Format
//! ("Trace Event Format", Google, 2016), which Perfetto and chrome://tracing read.
//!
//! wgpu does not say what the host's clock shows at a tick of the device's. But the device writes a submission's ticks
//! after the host has submitted it and before the host has read them, so each submission bounds the difference of the
//! clocks from both sides, and all of them together bound it tightly ([`DeviceClock`]).

use std::io::{self, Write as _};
use std::path::Path;
use std::time::Instant;

use serde_json::{Value, json};

use crate::files::Beside;
use crate::gpu::{HostSpan, Submission};

/// Threads of the trace.
const HOST: u32 = 1;
const DEVICE: u32 = 2;
/// The first of those of frames in flight.
const SLOTS: u32 = 3;
/// How fast two clocks may drift apart: crystal oscillators keep 100 ppm each over temperature and age.
const DRIFT: f64 = 200e-6;

/// Microseconds, the format's unit.
fn microseconds(ns: f64) -> f64 {
    ns * 1e-3
}

/// Where the device's clock stands against the host's.
#[derive(Debug)]
struct DeviceClock {
    /// Host times are counted from here.
    began: Instant,
    /// Ticks are counted from here.
    first_tick: Option<u64>,
    /// Bounds on host time less device time, nanoseconds, and the host time at which they held.
    bounds: Option<([f64; 2], f64)>,
}

impl DeviceClock {
    fn new(began: Instant) -> Self {
        Self {
            began,
            first_tick: None,
            bounds: None,
        }
    }

    /// Nanoseconds of the host's clock.
    fn host_ns(&self, at: Instant) -> f64 {
        at.saturating_duration_since(self.began).as_nanos() as f64
    }

    /// Nanoseconds of the device's clock.
    fn device_ns(&mut self, tick: u64, ns_per_tick: f64) -> f64 {
        let first = *self.first_tick.get_or_insert(tick);
        (i128::from(tick) - i128::from(first)) as f64 * ns_per_tick
    }

    /// Host time less device time by what is known with this submission, nanoseconds: the middle of the bounds, which
    /// always keeps the submission's ticks between its host times.
    fn note(&mut self, submission: &Submission) -> Option<f64> {
        let ticks = submission.passes.iter().flat_map(|(_, ticks)| *ticks);
        let (first, last) = (ticks.clone().min()?, ticks.max()?);
        let began_ns = self.host_ns(submission.host.began);
        let ended_ns = self.host_ns(submission.host.ended);
        let own = [
            began_ns - self.device_ns(first, submission.ns_per_tick),
            ended_ns - self.device_ns(last, submission.ns_per_tick),
        ];
        let both = self.bounds.map(|([low, high], then_ns)| {
            let drift_ns = DRIFT * (ended_ns - then_ns);
            [own[0].max(low - drift_ns), own[1].min(high + drift_ns)]
        });
        // Without anything in common the device's clock was reset.
        let bounds = both.filter(|[low, high]| low <= high).unwrap_or(own);
        self.bounds = Some((bounds, ended_ns));
        Some((bounds[0] + bounds[1]) / 2.0)
    }
}

/// The file while it is written. It gets its name when it is whole.
pub struct ChromeTrace {
    file: Beside,
    clock: DeviceClock,
    /// Slots of frames in flight that have a name.
    named_slots: u32,
}

impl ChromeTrace {
    /// Begins the file. `device` names the adapter; `clocks` are submissions to compare the clocks by.
    ///
    /// # Errors
    /// The file cannot be made or written.
    pub fn create(path: &Path, device: &str, clocks: &[Submission]) -> io::Result<Self> {
        let began = clocks.first().map_or_else(Instant::now, |s| s.host.began);
        let mut clock = DeviceClock::new(began);
        for submission in clocks {
            clock.note(submission);
        }
        let mut trace = Self {
            file: Beside::create(path)?,
            clock,
            named_slots: 0,
        };
        let bounds = trace.clock.bounds;
        let uncertain_us = bounds.map(|([low, high], _)| microseconds((high - low) / 2.0));
        let process = json!({
            "ph": "M", "name": "process_name", "pid": 1,
            "args": {"name": "stereolux", "clock_uncertainty_us": uncertain_us},
        });
        write!(trace.file.out, "[\n{process}")?;
        trace.name_thread(HOST, "host")?;
        trace.name_thread(DEVICE, device)?;
        Ok(trace)
    }

    fn name_thread(&mut self, thread: u32, name: &str) -> io::Result<()> {
        self.write(&json!({
            "ph": "M", "name": "thread_name", "pid": 1, "tid": thread, "args": {"name": name},
        }))
    }

    fn write(&mut self, event: &Value) -> io::Result<()> {
        write!(self.file.out, ",\n{event}")
    }

    fn span(
        &mut self,
        thread: u32,
        name: &str,
        begin_ns: f64,
        duration_ns: f64,
        frame: u32,
    ) -> io::Result<()> {
        let category = if thread == DEVICE { "device" } else { "host" };
        self.write(&json!({
            "ph": "X", "name": name, "cat": category, "pid": 1, "tid": thread,
            "ts": microseconds(begin_ns), "dur": microseconds(duration_ns),
            "args": {"frame": frame},
        }))
    }

    fn host_span(
        &mut self,
        thread: u32,
        name: &str,
        span: &HostSpan,
        frame: u32,
    ) -> io::Result<()> {
        let begin_ns = self.clock.host_ns(span.began);
        let duration_ns = self.clock.host_ns(span.ended) - begin_ns;
        self.span(thread, name, begin_ns, duration_ns, frame)
    }

    /// Adds a frame: its host stages, an outer one before those in it, and its submissions. Where frames overlap, `slot`
    /// tells those on their way at once apart, and the submissions of each are on a thread of their own.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn add_frame(
        &mut self,
        frame: u32,
        slot: Option<u32>,
        stages: &[HostSpan],
        submissions: &[Submission],
    ) -> io::Result<()> {
        for stage in stages {
            self.host_span(HOST, stage.stage, stage, frame)?;
        }
        let thread = slot.map_or(HOST, |slot| SLOTS + slot);
        while slot.is_some_and(|slot| slot >= self.named_slots) {
            let slot = self.named_slots;
            self.name_thread(SLOTS + slot, &format!("frames in flight {slot}"))?;
            self.named_slots += 1;
        }
        for submission in submissions {
            let name = format!("submission: {}", submission.host.stage);
            self.host_span(thread, &name, &submission.host, frame)?;
            let Some(host_less_device_ns) = self.clock.note(submission) else {
                continue;
            };
            let ns_per_tick = submission.ns_per_tick;
            for (name, [first, last]) in &submission.passes {
                let begin_ns = self.clock.device_ns(*first, ns_per_tick) + host_less_device_ns;
                let duration_ns = (last - first) as f64 * ns_per_tick;
                self.span(DEVICE, name, begin_ns, duration_ns, frame)?;
            }
        }
        Ok(())
    }

    /// Ends the file and puts it in its place.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn finish(mut self) -> io::Result<()> {
        self.file.out.write_all(b"\n]\n")?;
        self.file.finish()
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    fn submission(
        began: Instant,
        host_us: [u64; 2],
        ticks: [u64; 2],
        ns_per_tick: f64,
    ) -> Submission {
        let at = |us| began + Duration::from_micros(us);
        Submission {
            host: HostSpan {
                stage: "frame",
                began: at(host_us[0]),
                ended: at(host_us[1]),
            },
            ns_per_tick,
            passes: vec![("pass".to_owned(), ticks)],
        }
    }

    /// A device whose ticks are 40 ns, and whose clock is 1 ms behind at tick 25,000 (1 ms): each submission narrows the
    /// bounds, a reset of the clock starts anew, and ticks always stay within their submission.
    #[test]
    fn submissions_bound_the_difference_of_the_clocks() {
        let began = Instant::now();
        let mut clock = DeviceClock::new(began);
        // Host 2000 us to 2500 us around ticks that ran from 2100 us to 2200 us.
        let tick = |host_us: u64| 1_000_000 + host_us * 25;
        let wide = submission(began, [2000, 2500], [tick(2100), tick(2200)], 40.0);
        // Device time 0 is the first tick seen, host time 2100 us: bounds of 2000 us and 2400 us.
        assert_eq!(clock.note(&wide), Some(2_200_000.0));
        let tight = submission(began, [2599, 2622], [tick(2600), tick(2620)], 40.0);
        // Bounds of 2099 us and 2102 us; drift does not matter to them.
        assert_eq!(clock.note(&tight), Some(2_100_500.0));
        let later = submission(began, [3000, 4000], [tick(3500), tick(3501)], 40.0);
        // Held from 2622 us to 4000 us: 200 ppm of 1378 us to each side, in nanoseconds.
        let middle = clock.note(&later).unwrap();
        assert!((middle - 2_100_500.0).abs() < 1e-3, "{middle}");
        let ([low, high], _) = clock.bounds.unwrap();
        assert!((high - low - (3000.0 + 2.0 * 275.6)).abs() < 1e-3);
        let reset = submission(began, [5000, 5010], [25, 50], 40.0);
        let difference = clock.note(&reset).unwrap();
        let first_ns = clock.device_ns(25, 40.0) + difference;
        let last_ns = clock.device_ns(50, 40.0) + difference;
        assert!(
            (5_000_000.0..=5_010_000.0).contains(&first_ns),
            "{first_ns}"
        );
        assert!((5_000_000.0..=5_010_000.0).contains(&last_ns), "{last_ns}");
    }
}
