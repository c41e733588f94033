//! `settings`: all settings for people, or those that a word is about.

use std::fmt::Write as _;

use serde_json::Value;

use super::{Failure, print_line};
use crate::options::SettingsOptions;
use crate::printable::did_you_mean;
use crate::settings::registry::{self, Kind, Setting};

/// Prints the settings in groups.
pub fn settings(options: &SettingsOptions) -> Result<(), Failure> {
    let word = options.word.as_deref().unwrap_or_default().to_lowercase();
    let mut text = String::new();
    for section in registry::sections() {
        let has = |text: &str| text.to_lowercase().contains(&word);
        let is_meant = has(section.title) || word == section.name() && !word.is_empty();
        let rows = section.settings();
        let rows: Vec<&Setting> = rows.filter(|row| is_meant || matches(row, &word)).collect();
        if rows.is_empty() {
            continue;
        }
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{}", section.title);
        for row in rows {
            text.push_str(&entry(row));
        }
        text.push('\n');
    }
    if text.is_empty() {
        let keys = registry::all().flat_map(|setting| setting.key.split('.'));
        let hint = did_you_mean(&word, keys);
        return Err(Failure::unusable(format!(
            "settings {word}: no setting is about that{hint}; `stereolux settings` lists all"
        )));
    }
    text.push_str("--set KEY=VALUE changes one, --config FILE reads many; flags win over --set, --set over the file.");
    print_line(&text)
}

fn matches(setting: &Setting, word: &str) -> bool {
    let words = match setting.kind {
        Kind::Choice { words, .. } => words,
        _ => &[],
    };
    let mut texts = [setting.key, setting.doc, setting.unit]
        .into_iter()
        .chain(words.iter().copied());
    texts.any(|text| text.to_lowercase().contains(word))
}

/// Key, default and unit, and below the sentence and the values.
fn entry(setting: &Setting) -> String {
    let default = match setting.default_value() {
        Value::Null => "unset".to_owned(),
        other => other.to_string(),
    };
    let unit = match setting.unit {
        "" => String::new(),
        unit => format!(", {unit}"),
    };
    let (key, doc) = (setting.key, setting.doc);
    let mut text = format!("  {key} = {default}{unit}\n      {doc}");
    match setting.kind {
        Kind::Text { .. } => {}
        Kind::Choice { words, sentences } => {
            for (word, sentence) in words.iter().zip(sentences) {
                let _ = write!(text, "\n      {word}: {sentence}");
            }
        }
        kind => {
            let _ = write!(text, "; {}", kind.allowed());
        }
    }
    text.push('\n');
    text
}
