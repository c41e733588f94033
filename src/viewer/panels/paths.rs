//! The window that asks for a path: a field, and what lies in the folder that is written there.
//!
//! Ours, because native dialogs would bring 69 more crates along (`rfd` 0.15 with its portal: `zbus`, an async executor, `url`).

use std::path::{Path, PathBuf};

use egui::text::CCursorRange;
use egui::{Align2, Context, Key, ScrollArea, TextEdit, Window};

use crate::viewer::app::App;
use crate::viewer::loading::Kind;
use crate::viewer::save_files::Saved;

/// Entries that are offered at most.
const MOST_ENTRIES: usize = 500;

/// What becomes of the path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// A scene, surroundings or a recording is read.
    Open,
    /// This is written to it.
    Save(Saved),
}

impl Purpose {
    fn title(self) -> &'static str {
        match self {
            Self::Open => "Open a scene, surroundings or a recording",
            Self::Save(Saved::Scene) => "Save the scene as glTF",
            Self::Save(Saved::Settings) => "Save the settings as TOML",
        }
    }

    fn verb(self) -> &'static str {
        match self {
            Self::Open => "Open",
            Self::Save(_) => "Save",
        }
    }

    /// Whether files of such a name are what it is for.
    fn is_for(self, path: &Path) -> bool {
        match self {
            Self::Open => Kind::of_file(path).is_some(),
            Self::Save(Saved::Scene) => Kind::of_file(path) == Some(Kind::Scene),
            Self::Save(Saved::Settings) => path
                .extension()
                .is_some_and(|extension| extension.eq_ignore_ascii_case("toml")),
        }
    }
}

/// A path that is asked for.
#[derive(Clone, Debug)]
pub struct PathQuestion {
    purpose: Purpose,
    text: String,
    /// The field has had the keyboard.
    is_focused: bool,
    /// What stands there at first was selected: who types a path means that one alone.
    is_selected: bool,
    /// The folder that was read last, and its entries: names, folders with a slash at the end.
    listing: (PathBuf, Vec<String>),
}

impl PathQuestion {
    /// Begins with `text` in the field.
    pub fn new(purpose: Purpose, text: String) -> Self {
        Self {
            purpose,
            text,
            is_focused: false,
            is_selected: false,
            // No folder has this name.
            listing: (PathBuf::from("\0"), Vec::new()),
        }
    }

    /// The folder in the field, as it is written, and what is written after it.
    fn split(&self) -> (&str, &str) {
        let after = self.text.rfind(std::path::is_separator);
        self.text.split_at(after.map_or(0, |at| at + 1))
    }

    /// What the folder holds that begins as the field ends.
    fn matching(&mut self) -> Vec<String> {
        let (folder, begin) = self.split();
        let (folder, begin) = (folder.to_owned(), begin.to_lowercase());
        let path = Path::new(if folder.is_empty() { "." } else { &folder });
        if self.listing.0 != path {
            self.listing = (path.to_owned(), entries(path, self.purpose));
        }
        let names = self.listing.1.iter();
        names
            .filter(|name| name.to_lowercase().starts_with(&begin))
            .take(MOST_ENTRIES)
            .map(|name| folder.clone() + name)
            .collect()
    }
}

/// Folders and files of use in `folder`; none if it cannot be read.
fn entries(folder: &Path, purpose: Purpose) -> Vec<String> {
    let Ok(read) = std::fs::read_dir(folder) else {
        return Vec::new();
    };
    let mut names: Vec<String> = read
        .filter_map(Result::ok)
        .filter_map(|entry| {
            let name = entry.file_name().into_string().ok()?;
            let is_hidden = name.starts_with('.');
            if entry.path().is_dir() {
                return (!is_hidden).then(|| name + "/");
            }
            (!is_hidden && purpose.is_for(Path::new(&name))).then_some(name)
        })
        .collect();
    // Folders first.
    names.sort_by_key(|name| (!name.ends_with('/'), name.to_lowercase()));
    names
}

/// The window, while a path is asked for.
pub fn show(app: &mut App, context: &Context) {
    let Some(mut question) = app.asks_path.take() else {
        return;
    };
    let (mut is_open, mut is_done, mut is_cancelled) = (true, false, false);
    Window::new(question.purpose.title())
        .open(&mut is_open)
        .pivot(Align2::CENTER_CENTER)
        .default_pos(context.content_rect().center())
        .default_size([520.0, 320.0])
        .collapsible(false)
        .show(context, |ui| {
            let field = TextEdit::singleline(&mut question.text).desired_width(f32::INFINITY);
            let mut output = field.hint_text("path, or builtin:NAME").show(ui);
            let field = output.response.response;
            if !std::mem::replace(&mut question.is_focused, true) {
                field.request_focus();
            }
            if !std::mem::replace(&mut question.is_selected, true) {
                let all = CCursorRange::select_all(&output.galley);
                output.state.cursor.set_char_range(Some(all));
                output.state.store(context, field.id);
            }
            is_done = field.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
            ScrollArea::vertical()
                .max_height(240.0)
                .auto_shrink([false, true])
                .show(ui, |ui| {
                    for path in question.matching() {
                        let (_, name) = path.split_at(question.split().0.len());
                        let entry = ui.selectable_label(path == question.text, name);
                        is_done |= entry.double_clicked() && !path.ends_with('/');
                        if entry.clicked() {
                            question.text = path;
                            field.request_focus();
                            break;
                        }
                    }
                });
            ui.horizontal(|ui| {
                is_done |= ui.button(question.purpose.verb()).clicked();
                is_cancelled = ui.button("Cancel").clicked();
            });
        });
    let path = question.text.trim().to_owned();
    // Enter on a folder goes on in it.
    let is_answer = !path.is_empty() && !Path::new(&path).is_dir();
    if is_done && is_answer {
        answer(app, context, question.purpose, path);
    } else if is_open && !is_cancelled {
        if is_done {
            question.is_focused = false;
        }
        app.asks_path = Some(question);
    }
}

fn answer(app: &mut App, context: &Context, purpose: Purpose, path: String) {
    match purpose {
        Purpose::Open => app.open(context, path),
        Purpose::Save(what) => app.save_as(context, path.into(), what),
    }
}
