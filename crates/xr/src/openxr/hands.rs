//! Hands as OpenXR has them: poses, buttons, sticks and vibration of both controllers, in an action set of their own.

use glam::DVec3;
use openxr as xr;

use super::states::{held, pull, stick};
use super::{pose_of, vector_of};
use crate::input::{Button, Buttons, Hand, Input, PRESSED_FROM, Side, Tracked};
use crate::profiles::Profile;
use stereolux_base::pose::Pose;
use stereolux_gpu::vulkan_interop::openxr as interop;

/// The actions, and where the hands are.
pub(super) struct Hands {
    pub(super) set: xr::ActionSet,
    /// `/user/hand/left`, `/user/hand/right`.
    paths: [xr::Path; 2],
    poses: [xr::Action<xr::Posef>; 2],
    trigger: xr::Action<f32>,
    squeeze: xr::Action<f32>,
    stick: xr::Action<xr::Vector2f>,
    /// In the order of [`Button::ALL`]; trigger and squeeze go by how far they are pulled.
    pressed: Vec<(Button, xr::Action<bool>)>,
    touched: Vec<(Button, xr::Action<bool>)>,
    haptic: xr::Action<xr::Haptic>,
    /// Grip and aim of each hand, once the actions are attached.
    spaces: Option<[[xr::Space; 2]; 2]>,
}

impl Hands {
    pub(super) fn new(instance: &xr::Instance) -> xr::Result<Self> {
        let set = instance.create_action_set("hands", "Hands", 0)?;
        let paths = [
            instance.string_to_path("/user/hand/left")?,
            instance.string_to_path("/user/hand/right")?,
        ];
        let of_buttons = |buttons: &[Button], suffix: &str, says: &str| {
            buttons
                .iter()
                .map(|button| {
                    let name = format!("{}_{suffix}", button.word());
                    let shown = format!("{} {says}", button.word());
                    Ok((*button, set.create_action(&name, &shown, &paths)?))
                })
                .collect::<xr::Result<Vec<_>>>()
        };
        let [_, _, clicked @ ..] = Button::ALL;
        let felt = [
            Button::Trigger,
            Button::Stick,
            Button::Primary,
            Button::Secondary,
        ];
        Ok(Self {
            poses: [
                set.create_action("grip", "Grip", &paths)?,
                set.create_action("aim", "Aim", &paths)?,
            ],
            trigger: set.create_action("trigger", "Trigger", &paths)?,
            squeeze: set.create_action("squeeze", "Squeeze", &paths)?,
            stick: set.create_action("stick", "Stick", &paths)?,
            pressed: of_buttons(&clicked, "click", "pressed")?,
            touched: of_buttons(&felt, "touch", "touched")?,
            haptic: set.create_action("haptic", "Vibration", &paths)?,
            paths,
            spaces: None,
            set,
        })
    }

    /// What to suggest for a profile, beside the other actions' bindings.
    pub(super) fn bindings<'a>(
        &'a self,
        instance: &xr::Instance,
        profile: &Profile,
    ) -> xr::Result<Vec<xr::Binding<'a>>> {
        let mut bindings = Vec::new();
        for side in Side::BOTH {
            let hand = format!("/user/hand/{}", side.word());
            let path = |source: &str| instance.string_to_path(&format!("{hand}/{source}"));
            let input = |source: &str| path(&format!("input/{source}"));
            bindings.push(xr::Binding::new(&self.poses[0], input("grip/pose")?));
            bindings.push(xr::Binding::new(&self.poses[1], input("aim/pose")?));
            if profile.vibrates {
                bindings.push(xr::Binding::new(&self.haptic, path("output/haptic")?));
            }
            for (action, source) in [
                (&self.trigger, profile.trigger),
                (&self.squeeze, profile.squeeze),
            ] {
                if !source.is_empty() {
                    bindings.push(xr::Binding::new(action, input(source)?));
                }
            }
            if !profile.stick.is_empty() {
                bindings.push(xr::Binding::new(&self.stick, input(profile.stick)?));
            }
            for (actions, sources) in [
                (&self.pressed, profile.buttons),
                (&self.touched, profile.touches),
            ] {
                for (button, by_side) in sources {
                    let source = by_side[side as usize];
                    let action = actions.iter().find(|(known, _)| known == button);
                    if let Some((_, action)) = action.filter(|_| !source.is_empty()) {
                        bindings.push(xr::Binding::new(action, input(source)?));
                    }
                }
            }
        }
        Ok(bindings)
    }

    /// Makes the spaces of grips and aims, when the set is attached.
    pub(super) fn attached<G>(&mut self, session: &xr::Session<G>) -> xr::Result<()> {
        let space = |pose: usize, hand: usize| {
            self.poses[pose].create_space(session, self.paths[hand], xr::Posef::IDENTITY)
        };
        self.spaces = Some([[space(0, 0)?, space(1, 0)?], [space(0, 1)?, space(1, 1)?]]);
        Ok(())
    }

    /// What the hands do, from the last sync.
    pub(super) fn read<G>(&self, session: &xr::Session<G>, at: &Asked<'_>) -> xr::Result<Input> {
        let mut input = Input::default();
        let Some(spaces) = &self.spaces else {
            return Ok(input);
        };
        for ((hand, path), [grip, aim]) in input.hands.iter_mut().zip(self.paths).zip(spaces) {
            hand.grip = at.tracked(grip)?;
            hand.aim = at.tracked(aim)?;
            self.read_buttons(session, path, hand)?;
        }
        Ok(input)
    }

    fn read_buttons<G>(
        &self,
        session: &xr::Session<G>,
        path: xr::Path,
        hand: &mut Hand,
    ) -> xr::Result<()> {
        hand.trigger = pull(&self.trigger, session, path, 0.0)?;
        hand.squeeze = pull(&self.squeeze, session, path, 0.0)?;
        hand.stick = stick(&self.stick, session, path)?;
        let among = |actions: &[(Button, xr::Action<bool>)]| {
            let mut buttons = Buttons::default();
            for (button, action) in actions {
                buttons = buttons.with(*button, held(action, session, path)?);
            }
            Ok::<_, xr::sys::Result>(buttons)
        };
        hand.pressed = among(&self.pressed)?
            .with(Button::Trigger, hand.trigger >= PRESSED_FROM)
            .with(Button::Squeeze, hand.squeeze >= PRESSED_FROM);
        hand.touched = among(&self.touched)?;
        Ok(())
    }

    /// What lets a controller vibrate: the action, and the path of the hand.
    pub(super) fn haptic(&self, side: Side) -> (&xr::Action<xr::Haptic>, xr::Path) {
        (&self.haptic, self.paths[side as usize])
    }
}

/// Whether position and orientation mean something.
pub(super) fn is_valid(flags: xr::SpaceLocationFlags) -> bool {
    flags.contains(
        xr::SpaceLocationFlags::POSITION_VALID | xr::SpaceLocationFlags::ORIENTATION_VALID,
    )
}

/// When places are asked for, and where the space that they are told in lies in the world then.
pub(super) struct Asked<'a> {
    pub(super) base: &'a xr::Space,
    pub(super) world_from_base: Pose,
    pub(super) time: xr::Time,
}

impl Asked<'_> {
    /// A space in the world; `None` while the runtime does not know where it is.
    pub(super) fn tracked(&self, space: &xr::Space) -> xr::Result<Option<Tracked>> {
        let (location, velocity) = interop::relate(space, self.base, self.time)?;
        if !is_valid(location.location_flags) {
            return Ok(None);
        }
        let in_world = |flag, v: xr::Vector3f| {
            let is_known = velocity.velocity_flags.contains(flag);
            let known = is_known.then(|| self.world_from_base.orientation * vector_of(v));
            known.unwrap_or(DVec3::ZERO)
        };
        use xr::SpaceVelocityFlags as Flags;
        Ok(Some(Tracked {
            pose: self.world_from_base.then(&pose_of(&location.pose)),
            linear_velocity: in_world(Flags::LINEAR_VALID, velocity.linear_velocity),
            angular_velocity: in_world(Flags::ANGULAR_VALID, velocity.angular_velocity),
        }))
    }
}
