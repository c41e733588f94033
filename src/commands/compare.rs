//! `compare`: one JSON object on stdout.

use super::{Failure, print_line};
use crate::metrics::{FlipView, compare_files};
use crate::options::CompareOptions;

/// Compares two images; 1 if the relative MSE exceeds the limit.
pub fn compare(options: &CompareOptions) -> Result<u8, Failure> {
    let comparison = compare_files(
        &options.image,
        &options.reference,
        options.mask.as_deref(),
        FlipView {
            exposure: options.exposure,
            pixels_per_degree: options.pixels_per_degree,
        },
        options.limits.load(),
    )?;
    let text = serde_json::to_string_pretty(&comparison).map_err(Failure::failed)?;
    print_line(&text)?;
    let exceeds = options
        .max_rel_mse
        .is_some_and(|limit| comparison.exceeds(limit));
    Ok(u8::from(exceeds))
}
