//! What becomes of files that are opened or dropped: the scene, its environment, a recording.

use std::path::Path;
use std::sync::Arc;

use egui::Context;

use super::app::{App, SceneClock, camera_of};
use super::fields::Fields;
use super::loading::{Kind, Loaded, Loading};
use super::question::Question;
use super::session::Player;
use super::worker::Request;
use crate::scene::builtin;
use crate::settings::Settings;

impl App {
    /// Metres per unit of scenes that this window has not saved: its settings', unless they are still those of one that it has.
    fn scale_of_others(&self, settings: &Settings) -> f64 {
        let kept = self.other_scale.filter(|_| settings.scene_scale == 1.0);
        kept.unwrap_or(settings.scene_scale)
    }

    pub(super) fn take_loaded(&mut self, context: &Context) {
        let Some(loading) = &self.loading else {
            return;
        };
        // Its end is not announced by an event.
        context.request_repaint_after(std::time::Duration::from_millis(50));
        let Some(loaded) = loading.poll() else {
            return;
        };
        let name = loading.name().to_owned();
        let may_lose_edits = loading.may_lose_edits;
        if loaded.is_err() {
            self.cancel_loading();
        }
        self.loading = None;
        match loaded {
            Err(refused) => {
                if refused.names_outside {
                    self.asks = Some(Question::Outside(name, may_lose_edits));
                }
                self.say(context, refused.text, true);
            }
            // Edited since it was asked for.
            Ok(Loaded::Scene(_)) if self.document.is_modified() && !may_lose_edits => {
                self.asks = Some(Question::Open(name));
            }
            Ok(Loaded::Scene(loaded)) => {
                let (environment, light) = (loaded.settings.environment, loaded.light);
                self.document = loaded.document;
                self.selected.set(None);
                self.history.clear();
                self.clock = SceneClock::default();
                self.camera = camera_of(&self.document);
                self.fields = Fields::new(&self.out, self.document.original());
                let mut settings = (*self.settings).clone();
                settings.scene.clone_from(&name);
                let scale = self.scale_of_others(&settings);
                self.other_scale = self.has_written(Path::new(&name)).then_some(scale);
                settings.scene_scale = loaded.settings.scene_scale;
                settings.environment = environment;
                self.saved_scene = None;
                // Clips have names of their own in each scene.
                settings.render.animation.clip.clear();
                Arc::make_mut(&mut self.other).render.animation.clip.clear();
                self.set_settings(context, settings);
                self.environment = self.settings.environment.clone();
                self.restart_scene();
                self.window_state.remember_file(&name);
                self.is_auto_lit = light.as_ref().is_some_and(|light| light.is_auto);
                let light = light.map_or_else(String::new, |light| format!("; light: {light}"));
                self.say(context, format!("{name} opened{light}"), false);
                for warning in loaded.warnings {
                    log::warn!("{warning}");
                    self.say(context, warning, false);
                }
            }
            Ok(Loaded::Environment(environment, settings)) => {
                self.document.set_environment(Some(*environment));
                // Another strength is no other choice.
                self.is_auto_lit &= settings.path == self.environment.path;
                self.environment = settings;
                self.restart_scene();
                self.window_state.remember_file(&name);
                self.say(context, format!("{name} lights the scene"), false);
            }
            Ok(Loaded::Trace(recording)) => {
                self.player = Some(Player::new(*recording));
                self.window_state.remember_file(&name);
                self.say(context, format!("{name}: play with Space"), false);
            }
        }
    }

    fn restart_scene(&mut self) {
        // What the scene has been through is in it already.
        self.document.take_changes();
        let scene = Box::new(self.document.scene().clone());
        self.ask(Request::Scene(scene));
    }

    pub(super) fn take_dropped(&mut self, context: &Context) {
        let dropped = context.input(|input| input.raw.dropped_files.clone());
        if dropped.len() > 1 {
            self.say(
                context,
                "one file at a time, please: the first is read",
                false,
            );
        }
        if let Some(path) = dropped.first().map(|file| file.path().to_owned()) {
            self.open(context, path.to_string_lossy().into_owned());
        }
    }

    /// Begins to read a scene, an environment or a recording, by its name.
    pub fn open(&mut self, context: &Context, spec: String) {
        self.open_with(context, spec, (*self.settings).clone(), false);
    }

    /// Begins to read a scene, though the one that is open has changes that are not saved.
    pub(super) fn open_in_place(&mut self, context: &Context, spec: String) {
        self.open_with(context, spec, (*self.settings).clone(), true);
    }

    /// Begins to read the scene that was refused for naming files outside its folder, with them.
    pub(super) fn open_with_outside(
        &mut self,
        context: &Context,
        spec: String,
        may_lose_edits: bool,
    ) {
        let mut settings = (*self.settings).clone();
        settings.limits.allow_outside = true;
        self.open_with(context, spec, settings, may_lose_edits);
    }

    fn open_with(
        &mut self,
        context: &Context,
        spec: String,
        mut settings: Settings,
        may_lose_edits: bool,
    ) {
        self.take_written(context);
        self.asks.take_if(|asked| *asked != Question::Quit);
        let kind = match Kind::of(&spec) {
            Ok(kind) => kind,
            Err(error) => return self.say(context, error, true),
        };
        if kind == Kind::Environment {
            // A setting, which `follow_environment` carries out.
            self.cancel_loading();
            let mut settings = (*self.settings).clone();
            settings.environment.path = spec;
            self.set_settings(context, settings);
            return;
        }
        if kind == Kind::Scene && self.document.is_modified() && !may_lose_edits {
            self.asks = Some(Question::Open(spec));
            return;
        }
        // What this window has saved is as large as it was shown.
        if self.has_written(Path::new(&spec)) {
            settings.scene_scale = 1.0;
        } else {
            settings.scene_scale = self.scale_of_others(&settings);
        }
        // A second file takes the place of one that is still being read.
        match Loading::begin(
            kind,
            spec,
            &settings,
            self.is_auto_lit && settings.environment.path == self.environment.path,
            &self.headset,
            self.camera.pose(),
        ) {
            Ok(mut loading) => {
                loading.may_lose_edits = may_lose_edits;
                self.loading = Some(loading);
            }
            Err(error) => self.say(context, error, true),
        }
        context.request_repaint();
    }

    /// Reads the environment that the settings name, if that is another one now.
    pub(super) fn follow_environment(&mut self, context: &Context) {
        let wanted = &self.settings.environment;
        if self.environment == *wanted || self.loading.is_some() {
            return;
        }
        if wanted.path.is_empty() {
            // Embedded scenes have surroundings of their own.
            let own = builtin::environment(&self.settings.scene);
            let own = own.ok().flatten();
            let strength = wanted.strength as f32;
            self.environment = wanted.clone();
            self.is_auto_lit = false;
            self.document
                .set_environment(own.map(|own| own.scaled(strength)));
            self.restart_scene();
            return;
        }
        let path = wanted.path.clone();
        match Loading::begin(
            Kind::Environment,
            path,
            &self.settings,
            self.is_auto_lit,
            &self.headset,
            self.camera.pose(),
        ) {
            Ok(loading) => self.loading = Some(loading),
            Err(error) => {
                self.keep_environment();
                self.say(context, error, true);
            }
        }
    }

    /// The settings name the environment that is shown.
    fn keep_environment(&mut self) {
        let mut settings = (*self.settings).clone();
        settings.environment = self.environment.clone();
        self.settings = Arc::new(settings);
    }

    /// What is being read is not wanted any more.
    pub(super) fn cancel_loading(&mut self) {
        if let Some(loading) = self.loading.take()
            && loading.kind() == Kind::Environment
        {
            self.keep_environment();
        }
    }
}
