//! What the wearer does: hands, buttons, gaze.
//!
//! A session locates it for the time at which the frame is seen, as it does with the eyes
//! ([`super::XrSession::locate_input`]). Everything an application can react to is in here, and a recording holds all of
//! it, so that a replay drives the application through the same frames.

use glam::{DQuat, DVec2, DVec3};
use serde::{Serialize, Serializer};
use serde_json::Value;

use super::action_values::ActionValues;
use super::trace::{Fields, is_default};
use super::validation::{Fault, check_pose, within};
use stereolux_base::pose::Pose;

/// What the wearer does in one frame. At rest, with nothing tracked, it equals `Input::default()`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Input {
    /// Left hand, right hand.
    #[serde(flatten, serialize_with = "write_hands")]
    pub hands: [Hand; 2],
    /// World from gaze: -Z is where the eyes look; `None` where nothing tracks them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gaze: Option<Pose>,
    /// The application's own actions: all that it declares, or, in a loop of one's own, those that are not at rest
    /// ([`ActionValues::of`] completes them).
    #[serde(skip_serializing_if = "ActionValues::are_at_rest")]
    pub actions: ActionValues,
}

/// How far a trigger or a squeeze is pulled where it counts as pressed.
pub const PRESSED_FROM: f64 = 0.5;

stereolux_base::words! {
    /// Which hand.
    pub enum Side: word {
        /// The left one.
        Left = "left",
        /// The right one.
        Right = "right",
    }
}

impl Side {
    /// Both, in the order of [`Input::hands`].
    pub const BOTH: [Self; 2] = Self::ALL;
}

/// A hand, or the controller in it.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Hand {
    /// Where the palm holds things (OpenXR 1.1, section 6.3.2 "Standard pose identifiers", `grip`); `None`: not tracked.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub grip: Option<Tracked>,
    /// Where the hand points: along -Z; `None`: not tracked.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub aim: Option<Tracked>,
    /// How far the trigger is pulled, 0 to 1.
    #[serde(skip_serializing_if = "is_zero")]
    pub trigger: f64,
    /// How far the grip button is squeezed, 0 to 1.
    #[serde(skip_serializing_if = "is_zero")]
    pub squeeze: f64,
    /// Stick or pad: right and forward, each -1 to 1.
    #[serde(skip_serializing_if = "is_centred")]
    pub stick: DVec2,
    /// Buttons that are held down.
    #[serde(skip_serializing_if = "is_default")]
    pub pressed: Buttons,
    /// Buttons that a finger rests on; none where the controller does not feel it.
    #[serde(skip_serializing_if = "is_default")]
    pub touched: Buttons,
    /// Joints of the tracked hand; `None` where the runtime tracks none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joints: Option<Box<[Joint; JOINTS]>>,
}

/// Joints of a hand, in the order of `XrHandJointEXT`: palm, wrist, then thumb to little finger from the root to the tip.
pub const JOINTS: usize = 26;

/// A pose with how it changes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Tracked {
    /// World from hand.
    #[serde(flatten)]
    pub pose: Pose,
    /// Metres per second in the world; 0 where the runtime does not say.
    #[serde(skip_serializing_if = "is_still")]
    pub linear_velocity: DVec3,
    /// Radians per second about the world's axes; 0 where the runtime does not say.
    #[serde(skip_serializing_if = "is_still")]
    pub angular_velocity: DVec3,
}

impl Tracked {
    /// At rest.
    #[must_use]
    pub fn still(pose: Pose) -> Self {
        Self {
            pose,
            linear_velocity: DVec3::ZERO,
            angular_velocity: DVec3::ZERO,
        }
    }

    pub(super) fn check(&mut self) -> Result<(), Fault> {
        self.pose = check_pose(&self.pose)?;
        for (velocity, value) in [
            ("linear_velocity", self.linear_velocity),
            ("angular_velocity", self.angular_velocity),
        ] {
            if !value.is_finite() {
                return Err(Fault::new(velocity, format!("{value} is not finite")));
            }
        }
        Ok(())
    }

    /// Where it points: its -Z axis in the world.
    #[must_use]
    pub fn direction(&self) -> DVec3 {
        self.pose.orientation * DVec3::NEG_Z
    }
}

/// One joint of a hand.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Joint {
    /// World from joint.
    #[serde(flatten)]
    pub pose: Pose,
    /// Distance from the joint to the skin, metres.
    pub radius_m: f64,
}

stereolux_base::words! {
    /// A button of a controller. What a controller lacks is never pressed.
    pub enum Button: word {
        /// Under the index finger; `select` of a simple controller, a pinch of a tracked hand.
        Trigger = "trigger",
        /// Under the middle finger; a tracked hand's fist.
        Squeeze = "squeeze",
        /// The stick or the pad, pushed in.
        Stick = "stick",
        /// X on the left, A on the right.
        Primary = "primary",
        /// Y on the left, B on the right.
        Secondary = "secondary",
        /// Menu.
        Menu = "menu",
    }
}

impl Button {
    /// The button of that name, or which names there are.
    pub fn named(word: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|button| button.word() == word);
        found.ok_or_else(|| {
            let known = Self::ALL.map(Self::word).join(", ");
            format!("{word:?} is no button; known here: {known}")
        })
    }
}

/// A set of buttons.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Buttons(u8);

impl Buttons {
    /// Whether a button is among them.
    #[must_use]
    pub fn has(self, button: Button) -> bool {
        self.0 & (1 << button as u8) != 0
    }

    /// With this button as well, if `is_in`.
    #[must_use]
    pub fn with(self, button: Button, is_in: bool) -> Self {
        Self(self.0 | (u8::from(is_in) << button as u8))
    }

    /// Those that are not in `other`.
    #[must_use]
    pub fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }
}

/// The names in files.
impl Serialize for Buttons {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let held = Button::ALL.into_iter().filter(|button| self.has(*button));
        serializer.collect_seq(held.map(Button::word))
    }
}

impl FromIterator<Button> for Buttons {
    fn from_iter<I: IntoIterator<Item = Button>>(buttons: I) -> Self {
        let all = buttons.into_iter();
        all.fold(Self::default(), |set, button| set.with(button, true))
    }
}

impl Input {
    /// The hand of a side.
    #[must_use]
    pub fn hand(&self, side: Side) -> &Hand {
        &self.hands[side as usize]
    }

    /// Checks what comes from outside and returns it with unit quaternions.
    ///
    /// # Errors
    /// The first fault, its field named as in a recording (`input.left.grip.orientation`).
    pub fn checked(mut self) -> Result<Self, Fault> {
        for (side, hand) in Side::BOTH.into_iter().zip(&mut self.hands) {
            hand.check()
                .map_err(|fault| fault.under(side.word()).under("input"))?;
        }
        if let Some(gaze) = &mut self.gaze {
            *gaze = check_pose(gaze).map_err(|fault| fault.under("input.gaze"))?;
        }
        let actions = self.actions.check();
        actions.map_err(|fault| fault.under("input.actions"))?;
        Ok(self)
    }

    /// Reads what a recording holds: only what is not at rest. `value` is the field `input`.
    pub(super) fn read(value: &Value) -> Result<Self, Fault> {
        let fields = Fields::of("input", value, &["left", "right", "gaze", "actions"])?;
        let hand = |key| fields.optional(key, Hand::read);
        let input = Self {
            hands: [
                hand("left")?.unwrap_or_default(),
                hand("right")?.unwrap_or_default(),
            ],
            gaze: fields.optional("gaze", |path, value| {
                let fields = Fields::of(path, value, &["position", "orientation"])?;
                read_pose(&fields)
            })?,
            actions: fields
                .optional("actions", ActionValues::read)?
                .unwrap_or_default(),
        };
        input.checked()
    }
}

impl Hand {
    fn check(&mut self) -> Result<(), Fault> {
        for (name, tracked) in [("grip", &mut self.grip), ("aim", &mut self.aim)] {
            if let Some(tracked) = tracked {
                tracked.check().map_err(|fault| fault.under(name))?;
            }
        }
        for (name, value, low) in [
            ("trigger", self.trigger, 0.0),
            ("squeeze", self.squeeze, 0.0),
            ("stick[0]", self.stick.x, -1.0),
            ("stick[1]", self.stick.y, -1.0),
        ] {
            within(value, low..=1.0, "").map_err(|what| Fault::new(name, what))?;
        }
        let joints = self.joints.iter_mut().flat_map(|joints| joints.iter_mut());
        for (index, joint) in joints.enumerate() {
            let name = format!("joints[{index}]");
            joint.pose = check_pose(&joint.pose).map_err(|fault| fault.under(&name))?;
            within(joint.radius_m, 0.0..=1.0, " m")
                .map_err(|what| Fault::new("radius_m", what).under(&name))?;
        }
        Ok(())
    }

    fn read(path: &str, value: &Value) -> Result<Self, Fault> {
        let known = [
            "grip", "aim", "trigger", "squeeze", "stick", "pressed", "touched", "joints",
        ];
        let fields = Fields::of(path, value, &known)?;
        let share = |key| fields.optional(key, |_, _| fields.number(key));
        let buttons = |key| fields.optional(key, read_buttons);
        Ok(Self {
            grip: fields.optional("grip", read_tracked)?,
            aim: fields.optional("aim", read_tracked)?,
            trigger: share("trigger")?.unwrap_or_default(),
            squeeze: share("squeeze")?.unwrap_or_default(),
            stick: fields
                .optional("stick", |_, _| fields.numbers("stick"))?
                .map_or(DVec2::ZERO, DVec2::from_array),
            pressed: buttons("pressed")?.unwrap_or_default(),
            touched: buttons("touched")?.unwrap_or_default(),
            joints: fields.optional("joints", read_joints)?,
        })
    }
}

fn read_pose(fields: &Fields<'_>) -> Result<Pose, Fault> {
    // `Input::checked` looks at the numbers.
    Ok(Pose::new(
        DVec3::from_array(fields.numbers("position")?),
        DQuat::from_array(fields.numbers("orientation")?),
    ))
}

pub(super) fn read_tracked(path: &str, value: &Value) -> Result<Tracked, Fault> {
    let known = [
        "position",
        "orientation",
        "linear_velocity",
        "angular_velocity",
    ];
    let fields = Fields::of(path, value, &known)?;
    let velocity = |key| {
        let numbers = fields.optional(key, |_, _| fields.numbers(key));
        numbers.map(|numbers| numbers.map_or(DVec3::ZERO, DVec3::from_array))
    };
    Ok(Tracked {
        pose: read_pose(&fields)?,
        linear_velocity: velocity("linear_velocity")?,
        angular_velocity: velocity("angular_velocity")?,
    })
}

fn read_buttons(path: &str, value: &Value) -> Result<Buttons, Fault> {
    let words = value.as_array().ok_or_else(|| {
        let what = format!("{value} is not an array of buttons' names");
        Fault::new(path, what)
    })?;
    let button = |word: &Value| match word.as_str() {
        Some(word) => Button::named(word).map_err(|what| Fault::new(path, what)),
        None => Err(Fault::new(path, format!("{word} is not a button's name"))),
    };
    words.iter().map(button).collect()
}

fn read_joints(path: &str, value: &Value) -> Result<Box<[Joint; JOINTS]>, Fault> {
    let wrong = |what: String| Fault::new(path, what);
    let values = value
        .as_array()
        .ok_or_else(|| wrong(format!("is not an array of {JOINTS} joints")))?;
    let mut joints = Vec::with_capacity(JOINTS);
    for (index, value) in values.iter().enumerate() {
        let path = format!("{path}[{index}]");
        let fields = Fields::of(&path, value, &["position", "orientation", "radius_m"])?;
        joints.push(Joint {
            pose: read_pose(&fields)?,
            radius_m: fields.number("radius_m")?,
        });
    }
    let count = joints.len();
    joints
        .try_into()
        .map_err(|_| wrong(format!("holds {count} joints, not {JOINTS}")))
}

/// By their sides, without those at rest.
fn write_hands<S: Serializer>(hands: &[Hand; 2], serializer: S) -> Result<S::Ok, S::Error> {
    let hands = Side::BOTH.map(Side::word).into_iter().zip(hands);
    serializer.collect_map(hands.filter(|(_, hand)| !is_default(*hand)))
}

/// Whether a number may be left out; -0 may not, so that what is read and written again gives the same bytes.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes references")]
fn is_zero(value: &f64) -> bool {
    value.to_bits() == 0
}

fn is_centred(stick: &DVec2) -> bool {
    stick.to_array().iter().all(is_zero)
}

fn is_still(velocity: &DVec3) -> bool {
    velocity.to_array().iter().all(is_zero)
}
