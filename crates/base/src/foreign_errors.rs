//! Panics and messages of other people's code as errors of ours: one plain line.
//!
//! Two libraries panic where a program cannot keep them from it: wgpu when the device is lost while it is waited for, and
//! winit when the display lacks an extension.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind, set_hook, take_hook};
use std::sync::Once;

thread_local! {
    /// Whether a panic on this thread is going to be caught and reported as an error.
    static IS_CAUGHT: Cell<bool> = const { Cell::new(false) };
}

/// Runs `work`; what it panics with comes back as one line, and nothing is printed.
///
/// # Errors
/// The panic's message.
pub fn caught<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let otherwise = take_hook();
        set_hook(Box::new(move |info: &PanicHookInfo<'_>| {
            if !IS_CAUGHT.get() {
                otherwise(info);
            }
        }));
    });
    let was_caught = IS_CAUGHT.replace(true);
    let outcome = catch_unwind(AssertUnwindSafe(work));
    IS_CAUGHT.set(was_caught);
    outcome.map_err(|payload| {
        let text = payload
            .downcast_ref::<&str>()
            .map(|text| (*text).to_owned())
            .or_else(|| payload.downcast_ref::<String>().cloned())
            .unwrap_or_default();
        one_line(&text)
    })
}

/// wgpu's and WESL's messages span lines and may be coloured; an error of ours is one plain line.
pub fn one_line(text: &str) -> String {
    let mut pieces = text.split('\u{1b}');
    let first = pieces.next().unwrap_or_default();
    // A colour sequence ends with the letter m.
    let rest = pieces.map(|piece| piece.split_once('m').map_or("", |(_, rest)| rest));
    let plain: String = std::iter::once(first).chain(rest).collect();
    plain.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::caught;

    #[test]
    fn a_panic_is_one_line_and_success_passes_through() {
        assert_eq!(caught(|| 7), Ok(7));
        let said = caught(|| -> u32 { panic!("two\n lines") });
        assert_eq!(said, Err("two lines".to_owned()));
        let owned = caught(|| -> u32 { panic!("number {}", 3) });
        assert_eq!(owned, Err("number 3".to_owned()));
    }
}
