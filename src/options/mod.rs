//! Flags and settings files into validated options.
//!
//! A command line passes three stations in [`parse`]: each flag's own check, [`layers::Layers`], which puts the settings
//! of a config file, `--set` and flags over the defaults and checks each against the
//! [registry](crate::settings::registry), and the checks of what concerns several flags together. Nothing is opened or
//! made before all of that has passed, but for the config file.

mod checks;
mod cli;
pub mod layers;
mod parse;
mod save;
mod setting_flags;
mod values;

pub use cli::{
    BenchOptions, CompareOptions, InfoOptions, MergeOptions, NewOptions, Options, PoseOptions,
    RenderOptions, RunOptions, SessionChoice, SessionOptions, SettingsOptions, SharedOptions,
    Suite, TraceOptions, ViewOptions,
};
pub use parse::{EarlyExit, parse, parse_run};
pub use save::{Extent, changed, example_toml, save, to_toml, with_paths_in};

/// Unusable flags or settings; each message is one line. Exit status 2.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum OptionsError {
    /// The config file could not be read.
    #[error("{path}: {reason}; give --config a TOML file of settings")]
    ConfigUnreadable {
        /// Path as given.
        path: String,
        /// What went wrong.
        reason: String,
    },
    /// The config file is not TOML, or a pass in it not written as one.
    #[error("{path}:{line}: {reason}")]
    ConfigSyntax {
        /// Path as given.
        path: String,
        /// 1-based line.
        line: usize,
        /// What the parser says.
        reason: String,
    },
    /// A key that no setting has.
    #[error("{place}: unknown setting `{key}`; the nearest known one is `{nearest}`")]
    UnknownKey {
        /// `FILE:LINE` or `--set`.
        place: String,
        /// The key as given.
        key: String,
        /// The known key most like it.
        nearest: &'static str,
    },
    /// A value of the wrong type or out of range.
    #[error("{place}: {key} = {value}: must be {allowed}")]
    BadSetting {
        /// `FILE:LINE` or `--set`.
        place: String,
        /// Dotted key.
        key: &'static str,
        /// The value as given.
        value: String,
        /// Allowed values in words.
        allowed: String,
    },
    /// A flag's value that cannot be used.
    #[error("{flag} {value}: {reason}")]
    BadFlag {
        /// The flag.
        flag: String,
        /// The value as given, quoted.
        value: String,
        /// What is wrong and what is allowed.
        reason: String,
    },
    /// A settings file that cannot be written.
    #[error("{path}: settings cannot be written: {reason}")]
    Unwritable {
        /// Path as given.
        path: String,
        /// What went wrong.
        reason: String,
    },
    /// Flags or settings that do not go together.
    #[error("{0}")]
    Conflict(String),
}

/// Quotes a value for a one-line message: control characters escaped, long text cut.
pub(crate) fn quoted(text: &str) -> String {
    const LONGEST: usize = 100;
    let mut shown: String = text.chars().take(LONGEST).collect();
    if shown.len() < text.len() {
        shown.push_str("...");
    }
    format!("{shown:?}")
}
