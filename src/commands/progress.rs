//! Progress of a run, on stderr.

use std::io::IsTerminal as _;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use crate::frame_loop::{FrameStats, LoopProgress};

/// Time between two lines of progress where there is no terminal.
const BETWEEN_LINES: Duration = Duration::from_secs(10);

/// Shows a bar by a template, and keeps its clock going.
pub(super) fn show(bar: &ProgressBar, template: &str) {
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar.enable_steady_tick(Duration::from_millis(250));
}

/// Progress on stderr: a bar on a terminal, else a line now and then.
pub(super) struct Bar {
    bar: ProgressBar,
    samples: u32,
    frames: Option<u32>,
    /// The first frame of a range and its warm-up; frame 0 comes before it in any case, and is not counted.
    first: u32,
    began: Instant,
    /// When the last line was printed; `None` on a terminal.
    last_line: Option<Instant>,
}

impl Bar {
    pub(super) fn new(samples: u32, first: u32, frames: Option<u32>) -> Self {
        let bar = match frames {
            Some(frames) => {
                let frames = frames.saturating_sub(first);
                ProgressBar::new(u64::from(frames) * u64::from(samples))
            }
            None => ProgressBar::no_length(),
        };
        show(&bar, "{elapsed_precise} {wide_bar} {pos}/{len} {eta} {msg}");
        let began = Instant::now();
        Self {
            bar,
            samples,
            frames,
            first,
            began,
            last_line: (!std::io::stderr().is_terminal()).then_some(began),
        }
    }

    pub(super) fn say(&self, message: &'static str) {
        self.bar.set_message(message);
    }

    pub(super) fn print(&self, line: &str) {
        self.bar.suspend(|| eprint_line!("{line}"));
    }

    pub(super) fn finish(&self) {
        self.bar.finish_and_clear();
    }

    /// Prints a line if the last one is long ago: `done` samples of frame `frame` are finished.
    fn line(&mut self, frame: u32, done: u32) {
        let is_due = |last: Instant| last.elapsed() >= BETWEEN_LINES;
        if !self.last_line.is_some_and(is_due) {
            return;
        }
        self.last_line = Some(Instant::now());
        let elapsed_s = self.began.elapsed().as_secs_f64();
        let counts = [self.first, frame, done];
        let line = progress_line(counts, self.frames, self.samples, elapsed_s);
        eprint_line!("{line}");
    }
}

/// Where a run stands: the first frame that counts, this one, and finished samples of that; how many frames there are, and
/// samples of each.
fn progress_line(
    [first, frame, done]: [u32; 3],
    frames: Option<u32>,
    samples: u32,
    elapsed_s: f64,
) -> String {
    let done = if frame < first { 0 } else { done };
    let finished = f64::from(frame.saturating_sub(first)) + f64::from(done) / f64::from(samples);
    let of_frames = frames.map_or(String::new(), |frames| format!(" of {frames}"));
    let of_samples = match samples {
        1 => String::new(),
        samples => format!(", sample {done} of {samples}"),
    };
    let left = frames
        .filter(|_| finished > 0.0)
        .map_or(String::new(), |frames| {
            let left_s =
                elapsed_s * (f64::from(frames.saturating_sub(first)) / finished - 1.0).max(0.0);
            format!(", about {left_s:.0} s left")
        });
    let number = u64::from(frame) + 1;
    format!("frame {number}{of_frames}{of_samples}: {elapsed_s:.0} s so far{left}")
}

impl LoopProgress for Bar {
    fn sample(&mut self, frame: u32, done: u32) {
        if let Some(frame) = frame.checked_sub(self.first) {
            self.bar
                .set_position(u64::from(frame) * u64::from(self.samples) + u64::from(done));
        }
        self.line(frame, done);
    }

    fn frame(&mut self, stats: &FrameStats) {
        self.bar.set_message(format!(
            "frame {}: {:.1} ms, reuse {:.2}",
            stats.frame, stats.gpu_ms.total, stats.stereo.reuse_fraction
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn progress_says_what_is_done_and_what_is_left() {
        let line = progress_line([0, 4, 1], Some(20), 1, 10.0);
        // 5 of 20 frames in 10 s.
        assert_eq!(line, "frame 5 of 20: 10 s so far, about 30 s left");
        // Frames 100 to 119 of a range.
        let line = progress_line([100, 104, 1], Some(120), 1, 10.0);
        assert_eq!(line, "frame 105 of 120: 10 s so far, about 30 s left");
        // The first frame of all goes before them.
        let line = progress_line([100, 0, 1], Some(120), 1, 10.0);
        assert_eq!(line, "frame 1 of 120: 10 s so far");
        let line = progress_line([0, 0, 16], Some(1), 64, 10.0);
        assert_eq!(
            line,
            "frame 1 of 1, sample 16 of 64: 10 s so far, about 30 s left"
        );
        let line = progress_line([0, 9, 1], None, 1, 12.4);
        assert_eq!(line, "frame 10: 12 s so far");
    }
}
