//! Bias and variance apart, from independent renders of one view.
//!
//! Of n renders x with mean m and sample variance v per pixel and channel, against a reference r whose own variance is u:
//! E (m - r)^2 = bias^2 + v / n + u, so that (m - r)^2 - v / n - u estimates the squared bias without bias of its own. It may
//! come out negative where there is next to none.

use serde::{Deserialize, Serialize};

use super::{BlockedMean, Mask, MetricsError, mean_square, require_size};
use crate::images::{Image, ImageRgb};

/// Squared bias and variance in units of relative MSE: means over pixels and channels, each over r^2 + 0.01 s.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BiasVariance {
    /// Squared bias: what no number of renders averages away. An unbiased estimate, so noise may make it negative.
    pub bias_squared: f64,
    /// Its standard error over blocks of 8x8 pixels.
    pub bias_squared_se: Option<f64>,
    /// Variance of a single render.
    pub variance: f64,
    /// Its standard error over blocks of 8x8 pixels.
    pub variance_se: Option<f64>,
    /// Renders.
    pub renders: u32,
}

/// Running mean and sum of squared deviations of renders that differ in their random numbers only (Welford 1962).
#[derive(Clone, Debug, PartialEq)]
pub struct RenderMoments {
    /// Renders taken in.
    pub count: u32,
    /// Mean of each pixel and channel, by rows from the top.
    pub mean: Image<[f64; 3]>,
    /// Sum of squared deviations from the mean.
    pub squares: Image<[f64; 3]>,
}

impl RenderMoments {
    /// None yet, for images of this size.
    #[must_use]
    pub fn new(width: u32, height: u32) -> Self {
        let zero = Image {
            width,
            height,
            pixels: vec![[0.0; 3]; width as usize * height as usize],
        };
        Self {
            count: 0,
            mean: zero.clone(),
            squares: zero,
        }
    }

    /// Takes a render in.
    ///
    /// # Errors
    /// [`MetricsError::SizeMismatch`].
    pub fn add(&mut self, render: &ImageRgb) -> Result<(), MetricsError> {
        require_size("a render", render, &self.mean)?;
        self.count += 1;
        let count = f64::from(self.count);
        let moments = self.mean.pixels.iter_mut().zip(&mut self.squares.pixels);
        for ((mean, squares), pixel) in moments.zip(&render.pixels) {
            for channel in 0..3 {
                let value = f64::from(pixel[channel]);
                let before = value - mean[channel];
                mean[channel] += before / count;
                squares[channel] += before * (value - mean[channel]);
            }
        }
        Ok(())
    }

    /// The mean as an image of floats.
    #[must_use]
    pub fn mean_image(&self) -> ImageRgb {
        let pixels = self.mean.pixels.iter();
        self.mean
            .like(pixels.map(|pixel| pixel.map(|channel| channel as f32)))
    }

    /// Variance of the mean itself, v / n, in units of relative MSE over the pixels of `mask`; `None` from fewer than two
    /// renders or of no pixel. The square root is the relative standard error of the mean image.
    #[must_use]
    pub fn relative_variance_of_mean(&self, mask: Option<&Mask>) -> Option<f64> {
        if self.count < 2 {
            return None;
        }
        let floor = 0.01 * mean_square(&self.mean_image());
        let scale = 1.0 / (f64::from(self.count) * f64::from(self.count - 1));
        let (mut sum, mut pixels) = (0.0, 0.0);
        let moments = self.mean.pixels.iter().zip(&self.squares.pixels);
        for (index, (mean, squares)) in moments.enumerate() {
            if mask.is_some_and(|mask| !mask.pixels.get(index).copied().unwrap_or(false)) {
                continue;
            }
            for channel in 0..3 {
                if squares[channel] > 0.0 {
                    sum += squares[channel] * scale / (mean[channel].powi(2) + floor);
                }
            }
            pixels += 3.0;
        }
        (pixels > 0.0).then(|| sum / pixels)
    }

    /// Squared bias against `reference` (moments of an unbiased renderer) and variance of one render.
    ///
    /// # Errors
    /// [`MetricsError::SizeMismatch`]; [`MetricsError::TooFewRenders`] under two on either side.
    pub fn bias_and_variance(&self, reference: &Self) -> Result<BiasVariance, MetricsError> {
        require_size("the renders' mean", &self.mean, &reference.mean)?;
        for moments in [self, reference] {
            if moments.count < 2 {
                return Err(MetricsError::TooFewRenders {
                    found: moments.count as usize,
                    needed: 2,
                });
            }
        }
        let floor = 0.01 * mean_square(&reference.mean_image());
        let (width, height) = (self.mean.width, self.mean.height);
        let (mut bias, mut variance) = (
            BlockedMean::new(width, height),
            BlockedMean::new(width, height),
        );
        let per_render = 1.0 / f64::from(self.count - 1);
        let per_mean = per_render / f64::from(self.count);
        let per_reference = 1.0 / (f64::from(reference.count) * f64::from(reference.count - 1));
        for index in 0..self.mean.pixels.len() {
            let (m, squares) = (self.mean.pixels[index], self.squares.pixels[index]);
            let (r, r_squares) = (
                reference.mean.pixels[index],
                reference.squares.pixels[index],
            );
            let (mut bias_here, mut variance_here) = (0.0, 0.0);
            for c in 0..3 {
                let over = r[c] * r[c] + floor;
                let noise = squares[c] * per_mean + r_squares[c] * per_reference;
                let difference = (m[c] - r[c]).powi(2) - noise;
                // A black reference that is met is no error whatever the scale.
                if difference != 0.0 {
                    bias_here += difference / over / 3.0;
                }
                if squares[c] > 0.0 {
                    variance_here += squares[c] * per_render / over / 3.0;
                }
            }
            bias.add(index, width, bias_here);
            variance.add(index, width, variance_here);
        }
        Ok(BiasVariance {
            bias_squared: bias.mean(),
            bias_squared_se: bias.standard_error(),
            variance: variance.mean(),
            variance_se: variance.standard_error(),
            renders: self.count,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stereolux_base::random;

    const SIDE: u32 = 64;

    /// Renders around `level` with uniform noise of +-`a`, which has variance a^2 / 3.
    fn moments(level: f64, a: f64, count: u32, seed: u64) -> RenderMoments {
        let mut state = seed;
        let mut uniform = || random::unit(&mut state);
        let mut moments = RenderMoments::new(SIDE, SIDE);
        for _ in 0..count {
            let pixels = (0..SIDE * SIDE)
                .map(|_| [0; 3].map(|_: i32| (level + a * (2.0 * uniform() - 1.0)) as f32))
                .collect();
            moments
                .add(&Image::new(SIDE, SIDE, pixels).unwrap())
                .unwrap();
        }
        moments
    }

    #[test]
    fn moments_of_two_renders_by_hand() {
        let mut moments = RenderMoments::new(8, 8);
        for level in [1.0, 3.0] {
            moments
                .add(&Image::filled(8, 8, [level; 3]).unwrap())
                .unwrap();
        }
        // Mean 2, deviations -1 and 1, so their squares sum to 2 and the variance of the mean is 2 / (2 x 1) = 1.
        assert_eq!(moments.mean.pixels[5], [2.0; 3]);
        assert_eq!(moments.squares.pixels[5], [2.0; 3]);
        let relative = moments.relative_variance_of_mean(None).unwrap();
        assert!((relative - 1.0 / 4.04).abs() < 1e-12);
        assert!(
            moments
                .add(&Image::filled(9, 8, [0.0; 3]).unwrap())
                .is_err()
        );
        assert_eq!(
            RenderMoments::new(8, 8).relative_variance_of_mean(None),
            None
        );
    }

    #[test]
    fn known_bias_and_variance_are_told_apart() {
        // Level 2.2 with noise +-0.5 against 2.0 with noise +-0.1: over = 4.04 to the noise of the mean square;
        // bias^2 = 0.04 / 4.04, variance = 0.25 / 3 / 4.04.
        let biased = moments(2.2, 0.5, 6, 1);
        let reference = moments(2.0, 0.1, 20, 2);
        let found = biased.bias_and_variance(&reference).unwrap();
        let (bias, variance) = (0.04 / 4.04, 0.25 / 3.0 / 4.04);
        let (bias_se, variance_se) = (found.bias_squared_se.unwrap(), found.variance_se.unwrap());
        assert!(
            (found.bias_squared - bias).abs() < 4.0 * bias_se,
            "{found:?}"
        );
        assert!(
            (found.variance - variance).abs() < 4.0 * variance_se,
            "{found:?}"
        );
        assert!(
            bias_se < 0.1 * bias && variance_se < 0.05 * variance,
            "{found:?}"
        );
        assert_eq!(found.renders, 6);

        // Without bias the estimate is 0 within its error, though few noisy renders differ visibly from the reference:
        // without the correction it would be variance / 6, tens of standard errors away.
        let found = moments(2.0, 0.5, 6, 3)
            .bias_and_variance(&reference)
            .unwrap();
        let se = found.bias_squared_se.unwrap();
        assert!(found.bias_squared.abs() < 4.0 * se, "{found:?}");
        assert!(variance / 6.0 > 10.0 * se);
    }

    #[test]
    fn a_single_render_has_no_variance() {
        let (one, many) = (moments(1.0, 0.1, 1, 4), moments(1.0, 0.1, 4, 5));
        assert!(matches!(
            one.bias_and_variance(&many),
            Err(MetricsError::TooFewRenders {
                found: 1,
                needed: 2
            })
        ));
        assert!(many.bias_and_variance(&one).is_err());
    }
}
