//! stereolux
pub mod gpu;
