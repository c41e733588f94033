//! Hierarchies: how they are built, what rays meet, what moves and bends.

// What the tests here take from other subjects.
use crate::suite::support;

pub mod bvh_build;
pub mod bvh_gpu;
pub mod bvh_probe;
pub mod bvh_reference;
pub mod deforming;
pub mod moving_instances;
pub mod moving_support;
