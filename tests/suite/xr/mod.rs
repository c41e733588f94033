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
