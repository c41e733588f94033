//! The registry by sections, as panels show it.

use serde_json::Value;

use super::registry::SETTINGS;
use super::settings::Settings;

/// A group of settings that belong together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Section {
    /// What stands before the dot of its keys; empty for those without one.
    pub name: &'static str,
    /// Heading.
    pub title: &'static str,
    /// Keys, in the registry's order.
    pub keys: Vec<&'static str>,
}

/// Headings by section.
const TITLES: [(&str, &str); 13] = [
    ("", "General"),
    ("path", "Path tracing"),
    ("photon", "Photon mapping"),
    ("stereo", "Stereo reuse"),
    ("reconstruct", "Reconstruction"),
    ("environment", "Environment"),
    ("animation", "Animation"),
    ("output", "Output"),
    ("force", "Compiled features"),
    ("simulated", "Simulated headset"),
    ("openxr", "OpenXR"),
    ("gpu", "GPU"),
    ("limits", "Limits"),
];

/// The section that a key belongs to; empty for keys without one.
#[must_use]
pub fn section_of(key: &str) -> &str {
    key.split_once('.').map_or("", |(section, _)| section)
}

/// All sections, in the registry's order. One without a heading of its own has its name for one.
#[must_use]
pub fn sections() -> Vec<Section> {
    let mut sections: Vec<Section> = Vec::new();
    for setting in SETTINGS {
        let name = section_of(setting.key);
        match sections.iter_mut().find(|section| section.name == name) {
            Some(section) => section.keys.push(setting.key),
            None => sections.push(Section {
                name,
                title: TITLES
                    .iter()
                    .find(|(known, _)| *known == name)
                    .map_or(name, |(_, title)| title),
                keys: vec![setting.key],
            }),
        }
    }
    sections
}

/// The value under a dotted key as JSON, `null` where it is unset.
#[must_use]
pub fn value_of(settings: &Settings, key: &str) -> Value {
    let tree = serde_json::to_value(settings).unwrap_or(Value::Null);
    let mut at = &tree;
    for part in key.split('.') {
        match at.get(part) {
            Some(next) => at = next,
            None => return Value::Null,
        }
    }
    at.clone()
}
