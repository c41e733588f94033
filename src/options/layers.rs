//! Settings in layers: defaults, config file, `--set`, flags. A later layer replaces single values of an earlier one.

use std::fmt;
use std::path::Path;

use serde_json::Value;
use toml::de::{DeTable, DeValue};

use super::registry::{self, Kind, Setting};
use super::settings::Settings;
use super::{OptionsError, numbers, quoted};
use crate::files;

/// Longest config file that is read, in bytes.
const MAX_CONFIG_BYTES: u64 = 1 << 20;

/// The settings while layers are put on.
#[derive(Clone, Debug)]
pub struct Layers {
    tree: Value,
    changed: Vec<&'static str>,
}

impl Default for Layers {
    fn default() -> Self {
        let tree = serde_json::to_value(Settings::default()).unwrap_or(Value::Null);
        Self {
            tree,
            changed: Vec::new(),
        }
    }
}

/// A value as written, before its setting's kind is known.
#[derive(Clone, Debug, PartialEq)]
enum Written {
    Text(String),
    Whole(i128),
    Real(f64),
    Bool(bool),
    List(Vec<Self>),
    /// Something that no setting takes: a table, a date, a number beyond its type.
    Other,
}

/// Where a value was written.
enum Place<'a> {
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
    /// Begins with these settings in place of the defaults.
    #[must_use]
    pub fn of(settings: &Settings) -> Self {
        Self {
            tree: serde_json::to_value(settings).unwrap_or(Value::Null),
            changed: Vec::new(),
        }
    }

    /// Puts one value on, checked as [`Self::add_set`] checks it; `null` unsets a setting that is unset by default.
    ///
    /// # Errors
    /// As [`Self::add_set`].
    pub fn add_value(&mut self, key: &str, value: &Value) -> Result<(), OptionsError> {
        if value.is_null() && registry::find(key).is_some() && registry::default_of(key).is_null() {
            self.write(key, Value::Null);
            return Ok(());
        }
        self.put(key, &written_json(value), &value.to_string(), &Place::Set)
    }

    fn write(&mut self, key: &str, value: Value) {
        let mut at = &mut self.tree;
        for part in key.split('.') {
            at = &mut at[part];
        }
        *at = value;
    }

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
        let shown = shown_path(path);
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
        self.add_toml(&text, &shown)
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
            reason: error
                .message()
                .split_whitespace()
                .collect::<Vec<_>>()
                .join(" "),
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
            if let DeValue::Table(inner) = value.get_ref()
                && !registry::section_keys(&full).is_empty()
            {
                self.add_table(inner, &format!("{full}."), text, name)?;
                continue;
            }
            let source = text.get(value.span()).unwrap_or_default();
            self.put(&full, &written(value.get_ref()), source, &place)?;
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
                flag: "--set",
                value: quoted(argument),
                reason: "no `=` in it; give --set key=value, such as --set photon.kernel=cone"
                    .to_owned(),
            });
        };
        let (key, value) = (key.trim(), value.trim());
        self.put(key, &loose(value), value, &Place::Set)
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
        let is_text =
            registry::find(key).is_some_and(|setting| matches!(setting.kind, Kind::Text { .. }));
        let raw = if is_text {
            Written::Text(value.to_owned())
        } else {
            loose(value.trim())
        };
        self.put(key, &raw, value, &Place::Flag(flag))
    }

    fn put(
        &mut self,
        key: &str,
        raw: &Written,
        source: &str,
        place: &Place<'_>,
    ) -> Result<(), OptionsError> {
        let Some(setting) = registry::find(key) else {
            let unknown = |nearest| OptionsError::UnknownKey {
                place: place.to_string(),
                key: key.escape_debug().to_string(),
                nearest,
            };
            return Err(match registry::section_keys(key) {
                keys if keys.is_empty() => unknown(registry::nearest(key, *raw == Written::Other)),
                keys => OptionsError::Conflict(format!(
                    "{place}: {key} = {}: `{key}` is a section; its settings are {}",
                    shown_value(source),
                    keys.join(", ")
                )),
            });
        };
        let value = checked(setting, raw).ok_or_else(|| match place {
            Place::Flag(flag) => OptionsError::BadFlag {
                flag,
                value: quoted(source),
                reason: format!("must be {}", setting.kind.allowed()),
            },
            _ => OptionsError::BadSetting {
                place: place.to_string(),
                key: setting.key,
                value: shown_value(source),
                allowed: setting.kind.allowed(),
            },
        })?;
        self.write(setting.key, value);
        if !self.is_set(setting.key) {
            self.changed.push(setting.key);
        }
        Ok(())
    }

    /// The settings.
    ///
    /// # Errors
    /// Only if the registry and [`Settings`] disagree, which a test rules out.
    pub fn finish(self) -> Result<Settings, OptionsError> {
        let settings: Settings = serde_json::from_value(self.tree)
            .map_err(|error| OptionsError::Conflict(format!("settings: {error}")))?;
        settings
            .photon
            .check_gather()
            .map_err(OptionsError::Conflict)?;
        Ok(settings)
    }
}

fn shown_path(path: &Path) -> String {
    path.display().to_string().escape_debug().to_string()
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

/// The value of `--set` or a flag: TOML if it parses as that, else bare text.
fn loose(text: &str) -> Written {
    if let Ok(value) = DeValue::parse(text) {
        return written(value.get_ref());
    }
    // TOML refuses `.5` and `5.`, which people type.
    match text.parse::<f64>() {
        Ok(number) if text.starts_with(|c: char| !c.is_alphabetic()) => Written::Real(number),
        _ => Written::Text(text.to_owned()),
    }
}

fn written(value: &DeValue<'_>) -> Written {
    match value {
        DeValue::String(text) => Written::Text(text.to_string()),
        DeValue::Integer(number) => i128::from_str_radix(number.as_str(), number.radix())
            .map_or(Written::Other, Written::Whole),
        DeValue::Float(number) => number
            .as_str()
            .parse()
            .map_or(Written::Other, Written::Real),
        DeValue::Boolean(value) => Written::Bool(*value),
        DeValue::Array(list) => {
            Written::List(list.iter().map(|item| written(item.get_ref())).collect())
        }
        DeValue::Datetime(_) | DeValue::Table(_) => Written::Other,
    }
}

fn written_json(value: &Value) -> Written {
    match value {
        Value::Bool(value) => Written::Bool(*value),
        Value::String(text) => Written::Text(text.clone()),
        Value::Number(number) => match (number.as_i64(), number.as_u64(), number.as_f64()) {
            (Some(whole), ..) => Written::Whole(whole.into()),
            (_, Some(whole), _) => Written::Whole(whole.into()),
            (.., Some(real)) => Written::Real(real),
            _ => Written::Other,
        },
        Value::Array(list) => Written::List(list.iter().map(written_json).collect()),
        Value::Null | Value::Object(_) => Written::Other,
    }
}

/// The value as JSON if the setting takes it.
fn checked(setting: &Setting, raw: &Written) -> Option<Value> {
    match (setting.kind, raw) {
        (Kind::Bool, Written::Bool(value)) => Some(Value::from(*value)),
        (Kind::Whole { min, max }, Written::Whole(value)) => {
            let value = u64::try_from(*value).ok()?;
            (min..=max).contains(&value).then(|| Value::from(value))
        }
        (
            Kind::Real {
                min,
                max,
                inclusive,
            },
            Written::Whole(_) | Written::Real(_),
        ) => {
            let value = match raw {
                Written::Whole(value) => *value as f64,
                Written::Real(value) => *value,
                _ => return None,
            };
            let inside = if inclusive {
                min <= value && value <= max
            } else {
                min < value && value < max
            };
            // `-0` is zero, and `inside` is false for NaN.
            inside.then(|| Value::from(value + 0.0))
        }
        (Kind::Choice(words), Written::Text(text)) => words
            .contains(&text.as_str())
            .then(|| Value::from(text.as_str())),
        // `force.glossy=off` is text, yet TOML has no bare words; `true` and `false` are near misses worth refusing.
        (Kind::Text { empty }, Written::Text(text)) => {
            let usable = (empty || !text.trim().is_empty()) && !text.contains('\0');
            usable.then(|| Value::from(text.as_str()))
        }
        (Kind::Size { max }, Written::Text(text)) => sized(numbers::size(text)?, max),
        (Kind::Size { max }, Written::List(list)) => match list.as_slice() {
            [Written::Whole(width), Written::Whole(height)] => sized(
                [u64::try_from(*width).ok()?, u64::try_from(*height).ok()?],
                max,
            ),
            _ => None,
        },
        _ => None,
    }
}

fn sized(size: [u64; 2], max: u32) -> Option<Value> {
    let inside = size
        .iter()
        .all(|&side| (1..=u64::from(max)).contains(&side));
    inside.then(|| Value::from(size.to_vec()))
}
