//! Settings written as a TOML file that `--config` reads, and changed one by one, as a panel does.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::OptionsError;
use super::layers::{Layers, Place};
use crate::files::write_beside;
use crate::scene::builtin;
use crate::settings::Settings;
use crate::settings::registry::{self, Setting};
use crate::settings::user_pass::{self, UserPass};
use crate::xr::Headset;

/// Which settings a file holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Extent {
    /// Those that differ from the defaults.
    #[default]
    Changed,
    /// All that have a value.
    All,
}

/// Size that `config/example.toml` shows, where the default is the headset's.
const EXAMPLE_SIZE: [u32; 2] = [512, 512];

const EXAMPLE_HEAD: &str = "\
# Settings of stereolux, each with its default: a copy of this file, with some lines uncommented, goes to --config FILE.
# Flags win over --set, --set over this file; an unknown key is an error that names the nearest known one.
# Keys before the first [section] must stay there: TOML puts what follows a section's head into the section.
# Embedded scenes, builtin:NAME each, are";

/// The text of `config/example.toml`: every setting with its explanation, its default commented out.
#[must_use]
pub fn example_toml() -> String {
    let mut text = format!("{EXAMPLE_HEAD} {}.\n", builtin::NAMES.join(", "));
    for section in registry::sections() {
        let _ = match section.name() {
            "" => writeln!(text, "\n# {}", section.title),
            name => writeln!(text, "\n# {}\n[{name}]", section.title),
        };
        for setting in section.settings() {
            let default = match setting.default_value() {
                Value::Null => json!(EXAMPLE_SIZE),
                default => default,
            };
            if let Some(line) = toml_line(setting, &default, "#") {
                text.push_str(&line);
            }
        }
    }
    text
}

/// A setting in a file, after `mark`, below a comment of what it is, its unit and range; `None` if it is unset.
fn toml_line(setting: &Setting, value: &Value, mark: &str) -> Option<String> {
    let key = setting.key.rsplit('.').next()?;
    let written = toml_value(value)?;
    let (doc, range) = (setting.doc, setting.range());
    Some(format!("\n# {doc} ({range})\n{mark}{key} = {written}\n"))
}

/// The settings as TOML: by section, in the registry's order, each below a comment of what it is, its unit and range.
/// [`Layers::add_toml`] reads equal settings back. Paths are written as they are; see [`with_paths_in`].
#[must_use]
pub fn to_toml(settings: &Settings, extent: Extent) -> String {
    let mut text = String::from("# Settings of stereolux, for --config.\n");
    for section in registry::sections() {
        let lines: String = section
            .settings()
            .map(|setting| (setting, setting.value(settings)))
            .filter(|(setting, value)| extent == Extent::All || *value != setting.default_value())
            .filter_map(|(setting, value)| toml_line(setting, &value, ""))
            .collect();
        if !lines.is_empty() && !section.name().is_empty() {
            // Writing to a String cannot fail.
            let _ = write!(text, "\n[{}]", section.name());
        }
        text.push_str(&lines);
    }
    for pass in &settings.render.user_passes {
        let UserPass {
            file,
            name,
            after,
            over,
        } = pass;
        let text_of = |text: &str| toml::Value::String(text.to_owned());
        let _ = writeln!(
            text,
            "\n[[{}]]\nfile = {}\nname = {}\nafter = {}\nover = {}",
            user_pass::KEY,
            text_of(&file.display().to_string()),
            text_of(name),
            text_of(after),
            json!(over),
        );
    }
    text
}

/// The settings with relative paths made absolute, taken from `folder`: scene file, environment map, headset profile in
/// a file, script of hands and shader folder. Embedded scenes and profiles keep their names.
#[must_use]
pub fn with_paths_in(settings: &Settings, folder: &Path) -> Settings {
    let mut settings = settings.clone();
    let absolute = |text: &mut String| {
        let path = PathBuf::from(&*text);
        if !text.is_empty() && path.is_relative() {
            *text = folder.join(path).display().to_string();
        }
    };
    if !settings.scene.starts_with(builtin::PREFIX) {
        absolute(&mut settings.scene);
    }
    if Headset::is_path(&settings.headset) {
        absolute(&mut settings.headset);
    }
    if !settings.environment.path.starts_with(builtin::PREFIX) {
        absolute(&mut settings.environment.path);
    }
    absolute(&mut settings.simulated.hands);
    absolute(&mut settings.gpu.shader_folder);
    for pass in &mut settings.render.user_passes {
        pass.file = folder.join(&pass.file);
    }
    settings
}

/// Writes the settings to a file that `--config` reads from whatever folder: relative paths are taken from the working
/// directory and written in full. The file is written beside its place and renamed.
///
/// # Errors
/// One line: why the file cannot be written.
pub fn save(settings: &Settings, path: &Path, extent: Extent) -> Result<(), OptionsError> {
    let unwritable = |error: std::io::Error| OptionsError::Unwritable {
        path: path.display().to_string(),
        reason: error.to_string(),
    };
    let folder = std::env::current_dir().map_err(unwritable)?;
    let text = to_toml(&with_paths_in(settings, &folder), extent);
    write_beside(path, |out| out.write_all(text.as_bytes())).map_err(unwritable)
}

/// The settings with one of them changed, checked as `--set KEY=VALUE` checks it, and with the same words refused.
/// `null` unsets a setting that may be unset.
///
/// # Errors
/// [`OptionsError`]: an unknown key, a value that the setting does not take, or settings that do not go together.
pub fn changed(settings: &Settings, key: &str, value: &Value) -> Result<Settings, OptionsError> {
    let mut layers = Layers {
        settings: settings.clone(),
        ..Layers::default()
    };
    layers.put(key, value, &value.to_string(), &Place::Set)?;
    layers.finish()
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
