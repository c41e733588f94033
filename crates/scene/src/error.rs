//! What can be wrong with a scene, as one line each.

use std::path::{Path, PathBuf};

use thiserror::Error;

use stereolux_base::limits::OverBudget;
use stereolux_base::printable::{did_you_mean, line};

/// A scene or environment that cannot be used. `Display` is one line of at most 300 characters, fit for
/// a terminal: where, what, and how to mend it where that is not obvious.
#[derive(Debug, Error)]
pub enum SceneError {
    /// The file could not be read from disk.
    #[error("{}", line(&format!("{}: cannot be read: {reason}", path.display())))]
    Read {
        /// The file that was asked for.
        path: PathBuf,
        /// Why the system refused, in its words.
        reason: String,
    },
    /// The file was read, but its content cannot be used.
    #[error("{}", line(&format!("{}: {what}", path.display())))]
    Invalid {
        /// The file at fault.
        path: PathBuf,
        /// Which part of it, what is wrong, and how to mend it.
        what: String,
    },
    /// The scene names a file outside its own folder.
    #[error("{}", line(&format!("{}: {place} names '{name}', which does not lie below the scene's folder; if you trust the file's maker, --allow-outside reads it", path.display())))]
    Outside {
        /// The scene.
        path: PathBuf,
        /// Which part of it.
        place: String,
        /// The file that it names, in its words.
        name: String,
    },
    /// `builtin:NAME` names no embedded scene.
    #[error("{}", line(&format!("no embedded scene is called '{name}'{}: the names are {known}", did_you_mean(name, known.split(", ")))))]
    UnknownBuiltin {
        /// The name that was asked for.
        name: String,
        /// All names, comma-separated.
        known: String,
    },
    /// `animation.clip` names no animation of the scene.
    #[error("{}", line(&format!("{scene} has no animation '{wanted}' (animation.clip): {known}; \"none\" plays nothing")))]
    UnknownClip {
        /// Name of the scene.
        scene: String,
        /// What was asked for.
        wanted: String,
        /// What there is.
        known: String,
    },
    /// A scene made in memory that does not hold together ([`crate::Scene::check`]).
    #[error("{}", line(&format!("scene '{scene}': {fault}")))]
    Broken {
        /// Its name.
        scene: String,
        /// Which list, what is wrong.
        fault: String,
    },
    /// A scene made in memory cannot be written as glTF.
    #[error("{}", line(&format!("glTF writer: {what}")))]
    Write {
        /// What does not fit the format.
        what: String,
    },
}

impl SceneError {
    /// A fault in the content of `path`.
    pub fn invalid(path: &Path, what: impl AsRef<str>) -> Self {
        Self::Invalid {
            path: path.to_path_buf(),
            what: what.as_ref().to_owned(),
        }
    }

    /// Something in `path` takes too much memory.
    pub fn over(path: &Path, error: &OverBudget) -> Self {
        Self::invalid(path, error.to_string())
    }

    /// A system error for `path`.
    pub fn read(path: &Path, reason: impl ToString) -> Self {
        Self::Read {
            path: path.to_path_buf(),
            reason: reason.to_string(),
        }
    }
}
