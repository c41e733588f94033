//! Hierarchies: how they are built, what rays meet, what moves and bends.

// What the tests here take from other subjects.
use crate::suite::support;

/// The traversal's twin, from the tests of the crate that builds the hierarchies.
#[allow(dead_code)]
#[path = "../../../crates/bvh/tests/shared/reference.rs"]
pub mod bvh_reference;
/// What those tests build hierarchies over.
#[path = "../../../crates/bvh/tests/shared/shapes.rs"]
pub mod bvh_shapes;
pub mod deforming;
pub mod moving_instances;
pub mod moving_support;
/// From the tests of shaders without a renderer.
#[allow(dead_code)]
#[path = "../../../crates/gpu/tests/shared/trace_probe.rs"]
pub mod trace_probe;
