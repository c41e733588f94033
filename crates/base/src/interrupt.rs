//! Ctrl-C: the first one ends a run in order, the second one at once.

use std::sync::atomic::{AtomicBool, Ordering};

static REQUESTED: AtomicBool = AtomicBool::new(false);

/// Whether the user wants the run to end.
pub fn requested() -> bool {
    REQUESTED.load(Ordering::Relaxed)
}

/// Catches Ctrl-C (and the signals by which a system asks a program to end) from now on.
pub fn catch() {
    let caught = ctrlc::set_handler(|| {
        if REQUESTED.swap(true, Ordering::Relaxed) {
            std::process::exit(1);
        }
    });
    if let Err(error) = caught {
        log::debug!("Ctrl-C ends the program at once: {error}");
    }
}
