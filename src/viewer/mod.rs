//! The desktop viewer (`view`): a window in which a person walks through the scene, sees what each eye gets, edits, and
//! looks into what the renderer does.
//!
//! Three threads: the window's answers events and draws egui ([`window`], [`app`], [`panels`]); the renderer's turns what
//! is wanted into pictures through the frame loop ([`worker`], [`studio`]); a third reads files ([`loading`]). The window
//! never waits for either. A frame travels as an image and as what its pixels see ([`frames`]), so that a click finds its
//! object without asking the device; an edit travels as an [`Edit`](crate::scene::edit::Edit), which both ends carry out on
//! their own copy of the scene.

pub mod accumulate;
pub mod app;
pub mod fly_camera;
pub mod frames;
mod gamepad;
pub mod gizmo;
mod keys;
pub mod layout;
mod loading;
pub mod memory;
mod opening;
pub mod painter;
pub mod panels;
mod picture;
mod reference;
mod scene_facts;
mod screenshot;
pub mod session;
mod studio;
mod window;
mod worker;

pub use app::{App, Start};
pub use window::{ViewError, show};
