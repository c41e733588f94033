//! Actions of an application's own, as they are declared.

use stereolux_xr::{ActionKind, Actions};

use crate::cases::cases;

const TOUCH: &str = "/interaction_profiles/oculus/touch_controller";
const TRIGGER: &str = "/user/hand/right/input/trigger/value";

#[test]
fn declarations_that_cannot_be_are_one_error_each() {
    let action = |name: &str, kind: &str, rest: &str| {
        format!("[[action]]\nname = '{name}'\nkind = '{kind}'\n{rest}\n")
    };
    let bindings = format!("bindings = {{ '{TOUCH}' = ['{TRIGGER}'] }}");
    let good = action("take", "bool", &bindings);
    let parsed = Actions::parse("a.toml", &format!("locomotion = false\n{good}")).unwrap();
    let built = Actions::default().with("take", ActionKind::Bool, &[(TOUCH, TRIGGER)]);
    assert_eq!(parsed, built.unwrap().without_locomotion());
    assert!(parsed.drops_locomotion() && !Actions::default().drops_locomotion());
    let table = r#"
        take | bool | $bindings | 5 | name | declared twice
        Take it | bool | $bindings | 5 | name | a to z
        $long | bool | $bindings | 5 | name | 63
        b | bool | bindings = { '/interaction_profiles/oculus/touch' = ['$trigger'] } | 5 | bindings | $touch
        b | bool | bindings = { '$touch' = ['trigger'] } | 5 | bindings | no path like
        b | bool | bindings = { '$touch' = ['/user/hand/right/input/'] } | 5 | bindings | no path like
        b | bool | bindings = { '$touch' = ['/user/hand/both/input/trigger'] } | 5 | bindings | no path like
        b | float | bindings = { '$touch' = ['/user/hand/left/output/haptic'] } | 5 | bindings | kind float
        b | haptic | $bindings | 5 | bindings | kind haptic
        b | pose | $bindings | 5 | bindings | kind pose
        b | bool | - | 5 | bindings | none
        b | boolean | $bindings | 7 | action.kind | boolean
        b | bool | keys = 3 | 8 | action.keys | keys
    "#;
    let table = table
        .replace("$bindings", &bindings)
        .replace("$touch", TOUCH);
    let table = table
        .replace("$trigger", TRIGGER)
        .replace("$long", &"a".repeat(64));
    for [name, kind, rest, line, field, says] in cases(&table) {
        let text = action(name, kind, rest);
        let error = Actions::parse("a.toml", &format!("{good}{text}")).unwrap_err();
        assert_eq!(error.line, Some(line.parse().unwrap()), "{error}");
        assert_eq!(error.field.as_deref().unwrap_or_default(), field, "{error}");
        let shown = error.to_string();
        assert!(
            shown.contains(says) && shown.lines().count() == 1,
            "{shown}"
        );
    }
}
