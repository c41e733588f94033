//! Actions of an application's own, as they are declared.

use stereolux_xr::{ActionKind, Actions};

const TOUCH: &str = "/interaction_profiles/oculus/touch_controller";
const TRIGGER: &str = "/user/hand/right/input/trigger/value";

#[test]
fn declarations_that_cannot_be_are_one_error_each() {
    let action = |name: &str, kind: &str, profile: &str, source: &str| {
        format!(
            "[[action]]\nname = '{name}'\nkind = '{kind}'\nbindings = {{ '{profile}' = ['{source}'] }}\n"
        )
    };
    let good = action("take", "bool", TOUCH, TRIGGER);
    let parsed = Actions::parse("a.toml", &format!("locomotion = false\n{good}")).unwrap();
    let built = Actions::default().with("take", ActionKind::Bool, &[(TOUCH, TRIGGER)]);
    assert_eq!(parsed, built.unwrap().without_locomotion());
    assert!(parsed.drops_locomotion() && !Actions::default().drops_locomotion());
    let haptic = "/user/hand/left/output/haptic";
    for (text, line, field, says) in [
        (
            action("take", "bool", TOUCH, TRIGGER),
            5,
            "name",
            "declared twice",
        ),
        (
            action("Take it", "bool", TOUCH, TRIGGER),
            5,
            "name",
            "a to z",
        ),
        (
            action(&"a".repeat(64), "bool", TOUCH, TRIGGER),
            5,
            "name",
            "63",
        ),
        (
            action("b", "bool", "/interaction_profiles/oculus/touch", TRIGGER),
            5,
            "bindings",
            TOUCH,
        ),
        (
            action("b", "bool", TOUCH, "trigger"),
            5,
            "bindings",
            "no path like",
        ),
        (
            action("b", "bool", TOUCH, "/user/hand/right/input/"),
            5,
            "bindings",
            "no path like",
        ),
        (
            action("b", "bool", TOUCH, "/user/hand/both/input/trigger"),
            5,
            "bindings",
            "no path like",
        ),
        (
            action("b", "float", TOUCH, haptic),
            5,
            "bindings",
            "kind float",
        ),
        (
            action("b", "haptic", TOUCH, TRIGGER),
            5,
            "bindings",
            "kind haptic",
        ),
        (
            action("b", "pose", TOUCH, TRIGGER),
            5,
            "bindings",
            "kind pose",
        ),
        (
            "[[action]]\nname = 'b'\nkind = 'bool'\n".to_owned(),
            5,
            "bindings",
            "none",
        ),
        (
            action("b", "boolean", TOUCH, TRIGGER),
            7,
            "action.kind",
            "boolean",
        ),
        (
            "[[action]]\nname = 'b'\nkind = 'bool'\nkeys = 3\n".to_owned(),
            8,
            "action.keys",
            "keys",
        ),
    ] {
        let error = Actions::parse("a.toml", &format!("{good}{text}")).unwrap_err();
        assert_eq!(error.line, Some(line), "{error}");
        assert_eq!(error.field.as_deref().unwrap_or_default(), field, "{error}");
        let shown = error.to_string();
        assert!(
            shown.contains(says) && shown.lines().count() == 1,
            "{shown}"
        );
    }
}
