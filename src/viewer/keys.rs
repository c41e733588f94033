//! What keys do; [`super::panels::help`] lists them.

use egui::{Context, Event, FocusDirection, InputState, Key, Modifiers, Popup};

use super::app::{App, WindowCommand, camera_of};
use super::fly_camera::Thrust;
use super::gizmo::KEYS;
use super::panels::paths::Purpose;
use super::save_files::Saved;
use super::zoom::Zoom;
use crate::scene::edit::Document;

/// Keys of views that are kept: with Ctrl and Shift to keep one, with Ctrl to go there.
const BOOKMARKS: [Key; 5] = [Key::Num1, Key::Num2, Key::Num3, Key::Num4, Key::Num5];

impl App {
    /// Goes to a view that was kept.
    pub(super) fn go_to_bookmark(&mut self, context: &Context, slot: usize) {
        match self.bookmarks.get(slot).copied().flatten() {
            Some(camera) => {
                self.leave_recording();
                self.camera = camera;
            }
            None => {
                let text = format!("no view {} is kept: Ctrl+Shift+{0} keeps one", slot + 1);
                self.say(context, text, false);
            }
        }
    }

    /// Answers keys that were pressed. What a text field takes is left to it.
    pub(super) fn answer_keys(&mut self, context: &Context) {
        // Before anything takes the events.
        context.input(|input| note_commanding(input, &mut self.fields.commanding));
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
        let command = Modifiers::COMMAND;
        let shifted = Modifiers::COMMAND | Modifiers::SHIFT;
        if context.input_mut(|input| input.consume_key(command, Key::Q)) {
            self.request_quit();
        }
        if context.input_mut(|input| input.consume_key(command, Key::O)) {
            self.ask_path(Purpose::Open);
        }
        if context.input_mut(|input| input.consume_key(shifted, Key::S)) {
            self.ask_path(Purpose::Save(Saved::Scene));
        } else if context.input_mut(|input| input.consume_key(command, Key::S)) {
            self.save(context, Saved::Scene);
        }
        self.answer_escape(context);
        // What follows belongs to a widget that has the keyboard.
        if self.scene_has_keys(context) {
            self.answer_scene_keys(context);
        }
    }

    /// Whether keys are meant for the scene: no widget has the keyboard, no menu is open, nothing is asked.
    pub(super) fn scene_has_keys(&self, context: &Context) -> bool {
        context.memory(|memory| memory.focused().is_none())
            && !Popup::is_any_open(context)
            && self.asks_path.is_none()
            && self.asks.is_none()
    }

    /// Esc closes what is on top, and never quits.
    fn answer_escape(&mut self, context: &Context) {
        // egui closes its menus itself.
        if Popup::is_any_open(context)
            || !context.input_mut(|input| input.consume_key(Modifiers::NONE, Key::Escape))
        {
            return;
        }
        if self.asks.take().is_some() || self.asks_path.take().is_some() {
            // What was asked is over.
        } else if self.fields.had_text {
            // The field has lost the keyboard by it.
        } else if self.shows_help {
            self.shows_help = false;
        } else if self.shows_log {
            self.shows_log = false;
        } else if self.messages.iter().any(|message| message.is_error) {
            self.messages.retain(|message| !message.is_error);
        } else if self.loading.is_some() {
            self.cancel_loading();
            self.say(context, "reading was cancelled", false);
        } else if self.hides_panels {
            self.hides_panels = false;
        } else if self.zoom.is_on() {
            self.zoom = Zoom::default();
        } else if self.selected.last().is_some() {
            self.selected.set(None);
        } else if !self.is_stopped {
            self.stop();
            self.say(context, "stopped; any change goes on", false);
        }
    }

    fn answer_scene_keys(&mut self, context: &Context) {
        let command = Modifiers::COMMAND;
        let shifted = Modifiers::COMMAND | Modifiers::SHIFT;
        // On a slow adapter several presses fall into one pass.
        let count =
            |modifiers, key| context.input_mut(|input| input.count_and_consume_key(modifiers, key));
        for _ in 0..count(shifted, Key::Z) + count(command, Key::Y) {
            self.step(context, Document::redo);
        }
        for _ in 0..count(command, Key::Z) {
            self.step(context, Document::undo);
        }
        if context.input_mut(|input| input.consume_key(Modifiers::NONE, Key::T)) {
            self.screenshot();
        }
        if context.input_mut(|input| input.consume_key(Modifiers::NONE, Key::F)) {
            self.focus_selected();
        }
        if context.input_mut(|input| input.consume_key(Modifiers::NONE, Key::Home)) {
            self.leave_recording();
            self.camera = camera_of(&self.document);
        }
        let hides = context.input_mut(|input| {
            input.consume_key(command, Key::Space) || input.consume_key(Modifiers::NONE, Key::Tab)
        });
        if hides {
            // Tab would go to the first field.
            context.memory_mut(|memory| memory.move_focus(FocusDirection::None));
            self.hides_panels = !self.hides_panels;
        }
        for (key, factor) in [(Key::OpenBracket, 0.5), (Key::CloseBracket, 2.0)] {
            for _ in 0..count(Modifiers::NONE, key) {
                self.camera.change_speed(factor);
            }
        }
        for (slot, key) in BOOKMARKS.into_iter().enumerate() {
            if context.input_mut(|input| consume_digit(input, shifted, key)) {
                self.bookmarks[slot] = Some(self.camera);
                self.say(
                    context,
                    format!("view {} kept: Ctrl+{0} goes there", slot + 1),
                    false,
                );
            } else if context.input_mut(|input| consume_digit(input, command, key)) {
                self.go_to_bookmark(context, slot);
            }
        }
        for (key, mode) in KEYS {
            if context.input_mut(|input| input.consume_key(Modifiers::NONE, key)) {
                self.gizmo.mode = mode;
            }
        }
        if context.input_mut(|input| input.consume_key(Modifiers::NONE, Key::Delete)) {
            self.delete_selected(context);
        }
        if context.input_mut(|input| input.consume_key(command, Key::D)) {
            self.duplicate_selected(context);
        }
        if let Some(player) = &mut self.player {
            if context.input_mut(|input| input.consume_key(Modifiers::NONE, Key::Space)) {
                player.is_playing = !player.is_playing;
            }
            for (key, frames) in [(Key::Comma, -1), (Key::Period, 1)] {
                for _ in 0..count(Modifiers::NONE, key) {
                    player.step(frames);
                }
            }
        } else if context.input_mut(|input| input.consume_key(Modifiers::NONE, Key::Space)) {
            self.clock.is_playing = !self.clock.is_playing;
        }
    }
}

/// Whether a key has been pressed, by what it means or by where it lies: with Shift, digits mean other things on most
/// keyboards.
fn consume_digit(input: &mut InputState, modifiers: Modifiers, digit: Key) -> bool {
    let count = input.events.len();
    input.events.retain(|event| {
        !matches!(event, Event::Key { key, physical_key, pressed: true, modifiers: held, .. }
            if (*key == digit || *physical_key == Some(digit)) && held.matches_logically(modifiers))
    });
    input.events.len() < count
}

/// Keeps in `commanding` the keys that went down with Ctrl and are not up again.
fn note_commanding(input: &InputState, commanding: &mut Vec<Key>) {
    for event in &input.events {
        if let Event::Key {
            key,
            pressed,
            repeat: false,
            modifiers,
            ..
        } = event
        {
            commanding.retain(|known| known != key);
            if *pressed && modifiers.command {
                commanding.push(*key);
            }
        }
    }
}

/// Movement keys as they are held, but for those that are `commanding`.
pub(super) fn held(context: &Context, commanding: &[Key]) -> Thrust {
    context.input(|input| {
        let is_down = |key| input.key_down(key) && !commanding.contains(&key);
        let axis =
            |plus: Key, minus: Key| f64::from(i8::from(is_down(plus)) - i8::from(is_down(minus)));
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
