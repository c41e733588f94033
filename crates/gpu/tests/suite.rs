//! Shaders on a device without a renderer: the library, traversal, packing.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::type_complexity,
    missing_docs
)]

#[path = "shared/adapter.rs"]
#[allow(dead_code)]
mod adapter;
/// The traversal's twin, from the tests of the crate that builds the hierarchies.
#[path = "../../bvh/tests/shared/reference.rs"]
#[allow(dead_code)]
mod bvh_reference;
/// What those tests build hierarchies over.
#[path = "../../bvh/tests/shared/shapes.rs"]
#[allow(dead_code)]
mod bvh_shapes;
#[path = "shared/trace_probe.rs"]
#[allow(dead_code)]
mod trace_probe;
#[path = "shared/uniform_branches.rs"]
mod uniform_branches;

mod suite {
    mod bsdf_specialised;
    mod carried;
    mod filtered;
    mod library;
    mod pipeline_cache;
    mod records;
    mod shading;
    mod surroundings;
    mod traversal;
    mod uniform_branches;
}
