//! The program from outside: commands, options, settings, and the list of checks.

// What the tests here take from other subjects.
use crate::suite::{
    bvh::trace_probe, gallery_tour_example, minimal_example, own_loop_example, support, template,
};

pub mod application;
pub mod checks;
pub mod commands;
pub mod exr_output;
pub mod options_flags;
pub mod options_saving;
pub mod options_settings;
pub mod out_folder;
pub mod panels;
pub mod ranges;
pub mod scene_options;
pub mod teleport;
pub mod trace_file;
pub mod world_changes;
