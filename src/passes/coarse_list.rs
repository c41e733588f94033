//! `coarse_list`: see `shaders/passes/coarse_list.wesl`.

use super::{Over, Pass};

/// Lists the pixels that gather for themselves at half rate.
pub const PASS: Pass = Pass {
    name: "coarse_list",
    what: "Lists the pixels that gather for themselves at half rate.",
    over: Over::Hits,
    traces: true,
    reads: &[],
    writes: &["coarse_list", "coarse_count"],
};
