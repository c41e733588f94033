//! Errors against references that are noisy themselves.
//!
//! A difference from a noisy reference holds the reference's noise, which would drown what is asked here. So there are two
//! references of every view, independent of each other, and every squared error is the product of the differences from
//! each: its expectation is the square of the error against the truth. It may come out negative where there is none.

use super::correspondence::pixel_at;
use crate::images::{Image, ImageRgb};
use crate::metrics::BlockedMean;

/// Two references of an eye's view, of one size, whose noise is independent.
pub type References = [ImageRgb; 2];

/// Differences from each reference, by rows from the top, in the image's unit.
pub type Differences = [Vec<[f64; 3]>; 2];

/// An image's differences from its references; pixels that one of them lacks are left out.
pub fn differences(image: &ImageRgb, references: &References) -> Differences {
    [0, 1].map(|one: usize| {
        let pixels = image.pixels.iter().zip(&references[one].pixels);
        pixels
            .map(|(x, r)| std::array::from_fn(|c| f64::from(x[c]) - f64::from(r[c])))
            .collect()
    })
}

/// Mean over pixels and channels of the product of two sets of differences.
pub fn mean_product(one: &[[f64; 3]], other: &[[f64; 3]]) -> f64 {
    let products = one
        .iter()
        .zip(other)
        .flat_map(|(a, b)| (0..3).map(move |c| a[c] * b[c]));
    products.sum::<f64>() / (3 * one.len().max(1)) as f64
}

/// relMSE as [`crate::metrics::compare`] has it, without the references' noise: the squared error over the square of the references'
/// mean plus a hundredth of its mean square; NaN if both references are black.
pub fn relative_square(differences: &Differences, references: &References) -> f64 {
    let mean = |a: f32, b: f32| 0.5 * (f64::from(a) + f64::from(b));
    let reference: Vec<[f64; 3]> = references[0]
        .pixels
        .iter()
        .zip(&references[1].pixels)
        .map(|(a, b)| std::array::from_fn(|c| mean(a[c], b[c])))
        .collect();
    let floor = 0.01 * mean_product(&reference, &reference);
    let pixels = differences[0].iter().zip(&differences[1]).zip(&reference);
    let relative =
        pixels.flat_map(|((a, b), r)| (0..3).map(move |c| a[c] * b[c] / (r[c] * r[c] + floor)));
    relative.sum::<f64>() / (3 * reference.len().max(1)) as f64
}

/// How much the error has changed from a frame to the next, squared: one that stays does not flicker.
pub fn change_square(now: &Differences, before: &Differences) -> f64 {
    let changed = [0, 1].map(|one: usize| -> Vec<[f64; 3]> {
        let pixels = now[one].iter().zip(&before[one]);
        let change = pixels.map(|(a, b)| std::array::from_fn(|c| a[c] - b[c]));
        change.collect()
    });
    mean_product(&changed[0], &changed[1])
}

/// How far the eyes' errors lie apart at the points that both see, squared, without the references' noise: mean over points and
/// channels. `left_from_right`: where in the left image ([`super::correspondence::left_from_right`]) the point of each right
/// pixel is seen; the left eye's error there is interpolated between four pixels, since an error that changes by pixels would
/// disagree with itself half a pixel further on.
pub fn binocular_square(
    left: &Differences,
    right: &Differences,
    left_from_right: &Image<Option<[f64; 2]>>,
) -> BlockedMean {
    let (width, height) = (left_from_right.width, left_from_right.height);
    let mut apart = BlockedMean::new(width, height);
    for (index, place) in left_from_right.pixels.iter().enumerate() {
        let difference = |one: usize| {
            let theirs = interpolated(&left[one], [width, height], (*place)?)?;
            let ours = right[one].get(index)?;
            Some([0, 1, 2].map(|c| ours[c] - theirs[c]))
        };
        if let Some((one, other)) = difference(0).zip(difference(1)) {
            let products = one.iter().zip(other).map(|(a, b)| a * b);
            apart.add(index, width, products.sum::<f64>() / 3.0);
        }
    }
    apart
}

/// Bilinear, of pixels whose values are those of their middles; `None` less than half a pixel from the image's border.
fn interpolated(
    pixels: &[[f64; 3]],
    [width, height]: [u32; 2],
    place: [f64; 2],
) -> Option<[f64; 3]> {
    let corner = place.map(|at| (at - 0.5).floor());
    let part: [f64; 2] = std::array::from_fn(|axis| place[axis] - 0.5 - corner[axis]);
    let mut sum = [0.0; 3];
    for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
        let (x, y) = (corner[0] + dx, corner[1] + dy);
        if x < 0.0 || y < 0.0 || x >= f64::from(width) || y >= f64::from(height) {
            return None;
        }
        let weight = (1.0 - dx - part[0]).abs() * (1.0 - dy - part[1]).abs();
        let pixel = pixels.get(pixel_at([x, y], width) as usize)?;
        for (sum, value) in sum.iter_mut().zip(pixel) {
            *sum += weight * value;
        }
    }
    Some(sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use stereolux_base::random;

    #[test]
    fn an_error_painted_on_the_surface_does_not_disagree_between_pixels() {
        // The error rises from column to column, and what the right eye sees in column c lies at c + 1.75 for the left eye.
        let (width, height) = (16_u32, 4_u32);
        let rows = |at: f64| -> Differences {
            let pixels = (0..width * height).map(|i| [0.1 * (f64::from(i % width) + at); 3]);
            [pixels.clone().collect(), pixels.collect()]
        };
        let places = (0..width * height).map(|i| {
            let column = f64::from(i % width) + 0.5 + 1.75;
            (column < f64::from(width)).then_some([column, f64::from(i / width) + 0.5])
        });
        let seen = Image::new(width, height, places.collect()).unwrap();
        let painted = binocular_square(&rows(0.0), &rows(1.75), &seen);
        assert!(painted.mean().abs() < 1e-12, "{painted:?}");
        // Taken from the pixel that the place lies in, it would be 0.025 off; on the screen it is 0.175.
        let stays = binocular_square(&rows(0.0), &rows(0.0), &seen);
        assert!((stays.mean() - 0.175_f64.powi(2)).abs() < 1e-12);
    }

    #[test]
    fn noise_of_the_references_does_not_count() {
        // The truth is 1 and the image 1.1; the references scatter around the truth by far more than that.
        let mut state = 1_u64;
        let mut noisy = || {
            let pixels = (0..160_000)
                .map(|_| std::array::from_fn(|_| 0.5 + random::unit(&mut state) as f32));
            Image::new(400, 400, pixels.collect()).unwrap()
        };
        let references = [noisy(), noisy()];
        let image = ImageRgb::filled(400, 400, [1.1; 3]).unwrap();
        let found = differences(&image, &references);
        let square = mean_product(&found[0], &found[1]);
        // 480,000 products whose deviation is 1/12 + 2 (0.1 / sqrt 12): four standard errors are 8e-4.
        assert!((square - 0.01).abs() < 8e-4, "{square}");
        // One reference alone adds its variance, 1/12.
        assert!(mean_product(&found[0], &found[0]) > 0.09);
    }
}
