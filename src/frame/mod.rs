//! The frame: a list of steps, which is what runs.
//!
//! ```text
//! passes.rs   one row per pass                 buffers.rs  one row per buffer
//!        \                                      /
//!         plan/: settings, features, sizes -> steps, in order; no device
//!                              |
//!         run.rs: compiles, allocates, binds by the rules of bind.rs, dispatches
//! ```
//!
//! A shader declares names; [`bind`] resolves them to buffers. What a shader declares is reflected, not repeated.

pub mod bind;
pub mod buffers;
pub mod homes;
pub mod listing;
pub mod passes;
pub mod photon_layout;
pub mod plan;
pub mod run;
pub mod step;
pub mod user_passes;
pub mod work;

pub use buffers::ImageLayout;
pub use photon_layout::{AdapterLimits, MapConfig, MapKind, MapLayout};
pub use plan::{FrameSpec, GatherSlices, ShapeCounts, plan};
pub use run::{FrameRun, Play, SAMPLES_PER_SUBMISSION};
pub use step::{Eye, Only, PlannedStage, Stage, Step};
