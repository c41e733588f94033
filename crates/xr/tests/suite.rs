//! Sessions without a runtime: headsets, traces, recordings, simulated hands.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::type_complexity,
    missing_docs
)]

#[path = "../../base/tests/shared/cases.rs"]
mod cases;
#[path = "../../base/tests/shared/folders.rs"]
#[allow(dead_code)]
mod folders;

mod suite {
    mod actions;
    mod headset;
    mod replay;
    mod simulated;
    mod trace;
    mod trajectory;
    mod validation;
    mod view;
}
