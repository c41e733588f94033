//! The integration tests, in one binary: wgpu is linked once.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

mod suite {
    pub mod shaders;
    pub mod support;
}
