//! Structs that host and shaders share, beside the hierarchy's ([`crate::bvh::records`]). Each is `repr(C)`;
//! `tests/suite/frame/layout.rs` compares size and offsets of every one, and the numbers beside them, with what naga reads from
//! the shaders.

pub mod deform;
pub mod frame;
pub mod light;
pub mod material;
pub mod mirror;
pub mod photon;
pub mod reconstruction;
pub mod stereo;
pub mod still;
pub mod submit;
