//! Values of a view as pictures: colour maps, scales, legends in numbers. No device is needed.
//!
//! [`picture`] turns an [`Inspected`] into 8-bit RGB and a [`Legend`], [`relative_error`] an image and its reference. The
//! map for numbers grows in lightness all the way, so that its order is seen also in grey and by the colour blind.

use std::fmt::Write as _;

use crate::images::{Image, ImageError, ImageRgb, ImageRgb8, srgb_encode};
use crate::metrics::MetricsError;
use crate::renderer::{Inspected, InspectedValues, Inspection, Provenance};

/// Colour of pixels that have no value: a dark grey that no map holds.
pub const NO_VALUE: [u8; 3] = [38, 38, 42];

/// Knots of the map, sRGB, at equal steps from 0 to 1: black, blue, violet, red, orange, yellow, white. CIE lightness L*
/// grows by 12.5 from each to the next (a test; by 11 to the last): equal steps of a number look equally far apart. That
/// is the reasoning of van der Walt and Smith for matplotlib's maps (SciPy 2015); the colours are our own.
const KNOTS: [[f64; 3]; 9] = [
    [0.0, 0.0, 0.0],
    [28.0, 22.0, 86.0],
    [89.0, 22.0, 134.0],
    [154.0, 35.0, 137.0],
    [210.0, 63.0, 108.0],
    [240.0, 113.0, 77.0],
    [248.0, 168.0, 68.0],
    [250.0, 217.0, 118.0],
    [251.0, 254.0, 219.0],
];

/// How numbers become shares of the colour map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Scale {
    /// In proportion.
    #[default]
    Linear,
    /// By their logarithm; numbers of 0 and below have the map's first colour.
    Log,
}

/// How a view is coloured.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Coloring {
    /// Of numbers.
    pub scale: Scale,
    /// Numbers at the ends of the map, in the values' unit; `None`: [`automatic_range`], or [`depth_range`]. For light and
    /// motion the second alone counts: what becomes white ([`automatic_white`]), and the fullest colour.
    pub range: Option<[f64; 2]>,
}

impl Coloring {
    /// What suits a view: logarithms for what spans orders of magnitude.
    #[must_use]
    pub fn of(inspection: Inspection) -> Self {
        let scale = match inspection {
            Inspection::PhotonDensity | Inspection::Variance => Scale::Log,
            _ => Scale::Linear,
        };
        Self { scale, range: None }
    }
}

/// What a legend explains.
#[derive(Clone, Debug, PartialEq)]
pub enum Legend {
    /// A bar of the colour map with numbers beside it.
    Bar {
        /// Unit of the numbers, empty for none.
        unit: &'static str,
        /// Scale of the bar.
        scale: Scale,
        /// Numbers at the bar's ends.
        range: [f64; 2],
        /// Place along the bar, 0 to 1, with the number there: ascending, as short as they can be told apart.
        ticks: Vec<(f64, String)>,
    },
    /// Colours as they are, with the value that is shown as white.
    White {
        /// Unit of the number, empty for none.
        unit: &'static str,
        /// The number.
        white: f64,
    },
    /// Directions as 0.5 + 0.5 n: red is +X, green +Y, blue +Z.
    Axes,
    /// A wheel: the hue is the direction, full at `longest`.
    Wheel {
        /// Unit of the number.
        unit: &'static str,
        /// Length of the vectors with the fullest colour.
        longest: f64,
    },
    /// Names by colour, in the labels' order. Empty where there are too many to tell.
    Labels(Vec<([u8; 3], String)>),
}

/// A picture of a view.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// 8-bit sRGB.
    pub image: ImageRgb8,
    /// What its colours mean.
    pub legend: Legend,
}

/// Colour of `share` (0 to 1, clamped) of the map, 8-bit sRGB.
#[must_use]
pub fn map_color(share: f64) -> [u8; 3] {
    let at = share.clamp(0.0, 1.0) * (KNOTS.len() - 1) as f64;
    let first = (at as usize).min(KNOTS.len() - 2);
    let part = at - first as f64;
    let (a, b) = (KNOTS[first], KNOTS[first + 1]);
    [0, 1, 2].map(|c| (a[c] + part * (b[c] - a[c])).round() as u8)
}

/// A range for the map: from the 1st to the 99th percentile of the numbers, linear ones from 0 if they come near it;
/// logarithmic ones over the positive numbers, at most six decades. Never empty: [0, 1] (logarithmic [0.1, 1]) where there
/// is nothing to see.
#[must_use]
pub fn automatic_range(values: impl IntoIterator<Item = f64>, scale: Scale) -> [f64; 2] {
    match (spread(values, scale), scale) {
        (None, Scale::Linear) => [0.0, 1.0],
        (None, Scale::Log) => [0.1, 1.0],
        (Some([low, high]), Scale::Linear) => {
            let low = if low >= 0.0 && low < 0.5 * high {
                0.0
            } else {
                low
            };
            if high > low { [low, high] } else { around(low) }
        }
        (Some([low, high]), Scale::Log) => {
            let low = low.max(high * 1e-6);
            if high > low * 1.001 {
                [low, high]
            } else {
                [high * 0.1, high]
            }
        }
    }
}

/// A range of depths: as [`automatic_range`], but from the nearest on. There is nothing at the eye, and the colours before
/// the first surface would be lost.
#[must_use]
pub fn depth_range(values: impl IntoIterator<Item = f64>) -> [f64; 2] {
    match spread(values, Scale::Linear) {
        Some([low, high]) if high > low => [low, high],
        Some([low, _]) => around(low),
        None => [0.0, 1.0],
    }
}

/// The 1st and the 99th percentile of the numbers that a scale can show.
fn spread(values: impl IntoIterator<Item = f64>, scale: Scale) -> Option<[f64; 2]> {
    let mut sorted: Vec<f64> = values
        .into_iter()
        .filter(|value| value.is_finite() && (scale == Scale::Linear || *value > 0.0))
        .collect();
    sorted.sort_by(f64::total_cmp);
    let percentile = |share: f64| {
        let last = sorted.len().saturating_sub(1);
        sorted.get((share * last as f64).round() as usize).copied()
    };
    let (low, mut high) = (percentile(0.01)?, percentile(0.99)?);
    // Few bright pixels among many dark ones: better their own range than none.
    if scale == Scale::Linear && high <= low.max(0.0) {
        high = sorted.last().copied().unwrap_or(high);
    }
    Some([low, high])
}

/// What becomes white of light: the geometric mean of the pixels that are lit over 0.18, at most the brightest. Lamps in the
/// picture hardly move it. Reinhard et al. 2002, "Photographic tone reproduction for digital images", equations 1 and 2.
#[must_use]
pub fn automatic_white(values: impl IntoIterator<Item = f64>) -> f64 {
    const KEY: f64 = 0.18;
    let (mut sum, mut count, mut most) = (0.0, 0.0, 0.0_f64);
    for value in values {
        if value > 0.0 && value.is_finite() {
            sum += value.ln();
            count += 1.0;
            most = most.max(value);
        }
    }
    if count > 0.0 {
        ((sum / count).exp() / KEY).min(most)
    } else {
        1.0
    }
}

/// A range that a constant picture lies in: from 0 to it.
fn around(value: f64) -> [f64; 2] {
    if value > 0.0 {
        [0.0, value]
    } else if value < 0.0 {
        [value, 0.0]
    } else {
        [0.0, 1.0]
    }
}

/// Share of the map that `value` has.
#[must_use]
pub fn share_of(value: f64, range: [f64; 2], scale: Scale) -> f64 {
    let [low, high] = range;
    let share = match scale {
        Scale::Linear => (value - low) / (high - low),
        Scale::Log if value > 0.0 => (value / low).ln() / (high / low).ln(),
        Scale::Log => 0.0,
    };
    if share.is_finite() {
        share.clamp(0.0, 1.0)
    } else {
        0.0
    }
}

/// Places and texts of the numbers beside a bar: at most eight, round in the decimal system, from the range's inside.
#[must_use]
pub fn ticks(range: [f64; 2], scale: Scale) -> Vec<(f64, String)> {
    let [low, high] = range;
    let numbers: Vec<f64> = match scale {
        Scale::Linear => {
            let rough = (high - low) / 5.0;
            let power = 10_f64.powf(rough.log10().floor());
            // 1, 2 or 5 times a power of ten, so that there are three to eight of them.
            let step = [1.0, 2.0, 5.0, 10.0]
                .map(|factor| factor * power)
                .into_iter()
                .find(|step| *step >= rough * 0.999)
                .unwrap_or(power);
            let first = (low / step - 1e-9).ceil() as i64;
            let last = (high / step + 1e-9).floor() as i64;
            (first..=last.min(first + 16))
                .map(|k| k as f64 * step)
                .collect()
        }
        Scale::Log => {
            let decades = (high / low).log10();
            // Where decades are few, halves and fifths of them too.
            let within: &[f64] = if decades < 2.0 {
                &[1.0, 2.0, 5.0]
            } else {
                &[1.0]
            };
            let every = (decades / 7.0).ceil().max(1.0) as i32;
            let first = low.log10().floor() as i32;
            let last = high.log10().ceil() as i32;
            (first..=last)
                .filter(|power| power.rem_euclid(every) == 0)
                .flat_map(|power| within.iter().map(move |f| f * 10_f64.powi(power)))
                .filter(|number| *number >= low * (1.0 - 1e-9) && *number <= high * (1.0 + 1e-9))
                .collect()
        }
    };
    let step = match (scale, numbers.as_slice()) {
        (Scale::Linear, [first, second, ..]) => second - first,
        _ => 0.0,
    };
    let mut texts: Vec<(f64, String)> = numbers
        .into_iter()
        .map(|number| (share_of(number, range, scale), number_text(number, step)))
        .collect();
    if texts.len() < 2 {
        // A range too narrow for round numbers: its ends.
        texts = [low, high]
            .map(|end| {
                (
                    share_of(end, range, scale),
                    number_text(end, (high - low) / 10.0),
                )
            })
            .into();
    }
    texts
}

/// A number in as few digits as tell multiples of `step` apart; `step` 0: three significant ones.
fn number_text(number: f64, step: f64) -> String {
    if number == 0.0 {
        return "0".to_owned();
    }
    let size = number.abs().log10().floor() as i32;
    let digits = if step > 0.0 {
        (size - step.log10().floor() as i32).clamp(0, 12)
    } else {
        2
    };
    if (-3..6).contains(&size) {
        let decimals = (digits - size).max(0) as usize;
        trimmed(format!("{number:.decimals$}"))
    } else {
        let digits = digits as usize;
        let text = format!("{number:.digits$e}");
        match text.split_once('e') {
            Some((mantissa, power)) => format!("{}e{power}", trimmed(mantissa.to_owned())),
            None => text,
        }
    }
}

/// Without zeroes after the decimal point.
fn trimmed(text: String) -> String {
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// Colour of a label, the same in every picture: hues by the golden ratio, so that neighbours in number differ most, in two
/// lightnesses.
#[must_use]
pub fn label_color(label: u32) -> [u8; 3] {
    let hue = (f64::from(label) * 0.618_033_988_749_895).fract();
    let (saturation, value) = [(0.55, 0.95), (0.8, 0.7), (0.35, 0.75)][label as usize % 3];
    hsv(hue, saturation, value)
}

/// Hue (turns), saturation, value as 8-bit sRGB.
fn hsv(hue: f64, saturation: f64, value: f64) -> [u8; 3] {
    let channel = |offset: f64| {
        let k = (offset + hue * 6.0).rem_euclid(6.0);
        let dip = k.min(4.0 - k).clamp(0.0, 1.0);
        (255.0 * (value - value * saturation * dip)).round() as u8
    };
    [channel(5.0), channel(3.0), channel(1.0)]
}

/// Colour of a motion: hue by direction (red is to the right, then by way of yellow down), full at `longest` pixels.
#[must_use]
pub fn motion_color(vector: [f32; 2], longest: f64) -> [u8; 3] {
    let (x, y) = (f64::from(vector[0]), f64::from(vector[1]));
    let turn = y.atan2(x) / std::f64::consts::TAU;
    let share = (x.hypot(y) / longest).clamp(0.0, 1.0);
    hsv(turn.rem_euclid(1.0), share, 0.25 + 0.75 * share.sqrt())
}

/// Values as an image, `None` in pixels that have none.
fn valued<P: Copy>(inspected: &Inspected, values: &[P]) -> Result<Image<Option<P>>, ImageError> {
    let has_value = |pixel| match &inspected.has_value {
        Some(has) => has.get(pixel).copied().unwrap_or(false),
        None => true,
    };
    let values = values.iter().enumerate();
    let pixels = values.map(|(pixel, value)| has_value(pixel).then_some(*value));
    let [width, height] = inspected.size;
    Image::new(width, height, pixels.collect())
}

fn colored<P: Copy>(values: &Image<Option<P>>, color: impl Fn(P) -> [u8; 3]) -> ImageRgb8 {
    let pixels = values.pixels.iter();
    values.like(pixels.map(|value| value.map_or(NO_VALUE, &color)))
}

fn bar<P: Copy + Into<f64>>(
    values: &Image<Option<P>>,
    unit: &'static str,
    coloring: Coloring,
) -> Picture {
    let scale = coloring.scale;
    let known = values.pixels.iter().flatten().map(|value| (*value).into());
    let range = coloring.range;
    let range = range.unwrap_or_else(|| automatic_range(known, scale));
    Picture {
        image: colored(values, |v| map_color(share_of(v.into(), range, scale))),
        legend: Legend::Bar {
            unit,
            scale,
            range,
            ticks: ticks(range, scale),
        },
    }
}

/// Provenances with their names and colours.
const PROVENANCES: [(Provenance, &str, [u8; 3]); 8] = [
    (Provenance::Background, "no surface", [0, 0, 0]),
    (Provenance::Reused, "reused", [70, 130, 90]),
    (
        Provenance::OutOfLeftView,
        "outside the left image",
        [60, 90, 220],
    ),
    (
        Provenance::Disoccluded,
        "hidden from the left eye",
        [220, 50, 40],
    ),
    (Provenance::Edge, "another surface there", [245, 210, 60]),
    (
        Provenance::ViewDependent,
        "depends on the direction",
        [200, 90, 220],
    ),
    (Provenance::Gap, "too few samples agree", [240, 240, 240]),
    (
        Provenance::Resampled,
        "reused, scattered anew",
        [170, 200, 80],
    ),
];

fn provenance(code: u32) -> Option<&'static (Provenance, &'static str, [u8; 3])> {
    PROVENANCES.iter().find(|(known, ..)| *known as u32 == code)
}

/// Colour of a provenance; of no provenance one that nobody overlooks.
pub fn provenance_color(code: u32) -> [u8; 3] {
    provenance(code).map_or([255, 0, 255], |(_, _, color)| *color)
}

/// More labels than this get no legend.
const MOST_LABELS: usize = 32;
/// The longest motion is shown as this at least, pixels: where nothing moves, what is left is how numbers are rounded.
const LEAST_MOTION_PX: f64 = 1.0;

/// A view as a picture with its legend.
///
/// # Errors
/// [`ImageError::Shape`] if values and size do not go together.
pub fn picture(inspected: &Inspected, coloring: Coloring) -> Result<Picture, ImageError> {
    let unit = inspected.inspection.unit();
    match &inspected.values {
        InspectedValues::Scalar(values) => {
            let is_depth = inspected.inspection == Inspection::Depth;
            let values = valued(inspected, values)?;
            let depths = || depth_range(values.pixels.iter().flatten().map(|v| f64::from(*v)));
            let range = coloring.range.or_else(|| is_depth.then(depths));
            Ok(bar(&values, unit, Coloring { range, ..coloring }))
        }
        InspectedValues::Color(values) => {
            // Reflectance is shown as it is.
            let values = valued(inspected, values)?;
            let brightest = |v: &[f32; 3]| f64::from(v[0].max(v[1]).max(v[2]));
            let automatic = || match unit {
                "" => 1.0,
                _ => automatic_white(values.pixels.iter().flatten().map(brightest)),
            };
            let white = coloring.range.map_or_else(automatic, |range| range[1]);
            let encode =
                |value: f32| (srgb_encode((f64::from(value) / white) as f32) * 255.0).round() as u8;
            Ok(Picture {
                image: colored(&values, |value| value.map(encode)),
                legend: Legend::White { unit, white },
            })
        }
        InspectedValues::Direction(values) => Ok(Picture {
            image: colored(&valued(inspected, values)?, |n| {
                n.map(|c| (255.0 * (0.5 + 0.5 * f64::from(c))).round() as u8)
            }),
            legend: Legend::Axes,
        }),
        InspectedValues::Vector2(values) => {
            let values = valued(inspected, values)?;
            let length = |v: &[f32; 2]| f64::from(v[0].hypot(v[1]));
            let automatic = || {
                let lengths = values.pixels.iter().flatten().map(length);
                automatic_range(lengths, Scale::Linear)[1].max(LEAST_MOTION_PX)
            };
            let longest = coloring.range.map_or_else(automatic, |range| range[1]);
            Ok(Picture {
                image: colored(&values, |v| motion_color(v, longest)),
                legend: Legend::Wheel { unit, longest },
            })
        }
        InspectedValues::Labels(values) => {
            let is_provenance = inspected.inspection == Inspection::Provenance;
            let color = if is_provenance {
                provenance_color
            } else {
                label_color
            };
            let values = valued(inspected, values)?;
            let mut labels: Vec<u32> = values.pixels.iter().flatten().copied().collect();
            labels.sort_unstable();
            labels.dedup();
            let name = |label: u32| {
                let known = provenance(label).filter(|_| is_provenance);
                known.map_or_else(|| label.to_string(), |(_, name, _)| (*name).to_owned())
            };
            let legend = if labels.len() > MOST_LABELS {
                Vec::new()
            } else {
                labels
                    .iter()
                    .map(|&label| (color(label), name(label)))
                    .collect()
            };
            Ok(Picture {
                image: colored(&values, color),
                legend: Legend::Labels(legend),
            })
        }
    }
}

/// Squared relative error of each pixel, the terms whose mean is [`crate::metrics::Comparison::rel_mse`], as a picture. Of
/// an image that is all noise they average 1 and more; 1e-2 is an error of a tenth. Pixels that are not finite, and all
/// against a black reference, have no value.
///
/// # Errors
/// [`MetricsError::SizeMismatch`] if the images differ in size.
pub fn relative_error(
    image: &ImageRgb,
    reference: &ImageRgb,
    coloring: Coloring,
) -> Result<Picture, MetricsError> {
    let errors = crate::metrics::rel_mse_map(image, reference)?;
    Ok(bar(&errors, "", coloring))
}

impl Legend {
    /// The legend in a line of text, for status bars and reports.
    #[must_use]
    pub fn line(&self) -> String {
        let with_unit = |number: f64, unit: &str| {
            format!("{} {unit}", number_text(number, 0.0))
                .trim_end()
                .to_owned()
        };
        match self {
            Self::Bar {
                unit, scale, range, ..
            } => {
                let kind = match scale {
                    Scale::Linear => "",
                    Scale::Log => ", logarithmic",
                };
                let [low, high] = range.map(|end| with_unit(end, unit));
                format!("{low} to {high}{kind}")
            }
            Self::White { unit, white } => format!("white is {}", with_unit(*white, unit)),
            Self::Axes => "red +X, green +Y, blue +Z".to_owned(),
            Self::Wheel { unit, longest } => {
                format!("hue by direction, full at {}", with_unit(*longest, unit))
            }
            Self::Labels(labels) => {
                let mut line = String::new();
                for (_, name) in labels {
                    let _ = write!(line, "{}{name}", if line.is_empty() { "" } else { ", " });
                }
                line
            }
        }
    }
}

#[cfg(test)]
mod tests;
