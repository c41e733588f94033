//! Curves from linear radiance to what a screen shows (`output.tone`).

use glam::{Mat3, Vec3};

use crate::images::{ImageRgb, ImageRgb8, aces_filmic, to_bytes};
use crate::settings::Tone;

/// Display light, 0 to 1, of linear RGB. NaN and negative values count as 0.
#[must_use]
pub fn shown(tone: Tone, linear: [f32; 3]) -> [f32; 3] {
    // Beyond 1e4 every curve is white; the bound keeps powers finite. A NaN is not above 0.
    let bounded = |channel: f32| if channel > 0.0 { channel.min(1e4) } else { 0.0 };
    let linear = linear.map(bounded);
    let shown = match tone {
        Tone::Aces => linear.map(aces_filmic),
        Tone::Agx => agx(linear.into()).to_array(),
        Tone::Neutral => neutral(linear.into()).to_array(),
        Tone::Linear => linear,
    };
    shown.map(|channel| channel.clamp(0.0, 1.0))
}

/// AgX (T. Sobotka 2022) by the fit of B. Wrensch ("Minimal AgX Implementation", 2023): primaries moved inwards, 16.5 stops
/// of logarithm around middle grey, a polynomial sigmoid, primaries moved back.
fn agx(linear: Vec3) -> Vec3 {
    const STOPS: [f32; 2] = [-12.473_93, 4.026_069];
    const INSET: Mat3 = Mat3::from_cols(
        Vec3::new(0.842_479, 0.042_328_2, 0.042_375_7),
        Vec3::new(0.078_433_6, 0.878_468_6, 0.078_433_6),
        Vec3::new(0.079_223_7, 0.079_166_1, 0.879_143),
    );
    let curve = |stop: f32| {
        let x = ((stop - STOPS[0]) / (STOPS[1] - STOPS[0])).clamp(0.0, 1.0);
        let factors = [15.5, -40.14, 31.96, -6.868, 0.4298, 0.1191, -0.002_32];
        factors.iter().fold(0.0, |sum, factor| sum * x + factor)
    };
    let inset = INSET * linear;
    let sigmoid = Vec3::from(inset.to_array().map(|c| curve(c.max(1e-10).log2())));
    // The curve gives encoded light of a 2.2 display; here it is linear again.
    let encoded = INSET.inverse() * sigmoid;
    Vec3::from(encoded.to_array().map(|c| c.clamp(0.0, 1.0).powf(2.2)))
}

/// Khronos PBR Neutral ("Khronos PBR Neutral Tone Mapper Specification", 2024): colours up to 0.8 stay, less the 4 % that a
/// dielectric reflects; brighter ones are compressed towards white.
fn neutral(linear: Vec3) -> Vec3 {
    const START: f32 = 0.8 - 0.04;
    const DESATURATION: f32 = 0.15;
    let least = linear.min_element();
    let offset = if least < 0.08 {
        least - 6.25 * least * least
    } else {
        0.04
    };
    let color = linear - offset;
    let peak = color.max_element();
    if peak < START {
        return color;
    }
    let room = 1.0 - START;
    let new_peak = 1.0 - room * room / (peak + room - START);
    let kept = 1.0 / (DESATURATION * (peak - new_peak) + 1.0);
    (color * (new_peak / peak)).lerp(Vec3::splat(new_peak), 1.0 - kept)
}

/// The image as a screen shows it: times `exposure`, the curve, sRGB, 8 bits.
#[must_use]
pub fn tone_map_by(image: &ImageRgb, exposure: f64, tone: Tone) -> ImageRgb8 {
    let exposure = exposure as f32;
    to_bytes(image, |pixel| shown(tone, pixel.map(|c| c * exposure)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Choice as _;

    #[test]
    fn every_curve_rises_and_stays_a_colour() {
        for tone in Tone::ALL {
            let mut last = -1.0;
            for step in 0..4000 {
                let [red, green, blue] = shown(*tone, [step as f32 * 0.01; 3]);
                // The rows of AgX's matrix sum to 1 within 1.4e-4; encoded light differs by as much on each of the two ways,
                // and the power of 2.2 makes 6e-4 of it.
                let spread = (red - green).abs().max((red - blue).abs());
                assert!(spread < 1e-3, "{tone} at {step}: {spread}");
                // For the same reason AgX's channels meet the end of the logarithm 2.7e-4 of a stop apart: while one stands
                // still the others rise by 0.51 x 2.7e-4 / 16.5 = 8.2e-6. The inverse matrix takes 0.2 of that off, the power
                // makes 3.6e-6 of it.
                assert!(
                    red >= last - 4e-6 && (0.0..=1.0).contains(&red),
                    "{tone} at {step}"
                );
                last = red;
            }
            assert!(last > 0.9, "{tone}: white is {last}");
            for odd in [f32::NAN, f32::NEG_INFINITY, -1.0] {
                assert!(shown(*tone, [odd; 3])[0] < 1e-3, "{tone} of {odd}");
            }
            assert!(shown(*tone, [f32::INFINITY; 3])[0] > 0.9, "{tone}");
        }
    }

    #[test]
    fn known_values() {
        assert_eq!(shown(Tone::Linear, [0.25, 2.0, 0.0]), [0.25, 1.0, 0.0]);
        // Less 4 %, the rest as it is; the dark end is a parabola.
        let [r, g, b] = shown(Tone::Neutral, [0.5, 0.3, 0.2]);
        assert!((r - 0.46).abs() < 1e-6 && (g - 0.26).abs() < 1e-6 && (b - 0.16).abs() < 1e-6);
        let [dark, ..] = shown(Tone::Neutral, [0.04; 3]);
        assert!((dark - 6.25 * 0.04 * 0.04).abs() < 1e-6);
        // The specification's own example of its end: a peak of 1 goes to 1 - 0.24^2 / (1 - 0.04 + 0.24 - 0.76).
        let [white, ..] = shown(Tone::Neutral, [1.0; 3]);
        assert!((white - (1.0 - 0.0576 / 0.44)).abs() < 1e-5, "{white}");
        // AgX shows middle grey, 0.18, at half of the encoded light of a 2.2 display; the fit is good to a few thousandths.
        let [grey, ..] = shown(Tone::Agx, [0.18; 3]);
        assert!((grey - 0.5_f32.powf(2.2)).abs() < 0.01, "{grey}");
    }
}
