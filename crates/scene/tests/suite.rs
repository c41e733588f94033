//! Scenes: imported, edited, moved, and the embedded ones.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::type_complexity,
    missing_docs
)]

#[path = "../../base/tests/shared/cases.rs"]
mod cases;
#[path = "shared/edits.rs"]
mod edits;
/// The example that makes the files under assets/.
#[path = "../examples/make_assets/scenes/mod.rs"]
#[allow(dead_code)]
mod embedded_scenes;
#[path = "../../base/tests/shared/folders.rs"]
#[allow(dead_code)]
mod folders;
#[path = "../../bvh/tests/shared/shapes.rs"]
#[allow(dead_code)]
mod shapes;

mod suite {
    mod builtin;
    mod editing;
    mod faults;
    mod hostile_values;
    mod import;
    mod motion;
    mod outside;
    mod saving;
    mod whole;
}
