//! One pass of egui over the [`App`], so that a test can drive it without a display.

use egui::{Context, Ui};

use super::app::{App, Message};
use super::fly_camera::Thrust;
use super::{keys, panels, picture, question};

/// Seconds that a message stays; errors stay until they are closed.
const MESSAGE_SECONDS: f64 = 6.0;

impl App {
    /// One pass over the window's contents.
    pub fn ui(&mut self, ui: &mut Ui) {
        let context = ui.ctx().clone();
        self.take_reports(&context);
        self.take_loaded(&context);
        self.take_dropped(&context);
        self.follow_environment(&context);
        self.answer_keys(&context);
        if !self.hides_panels {
            panels::menu::show(self, ui);
            panels::statistics::show(self, ui);
            panels::hierarchy::show(self, ui);
            panels::right(self, ui);
        }
        picture::show(self, ui);
        panels::paths::show(self, &context);
        panels::help::show(self, &context);
        panels::log(self, &context);
        self.show_messages(&context);
        question::show(self, &context);
        self.advance(&context);
        self.send();
        self.fields.had_text = context.text_edit_focused();
    }

    /// Lets time pass: keys that are held move the head, clocks run.
    fn advance(&mut self, context: &Context) {
        // A window that slept does not make up for it.
        let seconds = f64::from(context.input(|input| input.stable_dt)).min(0.1);
        let mut thrust = if self.scene_has_keys(context) {
            keys::held(context, &self.fields.commanding)
        } else {
            Thrust::default()
        };
        let pad = self.gamepad.poll();
        let (stick, look) = pad.unwrap_or_default();
        thrust.right += stick.right;
        thrust.up += stick.up;
        thrust.ahead += stick.ahead;
        if thrust.is_some() || look != [0.0; 2] {
            self.take_head();
            self.camera.look(look.map(|rate| rate * seconds));
            self.camera.advance(thrust, seconds);
            context.request_repaint();
        } else if pad.is_some() {
            context.request_repaint_after(std::time::Duration::from_millis(30));
        }
        if let Some(player) = &mut self.player {
            player.advance(seconds);
            if player.is_playing {
                context.request_repaint();
            }
        }
        if self.clock.is_playing && !self.document.scene().animations.is_empty() {
            *self.clock.seconds.get_or_insert(0.0) += seconds;
            context.request_repaint();
        }
    }

    fn show_messages(&mut self, context: &Context) {
        let now = context.time();
        let age = |message: &Message| now - message.since;
        self.messages
            .retain(|message| message.is_error || age(message) < MESSAGE_SECONDS);
        if self.messages.iter().any(|message| !message.is_error) {
            context.request_repaint_after(std::time::Duration::from_secs(1));
        }
        panels::messages(self, context);
    }
}
