//! Do two sets of independent renders have the same expectation? Block means, their spread, and a z-test over blocks.
//!
//! Blocks instead of pixels: means of many samples are near normal where single pixels are not, and a small bias over
//! an area stands out of the noise.

use super::normal::sidak_z_limit;
use super::{MetricsError, require_size};
use crate::images::{Image, ImageRgb};

/// Fewest renders that a spread is taken from. With n renders z has Student's distribution of n - 1 degrees, whose
/// tails are heavier than the normal ones that [`z_test`] assumes; 16 or more are advisable.
const FEWEST_RENDERS: usize = 2;

/// Means over square blocks of pixels, with the standard error of each. Blocks at the right and bottom may be smaller.
#[derive(Clone, Debug, PartialEq)]
pub struct BlockStatistics {
    /// Blocks in a row.
    pub columns: u32,
    /// Rows of blocks.
    pub rows: u32,
    /// Mean of each block and channel, by rows from the top.
    pub means: Vec<[f64; 3]>,
    /// Standard error of each mean; 0 where all renders agree.
    pub standard_errors: Vec<[f64; 3]>,
}

impl BlockStatistics {
    /// From renders of the same view that differ in their random seed only; blocks of `side` x `side` pixels.
    ///
    /// # Errors
    /// [`MetricsError::TooFewRenders`] under two, [`MetricsError::SizeMismatch`].
    pub fn of_renders(renders: &[ImageRgb], side: u32) -> Result<Self, MetricsError> {
        let too_few = MetricsError::TooFewRenders {
            found: renders.len(),
            needed: FEWEST_RENDERS,
        };
        let Some(first) = renders.first().filter(|_| renders.len() >= FEWEST_RENDERS) else {
            return Err(too_few);
        };
        let count = renders.len() as f64;
        let mut each = Vec::with_capacity(renders.len());
        for render in renders {
            require_size("a render", render, first)?;
            each.push(block_means(render, side));
        }
        let blocks = each[0].len();
        let mut means = vec![[0.0; 3]; blocks];
        for (block, value) in each.iter().flat_map(|render| render.iter().enumerate()) {
            for channel in 0..3 {
                means[block][channel] += value[channel] / count;
            }
        }
        // Two passes: the spread may be far smaller than the mean.
        let mut standard_errors = vec![[0.0; 3]; blocks];
        for (block, value) in each.iter().flat_map(|render| render.iter().enumerate()) {
            for channel in 0..3 {
                standard_errors[block][channel] += (value[channel] - means[block][channel]).powi(2);
            }
        }
        for error in standard_errors.iter_mut().flatten() {
            *error = (*error / (count - 1.0) / count).sqrt();
        }
        let (columns, rows) = grid(first, side);
        Ok(Self {
            columns,
            rows,
            means,
            standard_errors,
        })
    }

    /// From a mean image and the standard error of each of its pixels and channels, errors of pixels independent.
    ///
    /// # Errors
    /// [`MetricsError::SizeMismatch`].
    pub fn of_mean_and_error(
        mean: &ImageRgb,
        error: &ImageRgb,
        side: u32,
    ) -> Result<Self, MetricsError> {
        require_size("the standard error", error, mean)?;
        let squares = Image {
            width: error.width,
            height: error.height,
            pixels: error
                .pixels
                .iter()
                .map(|pixel| pixel.map(|channel| channel * channel))
                .collect(),
        };
        let (columns, rows) = grid(mean, side);
        let standard_errors = block_means(&squares, side)
            .into_iter()
            .enumerate()
            .map(|(block, mean_square)| {
                let pixels = pixels_in(mean, side, block as u32 % columns, block as u32 / columns);
                mean_square.map(|square| (square / pixels).sqrt())
            })
            .collect();
        Ok(Self {
            columns,
            rows,
            means: block_means(mean, side),
            standard_errors,
        })
    }
}

/// Result of [`z_test`].
#[derive(Clone, Debug, PartialEq)]
pub struct ZTest {
    /// Blocks times channels.
    pub tests: usize,
    /// Those whose |z| is above the limit, or not a number.
    pub rejected: usize,
    /// The limit on |z|, Sidak corrected.
    pub z_limit: f64,
    /// Largest |z|; infinite where a value is not finite.
    pub max_abs_z: f64,
    /// Block (column, row) of that z.
    pub worst_block: (u32, u32),
    /// Mean of z over all tests; its standard error is about 1 / sqrt(tests).
    pub mean_z: f64,
}

impl ZTest {
    /// Share of the tests that are not rejected, 0 to 1.
    #[must_use]
    pub fn share_passed(&self) -> f64 {
        1.0 - self.rejected as f64 / self.tests.max(1) as f64
    }
}

/// Tests block by block and channel by channel whether two expectations are equal: z = (a - b) / sqrt(se_a^2 + se_b^2),
/// two-sided, Sidak corrected so that two equal expectations fail anywhere with chance `significance`, in (0, 1).
///
/// `rounding` is the relative error that both may have besides noise (f32 sums: about 1e-6); it enters the
/// denominator as `rounding` times the larger mean. Without it blocks without noise would fail for their last bit.
///
/// # Errors
/// [`MetricsError::SizeMismatch`] if the blocks do not correspond.
pub fn z_test(
    a: &BlockStatistics,
    b: &BlockStatistics,
    significance: f64,
    rounding: f64,
) -> Result<ZTest, MetricsError> {
    let (found, expected) = ([a.columns, a.rows], [b.columns, b.rows]);
    if found != expected || a.means.len() != b.means.len() {
        return Err(MetricsError::SizeMismatch {
            what: "the grid of blocks",
            found,
            expected,
        });
    }
    let tests = 3 * a.means.len();
    let z_limit = sidak_z_limit(significance, tests);
    let mut result = ZTest {
        tests,
        rejected: 0,
        z_limit,
        max_abs_z: 0.0,
        worst_block: (0, 0),
        mean_z: 0.0,
    };
    let errors = a.standard_errors.iter().zip(&b.standard_errors);
    for (block, ((mean_a, mean_b), (error_a, error_b))) in
        a.means.iter().zip(&b.means).zip(errors).enumerate()
    {
        for channel in 0..3 {
            let difference = mean_a[channel] - mean_b[channel];
            let slack = rounding * mean_a[channel].abs().max(mean_b[channel].abs());
            let error =
                (error_a[channel].powi(2) + error_b[channel].powi(2) + slack * slack).sqrt();
            let z = if difference == 0.0 {
                0.0
            } else {
                difference / error
            };
            let size = if z.is_nan() { f64::INFINITY } else { z.abs() };
            result.mean_z += z / tests as f64;
            result.rejected += usize::from(size > z_limit);
            if size > result.max_abs_z {
                result.max_abs_z = size;
                result.worst_block = (block as u32 % a.columns, block as u32 / a.columns);
            }
        }
    }
    Ok(result)
}

/// Mean of images pixel by pixel, summed in f64.
///
/// # Errors
/// [`MetricsError::TooFewRenders`] for none, [`MetricsError::SizeMismatch`].
pub fn mean_image(images: &[ImageRgb]) -> Result<ImageRgb, MetricsError> {
    let first = images.first().ok_or(MetricsError::TooFewRenders {
        found: 0,
        needed: 1,
    })?;
    let mut sums = vec![[0.0_f64; 3]; first.pixels.len()];
    for image in images {
        require_size("an image", image, first)?;
        for (sum, pixel) in sums.iter_mut().zip(&image.pixels) {
            for (sum, channel) in sum.iter_mut().zip(pixel) {
                *sum += f64::from(*channel);
            }
        }
    }
    let count = images.len() as f64;
    let pixels = sums
        .into_iter()
        .map(|sum| sum.map(|channel| (channel / count) as f32))
        .collect();
    Ok(Image {
        width: first.width,
        height: first.height,
        pixels,
    })
}

fn grid<P>(image: &Image<P>, side: u32) -> (u32, u32) {
    (
        image.width.div_ceil(side.max(1)),
        image.height.div_ceil(side.max(1)),
    )
}

/// Pixels in one block.
fn pixels_in<P>(image: &Image<P>, side: u32, column: u32, row: u32) -> f64 {
    let side = side.max(1);
    let extent = |size: u32, index: u32| f64::from(side.min(size - index * side));
    extent(image.width, column) * extent(image.height, row)
}

fn block_means(image: &ImageRgb, side: u32) -> Vec<[f64; 3]> {
    let side = side.max(1);
    let (columns, rows) = grid(image, side);
    let mut means = vec![[0.0; 3]; columns as usize * rows as usize];
    for (y, line) in (0..).zip(image.pixels.chunks_exact(image.width as usize)) {
        for (x, pixel) in (0..).zip(line) {
            let (column, row) = (x / side, y / side);
            let weight = 1.0 / pixels_in(image, side, column, row);
            if let Some(mean) = means.get_mut((row * columns + column) as usize) {
                for (mean, channel) in mean.iter_mut().zip(pixel) {
                    *mean += f64::from(*channel) * weight;
                }
            }
        }
    }
    means
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: u32 = 64;

    fn noise(seed: u64, level: f32) -> ImageRgb {
        let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
        let mut uniform = || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 40) as f32 / (1_u32 << 24) as f32
        };
        let pixels = (0..SIDE * SIDE)
            .map(|_| [0; 3].map(|_: i32| level * 2.0 * uniform()))
            .collect();
        Image::new(SIDE, SIDE, pixels).unwrap()
    }

    fn renders(first_seed: u64, level: f32) -> Vec<ImageRgb> {
        (0..32).map(|i| noise(first_seed + i, level)).collect()
    }

    #[test]
    fn block_means_by_hand_with_smaller_blocks_at_the_border() {
        let image = Image::new(3, 2, (0..6).map(|i| [i as f32, 0.0, 1.0]).collect()).unwrap();
        // Rows 0 1 2 and 3 4 5: blocks of 2 are {0 1 3 4} and {2 5}.
        assert_eq!(block_means(&image, 2), [[2.0, 0.0, 1.0], [3.5, 0.0, 1.0]]);
        let error = Image::new(3, 2, vec![[0.5; 3]; 6]).unwrap();
        let found = BlockStatistics::of_mean_and_error(&image, &error, 2).unwrap();
        assert_eq!((found.columns, found.rows), (2, 1));
        // 0.5 / sqrt(4) and 0.5 / sqrt(2).
        assert!((found.standard_errors[0][0] - 0.25).abs() < 1e-12);
        assert!((found.standard_errors[1][2] - 0.5 / 2.0_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn spread_of_renders_is_that_of_the_noise() {
        // Uniform in 0..2: variance 1/3 per pixel; 64 pixels per block, 32 renders. The estimate of one standard error
        // is off by about 1/sqrt(62); over 192 of them the mean is off by under 1 %, 5 % is generous.
        let found = BlockStatistics::of_renders(&renders(1, 1.0), 8).unwrap();
        let expected = (1.0_f64 / 3.0 / 64.0 / 32.0).sqrt();
        let mean = found.standard_errors.iter().flatten().sum::<f64>() / 192.0;
        assert!((mean / expected - 1.0).abs() < 0.05, "{mean} {expected}");
    }

    #[test]
    fn equal_expectations_pass_and_a_small_bias_fails() {
        let statistics =
            |seed, level| BlockStatistics::of_renders(&renders(seed, level), 8).unwrap();
        let (a, b) = (statistics(1, 1.0), statistics(1000, 1.0));
        let same = z_test(&a, &b, 1e-3, 1e-6).unwrap();
        assert_eq!((same.tests, same.rejected), (192, 0), "{same:?}");
        assert!(same.mean_z.abs() < 4.0 / 192.0_f64.sqrt());
        assert_eq!(same.share_passed(), 1.0);
        // Negative control: 10 % brighter is 0.1 / (sqrt(2) 0.0128) = 5.5 standard errors in each block.
        let brighter = z_test(&statistics(2000, 1.1), &a, 1e-3, 1e-6).unwrap();
        assert!(brighter.rejected > 96, "{brighter:?}");
        assert!(brighter.mean_z > 3.0);
        // Negative control: one wrong block of 64.
        let mut wrong = renders(3000, 1.0);
        for image in &mut wrong {
            for y in 8..16 {
                for x in 24..32 {
                    image.pixels[y * SIDE as usize + x] = [1.2; 3];
                }
            }
        }
        let wrong = BlockStatistics::of_renders(&wrong, 8).unwrap();
        let found = z_test(&wrong, &a, 1e-3, 1e-6).unwrap();
        assert_eq!((found.rejected, found.worst_block), (3, (3, 1)));
    }

    #[test]
    fn not_a_number_is_rejected() {
        let a = BlockStatistics::of_renders(&renders(1, 1.0), 8).unwrap();
        let mut b = a.clone();
        b.means[7][1] = f64::NAN;
        let found = z_test(&a, &b, 0.01, 1e-6).unwrap();
        assert_eq!((found.rejected, found.worst_block), (1, (7, 0)));
        assert_eq!(found.max_abs_z, f64::INFINITY);
    }

    #[test]
    fn noiseless_blocks_may_differ_in_the_last_bit_only() {
        let plane = |value: f32| vec![Image::filled(16, 16, [value; 3]).unwrap(); 2];
        let of = |value| BlockStatistics::of_renders(&plane(value), 8).unwrap();
        let z = |value| z_test(&of(value), &of(1.0), 0.01, 1e-6).unwrap();
        assert_eq!(z(1.000_000_1).rejected, 0);
        assert_eq!(z(1.000_1).rejected, z(1.000_1).tests);
        assert!(BlockStatistics::of_renders(&plane(1.0)[..1], 8).is_err());
        assert!(
            z_test(
                &of(1.0),
                &BlockStatistics::of_renders(&renders(1, 1.0), 8).unwrap(),
                0.01,
                0.0
            )
            .is_err()
        );
        assert_eq!(mean_image(&plane(0.3)).unwrap(), plane(0.3)[0]);
        assert!(mean_image(&[]).is_err());
    }
}
