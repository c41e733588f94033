//! Where the system wants a user's settings and what can be made anew; nothing here makes a folder.

use std::ffi::OsString;
use std::path::PathBuf;

/// `stereolux` in the user's folder for settings: `XDG_CONFIG_HOME` or `~/.config`; `APPDATA` on Windows. `None` if the system
/// names no such folder.
#[must_use]
pub fn settings() -> Option<PathBuf> {
    folder("XDG_CONFIG_HOME", ".config", "APPDATA")
}

/// `stereolux` in the user's folder for what can be made anew: `XDG_CACHE_HOME` or `~/.cache`; `LOCALAPPDATA` on Windows. `None`
/// if the system names no such folder.
#[must_use]
pub fn cache() -> Option<PathBuf> {
    folder("XDG_CACHE_HOME", ".cache", "LOCALAPPDATA")
}

fn folder(variable: &str, at_home: &str, on_windows: &str) -> Option<PathBuf> {
    let base = if cfg!(windows) {
        PathBuf::from(set(on_windows)?)
    } else if let Some(folder) = set(variable) {
        PathBuf::from(folder)
    } else {
        PathBuf::from(set("HOME")?).join(at_home)
    };
    Some(base.join("stereolux"))
}

fn set(variable: &str) -> Option<OsString> {
    std::env::var_os(variable).filter(|value| !value.is_empty())
}
