//! Do two sets of independent renders have the same expectation? Block means, their spread, and a z-test over blocks.
//!
//! Blocks instead of pixels: means of many samples are near normal where single pixels are not, and a small bias over
//! an area stands out of the noise.

use statrs::distribution::{ContinuousCDF as _, Normal};
use stereolux_images::images::{Image, ImageRgb};

use super::chi_square::sidak;

/// Means over square blocks of pixels, with the standard error of each. Blocks at the right and bottom may be smaller.
#[derive(Clone, Debug, PartialEq)]
pub struct BlockStatistics {
    /// Blocks in a row, and rows of blocks.
    pub blocks: [u32; 2],
    /// Mean of each block and channel, by rows from the top.
    pub means: Vec<[f64; 3]>,
    /// Standard error of each mean; 0 where all renders agree.
    pub standard_errors: Vec<[f64; 3]>,
}

impl BlockStatistics {
    /// From renders of the same view that differ in their random seed only; blocks of `side` x `side` pixels. With n renders z
    /// has Student's distribution of n - 1 degrees, whose tails are heavier than the normal ones that [`z_test`] assumes; 16 or
    /// more are advisable.
    pub fn of_renders(renders: &[ImageRgb], side: u32) -> Self {
        assert!(renders.len() >= 2, "one render gives no spread");
        let count = renders.len() as f64;
        let each: Vec<Vec<[f64; 3]>> = renders
            .iter()
            .map(|render| {
                assert!(same_size(render, &renders[0]));
                block_means(render, side)
            })
            .collect();
        let over_renders = |block: usize, of: &dyn Fn(usize, f64) -> f64| {
            [0, 1, 2].map(|c| each.iter().map(|means| of(c, means[block][c])).sum::<f64>() / count)
        };
        let means: Vec<[f64; 3]> = (0..each[0].len())
            .map(|block| over_renders(block, &|_, value| value))
            .collect();
        // Two passes: the spread may be far smaller than the mean.
        let squares = |(block, mean): (usize, &[f64; 3])| {
            over_renders(block, &|c, value| (value - mean[c]).powi(2))
                .map(|square| (square / (count - 1.0)).sqrt())
        };
        Self {
            blocks: grid(&renders[0], side),
            standard_errors: means.iter().enumerate().map(squares).collect(),
            means,
        }
    }

    /// From a mean image and the standard error of each of its pixels and channels, errors of pixels independent.
    pub fn of_mean_and_error(mean: &ImageRgb, error: &ImageRgb, side: u32) -> Self {
        assert!(same_size(error, mean));
        let squares = error.pixels.iter().map(|pixel| pixel.map(|x| x * x));
        let squares = Image::new(error.width, error.height, squares.collect()).unwrap();
        let blocks = grid(mean, side);
        let standard_errors = (0..)
            .zip(block_means(&squares, side))
            .map(|(block, square)| {
                let pixels = pixels_in(mean, side, block % blocks[0], block / blocks[0]);
                square.map(|square| (square / pixels).sqrt())
            });
        Self {
            blocks,
            means: block_means(mean, side),
            standard_errors: standard_errors.collect(),
        }
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
    pub fn share_passed(&self) -> f64 {
        1.0 - self.rejected as f64 / self.tests.max(1) as f64
    }
}

/// Tests block by block and channel by channel whether two expectations are equal: z = (a - b) / sqrt(se_a^2 + se_b^2),
/// two-sided, Sidak corrected so that two equal expectations fail anywhere with chance `significance`, in (0, 1).
///
/// `rounding` is the relative error that both may have besides noise (f32 sums: about 1e-6); it enters the
/// denominator as `rounding` times the larger mean. Without it blocks without noise would fail for their last bit.
pub fn z_test(a: &BlockStatistics, b: &BlockStatistics, significance: f64, rounding: f64) -> ZTest {
    assert_eq!(a.blocks, b.blocks);
    let tests = 3 * a.means.len();
    let z_limit = -Normal::standard().inverse_cdf(0.5 * sidak(significance, tests));
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
                result.worst_block = (block as u32 % a.blocks[0], block as u32 / a.blocks[0]);
            }
        }
    }
    result
}

/// Mean of images of one size pixel by pixel, summed in f64.
pub fn mean_image(images: &[ImageRgb]) -> ImageRgb {
    let mut sums = vec![[0.0_f64; 3]; images[0].pixels.len()];
    for image in images {
        assert!(same_size(image, &images[0]));
        for (sum, pixel) in sums.iter_mut().zip(&image.pixels) {
            for (sum, channel) in sum.iter_mut().zip(pixel) {
                *sum += f64::from(*channel);
            }
        }
    }
    let mean = |sum: [f64; 3]| sum.map(|channel| (channel / images.len() as f64) as f32);
    let pixels = sums.into_iter().map(mean).collect();
    Image::new(images[0].width, images[0].height, pixels).unwrap()
}

fn same_size(one: &ImageRgb, other: &ImageRgb) -> bool {
    [one.width, one.height] == [other.width, other.height]
}

fn grid(image: &ImageRgb, side: u32) -> [u32; 2] {
    [image.width, image.height].map(|edge| edge.div_ceil(side))
}

/// Pixels in one block.
fn pixels_in(image: &ImageRgb, side: u32, column: u32, row: u32) -> f64 {
    let extent = |size: u32, index: u32| f64::from(side.min(size - index * side));
    extent(image.width, column) * extent(image.height, row)
}

/// Means over the blocks, by rows from the top.
pub fn block_means(image: &ImageRgb, side: u32) -> Vec<[f64; 3]> {
    let [columns, rows] = grid(image, side);
    let mut means = vec![[0.0; 3]; (columns * rows) as usize];
    for (index, pixel) in (0..).zip(&image.pixels) {
        let (column, row) = (index % image.width / side, index / image.width / side);
        let weight = 1.0 / pixels_in(image, side, column, row);
        for (mean, channel) in means[(row * columns + column) as usize]
            .iter_mut()
            .zip(pixel)
        {
            *mean += f64::from(*channel) * weight;
        }
    }
    means
}
