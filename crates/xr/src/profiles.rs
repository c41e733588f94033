//! Interaction profiles: the controllers that bindings are suggested for, and what each of them has.

use super::input::Button;

/// What a source does in the program's own action set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Drives {
    /// A stick walks.
    Walk,
    /// A stick turns.
    Turn,
    /// A button walks ahead, where there is no stick.
    Advance,
    /// A button turns right.
    TurnRight,
    /// Stereo reuse is switched.
    SwitchReuse,
    /// The run ends.
    Quit,
}

/// One interaction profile. Sources are below `/user/hand/SIDE/input/`; empty: the controller has none. Where left and right
/// differ, both are given, left first. Every profile has grip and aim besides.
pub struct Profile {
    pub path: &'static str,
    /// The extension that it came with; `None`: OpenXR 1.0 has it.
    pub extension: Option<&'static str>,
    pub trigger: &'static str,
    pub squeeze: &'static str,
    pub stick: &'static str,
    pub buttons: &'static [(Button, [&'static str; 2])],
    pub touches: &'static [(Button, [&'static str; 2])],
    pub vibrates: bool,
    /// The program's own actions, with whole paths. What has no sticks walks and turns by its buttons.
    pub drives: &'static [(Drives, &'static str)],
}

const fn both(path: &'static str) -> [&'static str; 2] {
    [path, path]
}

/// The controllers that simulated hands hold.
pub const TOUCH: Profile = Profile {
    path: "/interaction_profiles/oculus/touch_controller",
    extension: None,
    trigger: "trigger/value",
    squeeze: "squeeze/value",
    stick: "thumbstick",
    buttons: &[
        (Button::Stick, both("thumbstick/click")),
        (Button::Primary, ["x/click", "a/click"]),
        (Button::Secondary, ["y/click", "b/click"]),
        (Button::Menu, ["menu/click", ""]),
    ],
    touches: &[
        (Button::Trigger, both("trigger/touch")),
        (Button::Stick, both("thumbstick/touch")),
        (Button::Primary, ["x/touch", "a/touch"]),
        (Button::Secondary, ["y/touch", "b/touch"]),
    ],
    vibrates: true,
    drives: &[
        (Drives::Walk, "/user/hand/left/input/thumbstick"),
        (Drives::Turn, "/user/hand/right/input/thumbstick"),
        (Drives::SwitchReuse, "/user/hand/left/input/x/click"),
        (Drives::Quit, "/user/hand/left/input/menu/click"),
    ],
};

/// All of them.
pub const PROFILES: &[Profile] = &[
    Profile {
        path: "/interaction_profiles/khr/simple_controller",
        extension: None,
        trigger: "select/click",
        squeeze: "",
        stick: "",
        buttons: &[(Button::Menu, both("menu/click"))],
        touches: &[],
        vibrates: true,
        drives: &[
            (Drives::Advance, "/user/hand/left/input/select/click"),
            (Drives::TurnRight, "/user/hand/right/input/select/click"),
            (Drives::SwitchReuse, "/user/hand/left/input/menu/click"),
            (Drives::Quit, "/user/hand/right/input/menu/click"),
        ],
    },
    TOUCH,
    Profile {
        path: "/interaction_profiles/meta/touch_controller_plus",
        extension: Some("XR_META_touch_controller_plus"),
        ..TOUCH
    },
    Profile {
        path: "/interaction_profiles/valve/index_controller",
        buttons: &[
            (Button::Stick, both("thumbstick/click")),
            (Button::Primary, both("a/click")),
            (Button::Secondary, both("b/click")),
        ],
        touches: &[
            (Button::Trigger, both("trigger/touch")),
            (Button::Stick, both("thumbstick/touch")),
            (Button::Primary, both("a/touch")),
            (Button::Secondary, both("b/touch")),
        ],
        drives: &[
            (Drives::Walk, "/user/hand/left/input/thumbstick"),
            (Drives::Turn, "/user/hand/right/input/thumbstick"),
            (Drives::SwitchReuse, "/user/hand/left/input/a/click"),
            (Drives::Quit, "/user/hand/left/input/b/click"),
        ],
        ..TOUCH
    },
    Profile {
        path: "/interaction_profiles/htc/vive_controller",
        squeeze: "squeeze/click",
        stick: "trackpad",
        buttons: &[
            (Button::Stick, both("trackpad/click")),
            (Button::Menu, both("menu/click")),
        ],
        touches: &[(Button::Stick, both("trackpad/touch"))],
        drives: &[
            (Drives::Walk, "/user/hand/left/input/trackpad"),
            (Drives::Turn, "/user/hand/right/input/trackpad"),
            (Drives::SwitchReuse, "/user/hand/left/input/menu/click"),
            (Drives::Quit, "/user/hand/right/input/menu/click"),
        ],
        ..TOUCH
    },
    Profile {
        path: "/interaction_profiles/microsoft/motion_controller",
        squeeze: "squeeze/click",
        buttons: &[
            (Button::Stick, both("thumbstick/click")),
            (Button::Menu, both("menu/click")),
        ],
        touches: &[],
        drives: &[
            (Drives::Walk, "/user/hand/left/input/thumbstick"),
            (Drives::Turn, "/user/hand/right/input/thumbstick"),
            (Drives::SwitchReuse, "/user/hand/left/input/menu/click"),
            (Drives::Quit, "/user/hand/right/input/menu/click"),
        ],
        ..TOUCH
    },
    Profile {
        // Bare hands: fists walk and turn, so that a pinch is the application's alone.
        path: "/interaction_profiles/ext/hand_interaction_ext",
        extension: Some("XR_EXT_hand_interaction"),
        trigger: "pinch_ext/value",
        squeeze: "grasp_ext/value",
        stick: "",
        buttons: &[],
        touches: &[],
        vibrates: false,
        drives: &[
            (Drives::Advance, "/user/hand/left/input/grasp_ext/value"),
            (Drives::TurnRight, "/user/hand/right/input/grasp_ext/value"),
        ],
    },
];
