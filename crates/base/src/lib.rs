//! What every crate of stereolux stands on.
//!
//! - [`limits`], [`files`], [`decoding`]: reading what others made within limits, writing files that are whole or not there;
//! - [`printable`], [`foreign_errors`]: messages of one line;
//! - [`features`]: the words that shaders are specialised by;
//! - [`quantiles`]: medians of measured figures;
//! - [`pose`]: where something is and how it is turned.
//!
//! Nothing here knows scenes, devices or images.

pub mod decoding;
pub mod features;
pub mod files;
pub mod foreign_errors;
pub mod limits;
pub mod pose;
pub mod printable;
pub mod quantiles;
