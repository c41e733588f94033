//! Binocular error: how much the two eyes' errors disagree at the surface points that both see.
//!
//! An error that is the same in both eyes looks like paint on the surface; one that differs fights between the eyes.

use super::comparison::relative_square;
use super::{BlockedMean, MetricsError, finite, is_finite, mean_square, require_size};
use crate::images::{Image, ImageRgb};

/// Disagreement of the two eyes' errors over corresponding pixels. With d = (x - r) of the right eye minus (x - r) of
/// the left eye at the same surface point, r the right eye's reference and s the mean of its squares.
#[derive(Clone, Debug, PartialEq)]
pub struct BinocularError {
    /// Mean over pairs and channels of d^2 / (r^2 + 0.01 s); `None` against a black reference that is not met.
    pub rel_mse: Option<f64>,
    /// Square root of the mean of d^2.
    pub rmse: f64,
    /// Pairs of pixels compared: those whose channels are finite.
    pub pairs: usize,
}

/// The signed error x - r of each pixel and channel.
///
/// # Errors
/// [`MetricsError::SizeMismatch`].
pub fn error_image(image: &ImageRgb, reference: &ImageRgb) -> Result<ImageRgb, MetricsError> {
    require_size("the image", image, reference)?;
    let pixels = image.pixels.iter().zip(&reference.pixels);
    Ok(image.like(pixels.map(|(x, r)| std::array::from_fn(|c| x[c] - r[c]))))
}

/// Compares the eyes' errors at the points that both see. `left_from_right` gives for each right-eye pixel (by rows from
/// the top) the index of the left-eye pixel that sees the same surface point, `None` where the left eye does not.
///
/// # Errors
/// [`MetricsError::SizeMismatch`], [`MetricsError::CorrespondenceOutside`], [`MetricsError::NothingCounted`].
pub fn binocular_error(
    left_error: &ImageRgb,
    right_error: &ImageRgb,
    right_reference: &ImageRgb,
    left_from_right: &Image<Option<u32>>,
) -> Result<BinocularError, MetricsError> {
    require_size("the right eye's error", right_error, right_reference)?;
    require_size("the correspondence", left_from_right, right_reference)?;
    let floor = 0.01 * mean_square(right_reference);
    let (width, height) = (right_reference.width, right_reference.height);
    let [mut relative, mut square] = [(); 2].map(|()| BlockedMean::new(width, height));
    let mut pairs = 0;
    let right = right_error.pixels.iter().zip(&right_reference.pixels);
    for (index, ((right, r), left)) in right.zip(&left_from_right.pixels).enumerate() {
        let Some(to) = left.map(|to| to as usize) else {
            continue;
        };
        let left = left_error
            .pixels
            .get(to)
            .ok_or(MetricsError::CorrespondenceOutside {
                from: index,
                to,
                pixels: left_error.pixels.len(),
            })?;
        if ![left, right, r].into_iter().all(is_finite) {
            continue;
        }
        pairs += 1;
        let (mut relative_here, mut square_here) = (0.0, 0.0);
        for channel in 0..3 {
            let [left, right, r] = [left, right, r].map(|of| f64::from(of[channel]));
            let difference = right - left;
            relative_here += relative_square(difference, r, floor);
            square_here += difference * difference;
        }
        relative.add(index, width, relative_here / 3.0);
        square.add(index, width, square_here / 3.0);
    }
    if pairs == 0 {
        return Err(MetricsError::NothingCounted(
            "no finite point is seen by both eyes",
        ));
    }
    Ok(BinocularError {
        rel_mse: finite(relative.mean()),
        rmse: square.root().0,
        pairs,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The right eye sees everything two columns further left; its last two columns are hidden from the left eye.
    fn shifted() -> Image<Option<u32>> {
        let pixels = (0..16 * 16_u32)
            .map(|i| (i % 16 < 14).then_some(i + 2))
            .collect();
        Image::new(16, 16, pixels).unwrap()
    }

    fn texture(shift: usize) -> ImageRgb {
        let pixels = (0..16 * 16)
            .map(|i| [((i % 16 + shift) * 37 % 11) as f32 * 0.25; 3])
            .collect();
        Image::new(16, 16, pixels).unwrap()
    }

    #[test]
    fn the_same_error_in_both_eyes_does_not_disagree() {
        // The error is painted on the surface: it moves with the disparity.
        let reference = Image::filled(16, 16, [1.0; 3]).unwrap();
        let found = binocular_error(&texture(0), &texture(2), &reference, &shifted()).unwrap();
        assert_eq!(
            (found.rel_mse, found.rmse, found.pairs),
            (Some(0.0), 0.0, 14 * 16)
        );
        // Negative control: an error that stays on the screen disagrees.
        let found = binocular_error(&texture(0), &texture(0), &reference, &shifted()).unwrap();
        assert!(found.rmse > 0.1 && found.rel_mse > Some(0.01));
    }

    #[test]
    fn opposite_errors_by_hand() {
        // +0.5 in one eye, -0.5 in the other, r = 2: d = 1, 1 / (4 + 0.04).
        let plane = |value| Image::filled(16, 16, [value; 3]).unwrap();
        let found = binocular_error(&plane(-0.5), &plane(0.5), &plane(2.0), &shifted()).unwrap();
        assert_eq!(found.rmse, 1.0);
        assert!((found.rel_mse.unwrap() - 1.0 / 4.04).abs() < 1e-15);
        let errors = error_image(&plane(2.5), &plane(2.0)).unwrap();
        assert_eq!(errors, plane(0.5));
    }

    #[test]
    fn bad_correspondence_is_refused() {
        let plane = Image::filled(16, 16, [1.0; 3]).unwrap();
        let mut map = shifted();
        map.pixels[5] = Some(256);
        assert_eq!(
            binocular_error(&plane, &plane, &plane, &map),
            Err(MetricsError::CorrespondenceOutside {
                from: 5,
                to: 256,
                pixels: 256
            })
        );
        map.pixels.fill(None);
        assert!(matches!(
            binocular_error(&plane, &plane, &plane, &map),
            Err(MetricsError::NothingCounted(_))
        ));
    }
}
