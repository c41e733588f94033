//! The desktop viewer (`view`): a window in which a person walks through the scene, sees what each eye gets, edits, and
//! looks into what the renderer does.
//!
//! Three threads: the UI thread answers events and draws egui ([`window`], [`ui`], [`app`]); the render thread turns requests
//! into pictures ([`worker`], [`render_engine`]); a third reads files ([`loading`]). The window never waits for either. A
//! frame travels as an image and as what its pixels see ([`frames`]), so that a click finds its object without asking the
//! device; an edit travels as an [`Edit`](crate::scene::edit::Edit), which both ends carry out on their own copy of the scene.

mod aim;
pub mod app;
mod fields;
pub mod fly_camera;
pub mod frames;
mod gamepad;
pub mod gizmo;
mod keys;
pub mod layout;
mod loading;
mod open_files;
pub mod painter;
pub mod panels;
mod picture;
mod pressure;
mod question;
mod reference;
mod render_engine;
mod save_files;
mod screenshot;
mod selection;
pub mod session;
pub mod sketch;
mod textures;
pub mod theme;
mod ui;
pub mod view_pictures;
mod window;
pub mod window_state;
mod worker;
mod zoom;

pub use app::{App, Start};
pub use window::{ViewError, show};
