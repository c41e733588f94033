//! What the actions of an application are in a frame.

use std::collections::BTreeMap;

use glam::DVec2;
use serde::{Serialize, Serializer};
use serde_json::Value;

use super::actions::{ActionError, ActionKind, Actions, unknown, wrong_kind};
use super::input::{Hand, PRESSED_FROM, Side, Tracked, read_tracked};
use super::profiles::TOUCH;
use super::trace::number;
use super::validation::{Fault, within};

/// The value of one action.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum ActionValue {
    /// Held or not.
    Bool(bool),
    /// -1 to 1.
    Float(f64),
    /// Right and forward, each -1 to 1.
    Vec2(DVec2),
    /// Where it is; `None`: not tracked.
    Pose(Option<Tracked>),
}

/// Values by the actions' names. A session may leave out what is at rest.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ActionValues(BTreeMap<String, ActionValue>);

impl ActionValue {
    /// At rest; `None` for what has no value.
    fn rest(kind: ActionKind) -> Option<Self> {
        match kind {
            ActionKind::Bool => Some(Self::Bool(false)),
            ActionKind::Float => Some(Self::Float(0.0)),
            ActionKind::Vec2 => Some(Self::Vec2(DVec2::ZERO)),
            ActionKind::Pose => Some(Self::Pose(None)),
            ActionKind::Haptic => None,
        }
    }

    fn kind(&self) -> ActionKind {
        match self {
            Self::Bool(_) => ActionKind::Bool,
            Self::Float(_) => ActionKind::Float,
            Self::Vec2(_) => ActionKind::Vec2,
            Self::Pose(_) => ActionKind::Pose,
        }
    }

    /// -0 is none, so that what is read and written again gives the same bytes.
    fn is_rest(&self) -> bool {
        match self {
            Self::Bool(held) => !held,
            Self::Float(value) => value.to_bits() == 0,
            Self::Vec2(value) => value.to_array().iter().all(|axis| axis.to_bits() == 0),
            Self::Pose(place) => place.is_none(),
        }
    }

    /// What a source of this value makes of an action of that kind, as OpenXR converts them; `None`: nothing.
    fn converted(self, kind: ActionKind) -> Option<Self> {
        match (self, kind) {
            (Self::Float(pull), ActionKind::Bool) => Some(Self::Bool(pull >= PRESSED_FROM)),
            (Self::Bool(held), ActionKind::Float) => Some(Self::Float(f64::from(u8::from(held)))),
            (value, kind) => (value.kind() == kind).then_some(value),
        }
    }

    /// How far from rest: of several sources the furthest counts.
    fn strength(&self) -> f64 {
        match self {
            Self::Bool(held) => f64::from(u8::from(*held)),
            Self::Float(value) => value.abs(),
            Self::Vec2(value) => value.length(),
            Self::Pose(place) => f64::from(u8::from(place.is_some())),
        }
    }
}

/// As a recording holds them: only what is not at rest.
impl Serialize for ActionValues {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().filter(|(_, value)| !value.is_rest()))
    }
}

impl ActionValues {
    /// Notes a value.
    pub fn set(&mut self, name: &str, value: ActionValue) {
        if value.is_rest() {
            self.0.remove(name);
        } else {
            self.0.insert(name.to_owned(), value);
        }
    }

    /// The values of all actions that are declared and of no other, those at rest too.
    ///
    /// # Errors
    /// A recording in which an action has a value of another kind.
    pub fn of(&self, declared: &Actions) -> Result<Self, ActionError> {
        let mut values = BTreeMap::new();
        for action in declared.declared() {
            let Some(rest) = ActionValue::rest(action.kind) else {
                continue;
            };
            let value = self.0.get(&action.name).copied().unwrap_or(rest);
            if value.kind() != action.kind {
                let ActionError(what) = wrong_kind(&action.name, value.kind().word(), action.kind);
                return Err(ActionError(format!("the recording's {what}")));
            }
            values.insert(action.name.clone(), value);
        }
        Ok(Self(values))
    }

    /// What Touch controllers in these hands make of the actions.
    #[must_use]
    pub fn of_touch(declared: &Actions, hands: &[Hand; 2]) -> Self {
        let mut values = Self::default();
        for action in declared.declared() {
            let sources = action.bindings.iter();
            let given = sources
                .filter(|(profile, _)| *profile == TOUCH.path)
                .filter_map(|(_, source)| source_value(source, hands))
                .filter_map(|value| value.converted(action.kind))
                .reduce(|a, b| if b.strength() > a.strength() { b } else { a });
            if let Some(value) = given {
                values.set(&action.name, value);
            }
        }
        values
    }

    fn get(&self, name: &str) -> Result<ActionValue, ActionError> {
        let value = self.0.get(name).copied();
        value.ok_or_else(|| unknown(name, self.0.keys().map(String::as_str)))
    }

    /// Whether there is an action of that name, of kind bool, and held.
    pub fn is_held(&self, name: &str) -> bool {
        self.0.get(name) == Some(&ActionValue::Bool(true))
    }

    /// Whether an action of kind bool is held.
    ///
    /// # Errors
    /// No such action, or one of another kind; so the others.
    pub fn held(&self, name: &str) -> Result<bool, ActionError> {
        match self.get(name)? {
            ActionValue::Bool(held) => Ok(held),
            other => Err(wrong_kind(name, other.kind().word(), ActionKind::Bool)),
        }
    }

    /// The value of an action of kind float.
    ///
    /// # Errors
    /// As [`ActionValues::held`].
    pub fn float(&self, name: &str) -> Result<f64, ActionError> {
        match self.get(name)? {
            ActionValue::Float(value) => Ok(value),
            other => Err(wrong_kind(name, other.kind().word(), ActionKind::Float)),
        }
    }

    /// The value of an action of kind vec2: right and forward.
    ///
    /// # Errors
    /// As [`ActionValues::held`].
    pub fn vec2(&self, name: &str) -> Result<DVec2, ActionError> {
        match self.get(name)? {
            ActionValue::Vec2(value) => Ok(value),
            other => Err(wrong_kind(name, other.kind().word(), ActionKind::Vec2)),
        }
    }

    /// Where an action of kind pose is; `None` while it is not tracked.
    ///
    /// # Errors
    /// As [`ActionValues::held`].
    pub fn pose(&self, name: &str) -> Result<Option<Tracked>, ActionError> {
        match self.get(name)? {
            ActionValue::Pose(place) => Ok(place),
            other => Err(wrong_kind(name, other.kind().word(), ActionKind::Pose)),
        }
    }

    /// Checks what comes from outside and makes quaternions unit ones.
    pub(super) fn check(&mut self) -> Result<(), Fault> {
        for (name, value) in &mut self.0 {
            let axes = match value {
                ActionValue::Bool(_) | ActionValue::Pose(None) => continue,
                ActionValue::Pose(Some(tracked)) => {
                    tracked.check().map_err(|fault| fault.under(name))?;
                    continue;
                }
                ActionValue::Float(value) => DVec2::new(*value, 0.0),
                ActionValue::Vec2(value) => *value,
            };
            for axis in axes.to_array() {
                within(axis, -1.0..=1.0, "").map_err(|what| Fault::new(name, what))?;
            }
        }
        Ok(())
    }

    pub(super) fn are_at_rest(&self) -> bool {
        self.0.values().all(ActionValue::is_rest)
    }

    /// Reads what a recording holds. The kinds show: what is true or false, a number, two, or a place.
    pub(super) fn read(path: &str, value: &Value) -> Result<Self, Fault> {
        let Value::Object(map) = value else {
            let what = format!("{value} is not an object of actions' values");
            return Err(Fault::new(path, what));
        };
        let mut values = Self::default();
        for (name, value) in map {
            let path = format!("{path}.{name}");
            let read = match value {
                Value::Bool(held) => ActionValue::Bool(*held),
                Value::Number(_) => ActionValue::Float(number(&path, value)?),
                Value::Object(_) => ActionValue::Pose(Some(read_tracked(&path, value)?)),
                Value::Array(axes) if axes.len() == 2 => ActionValue::Vec2(DVec2::new(
                    number(&format!("{path}[0]"), &axes[0])?,
                    number(&format!("{path}[1]"), &axes[1])?,
                )),
                _ => {
                    let what = "is not true, false, a number, two of them, or a place";
                    return Err(Fault::new(path, what));
                }
            };
            values.set(name, read);
        }
        Ok(values)
    }
}

impl Actions {
    /// Warns of sources that the controllers in simulated hands lack: nothing drives them there, and a runtime may refuse them.
    pub fn warn_of_undriven(&self) {
        for action in self.declared() {
            let of_touch = action.bindings.iter();
            let of_touch = of_touch.filter(|(profile, _)| *profile == TOUCH.path);
            for (_, source) in of_touch.filter(|_| action.kind != ActionKind::Haptic) {
                if source_value(source, &<[Hand; 2]>::default()).is_none() {
                    log::warn!(
                        "action '{}': simulated hands have nothing at {source}, and a headset may refuse it",
                        action.name
                    );
                }
            }
        }
    }
}

/// What a source of a Touch controller says; `None` for one that it lacks.
fn source_value(source: &str, hands: &[Hand; 2]) -> Option<ActionValue> {
    Side::BOTH.into_iter().zip(hands).find_map(|(side, hand)| {
        let prefix = format!("/user/hand/{}/input/", side.word());
        let input = source.strip_prefix(&prefix)?;
        let button = |named: &[_]| {
            let mut named = named.iter();
            let found =
                named.find(|(_, by_side): &&(_, [&str; 2])| by_side[side as usize] == input);
            found.map(|(button, _)| *button)
        };
        if input == TOUCH.trigger {
            return Some(ActionValue::Float(hand.trigger));
        }
        if input == TOUCH.squeeze {
            return Some(ActionValue::Float(hand.squeeze));
        }
        if let Some(axis) = input.strip_prefix(TOUCH.stick) {
            match axis {
                "" => return Some(ActionValue::Vec2(hand.stick)),
                "/x" => return Some(ActionValue::Float(hand.stick.x)),
                "/y" => return Some(ActionValue::Float(hand.stick.y)),
                _ => {}
            }
        }
        match input {
            "grip/pose" => return Some(ActionValue::Pose(hand.grip)),
            "aim/pose" => return Some(ActionValue::Pose(hand.aim)),
            _ => {}
        }
        let pressed = button(TOUCH.buttons).map(|button| hand.pressed.has(button));
        let touched = || button(TOUCH.touches).map(|button| hand.touched.has(button));
        Some(ActionValue::Bool(pressed.or_else(touched)?))
    })
}
