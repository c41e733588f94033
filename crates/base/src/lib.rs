//! What every crate of stereolux stands on.
//!
//! - [`limits`], [`files`] and [`decoding`]: what others made is read within limits; files are whole or not there;
//! - [`printable`] and [`foreign_errors`]: messages of one line;
//! - [`interrupt`]: what Ctrl-C asks for;
//! - [`features`]: the words that shaders are specialised by;
//! - [`quantiles`]: medians of measured figures;
//! - [`random`]: random numbers from a seed;
//! - [`user_folders`]: where the system wants what is a user's;
//! - [`pose`]: where something is and how it is turned;
//! - [`mod@words`]: enums with a word per value.
//!
//! Nothing here knows scenes, devices or images.

pub mod decoding;
pub mod features;
pub mod files;
pub mod foreign_errors;
pub mod interrupt;
pub mod limits;
pub mod pose;
pub mod printable;
pub mod quantiles;
pub mod random;
pub mod user_folders;
pub mod words;
