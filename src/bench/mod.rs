//! Speed against error: what `stereolux bench` measures and writes.
//!
//! A suite ([`suites`]) is a list of groups, and a group is a few variants of the same picture. [`measure`] renders the
//! variants of a group in turn ([`stereolux_report::rounds`]), so that whatever slows the machine slows all of them, and
//! judges the very frames that it timed ([`variant_statistics`]) against a path-traced reference ([`reference`]) that is
//! cached under everything it depends on. Everything that needs no renderer is in the crate `stereolux_report`: each
//! variant becomes one row there, kept in a journal as soon as it is measured, and in the end a report.
//!
//! Photons are traced anew in every frame that is measured, so that frames are independent renders: their mean against the
//! reference is the bias, their spread the variance, and no renderer has to be rebuilt in between.

pub mod correspondence;
pub mod instance_motion;
pub mod measure;
mod motion;
pub mod paired_references;
pub mod reference;
pub mod scenes;
pub mod suites;
pub mod variant_statistics;
mod work;

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use stereolux_report::journal::Journal;
use stereolux_report::records::{Machine, Row};
use stereolux_report::rounds::Round;
use stereolux_report::shards::{FORMAT, Head, Part, Shard, join};
use stereolux_report::{Circumstances, Report, ReportError, ReportFile};

use measure::{GroupPlan, Known, Lab};
use reference::{BOX_SAMPLES, References};
use scenes::SceneSource;

use crate::frame::user_passes::shader_library;
use crate::gpu::context::AdapterSummary;
use crate::gpu::{GpuContext, GpuError};
use crate::images::{ImageError, write_atomically};
use crate::interrupt;
use crate::metrics::MetricsError;
use crate::options::{BenchOptions, Suite};
use crate::renderer::RenderError;
use crate::scene::SceneError;
use crate::settings::{Choice as _, Settings};
use crate::xr::XrError;

/// The code that decides the pixels of an image: shaders, renderer, scenes and the versions of all dependencies.
pub const RENDER_CODE: &str = env!("STEREOLUX_RENDER_CODE");
/// [`RENDER_CODE`] and the code that measures.
pub const BENCH_CODE: &str = env!("STEREOLUX_BENCH_CODE");

/// Least time between two reports of a suite that is being measured; drawing one takes seconds.
const BETWEEN_REPORTS: Duration = Duration::from_secs(60);

/// Why a suite ends early; what was finished is in the journal.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// A scene.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A headset or trace.
    #[error(transparent)]
    Xr(#[from] XrError),
    /// The device or a pass.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// Images that cannot be compared.
    #[error(transparent)]
    Metrics(#[from] MetricsError),
    /// An image or a file written atomically.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A shader folder that cannot be used.
    #[error("gpu.shader_folder: {0}")]
    Shaders(String),
    /// The folder for the report, or that for references.
    #[error("{}: {reason}; choose a folder that can be written to", path.display())]
    Out {
        /// The folder.
        path: PathBuf,
        /// The system's words.
        reason: String,
    },
    /// A journal that cannot be gone on with.
    #[error("--out: {0}")]
    Journal(ReportError),
    /// The journal, the report, or another file.
    #[error(transparent)]
    Report(#[from] ReportError),
    /// The user wanted it to end; what was measured is in the journal.
    #[error("interrupted; the same command goes on from there")]
    Interrupted,
}

/// The scenes by which a frame is judged unless others are named.
const JUDGED_BY: [&str; 2] = ["builtin:cornell", "builtin:gallery"];

/// The scenes that `--scene` names, or others.
fn scenes_or(options: &BenchOptions, others: &[&str]) -> Vec<String> {
    match options.scenes.as_slice() {
        [] => others.iter().map(|&name| name.to_owned()).collect(),
        named => named.to_vec(),
    }
}

/// # Errors
/// [`BenchError::Interrupted`] once the user wants the suite to end.
fn go_on() -> Result<(), BenchError> {
    if interrupt::requested() {
        return Err(BenchError::Interrupted);
    }
    Ok(())
}

impl From<GpuError> for BenchError {
    fn from(error: GpuError) -> Self {
        Self::Render(error.into())
    }
}

/// Who hears how far the suite is.
pub trait BenchProgress {
    /// What a suite that has no groups does now.
    fn says(&mut self, what: &str);
    /// The groups of `suite` that will be measured or taken from the journal, and roughly how many seconds they take without
    /// references.
    fn planned(&mut self, suite: Suite, plans: &[GroupPlan], without_references_s: f64);
    /// A group begins.
    fn began(&mut self, plan: &GroupPlan);
    /// A round of it is done.
    fn round(&mut self, plan: &GroupPlan, round: Round);
    /// Its reference has `done` of at most `most` samples per pixel.
    fn reference(&mut self, plan: &GroupPlan, done: u32, most: u32);
    /// A group is finished and in the journal.
    fn finished(&mut self, plan: &GroupPlan);
    /// A group's rows were in the journal already.
    fn skipped(&mut self, plan: &GroupPlan);
}

/// What a suite came to.
#[derive(Debug)]
pub struct Outcome {
    /// Rows in the report.
    pub rows: usize,
    /// Of these, rows from the journal of an earlier run.
    pub resumed: usize,
    /// The report.
    pub report: PathBuf,
    /// Rows with errors that their reference was not good enough for.
    pub unsettled: usize,
}

/// Runs a suite and writes its report.
///
/// # Errors
/// [`BenchError`]; finished rows are in the journal.
pub fn run(
    options: &BenchOptions,
    progress: &mut dyn BenchProgress,
) -> Result<Outcome, BenchError> {
    let settings = &options.settings;
    let passes = &settings.render.user_passes;
    let library = shader_library(&settings.gpu.shader_folder, passes)
        .map_err(|error| BenchError::Shaders(error.to_string()))?;
    match options.suite {
        Suite::Work => return work::run(options, &library, progress),
        Suite::Motion => return motion::run(options, &library, progress),
        _ => {}
    }
    let mut plans = suites::plans(options)?;
    let part = options.shard.map(|shard| take_part(&mut plans, shard));
    let mut checked: Vec<&SceneSource> = Vec::new();
    for plan in &plans {
        // Scenes that cannot be read are refused before anything is written.
        if !checked.contains(&&plan.scene) {
            plan.scene.check(settings)?;
            checked.push(&plan.scene);
        }
    }
    let machine = machine_of(&GpuContext::open(Some(&settings.adapter))?.adapter);
    let out = options.out.as_path();
    make_folder(out)?;
    let journal = open_journal(out)?;
    let folder = references_folder(options)?;
    let references = References::open(
        &folder,
        suites::reference_samples(options),
        library.clone(),
        machine.clone(),
    );
    let without_references_s = measure::estimated_s(&plans, |plan, first| {
        let device = references.device(settings)?;
        measure::variant_time(plan, first, settings, &library, device)
    })?;
    progress.planned(options.suite, &plans, without_references_s);
    let mut lab = Lab {
        out,
        settings,
        machine,
        library,
        journal,
        references,
        progress,
        known: Known::default(),
    };
    let machine = lab.machine.clone();
    let mut rows: Vec<Row> = Vec::new();
    let mut written = Instant::now();
    for (done, plan) in (1..).zip(&plans) {
        let measured = lab.measure(plan);
        let is_interrupted = matches!(measured, Err(BenchError::Interrupted));
        let is_due = done < plans.len() && written.elapsed() >= BETWEEN_REPORTS;
        let groups = done - usize::from(is_interrupted);
        if let Ok(more) = &measured {
            rows.extend_from_slice(more);
        }
        if (is_due || is_interrupted) && !rows.is_empty() {
            let unfinished = Some([groups, plans.len()]);
            let so_far = report(options, &machine, part.as_ref(), unfinished, &rows);
            write(out, &so_far)?;
            written = Instant::now();
        }
        measured?;
    }
    let report = report(options, &machine, part.as_ref(), None, &rows);
    write(out, &report)?;
    Ok(outcome(out, &report, lab.known.resumed))
}

/// Makes a folder for output, if it is missing.
fn make_folder(path: &Path) -> Result<(), BenchError> {
    fs::create_dir_all(path).map_err(|error| BenchError::Out {
        path: path.to_owned(),
        reason: error.to_string(),
    })
}

fn open_journal(out: &Path) -> Result<Journal, BenchError> {
    Journal::open(&out.join("journal.jsonl")).map_err(BenchError::Journal)
}

/// The folder of the references, made.
fn references_folder(options: &BenchOptions) -> Result<PathBuf, BenchError> {
    let folder = match &options.references {
        Some(folder) => folder.clone(),
        None => options.out.join("references"),
    };
    make_folder(&folder)?;
    Ok(folder)
}

fn report<'a>(
    options: &BenchOptions,
    machine: &Machine,
    part: Option<&'a Part>,
    unfinished: Option<[usize; 2]>,
    rows: &'a [Row],
) -> Report<'a> {
    Report {
        head: Head {
            format: FORMAT.to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            suite: options.suite.word().to_owned(),
            render_code: RENDER_CODE.to_owned(),
            bench_code: BENCH_CODE.to_owned(),
            reference_samples: suites::reference_samples(options),
            samples_per_batch: BOX_SAMPLES,
            machine: machine.clone(),
        },
        part,
        unfinished,
        rows,
    }
}

/// Leaves the groups of one part of a suite.
fn take_part(plans: &mut Vec<GroupPlan>, [number, of]: [u32; 2]) -> Part {
    let shard = Shard { number, of };
    let groups = plans
        .iter()
        .map(|plan| [plan.suite.to_owned(), plan.name.clone()])
        .collect();
    let mut place = 0..;
    plans.retain(|_| place.next().is_some_and(|place| shard.has(place)));
    Part { shard, groups }
}

/// Joins the reports and journals of a suite's parts, so that the suite's own command finds all of it measured.
///
/// # Errors
/// [`BenchError::Report`], [`BenchError::Out`], [`BenchError::Journal`].
pub fn merge(reports: &[(PathBuf, String)], out: &Path) -> Result<Outcome, BenchError> {
    let (head, rows) = join(reports)?;
    make_folder(out)?;
    open_journal(out)?.append(&rows)?;
    let report = Report {
        head,
        part: None,
        unfinished: None,
        rows: &rows,
    };
    write(out, &report)?;
    Ok(outcome(out, &report, 0))
}

fn outcome(out: &Path, report: &Report<'_>, resumed: usize) -> Outcome {
    Outcome {
        rows: report.rows.len(),
        resumed,
        report: out.join("report.md"),
        unsettled: report.unsettled(),
    }
}

/// Writes the files of a suite that is one table.
fn write_table(
    options: &BenchOptions,
    rows: usize,
    files: Vec<ReportFile>,
) -> Result<Outcome, BenchError> {
    let out = options.out.as_path();
    make_folder(out)?;
    write_files(out, files)?;
    Ok(Outcome {
        rows,
        resumed: 0,
        report: out.join("report.md"),
        unsettled: 0,
    })
}

fn write_files(out: &Path, files: Vec<ReportFile>) -> Result<(), BenchError> {
    for file in files {
        write_atomically(&out.join(&file.path), |to| to.write_all(&file.bytes))?;
    }
    Ok(())
}

/// Where and how a suite that is one table measures.
fn circumstances(device: &GpuContext, settings: &Settings) -> Circumstances {
    Circumstances {
        machine: machine_of(&device.adapter),
        settings: measure::differing_settings(settings),
    }
}

/// What times are measured by.
fn clock(device: &GpuContext) -> &'static str {
    match device.has_timestamps {
        true => "device",
        false => "host",
    }
}

fn write(out: &Path, report: &Report<'_>) -> Result<(), BenchError> {
    let plots = out.join("plots");
    fs::create_dir_all(&plots).map_err(|error| ReportError::file(&plots, error))?;
    write_files(out, report.files()?)
}

/// What wgpu says of an adapter.
fn machine_of(adapter: &AdapterSummary) -> Machine {
    Machine {
        adapter: adapter.name.clone(),
        kind: adapter.kind.to_owned(),
        backend: adapter.backend.clone(),
        driver: format!("{} {}", adapter.driver, adapter.driver_info)
            .trim()
            .to_owned(),
        software_adapter: adapter.is_software(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_code_has_a_fingerprint() {
        for code in [RENDER_CODE, BENCH_CODE] {
            assert_eq!(code.len(), 32);
            assert!(u128::from_str_radix(code, 16).unwrap() != 0);
        }
        assert_ne!(RENDER_CODE, BENCH_CODE);
    }
}
