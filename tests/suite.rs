//! The integration tests, in one binary: wgpu is linked once.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

mod suite {
    pub mod images_files;
    pub mod metrics_files;
    pub mod options_flags;
    pub mod options_settings;
    pub mod shaders;
    pub mod support;
    pub mod xr_headset;
    pub mod xr_replay;
    pub mod xr_simulated;
    pub mod xr_trace;
    pub mod xr_trajectory;
    pub mod xr_validation;
    pub mod xr_view;
}
