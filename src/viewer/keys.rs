//! What keys do; [`super::panels::help`] lists them.

use egui::{Context, Key, Modifiers};

use super::app::{App, WindowCommand, camera_of};
use super::fly_camera::Thrust;
use super::gizmo::KEYS;
use crate::scene::edit::Edit;

impl App {
    /// Answers keys that were pressed. What a text field takes is left to it.
    pub(super) fn answer_keys(&mut self, context: &Context) {
        if context.input_mut(|input| input.consume_key(Modifiers::NONE, Key::F1)) {
            self.shows_help = !self.shows_help;
        }
        if context.input_mut(|input| input.consume_key(Modifiers::NONE, Key::F5)) {
            self.reload_shaders();
        }
        if context.input_mut(|input| input.consume_key(Modifiers::NONE, Key::F11)) {
            self.command(WindowCommand::ToggleFullScreen);
        }
        if context.input_mut(|input| input.consume_key(Modifiers::NONE, Key::F12)) {
            self.screenshot();
        }
        // Letters belong to a text field that has the keyboard.
        if context.text_edit_focused() {
            return;
        }
        let command = Modifiers::COMMAND;
        let shifted = Modifiers::COMMAND | Modifiers::SHIFT;
        if context.input_mut(|input| {
            input.consume_key(shifted, Key::Z) || input.consume_key(command, Key::Y)
        }) {
            self.redo(context);
        } else if context.input_mut(|input| input.consume_key(command, Key::Z)) {
            self.undo(context);
        }
        if context.input_mut(|input| input.consume_key(command, Key::S)) {
            self.save_scene(context);
        }
        if context.input_mut(|input| input.consume_key(Modifiers::NONE, Key::Escape)) {
            if self.shows_help {
                self.shows_help = false;
            } else if self.asks_to_quit {
                self.asks_to_quit = false;
            } else if self.asks_outside.take().is_some() {
            } else if self.loading.is_some() {
                self.cancel_loading();
                self.say(context, "reading was cancelled", false);
            } else if self.selected.is_some() {
                self.selected = None;
            } else {
                self.request_quit();
            }
        }
        if context.input_mut(|input| input.consume_key(Modifiers::NONE, Key::T)) {
            self.screenshot();
        }
        if context.input_mut(|input| input.consume_key(Modifiers::NONE, Key::F)) {
            self.focus_selected();
        }
        if context.input_mut(|input| input.consume_key(Modifiers::NONE, Key::Home)) {
            self.camera = camera_of(&self.document);
            self.player = None;
        }
        for (key, mode) in KEYS {
            if context.input_mut(|input| input.consume_key(Modifiers::NONE, key)) {
                self.gizmo.mode = mode;
            }
        }
        if context.input_mut(|input| input.consume_key(Modifiers::NONE, Key::Delete))
            && let Some(node) = self.selected
        {
            self.edit(context, Edit::Delete { node });
            self.forget_missing();
        }
        if context.input_mut(|input| input.consume_key(command, Key::D))
            && let Some(node) = self.selected
        {
            let copy = self.document.scene().nodes.len();
            self.edit(context, Edit::Duplicate { node });
            if self.document.scene().nodes.len() > copy {
                self.selected = Some(copy);
            }
        }
        if let Some(player) = &mut self.player {
            if context.input_mut(|input| input.consume_key(Modifiers::NONE, Key::Space)) {
                player.is_playing = !player.is_playing;
            }
            for (key, frames) in [(Key::Comma, -1), (Key::Period, 1)] {
                if context.input_mut(|input| input.consume_key(Modifiers::NONE, key)) {
                    player.step(frames);
                }
            }
        } else if context.input_mut(|input| input.consume_key(Modifiers::NONE, Key::Space)) {
            self.clock.is_playing = !self.clock.is_playing;
        }
    }
}

/// Movement keys as they are held.
pub(super) fn held(context: &Context) -> Thrust {
    context.input(|input| {
        let axis = |plus: Key, minus: Key| {
            f64::from(i8::from(input.key_down(plus)) - i8::from(input.key_down(minus)))
        };
        if input.modifiers.command {
            // Ctrl and a letter is a command.
            return Thrust::default();
        }
        Thrust {
            right: axis(Key::D, Key::A),
            up: axis(Key::E, Key::Q),
            ahead: axis(Key::W, Key::S),
            runs: input.modifiers.shift,
            is_slow: input.modifiers.alt,
        }
    })
}
