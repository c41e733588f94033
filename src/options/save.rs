//! Settings written as a TOML file that `--config` reads, and changed one by one, as a panel does.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::OptionsError;
use super::layers::Layers;
use super::registry::{self, SETTINGS};
use super::settings::Settings;
use crate::scene::write_beside;

/// Which settings a file holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Extent {
    /// Those that differ from the defaults.
    #[default]
    Changed,
    /// All that have a value.
    All,
}

/// Settings whose text is a path.
const PATHS: [&str; 2] = ["environment.path", "gpu.shader_folder"];

impl Settings {
    /// The settings as TOML: by section, in the registry's order, each below a comment of what it is, its unit and range.
    /// [`Layers::add_toml`] reads equal settings back. Paths are written as they are; see [`Settings::with_paths_in`].
    #[must_use]
    pub fn to_toml(&self, extent: Extent) -> String {
        let mut text = String::from("# Settings of stereolux, for --config.\n");
        let mut section = "";
        for setting in SETTINGS {
            let value = registry::value_of(self, setting.key);
            let is_default = value == registry::default_of(setting.key);
            let Some(written) = toml_value(&value) else {
                continue;
            };
            if is_default && extent == Extent::Changed {
                continue;
            }
            let (own, key) = setting.key.rsplit_once('.').unwrap_or(("", setting.key));
            // Writing to a String cannot fail.
            if own != section {
                let _ = write!(text, "\n[{own}]");
                section = own;
            }
            let unit = match setting.unit {
                "" => String::new(),
                unit => format!("{unit}, "),
            };
            let allowed = setting.kind.allowed();
            let _ = write!(
                text,
                "\n# {} ({unit}{allowed})\n{key} = {written}\n",
                setting.doc
            );
        }
        text
    }

    /// The settings with relative paths made absolute, taken from `folder`: scene file, environment map, headset profile in
    /// a file (`.toml`) and shader folder. Embedded scenes and profiles keep their names.
    #[must_use]
    pub fn with_paths_in(&self, folder: &Path) -> Self {
        let mut settings = self.clone();
        let absolute = |text: &mut String| {
            let path = PathBuf::from(&*text);
            if !text.is_empty() && path.is_relative() {
                *text = folder.join(path).display().to_string();
            }
        };
        if !settings.scene.starts_with("builtin:") {
            absolute(&mut settings.scene);
        }
        if settings.headset.ends_with(".toml") {
            absolute(&mut settings.headset);
        }
        absolute(&mut settings.environment.path);
        absolute(&mut settings.gpu.shader_folder);
        settings
    }

    /// Writes the settings to a file that `--config` reads from whatever folder: relative paths are taken from the working
    /// directory and written in full. The file is written beside its place and renamed.
    ///
    /// # Errors
    /// One line: why the file cannot be written.
    pub fn save(&self, path: &Path, extent: Extent) -> Result<(), OptionsError> {
        let unwritable = |error: std::io::Error| OptionsError::Unwritable {
            path: path.display().to_string(),
            reason: error.to_string(),
        };
        let folder = std::env::current_dir().map_err(unwritable)?;
        let text = self.with_paths_in(&folder).to_toml(extent);
        write_beside(path, text.as_bytes()).map_err(unwritable)
    }

    /// The settings with one of them changed, checked as `--set KEY=VALUE` checks it, and with the same words refused.
    /// `null` unsets a setting that may be unset.
    ///
    /// # Errors
    /// [`OptionsError`]: an unknown key, a value that the setting does not take, or settings that do not go together.
    pub fn with(&self, key: &str, value: &Value) -> Result<Self, OptionsError> {
        let mut layers = Layers::of(self);
        layers.add_value(key, value)?;
        layers.finish()
    }

    /// The value under a dotted key, `null` where it is unset or no such setting exists.
    #[must_use]
    pub fn value(&self, key: &str) -> Value {
        registry::value_of(self, key)
    }

    /// Whether a setting's text is the path of a file or folder.
    #[must_use]
    pub fn is_path(key: &str) -> bool {
        key == "scene" || PATHS.contains(&key)
    }
}

/// A value as TOML writes it; `None` for an unset one, which TOML has no word for.
fn toml_value(value: &Value) -> Option<String> {
    match value {
        Value::Null | Value::Object(_) => None,
        Value::Bool(value) => Some(value.to_string()),
        // The shortest text that reads back as the same number.
        Value::Number(number) => Some(match number.as_u64() {
            Some(whole) => whole.to_string(),
            None => format!("{:?}", number.as_f64()?),
        }),
        Value::String(text) => Some(toml::Value::String(text.clone()).to_string()),
        Value::Array(list) => {
            let items: Option<Vec<String>> = list.iter().map(toml_value).collect();
            Some(format!("[{}]", items?.join(", ")))
        }
    }
}
