//! `bench`: a suite of speed against error.

use std::path::{Path, PathBuf};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use stereolux_report::rounds::Round;

use super::Failure;
use crate::bench::measure::GroupPlan;
use crate::bench::{self, BenchProgress, Outcome};
use crate::options::BenchOptions;
use crate::output::OutputFolder;

/// Runs the suite, writes the report, and says where it is.
pub fn bench(options: &BenchOptions) -> Result<(), Failure> {
    OutputFolder::check(&options.out)?;
    let mut bar = Bar::new();
    let outcome = bench::run(options, &mut bar);
    bar.bar.finish_and_clear();
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
    eprintln!(
        "{} rows{resumed}; report in {}{unsettled}",
        outcome.rows,
        outcome.report.display()
    );
}

/// Progress on stderr with the time left, if that is a terminal. It counts rounds; a reference holds it up.
struct Bar {
    bar: ProgressBar,
}

impl Bar {
    fn new() -> Self {
        let bar = ProgressBar::new(0);
        if let Ok(style) = ProgressStyle::with_template(
            "{elapsed_precise} {bar:24} {pos}/{len} {eta} left {wide_msg}",
        ) {
            bar.set_style(style);
        }
        bar.enable_steady_tick(Duration::from_millis(250));
        Self { bar }
    }
}

fn frames(plan: &GroupPlan) -> u64 {
    u64::from(plan.rounds + plan.warm_up.max(1)) * plan.candidates.len() as u64
}

impl BenchProgress for Bar {
    fn planned(&mut self, plans: &[GroupPlan]) {
        self.bar.set_length(plans.iter().map(frames).sum());
    }

    fn began(&mut self, plan: &GroupPlan) {
        self.bar
            .set_message(format!("{}: {}: compiling", plan.suite, plan.name));
    }

    fn round(&mut self, plan: &GroupPlan, _round: Round) {
        self.bar.inc(plan.candidates.len() as u64);
        self.bar
            .set_message(format!("{}: {}", plan.suite, plan.name));
    }

    fn reference(&mut self, plan: &GroupPlan, done: u32, most: u32) {
        self.bar.set_message(format!(
            "{}: {}: reference, {done} of at most {most} samples",
            plan.suite, plan.name
        ));
    }

    fn finished(&mut self, plan: &GroupPlan) {
        log::info!("{}: {} measured", plan.suite, plan.name);
    }

    fn skipped(&mut self, plan: &GroupPlan) {
        // Work of an earlier run says nothing about the time that is left of this one.
        let length = self.bar.length().unwrap_or(0);
        self.bar.set_length(length.saturating_sub(frames(plan)));
        log::info!("{}: {} taken from the journal", plan.suite, plan.name);
    }
}
