//! Scenes: edited, saved and met by rays, with what is rendered of them.

// What the tests here take from other subjects.
use crate::suite::{adding_example, bvh::trace_probe, support, transport::hard_support};

pub mod edited_frames;
/// From the tests of edits themselves.
#[path = "../../../crates/scene/tests/shared/edits.rs"]
pub mod edits;
pub mod edits_left;
pub mod parts;
pub mod ray_cast;
