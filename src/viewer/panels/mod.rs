//! What surrounds the picture.

pub mod help;
pub mod hierarchy;
pub mod inspector;
pub mod menu;
pub mod paths;
pub mod settings;
pub mod statistics;

use egui::{Align2, Color32, Context, Frame, Panel, RichText, ScrollArea, Ui, vec2};

use super::app::{App, Tab};

/// Share of the window's width or height that one panel may be drawn to: something of the picture stays.
const MOST_OF_WINDOW: f32 = 0.4;
/// Width of the right panel at least where the window has room, points: it comes back when a small window grows again.
const LEAST_WIDTH: f32 = 280.0;
/// Width of what is said, points, at most, and what the window is wider at least: by a margin, and a button to close it.
const MESSAGE_WIDTH: f32 = 620.0;
const BESIDE_MESSAGE: f32 = 100.0;

/// The right panel: inspector and settings.
pub fn right(app: &mut App, ui: &mut Ui) {
    if !app.window_state.side {
        return;
    }
    let panel = Panel::right("side").default_size(370.0);
    let panel = panel.min_size(LEAST_WIDTH);
    let panel = panel.max_size(MOST_OF_WINDOW * ui.ctx().content_rect().width());
    panel.show(ui, |ui| {
        ui.horizontal_wrapped(|ui| {
            ui.selectable_value(&mut app.tab, Tab::Inspector, "Inspector");
            ui.selectable_value(&mut app.tab, Tab::Settings, "Settings");
        });
        ui.separator();
        // In a narrow window not all of a row fits.
        ScrollArea::both()
            .auto_shrink(false)
            .show(ui, |ui| match app.tab {
                Tab::Inspector => inspector::show(app, ui),
                Tab::Settings => settings::show(app, ui),
            });
    });
}

/// Everything that has been said since the start.
pub fn log(app: &mut App, context: &Context) {
    let mut is_open = app.shows_log;
    egui::Window::new("Log")
        .open(&mut is_open)
        .default_size([520.0, 200.0])
        .show(context, |ui| {
            ScrollArea::vertical()
                .auto_shrink(false)
                .stick_to_bottom(true)
                .show(ui, |ui| {
                    for (seconds, text) in &app.log {
                        ui.label(format!("{seconds:8.1} s  {text}"));
                    }
                });
        });
    app.shows_log = is_open;
}

/// What has been said, over the picture.
pub fn messages(app: &mut App, context: &Context) {
    if let Some(loading) = &app.loading {
        let text = format!("reading {} ({:.0} s)", loading.name(), loading.seconds());
        let mut cancelled = false;
        egui::Area::new(egui::Id::unique("loading"))
            .anchor(Align2::CENTER_TOP, vec2(0.0, 60.0))
            .show(context, |ui| {
                Frame::popup(ui.style()).show(ui, |ui| {
                    ui.horizontal(|ui| {
                        ui.spinner();
                        ui.label(text);
                        cancelled = ui.button("Cancel").clicked();
                    });
                });
            });
        if cancelled {
            app.cancel_loading();
            app.say(context, "reading was cancelled", false);
        }
    }
    if !app.messages.is_empty() {
        let mut closed = None;
        let width = (context.content_rect().width() - BESIDE_MESSAGE).clamp(0.0, MESSAGE_WIDTH);
        egui::Area::new(egui::Id::unique("messages"))
            .anchor(Align2::CENTER_BOTTOM, vec2(0.0, -12.0))
            .show(context, |ui| {
                for (index, message) in app.messages.iter().enumerate() {
                    Frame::popup(ui.style()).show(ui, |ui| {
                        ui.horizontal(|ui| {
                            ui.set_max_width(width);
                            let color = if message.is_error {
                                Color32::from_rgb(255, 130, 110)
                            } else {
                                ui.visuals().text_color()
                            };
                            ui.add(
                                egui::Label::new(RichText::new(&message.text).color(color)).wrap(),
                            );
                            if message.is_error && ui.button("Close").clicked() {
                                closed = Some(index);
                            }
                        });
                    });
                }
            });
        if let Some(index) = closed {
            app.messages.remove(index);
        }
    }
}
