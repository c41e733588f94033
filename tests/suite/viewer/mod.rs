//! Windows: the viewer, the desktop mirror, views of intermediate results.

// What the tests here take from other subjects.
use crate::suite::{
    bvh::bvh_reference, support, textures, transport::bsdf_probe, transport::hard_support,
    transport::photon_map, xr::openxr_picture, xr::openxr_runtime, xr::openxr_support,
};

pub mod drag;
pub mod inspect;
pub mod inspect_photons;
pub mod mirror;
pub mod viewer_app;
pub mod viewer_files;
pub mod viewer_painter;
pub mod viewer_selection;
pub mod viewer_sketch;
pub mod viewer_support;
pub mod viewer_toolbar;
pub mod viewer_views;
pub mod viewer_window;
pub mod virtual_screen;
