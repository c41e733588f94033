//! Values of flags: words, numbers, poses, angles. An error says what is wrong, to follow the flag and its value.

use std::ops::{Range, RangeInclusive};

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use glam::{DQuat, DVec3};

use super::quoted;
use crate::settings::Choice;
use crate::xr::headset::MAX_IPD_M;
use crate::xr::validation::{MAX_FOV_ANGLE_DEG, QUATERNION_LENGTH_TOLERANCE, unit_quaternion};
use crate::xr::{Fov, Pose, TraceBody};

/// Words as a flag takes them, each with its sentence in the help.
pub(super) fn words(words: &[&'static str], sentences: &[&'static str]) -> PossibleValuesParser {
    let explained = words.iter().zip(sentences);
    explained
        .map(|(word, sentence)| PossibleValue::new(*word).help(*sentence))
        .collect::<Vec<_>>()
        .into()
}

/// A choice as a flag takes it.
pub(super) fn choice<C: Choice>() -> impl TypedValueParser<Value = C> {
    words(C::WORDS, C::SENTENCES)
        .try_map(|word| C::from_word(&word).ok_or_else(|| format!("unknown word {word}")))
}

/// A whole number of a range.
pub(super) fn whole(range: RangeInclusive<u32>) -> impl Fn(&str) -> Result<u32, String> + Clone {
    move |text| {
        let number = text.trim().parse().ok();
        number
            .filter(|number| range.contains(number))
            .ok_or_else(|| {
                let (min, max) = (range.start(), range.end());
                format!("must be a whole number from {min} to {max}")
            })
    }
}

/// A distance between the eyes in metres.
pub(super) fn ipd_m(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(ipd_m) if (0.0..=MAX_IPD_M).contains(&ipd_m) => Ok(ipd_m + 0.0),
        _ => Err(format!(
            "must be a distance in metres from 0 to {MAX_IPD_M}"
        )),
    }
}

/// A finite number that is `allowed`, which `allowed_words` say.
pub(super) fn real(
    allowed: fn(f64) -> bool,
    allowed_words: &'static str,
) -> impl Fn(&str) -> Result<f64, String> + Clone {
    move |text| match text.trim().parse::<f64>() {
        // `-0` is zero.
        Ok(number) if number.is_finite() && allowed(number) => Ok(number + 0.0),
        _ => Err(format!("must be {allowed_words}")),
    }
}

/// Frames `A..B`, at least one.
pub(super) fn frame_range(text: &str) -> Result<Range<u32>, String> {
    let range = || {
        let (from, to) = text.split_once("..")?;
        let range = from.trim().parse().ok()?..to.trim().parse().ok()?;
        Some(range).filter(|range| !range.is_empty())
    };
    range().ok_or_else(|| "must be A..B with whole numbers, A below B, such as 100..200".to_owned())
}

/// Part I of N, from 1.
pub(super) fn shard(text: &str) -> Result<[u32; 2], String> {
    let shard = || {
        let (number, of) = text.split_once('/')?;
        let [number, of] = [number, of].map(|word| word.trim().parse::<u32>().ok());
        let [number, of] = [number?, of?];
        (1..=of).contains(&number).then_some([number, of])
    };
    shard().ok_or_else(|| "must be I/N with I from 1 to N, such as 2/4".to_owned())
}

/// The name of a scene.
pub(super) fn scene(text: &str) -> Result<String, String> {
    match text {
        "" => Err("must be a glTF file or builtin:NAME".to_owned()),
        name => Ok(name.to_owned()),
    }
}

/// What `--trace-body` takes.
pub(super) fn trace_body(text: &str) -> Result<TraceBody, String> {
    match text {
        "openxr" => Ok(TraceBody::OpenXr),
        "optical" => Ok(TraceBody::Optical),
        text => numbers::<4>(text, "openxr, optical or qx qy qz qw")
            .and_then(quaternion)
            .map(TraceBody::Quaternion),
    }
}

/// Largest coordinate of a head position in metres.
const MAX_COORDINATE_M: f64 = 1e9;

/// Exactly `N` finite numbers, separated by blanks or commas.
fn numbers<const N: usize>(text: &str, names: &str) -> Result<[f64; N], String> {
    let mut values = [0.0; N];
    let mut count = 0;
    for word in text
        .split(|c: char| c.is_whitespace() || c == ',')
        .filter(|word| !word.is_empty())
    {
        let value: f64 = word
            .parse()
            .map_err(|_| format!("{} is not a number; give \"{names}\"", quoted(word)))?;
        if !value.is_finite() {
            return Err(format!("{word} is not finite; give \"{names}\""));
        }
        if let Some(slot) = values.get_mut(count) {
            *slot = value;
        }
        count += 1;
    }
    if count != N {
        return Err(format!("{count} numbers where {N} are needed: \"{names}\""));
    }
    Ok(values)
}

/// A rotation from `qx qy qz qw`, normalised.
fn quaternion(values: [f64; 4]) -> Result<DQuat, String> {
    let [x, y, z, w] = values;
    unit_quaternion(x, y, z, w).map_err(|_| {
        let length = DQuat::from_array(values).length();
        format!(
            "the quaternion's length is {length:.6}; it must be 1 within {QUATERNION_LENGTH_TOLERANCE}, in the order qx qy qz qw"
        )
    })
}

/// A head pose from `x y z qx qy qz qw`.
pub(super) fn pose(text: &str) -> Result<Pose, String> {
    let [x, y, z, qx, qy, qz, qw] = numbers::<7>(text, "x y z qx qy qz qw")?;
    let position = DVec3::new(x, y, z);
    if position.abs().max_element() > MAX_COORDINATE_M {
        return Err(format!(
            "a position is farther than {MAX_COORDINATE_M:e} m from the origin"
        ));
    }
    Ok(Pose::new(position, quaternion([qx, qy, qz, qw])?))
}

/// FOV angles from `left right up down` in degrees.
pub(super) fn fov(text: &str) -> Result<Fov, String> {
    let names = "left right up down";
    let angles = numbers::<4>(text, names)?;
    if let Some(angle) = angles.iter().find(|angle| angle.abs() > MAX_FOV_ANGLE_DEG) {
        return Err(format!(
            "{angle} degrees is beyond +-{MAX_FOV_ANGLE_DEG}; give \"{names}\" in degrees"
        ));
    }
    let [left, right, up, down] = angles;
    if left >= right {
        return Err(format!(
            "left ({left}) must be less than right ({right}); give \"{names}\" with left negative"
        ));
    }
    if down >= up {
        return Err(format!(
            "down ({down}) must be less than up ({up}); give \"{names}\" with down negative"
        ));
    }
    Ok(Fov::from_degrees(left, right, up, down))
}
