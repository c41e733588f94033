//! `mirror`: see `shaders/passes/mirror.wesl`.

use super::{Over, Pass};

/// Draws an eye's image into its rectangle of a desktop window.
pub const PASS: Pass = Pass {
    name: "mirror",
    what: "Draws an eye's image into its rectangle of a desktop window.",
    over: Over::Fragments,
    traces: false,
    reads: &["shown_light"],
    writes: &[],
};
