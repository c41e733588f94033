//! `xr_submit`: see `shaders/passes/xr_submit.wesl`.

use super::{Over, Pass};

/// Writes an eye's image into a runtime's texture.
pub const PASS: Pass = Pass {
    name: "xr_submit",
    what: "Writes an eye's image into a runtime's texture.",
    over: Over::Fragments,
    traces: false,
    reads: &["shown_light"],
    writes: &[],
};
