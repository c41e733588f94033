//! Settings in layers: defaults, config file, `--set`, flags. A later layer replaces single values of an earlier one.

use std::fmt;
use std::path::Path;

use serde_json::Value;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::{OptionsError, quoted};
use crate::files;
use crate::printable::escaped;
use crate::settings::{Kind, Light, Settings, registry, user_pass};

/// Longest config file that is read, in bytes.
const MAX_CONFIG_BYTES: u64 = 1 << 20;

/// The settings while layers are put on.
#[derive(Clone, Debug, Default)]
pub struct Layers {
    pub(super) settings: Settings,
    pub(super) changed: Vec<&'static str>,
}

/// Where a value was written.
pub(super) enum Place<'a> {
    Line(&'a str, usize),
    Set,
    Flag(&'static str),
}

impl fmt::Display for Place<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(name, line) => write!(f, "{name}:{line}"),
            Self::Set => f.write_str("--set"),
            Self::Flag(flag) => f.write_str(flag),
        }
    }
}

impl Layers {
    /// Whether a layer above the defaults has set this key.
    #[must_use]
    pub fn is_set(&self, key: &str) -> bool {
        self.changed.contains(&key)
    }

    /// Puts a TOML file on.
    ///
    /// # Errors
    /// [`OptionsError`] with the file's path, and the 1-based line where one is at fault.
    pub fn add_file(&mut self, path: &Path) -> Result<(), OptionsError> {
        let shown = escaped(&path.display().to_string());
        let unreadable = |reason: String| OptionsError::ConfigUnreadable {
            path: shown.clone(),
            reason,
        };
        let bytes = files::read_at_most(path, MAX_CONFIG_BYTES)
            .map_err(|error| unreadable(format!("cannot be read: {error}")))?
            .ok_or_else(|| unreadable(format!("is longer than {MAX_CONFIG_BYTES} bytes")))?;
        let text = String::from_utf8(bytes).map_err(|error| {
            let valid = error.utf8_error().valid_up_to();
            OptionsError::ConfigSyntax {
                path: shown.clone(),
                line: line_of(error.as_bytes(), valid),
                reason: "the text is not UTF-8".to_owned(),
            }
        })?;
        self.add_toml(&text, &shown)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        for pass in &mut self.settings.render.user_passes {
            pass.file = folder.join(&pass.file);
        }
        Ok(())
    }

    /// Puts TOML text on; `name` stands for the file in messages.
    ///
    /// # Errors
    /// As [`Self::add_file`].
    pub fn add_toml(&mut self, text: &str, name: &str) -> Result<(), OptionsError> {
        let table = DeTable::parse(text).map_err(|error| OptionsError::ConfigSyntax {
            path: name.to_owned(),
            line: line_of(
                text.as_bytes(),
                error.span().map_or(text.len(), |span| span.start),
            ),
            reason: format!(
                "not valid TOML: {}",
                error
                    .message()
                    .split_whitespace()
                    .collect::<Vec<_>>()
                    .join(" ")
            ),
        })?;
        self.add_table(table.get_ref(), "", text, name)
    }

    fn add_table(
        &mut self,
        table: &DeTable<'_>,
        prefix: &str,
        text: &str,
        name: &str,
    ) -> Result<(), OptionsError> {
        for (key, value) in table {
            let place = Place::Line(name, line_of(text.as_bytes(), key.span().start));
            let full = format!("{prefix}{}", key.get_ref());
            if full == user_pass::KEY {
                self.add_passes(value, text, name)?;
                continue;
            }
            if let DeValue::Table(inner) = value.get_ref()
                && !keys_of(&full).is_empty()
            {
                self.add_table(inner, &format!("{full}."), text, name)?;
                continue;
            }
            let source = text.get(value.span()).unwrap_or_default();
            self.put(&full, &json_of(value.get_ref()), source, &place)?;
        }
        Ok(())
    }

    /// Puts the passes of the user's own on: an array of tables.
    fn add_passes(
        &mut self,
        passes: &Spanned<DeValue<'_>>,
        text: &str,
        name: &str,
    ) -> Result<(), OptionsError> {
        let fault = |at: usize, reason: String| OptionsError::ConfigSyntax {
            path: name.to_owned(),
            line: line_of(text.as_bytes(), at),
            reason,
        };
        let is_written = "passes are written as [[pass]], with file, name, after and over";
        let DeValue::Array(each) = passes.get_ref() else {
            return Err(fault(passes.span().start, is_written.to_owned()));
        };
        for pass in each {
            let DeValue::Table(fields) = pass.get_ref() else {
                return Err(fault(pass.span().start, is_written.to_owned()));
            };
            let fields = fields.iter();
            let fields =
                fields.map(|(key, value)| (key.get_ref().to_string(), json_of(value.get_ref())));
            let read = serde_json::from_value(Value::Object(fields.collect()));
            let read = read.map_err(|error| fault(pass.span().start, format!("[[pass]]: {error}")));
            self.settings.render.user_passes.push(read?);
        }
        Ok(())
    }

    /// Puts one `key=value` of `--set` on; the value is TOML or bare text.
    ///
    /// # Errors
    /// [`OptionsError`] that names the key and the allowed values.
    pub fn add_set(&mut self, argument: &str) -> Result<(), OptionsError> {
        let Some((key, value)) = argument.split_once('=') else {
            return Err(OptionsError::BadFlag {
                flag: "--set".to_owned(),
                value: quoted(argument),
                reason: "no `=` in it; give --set key=value, such as --set photon.kernel=cone"
                    .to_owned(),
            });
        };
        let (key, value) = (key.trim(), value.trim());
        let raw = match loose(value) {
            // Text that looks like a number, such as one of a clip.
            other if is_text(key) && !other.is_string() => Value::from(value),
            raw => raw,
        };
        self.put(key, &raw, value, &Place::Set)
    }

    /// Puts one flag's value on, taken as `--set` takes it.
    ///
    /// # Errors
    /// [`OptionsError`] that names the flag and the allowed values.
    pub fn add_flag(
        &mut self,
        flag: &'static str,
        key: &str,
        value: &str,
    ) -> Result<(), OptionsError> {
        // A path or a name stays as typed, quotation marks and all.
        let raw = match is_text(key) {
            true => Value::from(value),
            false => loose(value.trim()),
        };
        self.put(key, &raw, value, &Place::Flag(flag))
    }

    /// Puts one value on, which messages show as `source`; `null` unsets a setting that may be unset.
    pub(super) fn put(
        &mut self,
        key: &str,
        raw: &Value,
        source: &str,
        place: &Place<'_>,
    ) -> Result<(), OptionsError> {
        // TOML has no room for `scene.scale` beside `scene`; people write it all the same.
        let key = match key {
            "scene.scale" => "scene_scale",
            key => key,
        };
        let Some(setting) = registry::find(key) else {
            return Err(unknown(key, raw, source, place));
        };
        if !setting.put(&mut self.settings, raw) {
            let allowed = setting.kind.allowed();
            return Err(match place {
                Place::Flag(flag) => OptionsError::BadFlag {
                    flag: (*flag).to_owned(),
                    value: quoted(source),
                    reason: format!("must be {allowed}"),
                },
                _ => OptionsError::BadSetting {
                    place: place.to_string(),
                    key: setting.key,
                    value: shown_value(source),
                    allowed,
                },
            });
        }
        if !self.is_set(setting.key) {
            self.changed.push(setting.key);
        }
        Ok(())
    }

    /// The settings.
    ///
    /// # Errors
    /// [`OptionsError::Conflict`] if some do not go together.
    pub fn finish(self) -> Result<Settings, OptionsError> {
        self.settings
            .render
            .check()
            .map_err(OptionsError::Conflict)?;
        let Settings {
            light, environment, ..
        } = &self.settings;
        if matches!(light, Light::Studio | Light::Sky) && !environment.path.is_empty() {
            return Err(OptionsError::Conflict(format!(
                "--light {light} and environment.path exclude each other; leave one out"
            )));
        }
        Ok(self.settings)
    }
}

/// Keys of the settings under a section, such as `photon`; empty if there is no such section.
fn keys_of(section: &str) -> Vec<&'static str> {
    let keys = registry::all().map(|setting| setting.key);
    keys.filter(|key| key.split_once('.').is_some_and(|(own, _)| own == section))
        .collect()
}

/// What is wrong with a key that no setting has.
fn unknown(key: &str, raw: &Value, source: &str, place: &Place<'_>) -> OptionsError {
    match keys_of(key) {
        keys if keys.is_empty() => OptionsError::UnknownKey {
            place: place.to_string(),
            key: escaped(key),
            nearest: nearest(key, raw.is_object()),
        },
        keys => OptionsError::Conflict(format!(
            "{place}: {key} = {}: `{key}` is a section; its settings are {}",
            shown_value(source),
            keys.join(", ")
        )),
    }
}

/// The known key most like an unknown one; `section` looks among the sections' names as well.
fn nearest(unknown: &str, section: bool) -> &'static str {
    let unknown = &*unknown.to_lowercase();
    let score = |known: &str| {
        let whole = strsim::normalized_damerau_levenshtein(unknown, known);
        // `radius_m` should find `photon.radius_m`; a little less sure than the same words in full.
        let leaf = known.rsplit('.').next().map_or(0.0, |leaf| {
            0.9 * strsim::normalized_damerau_levenshtein(unknown, leaf)
        });
        whole.max(leaf)
    };
    let sections = registry::sections().iter().map(registry::Section::name);
    let sections = sections.filter(|name| section && !name.is_empty());
    let mut best = ("scene", -1.0);
    for known in registry::all().map(|setting| setting.key).chain(sections) {
        let likeness = score(known);
        if likeness > best.1 {
            best = (known, likeness);
        }
    }
    best.0
}

/// A value in a message, as it was written but on one line.
fn shown_value(source: &str) -> String {
    let plain =
        !source.is_empty() && source.len() <= 100 && source.chars().all(|c| !c.is_control());
    if plain {
        source.to_owned()
    } else {
        quoted(source)
    }
}

/// 1-based line of a byte offset.
fn line_of(bytes: &[u8], offset: usize) -> usize {
    1 + bytes
        .iter()
        .take(offset)
        .filter(|&&byte| byte == b'\n')
        .count()
}

fn is_text(key: &str) -> bool {
    registry::find(key)
        .is_some_and(|setting| matches!(setting.kind, Kind::Text { .. } | Kind::List { .. }))
}

/// The value of `--set` or a flag: TOML if it parses as that, else bare text.
fn loose(text: &str) -> Value {
    if let Ok(value) = DeValue::parse(text) {
        return json_of(value.get_ref());
    }
    // TOML refuses `.5` and `5.`, which people type.
    match text.parse::<f64>() {
        Ok(number) if text.starts_with(|c: char| !c.is_alphabetic()) => real(number),
        _ => Value::from(text),
    }
}

/// A TOML value as JSON. What no setting takes is an empty object: a table, a date, a number beyond its type.
fn json_of(value: &DeValue<'_>) -> Value {
    let none = || Value::Object(serde_json::Map::new());
    match value {
        DeValue::String(text) => Value::from(&**text),
        DeValue::Integer(number) => {
            let whole = i128::from_str_radix(number.as_str(), number.radix()).ok();
            whole
                .and_then(serde_json::Number::from_i128)
                .map_or_else(none, Value::Number)
        }
        DeValue::Float(number) => number.as_str().parse().map_or_else(|_| none(), real),
        DeValue::Boolean(value) => Value::from(*value),
        DeValue::Array(list) => list.iter().map(|item| json_of(item.get_ref())).collect(),
        DeValue::Datetime(_) | DeValue::Table(_) => none(),
    }
}

/// A number as JSON; one that is not finite is no value of any setting.
fn real(number: f64) -> Value {
    serde_json::Number::from_f64(number)
        .map_or_else(|| Value::Object(serde_json::Map::new()), Value::Number)
}
