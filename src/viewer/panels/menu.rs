//! The menu bar, with what is shown and how, and what plays.

use egui::containers::menu::{MenuButton, MenuConfig};
use egui::{Button, ComboBox, DragValue, MenuBar, Panel, PopupCloseBehavior, Slider, Ui};

use crate::scene::builtin;
use crate::scene::edit::Document;
use crate::settings::{Choice as _, Switch, Tone};
use crate::viewer::app::{App, WindowCommand};
use crate::viewer::frames::ViewMode;
use crate::viewer::gizmo::Mode;
use crate::viewer::layout::Layout;
use crate::viewer::panels::paths::Purpose;
use crate::viewer::save_files::Saved;
use crate::viewer::session::{Player, Recording};
use crate::viewer::worker::decided;
use crate::xr::{Motion, SimulatedSession};

/// Seconds of a simulated motion.
const MOTION_SECONDS: f64 = 12.0;

/// The top panel.
pub fn show(app: &mut App, ui: &mut Ui) {
    Panel::top("menu").show(ui, |ui| {
        MenuBar::new().ui(ui, |ui| {
            ui.menu_button("File", |ui| file(app, ui));
            ui.menu_button("Edit", |ui| edit(app, ui));
            ui.menu_button("Window", |ui| window(app, ui));
            ui.menu_button("Motion", |ui| motion(app, ui));
            if ui.button("Help").clicked() {
                app.shows_help = !app.shows_help;
            }
            ui.separator();
            ComboBox::from_id_salt("layout")
                .selected_text(app.window_state.layout.name())
                .show_ui(ui, |ui| {
                    for layout in Layout::ALL {
                        ui.selectable_value(&mut app.window_state.layout, layout, layout.name())
                            .on_hover_text(layout.about());
                    }
                })
                .response
                .on_hover_text("how the eyes share the picture");
            ComboBox::from_id_salt("look")
                .selected_text(app.view_mode.name())
                .height(600.0)
                .show_ui(ui, |ui| {
                    for look in ViewMode::all() {
                        ui.selectable_value(&mut app.view_mode, look, look.name())
                            .on_hover_text(look.about());
                    }
                })
                .response
                .on_hover_text("the picture, or what it is made of");
            ui.separator();
            for mode in Mode::ALL {
                ui.selectable_value(&mut app.gizmo.mode, mode, mode.name());
            }
            ui.toggle_value(&mut app.gizmo.is_local, "Local")
                .on_hover_text("handles along the object's axes instead of the world's");
            ui.toggle_value(&mut app.gizmo.snaps, "Snap")
                .on_hover_text("handles move in steps; Ctrl does the same for one drag");
        });
        toolbar(app, ui);
        transport(app, ui);
    });
}

/// What a designer changes most: light of the picture, denoiser, surroundings; and what is compared.
fn toolbar(app: &mut App, ui: &mut Ui) {
    let context = ui.ctx().clone();
    let mut settings = (*app.settings).clone();
    ui.horizontal(|ui| {
        let output = &mut settings.render.output;
        let mut stops = output.exposure.max(1e-6).log2();
        let field = DragValue::new(&mut stops).range(-16.0..=16.0).speed(0.02);
        let field = field
            .clamp_existing_to_range(false)
            .fixed_decimals(1)
            .prefix("Exposure ")
            .suffix(" EV");
        if ui
            .add(field)
            .on_hover_text("drag, or click and type")
            .changed()
        {
            output.exposure = stops.exp2();
        }
        ComboBox::from_id_salt("tone")
            .selected_text(format!("{} curve", output.tone))
            .show_ui(ui, |ui| {
                for &tone in Tone::ALL {
                    ui.selectable_value(&mut output.tone, tone, tone.to_string());
                }
            })
            .response
            .on_hover_text("from radiance to what is shown");
        ui.separator();
        let denoiser = &mut settings.render.reconstruct.svgf;
        let mut denoises = decided(&app.settings).render.reconstruct.svgf.is_on();
        let toggle = ui.toggle_value(&mut denoises, "Denoise");
        if toggle.on_hover_text("reconstruct.svgf").changed() {
            *denoiser = if denoises { Switch::On } else { Switch::Off };
        }
        ui.separator();
        let path = &mut settings.environment.path;
        let name = std::path::Path::new(path.as_str()).file_name();
        let own = match app.document.scene().environment {
            Some(_) => "the scene's",
            None => "none",
        };
        let name = name.map_or_else(|| own.into(), |name| name.to_string_lossy().into_owned());
        // A click on its field leaves it open.
        let stays = MenuConfig::new().close_behavior(PopupCloseBehavior::CloseOnClickOutside);
        let menu = MenuButton::new(format!("Surroundings: {name}")).config(stays);
        menu.ui(ui, |ui| {
            if ui.button("Open\u{2026}").clicked() {
                app.ask_path(Purpose::Open);
                ui.close();
            }
            if ui
                .add_enabled(!path.is_empty(), Button::new("None"))
                .clicked()
            {
                path.clear();
                ui.close();
            }
            let strength = DragValue::new(&mut settings.environment.strength);
            let strength = strength.range(0.0..=1e3).clamp_existing_to_range(false);
            ui.add(strength.speed(0.01).prefix("strength "));
        });
        ui.separator();
        let mut is_frozen = app.frozen.is_some();
        if ui
            .toggle_value(&mut is_frozen, "Freeze A")
            .on_hover_text("keeps this picture left of a line that can be dragged, to compare with")
            .clicked()
        {
            app.freeze(&context);
        }
        ui.menu_button("Views", |ui| {
            for slot in 0..app.bookmarks.len() {
                let is_kept = app.bookmarks[slot].is_some();
                let (view, keys) = (format!("View {}", slot + 1), format!("Ctrl+{}", slot + 1));
                if entry(ui, is_kept, &view, &keys) {
                    app.go_to_bookmark(&context, slot);
                }
            }
            ui.weak("Ctrl+Shift+1 to 5 keep the view");
        });
    });
    app.set_settings(&context, settings);
}

/// An entry of a menu, with its keys; true if it was chosen.
fn entry(ui: &mut Ui, is_enabled: bool, text: &str, keys: &str) -> bool {
    let button = Button::new(text).shortcut_text(keys);
    let chosen = ui.add_enabled(is_enabled, button).clicked();
    if chosen {
        ui.close();
    }
    chosen
}

fn file(app: &mut App, ui: &mut Ui) {
    let context = ui.ctx().clone();
    if entry(ui, true, "Open\u{2026}", "Ctrl+O") {
        app.ask_path(Purpose::Open);
    }
    let recent = app.window_state.recent.clone();
    ui.add_enabled_ui(!recent.is_empty(), |ui| {
        ui.menu_button("Open recent", |ui| {
            for path in recent {
                if entry(ui, true, &path, "") {
                    app.open(&context, path);
                }
            }
        });
    });
    ui.menu_button("Embedded scenes", |ui| {
        for name in builtin::NAMES {
            if entry(ui, true, name, "") {
                app.open(&context, format!("{}{name}", builtin::PREFIX));
            }
        }
    });
    ui.separator();
    if entry(ui, true, "Save scene", "Ctrl+S") {
        app.save(&context, Saved::Scene);
    }
    if entry(ui, true, "Save scene as\u{2026}", "Ctrl+Shift+S") {
        app.ask_path(Purpose::Save(Saved::Scene));
    }
    if entry(ui, true, "Save settings as\u{2026}", "") {
        app.ask_path(Purpose::Save(Saved::Settings));
    }
    ui.separator();
    if entry(ui, true, "Screenshot", "T") {
        app.screenshot();
    }
    if entry(ui, true, "Reload shaders", "F5") {
        app.reload_shaders();
    }
    ui.separator();
    if entry(ui, true, "Quit", "Ctrl+Q") {
        app.request_quit();
    }
}

fn edit(app: &mut App, ui: &mut Ui) {
    let context = ui.ctx().clone();
    let labelled = |verb: &str, label: Option<&str>| match label {
        Some(label) => format!("{verb}: {label}"),
        None => verb.to_owned(),
    };
    let undo = labelled("Undo", app.document.undo_label());
    let can_undo = app.document.undo_label().is_some();
    if entry(ui, can_undo, &undo, "Ctrl+Z") {
        app.step(&context, Document::undo);
    }
    let redo = labelled("Redo", app.document.redo_label());
    let can_redo = app.document.redo_label().is_some();
    if entry(ui, can_redo, &redo, "Ctrl+Shift+Z") {
        app.step(&context, Document::redo);
    }
    ui.separator();
    for step in app
        .document
        .history()
        .collect::<Vec<_>>()
        .iter()
        .rev()
        .take(12)
    {
        ui.weak(*step);
    }
}

fn window(app: &mut App, ui: &mut Ui) {
    ui.checkbox(&mut app.window_state.hierarchy, "Hierarchy");
    ui.checkbox(&mut app.window_state.side, "Inspector and settings");
    ui.checkbox(&mut app.window_state.statistics, "Statistics");
    ui.checkbox(&mut app.shows_log, "Log");
    let mut are_hidden = app.hides_panels;
    let hide = Button::selectable(are_hidden, "Hide all").shortcut_text("Tab");
    if ui.add(hide).clicked() {
        are_hidden = !are_hidden;
        ui.close();
    }
    app.hides_panels = are_hidden;
    ui.separator();
    if entry(ui, true, "Full screen", "F11") {
        app.command(WindowCommand::ToggleFullScreen);
    }
}

fn motion(app: &mut App, ui: &mut Ui) {
    if ui.button("By hand").clicked() {
        app.take_head();
        app.player = None;
        ui.close();
    }
    let seed = u64::from(app.settings.render.seed);
    for (name, motion) in [
        ("Yaw sweep", Motion::Yaw),
        ("Walk", Motion::Walk),
        ("Sway", Motion::Sway),
    ] {
        if ui.button(name).clicked() {
            let context = ui.ctx().clone();
            let frames = (MOTION_SECONDS * app.headset.refresh_hz) as u64;
            let headset = app.headset.clone();
            let start = app.camera.pose();
            let mut session =
                SimulatedSession::new(headset, motion, start, Some(frames)).with_seed(seed);
            match Recording::of(&mut session) {
                Ok(recording) => {
                    let mut player = Player::new(recording);
                    player.is_playing = true;
                    app.player = Some(player);
                    // What is saved runs like that.
                    let mut settings = (*app.settings).clone();
                    settings.simulated.motion = motion;
                    app.set_settings(&context, settings);
                }
                Err(error) => app.say(&context, error.to_string(), true),
            }
            ui.close();
        }
    }
    ui.separator();
    ui.weak("A recording (.jsonl, .csv, .txt) plays when it is dropped onto the window.");
}

/// Play, pause, step and scrub.
fn transport(app: &mut App, ui: &mut Ui) {
    if let Some(player) = &mut app.player {
        ui.horizontal(|ui| {
            play_button(ui, &mut player.is_playing);
            if ui
                .button("|<")
                .on_hover_text("one frame back (,)")
                .clicked()
            {
                player.step(-1);
            }
            if ui.button(">|").on_hover_text("one frame on (.)").clicked() {
                player.step(1);
            }
            let mut frame = player.frame();
            let last = player.recording.len().saturating_sub(1);
            ui.spacing_mut().slider_width = 320.0;
            if ui
                .add(Slider::new(&mut frame, 0..=last).text("frame"))
                .changed()
            {
                player.is_playing = false;
                player.seek(frame);
            }
            ui.weak(format!(
                "{:.2} s, {}",
                player.recording.seconds_at(frame),
                player.recording.name
            ));
            if player.is_left() {
                ui.strong("left by hand: Play goes back to it");
            }
        });
    } else if !app.document.scene().animations.is_empty() {
        ui.horizontal(|ui| {
            play_button(ui, &mut app.clock.is_playing);
            if ui
                .button("Stop")
                .on_hover_text("the scene as its nodes have it")
                .clicked()
            {
                app.clock = Default::default();
            }
            match &mut app.clock.seconds {
                None => ui.weak("the scene's animation stands"),
                Some(seconds) => {
                    let field = DragValue::new(seconds).speed(0.01).suffix(" s");
                    ui.add(field.range(0.0..=f64::INFINITY))
                }
            };
        });
    }
}

fn play_button(ui: &mut Ui, is_playing: &mut bool) {
    let text = if *is_playing { "Pause" } else { "Play" };
    if ui.button(text).on_hover_text("Space").clicked() {
        *is_playing = !*is_playing;
    }
}
