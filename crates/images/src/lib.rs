//! Images: their files, and their errors against a reference.
//!
//! - [`images`]: images in memory, PNG and EXR, tone curve;
//! - [`exr_file`]: OpenEXR files with layers and attributes;
//! - [`metrics`]: errors, apart by bias and variance, FLIP, what the two eyes disagree in.

pub mod exr_file;
pub mod images;
pub mod metrics;
