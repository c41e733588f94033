//! All action sets of a session: the program's own (switch reuse, quit), walking and turning, the hands, the application's;
//! and what follows fingers and eyes.

use glam::DVec2;
use openxr as xr;

use super::hands::{Asked, Hands};
use super::own_actions::OwnActions;
use super::runtime::{Runtime, RuntimeError, failed, names};
use super::states::{held, stick};
use super::trackers::Trackers;
use crate::actions::Actions;
use crate::profiles::{Drives, PROFILES, Profile};
use crate::{Input, Pulse, PulseOf};

/// What the wearer does in one frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Wishes {
    /// Right and forward, -1 to 1.
    pub(super) walk: DVec2,
    /// Right, -1 to 1.
    pub(super) turn: f64,
    /// The button was pressed since the last frame.
    pub(super) switch_reuse: bool,
    /// The button was pressed since the last frame.
    pub(super) quit: bool,
}

/// Walking and turning.
struct Moves {
    set: xr::ActionSet,
    walk: xr::Action<xr::Vector2f>,
    turn: xr::Action<xr::Vector2f>,
    advance: xr::Action<bool>,
    turn_right: xr::Action<bool>,
}

/// The actions, attached to a session.
pub(super) struct Controls {
    hands: Hands,
    trackers: Trackers,
    own: Option<OwnActions>,
    /// `None`: the wearer neither walks nor turns.
    moves: Option<Moves>,
    set: xr::ActionSet,
    switch_reuse: xr::Action<bool>,
    quit: xr::Action<bool>,
}

impl Moves {
    fn new(instance: &xr::Instance) -> xr::Result<Self> {
        let set = instance.create_action_set("locomotion", "Walking and turning", 0)?;
        Ok(Self {
            walk: set.create_action("walk", "Walk", &[])?,
            turn: set.create_action("turn", "Turn", &[])?,
            advance: set.create_action("advance", "Walk ahead", &[])?,
            turn_right: set.create_action("turn_right", "Turn right", &[])?,
            set,
        })
    }
}

impl Controls {
    /// Makes the actions, suggests bindings for the profiles that the runtime knows, and attaches them. Without `moves`, or
    /// where the application drops them, the wearer neither walks nor turns: the application has the sticks for itself.
    ///
    /// # Errors
    /// [`RuntimeError::Call`]; [`RuntimeError::Binding`]: the runtime does not take what the application suggests.
    pub(super) fn new<G>(
        runtime: &Runtime,
        session: &xr::Session<G>,
        moves: bool,
        actions: &Actions,
    ) -> Result<Self, RuntimeError> {
        let mut controls = Self::make(runtime, session, moves, actions).map_err(in_set)?;
        let used = names(&runtime.used);
        let is_there = |extension: &str| used.iter().any(|name| name == extension);
        for profile in PROFILES {
            if profile.extension.is_none_or(is_there) {
                controls.suggest(&runtime.instance, profile)?;
            }
        }
        session
            .attach_action_sets(&controls.sets())
            .map_err(in_set)?;
        controls.hands.attached(session).map_err(in_set)?;
        controls.trackers.attached(session).map_err(in_set)?;
        if let Some(own) = &mut controls.own {
            own.attached(session).map_err(in_set)?;
        }
        Ok(controls)
    }

    fn make<G>(
        runtime: &Runtime,
        session: &xr::Session<G>,
        moves: bool,
        actions: &Actions,
    ) -> xr::Result<Self> {
        let instance = &runtime.instance;
        let set = instance.create_action_set("stereolux", "stereolux", 0)?;
        let moves = moves && !actions.drops_locomotion();
        Ok(Self {
            hands: Hands::new(instance)?,
            trackers: Trackers::new(runtime, session, &set),
            own: OwnActions::new(instance, actions)?,
            moves: moves.then(|| Moves::new(instance)).transpose()?,
            switch_reuse: set.create_action("switch_reuse", "Switch stereo reuse", &[])?,
            quit: set.create_action("quit", "Quit", &[])?,
            set,
        })
    }

    fn sets(&self) -> Vec<&xr::ActionSet> {
        let moves = self.moves.as_ref().map(|moves| &moves.set);
        let own = self.own.as_ref().map(|own| &own.set);
        let always = [&self.set, &self.hands.set];
        always.into_iter().chain(moves).chain(own).collect()
    }

    /// Suggests what drives the actions with a profile.
    fn suggest(&self, instance: &xr::Instance, profile: &Profile) -> Result<(), RuntimeError> {
        let path = instance.string_to_path(profile.path).map_err(in_set)?;
        let suggest = |bindings: &[xr::Binding<'_>]| {
            instance.suggest_interaction_profile_bindings(path, bindings)
        };
        let ours = self.bindings(instance, profile).map_err(in_set)?;
        let own = match &self.own {
            Some(own) => own.bindings(instance, profile.path).map_err(in_set)?,
            None => Vec::new(),
        };
        let all = ours.iter().chain(own.iter().map(|(.., binding)| binding));
        let Err(error) = suggest(&all.copied().collect::<Vec<_>>()) else {
            return Ok(());
        };
        // Which one is it? Ours are all right where the runtime knows the profile, and it need not know every controller.
        if suggest(&ours).is_ok() {
            let mut alone = own.iter().map(|(name, source, binding)| {
                suggest(&[*binding]).map_err(|error| (*name, *source, error))
            });
            if let Some(Err((name, source, error))) = alone.find(Result::is_err) {
                return Err(RuntimeError::Binding {
                    action: name.to_owned(),
                    source_path: source.to_owned(),
                    profile: profile.path,
                    reason: error.to_string(),
                });
            }
            // Each by itself is all right; the last one that was tried would stand alone.
            if let Err(error) = suggest(&ours) {
                log::debug!("{}: {error}", profile.path);
            }
        }
        log::debug!("{}: {error}", profile.path);
        Ok(())
    }

    /// All but the application's, and what its actions take the button of.
    fn bindings<'a>(
        &'a self,
        instance: &xr::Instance,
        profile: &Profile,
    ) -> xr::Result<Vec<xr::Binding<'a>>> {
        let mut bindings = self.hands.bindings(instance, profile)?;
        for (drives, source) in profile.drives {
            let is_button = matches!(drives, Drives::SwitchReuse | Drives::Quit);
            let is_taken = |own: &OwnActions| own.binds(profile.path, source);
            if is_button && self.own.as_ref().is_some_and(is_taken) {
                continue;
            }
            let path = instance.string_to_path(source)?;
            bindings.push(match (drives, &self.moves) {
                (Drives::SwitchReuse, _) => xr::Binding::new(&self.switch_reuse, path),
                (Drives::Quit, _) => xr::Binding::new(&self.quit, path),
                (_, None) => continue,
                (Drives::Walk, Some(moves)) => xr::Binding::new(&moves.walk, path),
                (Drives::Turn, Some(moves)) => xr::Binding::new(&moves.turn, path),
                (Drives::Advance, Some(moves)) => xr::Binding::new(&moves.advance, path),
                (Drives::TurnRight, Some(moves)) => xr::Binding::new(&moves.turn_right, path),
            });
        }
        Ok(bindings)
    }

    /// Syncs all sets and reads the program's own. Without focus the runtime reports rest.
    pub(super) fn read<G>(&self, session: &xr::Session<G>) -> xr::Result<Wishes> {
        let active: Vec<_> = self
            .sets()
            .into_iter()
            .map(xr::ActiveActionSet::new)
            .collect();
        session.sync_actions(&active)?;
        let any = xr::Path::NULL;
        let as_axis = |action| held(action, session, any).map(|held| f64::from(u8::from(held)));
        let pressed = |action: &xr::Action<bool>| {
            let state = action.state(session, any)?;
            let is_down = state.is_active && state.current_state;
            Ok::<_, xr::sys::Result>(is_down && state.changed_since_last_sync)
        };
        let mut wishes = Wishes {
            switch_reuse: pressed(&self.switch_reuse)?,
            quit: pressed(&self.quit)?,
            ..Wishes::default()
        };
        if let Some(moves) = &self.moves {
            wishes.walk = stick(&moves.walk, session, any)? + DVec2::Y * as_axis(&moves.advance)?;
            wishes.turn = stick(&moves.turn, session, any)?.x + as_axis(&moves.turn_right)?;
        }
        Ok(wishes)
    }

    /// What an application sees, from the last sync.
    pub(super) fn locate<G>(&self, session: &xr::Session<G>, at: &Asked<'_>) -> xr::Result<Input> {
        let mut input = self.hands.read(session, at)?;
        self.trackers.read(&mut input, at)?;
        if let Some(own) = &self.own {
            input.actions = own.read(session, at)?;
        }
        Ok(input)
    }

    /// Lets something vibrate; the runtime ignores it where nothing can.
    pub(super) fn vibrate<G>(&self, session: &xr::Session<G>, pulse: &Pulse) -> xr::Result<()> {
        let nanoseconds = (pulse.duration_s * 1e9).min(1e18) as i64;
        let duration = match nanoseconds {
            0 => xr::Duration::MIN_HAPTIC,
            more => xr::Duration::from_nanos(more),
        };
        let event = xr::HapticVibration::new()
            .duration(duration)
            .frequency(xr::FREQUENCY_UNSPECIFIED)
            .amplitude(pulse.amplitude as f32);
        let (action, path) = match &pulse.of {
            PulseOf::Hand(side) => self.hands.haptic(*side),
            PulseOf::Action(name) => match self.own.as_ref().and_then(|own| own.haptic(name)) {
                Some(action) => (action, xr::Path::NULL),
                None => return Ok(()),
            },
        };
        action.apply_feedback(session, path, &event)
    }
}

fn in_set(result: xr::sys::Result) -> RuntimeError {
    failed("action set")(result)
}
