//! Every setting, grouped, with its unit, its range and one line of explanation.

use std::sync::Arc;

use egui::{CollapsingHeader, Color32, ComboBox, Context, DragValue, Key, RichText, TextEdit, Ui};
use serde_json::{Value, json};

use crate::options;
use crate::settings::{Kind, Setting, Settings, registry};
use crate::viewer::app::App;
use crate::viewer::layout::Layout;
use crate::viewer::save_files::Saved;
use crate::xr::Headset;

/// The tab.
pub fn show(app: &mut App, ui: &mut Ui) {
    if app.window_state.layout == Layout::Split {
        ui.horizontal(|ui| {
            ui.selectable_value(&mut app.fields.edits_other, false, "Left of the line");
            ui.selectable_value(&mut app.fields.edits_other, true, "Right of the line");
        });
    } else {
        app.fields.edits_other = false;
    }
    ui.horizontal(|ui| {
        let reset = ui
            .button("Reset all")
            .on_hover_text("all settings but the scene, its environment and the adapter");
        if reset.clicked() {
            let now = app.panel_settings();
            let kept = Settings {
                scene: now.scene.clone(),
                adapter: now.adapter.clone(),
                environment: now.environment.clone(),
                ..Settings::default()
            };
            store(app, ui.ctx(), kept);
        }
        if ui
            .button("Save as TOML")
            .on_hover_text(&app.fields.settings_path)
            .clicked()
        {
            let context = ui.ctx().clone();
            app.save(&context, Saved::Settings);
        }
    });
    ui.add(
        TextEdit::singleline(&mut app.fields.settings_search)
            .hint_text("Search settings")
            .desired_width(f32::INFINITY),
    );
    let wanted = app.fields.settings_search.trim().to_lowercase();
    let matches = |setting: &&'static Setting| {
        wanted.is_empty()
            || setting.key.contains(&wanted)
            || title(setting.key.rsplit('.').next().unwrap_or_default())
                .to_lowercase()
                .contains(&wanted)
            || setting.doc.to_lowercase().contains(&wanted)
    };
    let mut found = 0;
    for section in registry::sections() {
        let rows: Vec<&'static Setting> = section.settings().filter(matches).collect();
        if rows.is_empty() {
            continue;
        }
        found += rows.len();
        CollapsingHeader::new(section.title)
            .default_open(matches!(section.name(), "" | "photon"))
            .open((!wanted.is_empty()).then_some(true))
            .show(ui, |ui| {
                for setting in rows {
                    row(app, ui, setting);
                }
            });
    }
    if found == 0 {
        ui.weak("no setting has that in its name or its explanation");
    }
}

fn store(app: &mut App, context: &Context, settings: Settings) {
    if app.fields.edits_other {
        app.other = Arc::new(settings);
    } else {
        app.set_settings(context, settings);
    }
}

/// Changes a setting, or notes why it cannot be that.
fn set(app: &mut App, context: &Context, setting: &Setting, new: &Value) {
    match options::changed(app.panel_settings(), setting.key, new) {
        Ok(settings) => {
            app.fields.refused = None;
            store(app, context, settings);
        }
        Err(error) => app.fields.refused = Some((setting.key, error.to_string())),
    }
}

/// What is being written in a field counts as it stands.
pub fn take_written(app: &mut App, context: &Context) {
    let Some((key, text)) = app.fields.setting.take() else {
        return;
    };
    if let Some(setting) = registry::find(key)
        && size_words(&setting.value(app.panel_settings())) != text.trim()
    {
        set(app, context, setting, &entered(setting, &text));
    }
}

/// What stands in a field of text, as a value.
fn entered(setting: &Setting, text: &str) -> Value {
    if text.trim().is_empty() && matches!(setting.kind, Kind::Size { .. }) {
        Value::Null
    } else {
        json!(text.trim())
    }
}

/// What opens with another program start only, and is shown without being changed.
fn is_fixed(key: &str) -> bool {
    // The scene is opened by the File menu.
    key == "scene" || key.starts_with("openxr.")
}

/// What a scene is read by.
fn is_of_reading(key: &str) -> bool {
    matches!(key, "scene_scale" | "light") || key.starts_with("limits.")
}

fn row(app: &mut App, ui: &mut Ui, setting: &'static Setting) {
    let value = setting.value(app.panel_settings());
    let default = setting.default_value();
    let short = setting.key.rsplit('.').next().unwrap_or(setting.key);
    let mut new = None;
    ui.horizontal(|ui| {
        let is_changed = value != default;
        let name = RichText::new(title(short));
        let name = if is_changed { name.strong() } else { name };
        ui.label(name).on_hover_ui(|ui| {
            ui.strong(setting.key);
            ui.label(setting.doc);
            ui.weak(format!("must be {}", setting.kind.allowed()));
            ui.weak(format!("default {default}"));
        });
        if is_fixed(setting.key) {
            ui.weak(words(&value));
            return;
        }
        new = widget(app, ui, setting, &value);
        if !setting.unit.is_empty() {
            ui.weak(setting.unit);
        }
        if is_of_reading(setting.key) {
            ui.weak("for what is read next");
        }
        if let Some(frame) = &app.frame
            && value.as_f64() == Some(0.0)
            && let Some(eye) = ["photon.radius_m", "photon.caustic_radius_m"]
                .iter()
                .position(|key| *key == setting.key)
        {
            ui.weak(format!("automatic: {:.4}", frame.radii_m[eye]));
        }
        if is_changed
            && ui
                .small_button("reset")
                .on_hover_text(format!("back to {default}"))
                .clicked()
        {
            new = Some(default.clone());
        }
    });
    if let Some(new) = new {
        set(app, ui.ctx(), setting, &new);
    }
    if let Some((key, why)) = &app.fields.refused
        && *key == setting.key
    {
        ui.colored_label(Color32::from_rgb(255, 130, 110), why);
    }
}

/// A setting's name for people: words, without the unit that stands beside the value. Search finds the key as well.
fn title(short: &str) -> String {
    let whole = match short {
        "radius_m" => "gather radius",
        "caustic_radius_m" => "caustic gather radius",
        "spp" => "samples per pixel",
        "svgf" => "SVGF denoiser",
        "taa" => "temporal anti-aliasing",
        "nee" => "next event estimation",
        other => ["_m", "_ms", "_hz", "_rad", "_deg"]
            .iter()
            .find_map(|unit| other.strip_suffix(unit))
            .unwrap_or(other),
    };
    let words = whole.replace('_', " ");
    let mut letters = words.chars();
    letters.next().map_or_else(String::new, |first| {
        first.to_uppercase().collect::<String>() + letters.as_str()
    })
}

fn words(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Null => "unset".to_owned(),
        other => other.to_string(),
    }
}

/// A box of words; what is chosen instead of `value`.
fn choice(ui: &mut Ui, key: &str, value: &Value, words: &[&str]) -> Option<Value> {
    let mut chosen = value.as_str().unwrap_or_default().to_owned();
    ComboBox::from_id_salt(key)
        .selected_text(chosen.clone())
        .show_ui(ui, |ui| {
            for word in words {
                ui.selectable_value(&mut chosen, (*word).to_owned(), *word);
            }
        });
    (value.as_str() != Some(&chosen)).then(|| json!(chosen))
}

/// The widget of a setting's kind; what it was changed to.
fn widget(app: &mut App, ui: &mut Ui, setting: &'static Setting, value: &Value) -> Option<Value> {
    if setting.key == "headset" {
        return choice(ui, setting.key, value, &Headset::names());
    }
    match setting.kind {
        Kind::Bool => {
            let mut on = value.as_bool().unwrap_or_default();
            ui.checkbox(&mut on, "").changed().then(|| json!(on))
        }
        Kind::Choice { words, .. } => choice(ui, setting.key, value, words),
        Kind::Whole { min, max } => {
            let mut number = value.as_u64().unwrap_or(min);
            let speed = (number as f64 * 0.01).max(0.1);
            let field = DragValue::new(&mut number).range(min..=max).speed(speed);
            let response = ui.add(field.update_while_editing(false));
            response.changed().then(|| json!(number))
        }
        Kind::Real { min, max, .. } => {
            let mut number = value.as_f64().unwrap_or(min);
            let speed = (number.abs() * 0.01).max(1e-4);
            let field = DragValue::new(&mut number)
                .range(min..=max)
                .speed(speed)
                .max_decimals(6);
            let response = ui.add(field.update_while_editing(false));
            response.changed().then(|| json!(number))
        }
        Kind::Text { .. } | Kind::List { .. } | Kind::Size { .. } => {
            let mut text = match &app.fields.setting {
                Some((key, text)) if *key == setting.key => text.clone(),
                _ => size_words(value),
            };
            let field = TextEdit::singleline(&mut text)
                .hint_text("unset")
                .desired_width(140.0);
            let response = ui.add(field);
            if response.changed() || response.has_focus() {
                app.fields.setting = Some((setting.key, text.clone()));
            }
            let is_entered = response.lost_focus();
            if is_entered {
                app.fields.setting = None;
                let cancelled = ui.input(|input| input.key_pressed(Key::Escape));
                let new = entered(setting, &text);
                let same = size_words(value) == text.trim();
                return (!cancelled && !same).then_some(new);
            }
            None
        }
    }
}

/// A size as `WIDTHxHEIGHT`, anything else as it is.
fn size_words(value: &Value) -> String {
    match value {
        Value::Array(edges) => edges
            .iter()
            .map(Value::to_string)
            .collect::<Vec<_>>()
            .join("x"),
        Value::Null => String::new(),
        other => words(other),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_words_without_units() {
        assert_eq!(title("radius_m"), "Gather radius");
        assert_eq!(title("grid_cells_max"), "Grid cells max");
        assert_eq!(title("ipd_m"), "Ipd");
        assert_eq!(title(""), "");
    }

    #[test]
    fn sizes_are_written_as_flags_take_them() {
        assert_eq!(size_words(&json!([640, 480])), "640x480");
        assert_eq!(size_words(&Value::Null), "");
        assert_eq!(size_words(&json!("photon")), "photon");
    }
}
