//! The application's own actions, in a set of their own.

use openxr as xr;

use super::hands::Asked;
use super::states::{held, pull, stick};
use crate::actions::{Action, ActionKind, Actions};
use crate::{ActionValue, ActionValues};

/// What an application declared, made.
pub(super) struct OwnActions {
    pub(super) set: xr::ActionSet,
    actions: Vec<(Action, Made)>,
}

/// An action by its kind.
enum Made {
    Bool(xr::Action<bool>),
    Float(xr::Action<f32>),
    Vec2(xr::Action<xr::Vector2f>),
    /// With its space, once the set is attached.
    Pose(xr::Action<xr::Posef>, Option<xr::Space>),
    Haptic(xr::Action<xr::Haptic>),
}

impl OwnActions {
    /// Makes them; `None` if there are none.
    pub(super) fn new(instance: &xr::Instance, actions: &Actions) -> xr::Result<Option<Self>> {
        if actions.declared().is_empty() {
            return Ok(None);
        }
        let set = instance.create_action_set("application", "Application", 0)?;
        let make = |action: &Action| {
            let name = action.name.as_str();
            let made = match action.kind {
                ActionKind::Bool => Made::Bool(set.create_action(name, name, &[])?),
                ActionKind::Float => Made::Float(set.create_action(name, name, &[])?),
                ActionKind::Vec2 => Made::Vec2(set.create_action(name, name, &[])?),
                ActionKind::Pose => Made::Pose(set.create_action(name, name, &[])?, None),
                ActionKind::Haptic => Made::Haptic(set.create_action(name, name, &[])?),
            };
            Ok::<_, xr::sys::Result>((action.clone(), made))
        };
        let actions = actions
            .declared()
            .iter()
            .map(make)
            .collect::<Result<_, _>>()?;
        Ok(Some(Self { set, actions }))
    }

    /// Whether one of them is to be driven by a source of a profile.
    pub(super) fn binds(&self, profile: &str, source: &str) -> bool {
        let bindings = self.actions.iter().flat_map(|(action, _)| &action.bindings);
        bindings
            .into_iter()
            .any(|(of, by)| *of == profile && by == source)
    }

    /// What to suggest for a profile: the action's name, its source, and both as the runtime takes them.
    pub(super) fn bindings<'a>(
        &'a self,
        instance: &xr::Instance,
        profile: &str,
    ) -> xr::Result<Vec<(&'a str, &'a str, xr::Binding<'a>)>> {
        let mut bindings = Vec::new();
        for (action, made) in &self.actions {
            for (_, source) in action.bindings.iter().filter(|(of, _)| *of == profile) {
                let path = instance.string_to_path(source)?;
                let binding = match made {
                    Made::Bool(action) => xr::Binding::new(action, path),
                    Made::Float(action) => xr::Binding::new(action, path),
                    Made::Vec2(action) => xr::Binding::new(action, path),
                    Made::Pose(action, _) => xr::Binding::new(action, path),
                    Made::Haptic(action) => xr::Binding::new(action, path),
                };
                bindings.push((action.name.as_str(), source.as_str(), binding));
            }
        }
        Ok(bindings)
    }

    /// Makes the spaces of poses, when the set is attached.
    pub(super) fn attached<G>(&mut self, session: &xr::Session<G>) -> xr::Result<()> {
        for (_, made) in &mut self.actions {
            if let Made::Pose(action, space) = made {
                *space = Some(action.create_space(session, xr::Path::NULL, xr::Posef::IDENTITY)?);
            }
        }
        Ok(())
    }

    /// What they are, from the last sync.
    pub(super) fn read<G>(
        &self,
        session: &xr::Session<G>,
        at: &Asked<'_>,
    ) -> xr::Result<ActionValues> {
        let mut values = ActionValues::default();
        let any = xr::Path::NULL;
        for (action, made) in &self.actions {
            let value = match made {
                Made::Bool(action) => ActionValue::Bool(held(action, session, any)?),
                Made::Float(action) => ActionValue::Float(pull(action, session, any, -1.0)?),
                Made::Vec2(action) => ActionValue::Vec2(stick(action, session, any)?),
                Made::Pose(_, Some(space)) => ActionValue::Pose(at.tracked(space)?),
                Made::Pose(_, None) | Made::Haptic(_) => continue,
            };
            values.set(&action.name, value);
        }
        Ok(values)
    }

    /// The action of that name that vibrates.
    pub(super) fn haptic(&self, name: &str) -> Option<&xr::Action<xr::Haptic>> {
        self.actions.iter().find_map(|(action, made)| match made {
            Made::Haptic(haptic) if action.name == name => Some(haptic),
            _ => None,
        })
    }
}
