//! Writing the scene and the settings, and never over a file of others unasked.

use std::iter;
use std::path::{Path, PathBuf};

use egui::Context;

use super::app::App;
use super::fields::Fields;
use super::question::Question;
use super::worker::decided;
use crate::files::Stamp;
use crate::options::{self, Extent};

/// What is written to files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Saved {
    /// The edited scene, as glTF.
    Scene,
    /// The settings, as TOML.
    Settings,
}

/// A file's name that stays the same however it is spelled.
fn one_name(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}

impl App {
    /// Whether this window has written a file.
    pub(super) fn has_written(&self, path: &Path) -> bool {
        self.written.contains_key(&one_name(path))
    }

    /// Writes to the path of the fields, as [`App::save_as`] does.
    pub(super) fn save(&mut self, context: &Context, what: Saved) {
        let path = PathBuf::from(self.fields.path_of(what).trim());
        self.save_as(context, path, what);
    }

    /// Writes to a path, which is that of the fields from then on; asks before, if a file stands there that is not as this
    /// window wrote it.
    pub(super) fn save_as(&mut self, context: &Context, path: PathBuf, what: Saved) {
        let stamp = Stamp::of(&path);
        let is_own = stamp.is_some() && self.written.get(&one_name(&path)) == stamp.as_ref();
        if path.exists() && !is_own {
            self.asks = Some(Question::Replace(path, what, None));
            return;
        }
        self.replace(context, path, what);
    }

    /// Writes to a path, whatever stands there.
    pub(super) fn replace(&mut self, context: &Context, path: PathBuf, what: Saved) {
        self.take_written(context);
        self.make_room(&path);
        let (written, use_of_it) = match what {
            Saved::Scene => {
                let written = self.document.save(&path);
                if written.is_ok() {
                    self.saved_scene = Some(path.clone());
                }
                (written.map_err(|error| error.to_string()), "")
            }
            Saved::Settings => {
                // What is shown is what is saved, whatever `auto` stands for where it is read.
                let mut settings = decided(self.panel_settings());
                settings.size = Some(self.size);
                // A saved scene is what is shown, and is as large as it is shown.
                if let Some(scene) = &self.saved_scene {
                    settings.scene = scene.to_string_lossy().into_owned();
                    settings.scene_scale = 1.0;
                }
                let written = options::save(&settings, &path, Extent::Changed);
                let use_of_it = if self.document.is_modified() {
                    "; --config reads it, with the scene as it was last saved"
                } else {
                    "; --config reads it"
                };
                (written.map_err(|error| error.to_string()), use_of_it)
            }
        };
        match written {
            Ok(()) => {
                let text = format!("{} written{use_of_it}", path.display());
                self.say(context, text, false);
                *self.fields.path_of(what) = path.to_string_lossy().into_owned();
                self.written
                    .extend(Stamp::of(&path).map(|stamp| (one_name(&path), stamp)));
            }
            Err(error) => self.say(context, error, true),
        }
    }

    /// Writes edits that would end with the window to where they would be saved, or beside it where a file stands; to where they
    /// are saved of themselves if that cannot be: its path, if there was anything to keep.
    ///
    /// # Errors
    /// What stands in the way of the first.
    pub fn rescue(&mut self) -> Option<Result<PathBuf, String>> {
        self.take_name();
        if !self.document.is_modified() {
            return None;
        }
        // Whatever is being written in the field.
        let wanted = self.fields.path_of(Saved::Scene).trim().to_owned();
        let mut fields = Fields::new(&self.out, self.document.original());
        let of_itself = fields.path_of(Saved::Scene);
        let written = self.rescue_to(Path::new(&wanted));
        Some(written.or_else(|error| self.rescue_to(Path::new(of_itself)).map_err(|_| error)))
    }

    fn rescue_to(&mut self, wanted: &Path) -> Result<PathBuf, String> {
        let wanted = wanted.with_extension("glb");
        self.make_room(&wanted);
        let stem = wanted.file_stem().unwrap_or_default().to_string_lossy();
        let beside = (2_u32..).map(|n| wanted.with_file_name(format!("{stem}_{n}.glb")));
        let mut paths = iter::once(wanted.clone()).chain(beside);
        let path = paths.find(|path| !path.exists()).unwrap_or(wanted);
        let written = self.document.save(&path);
        written.map(|()| path).map_err(|error| error.to_string())
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
