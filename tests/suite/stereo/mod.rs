//! What the right eye takes over from the left.

// What the tests here take from other subjects.
use crate::suite::{support, transport::hard_support, transport::parts};

pub mod cornell;
pub mod half_rate;
pub mod hard_reuse;
pub mod lookup;
pub mod stereo_exact;
