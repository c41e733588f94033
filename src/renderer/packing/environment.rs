//! Environment map: texels and the distribution that directions are drawn from.

use std::f64::consts::PI;

use super::mips::averaged;
use crate::scene::Environment;

/// Rows, and half the columns, below which cells are parted to integrate over them: in smaller ones cosines hardly change.
const FINE_ROWS: usize = 256;

/// Shares of a texel before, of a cell's own and of the one after in the bilinear map's mean over the cell, along one edge.
const MEAN_SHARES: [f64; 3] = [0.125, 0.75, 0.125];

/// An environment as `shaders/shared/environment.wesl` reads it.
#[derive(Clone, Debug, Default)]
pub struct PackedEnvironment {
    /// Columns and rows. Then linear radiance, row 0 = +Y; the fourth channel is 0. What was negative or not a number is 0. Then
    /// coarser levels, each with the means over half as many columns and rows (rounded down), while both are more than one.
    pub texels: Vec<[f32; 4]>,
    /// Cumulative probability of the rows (`height` values), then of each row's columns (`width` values per row).
    pub cdf: Vec<f32>,
    /// Irradiances of both sides of planes across x, y and z together, W m^-2: integrals over the sphere of the radiance times
    /// the magnitude of the direction's component.
    pub through_planes: [[f64; 3]; 3],
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
    // Around a texel, by the shares of the row or column before, of its own and of the one after.
    let weighed = |row: usize, column: usize, row_shares: [f64; 3], column_shares: [f64; 3]| {
        let rows = [row.saturating_sub(1), row, (row + 1).min(height - 1)];
        let columns = [(column + width - 1) % width, column, (column + 1) % width];
        let mut mean = [0.0; 3];
        for (y, row_share) in rows.into_iter().zip(row_shares) {
            for (x, column_share) in columns.into_iter().zip(column_shares) {
                let texel = finest[y * width + x];
                for channel in 0..3 {
                    mean[channel] += row_share * column_share * f64::from(texel[channel]);
                }
            }
        }
        mean
    };
    let cell_mean = |row, column| weighed(row, column, MEAN_SHARES, MEAN_SHARES);
    // Parts of a cell's edge, at whose middle the map is linear.
    let parts: Vec<[f64; 3]> = match FINE_ROWS / height.max(width / 2) {
        0 | 1 => vec![MEAN_SHARES],
        count => (0..count)
            .map(|part| {
                let off = (part as f64 + 0.5) / count as f64 - 0.5;
                [(-off).max(0.0), 1.0 - off.abs(), off.max(0.0)]
            })
            .collect(),
    };
    let by_row = row_projections(height * parts.len());
    let by_column = column_projections(width * parts.len());

    let mut through_planes = [[0.0; 3]; 3];
    let mut row_weights = Vec::with_capacity(height);
    let mut columns_cdf = Vec::with_capacity(width * height);
    let mut weights = vec![0.0; width];
    for row in 0..height {
        let solid_angle = cell_solid_angle(row, width, height);
        for (column, weight) in weights.iter_mut().enumerate() {
            let mean = cell_mean(row, column);
            let [rows, columns] = [row, column].map(|cell| cell * parts.len());
            for (row_shares, [level, upright]) in parts.iter().zip(&by_row[rows..]) {
                for (column_shares, [x, y, z]) in parts.iter().zip(&by_column[columns..]) {
                    let radiance = match parts.len() {
                        1 => mean,
                        _ => weighed(row, column, *row_shares, *column_shares),
                    };
                    let projections = [level * x, upright * y, level * z];
                    for (through, projection) in through_planes.iter_mut().zip(projections) {
                        for channel in 0..3 {
                            through[channel] += radiance[channel] * projection;
                        }
                    }
                }
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
        through_planes,
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

/// Integrals of |sin| from 0 to `angle`.
fn rectified_sine(angle: f64) -> f64 {
    let turns = (angle / PI).floor();
    2.0 * turns + 1.0 - (angle - PI * turns).cos()
}

/// What of the integrals of a direction's components' magnitudes, over cells between two of `count` rows from pole to pole, is
/// the row's: for the components along the horizon, and for the vertical one.
fn row_projections(count: usize) -> Vec<[f64; 2]> {
    let squared_sine = |angle: f64| 0.5 * angle - 0.25 * (2.0 * angle).sin();
    let upright = |angle: f64| 0.25 * rectified_sine(2.0 * angle);
    differences(count, PI, |angle| [squared_sine(angle), upright(angle)])
}

/// What is the column's: for x, y and z.
fn column_projections(count: usize) -> Vec<[f64; 3]> {
    differences(count, 2.0 * PI, |angle| {
        [
            rectified_sine(angle),
            angle,
            rectified_sine(angle + 0.5 * PI),
        ]
    })
}

/// By how much antiderivatives grow over each of `count` parts of [0, `end`].
fn differences<const N: usize>(
    count: usize,
    end: f64,
    of: impl Fn(f64) -> [f64; N],
) -> Vec<[f64; N]> {
    let at = |edge: usize| of(end * edge as f64 / count as f64);
    let between = |part| {
        let (before, after) = (at(part), at(part + 1));
        std::array::from_fn(|which| after[which] - before[which])
    };
    (0..count).map(between).collect()
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
    fn a_uniform_map_shines_through_planes_as_a_lambert_surface_does() {
        let packed = pack_environment(&environment(16, 8, |_| [1.0, 2.0, 0.5])).unwrap();
        for (channel, value) in [1.0, 2.0, 0.5].into_iter().enumerate() {
            for through in packed.through_planes {
                assert!((through[channel] - 2.0 * PI * value).abs() < 1e-9);
            }
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
