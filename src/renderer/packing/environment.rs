//! Environment map: texels and the distribution that directions are drawn from.

use std::f64::consts::PI;

use super::mips::averaged;
use crate::scene::Environment;

/// An environment as `shaders/shared/environment.wesl` reads it.
#[derive(Clone, Debug, Default)]
pub struct PackedEnvironment {
    /// Columns and rows. Then linear radiance, row 0 = +Y; the fourth channel is 0. What was negative or not a number is 0. Then
    /// coarser levels, each with the means over half as many columns and rows (rounded down), while both are more than one.
    pub texels: Vec<[f32; 4]>,
    /// Cumulative probability of the rows (`height` values), then of each row's columns (`width` values per row).
    pub cdf: Vec<f32>,
    /// Integral of the radiance over the sphere, W m^-2.
    pub integral: [f64; 3],
}

/// Packs a map; none if it is empty or black.
///
/// A cell is the area of a texel. Its weight is the mean of the bilinear radiance over it, which in one dimension
/// weighs the texel by 6/8 and its neighbours by 1/8 each, times its solid angle.
pub fn pack_environment(environment: &Environment) -> Option<PackedEnvironment> {
    let (width, height) = (environment.width as usize, environment.height as usize);
    if width == 0 || height == 0 || environment.radiance.len() < width * height {
        return None;
    }
    let finest = environment.radiance[..width * height].iter();
    let finest = finest.map(|radiance| {
        // NaN compares false and becomes 0.
        let [r, g, b] = radiance.map(|c| if c > 0.0 { c.min(f32::MAX) } else { 0.0 });
        [r, g, b, 0.0]
    });
    let size = [width as f32, height as f32, 0.0, 0.0];
    let mut texels: Vec<[f32; 4]> = std::iter::once(size).chain(finest).collect();
    let finest = &texels[1..];
    let cell_mean = |row: usize, column: usize| -> [f64; 3] {
        let rows = [
            (row.saturating_sub(1), 0.125),
            (row, 0.75),
            ((row + 1).min(height - 1), 0.125),
        ];
        let columns = [
            ((column + width - 1) % width, 0.125),
            (column, 0.75),
            ((column + 1) % width, 0.125),
        ];
        let mut mean = [0.0; 3];
        for (y, row_share) in rows {
            for (x, column_share) in columns {
                let texel = finest[y * width + x];
                for channel in 0..3 {
                    mean[channel] += row_share * column_share * f64::from(texel[channel]);
                }
            }
        }
        mean
    };

    let mut integral = [0.0; 3];
    let mut row_weights = Vec::with_capacity(height);
    let mut columns_cdf = Vec::with_capacity(width * height);
    let mut weights = vec![0.0; width];
    for row in 0..height {
        let solid_angle = cell_solid_angle(row, width, height);
        for (column, weight) in weights.iter_mut().enumerate() {
            let mean = cell_mean(row, column);
            for channel in 0..3 {
                integral[channel] += mean[channel] * solid_angle;
            }
            *weight = mean.iter().sum::<f64>() / 3.0 * solid_angle;
        }
        row_weights.push(weights.iter().sum::<f64>());
        push_cumulative(&mut columns_cdf, &weights);
    }
    if !row_weights.iter().any(|weight| *weight > 0.0) {
        return None;
    }
    let mut cdf = Vec::with_capacity(height * (width + 1));
    push_cumulative(&mut cdf, &row_weights);
    cdf.append(&mut columns_cdf);
    add_levels(&mut texels, [width, height]);
    Some(PackedEnvironment {
        texels,
        cdf,
        integral,
    })
}

/// Appends the coarser levels of a map to its size and finest level.
fn add_levels(texels: &mut Vec<[f32; 4]>, mut size: [usize; 2]) {
    let mut first = 1;
    while size[0].min(size[1]) > 1 {
        let coarser = size.map(|length| length / 2);
        let level = averaged(size, coarser, |at| texels[first + at]);
        first = texels.len();
        texels.extend(level);
        size = coarser;
    }
}

/// Solid angle of one cell of a row: (2 pi / width) (cos theta_top - cos theta_bottom).
fn cell_solid_angle(row: usize, width: usize, height: usize) -> f64 {
    let half_step = 0.5 * PI / height as f64;
    2.0 * PI / width as f64 * 2.0 * ((2 * row + 1) as f64 * half_step).sin() * half_step.sin()
}

/// Appends the cumulative shares of `weights`; the last is exactly 1. All zero: uniform, never asked for.
fn push_cumulative(cdf: &mut Vec<f32>, weights: &[f64]) {
    let total: f64 = weights.iter().sum();
    let mut sum = 0.0;
    // From the last weight above 0 on it is 1, so that rounding leaves no probability to what is black.
    let last = weights
        .iter()
        .rposition(|weight| *weight > 0.0)
        .unwrap_or(weights.len() - 1);
    for (index, weight) in weights.iter().enumerate() {
        sum += weight;
        let share = if total > 0.0 {
            sum / total
        } else {
            (index + 1) as f64 / weights.len() as f64
        };
        cdf.push(if index >= last { 1.0 } else { share as f32 });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn environment(width: u32, height: u32, radiance: impl Fn(usize) -> [f32; 3]) -> Environment {
        Environment {
            width,
            height,
            radiance: (0..(width * height) as usize).map(radiance).collect(),
            name: "test".to_owned(),
        }
    }

    #[test]
    fn a_uniform_map_integrates_to_the_sphere() {
        let packed = pack_environment(&environment(16, 8, |_| [1.0, 2.0, 0.5])).unwrap();
        for (channel, value) in [1.0, 2.0, 0.5].into_iter().enumerate() {
            assert!((packed.integral[channel] - 4.0 * PI * value).abs() < 1e-9);
        }
        // Half of the light comes from above the horizon.
        assert!((packed.cdf[3] - 0.5).abs() < 1e-6);
        assert_eq!(packed.cdf.len(), 8 + 16 * 8);
    }

    #[test]
    fn a_lone_texel_gives_its_neighbours_a_share() {
        let packed = pack_environment(&environment(8, 4, |i| {
            [if i == 8 + 3 { 64.0 } else { 0.0 }; 3]
        }))
        .unwrap();
        let row = &packed.cdf[4 + 8..4 + 16];
        let shares: Vec<f32> = (0..8)
            .map(|i| row[i] - if i == 0 { 0.0 } else { row[i - 1] })
            .collect();
        assert_eq!(shares[..2], [0.0, 0.0]);
        for (share, wanted) in shares[2..5].iter().zip([0.125, 0.75, 0.125]) {
            assert!((share - wanted).abs() < 1e-6, "{shares:?}");
        }
        assert_eq!(packed.cdf[3], 1.0);
        assert_eq!(packed.cdf[2], 1.0, "the last row is black");
    }

    #[test]
    fn coarser_levels_hold_the_means_of_what_they_cover() {
        // 6 by 4, then 3 by 2, then 1 by 1.
        let packed = pack_environment(&environment(6, 4, |i| [i as f32; 3])).unwrap();
        assert_eq!(packed.texels.len(), 1 + 24 + 6 + 1);
        assert_eq!(packed.texels[0], [6.0, 4.0, 0.0, 0.0]);
        let red: Vec<f32> = packed.texels[25..].iter().map(|texel| texel[0]).collect();
        let wanted = [3.5, 5.5, 7.5, 15.5, 17.5, 19.5, 11.5];
        for (found, wanted) in red.iter().zip(wanted) {
            assert!((found - wanted).abs() < 1e-5, "{red:?}");
        }
    }

    #[test]
    fn black_empty_and_broken_maps_are_none() {
        assert!(pack_environment(&environment(4, 2, |_| [0.0; 3])).is_none());
        assert!(pack_environment(&environment(4, 2, |_| [f32::NAN, -1.0, 0.0])).is_none());
        assert!(pack_environment(&environment(0, 0, |_| [1.0; 3])).is_none());
    }
}
