//! `[[pass]]` of a config file: passes of the user's own (`frame::user_passes`).

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// What a pass of the user's runs over.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum UserDomain {
    /// All pixels of the eye, in 8x8 tiles of 64 threads.
    #[default]
    Pixels,
    /// Those that see a surface, 64 threads to a workgroup.
    Hits,
}

/// One `[[pass]]`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UserPass {
    /// WESL file.
    pub file: PathBuf,
    /// Name in timings and in `after` of others.
    pub name: String,
    /// The pass that it follows.
    pub after: String,
    /// Domain.
    #[serde(default)]
    pub over: UserDomain,
}

/// Key of the passes in config files and in `run.json`.
pub const KEY: &str = "pass";
