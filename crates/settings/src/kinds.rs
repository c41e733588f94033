//! What a setting is: its key, what values it takes, its unit and sentence.

use serde_json::{Value, json};

use super::Choice;

/// Largest width or height of an eye's image in pixels. The largest texture that wgpu offers by default is 8192 wide, and
/// twice that is beyond any headset.
pub const MAX_SIZE: u32 = 16_384;

/// What values a setting takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// `true` or `false`.
    Bool,
    /// A whole number in `min..=max`.
    Whole {
        /// Smallest value.
        min: u64,
        /// Largest value.
        max: u64,
    },
    /// A finite number between `min` and `max`.
    Real {
        /// Lower bound.
        min: f64,
        /// Upper bound.
        max: f64,
        /// Whether the bounds themselves are allowed.
        inclusive: bool,
    },
    /// One of some words.
    Choice {
        /// The words.
        words: &'static [&'static str],
        /// What each stands for, one sentence without a full stop.
        sentences: &'static [&'static str],
    },
    /// Text; may it be empty?
    Text {
        /// Whether the empty text is allowed.
        empty: bool,
    },
    /// Any of some words, separated by commas; none are none.
    List {
        /// The words.
        words: &'static [&'static str],
    },
    /// Width and height in pixels, each in `1..=max`; may be unset.
    Size {
        /// Largest width or height.
        max: u32,
    },
}

impl Kind {
    /// The allowed values in words, to follow "must be".
    #[must_use]
    pub fn allowed(&self) -> String {
        match self {
            Self::Bool => "true or false".to_owned(),
            Self::Whole { min, max } => format!("a whole number from {min} to {max}"),
            Self::Real {
                min,
                max,
                inclusive: true,
            } => format!("a number from {min} to {max}"),
            Self::Real {
                min,
                max,
                inclusive: false,
            } => format!("a number between {min} and {max}, both excluded"),
            Self::Choice { words, .. } => match words {
                [] => "nothing".to_owned(),
                [only] => (*only).to_owned(),
                [first @ .., last] => format!("{} or {last}", first.join(", ")),
            },
            Self::Text { empty: true } => "text".to_owned(),
            Self::Text { empty: false } => "text that is not empty".to_owned(),
            Self::List { words } => format!("words of {}, separated by commas", words.join(", ")),
            Self::Size { max } => {
                format!("[width, height] or \"WIDTHxHEIGHT\", each from 1 to {max} pixels")
            }
        }
    }

    /// The kind's short name, for listings.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Bool => "bool",
            Self::Whole { .. } => "whole",
            Self::Real { .. } => "real",
            Self::Choice { .. } => "choice",
            Self::Text { .. } => "text",
            Self::List { .. } => "list",
            Self::Size { .. } => "size",
        }
    }

    /// The value as the setting holds it; `None` if it is of another type or out of range. A size may be written
    /// `WIDTHxHEIGHT`, and `null` unsets it.
    #[must_use]
    pub fn checked(&self, value: &Value) -> Option<Value> {
        match *self {
            Self::Bool => value.as_bool().map(Value::from),
            Self::Whole { min, max } => value
                .as_u64()
                .filter(|whole| (min..=max).contains(whole))
                .map(Value::from),
            Self::Real {
                min,
                max,
                inclusive,
            } => value
                .as_f64()
                .filter(|real| match inclusive {
                    true => (min..=max).contains(real),
                    false => min < *real && *real < max,
                })
                // `-0` is zero.
                .map(|real| Value::from(real + 0.0)),
            Self::Choice { words, .. } => value
                .as_str()
                // What can be switched on and off is also true or false.
                .or_else(|| {
                    let on = value.as_bool().filter(|_| words.contains(&"on"))?;
                    Some(if on { "on" } else { "off" })
                })
                .map(str::to_owned)
                // A word may be a number, which files give without quotes.
                .or_else(|| value.as_u64().map(|number| number.to_string()))
                .filter(|word| words.contains(&word.as_str()))
                .map(Value::from),
            Self::Text { empty } => value
                .as_str()
                .filter(|text| (empty || !text.trim().is_empty()) && !text.contains('\0'))
                .map(Value::from),
            Self::List { words } => value
                .as_str()
                .filter(|list| listed(list).all(|word| words.contains(&word)))
                .map(Value::from),
            Self::Size { .. } if value.is_null() => Some(Value::Null),
            Self::Size { max } => sides(value)
                .filter(|sides| sides.iter().all(|side| (1..=u64::from(max)).contains(side)))
                .map(|sides| json!(sides)),
        }
    }
}

/// The words of a list.
pub(crate) fn listed(list: &str) -> impl Iterator<Item = &str> {
    let words = list.split(',').map(str::trim);
    words.filter(|word| !word.is_empty())
}

/// Width and height from `[width, height]` or `"WIDTHxHEIGHT"`.
fn sides(value: &Value) -> Option<[u64; 2]> {
    match value {
        Value::String(text) => {
            let (width, height) = text.trim().split_once(['x', 'X'])?;
            Some([width.trim().parse().ok()?, height.trim().parse().ok()?])
        }
        Value::Array(sides) => match sides.as_slice() {
            [width, height] => Some([width.as_u64()?, height.as_u64()?]),
            _ => None,
        },
        _ => None,
    }
}

/// A type that says by itself what values it takes.
pub(super) trait OwnKind {
    /// Its kind.
    const KIND: Kind;
}

impl OwnKind for bool {
    const KIND: Kind = Kind::Bool;
}

impl<C: Choice> OwnKind for C {
    const KIND: Kind = Kind::Choice {
        words: C::WORDS,
        sentences: C::SENTENCES,
    };
}

/// One setting of the settings `S`.
#[derive(Debug)]
pub struct Row<S: 'static> {
    /// Dotted key, as in `--set KEY=VALUE` and in the config file.
    pub key: &'static str,
    /// Kind and range.
    pub kind: Kind,
    /// Unit, or empty.
    pub unit: &'static str,
    /// One line for a newcomer.
    pub doc: &'static str,
    pub(super) get: fn(&S) -> Value,
    pub(super) set: fn(&mut S, Value) -> bool,
}

impl<S: Default> Row<S> {
    /// Its value as JSON, `null` where it is unset.
    #[must_use]
    pub fn value(&self, settings: &S) -> Value {
        (self.get)(settings)
    }

    /// Its default as JSON, `null` where it is unset.
    #[must_use]
    pub fn default_value(&self) -> Value {
        self.value(&S::default())
    }

    /// Changes it to a value that [`Kind::checked`] takes; false if that does not, and nothing is changed.
    pub fn put(&self, settings: &mut S, value: &Value) -> bool {
        self.kind
            .checked(value)
            .is_some_and(|value| (self.set)(settings, value))
    }

    /// Unit and allowed values in words.
    #[must_use]
    pub fn range(&self) -> String {
        let allowed = self.kind.allowed();
        match self.unit {
            "" => allowed,
            unit => format!("{unit}, {allowed}"),
        }
    }
}

/// Settings of `S` that belong together.
#[derive(Debug)]
pub struct RowSection<S: 'static> {
    /// Heading.
    pub title: &'static str,
    groups: &'static [&'static [Row<S>]],
}

impl<S: 'static> RowSection<S> {
    pub(super) const fn new(title: &'static str, groups: &'static [&'static [Row<S>]]) -> Self {
        Self { title, groups }
    }

    /// Its settings, in the order of listings.
    pub fn settings(&self) -> impl Iterator<Item = &'static Row<S>> + use<S> {
        self.groups.iter().copied().flatten()
    }

    /// What stands before the dot of its keys; empty for those without one.
    #[must_use]
    pub fn name(&self) -> &'static str {
        self.settings()
            .next()
            .map_or("", |setting| section_of(setting.key))
    }
}

/// The section that a key belongs to; empty for keys without one.
#[must_use]
pub fn section_of(key: &str) -> &str {
    key.split_once('.').map_or("", |(section, _)| section)
}
