//! What is asked in the middle of the window before anything else goes on.

use std::path::PathBuf;

use egui::{Context, Id, Modal, Ui};

use super::app::{App, WindowCommand};
use super::save_files::Saved;

/// What is asked; one thing at a time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Question {
    /// Whether to read the scene of this name, which was refused for naming files outside its folder; and whether changes that
    /// are not saved may go.
    Outside(String, bool),
    /// Whether to quit with changes that are not saved.
    Quit,
    /// Whether to open the scene of this name in place of one with changes that are not saved.
    Open(String),
    /// Whether to write over this file, and what comes after.
    Replace(PathBuf, Saved, Option<Leave>),
}

/// Where one goes from a scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Leave {
    /// Out of the program.
    Quit,
    /// To the scene of this name.
    Open(String),
}

impl Leave {
    fn go(self, app: &mut App, context: &Context) {
        match self {
            Self::Quit => app.command(WindowCommand::Quit),
            Self::Open(spec) => app.open(context, spec),
        }
    }
}

/// Shows the question, and does what is answered.
pub fn show(app: &mut App, context: &Context) {
    let Some(question) = app.asks.clone() else {
        return;
    };
    Modal::new(Id::unique("question")).show(context, |ui| match question {
        Question::Outside(spec, may_lose_edits) => {
            ui.heading("The scene names files outside its own folder");
            ui.label("Reading them is safe only if you trust whoever made it: saving the scene takes them along.");
            if is_agreed(app, ui, "Read them") {
                app.open_with_outside(context, spec, may_lose_edits);
            }
        }
        Question::Quit => {
            ui.heading("The scene has changes that are not saved");
            let buttons = ["Quit without saving", "Save and quit"];
            unsaved(app, ui, buttons, Leave::Quit);
        }
        Question::Open(spec) => {
            ui.heading("The scene has changes that are not saved");
            ui.label(format!("{spec} takes its place."));
            let buttons = ["Open without saving", "Save and open"];
            unsaved(app, ui, buttons, Leave::Open(spec));
        }
        Question::Replace(path, what, leave) => {
            ui.heading("A file of this name is there already");
            ui.label(format!("{} is lost.", path.display()));
            if is_agreed(app, ui, "Replace it") {
                app.replace(context, path, what);
                if let Some(leave) = leave.filter(|_| !app.document.is_modified()) {
                    leave.go(app, context);
                }
            }
        }
    });
}

/// A button that leaves things as they are and one that agrees; the question is over with either.
fn is_agreed(app: &mut App, ui: &mut Ui, agree: &str) -> bool {
    ui.add_space(8.0);
    ui.horizontal(|ui| {
        let is_left = ui.button("Leave it").clicked();
        let is_agreed = ui.button(agree).clicked();
        if is_left || is_agreed {
            app.asks = None;
        }
        is_agreed
    })
    .inner
}

/// Buttons that leave a scene without saving it and with, and one that stays.
fn unsaved(app: &mut App, ui: &mut Ui, [without, with]: [&str; 2], leave: Leave) {
    ui.add_space(8.0);
    ui.horizontal(|ui| {
        let goes_without = ui.button(without).clicked();
        let saves = ui.button(with).clicked();
        let stays = ui.button("Go on").clicked();
        if goes_without || saves || stays {
            app.asks = None;
        }
        let context = ui.ctx().clone();
        if saves {
            app.save(&context, Saved::Scene);
        }
        match &mut app.asks {
            // Asked before it is saved.
            Some(Question::Replace(_, _, after)) if saves => *after = Some(leave),
            _ if goes_without => match leave {
                Leave::Open(spec) => app.open_in_place(&context, spec),
                Leave::Quit => leave.go(app, &context),
            },
            _ if saves && !app.document.is_modified() => leave.go(app, &context),
            _ => {}
        }
    });
}
