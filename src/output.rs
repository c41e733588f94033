//! Files under `--out`.

use std::fs::{self, File, TryLockError};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use glam::{DMat4, DVec3};
use serde::Serialize;

use crate::chrome_trace::ChromeTrace;
use crate::exr_file::{ExrAttribute, ExrFile, ExrSamples, exr_text};
use crate::false_color::provenance_color;
use crate::gpu::{HostSpan, Submission};
use crate::images::{
    Image, ImageError, ImageRgb, ImageRgb8, luminance, write_atomically, write_png,
};
use crate::renderer::{Eye, Inspected, InspectedValues};
use crate::settings::{ExrLayout, ExrPrecision, Settings};
use crate::tone::tone_map_by;
use crate::xr::View;

/// Why nothing can be written; exit status 2.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// The folder cannot be made or written to.
    #[error("--out {}: {reason}; choose another folder", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// The system's words.
        reason: String,
    },
    /// A file in it cannot be written.
    #[error("{}: {reason}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The system's words.
        reason: String,
    },
    /// An image cannot be written.
    #[error(transparent)]
    Image(#[from] ImageError),
}

/// Statistics, a line per frame.
pub const STATS: &str = "stats.jsonl";
/// What a run was, and how it ended.
pub const RUN: &str = "run.json";
const TRACE: &str = "trace.json";

/// What a frame's files say about it.
#[derive(Debug, Clone, Copy)]
pub struct FrameFacts<'a> {
    /// Number, from 0.
    pub frame: u32,
    /// Predicted display time, nanoseconds.
    pub display_time_ns: i64,
    /// Refresh rate, Hz.
    pub refresh_hz: f64,
    /// Views of the left and the right eye.
    pub views: &'a [View; 2],
}

/// The images of one frame.
#[derive(Debug, Default)]
pub struct FrameImages {
    /// Linear radiance of the eyes that were rendered, the left one first.
    pub radiance: Vec<(Eye, ImageRgb)>,
    /// Provenance of the right eye's pixels, row-major; `None` without reuse.
    pub provenance: Option<Vec<u32>>,
    /// Parts of the radiance: direct, indirect, albedo.
    pub parts: Vec<(Eye, &'static str, ImageRgb)>,
    /// What each pixel sees, as further layers.
    pub aovs: Vec<Inspected>,
}

impl FrameImages {
    fn radiance(&self, eye: Eye) -> Option<&ImageRgb> {
        let found = self.radiance.iter().find(|(of, _)| *of == eye);
        found.map(|(_, image)| image)
    }
}

/// Makes a folder if need be, and holds it by a lock on its `stats.jsonl`, which may be empty.
///
/// # Errors
/// The folder cannot be made or written to, something else has that name in it, or another run writes there.
pub fn take(folder: &Path) -> io::Result<File> {
    fs::create_dir_all(folder)?;
    let path = folder.join(STATS);
    // A link leads to somebody else's file, and a pipe would wait for a reader.
    if fs::symlink_metadata(&path).is_ok_and(|there| !there.is_file()) {
        return Err(io::Error::other(format!("{STATS} in it is no file")));
    }
    let mut options = File::options();
    let stats = options.create(true).write(true).truncate(false);
    let stats = stats.open(path)?;
    if cfg!(unix) && matches!(stats.try_lock(), Err(TryLockError::WouldBlock)) {
        return Err(io::Error::other("another run writes to it"));
    }
    Ok(stats)
}

/// Luminance that every curve shows as black or white in 8 bits, but for a step or two, and as something between.
const BLACK: f64 = 2e-4;
const WHITE: f64 = 30.0;
const MIDDLE: f64 = 0.3;
/// The greatest that `output.exposure` takes.
const MOST_EXPOSURE: f64 = 1e9;
/// Pixels of an image that are looked at for it, about.
const LOOKED_AT: usize = 65_536;

/// Median luminance of the pixels that are not black; `None` if all are.
fn lit_luminance(images: &FrameImages) -> Option<f64> {
    let mut lit: Vec<f64> = Vec::new();
    for (_, image) in &images.radiance {
        let step = image.pixels.len().div_ceil(LOOKED_AT).max(1);
        let looked_at = image.pixels.iter().step_by(step);
        let luminances = looked_at.map(|pixel| luminance(pixel.map(f64::from)));
        lit.extend(luminances.filter(|value| *value > 0.0 && value.is_finite()));
    }
    let middle = lit.len() / 2;
    (!lit.is_empty()).then(|| *lit.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// The number with so many digits behind its first.
fn rounded(number: f64, digits: usize) -> f64 {
    format!("{number:.digits$e}").parse().unwrap_or(number)
}

/// The folder that a run writes to.
pub struct OutputFolder {
    path: PathBuf,
    /// How files are written.
    settings: Settings,
    /// The adapter's name.
    adapter: String,
    /// The folder, and `stats.jsonl` in it, were made for this run.
    is_new: [bool; 2],
    stats: File,
    trace: Option<ChromeTrace>,
    /// Of the last picture: [`lit_luminance`].
    lit: Option<f64>,
}

impl OutputFolder {
    /// Finds out early, and without making anything, whether `path` can become a folder.
    ///
    /// # Errors
    /// [`OutputError::Folder`] if a file is in the way.
    pub fn check(path: &Path) -> Result<(), OutputError> {
        let in_the_way = path
            .ancestors()
            .find(|ancestor| ancestor.exists())
            .filter(|ancestor| !ancestor.is_dir());
        match in_the_way {
            None => Ok(()),
            Some(file) => Err(OutputError::Folder {
                path: path.to_owned(),
                reason: format!("{} is not a folder", file.display()),
            }),
        }
    }

    /// Makes the folder if need be and takes it for this run, by a lock ([`take`]) where systems have locks that let others
    /// read on. What an older run has left in it stays until [`OutputFolder::clear`].
    ///
    /// # Errors
    /// [`OutputError::Folder`] if that is impossible, another run writes there, or what lies there is not a run's.
    pub fn open(path: &Path, settings: &Settings, adapter: &str) -> Result<Self, OutputError> {
        let fail = |error: io::Error| OutputError::Folder {
            path: path.to_owned(),
            reason: error.to_string(),
        };
        let is_new = [!path.exists(), !path.join(STATS).exists()];
        if is_new == [false, true] {
            // Other programs number their frames so, too.
            let found = fs::read_dir(path).map_err(fail)?.flatten();
            let files = found.filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_file()));
            let mut names = files.filter_map(|entry| entry.file_name().into_string().ok());
            if let Some(name) = names.find(|name| is_of_a_run(name)) {
                return Err(OutputError::Folder {
                    path: path.to_owned(),
                    reason: format!("{name} lies there without a run's {STATS}, and would be lost"),
                });
            }
        }
        Ok(Self {
            path: path.to_owned(),
            settings: settings.clone(),
            adapter: adapter.to_owned(),
            is_new,
            stats: take(path).map_err(fail)?,
            trace: None,
            lit: None,
        })
    }

    /// Lets go of a folder that was opened for nothing.
    pub fn give_up(self) {
        let [folder, stats] = self.is_new;
        // What cannot be removed is an empty file.
        if stats {
            let _ = fs::remove_file(self.path.join(STATS));
        }
        if folder {
            let _ = fs::remove_dir(&self.path);
        }
    }

    /// Removes what an older run has left, and returns how many files that were, besides its `stats.jsonl`.
    ///
    /// # Errors
    /// [`OutputError::Folder`] if that is impossible.
    pub fn clear(&mut self) -> Result<usize, OutputError> {
        let path = &self.path;
        let fail = |error: io::Error| OutputError::Folder {
            path: path.clone(),
            reason: error.to_string(),
        };
        let mut removed = 0;
        for entry in fs::read_dir(path).map_err(fail)? {
            let entry = entry.map_err(fail)?;
            let is_old = entry.file_name().to_str().is_some_and(is_of_a_run);
            // Folders and links of such a name are somebody else's.
            if is_old && entry.file_type().map_err(fail)?.is_file() {
                fs::remove_file(entry.path()).map_err(fail)?;
                removed += 1;
            }
        }
        self.stats.set_len(0).map_err(fail)?;
        Ok(removed)
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Appends one line to `stats.jsonl` and hands it to the system, so that a killed run keeps it.
    ///
    /// # Errors
    /// [`OutputError::File`].
    pub fn append_stats(&mut self, stats: &impl Serialize) -> Result<(), OutputError> {
        let path = self.path.join(STATS);
        let fail = |reason: String| OutputError::File { path, reason };
        let mut line = match serde_json::to_string(stats) {
            Ok(line) => line,
            Err(error) => return Err(fail(error.to_string())),
        };
        line.push('\n');
        self.stats
            .write_all(line.as_bytes())
            .map_err(|error| fail(error.to_string()))
    }

    fn trace_path(&self) -> PathBuf {
        self.path.join(TRACE)
    }

    fn trace_failed(&self, error: &io::Error) -> OutputError {
        OutputError::File {
            path: self.trace_path(),
            reason: error.to_string(),
        }
    }

    /// Begins `trace.json`. `clocks` are submissions to compare the clocks by.
    ///
    /// # Errors
    /// [`OutputError::File`].
    pub fn begin_trace(&mut self, clocks: &[Submission]) -> Result<(), OutputError> {
        let trace = ChromeTrace::create(&self.trace_path(), &self.adapter, clocks);
        self.trace = Some(trace.map_err(|error| self.trace_failed(&error))?);
        Ok(())
    }

    /// Adds a frame to `trace.json`, if there is one; `slot`: as [`ChromeTrace::add_frame`].
    ///
    /// # Errors
    /// [`OutputError::File`].
    pub fn trace_frame(
        &mut self,
        index: u32,
        slot: Option<u32>,
        stages: &[HostSpan],
        submissions: &[Submission],
    ) -> Result<(), OutputError> {
        let Some(trace) = &mut self.trace else {
            return Ok(());
        };
        let written = trace.add_frame(index, slot, stages, submissions);
        written.map_err(|error| self.trace_failed(&error))
    }

    /// Puts `trace.json` in its place, if there is one.
    ///
    /// # Errors
    /// [`OutputError::File`].
    pub fn finish_trace(&mut self) -> Result<(), OutputError> {
        match self.trace.take().map(ChromeTrace::finish) {
            Some(Err(error)) => Err(self.trace_failed(&error)),
            _ => Ok(()),
        }
    }

    /// Writes a folder's `run.json`.
    ///
    /// # Errors
    /// [`OutputError`].
    pub fn write_run(folder: &Path, run: &impl Serialize) -> Result<(), OutputError> {
        let path = folder.join(RUN);
        let text = serde_json::to_string_pretty(run).map_err(|error| OutputError::File {
            path: path.clone(),
            reason: error.to_string(),
        })?;
        write_atomically(&path, |out| {
            out.write_all(text.as_bytes())?;
            out.write_all(b"\n")
        })?;
        Ok(())
    }

    fn frame_path(&self, index: u32, rest: &str) -> PathBuf {
        self.path.join(format!("frame_{index:04}{rest}"))
    }

    /// Writes a frame's images: EXR by the settings' layout, both eyes tone mapped side by side, provenance in false colour.
    ///
    /// # Errors
    /// [`OutputError`].
    pub fn write_frame(
        &mut self,
        facts: &FrameFacts<'_>,
        images: &FrameImages,
    ) -> Result<(), OutputError> {
        let index = facts.frame;
        match self.settings.output.layout {
            ExrLayout::Files => self.write_files(facts, images)?,
            ExrLayout::Multiview => self.write_multiview(facts, images)?,
        }
        if let Some(picture) = self.picture(images)? {
            write_png(&self.frame_path(index, ".png"), &picture)?;
            self.lit = lit_luminance(images);
        }
        if let (Some(provenance), Some(right)) = (&images.provenance, images.radiance(Eye::Right)) {
            let pixels = provenance.iter().map(|&p| provenance_color(p)).collect();
            let picture = Image::new(right.width, right.height, pixels)?;
            write_png(&self.frame_path(index, "_reuse.png"), &picture)?;
        }
        Ok(())
    }

    /// The exposure to try where the last picture is all but white or black, in a sentence that says so.
    #[must_use]
    pub fn exposure_advice(&self) -> Option<String> {
        let lit = self.lit?;
        let shown = lit * self.settings.render.output.exposure;
        let what = match shown {
            ..BLACK => "darker",
            WHITE.. => "brighter",
            _ => return None,
        };
        Some(format!(
            "half of what is lit in the last picture is {what} than {}, which its exposure does not show; try --set output.exposure={}",
            rounded(lit, 1),
            rounded((MIDDLE / lit).min(MOST_EXPOSURE), 0)
        ))
    }

    /// The eyes side by side as a screen shows them.
    fn picture(&self, images: &FrameImages) -> Result<Option<ImageRgb8>, OutputError> {
        let output = &self.settings.render.output;
        let shown = |eye: Eye| {
            let image = images.radiance(eye);
            image.map(|image| tone_map_by(image, output.exposure, output.tone))
        };
        Ok(match (shown(Eye::Left), shown(Eye::Right)) {
            (Some(left), Some(right)) => Some(Image::side_by_side(&left, &right)?),
            (image, None) | (None, image) => image,
        })
    }

    /// A file per eye, its further layers in it, and one per part.
    fn write_files(&self, facts: &FrameFacts<'_>, images: &FrameImages) -> Result<(), OutputError> {
        let half = self.settings.output.exr == ExrPrecision::F16;
        let eyes = images.radiance.iter().map(|(eye, image)| (*eye, "", image));
        let parts = images.parts.iter();
        let parts = parts.map(|(eye, part, image)| (*eye, *part, image));
        for (eye, part, image) in eyes.chain(parts) {
            let mut file = ExrFile::new([image.width, image.height]);
            file.add_rgb("", image, half);
            self.describe(&mut file, facts, eye, "");
            file.set("view", ExrAttribute::Text(exr_text(eye.name())));
            let rest = if part.is_empty() {
                for layer in images.aovs.iter().filter(|layer| layer.eye == eye) {
                    add_layer(&mut file, layer, "", half);
                }
                format!("_{}.exr", eye.name())
            } else {
                format!("_{}_{part}.exr", eye.name())
            };
            let path = self.frame_path(facts.frame, &rest);
            write_atomically(&path, |out| file.write(out))?;
        }
        Ok(())
    }

    /// One file: the first eye's channels have no view in their names.
    fn write_multiview(
        &self,
        facts: &FrameFacts<'_>,
        images: &FrameImages,
    ) -> Result<(), OutputError> {
        let half = self.settings.output.exr == ExrPrecision::F16;
        let Some((first, image)) = images.radiance.first() else {
            return Ok(());
        };
        let mut file = ExrFile::new([image.width, image.height]);
        let view = |eye: Eye| match eye == *first {
            true => String::new(),
            false => format!("{}.", eye.name()),
        };
        for (eye, image) in &images.radiance {
            file.add_rgb(&view(*eye), image, half);
            self.describe(&mut file, facts, *eye, &view(*eye));
        }
        for (eye, part, image) in &images.parts {
            file.add_rgb(&format!("{part}.{}", view(*eye)), image, half);
        }
        for layer in &images.aovs {
            add_layer(&mut file, layer, &view(layer.eye), half);
        }
        let names = images.radiance.iter().map(|(eye, _)| exr_text(eye.name()));
        file.set("multiView", ExrAttribute::TextVector(names.collect()));
        let path = self.frame_path(facts.frame, ".exr");
        write_atomically(&path, |out| file.write(out))?;
        Ok(())
    }

    /// Attributes of an eye's image; `prefix` stands before those that differ between the eyes of one file.
    fn describe(&self, file: &mut ExrFile, facts: &FrameFacts<'_>, eye: Eye, prefix: &str) {
        let view = &facts.views[eye as usize];
        let tangents = view.fov.tangents();
        let (width, height) = (tangents.right - tangents.left, tangents.up - tangents.down);
        let [columns, rows] = file.size().map(f64::from);
        let center = (
            ((tangents.left + tangents.right) / 2.0) as f32,
            ((tangents.up + tangents.down) / 2.0) as f32,
        );
        let center = ExrAttribute::FloatVec2(center.into());
        let mut own = |name: &str, value| file.set(&format!("{prefix}{name}"), value);
        own("screenWindowCenter", center);
        own("screenWindowWidth", ExrAttribute::F32(width as f32));
        let aspect = (width / columns) / (height / rows);
        own("pixelAspectRatio", ExrAttribute::F32(aspect as f32));
        own("worldToCamera", world_to_camera(view));
        let fov = view.fov;
        let angles = [
            fov.angle_left,
            fov.angle_right,
            fov.angle_up,
            fov.angle_down,
        ];
        let angles = angles.map(|angle| format!("{:.6}", angle.to_degrees()));
        own(
            "fovDegrees",
            ExrAttribute::Text(exr_text(&angles.join(" "))),
        );
        file.set("imageCounter", ExrAttribute::I32(facts.frame as i32));
        let thousandths = (facts.refresh_hz * 1000.0).round() as i32;
        file.set(
            "framesPerSecond",
            ExrAttribute::Rational((thousandths, 1000)),
        );
        for (name, text) in [
            ("stereolux.adapter", self.adapter.clone()),
            ("stereolux.displayTimeNs", facts.display_time_ns.to_string()),
            (
                "stereolux.settings",
                format!("{:016x}", self.settings.picture_hash()),
            ),
        ] {
            file.set(name, ExrAttribute::Text(exr_text(&text)));
        }
    }
}

/// OpenEXR's camera is left-handed: x right, y up, z forward; its matrices are for row vectors.
fn world_to_camera(view: &View) -> ExrAttribute {
    let camera_from_eye = DMat4::from_scale(DVec3::new(1.0, 1.0, -1.0));
    let camera_from_world = camera_from_eye * DMat4::from(view.eye_from_world());
    let columns = camera_from_world.to_cols_array();
    ExrAttribute::Matrix4x4(columns.map(|value| value as f32))
}

/// Adds what each pixel sees; `view` stands before the last word of the channels' names.
fn add_layer(file: &mut ExrFile, layer: &Inspected, view: &str, half: bool) {
    let mut add = |name: &str, channel: &str, samples| {
        let separator = if name.is_empty() { "" } else { "." };
        file.add(format!("{name}{separator}{view}{channel}"), samples);
    };
    let name = layer.inspection.name();
    match &layer.values {
        InspectedValues::Scalar(values) => add("", "Z", ExrSamples::Float(values.clone())),
        InspectedValues::Labels(values) => add(name, "id", ExrSamples::Whole(values.clone())),
        InspectedValues::Vector2(values) => {
            for (at, channel) in ["X", "Y"].into_iter().enumerate() {
                let samples = values.iter().map(|value| value[at]).collect();
                add(name, channel, ExrSamples::Float(samples));
            }
        }
        InspectedValues::Direction(values) | InspectedValues::Color(values) => {
            let is_color = matches!(layer.values, InspectedValues::Color(_));
            let (name, channels) = match is_color {
                true => (name, ["R", "G", "B"]),
                false => ("N", ["X", "Y", "Z"]),
            };
            for (at, channel) in channels.into_iter().enumerate() {
                let samples = values.iter().map(|value| value[at]).collect();
                add(name, channel, ExrSamples::real(samples, half));
            }
        }
    }
}

/// Whether a run clears or writes a file of such a name.
pub(crate) fn is_taken(name: &str) -> bool {
    name == STATS || is_of_a_run(name)
}

/// Whether a run names its files so, besides its statistics; those included that it was writing when it was killed.
fn is_of_a_run(name: &str) -> bool {
    let unfinished = name
        .strip_prefix('.')
        .and_then(|name| name.strip_suffix(".partial"))
        .and_then(|name| name.rsplit_once('.'))
        .filter(|(_, process)| process.bytes().all(|digit| digit.is_ascii_digit()));
    let name = unfinished.map_or(name, |(name, _)| name);
    if [RUN, TRACE].contains(&name) {
        return true;
    }
    let Some(rest) = name.strip_prefix("frame_") else {
        return false;
    };
    let digits = rest.bytes().take_while(u8::is_ascii_digit).count();
    let (number, rest) = rest.split_at(digits);
    let part = |rest: &str| {
        let eye = rest.strip_prefix("_left").or(rest.strip_prefix("_right"));
        eye.is_some_and(|part| ["", "_direct", "_indirect", "_albedo"].contains(&part))
    };
    number.len() >= 4
        && (["", "_reuse"]
            .iter()
            .any(|end| rest == format!("{end}.png"))
            || rest == ".exr"
            || rest.strip_suffix(".exr").is_some_and(part))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::folders::Folder;

    #[test]
    fn only_names_of_a_run_are_a_runs() {
        for name in [
            "run.json",
            "trace.json",
            "frame_0000.png",
            "frame_0000.exr",
            "frame_0000_reuse.png",
            "frame_12345_left.exr",
            "frame_0001_right_albedo.exr",
            ".frame_0044_left.exr.30223.partial",
            ".run.json.7.partial",
        ] {
            assert!(is_of_a_run(name), "{name}");
        }
        for name in [
            "frame_000.png",
            "frame_0000_left.png",
            "frame_0000_top.exr",
            "frame_0000_left_mine.exr",
            "frame_0000.jpg",
            "frame_abcd.png",
            "my_frame_0000.png",
            "view_0000.png",
            "run.json.bak",
            ".mine.exr.7.partial",
            ".run.json.old.partial",
            "stats.jsonl",
            "journal.jsonl",
        ] {
            assert!(!is_of_a_run(name), "{name}");
        }
    }

    #[test]
    fn what_is_given_up_leaves_the_folders_that_were_there() {
        let folder = Folder::new("given-up");
        let base = folder.join("out");
        for was_there in [true, false] {
            if was_there {
                fs::create_dir_all(&base).unwrap();
            }
            let folder = OutputFolder::open(&base, &Settings::default(), "").unwrap();
            assert!(base.join(STATS).exists());
            folder.give_up();
            assert!(!base.join(STATS).exists());
            assert_eq!(base.exists(), was_there);
            let _ = fs::remove_dir(&base);
        }
    }
}
