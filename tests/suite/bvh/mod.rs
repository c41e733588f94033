//! Hierarchies: how they are built, what rays meet, what moves and bends.

// What the tests here take from other subjects.
use crate::suite::support;

pub mod bvh_gpu;
pub mod bvh_probe;
/// The traversal's twin, from the tests of the crate that builds the hierarchies.
#[path = "../../../crates/bvh/tests/shared/reference.rs"]
pub mod bvh_reference;
/// What those tests build hierarchies over.
#[path = "../../../crates/bvh/tests/shared/shapes.rs"]
pub mod bvh_shapes;
pub mod deforming;
pub mod moving_instances;
pub mod moving_support;
