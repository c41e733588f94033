//! What a setting is: its key, and the kind and range of its values.

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
    /// One of these words.
    Choice(&'static [&'static str]),
    /// Text; may it be empty?
    Text {
        /// Whether the empty text is allowed.
        empty: bool,
    },
    /// Width and height in pixels, each in `1..=max`.
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
            } => {
                format!("a number between {min} and {max}, both excluded")
            }
            Self::Choice(words) => match words {
                [] => "nothing".to_owned(),
                [only] => (*only).to_owned(),
                [first @ .., last] => format!("{} or {last}", first.join(", ")),
            },
            Self::Text { empty: true } => "text".to_owned(),
            Self::Text { empty: false } => "text that is not empty".to_owned(),
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
            Self::Choice(_) => "choice",
            Self::Text { .. } => "text",
            Self::Size { .. } => "size",
        }
    }
}

/// One setting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setting {
    /// Dotted key, as in `--set KEY=VALUE` and in the config file.
    pub key: &'static str,
    /// Kind and range.
    pub kind: Kind,
    /// Unit, or empty.
    pub unit: &'static str,
    /// One line for a newcomer.
    pub doc: &'static str,
}
