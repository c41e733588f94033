//! `bench`: a suite of speed against error.

use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use indicatif::ProgressBar;
use stereolux_report::rounds::Round;

use super::Failure;
use super::progress::show;
use crate::bench::measure::GroupPlan;
use crate::bench::{self, BenchError, BenchProgress, Outcome};
use crate::interrupt;
use crate::options::{BenchOptions, Suite};
use crate::output::OutputFolder;
use crate::settings::Choice as _;

/// Runs the suite, writes the report, and says where it is.
pub fn bench(options: &BenchOptions) -> Result<(), Failure> {
    OutputFolder::check(&options.out)?;
    interrupt::catch();
    let mut bar = Bar::new();
    let outcome = bench::run(options, &mut bar);
    bar.bar.finish_and_clear();
    if matches!(outcome, Err(BenchError::Interrupted)) {
        return Err(Failure::failed(match (options.suite, bar.groups) {
            (Suite::Motion | Suite::Work, _) => {
                "interrupted; no report was written, and the same command begins anew".to_owned()
            }
            (_, [_, 0]) => {
                "interrupted before the first group; the same command goes on with what is kept"
                    .to_owned()
            }
            (_, [done, all]) => format!(
                "interrupted after {done} of {all} groups, which are kept in {}; the same command goes on from there",
                options.out.display()
            ),
        }));
    }
    let outcome = outcome?;
    tell(&outcome);
    Ok(())
}

/// Joins the reports of a suite's parts.
pub fn merge(reports: &[(PathBuf, String)], out: &Path) -> Result<(), Failure> {
    tell(&bench::merge(reports, out)?);
    Ok(())
}

/// Says on stderr where the report is.
fn tell(outcome: &Outcome) {
    let resumed = match outcome.resumed {
        0 => String::new(),
        rows => format!(", {rows} of them from an earlier run"),
    };
    let unsettled = match outcome.unsettled {
        0 => String::new(),
        rows => format!(
            "; {rows} rows have errors that their reference was too noisy for, see --reference-spp"
        ),
    };
    eprint_line!(
        "{} rows{resumed}; report in {}{unsettled}",
        outcome.rows,
        outcome.report.display()
    );
}

/// Progress on stderr: a bar on a terminal, else a line per group. It counts rounds; a reference holds it up.
struct Bar {
    bar: ProgressBar,
    is_terminal: bool,
    began: Instant,
    /// Groups that are dealt with, and all.
    groups: [usize; 2],
    /// Frames measured, and those that are to be.
    frames: [u64; 2],
}

impl Bar {
    fn new() -> Self {
        let bar = ProgressBar::new(0);
        show(&bar, "{elapsed_precise} {wide_msg}");
        Self {
            bar,
            is_terminal: std::io::stderr().is_terminal(),
            began: Instant::now(),
            groups: [0; 2],
            frames: [0; 2],
        }
    }

    fn say(&self, plan: &GroupPlan, what: &str) {
        let message = format!("{}: {}{what}", plan.suite, plan.name);
        self.bar.set_message(message);
    }

    /// A line where there is no bar.
    fn line(&self, plan: &GroupPlan, what: &str) {
        if self.is_terminal {
            return;
        }
        let [done, all] = self.groups;
        let left = left(self.frames, self.began.elapsed().as_secs_f64());
        eprint_line!(
            "{done} of {all}: {}: {} {what}{left}",
            plan.suite,
            plan.name
        );
    }
}

/// The time that the frames which are left will take if they are like those before, in words.
fn left([done, all]: [u64; 2], elapsed_s: f64) -> String {
    if done == 0 || done >= all {
        return String::new();
    }
    let left_s = elapsed_s * (all - done) as f64 / done as f64;
    format!(", about {} left", in_words(left_s))
}

fn in_words(seconds: f64) -> String {
    match seconds {
        ..100.0 => format!("{seconds:.0} s"),
        ..6000.0 => format!("{:.0} min", seconds / 60.0),
        _ => format!("{:.1} h", seconds / 3600.0),
    }
}

fn frames(plan: &GroupPlan) -> u64 {
    plan.frames() * plan.candidates.len() as u64
}

impl BenchProgress for Bar {
    fn says(&mut self, what: &str) {
        self.bar.set_message(what.to_owned());
        if !self.is_terminal {
            eprint_line!("{what}");
        }
    }

    fn planned(&mut self, suite: Suite, plans: &[GroupPlan], without_references_s: f64) {
        self.frames[1] = plans.iter().map(frames).sum();
        self.groups[1] = plans.len();
        show(
            &self.bar,
            "{elapsed_precise} {bar:24} {pos}/{len} {eta} left {wide_msg}",
        );
        self.bar.set_length(self.frames[1]);
        let variants: usize = plans.iter().map(|plan| plan.candidates.len()).sum();
        let [_, groups] = self.groups;
        let [_, frames] = self.frames;
        self.bar.suspend(|| {
            eprint_line!(
                "bench {}: {groups} groups, {variants} variants, {frames} frames, which take about {} and their references on top; \
                 stopped, it goes on with the same command",
                suite.word(),
                in_words(without_references_s),
            );
        });
    }

    fn began(&mut self, plan: &GroupPlan) {
        self.say(plan, ": compiling");
    }

    fn round(&mut self, plan: &GroupPlan, _round: Round) {
        self.bar.inc(plan.candidates.len() as u64);
        self.say(plan, "");
    }

    fn reference(&mut self, plan: &GroupPlan, done: u32, most: u32) {
        let what = format!(": reference, {done} of at most {most} samples");
        self.say(plan, &what);
    }

    fn finished(&mut self, plan: &GroupPlan) {
        self.groups[0] += 1;
        self.frames[0] += frames(plan);
        self.line(plan, "measured");
    }

    fn skipped(&mut self, plan: &GroupPlan) {
        // Work of an earlier run says nothing about the time that is left of this one.
        self.groups[0] += 1;
        self.frames[1] -= frames(plan);
        self.bar.set_length(self.frames[1]);
        self.line(plan, "taken from the journal");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_goes_by_the_frames_measured() {
        assert_eq!(left([0, 10], 5.0), "");
        assert_eq!(left([10, 10], 5.0), "");
        assert_eq!(left([5, 10], 30.0), ", about 30 s left");
        assert_eq!(left([1, 10], 60.0), ", about 9 min left");
        assert_eq!(left([1, 100], 360.0), ", about 9.9 h left");
    }
}
