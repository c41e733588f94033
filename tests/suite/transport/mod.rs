//! How light travels: BSDFs, lights, paths, photons, and scenes whose light is known beforehand.

// What the tests here take from other subjects.
use crate::suite::{block_statistics, bvh::trace_probe, chi_square, support, user_bsdf_example};

pub mod adaptive_radius;
pub mod blend;
pub mod bsdf_furnace;
pub mod bsdf_layer;
pub mod bsdf_probe;
pub mod bsdf_sampling;
pub mod bsdf_surface;
pub mod bsdf_twin;
pub mod bsdf_user;
pub mod caustics;
pub mod closed_sphere;
pub mod convergence;
pub mod edges;
pub mod emission_maps;
pub mod gathers;
pub mod hard_cases;
pub mod hard_extremes;
pub mod hard_scales;
pub mod hard_support;
pub mod light_candidates;
pub mod light_tree;
pub mod lights_emission;
pub mod lights_probe;
pub mod lights_sampling;
pub mod mips;
pub mod parts;
pub mod photon_guide;
pub mod photon_map;
pub mod photons_over_time;
pub mod progressive;
pub mod reference;
pub mod sphere;
pub mod techniques;
