//! Until saving is merged.
use crate::options::{OptionsError, Settings};
use crate::scene::{Scene, edit::Original};
use serde_json::Value;
use std::path::Path;
pub trait SettingsPending: Sized {
    fn value(&self, key: &str) -> Value;
    fn with(&self, key: &str, value: &Value) -> Result<Settings, OptionsError>;
    fn save_toml(&self, path: &Path) -> Result<(), String>;
}
impl SettingsPending for Settings {
    fn value(&self, key: &str) -> Value {
        let tree = serde_json::to_value(self).unwrap();
        key.split('.').fold(tree, |at, part| at[part].clone())
    }
    fn with(&self, key: &str, value: &Value) -> Result<Settings, OptionsError> {
        let mut tree = serde_json::to_value(self).unwrap();
        let mut at = &mut tree;
        for part in key.split('.') {
            at = &mut at[part];
        }
        *at = value.clone();
        serde_json::from_value(tree).map_err(|e| OptionsError::Conflict(e.to_string()))
    }
    fn save_toml(&self, _: &Path) -> Result<(), String> {
        Err("pending".to_owned())
    }
}
pub fn save_scene(_: &Scene, _: &Original, _: &Path) -> Result<(), String> {
    Err("pending".to_owned())
}
