//! Procedural pictures for the gallery, as sRGB bytes. Only integer hashes, sums and products are used, so that every
//! machine paints the same bytes.

use glam::DVec2;
use image::{Rgb, RgbImage};

/// Colour with channels from 0 to 255, sRGB.
type Color = [f64; 3];

/// Paints every texel from its place: (0, 0) top left, (1, 1) bottom right.
fn paint(width: u32, height: u32, color_at: impl Fn(DVec2) -> Color) -> RgbImage {
    let size = DVec2::new(f64::from(width), f64::from(height));
    RgbImage::from_fn(width, height, |column, row| {
        let place = (DVec2::new(f64::from(column), f64::from(row)) + 0.5) / size;
        // Steps of two levels halve the PNG and cannot be seen.
        let level = |channel: f64| ((channel / 2.0).round() * 2.0).clamp(0.0, 255.0) as u8;
        Rgb(color_at(place).map(level))
    })
}

/// A floor tile pattern of 2x2 slabs with grout: warm white and dark green marble in turn. Repeats without a seam.
pub fn marble_floor(size: u32) -> RgbImage {
    paint(size, size, |place| {
        let slab = place * 2.0;
        let (column, row) = (slab.x.floor(), slab.y.floor());
        let local = slab - DVec2::new(column, row);
        let edge = local.x.min(local.y).min(1.0 - local.x).min(1.0 - local.y);
        if edge < 0.006 {
            return [92.0, 84.0, 74.0];
        }
        // Every slab is cut from another place of the quarry.
        let offset = DVec2::new(17.3 * column + 5.1 * row, 9.7 * row + 3.3 * column);
        let vein = veins(local * 2.2 + offset);
        let cloud = fractal(local * 3.0 + offset, 4);
        if (column + row) % 2.0 == 0.0 {
            mix(
                mix([226.0, 218.0, 202.0], [205.0, 193.0, 172.0], cloud),
                [150.0, 132.0, 112.0],
                0.75 * vein,
            )
        } else {
            mix(
                mix([38.0, 62.0, 54.0], [20.0, 38.0, 36.0], cloud),
                [150.0, 170.0, 156.0],
                0.6 * vein,
            )
        }
    })
}

/// An abstract of coloured bands under a low sun.
pub fn painting_dusk(width: u32, height: u32) -> RgbImage {
    paint(width, height, |place| {
        let stroke = fractal(DVec2::new(place.x * 3.0, place.y * 26.0), 4) - 0.5;
        let y = place.y + 0.07 * stroke + 0.05 * (fractal(DVec2::new(place.x * 5.0, 7.0), 3) - 0.5);
        let sky = mix(
            [44.0, 46.0, 110.0],
            [236.0, 128.0, 66.0],
            smooth(0.05, 0.55, y),
        );
        let sea = mix(
            [190.0, 84.0, 62.0],
            [26.0, 30.0, 66.0],
            smooth(0.58, 0.95, y),
        );
        let sun = place.distance(DVec2::new(0.62, 0.44));
        let base = if y < 0.57 { sky } else { sea };
        let lit = mix(
            base,
            [255.0, 220.0, 140.0],
            0.95 * (1.0 - smooth(0.085, 0.1, sun + 0.015 * stroke)),
        );
        let path = (1.0 - smooth(0.0, 0.12, (place.x - 0.62).abs() + 0.1 * stroke))
            * smooth(0.58, 0.62, y);
        mix(lit, [250.0, 170.0, 96.0], 0.55 * path)
    })
}

/// Circles and squares after the constructivists.
pub fn painting_circles(width: u32, height: u32) -> RgbImage {
    let discs: [(DVec2, f64, Color); 6] = [
        (DVec2::new(0.36, 0.40), 0.27, [196.0, 46.0, 40.0]),
        (DVec2::new(0.62, 0.58), 0.20, [22.0, 66.0, 128.0]),
        (DVec2::new(0.70, 0.26), 0.11, [236.0, 180.0, 40.0]),
        (DVec2::new(0.28, 0.76), 0.09, [30.0, 30.0, 34.0]),
        (DVec2::new(0.40, 0.36), 0.10, [240.0, 226.0, 196.0]),
        (DVec2::new(0.62, 0.60), 0.06, [240.0, 150.0, 60.0]),
    ];
    paint(width, height, |place| {
        let grain = fractal(place * 24.0, 3) - 0.5;
        let mut color = mix(
            [236.0, 226.0, 204.0],
            [214.0, 202.0, 178.0],
            fractal(place * 4.0, 3),
        );
        let bar = (place.x - place.y * 0.55 - 0.22).abs();
        color = mix([34.0, 34.0, 38.0], color, smooth(0.018, 0.022, bar));
        for (center, radius, paint) in discs {
            let inside = 1.0 - smooth(radius - 0.003, radius + 0.003, place.distance(center));
            color = mix(color, paint, 0.94 * inside);
        }
        color.map(|channel| channel * (1.0 + 0.10 * grain))
    })
}

/// Green hills in mist.
pub fn painting_hills(width: u32, height: u32) -> RgbImage {
    paint(width, height, |place| {
        let mut color = mix(
            [150.0, 186.0, 206.0],
            [242.0, 226.0, 196.0],
            smooth(0.0, 0.5, place.y),
        );
        for ridge in 0..6 {
            let depth = f64::from(ridge) / 5.0;
            let line = 0.34
                + 0.11 * f64::from(ridge)
                + 0.20
                    * (fractal(
                        DVec2::new(place.x * (2.0 + 0.7 * depth) + 13.0 * depth, 3.0 * depth),
                        4,
                    ) - 0.5);
            let slope = mix([148.0, 176.0, 170.0], [30.0, 62.0, 40.0], depth);
            let brush = fractal(DVec2::new(place.x * 30.0, place.y * 60.0), 3) - 0.5;
            color = mix(
                color,
                slope.map(|channel| channel * (1.0 + 0.25 * brush * depth)),
                smooth(line - 0.004, line + 0.004, place.y),
            );
        }
        color
    })
}

/// A carpet: dark red field with a lattice of rosettes, bands at the long sides. u runs across, v along and repeats.
pub fn carpet(size: u32) -> RgbImage {
    paint(size, size, |place| {
        let weave = 0.9
            + 0.1
                * hash(DVec2::new(
                    (place.x * 256.0).floor(),
                    (place.y * 256.0).floor(),
                ));
        let side = place.x.min(1.0 - place.x);
        let cell = DVec2::new(
            ((place.x - 0.14) / 0.72 * 3.0).fract().abs(),
            (place.y * 4.0).fract(),
        );
        let from_center = (cell - DVec2::splat(0.5)).abs();
        let rhombus = from_center.x + from_center.y;
        let color = if side < 0.025 || (0.105..0.125).contains(&side) {
            [198.0, 158.0, 84.0]
        } else if side < 0.105 {
            let wave = ((place.y * 16.0).fract() - 0.5).abs() * 2.0;
            if (side - 0.065).abs() < 0.028 * wave {
                [206.0, 178.0, 120.0]
            } else {
                [26.0, 40.0, 74.0]
            }
        } else if rhombus < 0.14 {
            [214.0, 172.0, 96.0]
        } else if rhombus < 0.30 {
            [28.0, 44.0, 82.0]
        } else if rhombus < 0.335 || (0.47..0.5).contains(&rhombus) {
            [204.0, 166.0, 98.0]
        } else {
            [124.0, 22.0, 28.0]
        };
        color.map(|channel| channel * weave)
    })
}

fn mix(a: Color, b: Color, share: f64) -> Color {
    let share = share.clamp(0.0, 1.0);
    [0, 1, 2].map(|channel| a[channel] + (b[channel] - a[channel]) * share)
}

fn smooth(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Thin bright lines where a warped noise crosses its middle.
fn veins(place: DVec2) -> f64 {
    let warp = DVec2::new(
        fractal(place + DVec2::new(31.0, 7.0), 3),
        fractal(place + DVec2::new(5.0, 43.0), 3),
    );
    let ridge = (fractal(place + warp * 1.6, 4) - 0.5).abs();
    1.0 - smooth(0.0, 0.045, ridge)
}

/// Sum of `octaves` of value noise, 0 to 1.
fn fractal(place: DVec2, octaves: u32) -> f64 {
    let mut sum = 0.0;
    let mut weight = 0.5;
    let mut scaled = place;
    for _ in 0..octaves {
        sum += weight * value_noise(scaled);
        weight *= 0.5;
        scaled = scaled * 2.0 + DVec2::new(11.5, 23.25);
    }
    sum / (1.0 - 2.0 * weight)
}

fn value_noise(place: DVec2) -> f64 {
    let cell = place.floor();
    let t = place - cell;
    let t = t * t * (DVec2::splat(3.0) - 2.0 * t);
    let at = |dx: f64, dy: f64| hash(cell + DVec2::new(dx, dy));
    let top = at(0.0, 0.0) + (at(1.0, 0.0) - at(0.0, 0.0)) * t.x;
    let bottom = at(0.0, 1.0) + (at(1.0, 1.0) - at(0.0, 1.0)) * t.x;
    top + (bottom - top) * t.y
}

/// A number from 0 to 1 for every integer place (multiplication and xor-shift, after the finaliser of MurmurHash3).
fn hash(cell: DVec2) -> f64 {
    let mut bits = (cell.x as i64 as u32).wrapping_mul(0x9e37_79b9)
        ^ (cell.y as i64 as u32).wrapping_mul(0x85eb_ca6b);
    bits ^= bits >> 16;
    bits = bits.wrapping_mul(0x85eb_ca6b);
    bits ^= bits >> 13;
    bits = bits.wrapping_mul(0xc2b2_ae35);
    bits ^= bits >> 16;
    f64::from(bits) / f64::from(u32::MAX)
}
