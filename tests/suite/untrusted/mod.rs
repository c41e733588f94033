//! Input that means harm, and mutated input.

// What the tests here take from other subjects.
use crate::suite::{viewer::viewer_files, viewer::viewer_support};

pub mod fuzzed;
pub mod hostile;
pub mod hostile_files;
pub mod hostile_pipes;
pub mod hostile_values;
pub mod hostile_viewer;
