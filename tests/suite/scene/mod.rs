//! Scenes: imported, edited, saved, and the embedded ones.

// What the tests here take from other subjects.
use crate::suite::{bvh::bvh_probe, embedded_scenes, support};

pub mod edited_frames;
pub mod editing;
pub mod parts;
pub mod ray_cast;
pub mod saving;
pub mod scene_builtin;
pub mod scene_faults;
pub mod scene_import;
pub mod scene_motion;
