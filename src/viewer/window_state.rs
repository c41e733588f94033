//! What the window remembers from one start to the next.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::layout::Layout;
use crate::files;
use crate::images::write_atomically;
use crate::scene::builtin::PREFIX;
use stereolux_base::user_folders;

/// What is read of the file at most, bytes: it has a few lines.
const MAX_BYTES: u64 = 1 << 16;
/// Files that it remembers.
const MOST_RECENT: usize = 10;

/// Size, layout and open panels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct WindowState {
    /// Inner size of the window, logical points.
    pub size: [f32; 2],
    /// Layout of the eyes.
    pub layout: Layout,
    /// Where the divider of a split view stands, 0 to 1.
    pub divider: f32,
    /// The tree of nodes is shown.
    pub hierarchy: bool,
    /// Inspector and settings are shown.
    pub side: bool,
    /// Times and counts are shown.
    pub statistics: bool,
    /// Files that were opened, the last first.
    pub recent: Vec<String>,
}

impl Default for WindowState {
    fn default() -> Self {
        Self {
            size: [1280.0, 800.0],
            layout: Layout::default(),
            divider: 0.5,
            hierarchy: true,
            side: true,
            statistics: true,
            recent: Vec::new(),
        }
    }
}

impl WindowState {
    /// Where it is kept: `viewer.toml` in the user's folder for settings. `None` if the system names no such folder.
    pub fn path() -> Option<PathBuf> {
        Some(user_folders::settings()?.join("viewer.toml"))
    }

    /// Reads it; what cannot be read or makes no sense is as in a first start, with a warning.
    pub fn load(path: &Path) -> Self {
        if !path.exists() {
            return Self::default();
        }
        let text = files::read_regular(path, MAX_BYTES)
            .and_then(|bytes| String::from_utf8(bytes).map_err(|error| error.to_string()));
        let read = text.and_then(|text| {
            toml::from_str::<Self>(&text).map_err(|error| error.message().to_owned())
        });
        let read = read.unwrap_or_else(|reason| {
            log::warn!(
                "{}: {reason}; the window opens with the default layout",
                path.display()
            );
            Self::default()
        });
        let sane = |value: f32, least: f32, most: f32, other: f32| {
            if value.is_finite() {
                value.clamp(least, most)
            } else {
                other
            }
        };
        let first = Self::default();
        Self {
            size: [
                sane(read.size[0], 320.0, 16_384.0, first.size[0]),
                sane(read.size[1], 240.0, 16_384.0, first.size[1]),
            ],
            divider: sane(read.divider, 0.0, 1.0, first.divider),
            ..read
        }
    }

    /// Puts a file first among those that were opened. Embedded scenes have a menu of their own.
    pub fn remember_file(&mut self, path: &str) {
        if path.is_empty() || path.starts_with(PREFIX) {
            return;
        }
        // Found again from wherever the next start is.
        let path = std::path::absolute(path).map_or_else(
            |_| path.to_owned(),
            |path| path.to_string_lossy().into_owned(),
        );
        self.recent.retain(|other| *other != path);
        self.recent.insert(0, path);
        self.recent.truncate(MOST_RECENT);
    }

    /// Writes it, beside and renamed.
    ///
    /// # Errors
    /// One line.
    pub fn save(&self, path: &Path) -> Result<(), String> {
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)
                .map_err(|error| format!("{}: {error}", folder.display()))?;
        }
        let text = toml::to_string(self).map_err(|error| error.to_string())?;
        write_atomically(path, |out| out.write_all(text.as_bytes()))
            .map_err(|error| error.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::folders::Folder;

    #[test]
    fn what_is_saved_is_read_back_and_nonsense_is_not() {
        let folder = Folder::new("window-state");
        // In a folder that is not there yet.
        let path = folder.path().join("state").join("viewer.toml");
        assert_eq!(WindowState::load(&path), WindowState::default(), "none yet");
        let state = WindowState {
            size: [900.0, 700.0],
            layout: Layout::Anaglyph,
            divider: 0.25,
            statistics: false,
            recent: vec!["/scenes/room.glb".to_owned()],
            ..WindowState::default()
        };
        state.save(&path).unwrap();
        assert_eq!(WindowState::load(&path), state);
        std::fs::write(&path, "size = [nan, 3.0]\nlayout = \"left\"\n").unwrap();
        let mended = WindowState::load(&path);
        assert_eq!(mended.size, [WindowState::default().size[0], 240.0]);
        assert_eq!(mended.layout, Layout::Left);
        std::fs::write(&path, "layout = \"upside-down\"").unwrap();
        assert_eq!(WindowState::load(&path), WindowState::default());
    }
}
