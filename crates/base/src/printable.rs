//! Text from files on its way to a terminal or a log: one line, nothing that steers a terminal, not too long.

use std::borrow::Cow;

/// The most characters of a message.
const LONGEST: usize = 300;
/// Characters of a message's end that are kept where its middle is cut out.
const TAIL: usize = 100;

/// One line of at most 300 characters: white space folded, control characters escaped, the data of data URIs left out, the
/// middle cut out of longer text.
pub fn line(text: &str) -> String {
    let words: Vec<_> = text.split_whitespace().map(without_data).collect();
    let clean = escaped(&cut(&words.join(" ")));
    cut(&clean)
}

/// A word without what follows the comma of a data URI in it.
fn without_data(word: &str) -> Cow<'_, str> {
    /// As much of the data may stay.
    const MOST: usize = 16;
    let data = word.find("data:").and_then(|start| {
        let comma = word[start..].find(',')?;
        Some(start + comma + 1)
    });
    match data {
        Some(start) if word.len() > start + MOST => format!("{}...", &word[..start]).into(),
        _ => word.into(),
    }
}

/// `text` with its control characters, and those that turn the direction of writing, escaped.
pub fn escaped(text: &str) -> String {
    let mut clean = String::with_capacity(text.len());
    for c in text.chars() {
        if steers(c) {
            clean.extend(c.escape_default());
        } else {
            clean.push(c);
        }
    }
    clean
}

/// JSON text without anything that steers a terminal: such characters stand in strings only, where JSON has an escape.
pub fn json(text: &str) -> String {
    let mut clean = String::with_capacity(text.len());
    for c in text.chars() {
        if steers(c) && c != '\n' {
            clean.push_str(&format!("\\u{:04x}", u32::from(c)));
        } else {
            clean.push(c);
        }
    }
    clean
}

/// What is wrong with one line of JSON, and in which column of it, from what serde_json says.
pub fn json_fault(error: impl std::fmt::Display, column: usize) -> String {
    let text = error.to_string();
    let reason = text.split(" at line ").next().unwrap_or_default();
    format!("{reason} at column {column}")
}

/// Control characters (C0, DEL, C1), line separators and the marks of bidirectional text.
fn steers(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{061c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

fn cut(text: &str) -> String {
    let count = text.chars().count();
    if count <= LONGEST {
        return text.to_owned();
    }
    let head = text.chars().take(LONGEST - TAIL - 5);
    head.chain(" ... ".chars())
        .chain(text.chars().skip(count - TAIL))
        .collect()
}

/// `; the nearest is 'NAME'`, if one of the names is like the unknown one, whatever its case; else nothing.
pub fn did_you_mean<'a>(
    unknown: &str,
    names: impl IntoIterator<Item = impl AsRef<str> + 'a>,
) -> String {
    let mut best = (0.0, String::new());
    for name in names {
        let name = name.as_ref();
        let (a, b) = (unknown.to_lowercase(), name.to_lowercase());
        let likeness = match a.len() >= 3 && b.starts_with(&a) {
            true => 1.0,
            false => strsim::normalized_damerau_levenshtein(&a, &b),
        };
        if likeness > best.0 {
            best = (likeness, name.to_owned());
        }
    }
    match best.0 >= 0.5 {
        true => format!("; the nearest is '{}'", best.1),
        false => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_steers_the_terminal() {
        let dirty = "a\u{1b}]0;owned\u{7}b\r\nc\u{9b}2J \u{202e}d\u{7f}";
        let clean = line(dirty);
        assert!(!clean.chars().any(steers), "{clean:?}");
        assert_eq!(
            clean,
            "a\\u{1b}]0;owned\\u{7}b c\\u{9b}2J \\u{202e}d\\u{7f}"
        );
        assert_eq!(json("{\n\"a\u{9b}\"}"), "{\n\"a\\u009b\"}");
    }

    #[test]
    fn long_lines_keep_both_ends() {
        for text in ["x".repeat(9999), "\u{1b}".repeat(9999)] {
            let shown = line(&format!("begin {text} end"));
            assert!(shown.chars().count() <= LONGEST);
            assert!(
                shown.starts_with("begin ") && shown.ends_with(" end"),
                "{shown}"
            );
        }
        assert_eq!(line("short"), "short");
    }

    #[test]
    fn the_data_of_data_uris_is_left_out() {
        let data = format!(
            "images[0]: 'data:image/png;base64,{}' is broken",
            "A".repeat(50)
        );
        assert_eq!(
            line(&data),
            "images[0]: 'data:image/png;base64,... is broken"
        );
        assert_eq!(line("data:, is empty"), "data:, is empty");
    }
}
