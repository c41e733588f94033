//! What can be wrong with a scene, as one line each.

use std::path::{Path, PathBuf};

use thiserror::Error;

/// A scene or environment that cannot be used. `Display` is one line: where, what, and how to mend it where that is not obvious.
#[derive(Debug, Error)]
pub enum SceneError {
    /// The file could not be read from disk.
    #[error("{}: cannot be read: {reason}", path.display())]
    Read {
        /// The file that was asked for.
        path: PathBuf,
        /// Why the system refused, in its words.
        reason: String,
    },
    /// The file was read, but its content cannot be used.
    #[error("{}: {what}", path.display())]
    Invalid {
        /// The file at fault.
        path: PathBuf,
        /// Which part of it, what is wrong, and how to mend it.
        what: String,
    },
    /// `builtin:NAME` names no embedded scene.
    #[error("no embedded scene is called '{name}': the names are {known}")]
    UnknownBuiltin {
        /// The name that was asked for.
        name: String,
        /// All names, comma-separated.
        known: String,
    },
    /// `animation.clip` names no animation of the scene.
    #[error(
        "{scene} has no animation '{wanted}' (animation.clip): {known}; \"none\" plays nothing"
    )]
    UnknownClip {
        /// Name of the scene.
        scene: String,
        /// What was asked for.
        wanted: String,
        /// What there is.
        known: String,
    },
    /// A scene made in memory cannot be written as glTF.
    #[error("glTF writer: {what}")]
    Write {
        /// What does not fit the format.
        what: String,
    },
}

impl SceneError {
    /// A fault in the content of `path`. Line breaks in `what` are flattened, so that every error stays one line.
    pub(crate) fn invalid(path: &Path, what: impl AsRef<str>) -> Self {
        let what = what
            .as_ref()
            .split_whitespace()
            .collect::<Vec<_>>()
            .join(" ");
        Self::Invalid {
            path: path.to_path_buf(),
            what,
        }
    }

    /// A system error for `path`.
    pub(crate) fn read(path: &Path, reason: impl ToString) -> Self {
        Self::Read {
            path: path.to_path_buf(),
            reason: reason.to_string(),
        }
    }
}
