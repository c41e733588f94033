//! What concerns several flags together, and the settings that they make.

use super::cli::{
    BenchOptions, InfoOptions, LayerArgs, Options, RunOptions, SessionChoice, SessionOptions,
    Suite, TraceOptions,
};
use super::layers::Layers;
use super::{OptionsError, quoted};
use crate::settings::Light;

impl Options {
    /// Checks the flags as a whole, and fills the settings in.
    ///
    /// # Errors
    /// [`OptionsError`], one line.
    pub(super) fn check(&mut self) -> Result<(), OptionsError> {
        match self {
            Self::Run(options) => options.check()?,
            Self::Render(options) => {
                let layers = options.shared.layers.read()?;
                options.names_headset = layers.is_set("headset");
                options.settings = layers.finish()?;
            }
            Self::Compare(options) => options.limits = options.layers.read()?.finish()?.limits,
            Self::Bench(options) => options.check()?,
            Self::Info(options) => options.check()?,
            Self::Settings(_) | Self::Merge(_) | Self::New(_) => {}
            Self::View(options) => {
                let layers = options.shared.layers.read()?;
                let lights = layers.is_set("light");
                options.settings = layers.finish()?;
                if !lights {
                    options.settings.light = Light::Auto;
                }
                options.recording.check()?;
            }
        }
        Ok(())
    }
}

impl<const FLAGS: usize> LayerArgs<FLAGS> {
    fn read(&self) -> Result<Layers, OptionsError> {
        let mut layers = Layers::default();
        if let Some(path) = &self.config {
            layers.add_file(path)?;
        }
        for argument in &self.set {
            layers.add_set(argument)?;
        }
        self.flags.put_on(&mut layers)?;
        Ok(layers)
    }
}

impl RunOptions {
    fn check(&mut self) -> Result<(), OptionsError> {
        let mut layers = self.shared.layers.read()?;
        self.session.flags.put_on(&mut layers)?;
        self.session.check()?;
        self.names_reuse = layers.is_set("reuse");
        self.settings = layers.finish()?;
        Ok(())
    }
}

impl SessionOptions {
    fn check(&mut self) -> Result<(), OptionsError> {
        let conflict = |text: &str| Err(OptionsError::Conflict(text.to_owned()));
        self.choice = match (self.choice, self.recording.trace.is_some()) {
            (SessionChoice::Auto, true) => SessionChoice::Replay,
            (SessionChoice::Replay, false) => {
                return conflict("--session replay needs a recording; add --trace FILE");
            }
            (SessionChoice::Simulated, true) => {
                return conflict(
                    "--trace and --session simulated exclude each other; give --session replay or leave one out",
                );
            }
            (SessionChoice::Desktop, true) => {
                return conflict(
                    "--trace and --session desktop exclude each other; give --session replay or leave one out",
                );
            }
            (SessionChoice::Openxr, true) => {
                return conflict(
                    "--trace and --session openxr exclude each other; give --session replay or leave one out",
                );
            }
            (chosen, _) => chosen,
        };
        if self.flags.has("--motion")
            && matches!(
                self.choice,
                SessionChoice::Replay | SessionChoice::Openxr | SessionChoice::Desktop
            )
        {
            return conflict(
                "--motion moves the simulated headset; give --session simulated or leave --motion out",
            );
        }
        if self.pose.is_some() && self.recording.trace_recenter == Some(false) {
            return conflict(
                "--pose is where a recording starts, and --trace-recenter=false leaves it where it is; leave one out",
            );
        }
        if let Some(range) = &self.range {
            if self.choice == SessionChoice::Desktop {
                return conflict(
                    "--range cuts a recording or a simulation; a window shows every frame, leave it out",
                );
            }
            if self.choice == SessionChoice::Openxr {
                return conflict(
                    "--range cuts a recording or a simulation; an OpenXR runtime shows every frame, leave it out",
                );
            }
            if self.record.is_some() {
                return conflict(
                    "--range renders some frames and --record writes down all; leave one out",
                );
            }
            if self.choice == SessionChoice::Auto {
                // Not a headset that happens to be there.
                self.choice = SessionChoice::Simulated;
            }
            self.frames.get_or_insert(range.end);
        } else if self.warm_up != 0 {
            return conflict("--warm-up is for --range; leave it out, or say which range");
        }
        if self.realtime && self.choice == SessionChoice::Openxr {
            return conflict(
                "--realtime paces replay and simulation; an OpenXR runtime sets its own pace, leave it out",
            );
        }
        self.recording.check()?;
        match (&self.record, &self.recording.trace) {
            (Some(record), Some(trace)) if record == trace => Err(OptionsError::Conflict(format!(
                "--record {} is the file that --trace reads; give --record another name",
                quoted(&record.to_string_lossy())
            ))),
            _ => Ok(()),
        }
    }
}

impl TraceOptions {
    fn check(&self) -> Result<(), OptionsError> {
        let given = [
            (self.trace_up.is_some(), "--trace-up"),
            (self.trace_body.is_some(), "--trace-body"),
            (self.trace_recenter.is_some(), "--trace-recenter"),
        ];
        match given.iter().find(|(is_given, _)| *is_given) {
            Some((_, flag)) if self.trace.is_none() => Err(OptionsError::Conflict(format!(
                "{flag} needs a recording to apply to; add --trace FILE"
            ))),
            _ => Ok(()),
        }
    }
}

impl BenchOptions {
    fn check(&mut self) -> Result<(), OptionsError> {
        let layers = self.layers.read()?;
        let is_named = layers.is_set("scene");
        let names_headset = layers.is_set("headset");
        self.settings = layers.finish()?;
        if self.suite == Suite::Work && !names_headset {
            self.settings.headset = "quest3".to_owned();
        }
        if self.suite == Suite::Motion && self.shard.is_some() {
            return Err(OptionsError::Conflict(
                "bench motion has no parts; leave --shard out, or share out its scenes".to_owned(),
            ));
        }
        let of_others = [
            (self.rounds.is_some(), "--rounds"),
            (self.frames.is_some(), "--frames"),
            (self.reference_spp.is_some(), "--reference-spp"),
            (self.references.is_some(), "--references"),
            (self.shard.is_some(), "--shard"),
        ];
        if let Some((_, flag)) = of_others.iter().find(|(is_given, _)| *is_given)
            && self.suite == Suite::Work
        {
            return Err(OptionsError::Conflict(format!(
                "bench work counts one frame of each scene and method; leave {flag} out"
            )));
        }
        if self.scenes.is_empty() && is_named {
            // A scene from --set or the config file is the one to measure, too.
            self.scenes.push(self.settings.scene.clone());
        }
        Ok(())
    }
}

impl InfoOptions {
    fn check(&mut self) -> Result<(), OptionsError> {
        let layers = self.layers.read()?;
        self.names_scene = layers.is_set("scene");
        self.settings = layers.finish()?;
        Ok(())
    }
}
