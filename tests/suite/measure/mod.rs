//! Measuring: `bench`, metrics, image files.

// What the tests here take from other subjects.
use crate::suite::support;

pub mod bench;
pub mod metrics_files;
