//! Structs that host and shaders share. Each is `repr(C)`; `tests/suite/layout.rs` compares size and offsets of every
//! one with what naga reads from the shaders.

pub mod bvh;
pub mod deform;
pub mod frame;
pub mod light;
pub mod material;
pub mod mirror;
pub mod reconstruction;
pub mod submit;
