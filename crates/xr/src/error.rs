//! What can go wrong in the session layer.

use std::fmt;
use std::path::PathBuf;

use stereolux_base::printable;

/// An error of the session layer; one line when displayed.
#[derive(Debug, thiserror::Error)]
pub enum XrError {
    /// A file that was given cannot be used as it is.
    #[error(transparent)]
    Input(#[from] InputError),
    /// A flag's value cannot be used.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// The recording cannot be created.
    #[error("cannot write the recording {}: {cause}; choose a writable file with --record", path.display())]
    RecordCreate {
        /// The file that was asked for.
        path: PathBuf,
        /// The system's reason.
        cause: std::io::Error,
    },
    /// The recording broke off while running.
    #[error("the recording {} broke off after {frames} frames: {cause}", path.display())]
    RecordWrite {
        /// The file that was being written.
        path: PathBuf,
        /// Complete frames in it.
        frames: u64,
        /// The system's reason.
        cause: std::io::Error,
    },
    /// The frame loop called out of order: a fault of this program.
    #[error("session call out of order: {0}")]
    CallOrder(String),
    /// The runtime failed or went away.
    #[error("XR runtime: {0}")]
    Runtime(String),
}

impl XrError {
    /// True for unusable arguments or input (exit status 2), false for a failure while running (1).
    #[must_use]
    pub fn is_unusable_input(&self) -> bool {
        matches!(
            self,
            Self::Input(_) | Self::Argument(_) | Self::RecordCreate { .. }
        )
    }
}

/// A fault in an input file: which file, which 1-based line, which field, and what is wrong with it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct InputError {
    /// The file, as the user named it.
    pub file: String,
    /// 1-based line, where the fault has one.
    pub line: Option<usize>,
    /// Name of the field, such as `views[0].fov.left`, where the fault has one.
    pub field: Option<String>,
    /// What is wrong and how to mend it.
    pub what: String,
}

impl InputError {
    /// A fault of the file as a whole.
    #[must_use]
    pub fn file(file: &str, what: impl Into<String>) -> Self {
        Self {
            file: file.to_owned(),
            line: None,
            field: None,
            what: what.into(),
        }
    }

    /// A fault on a 1-based line.
    #[must_use]
    pub fn line(file: &str, line: usize, what: impl Into<String>) -> Self {
        Self {
            line: Some(line),
            ..Self::file(file, what)
        }
    }

    /// A fault of one field on a 1-based line.
    #[must_use]
    pub fn field(file: &str, line: usize, field: &str, what: impl Into<String>) -> Self {
        Self {
            field: Some(field.to_owned()),
            ..Self::line(file, line, what)
        }
    }
}

impl fmt::Display for InputError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut text = self.file.clone();
        if let Some(line) = self.line {
            text.push_str(&format!(", line {line}"));
        }
        if let Some(field) = &self.field {
            text.push_str(&format!(", field {field}"));
        }
        f.write_str(&printable::line(&format!("{text}: {}", self.what)))
    }
}

/// A flag's value that cannot be used: what is wrong and what would do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct ArgumentError(pub String);
