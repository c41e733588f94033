//! Structs that host and shaders share. Each is `repr(C)`; `tests/suite/layout.rs` compares size and offsets of every
//! one, and the numbers beside them, with what naga reads from the shaders.

pub mod stereo;
