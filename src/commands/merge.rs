//! `merge`: joins the statistics of runs that rendered ranges of one run's frames, or the reports of a suite's parts.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::report::Medians;
use super::{Failure, print_line};
use crate::files;
use crate::frame_loop::KEPT_FRAMES;
use crate::images::write_atomically;
use crate::limits::LoadBudget;
use crate::options::MergeOptions;
use crate::output::{OutputFolder, RUN, STATS, take};
use crate::printable::json_fault;

/// What must be the same in all runs.
const SAME: [&str; 8] = [
    "/version",
    "/adapter/name",
    "/settings_hash",
    "/settings/simulated",
    "/session",
    "/size",
    "/headset",
    "/refresh_hz",
];

/// Frames of a folder: the whole lines of `stats.jsonl`. Of a run that was killed or met a full disk the last may be cut.
fn frames(folder: &Path) -> Result<Vec<Value>, Failure> {
    let path = folder.join(STATS);
    let text = read(&path)?;
    let whole = text.rfind('\n').map_or(0, |end| end + 1);
    if whole < text.len() {
        log::warn!("{}: the last line is cut off, and left out", path.display());
    }
    let lines = text[..whole].lines().enumerate();
    lines
        .map(|(at, line)| {
            let frame: Value = serde_json::from_str(line).map_err(|error| {
                let (number, error) = (at + 1, json_fault(&error, error.column()));
                Failure::unusable(format!("{}:{number}: {error}", path.display()))
            })?;
            match frame["frame"].as_u64() {
                Some(_) => Ok(frame),
                None => Err(Failure::unusable(format!(
                    "{}:{}: no frame number; give folders that `run` has written",
                    path.display(),
                    at + 1
                ))),
            }
        })
        .collect()
}

fn read(path: &Path) -> Result<String, Failure> {
    let fault = |reason: String| {
        Failure::unusable(format!(
            "{}: {reason}; give folders that `run` or `bench` has written",
            path.display()
        ))
    };
    let bytes = files::load_regular(path, &LoadBudget::default()).map_err(fault)?;
    String::from_utf8(bytes).map_err(|error| fault(error.to_string()))
}

fn run_of(folder: &Path) -> Result<Value, Failure> {
    let path = folder.join(RUN);
    serde_json::from_str(&read(&path)?)
        .map_err(|error| Failure::unusable(format!("{}: {error}", path.display())))
}

/// Writes `stats.jsonl` and `run.json` of all runs together.
pub fn merge(options: &MergeOptions) -> Result<(), Failure> {
    OutputFolder::check(&options.out)?;
    let same_folder =
        |folder: &PathBuf| folder.canonicalize().ok() == options.out.canonicalize().ok();
    if options.out.exists() && options.folders.iter().any(same_folder) {
        return Err(Failure::unusable(format!(
            "--out {} is one of the folders to merge; give another",
            options.out.display()
        )));
    }
    if options.folders[0].join("report.json").exists() {
        return reports(options);
    }
    let is_there = |name| options.out.join(name).exists();
    let is_merged = is_there(RUN) && !run_of(&options.out)?["merged"].is_null();
    // A run that was killed has no more than its statistics.
    if (is_there(RUN) || is_there(STATS)) && !is_merged {
        return Err(Failure::unusable(format!(
            "--out {} holds a run, whose statistics would be lost; give another folder",
            options.out.display()
        )));
    }
    let mut runs = Vec::new();
    let mut all = Vec::new();
    for folder in &options.folders {
        let run = run_of(folder)?;
        all.extend(frames(folder)?.into_iter().map(|frame| (frame, folder)));
        runs.push(run);
    }
    for (run, folder) in runs.iter().zip(&options.folders) {
        let differs = |key: &&str| run.pointer(key) != runs[0].pointer(key);
        if let Some(key) = SAME.into_iter().find(differs) {
            let [first, other] =
                [&runs[0], run].map(|run| run.pointer(key).unwrap_or(&Value::Null));
            return Err(Failure::unusable(format!(
                "{} and {} are not of one run: {} is {first} and {other}",
                options.folders[0].display(),
                folder.display(),
                key[1..].replace('/', "."),
            )));
        }
    }
    for (run, folder) in runs.iter().zip(&options.folders) {
        if let Some(error) = run["error"].as_str() {
            log::warn!("{} is not whole: {error}", folder.display());
        }
    }
    let number = |frame: &Value| frame["frame"].as_u64().unwrap_or_default();
    all.sort_by_key(|(frame, _)| number(frame));
    match all.first().map(|(frame, _)| number(frame)) {
        None | Some(0) => {}
        Some(1) => log::warn!("frame 0 is in none of the folders"),
        Some(first) => log::warn!("frames 0 to {} are in none of the folders", first - 1),
    }
    for pair in all.windows(2) {
        let [(first, of_first), (second, of_second)] = pair else {
            continue;
        };
        let (at, next) = (number(first), number(second));
        if at == next {
            return Err(Failure::unusable(format!(
                "frame {at} is in {} and in {}; leave one of the folders out",
                of_first.display(),
                of_second.display()
            )));
        }
        if next != at + 1 {
            log::warn!(
                "frames {} to {} are in none of the folders",
                at + 1,
                next - 1
            );
        }
    }
    let frames: Vec<Value> = all.into_iter().map(|(frame, _)| frame).collect();
    let folders = options
        .folders
        .iter()
        .map(|folder| folder.display().to_string());
    let merged = joined(runs, &frames, folders.collect())?;
    write(&options.out, &frames, &merged)?;
    print_line(&format!(
        "{} frames of {} folders: {}",
        frames.len(),
        options.folders.len(),
        options.out.display()
    ))
}

/// Joins the reports of `bench --shard`.
#[cfg(feature = "bench")]
fn reports(options: &MergeOptions) -> Result<(), Failure> {
    let folders = options.folders.iter();
    let texts: Vec<(PathBuf, String)> = folders
        .map(|folder| Ok((folder.clone(), read(&folder.join("report.json"))?)))
        .collect::<Result<_, Failure>>()?;
    super::bench::merge(&texts, &options.out)
}

#[cfg(not(feature = "bench"))]
fn reports(_: &MergeOptions) -> Result<(), Failure> {
    Err(super::not_built("merge of reports", "bench"))
}

/// The first run's report with what all frames give; wall times add up.
fn joined(runs: Vec<Value>, frames: &[Value], folders: Vec<String>) -> Result<Value, Failure> {
    let wall_s: f64 = runs.iter().filter_map(|run| run["wall_s"].as_f64()).sum();
    let error = runs.iter().map(|run| run["error"].clone());
    let error = error.into_iter().find(|error| !error.is_null());
    let last = &frames[frames.len().saturating_sub(KEPT_FRAMES)..];
    let medians = serde_json::to_value(Medians::of(last)).map_err(Failure::failed)?;
    let first = runs.into_iter().next();
    let mut merged = first.ok_or_else(|| Failure::unusable("there is nothing to merge"))?;
    merged["frames"] = json!(frames.len());
    merged["wall_s"] = json!(wall_s);
    merged["frames_per_second"] = json!(match wall_s > 0.0 {
        true => frames.len() as f64 / wall_s,
        false => 0.0,
    });
    merged["medians"] = medians;
    merged["error"] = error.unwrap_or(Value::Null);
    merged["merged"] = json!(folders);
    Ok(merged)
}

fn write(out: &Path, frames: &[Value], run: &Value) -> Result<(), Failure> {
    let _taken = take(out)
        .map_err(|error| Failure::unusable(format!("--out {}: {error}", out.display())))?;
    OutputFolder::write_run(out, run).map_err(Failure::failed)?;
    // The locked file goes last: whoever comes next locks another.
    write_atomically(&out.join(STATS), |file| {
        use std::io::Write as _;
        frames
            .iter()
            .try_for_each(|frame| writeln!(file, "{frame}"))
    })
    .map_err(Failure::failed)
}
