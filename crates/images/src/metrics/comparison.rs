//! `compare`: one image against its reference.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::flip::{FlipView, flip_map};
use super::{BlockedMean, Mask, MetricsError, finite, is_finite, mean_square, require_size};
use crate::images::{Image, ImageError, ImageFile, ImageRgb, luminance};
use stereolux_base::limits::{LoadBudget, LoadLimits};

/// Errors of an image against a reference.
///
/// A metric is `None` (JSON `null`) where it is not defined: relative ones against an all-black reference that the image
/// does not match. A standard error is `None` where fewer than two blocks of 8x8 pixels are counted. The reference is
/// taken as exact.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Mean over pixels and channels of (x - r)^2 / (r^2 + 0.01 s).
    pub rel_mse: Option<f64>,
    /// Its standard error.
    pub rel_mse_se: Option<f64>,
    /// Square root of the mean over pixels and channels of (x - r)^2.
    pub rmse: f64,
    /// Its standard error.
    pub rmse_se: Option<f64>,
    /// (mean x - mean r) / mean r over pixels and channels, signed; 0 for two black images.
    pub mean_rel_bias: Option<f64>,
    /// Its standard error: that of mean (x - r), over mean r.
    pub mean_rel_bias_se: Option<f64>,
    /// Mean FLIP difference of the tone-mapped pair, 0 to 1.
    pub flip: f64,
    /// Its standard error.
    pub flip_se: Option<f64>,
    /// Mean luminance of the image.
    pub mean_luminance: f64,
    /// Mean luminance of the reference.
    pub reference_mean_luminance: f64,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Pixels that the metrics are means over.
    pub pixels: usize,
    /// Pixels left out because a channel of image or reference is NaN or infinite.
    pub non_finite: usize,
}

impl Comparison {
    /// Whether the image misses a limit on the relative MSE: the error is above it or not defined, or a pixel is not
    /// finite.
    #[must_use]
    pub fn exceeds(&self, max_rel_mse: f64) -> bool {
        self.non_finite > 0 || self.rel_mse.is_none_or(|error| error > max_rel_mse)
    }
}

/// Files that cannot be compared. Exit status 2.
#[derive(Debug, thiserror::Error)]
pub enum CompareError {
    /// An image cannot be read.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// The images do not go together, or their differences take more memory than they may.
    #[error("{} against {}: {fault}", image.display(), reference.display())]
    Pair {
        /// The image.
        image: PathBuf,
        /// The reference.
        reference: PathBuf,
        /// What is wrong.
        fault: String,
    },
}

/// What the metrics take beside the two images, bytes per pixel: FLIP's images in its colour spaces, its features and maps.
const METRIC_BYTES: u64 = 120;

/// Two images that were compared, and what came out.
#[derive(Clone, Debug)]
pub struct ComparedFiles {
    /// The image.
    pub image: ImageRgb,
    /// The reference.
    pub reference: ImageRgb,
    /// Pixels that count; `None`: all.
    pub mask: Option<Mask>,
    /// FLIP difference of each pixel, 0 to 1.
    pub flip: Image<f32>,
    /// The errors.
    pub comparison: Comparison,
}

/// Compares an image file with a reference file, over a mask file's white pixels if there is one, within the memory that
/// `limits` allow; with all that the errors were found from. `more_bytes` per pixel are kept free for what is made of it.
///
/// # Errors
/// [`CompareError`], one line.
pub fn compare_and_keep(
    image: &Path,
    reference: &Path,
    mask: Option<&Path>,
    view: FlipView,
    limits: LoadLimits,
    more_bytes: u64,
) -> Result<ComparedFiles, CompareError> {
    let budget = LoadBudget::new(limits);
    let fault = |fault: &dyn Display| CompareError::Pair {
        image: image.to_owned(),
        reference: reference.to_owned(),
        fault: fault.to_string(),
    };
    let test = ImageFile::open(image, &budget)?;
    let truth = ImageFile::open(reference, &budget)?;
    let mask = mask
        .map(|mask| ImageFile::open(mask, &budget))
        .transpose()?;
    // Before anything is decoded, so that what cannot be compared is not read either.
    let bytes = truth.pixels()?.saturating_mul(METRIC_BYTES + more_bytes);
    let taken = budget.take(bytes, "the images' differences");
    taken.map_err(|error| fault(&error))?;
    let (test, truth) = (test.decode(&budget)?, truth.decode(&budget)?);
    let mask = mask
        .map(|mask| mask.decode(&budget))
        .transpose()?
        .map(|mask| Mask::from_image(&mask));
    let flip = flip_map(&test, &truth, view).map_err(|error| fault(&error))?;
    let comparison = compare_by(&flip, &test, &truth, mask.as_ref());
    Ok(ComparedFiles {
        comparison: comparison.map_err(|error| fault(&error))?,
        image: test,
        reference: truth,
        mask,
        flip,
    })
}

/// Error e of one channel by its reference r: e^2 / (r^2 + floor).
pub(super) fn relative_square(error: f64, r: f64, floor: f64) -> f64 {
    // Equal values are no error whatever the scale, also where the whole reference is black.
    if error == 0.0 {
        return 0.0;
    }
    error * error / (r * r + floor)
}

/// What each pixel adds to [`Comparison::rel_mse`]: the mean over its channels of (x - r)^2 / (r^2 + 0.01 s). `None` where a
/// channel of image or reference is NaN or infinite, or where the error is not defined (a black reference).
///
/// # Errors
/// [`MetricsError::SizeMismatch`].
pub fn rel_mse_map(
    image: &ImageRgb,
    reference: &ImageRgb,
) -> Result<Image<Option<f64>>, MetricsError> {
    require_size("the image", image, reference)?;
    let floor = 0.01 * mean_square(reference);
    let error = |(x, r): (&[f32; 3], &[f32; 3])| {
        if !is_finite(x) || !is_finite(r) {
            return None;
        }
        let sum: f64 = (0..3)
            .map(|c| relative_square(f64::from(x[c]) - f64::from(r[c]), f64::from(r[c]), floor))
            .sum();
        Some(sum / 3.0).filter(|error| error.is_finite())
    };
    let pixels = image.pixels.iter().zip(&reference.pixels);
    Ok(reference.like(pixels.map(error)))
}

/// Compares an image with a reference, over the pixels of `mask` if there is one.
///
/// # Errors
/// [`MetricsError::SizeMismatch`], [`MetricsError::NothingCounted`].
pub fn compare(
    image: &ImageRgb,
    reference: &ImageRgb,
    mask: Option<&Mask>,
    view: FlipView,
) -> Result<Comparison, MetricsError> {
    compare_by(&flip_map(image, reference, view)?, image, reference, mask)
}

/// [`compare`], once the FLIP differences are known.
fn compare_by(
    flip_map: &Image<f32>,
    image: &ImageRgb,
    reference: &ImageRgb,
    mask: Option<&Mask>,
) -> Result<Comparison, MetricsError> {
    if let Some(mask) = mask {
        require_size("the mask", mask, reference)?;
    }
    let (width, height) = (reference.width, reference.height);

    let floor = 0.01 * mean_square(reference);
    let blocked = || BlockedMean::new(width, height);
    let (mut relative, mut square, mut difference, mut flip) =
        (blocked(), blocked(), blocked(), blocked());
    let (mut sum, mut reference_sum) = ([0.0; 3], [0.0; 3]);
    let (mut pixels, mut non_finite) = (0, 0);
    for (index, (x, r)) in image.pixels.iter().zip(&reference.pixels).enumerate() {
        if mask.is_some_and(|mask| !mask.pixels.get(index).copied().unwrap_or(false)) {
            continue;
        }
        if !is_finite(x) || !is_finite(r) {
            non_finite += 1;
            continue;
        }
        pixels += 1;
        let (x, r) = (x.map(f64::from), r.map(f64::from));
        let [mut relative_here, mut square_here, mut difference_here] = [0.0; 3];
        for channel in 0..3 {
            let error = x[channel] - r[channel];
            relative_here += relative_square(x[channel] - r[channel], r[channel], floor);
            square_here += error * error;
            difference_here += error;
            sum[channel] += x[channel];
            reference_sum[channel] += r[channel];
        }
        relative.add(index, width, relative_here / 3.0);
        square.add(index, width, square_here / 3.0);
        difference.add(index, width, difference_here / 3.0);
        flip.add(
            index,
            width,
            f64::from(flip_map.pixels.get(index).copied().unwrap_or(0.0)),
        );
    }
    if pixels == 0 {
        return Err(MetricsError::NothingCounted(if non_finite > 0 {
            "every counted pixel is NaN or infinite"
        } else {
            "the mask is black"
        }));
    }

    let (rmse, rmse_se) = square.root();
    let reference_mean = reference_sum.iter().sum::<f64>() / (3 * pixels) as f64;
    let over_mean = |value: f64| match value {
        0.0 => Some(0.0),
        _ => Some(value / reference_mean).filter(|ratio| ratio.is_finite()),
    };
    let mean_of = |sum: [f64; 3]| luminance(sum.map(|channel| channel / pixels as f64));
    Ok(Comparison {
        rel_mse: finite(relative.mean()),
        rel_mse_se: relative.standard_error().and_then(finite),
        rmse,
        rmse_se,
        mean_rel_bias: over_mean(difference.mean()),
        mean_rel_bias_se: difference
            .standard_error()
            .and_then(over_mean)
            .map(f64::abs),
        flip: flip.mean(),
        flip_se: flip.standard_error(),
        mean_luminance: mean_of(sum),
        reference_mean_luminance: mean_of(reference_sum),
        width,
        height,
        pixels,
        non_finite,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::images::Image;
    use stereolux_base::random;

    fn filled(value: f32) -> ImageRgb {
        Image::filled(32, 24, [value; 3]).unwrap()
    }

    fn compared(image: &ImageRgb, reference: &ImageRgb) -> Comparison {
        compare(image, reference, None, FlipView::default()).unwrap()
    }

    /// Columns alternate between two colours.
    fn striped(even: f32, odd: f32) -> ImageRgb {
        let pixels = (0..32 * 24)
            .map(|i| [if i % 2 == 0 { even } else { odd }; 3])
            .collect();
        Image::new(32, 24, pixels).unwrap()
    }

    #[test]
    fn identical_images_have_no_error_at_all() {
        for image in [filled(0.0), filled(0.7), striped(0.1, 1e6)] {
            let found = compared(&image, &image);
            assert_eq!(found.rel_mse, Some(0.0));
            assert_eq!(found.rel_mse_se, Some(0.0));
            assert_eq!((found.rmse, found.rmse_se), (0.0, Some(0.0)));
            assert_eq!(
                (found.mean_rel_bias, found.mean_rel_bias_se),
                (Some(0.0), Some(0.0))
            );
            assert_eq!((found.flip, found.flip_se), (0.0, Some(0.0)));
            assert!(!found.exceeds(0.0));
        }
    }

    #[test]
    fn constant_images_by_hand() {
        // r = 2, x = 3: s = 4, (3 - 2)^2 / (4 + 0.04); every block alike, so no spread.
        let found = compared(&filled(3.0), &filled(2.0));
        assert!((found.rel_mse.unwrap() - 1.0 / 4.04).abs() < 1e-15);
        assert_eq!(found.rmse, 1.0);
        assert_eq!(found.mean_rel_bias, Some(0.5));
        assert!(found.rel_mse_se.unwrap() < 1e-15);
        assert!(found.flip > 0.0);
        assert!((found.mean_luminance - 3.0).abs() < 1e-12);
        assert!((found.reference_mean_luminance - 2.0).abs() < 1e-12);
        assert!(found.exceeds(0.2) && !found.exceeds(0.25));
        // The sign of the bias.
        assert_eq!(
            compared(&filled(1.0), &filled(2.0)).mean_rel_bias,
            Some(-0.5)
        );
    }

    #[test]
    fn the_floor_is_the_mean_of_squares_over_pixels() {
        // r alternates 0 and 2, so s = 2 and the floor 0.02; x is r + 0.1 everywhere:
        // 0.01 / 0.02 on dark pixels and 0.01 / 4.02 on bright ones. A wrong s (squared mean = 1) would give 0.5012.
        let reference = striped(0.0, 2.0);
        let image = striped(0.1, 2.1);
        let dark = f64::from(0.1_f32).powi(2) / 0.02;
        let bright = (f64::from(2.1_f32) - 2.0).powi(2) / 4.02;
        let found = compared(&image, &reference).rel_mse.unwrap();
        assert!((found - (dark + bright) / 2.0).abs() < 1e-12, "{found}");
    }

    #[test]
    fn one_channel_counts_a_third() {
        let mut image = filled(2.0);
        for pixel in &mut image.pixels {
            pixel[1] = 3.0;
        }
        let found = compared(&image, &filled(2.0));
        assert!((found.rel_mse.unwrap() - 1.0 / 4.04 / 3.0).abs() < 1e-15);
        assert!((found.rmse - (1.0_f64 / 3.0).sqrt()).abs() < 1e-15);
    }

    #[test]
    fn mask_and_complement_add_up() {
        let reference = striped(0.5, 2.0);
        let mut image = reference.clone();
        for (index, pixel) in image.pixels.iter_mut().enumerate() {
            pixel[index % 3] += (index % 7) as f32 * 0.1;
        }
        let mask = Mask {
            width: 32,
            height: 24,
            pixels: (0..32 * 24).map(|index| index % 5 == 0).collect(),
        };
        let rest = Mask {
            pixels: mask.pixels.iter().map(|counted| !counted).collect(),
            ..mask
        };
        let parts = [&mask, &rest]
            .map(|mask| compare(&image, &reference, Some(mask), FlipView::default()).unwrap());
        let weighted: f64 = parts
            .iter()
            .map(|part| part.rel_mse.unwrap() * part.pixels as f64)
            .sum();
        let whole = compared(&image, &reference);
        assert_eq!(parts[0].pixels + parts[1].pixels, whole.pixels);
        assert!((weighted / whole.pixels as f64 - whole.rel_mse.unwrap()).abs() < 1e-12);
        // An error outside of the mask does not count.
        let mut wrong = reference.clone();
        wrong.pixels[1] = [100.0; 3];
        let inside = compare(&wrong, &reference, Some(&mask), FlipView::default()).unwrap();
        assert_eq!(inside.rmse, 0.0);
    }

    #[test]
    fn standard_error_of_noise() {
        // Independent noise of variance v per channel: the mean square's standard error over 3 N independent uniform
        // values in +-a is sqrt(4/45) a^2 / sqrt(3 N), as E e^2 = a^2/3 and Var e^2 = 4 a^4 / 45. N = 256 x 256 gives
        // 1024 blocks, so the estimate's own spread is about 1/sqrt(2048) = 2.2 %; 10 % is over four times that.
        let side = 256;
        let a = 0.25;
        let mut state = 1_u64;
        let mut uniform = || random::unit(&mut state);
        let pixels = (0..side * side)
            .map(|_| [0; 3].map(|_: i32| (1.0 + a * (2.0 * uniform() - 1.0)) as f32))
            .collect();
        let image = Image::new(side, side, pixels).unwrap();
        let found = compared(&image, &Image::filled(side, side, [1.0; 3]).unwrap());
        let values = f64::from(3 * side * side);
        let rel_mse_se = (4.0_f64 / 45.0).sqrt() * a * a / values.sqrt() / 1.01;
        assert!(
            (found.rel_mse_se.unwrap() / rel_mse_se - 1.0).abs() < 0.1,
            "{found:?}"
        );
        let bias_se = a / 3.0_f64.sqrt() / values.sqrt();
        assert!((found.mean_rel_bias_se.unwrap() / bias_se - 1.0).abs() < 0.1);
        // Four standard errors about the expectations.
        assert!((found.rel_mse.unwrap() - a * a / 3.0 / 1.01).abs() < 4.0 * rel_mse_se);
        assert!(found.mean_rel_bias.unwrap().abs() < 4.0 * bias_se);
        // Negative control: a bias of a tenth is seen.
        let mut brighter = image;
        brighter
            .pixels
            .iter_mut()
            .flatten()
            .for_each(|channel| *channel *= 1.1);
        let found = compared(&brighter, &Image::filled(side, side, [1.0; 3]).unwrap());
        assert!(found.mean_rel_bias.unwrap() > 20.0 * bias_se);
    }

    #[test]
    fn black_reference_leaves_relative_errors_undefined() {
        let found = compared(&filled(1.0), &filled(0.0));
        assert_eq!((found.rel_mse, found.mean_rel_bias), (None, None));
        assert_eq!(found.rmse, 1.0);
        assert!(found.exceeds(1e300));
        let json = serde_json::to_value(&found).unwrap();
        assert!(json["rel_mse"].is_null() && json["rmse"] == 1.0);
    }

    #[test]
    fn pixels_that_are_not_finite_are_counted_and_left_out() {
        let mut image = filled(2.0);
        image.pixels[3][0] = f32::NAN;
        image.pixels[500][2] = f32::INFINITY;
        let found = compared(&image, &filled(2.0));
        assert_eq!((found.non_finite, found.pixels), (2, 32 * 24 - 2));
        assert_eq!(
            (found.rel_mse, found.rmse, found.flip),
            (Some(0.0), 0.0, 0.0)
        );
        assert!(found.exceeds(1.0), "NaN must not pass");
        let all = filled(f32::NAN);
        assert!(matches!(
            compare(&all, &filled(1.0), None, FlipView::default()),
            Err(MetricsError::NothingCounted(_))
        ));
    }

    #[test]
    fn sizes_must_agree() {
        let other = Image::filled(24, 32, [1.0; 3]).unwrap();
        let error = compare(&other, &filled(1.0), None, FlipView::default()).unwrap_err();
        assert!(error.to_string().contains("[24, 32]") && error.to_string().contains("[32, 24]"));
        let mask = Mask {
            width: 1,
            height: 1,
            pixels: vec![true],
        };
        assert!(compare(&filled(1.0), &filled(1.0), Some(&mask), FlipView::default()).is_err());
        let black = Mask {
            width: 32,
            height: 24,
            pixels: vec![false; 32 * 24],
        };
        assert!(
            compare(
                &filled(1.0),
                &filled(1.0),
                Some(&black),
                FlipView::default()
            )
            .is_err()
        );
    }
}
