//! FLIP: a difference that follows what a person sees when flipping between two images.
//!
//! P. Andersson et al., "FLIP: A Difference Evaluator for Alternating Images", Proc. ACM Comput. Graph. Interact. Tech.
//! 3(2), 2020; the authors' own C++ through `nv-flip`. Input is the pair as `frame_NNNN.png` shows it: filmic curve,
//! sRGB, 8 bits.

use super::{MetricsError, is_finite, require_size};
use crate::images::{Image, ImageRgb, tone_map};

/// Pixels per degree of FLIP's authors: a 0.7 m wide monitor of 3840 pixels, seen from 0.7 m.
pub const DEFAULT_PIXELS_PER_DEGREE: f64 = 67.0;

/// How the pair is looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlipView {
    /// Factor on radiance before the filmic curve, above 0.
    pub exposure: f64,
    /// Pixels per degree of visual angle, 1 to 1000.
    pub pixels_per_degree: f64,
}

impl Default for FlipView {
    fn default() -> Self {
        Self {
            exposure: 1.0,
            pixels_per_degree: DEFAULT_PIXELS_PER_DEGREE,
        }
    }
}

/// FLIP difference of each pixel, 0 to 1. Pixels that are not finite in either image are black in both.
///
/// # Errors
/// [`MetricsError::SizeMismatch`].
pub fn flip_map(
    image: &ImageRgb,
    reference: &ImageRgb,
    view: FlipView,
) -> Result<Image<f32>, MetricsError> {
    require_size("the image", image, reference)?;
    let (width, height) = (reference.width, reference.height);
    let (mut test, mut truth) = (
        tone_map(image, view.exposure),
        tone_map(reference, view.exposure),
    );
    let finite = image
        .pixels
        .iter()
        .zip(&reference.pixels)
        .map(|(x, r)| is_finite(x) && is_finite(r));
    for (finite, (x, r)) in finite.zip(test.pixels.iter_mut().zip(&mut truth.pixels)) {
        if !finite {
            (*x, *r) = ([0; 3], [0; 3]);
        }
    }
    let [truth, test] = [&truth, &test]
        .map(|image| nv_flip::FlipImageRgb8::with_data(width, height, image.pixels.as_flattened()));
    let map = nv_flip::flip(truth, test, view.pixels_per_degree as f32);
    Ok(reference.like(map.to_vec()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filled(pixel: [f32; 3]) -> ImageRgb {
        Image::filled(16, 12, pixel).unwrap()
    }

    #[test]
    fn black_against_white_is_one() {
        let map = flip_map(&filled([0.0; 3]), &filled([1e4; 3]), FlipView::default()).unwrap();
        assert_eq!(map.pixels.len(), 16 * 12);
        assert!(
            map.pixels.iter().all(|&value| (0.9..=1.0).contains(&value)),
            "{:?}",
            map.pixels[0]
        );
    }

    #[test]
    fn the_difference_stays_where_it_is() {
        // Checks orientation: an error in the top row must not show at the bottom. Large enough that FLIP's filters,
        // a few pixels wide at this angle, do not reach the other end.
        let reference = Image::filled(64, 64, [0.5; 3]).unwrap();
        let mut image = reference.clone();
        image.pixels[0] = [5.0, 0.0, 0.0];
        let view = FlipView {
            pixels_per_degree: 10.0,
            ..FlipView::default()
        };
        let map = flip_map(&image, &reference, view).unwrap();
        assert!(map.pixels[0] > 0.1);
        assert_eq!(map.pixels[64 * 64 - 1], 0.0);
    }

    #[test]
    fn equal_images_differ_nowhere_and_exposure_matters() {
        let (a, b) = (filled([0.2, 0.3, 0.4]), filled([0.25, 0.3, 0.4]));
        assert!(
            flip_map(&a, &a, FlipView::default())
                .unwrap()
                .pixels
                .iter()
                .all(|&value| value == 0.0)
        );
        let mean = |exposure| {
            let view = FlipView {
                exposure,
                ..FlipView::default()
            };
            flip_map(&a, &b, view).unwrap().pixels.iter().sum::<f32>()
        };
        assert!(mean(1.0) > 0.0);
        assert!(mean(1.0) > mean(1e-6));
    }
}
