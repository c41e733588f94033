//! Headset application skeleton that ray traces global illumination in stereo.
//!
//! # One frame
//!
//! The [frame loop](frame_loop) asks an [XR session](xr) for the time at which the frame will be seen and for both eyes'
//! views then. It cannot tell whether a simulated headset, a recording or a runtime answers. The
//! [renderer](renderer) moves the [scene](scene) to the head: positions are f64 on the host and f32 relative to the
//! head on the device. If the photon map is missing, photons are traced from the lights through the two-level
//! [hierarchy](bvh), stored, and sorted into a grid. The left eye's rays find the surfaces, next-event estimation lights
//! them directly, photons within a radius light them indirectly. The left eye's hits are projected into the right eye;
//! those that it sees, and whose light does not depend on the viewing direction, are reused; the pixels that are
//! still empty are listed and rendered by the same passes. [`frame::plan()`] lists all steps in order. Images, statistics
//! and false-colour provenance are [written](output) to disk, and [metrics] compare them with a reference.
//!
//! # Modules
//!
//! - [`commands`], [`options`], [`settings`]: the program's commands, their checked options, every setting;
//! - [`frame_loop`], [`xr`], [`output`], [`mirror`], [`interrupt`]: frames from a session to files, a headset, a window;
//! - [`viewer`]: the same loop in a window in which a scene is walked through and edited;
//! - [`renderer`], [`frame`], [`gpu`]: images from views;
//! - [`scene`], [`bvh`]: what is rendered;
//! - [`limits`]: limits on reading files;
//! - [`metrics`], [`images`], [`false_color`]: errors against a reference, image files, pictures of views;
//! - [`bench`]: speed against error.
//!
//! Matrix names read target_from_source; points and vectors carry their space in their names.

#[cfg(feature = "bench")]
pub mod bench;
pub mod bvh;
pub mod commands;
mod decoding;
pub mod false_color;
mod files;
mod foreign_errors;
pub mod frame;
pub mod frame_loop;
pub mod gpu;
pub mod images;
pub mod interrupt;
pub mod limits;
pub mod metrics;
#[cfg_attr(not(feature = "mirror"), path = "no_mirror.rs")]
pub mod mirror;
pub mod options;
pub mod output;
mod pose;
mod printable;
pub mod renderer;
pub mod scene;
pub mod settings;
#[cfg(feature = "viewer")]
pub mod viewer;
#[cfg(feature = "mirror")]
mod windowing;
pub mod xr;
