//! `kd_keys`: see `shaders/passes/kd_keys.wesl`.

use super::{Over, Pass};

/// Takes one coordinate of every photon as its key.
pub const PASS: Pass = Pass {
    name: "kd_keys",
    what: "Takes one coordinate of every photon as its key.",
    over: Over::Photons,
    traces: false,
    reads: &["photon_counters", "photons"],
    writes: &["radix_to"],
};
