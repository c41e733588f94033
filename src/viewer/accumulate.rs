//! Frames of a still view, averaged.

use crate::images::{ImageRgb, luminance};

/// Mean and spread of an eye's pixels over frames.
#[derive(Clone, Debug, Default)]
pub struct Accumulator {
    frames: u32,
    sums: Vec<[f64; 3]>,
    /// Squares of the luminance.
    squares: Vec<f64>,
}

impl Accumulator {
    /// Adds a frame; one of another size begins anew.
    pub fn add(&mut self, pixels: &[[f32; 3]]) {
        if self.sums.len() != pixels.len() {
            *self = Self {
                frames: 0,
                sums: vec![[0.0; 3]; pixels.len()],
                squares: vec![0.0; pixels.len()],
            };
        }
        self.frames += 1;
        for ((sum, square), pixel) in self.sums.iter_mut().zip(&mut self.squares).zip(pixels) {
            let pixel = pixel.map(f64::from);
            for (sum, channel) in sum.iter_mut().zip(pixel) {
                *sum += channel;
            }
            *square += luminance(pixel).powi(2);
        }
    }

    /// Forgets all frames.
    pub fn clear(&mut self) {
        self.frames = 0;
        self.sums.fill([0.0; 3]);
        self.squares.fill(0.0);
    }

    /// Frames that were added.
    pub fn frames(&self) -> u32 {
        self.frames
    }

    /// Mean radiance, row 0 on top; `None` before the first frame, or for another size.
    pub fn mean(&self, size: [u32; 2]) -> Option<ImageRgb> {
        if self.frames == 0 {
            return None;
        }
        let scale = 1.0 / f64::from(self.frames);
        let pixels = self
            .sums
            .iter()
            .map(|sum| sum.map(|channel| (channel * scale) as f32))
            .collect();
        ImageRgb::new(size[0], size[1], pixels).ok()
    }

    /// Variance of the mean's luminance in each pixel: the sample variance (with n - 1) over n. `None` under two frames.
    pub fn variance(&self) -> Option<Vec<f32>> {
        if self.frames < 2 {
            return None;
        }
        let n = f64::from(self.frames);
        let of = |(sum, square): (&[f64; 3], &f64)| {
            let mean = luminance(*sum) / n;
            // Rounding may leave a little less than nothing where all frames are equal.
            let variance = ((square / n - mean * mean) * n / (n - 1.0)).max(0.0);
            (variance / n) as f32
        };
        Some(self.sums.iter().zip(&self.squares).map(of).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_and_variance_are_those_of_the_frames() {
        let mut frames = Accumulator::default();
        assert!(frames.mean([1, 1]).is_none());
        for value in [1.0, 2.0, 6.0] {
            frames.add(&[[value; 3]]);
        }
        assert_eq!(frames.mean([1, 1]).unwrap().pixels, [[3.0; 3]]);
        // Sample variance of 1, 2, 6 is 7; of their mean, a third of that. The weights of luminance add up to 1.
        let variance = frames.variance().unwrap()[0];
        assert!((variance - 7.0 / 3.0).abs() < 1e-5, "{variance}");
        frames.add(&[[1.0; 3], [2.0; 3]]);
        assert_eq!(frames.frames(), 1, "another size begins anew");
        assert!(frames.variance().is_none());
        frames.clear();
        assert!(frames.mean([2, 1]).is_none());
    }
}
