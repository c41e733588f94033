//! F1: what keys and mouse do.

use egui::{Align2, Context, Grid, RichText, ScrollArea, Window};

use crate::viewer::app::App;

/// Keys, and what they do.
pub const KEYS: &[(&str, &str)] = &[
    ("drag", "look around"),
    ("W A S D, Q E", "walk; down and up"),
    ("Shift, Alt", "run, slow"),
    ("wheel", "move along the gaze"),
    ("Ctrl + wheel, drag", "enlarge the picture, shift it"),
    ("click", "select what is under the pointer"),
    (
        "Ctrl or Shift + click",
        "add to what is selected, take away",
    ),
    ("F", "look at what is selected"),
    ("1 2 3", "handles: move, turn, scale (Ctrl snaps)"),
    ("Delete, Ctrl+D", "delete, duplicate what is selected"),
    ("Ctrl+Z, Ctrl+Shift+Z", "undo, redo"),
    ("middle drag", "go around what is under the pointer"),
    ("Shift, Ctrl + middle drag", "shift the view; near and far"),
    ("Ctrl+O", "open a file"),
    ("Ctrl+S, Ctrl+Shift+S", "save the scene as glTF; as another"),
    ("Tab, Ctrl+Space", "hide all panels"),
    ("[ ]", "walk slower, faster"),
    ("Ctrl+Shift+1 to 5, Ctrl+1 to 5", "keep a view, go to it"),
    ("Ctrl+Q", "quit"),
    (
        "Space",
        "play or pause a recording or the scene's animation",
    ),
    (", .", "one frame back, on"),
    ("Home", "back to the scene's first view"),
    (
        "T, F12",
        "screenshot: PNG, and EXR of each eye that is shown",
    ),
    ("F1", "this help"),
    ("F5", "read the shaders again"),
    ("F11", "full screen"),
    ("Esc", "close, cancel, show all, deselect, stop refining"),
    ("drop a file", "open .glb, .gltf, .hdr, .exr or a recording"),
];

/// What the window needs above and below the list, points.
const FRAME_HEIGHT: f32 = 60.0;

/// The overlay, if it is wanted.
pub fn show(app: &mut App, context: &Context) {
    let mut is_open = app.shows_help;
    Window::new("Keys and mouse")
        .open(&mut is_open)
        .anchor(Align2::CENTER_CENTER, [0.0, 0.0])
        .auto_sized()
        .collapsible(false)
        .show(context, |ui| {
            // In a low window the list is scrolled, so that title and close button stay on the screen.
            let height = (context.content_rect().height() - FRAME_HEIGHT).max(0.0);
            ScrollArea::vertical()
                .max_height(height)
                .min_scrolled_height(height)
                .show(ui, |ui| {
                    Grid::new("keys").spacing([24.0, 4.0]).show(ui, |ui| {
                        for (keys, what) in KEYS {
                            ui.label(RichText::new(*keys).monospace().strong());
                            ui.label(*what);
                            ui.end_row();
                        }
                    });
                });
        });
    app.shows_help = is_open;
}
