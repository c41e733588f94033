//! Actions of an application's own: what the wearer means, by name, whatever controller is in the hand.
//!
//! An application declares names and kinds and suggests what drives them per interaction profile ([`Actions`], in code or
//! TOML); the runtime, or the wearer in its menus, has the last word. Values come with each frame ([`ActionValues`]) and are
//! recorded. Simulated hands hold Touch controllers: an action does there what the bindings for those say.
//!
//! ```toml
//! locomotion = false           # the program's own walking and turning are dropped; may be left out
//! [[action]]
//! name = "take"
//! kind = "bool"                # bool, float, vec2, pose, haptic
//! [action.bindings]
//! "/interaction_profiles/oculus/touch_controller" = ["/user/hand/right/input/trigger/value"]
//! "/interaction_profiles/khr/simple_controller" = ["/user/hand/right/input/select/click"]
//! ```

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;
use thiserror::Error;
use toml::Spanned;

use super::profiles::PROFILES;
use super::{InputError, toml_files};
use stereolux_base::printable::{did_you_mean, line};

/// Longest name that OpenXR takes, bytes.
const LONGEST_NAME: usize = 63;

stereolux_base::words! {
    /// What an action's value is.
    #[derive(Deserialize)]
    #[serde(rename_all = "lowercase")]
    pub enum ActionKind: word {
        /// Held or not.
        Bool = "bool",
        /// -1 to 1; triggers from 0.
        Float = "float",
        /// Right and forward, each -1 to 1.
        Vec2 = "vec2",
        /// A place that is tracked, or is not.
        Pose = "pose",
        /// A vibration; it has no value (`World::vibrate_action`).
        Haptic = "haptic",
    }
}

/// A declared action.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Action {
    pub(super) name: String,
    pub(super) kind: ActionKind,
    /// Interaction profile and source, as OpenXR names them.
    pub(super) bindings: Vec<(&'static str, String)>,
}

/// The actions that an application declares; none by default.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Actions {
    declared: Vec<Action>,
    drops_locomotion: bool,
}

/// An action that cannot be declared, or is asked for as what it is not; one line.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{}", line(.0))]
pub struct ActionError(pub(super) String);

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    locomotion: Option<bool>,
    #[serde(default)]
    action: Vec<Spanned<Declaration>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Declaration {
    name: String,
    kind: ActionKind,
    #[serde(default)]
    bindings: BTreeMap<String, Vec<String>>,
}

impl Actions {
    /// With one more action. `bindings`: interaction profile and source of each, as OpenXR names them.
    ///
    /// # Errors
    /// A name that is taken or that OpenXR does not allow, an unknown profile, a malformed path, or one of another kind.
    pub fn with(
        mut self,
        name: &str,
        kind: ActionKind,
        bindings: &[(&str, &str)],
    ) -> Result<Self, ActionError> {
        let added = self.add(name, kind, bindings.iter().copied());
        added.map_err(|(field, what)| ActionError(format!("action '{name}', {field}: {what}")))?;
        Ok(self)
    }

    /// Without the program's own walking and turning: their sources are the application's alone.
    #[must_use]
    pub fn without_locomotion(mut self) -> Self {
        self.drops_locomotion = true;
        self
    }

    /// Reads a declaration from a file.
    ///
    /// # Errors
    /// An unreadable file, or the first fault in it, with file, line and field.
    pub fn load(path: &Path) -> Result<Self, InputError> {
        let (name, text) = toml_files::read(path, "declaration of actions")?;
        Self::parse(&name, &text)
    }

    /// As [`Actions::load`], from text; `file` names it in errors.
    ///
    /// # Errors
    /// The first fault, with file, line and field.
    pub fn parse(file: &str, text: &str) -> Result<Self, InputError> {
        let read: File = toml_files::parsed(file, text)?;
        let mut actions = Self {
            drops_locomotion: read.locomotion == Some(false),
            ..Self::default()
        };
        for action in &read.action {
            let Declaration {
                name,
                kind,
                bindings,
            } = action.get_ref();
            let sources = bindings.iter().flat_map(|(profile, sources)| {
                let sources = sources.iter();
                sources.map(|source| (profile.as_str(), source.as_str()))
            });
            let added = actions.add(name, *kind, sources);
            added.map_err(|(field, what)| {
                let line = toml_files::line_at(text, action.span().start);
                InputError::field(file, line, field, what)
            })?;
        }
        Ok(actions)
    }

    /// All of them, in the order in which they were declared.
    #[must_use]
    pub fn declared(&self) -> &[Action] {
        &self.declared
    }

    /// Whether the program's own walking and turning are dropped.
    #[must_use]
    pub fn drops_locomotion(&self) -> bool {
        self.drops_locomotion
    }

    /// Whether an action of that name and kind is declared.
    ///
    /// # Errors
    /// It is not, or is of another kind.
    pub fn known(&self, name: &str, kind: ActionKind) -> Result<(), ActionError> {
        let found = self.declared.iter().find(|action| action.name == name);
        match found {
            Some(action) if action.kind == kind => Ok(()),
            Some(action) => Err(wrong_kind(name, action.kind.word(), kind)),
            None => {
                let names = self.declared.iter().map(|action| action.name.as_str());
                Err(unknown(name, names))
            }
        }
    }

    /// Adds an action; the field and what is wrong with it.
    fn add<'a>(
        &mut self,
        name: &str,
        kind: ActionKind,
        sources: impl Iterator<Item = (&'a str, &'a str)>,
    ) -> Result<(), (&'static str, String)> {
        let is_plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || "-_.".contains(c);
        if name.is_empty() || name.len() > LONGEST_NAME || !name.chars().all(is_plain) {
            let what = format!(
                "'{name}' is not 1 to {LONGEST_NAME} of a to z, 0 to 9, '-', '_' and '.', of which OpenXR makes names"
            );
            return Err(("name", what));
        }
        if self.declared.iter().any(|known| known.name == name) {
            let what = format!("'{name}' is declared twice; names tell actions apart");
            return Err(("name", what));
        }
        let bindings = sources.map(|(profile, source)| {
            let known = PROFILES.iter().find(|known| known.path == profile);
            let Some(known) = known else {
                let hint = did_you_mean(profile, PROFILES.iter().map(|known| known.path));
                return Err(format!(
                    "'{profile}' is no interaction profile known here{hint}"
                ));
            };
            check_source(source, kind)?;
            Ok((known.path, source.to_owned()))
        });
        let bindings = bindings.collect::<Result<Vec<_>, _>>();
        let bindings = bindings.map_err(|what| ("bindings", what))?;
        if bindings.is_empty() {
            let what = format!("'{name}' has none; suggest at least one source for one profile");
            return Err(("bindings", what));
        }
        self.declared.push(Action {
            name: name.to_owned(),
            kind,
            bindings,
        });
        Ok(())
    }
}

/// Whether a source is well formed and can drive an action of that kind.
fn check_source(source: &str, kind: ActionKind) -> Result<(), String> {
    let is_plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
    let parts: Vec<&str> = source.split('/').collect();
    let is_whole = matches!(
        parts[..],
        [
            "",
            "user",
            "hand",
            "left" | "right",
            "input" | "output",
            _,
            ..
        ]
    );
    if !is_whole
        || !parts[1..]
            .iter()
            .all(|part| !part.is_empty() && part.chars().all(is_plain))
    {
        return Err(format!(
            "'{source}' is no path like /user/hand/right/input/trigger/value"
        ));
    }
    let fits = match kind {
        ActionKind::Haptic => parts[4] == "output",
        ActionKind::Pose => parts[4] == "input" && source.ends_with("/pose"),
        _ => parts[4] == "input" && !source.ends_with("/pose"),
    };
    if fits {
        return Ok(());
    }
    let wanted = match kind {
        ActionKind::Haptic => "/user/hand/right/output/haptic",
        ActionKind::Pose => "/user/hand/right/input/grip/pose",
        _ => "/user/hand/right/input/trigger/value",
    };
    let kind = kind.word();
    Err(format!(
        "'{source}' cannot drive an action of kind {kind}; one like {wanted} can"
    ))
}

/// An action that was not declared.
pub(super) fn unknown<'a>(name: &str, names: impl Iterator<Item = &'a str>) -> ActionError {
    let hint = did_you_mean(name, names);
    ActionError(format!("no action '{name}' is declared{hint}"))
}

/// An action that is of another kind.
pub(super) fn wrong_kind(name: &str, is: &str, wanted: ActionKind) -> ActionError {
    let wanted = wanted.word();
    ActionError(format!("action '{name}' is of kind {is}, not {wanted}"))
}
