//! Gradient noise, and sums of it.

use glam::{DVec2, IVec2};

/// 0 below `from`, 1 above `to`, a cubic between.
pub fn smooth(from: f64, to: f64, at: f64) -> f64 {
    let t = ((at - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// A number from 0 to 1 (excluded) for an integer point and a seed: the finaliser of MurmurHash3 over a sum of products by odd
/// numbers.
pub fn hash(point: IVec2, seed: u32) -> f64 {
    let mut h = (point.x as u32)
        .wrapping_mul(0x9e37_79b1)
        .wrapping_add((point.y as u32).wrapping_mul(0x85eb_ca77))
        .wrapping_add(seed.wrapping_mul(0xc2b2_ae3d));
    h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
    h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
    f64::from(h ^ (h >> 16)) / 4_294_967_296.0
}

/// Gradient noise of unit wavelength, about -0.7 to 0.7 (Perlin 2002, "Improving noise", with gradients all around).
pub fn gradient(at: DVec2, seed: u32) -> f64 {
    let corner = at.floor();
    let part = at - corner;
    let fade = part * part * part * (part * (part * 6.0 - 15.0) + 10.0);
    let slope = |step: DVec2| {
        let angle = std::f64::consts::TAU * hash((corner + step).as_ivec2(), seed);
        DVec2::from_angle(angle).dot(part - step)
    };
    let [a, b, c, d] = [DVec2::ZERO, DVec2::X, DVec2::Y, DVec2::ONE].map(slope);
    let top = a + (b - a) * fade.x;
    let bottom = c + (d - c) * fade.x;
    top + (bottom - top) * fade.y
}

/// Octaves of noise, each of half the wavelength and `gain` times the height of the one before, turned so that their lattices
/// do not coincide. About -1 to 1.
pub fn fractal(at: DVec2, octaves: u32, gain: f64, seed: u32) -> f64 {
    sum(at, octaves, gain, seed, |noise| 1.5 * noise)
}

/// The same with crests instead of waves, 0 to 1 (Musgrave 1994, "Texturing and modeling", chapter on ridged fractals).
pub fn ridged(at: DVec2, octaves: u32, gain: f64, seed: u32) -> f64 {
    sum(at, octaves, gain, seed, |noise| {
        (1.0 - (1.5 * noise).abs()).max(0.0).powi(2)
    })
}

fn sum(at: DVec2, octaves: u32, gain: f64, seed: u32, of: impl Fn(f64) -> f64) -> f64 {
    let (mut place, mut height) = (at, 1.0);
    let (mut sum, mut heights) = (0.0, 0.0);
    for octave in 0..octaves {
        sum += height * of(gradient(place, seed.wrapping_add(octave)));
        heights += height;
        height *= gain;
        place = DVec2::new(1.6, 1.2).rotate(place);
    }
    sum / heights
}
