//! What the filters read and write, packed and unpacked again.

use bytemuck::{Pod, Zeroable};
use stereolux_gpu::Resources;

use crate::adapter::context;
use crate::trace_probe::{Random, ask, probe};

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
struct Sample {
    /// Light over albedo, and its variance.
    direct: [f32; 4],
    indirect: [f32; 4],
    /// Mean and variance, of direct and of indirect light.
    moments: [f32; 4],
    motion: [f32; 2],
    distance_m: f32,
    is_known: u32,
    emission: [f32; 3],
    padding: f32,
}

/// Half a step of the greatest channel, which is 2^13 steps or more, or a whole one where it would leave its 14 bits, at
/// 2^14 steps: 2^-14 of it either way. f32 rounds the sum with a half by 2^-11 of a step.
const LIGHT: f64 = (1.0 + 1.0 / 1024.0) / (1u32 << 14) as f64;
/// Half a step of a mantissa of so many bits, of a number that is at least 2^bits steps.
const fn half_a_step(bits: u32) -> f64 {
    0.5 / (1u32 << bits) as f64
}
const VARIANCE: f64 = half_a_step(6);
const MEAN: f64 = half_a_step(10);
const MOTION: f64 = half_a_step(13);
const DISTANCE: f64 = half_a_step(12);
/// Up by less than a step of the greatest channel, which is 64 steps or more.
const EMISSION: f64 = 1.0 / 64.0;

fn off(given: f32, found: f32) -> f64 {
    f64::from(found) - f64::from(given)
}

fn relative(given: f32, found: f32) -> f64 {
    off(given, found).abs() / f64::from(given.abs()).max(f64::MIN_POSITIVE)
}

fn greatest(channels: &[f32]) -> f64 {
    f64::from(channels.iter().copied().fold(f32::MIN_POSITIVE, f32::max))
}

/// Errors over their bounds: light, variances, means, motion, distance, emission.
fn errors(given: &Sample, found: &Sample) -> [f64; 6] {
    let channels = |given: &[f32], found: &[f32]| -> f64 {
        let each = given.iter().zip(found).map(|(a, b)| off(*a, *b).abs());
        each.fold(0.0, f64::max) / greatest(given)
    };
    let light = channels(&given.direct[..3], &found.direct[..3])
        .max(channels(&given.indirect[..3], &found.indirect[..3]));
    let variances = [
        (given.direct[3], found.direct[3]),
        (given.indirect[3], found.indirect[3]),
        (given.moments[1], found.moments[1]),
        (given.moments[3], found.moments[3]),
    ];
    let means = [0, 2].map(|k| (given.moments[k], found.moments[k]));
    let motions = [0, 1].map(|k| (given.motion[k], found.motion[k]));
    let worst = |pairs: &[(f32, f32)]| {
        pairs
            .iter()
            .map(|(a, b)| relative(*a, *b))
            .fold(0.0, f64::max)
    };
    [
        light / LIGHT,
        worst(&variances) / VARIANCE,
        worst(&means) / MEAN,
        worst(&motions) / MOTION,
        relative(given.distance_m, found.distance_m) / DISTANCE,
        channels(&given.emission, &found.emission) / EMISSION,
    ]
}

#[test]
fn what_filters_read_survives_its_packing_within_its_steps() {
    let context = context();
    let mut random = Random(11);
    let mut unit = || random.unit() as f32;
    let mut samples = Vec::new();
    for i in 0..4096 {
        let mut number = |bits: f32| (2.0_f32).powf(bits * (unit() - 0.5)) * (0.5 + unit());
        let magnitude = number(200.0);
        let mut light = || [0, 1, 2].map(|_| magnitude * number(4.0));
        let [[dr, dg, db], [ir, ig, ib], emission] = [light(), light(), light()];
        samples.push(Sample {
            direct: [dr, dg, db, number(120.0)],
            indirect: [ir, ig, ib, number(120.0)],
            moments: [number(120.0), number(120.0), number(120.0), number(120.0)],
            motion: [number(40.0), -number(40.0)],
            distance_m: number(60.0),
            is_known: u32::from(i % 5 != 0),
            emission,
            padding: 0.0,
        });
    }
    // Ends of the range, and what rounding takes to the next power of two.
    let corners = [
        Sample {
            is_known: 1,
            ..Sample::default()
        },
        Sample {
            direct: [f32::MAX, 1.0, 0.0, 0.0],
            indirect: [0.999_999_94, 0.5, 0.25, 1.0],
            moments: [0.999_999_94, 1.999_999_9, 0.0, 1.0],
            motion: [0.999_999_94, -1.0],
            distance_m: 1.999_999_9,
            is_known: 1,
            emission: [1.0, 0.999_999_94, 0.0],
            padding: 0.0,
        },
    ];
    samples.extend(corners);
    let kernel = probe(&context, include_str!("filtered_probe.wesl"), &[]);
    let unpacked: Vec<Sample> = ask(
        &context,
        &kernel,
        &Resources::new(),
        &samples,
        samples.len(),
    );
    let mut worst = [0.0_f64; 6];
    for (given, found) in samples.iter().zip(&unpacked) {
        let what = format!("{given:?} {found:?}");
        let mut errors = errors(given, found);
        assert_eq!(found.is_known, given.is_known, "{what}");
        if given.is_known == 0 {
            errors[4] = 0.0;
        }
        assert!(
            errors.iter().all(|error| *error <= 1.0),
            "{errors:?} {what}"
        );
        // No part of a lamp may be left to the filter.
        let is_less = |channel: usize| found.emission[channel] < given.emission[channel];
        assert!(!(0..3).any(is_less), "{what}");
        for (worst, error) in worst.iter_mut().zip(errors) {
            *worst = worst.max(error);
        }
    }
    let zero = unpacked[4096];
    assert_eq!(zero, corners[0], "nothing comes out as nothing");
    // Bounds that nothing comes near would not see a lost bit.
    assert!(worst.iter().all(|worst| *worst > 0.9), "{worst:?}");
}
