//! Sessions: headsets, traces, recordings, OpenXR runtimes.

// What the tests here take from other subjects.
use crate::suite::support;

pub mod actions;
pub mod late_views;
pub mod openxr_failures;
pub mod openxr_picture;
pub mod openxr_remote;
pub mod openxr_runtime;
pub mod openxr_submit;
pub mod openxr_support;
pub mod xr_headset;
pub mod xr_replay;
pub mod xr_simulated;
pub mod xr_trace;
pub mod xr_trajectory;
pub mod xr_validation;
pub mod xr_view;
