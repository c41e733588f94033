//! Files that are read while the window goes on.

use std::path::Path;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::Instant;

use super::session::Recording;
use crate::limits::LoadBudget;
use crate::scene::builtin::PREFIX;
use crate::scene::{Environment, SceneError, load_environment_within};
use crate::scene_loading::LoadedDocument;
use crate::settings::{EnvironmentSettings, Settings};
use crate::xr::{Headset, Pose, ReplayOptions, ReplaySession, Validated};

/// What was in the file.
pub enum Loaded {
    /// A scene, lit as the settings say.
    Scene(Box<LoadedDocument>),
    /// Surroundings, and the settings that they were read by.
    Environment(Box<Environment>, EnvironmentSettings),
    /// Head motion.
    Trace(Box<Recording>),
}

/// Why nothing was read.
pub struct Refused {
    /// One line.
    pub text: String,
    /// It names files outside its own folder: a person who trusts it may read it all the same.
    pub names_outside: bool,
}

impl From<String> for Refused {
    fn from(text: String) -> Self {
        Self {
            text,
            names_outside: false,
        }
    }
}

/// A file that is being read. Dropping it cancels: the thread's result is thrown away.
pub struct Loading {
    name: String,
    kind: Kind,
    since: Instant,
    /// Changes that are not saved may be lost when it is there.
    pub(super) may_lose_edits: bool,
    result: Receiver<Result<Loaded, Refused>>,
}

impl Loading {
    /// Begins to read `spec`, which holds what `kind` says. Environments are read as strong as `settings` say. `is_auto_lit`: as
    /// [`LoadedDocument::open`] takes it.
    ///
    /// # Errors
    /// One line: the system refuses a thread.
    pub fn begin(
        kind: Kind,
        spec: String,
        settings: &Settings,
        is_auto_lit: bool,
        headset: &Headset,
        start: Pose,
    ) -> Result<Self, String> {
        let (settings, headset, path) = (settings.clone(), headset.clone(), spec.clone());
        let (sender, result) = channel();
        std::thread::Builder::new()
            .name("loading".to_owned())
            .spawn(move || {
                let loaded = crate::foreign_errors::caught(|| {
                    read(kind, &path, &settings, is_auto_lit, headset, start)
                })
                .unwrap_or_else(|panicked| {
                    let text =
                        format!("{path}: reading it failed ({panicked}); please report the file");
                    Err(text.into())
                });
                // Cancelled: nobody waits.
                let _ = sender.send(loaded);
            })
            .map_err(|error| format!("{spec}: no thread to read it ({error})"))?;
        Ok(Self {
            name: spec,
            kind,
            since: Instant::now(),
            may_lose_edits: false,
            result,
        })
    }

    /// What is in it.
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// What is read.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Seconds since it began.
    pub fn seconds(&self) -> f64 {
        self.since.elapsed().as_secs_f64()
    }

    /// The result, once it is there. One line if it failed.
    pub fn poll(&self) -> Option<Result<Loaded, Refused>> {
        match self.result.try_recv() {
            Ok(loaded) => Some(loaded),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => {
                Some(Err(format!("{}: reading it failed", self.name).into()))
            }
        }
    }
}

/// What a file holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A scene.
    Scene,
    /// Surroundings.
    Environment,
    /// Head motion.
    Trace,
}

impl Kind {
    /// What a file holds, by the end of its name.
    pub fn of_file(path: &Path) -> Option<Self> {
        match path.extension()?.to_string_lossy().to_lowercase().as_str() {
            "glb" | "gltf" => Some(Self::Scene),
            "hdr" | "exr" => Some(Self::Environment),
            "jsonl" | "csv" | "txt" | "tum" => Some(Self::Trace),
            _ => None,
        }
    }

    /// What a file that somebody opens holds, by its name: `.gltf`, `.glb` and `builtin:NAME` are scenes.
    ///
    /// # Errors
    /// One line: the name says that nothing of use is in it.
    pub fn of(spec: &str) -> Result<Self, String> {
        if spec.starts_with(PREFIX) {
            return Ok(Self::Scene);
        }
        Self::of_file(Path::new(spec)).ok_or_else(|| {
            format!(
                "{spec}: is no scene (.gltf, .glb), environment (.hdr, .exr) or recording (.jsonl, .csv, .txt)"
            )
        })
    }
}

fn read(
    kind: Kind,
    path: &str,
    settings: &Settings,
    is_auto_lit: bool,
    headset: Headset,
    start: Pose,
) -> Result<Loaded, Refused> {
    let line = |error: &dyn std::fmt::Display| Refused::from(error.to_string());
    let budget = LoadBudget::new(settings.limits.load());
    let strength = settings.environment.strength as f32;
    match kind {
        Kind::Scene => {
            let settings = Settings {
                scene: path.to_owned(),
                ..settings.clone()
            };
            let loaded = LoadedDocument::open(&settings, is_auto_lit).map_err(|error| Refused {
                names_outside: matches!(error, SceneError::Outside { .. }),
                ..line(&error)
            })?;
            Ok(Loaded::Scene(Box::new(loaded)))
        }
        Kind::Environment => {
            let (environment, warnings) =
                load_environment_within(path, strength, &budget).map_err(|error| line(&error))?;
            for warning in warnings {
                log::warn!("{warning}");
            }
            Ok(Loaded::Environment(
                Box::new(environment),
                settings.environment.clone(),
            ))
        }
        Kind::Trace => {
            let options = ReplayOptions::new(headset, start);
            let session =
                ReplaySession::open(Path::new(path), options).map_err(|error| line(&error))?;
            let recording =
                Recording::of(&mut Validated::new(session)).map_err(|error| line(&error))?;
            Ok(Loaded::Trace(Box::new(recording)))
        }
    }
}
