//! Error metrics of an image against a reference.
//!
//! - [`compare`]: relative MSE, RMSE, mean relative bias and FLIP with their standard errors, over all pixels or those of a [`Mask`];
//! - [`RenderMoments`]: bias and variance apart, from independent renders;
//! - [`binocular_error`]: how much the two eyes' errors disagree at points that both see.
//!
//! Sums are formed in f64. Throughout, x is the image, r the reference, and s the mean of r^2 over the pixels and
//! channels of the whole reference, masked or not: so the relative MSEs of a mask and of its complement add up, weighted
//! by their pixels, to that of the whole image.

mod binocular;
mod comparison;
mod flip;
mod moments;

pub use binocular::{BinocularError, binocular_error, error_image};
pub use comparison::{
    CompareError, ComparedFiles, Comparison, compare, compare_and_keep, rel_mse_map,
};
pub use flip::{DEFAULT_PIXELS_PER_DEGREE, FlipView, flip_map};
pub use moments::{BiasVariance, RenderMoments};
pub use stereolux_base::quantiles::{median, quantile};

use crate::images::{Image, ImageRgb, srgb_decode};

/// Side of the blocks of pixels that standard errors are taken over. Neighbours are correlated (one photon serves many
/// gather points, FLIP filters), so that single pixels as samples would claim too much.
pub const STANDARD_ERROR_BLOCK: u32 = 8;

/// Images that cannot be compared. Each message is one line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MetricsError {
    /// Two images differ in size.
    #[error(
        "{what} has {found:?} pixels (width, height), but {expected:?} are needed; compare images of equal size"
    )]
    SizeMismatch {
        /// Which image.
        what: &'static str,
        /// Its width and height.
        found: [u32; 2],
        /// Width and height of the other.
        expected: [u32; 2],
    },
    /// No pixel is left to compare.
    #[error("no pixel is left to compare: {0}")]
    NothingCounted(&'static str),
    /// A correspondence that points out of the image.
    #[error(
        "the correspondence of pixel {from} points to pixel {to}, but the other image has {pixels}"
    )]
    CorrespondenceOutside {
        /// Index of the pixel.
        from: usize,
        /// Index that it points to.
        to: usize,
        /// Pixels of the other image.
        pixels: usize,
    },
    /// Too few independent renders for a spread.
    #[error("{found} independent renders give no spread; at least {needed} are needed")]
    TooFewRenders {
        /// Renders given.
        found: usize,
        /// Renders needed.
        needed: usize,
    },
}

fn require_size<P, Q>(
    what: &'static str,
    image: &Image<P>,
    other: &Image<Q>,
) -> Result<(), MetricsError> {
    let (found, expected) = ([image.width, image.height], [other.width, other.height]);
    if found == expected {
        Ok(())
    } else {
        Err(MetricsError::SizeMismatch {
            what,
            found,
            expected,
        })
    }
}

fn is_finite(pixel: &[f32; 3]) -> bool {
    pixel.iter().all(|channel| channel.is_finite())
}

/// Mean of the squares over pixels and channels of the finite pixels; 0 if there are none.
fn mean_square(image: &ImageRgb) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for channel in image
        .pixels
        .iter()
        .filter(|pixel| is_finite(pixel))
        .flatten()
    {
        sum += f64::from(*channel) * f64::from(*channel);
        count += 1.0;
    }
    if count > 0.0 { sum / count } else { 0.0 }
}

fn finite(value: f64) -> Option<f64> {
    Some(value).filter(|value| value.is_finite())
}

/// Which pixels count.
pub type Mask = Image<bool>;

impl Mask {
    /// White pixels count: those with a channel of at least half, sRGB encoded.
    #[must_use]
    pub fn from_image(image: &ImageRgb) -> Self {
        let half = srgb_decode(0.5) as f32;
        let white = |pixel: &[f32; 3]| pixel.iter().any(|&channel| channel >= half);
        image.like(image.pixels.iter().map(white))
    }
}

/// Mean over pixels of values that come in blocks, with the standard error of that mean.
///
/// With n_b pixels and mean m_b in block b of B, the mean is m = sum n_b m_b / N and its variance
/// B / (B - 1) sum n_b^2 (m_b - m)^2 / N^2: the ratio estimator of cluster sampling (Cochran, Sampling Techniques,
/// 3rd ed., section 9A.2).
#[derive(Clone, Debug, Default)]
pub struct BlockedMean {
    sums: Vec<f64>,
    counts: Vec<f64>,
    blocks_per_row: usize,
}

impl BlockedMean {
    /// Of nothing yet, for images of this size.
    #[must_use]
    pub fn new(width: u32, height: u32) -> Self {
        let columns = width.div_ceil(STANDARD_ERROR_BLOCK) as usize;
        let rows = height.div_ceil(STANDARD_ERROR_BLOCK) as usize;
        Self {
            sums: vec![0.0; columns * rows],
            counts: vec![0.0; columns * rows],
            blocks_per_row: columns,
        }
    }

    /// Adds the value of the pixel with this index in an image of this width.
    pub fn add(&mut self, index: usize, width: u32, value: f64) {
        let side = STANDARD_ERROR_BLOCK as usize;
        let (x, y) = (index % width as usize, index / width as usize);
        let block = y / side * self.blocks_per_row + x / side;
        if let (Some(sum), Some(count)) = (self.sums.get_mut(block), self.counts.get_mut(block)) {
            *sum += value;
            *count += 1.0;
        }
    }

    /// NaN of nothing.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.sums.iter().sum::<f64>() / self.counts.iter().sum::<f64>()
    }

    /// Square root of the mean, with its standard error by the delta method: the mean's over twice the root.
    fn root(&self) -> (f64, Option<f64>) {
        let root = self.mean().sqrt();
        let error = self.standard_error();
        (
            root,
            error.map(|error| {
                if root > 0.0 {
                    error / (2.0 * root)
                } else {
                    0.0
                }
            }),
        )
    }

    /// `None` where fewer than two blocks hold a pixel.
    #[must_use]
    pub fn standard_error(&self) -> Option<f64> {
        let total: f64 = self.counts.iter().sum();
        let mean = self.mean();
        let filled = self.counts.iter().filter(|&&count| count > 0.0).count() as f64;
        if filled < 2.0 {
            return None;
        }
        let squares: f64 = self
            .sums
            .iter()
            .zip(&self.counts)
            .map(|(sum, count)| (sum - count * mean).powi(2))
            .sum();
        Some((filled / (filled - 1.0) * squares).sqrt() / total)
    }
}
