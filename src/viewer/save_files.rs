//! Writing the scene and the settings, and never over a file of others unasked.

use std::path::{Path, PathBuf};

use egui::Context;

use super::app::App;
use super::question::Question;
use super::worker::decided;
use crate::options::{Extent, SettingsFile as _};

/// What is written to files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Saved {
    /// The edited scene, as glTF.
    Scene,
    /// The settings, as TOML.
    Settings,
}

impl App {
    /// Writes to the path of the fields; asks before, if a file stands there that this window did not write.
    pub(super) fn save(&mut self, context: &Context, what: Saved) {
        let path = PathBuf::from(self.fields.path_of(what).trim());
        if path.exists() && !self.written.contains(&path) {
            self.asks = Some(Question::Replace(path, what, None));
            return;
        }
        self.make_room(&path);
        let (written, use_of_it) = match what {
            Saved::Scene => {
                let written = self.document.save(&path);
                (written.map_err(|error| error.to_string()), "")
            }
            Saved::Settings => {
                // What is shown is what is saved, whatever `auto` stands for where it is read.
                let mut settings = decided(self.panel_settings());
                settings.size = Some(self.size);
                let written = settings.save(&path, Extent::Changed);
                (
                    written.map_err(|error| error.to_string()),
                    "; --config reads it",
                )
            }
        };
        match written {
            Ok(()) => {
                let text = format!("{} written{use_of_it}", path.display());
                self.say(context, text, false);
                self.written.insert(path);
            }
            Err(error) => self.say(context, error, true),
        }
    }

    /// Writes over a file, as was answered.
    pub(super) fn replace(&mut self, context: &Context, path: PathBuf, what: Saved) {
        self.written.insert(path);
        self.save(context, what);
    }

    /// Makes the folder of `--out` if that is where `path` lies. Other folders that are missing are slips of the hand, and
    /// said by what writes there; so is one that cannot be made.
    fn make_room(&self, path: &Path) {
        if path.parent() == Some(self.out.as_path())
            && let Err(error) = std::fs::create_dir_all(&self.out)
        {
            log::debug!("{}: {error}", self.out.display());
        }
    }
}
