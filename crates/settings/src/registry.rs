//! Settings by key: what each takes, its value in [`Settings`], and the order in which they are listed.

use serde::{Serialize, Serializer};
use serde_json::{Value, json};

pub use super::kinds::{Kind, MAX_SIZE, section_of};
use super::kinds::{Row, RowSection};
use super::table::{SECTIONS, Settings};

/// One setting.
pub type Setting = Row<Settings>;
/// Settings that belong together.
pub type Section = RowSection<Settings>;
use super::user_pass;

/// All sections, in the order of listings.
#[must_use]
pub fn sections() -> &'static [Section] {
    SECTIONS
}

/// All settings, in the order of listings.
pub fn all() -> impl Iterator<Item = &'static Setting> {
    SECTIONS.iter().flat_map(Section::settings)
}

/// The setting under a dotted key.
#[must_use]
pub fn find(key: &str) -> Option<&'static Setting> {
    all().find(|setting| setting.key == key)
}

/// All settings as `info --settings` prints them: key, kind, default, allowed values, unit and one line each.
#[must_use]
pub fn listing() -> Value {
    let rows = all().map(|setting| {
        json!({
            "key": setting.key,
            "kind": setting.kind.name(),
            "default": setting.default_value(),
            "allowed": setting.kind.allowed(),
            "unit": setting.unit,
            "doc": setting.doc,
        })
    });
    rows.collect()
}

impl Settings {
    /// A hash (FNV-1a, 64 bits) of all settings that the pixels of a frame depend on once its views are given: not those of
    /// sessions, devices and files.
    #[must_use]
    pub fn picture_hash(&self) -> u64 {
        let elsewhere = ["simulated", "openxr", "gpu", "output", "limits"];
        let keys = ["headset", "adapter", "size", "force.record_texels"];
        let decides = |key: &str| {
            key == "gpu.shader_folder"
                || !(elsewhere.contains(&section_of(key)) || keys.contains(&key))
        };
        let settings = all().filter(|setting| decides(setting.key));
        let mut words: Vec<String> = settings
            .map(|setting| format!("{} = {}\n", setting.key, setting.value(self)))
            .collect();
        words.push(json!(self.render.user_passes).to_string());
        let bytes = words.iter().flat_map(|word| word.bytes());
        bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        })
    }

    /// The value under a dotted key as JSON, `null` where it is unset or no such setting exists.
    #[must_use]
    pub fn value(&self, key: &str) -> Value {
        find(key).map_or(Value::Null, |setting| setting.value(self))
    }
}

/// Keys and sections as in the config file, in the order of listings.
impl Serialize for Settings {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut tree = json!({});
        for setting in all() {
            let value = setting.value(self);
            match setting.key.split_once('.') {
                Some((section, key)) => tree[section][key] = value,
                None => tree[setting.key] = value,
            }
        }
        if !self.render.user_passes.is_empty() {
            tree[user_pass::KEY] = json!(self.render.user_passes);
        }
        tree.serialize(serializer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::user_pass::{UserDomain, UserPass};

    #[test]
    fn what_changes_pixels_changes_the_hash() {
        let plain = Settings::default();
        let changed = |change: fn(&mut Settings)| {
            let mut settings = plain.clone();
            change(&mut settings);
            settings.picture_hash() != plain.picture_hash()
        };
        assert!(changed(|s| s.render.seed += 1));
        assert!(changed(|s| s.gpu.shader_folder = "mine".into()));
        assert!(changed(|s| s.render.user_passes.push(UserPass {
            file: "a.wesl".into(),
            name: "a".into(),
            after: "remodulate".into(),
            over: UserDomain::default(),
        })));
        assert!(!changed(|s| s.adapter = "another".into()));
        assert!(!changed(|s| s.output.images = true.into()));
    }
}
