//! Measuring: `bench`, metrics, image files.

pub mod bench;
pub mod images_files;
pub mod metrics_files;
