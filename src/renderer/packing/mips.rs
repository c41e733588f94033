//! Coarser levels of textures, each half as wide and high as the one before, by area.

use std::sync::LazyLock;

use rayon::prelude::*;

use crate::images::{srgb_decode, srgb_encode};
use crate::scene::{AlphaMode, Image, Material};

/// What a texture stands for, and so how its texels are averaged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Averaging {
    /// Not at all: there is one level.
    None,
    /// Colours in sRGB, averaged in linear light; alpha as it is.
    Color,
    /// The same, weighted by alpha: what cannot be seen leaves no tint.
    BlendedColor,
    /// Weighted by whether alpha is at least this byte; coarser levels hold the share of texels that have it as their alpha.
    MaskedColor(u16),
    /// Numbers.
    Linear,
    /// Tangent-space normals. Level 0 has alpha 0, coarser ones what their texels' normals add to the GGX alpha (in squares).
    Normals,
}

impl Averaging {
    /// Of a material's texture, named as in [`Material::texture_slots`], where textures have levels.
    pub fn of(material: &Material, slot: &str) -> Self {
        match slot {
            "base_color" => match material.alpha_mode {
                AlphaMode::Opaque => Self::Color,
                AlphaMode::Blend => Self::BlendedColor,
                AlphaMode::Mask { cutoff } if cutoff <= 0.0 => Self::Color,
                AlphaMode::Mask { cutoff } => {
                    let least = (255.0 * cutoff / material.base_color[3].max(1e-6)).ceil();
                    Self::MaskedColor(least.clamp(0.0, 256.0) as u16)
                }
            },
            "emissive" | "specular_color" => Self::Color,
            "normal" => Self::Normals,
            _ => Self::Linear,
        }
    }

    /// Levels of an image of this size, itself included.
    pub fn level_count(self, width: u32, height: u32) -> u32 {
        match self {
            Self::None => 1,
            _ => width.max(height).max(1).ilog2() + 1,
        }
    }

    /// What the mean of texels is taken of.
    fn expand(self, texel: &[u8]) -> [f32; 4] {
        let unit = |channel: usize| f32::from(texel[channel]) / 255.0;
        match self {
            Self::None | Self::Linear => std::array::from_fn(unit),
            Self::Normals => {
                let normal = glam::Vec3::from_array(std::array::from_fn(|c| unit(c) * 2.0 - 1.0));
                let normal = normal.try_normalize().unwrap_or(glam::Vec3::Z);
                normal.extend(0.0).to_array()
            }
            Self::Color | Self::BlendedColor | Self::MaskedColor(_) => {
                let (weight, alpha) = match self {
                    Self::MaskedColor(least) => {
                        let share = f32::from(u16::from(texel[3]) >= least);
                        (share + LEAST_WEIGHT, share + LEAST_WEIGHT)
                    }
                    Self::BlendedColor => (unit(3) + LEAST_WEIGHT, unit(3) + LEAST_WEIGHT),
                    _ => (1.0, unit(3)),
                };
                let color = |c: usize| weight * LINEAR_OF_BYTE[texel[c] as usize];
                [color(0), color(1), color(2), alpha]
            }
        }
    }

    /// The texel of a mean.
    fn pack(self, mean: [f32; 4]) -> u32 {
        let bytes: [u8; 4] = match self {
            Self::None | Self::Linear => mean.map(byte),
            Self::Color => [
                byte(srgb_encode(mean[0])),
                byte(srgb_encode(mean[1])),
                byte(srgb_encode(mean[2])),
                byte(mean[3]),
            ],
            Self::BlendedColor | Self::MaskedColor(_) => {
                let color = |c: usize| byte(srgb_encode(mean[c] / mean[3]));
                [color(0), color(1), color(2), byte(mean[3] - LEAST_WEIGHT)]
            }
            Self::Normals => {
                let mean = glam::Vec3::from_slice(&mean[..3]);
                let normal = mean.try_normalize().unwrap_or(glam::Vec3::Z);
                let [x, y, z] = (0.5 * normal + 0.5).to_array().map(byte);
                [x, y, z, byte(alpha_of_normals(mean.length()))]
            }
        };
        u32::from_le_bytes(bytes)
    }
}

/// Weight of a texel that cannot be seen: where there are no others, its colour is the mean.
const LEAST_WEIGHT: f32 = 1.0 / 4096.0;

static LINEAR_OF_BYTE: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|byte| srgb_decode(byte as f64 / 255.0) as f32));

fn byte(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

/// GGX alpha that normals add (in squares) whose mean is this long (Toksvig 2005): they are taken as spread by von Mises and
/// Fisher's law, whose concentration k follows from that length (Banerjee et al. 2005), and 1/k is the variance of their slopes
/// per axis, of which alpha^2 is twice (Olano and Baker 2010).
pub fn alpha_of_normals(mean_length: f32) -> f32 {
    let length = f64::from(mean_length).clamp(0.0, 1.0);
    if length < 1e-3 {
        return 1.0;
    }
    let squared = 2.0 * (1.0 - length * length) / (length * (3.0 - length * length));
    squared.sqrt().min(1.0) as f32
}

/// Texels of all levels together.
pub(super) fn texel_count(image: &Image, averaging: Averaging) -> u64 {
    let levels = averaging.level_count(image.width, image.height);
    let sizes = (0..levels).map(|level| [image.width, image.height].map(|size| half(size, level)));
    sizes
        .map(|[width, height]| u64::from(width) * u64::from(height))
        .sum()
}

fn half(size: u32, times: u32) -> u32 {
    (size >> times).max(size.min(1))
}

/// Appends the texels of all levels, finest first, and returns the sizes. Means are taken of the level before as it was before
/// it was rounded to bytes.
pub(super) fn add_levels(
    image: &Image,
    averaging: Averaging,
    texels: &mut Vec<u32>,
) -> Vec<[u32; 2]> {
    let alpha = |t: &[u8]| match averaging {
        Averaging::Normals => 0,
        _ => t[3],
    };
    let finest = image.rgba8.chunks_exact(4);
    texels.extend(finest.map(|t| u32::from_le_bytes([t[0], t[1], t[2], alpha(t)])));
    let mut sizes = vec![[image.width, image.height]];
    let finest = |at: usize| averaging.expand(&image.rgba8[4 * at..4 * at + 4]);
    let mut size = [image.width as usize, image.height as usize];
    let mut before: Vec<[f32; 4]> = Vec::new();
    for level in 1..averaging.level_count(image.width, image.height) {
        let coarser = [half(image.width, level), half(image.height, level)];
        let to = coarser.map(|size| size as usize);
        before = if level == 1 {
            averaged(size, to, finest)
        } else {
            averaged(size, to, |at| before[at])
        };
        let packed = before.par_iter().map(|mean| averaging.pack(*mean));
        texels.par_extend(packed);
        sizes.push(coarser);
        size = to;
    }
    sizes
}

/// Means over the area of each texel of a smaller image.
pub(super) fn averaged(
    from: [usize; 2],
    to: [usize; 2],
    texel: impl Fn(usize) -> [f32; 4] + Sync,
) -> Vec<[f32; 4]> {
    let columns: Vec<Vec<(usize, f32)>> = (0..to[0]).map(|x| shares(from[0], to[0], x)).collect();
    let row = |y: usize| {
        let rows = shares(from[1], to[1], y);
        let mean = |columns: &Vec<(usize, f32)>| {
            let mut sum = [0.0; 4];
            for (y, height) in &rows {
                for (x, width) in columns {
                    let value = texel(y * from[0] + x);
                    sum = std::array::from_fn(|c| sum[c] + width * height * value[c]);
                }
            }
            sum
        };
        columns.iter().map(mean).collect::<Vec<_>>()
    };
    (0..to[1]).into_par_iter().flat_map_iter(row).collect()
}

/// The texels of a line of `from` that texel `at` of a line of `to` covers, at most three, and their shares of it.
fn shares(from: usize, to: usize, at: usize) -> Vec<(usize, f32)> {
    // In units of 1 / to texels.
    let (start, end) = (at * from, (at + 1) * from);
    let covered = (start / to)..end.div_ceil(to);
    let share = |x: usize| ((end.min((x + 1) * to) - start.max(x * to)) as f32) / from as f32;
    covered.map(|x| (x, share(x))).collect()
}

#[cfg(test)]
mod tests;
