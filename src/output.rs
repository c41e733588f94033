//! Files under `--out`.

use std::fs::{self, File};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::false_color::provenance_color;
use crate::images::{
    Image, ImageError, ImageRgb, tone_map, write_atomically, write_exr, write_png,
};

/// Why nothing can be written; exit status 2.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// The folder cannot be made or written to.
    #[error("--out {}: {reason}; choose a folder that can be written to", path.display())]
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

/// The images of one frame.
#[derive(Debug, Default)]
pub struct FrameImages {
    /// Left eye, linear radiance.
    pub left: Option<ImageRgb>,
    /// Right eye, linear radiance.
    pub right: Option<ImageRgb>,
    /// Provenance of the right eye's pixels, row-major; `None` without reuse.
    pub provenance: Option<Vec<u32>>,
    /// Further images as (eye and part as in the file's name, such as `left_direct`; pixels).
    pub parts: Vec<(String, ImageRgb)>,
}

/// The folder that a run writes to.
pub struct OutputFolder {
    path: PathBuf,
    stats: File,
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

    /// Makes the folder if need be and starts `stats.jsonl` in it.
    ///
    /// # Errors
    /// [`OutputError::Folder`] if that is impossible.
    pub fn create(path: &Path) -> Result<Self, OutputError> {
        let fail = |error: std::io::Error| OutputError::Folder {
            path: path.to_owned(),
            reason: error.to_string(),
        };
        fs::create_dir_all(path).map_err(fail)?;
        let stats = File::create(path.join("stats.jsonl")).map_err(fail)?;
        Ok(Self {
            path: path.to_owned(),
            stats,
        })
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
        let path = self.path.join("stats.jsonl");
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

    /// Writes `run.json`.
    ///
    /// # Errors
    /// [`OutputError`].
    pub fn write_run(&self, run: &impl Serialize) -> Result<(), OutputError> {
        let path = self.path.join("run.json");
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

    /// Writes a frame's images: EXR per eye and per part, both tone mapped side by side, provenance in false colour.
    ///
    /// # Errors
    /// [`OutputError`].
    pub fn write_frame(
        &self,
        index: u32,
        images: &FrameImages,
        exposure: f64,
    ) -> Result<(), OutputError> {
        for (eye, image) in [("left", &images.left), ("right", &images.right)] {
            if let Some(image) = image {
                write_exr(
                    &self.path.join(format!("frame_{index:04}_{eye}.exr")),
                    image,
                )?;
            }
        }
        for (part, image) in &images.parts {
            write_exr(
                &self.path.join(format!("frame_{index:04}_{part}.exr")),
                image,
            )?;
        }
        let shown =
            |radiance: &Option<ImageRgb>| radiance.as_ref().map(|image| tone_map(image, exposure));
        let picture = match (shown(&images.left), shown(&images.right)) {
            (Some(left), Some(right)) => Some(Image::side_by_side(&left, &right)?),
            (image, None) | (None, image) => image,
        };
        if let Some(picture) = picture {
            write_png(&self.path.join(format!("frame_{index:04}.png")), &picture)?;
        }
        if let (Some(provenance), Some(right)) = (&images.provenance, &images.right) {
            let pixels = provenance.iter().map(|&p| provenance_color(p)).collect();
            let picture = Image::new(right.width, right.height, pixels)?;
            write_png(
                &self.path.join(format!("frame_{index:04}_reuse.png")),
                &picture,
            )?;
        }
        Ok(())
    }
}
