//! The program's own action set: move, turn, switch reuse, quit. It is attached with that of the hands.

use glam::DVec2;
use openxr as xr;

use super::hands::Hands;
use super::runtime::Runtime;
use crate::profiles::{Drives, PROFILES};

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

/// The actions, attached to a session.
pub(super) struct Controls {
    /// What an application sees.
    pub(super) hands: Hands,
    /// Whether walking and turning are on.
    moves: bool,
    set: xr::ActionSet,
    walk: xr::Action<xr::Vector2f>,
    turn: xr::Action<xr::Vector2f>,
    advance: xr::Action<bool>,
    turn_right: xr::Action<bool>,
    switch_reuse: xr::Action<bool>,
    quit: xr::Action<bool>,
}

impl Controls {
    /// Makes the actions, suggests bindings for the profiles that the runtime knows, and attaches them. Without `moves` the
    /// wearer neither walks nor turns: an application has the sticks for itself.
    pub(super) fn new<G>(
        runtime: &Runtime,
        session: &xr::Session<G>,
        moves: bool,
    ) -> xr::Result<Self> {
        let instance = &runtime.instance;
        let set = instance.create_action_set("stereolux", "stereolux", 0)?;
        let mut controls = Self {
            hands: Hands::new(instance)?,
            moves,
            walk: set.create_action("walk", "Walk", &[])?,
            turn: set.create_action("turn", "Turn", &[])?,
            advance: set.create_action("advance", "Walk ahead", &[])?,
            turn_right: set.create_action("turn_right", "Turn right", &[])?,
            switch_reuse: set.create_action("switch_reuse", "Switch stereo reuse", &[])?,
            quit: set.create_action("quit", "Quit", &[])?,
            set,
        };
        let used = runtime.used_extensions();
        let is_there = |extension: &str| used.contains(&extension);
        for profile in PROFILES {
            if !profile.extension.is_none_or(is_there) {
                continue;
            }
            let mut bindings = controls.hands.bindings(instance, profile)?;
            for (drives, source) in profile.drives {
                let path = instance.string_to_path(source)?;
                bindings.push(match drives {
                    Drives::Walk => xr::Binding::new(&controls.walk, path),
                    Drives::Turn => xr::Binding::new(&controls.turn, path),
                    Drives::Advance => xr::Binding::new(&controls.advance, path),
                    Drives::TurnRight => xr::Binding::new(&controls.turn_right, path),
                    Drives::SwitchReuse => xr::Binding::new(&controls.switch_reuse, path),
                    Drives::Quit => xr::Binding::new(&controls.quit, path),
                });
            }
            let path = instance.string_to_path(profile.path)?;
            if let Err(error) = instance.suggest_interaction_profile_bindings(path, &bindings) {
                // A runtime need not know every controller.
                log::debug!("{}: {error}", profile.path);
            }
        }
        session.attach_action_sets(&[&controls.set, &controls.hands.set])?;
        controls.hands.attached(session)?;
        Ok(controls)
    }

    /// Reads the actions. Without focus the runtime reports rest.
    pub(super) fn read<G>(&self, session: &xr::Session<G>) -> xr::Result<Wishes> {
        session.sync_actions(&[
            xr::ActiveActionSet::new(&self.set),
            xr::ActiveActionSet::new(&self.hands.set),
        ])?;
        let stick = |action: &xr::Action<xr::Vector2f>| {
            action.state(session, xr::Path::NULL).map(|state| {
                if state.is_active {
                    DVec2::new(
                        f64::from(state.current_state.x),
                        f64::from(state.current_state.y),
                    )
                } else {
                    DVec2::ZERO
                }
            })
        };
        let button = |action: &xr::Action<bool>| action.state(session, xr::Path::NULL);
        let held =
            |action| button(action).map(|state| f64::from(state.is_active && state.current_state));
        let pressed = |action| {
            button(action).map(|state| {
                state.is_active && state.current_state && state.changed_since_last_sync
            })
        };
        let [walk, turn] = if self.moves {
            [
                stick(&self.walk)? + DVec2::Y * held(&self.advance)?,
                stick(&self.turn)? + DVec2::X * held(&self.turn_right)?,
            ]
        } else {
            [DVec2::ZERO; 2]
        };
        Ok(Wishes {
            walk,
            turn: turn.x,
            switch_reuse: pressed(&self.switch_reuse)?,
            quit: pressed(&self.quit)?,
        })
    }
}
