//! The scenes that are embedded in the library, made by code, and what is known of them in closed form.

pub mod caustic;
pub mod cornell;
mod gallery;
mod glb_writer;
mod paint;
pub mod parade;
pub mod plane;
mod shapes;
pub mod sphere;

use stereolux_scene::SceneError;

/// Makes a scene as binary glTF.
type Make = fn() -> Result<Vec<u8>, SceneError>;

/// All scenes by name.
pub const SCENES: [(&str, Make); 6] = [
    ("cornell", cornell::write),
    ("plane", plane::write),
    ("sphere", sphere::write),
    ("caustic", caustic::write),
    ("gallery", gallery::write),
    ("parade", parade::write),
];
