//! One frame and the frames around it: the plan, shaders and layouts, reconstruction over time, determinism.

// What the tests here take from other subjects.
use crate::suite::{
    bvh::deforming, bvh::trace_probe, stereo::cornell, support, transport::hard_support,
    transport::lights_sampling, xr::openxr_runtime, xr::openxr_support,
};

pub mod anti_aliasing;
pub mod deforming_motion;
pub mod determinism;
pub mod endurance;
pub mod forced_features;
pub mod frame_plan;
pub mod frames_in_flight;
pub mod images_in_mirrors;
pub mod layout;
pub mod outliers;
pub mod quality;
pub mod reconstruction;
pub mod resize;
pub mod shaders;
pub mod uniform_branches;
pub mod user_passes;
pub mod work;
