//! Speed against error: what `stereolux bench` measures and writes.
//!
//! A suite ([`suites`]) is a list of groups, and a group is a few variants of the same picture. [`measure`] renders the
//! variants of a group in turn ([`timing`]), so that whatever slows the machine slows all of them, and judges the very frames
//! that it timed ([`variant_statistics`]) against a path-traced reference ([`reference`]) that is cached under everything it depends on.
//! Each variant becomes one [`records::Row`], appended to the [`journal`] as soon as it is there: a run that is killed goes on
//! where it stopped. In the end [`report`] fits, ranks and writes report.md, CSV, JSON and [`plots`].
//!
//! Photons are traced anew in every frame that is measured, so that frames are independent renders: their mean against the
//! reference is the bias, their spread the variance, and no renderer has to be rebuilt in between.

pub mod correspondence;
pub mod fingerprint;
pub mod instance_motion;
pub mod journal;
pub mod measure;
pub mod plots;
pub mod records;
pub mod reference;
pub mod report;
pub mod scenes;
pub mod statistics;
pub mod suites;
pub mod timing;
pub mod variant_statistics;

use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

use journal::Journal;
use measure::{GroupPlan, Lab};
use records::Machine;
use reference::References;
use scenes::SceneSource;
use timing::Round;

use crate::frame::user_passes::shader_library;
use crate::gpu::{GpuContext, GpuError};
use crate::images::ImageError;
use crate::metrics::MetricsError;
use crate::options::BenchOptions;
use crate::renderer::RenderError;
use crate::scene::SceneError;
use crate::xr::XrError;

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
    /// A file.
    #[error("{}: {reason}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The system's words.
        reason: String,
    },
    /// A plot.
    #[error("{}: cannot be drawn: {reason}", path.display())]
    Plot {
        /// The file.
        path: PathBuf,
        /// The plotting library's words.
        reason: String,
    },
}

impl BenchError {
    fn file(path: &Path, reason: impl fmt::Display) -> Self {
        Self::File {
            path: path.to_owned(),
            reason: reason.to_string(),
        }
    }
}

impl From<GpuError> for BenchError {
    fn from(error: GpuError) -> Self {
        Self::Render(error.into())
    }
}

/// Who hears how far the suite is.
pub trait BenchProgress {
    /// The groups that will be measured or taken from the journal.
    fn planned(&mut self, plans: &[GroupPlan]);
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
    /// Groups with errors that their reference was not good enough for.
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
    let plans = suites::plans(options)?;
    let mut checked: Vec<&SceneSource> = Vec::new();
    for plan in &plans {
        // Scenes that cannot be read are refused before anything is written.
        if !checked.contains(&&plan.scene) {
            plan.scene.check(settings)?;
            checked.push(&plan.scene);
        }
    }
    let machine = Machine::of(&GpuContext::open(Some(&settings.adapter))?.adapter);
    let out = options.out.as_path();
    let folder = match &options.references {
        Some(folder) => folder.clone(),
        None => out.join("references"),
    };
    for path in [out, &folder] {
        fs::create_dir_all(path).map_err(|error| BenchError::Out {
            path: path.to_owned(),
            reason: error.to_string(),
        })?;
    }
    let journal = Journal::open(&out.join("journal.jsonl"))?;
    let references = References::open(
        &folder,
        suites::reference_samples(options),
        library.clone(),
        machine.clone(),
    );
    progress.planned(&plans);
    let mut lab = Lab::new(
        out, settings, machine, library, journal, references, progress,
    );
    let mut rows = Vec::new();
    for plan in &plans {
        rows.extend(lab.measure(plan)?);
    }
    let resumed = lab.resumed();
    let machine = lab.machine.clone();
    let written = report::write(out, options, &machine, &rows)?;
    Ok(Outcome {
        rows: rows.len(),
        resumed,
        report: written.path,
        unsettled: written.unsettled,
    })
}
