//! What the lookup carries from eye to eye, packed into sixteen bytes and unpacked again.

use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3};
use stereolux_gpu::{GpuContext, Resources};

use crate::adapter::context;
use crate::trace_probe::{Random, ask, probe};

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
struct Sample {
    light: [f32; 3],
    depth_m: f32,
    normal: [f32; 3],
    kind: u32,
    place_in_pixel: [f32; 2],
    /// 1 where green is not reflected.
    unlit: f32,
    /// Gloss, and from bit 7 on the channels that are a lobe's.
    mixing: u32,
}

fn there_and_back(context: &GpuContext, samples: &[Sample]) -> Vec<Sample> {
    let kernel = probe(context, include_str!("carried_probe.wesl"), &[]);
    ask(context, &kernel, &Resources::new(), samples, samples.len())
}

/// The largest channel is 2^16 to 2^17 steps, and rounding is off by half a step, or by one where it would reach 2^17: by 2^-17 of
/// the largest at most. f32 rounds the sum with a half by 2^-8 of a step.
const LIGHT_BOUND: f64 = (1.0 + 1.0 / 128.0) / (1u32 << 17) as f64;
/// Octahedral coordinates come in steps of 1 / 2047: half a step off each, sqrt(2) / 2 steps together. The octahedron's faces
/// are sqrt(3) times as long as the plane of the coordinates, and their points at least 1 / sqrt(3) from the centre, so
/// that directions are off by three times that; a hundredth for f32.
const NORMAL_BOUND: f64 = 1.01 * 3.0 * std::f64::consts::FRAC_1_SQRT_2 / 2047.0;
/// Half a sixteenth of a pixel. At the far edge it is a whole one, since the next step would be the next pixel's; the samples
/// here stay clear of it.
const PLACE_BOUND: f32 = 0.5 / 16.0;
/// Half a step where 7 of 23 bits are not the depth's, and f32's own rounding of the ratio.
const DEPTH_BOUND: f32 = 1.0 / (1 << 17) as f32 + f32::EPSILON;

#[test]
fn what_is_carried_survives_its_packing_within_its_steps() {
    let context = context();
    let mut random = Random(7);
    let mut unit = || random.unit() as f32;
    let mut samples = Vec::new();
    for i in 0..4096 {
        let magnitude = (2.0_f32).powf(unit() * 200.0 - 100.0);
        let normal = Vec3::new(unit() - 0.5, unit() - 0.5, unit() - 0.5).normalize_or(Vec3::Z);
        samples.push(Sample {
            light: [unit() * magnitude, unit() * magnitude, unit() * magnitude],
            depth_m: 1e-6 + unit() * 1e4,
            normal: normal.to_array(),
            kind: i % 4,
            place_in_pixel: [unit() * 0.96, unit() * 0.96],
            unlit: 0.0,
            mixing: i % 1024,
        });
    }
    // Corners: nothing, the ends of the range, axes, pixel centres, which must come out exactly.
    let centre = Vec2::splat(0.5).to_array();
    for (light, normal) in [
        ([0.0, 0.0, 0.0], Vec3::Z),
        ([f32::MAX, 1.0, 0.0], Vec3::NEG_Z),
        ([1.0, 2.0, 4.0], Vec3::X),
        ([0.999_999_94, 0.5, 0.25], Vec3::NEG_X),
        ([1e-30, 1e-31, 0.0], Vec3::Y),
        ([3.0, 3.0, 3.0], Vec3::NEG_Y),
    ] {
        samples.push(Sample {
            light,
            depth_m: 2.5,
            normal: normal.to_array(),
            kind: 1,
            place_in_pixel: centre,
            unlit: 0.0,
            mixing: 1023,
        });
    }
    let unpacked = there_and_back(&context, &samples);
    let light_error = |a: &Sample, b: &Sample| {
        let largest = a.light.iter().copied().fold(0.0_f32, f32::max);
        let off =
            |channel: usize| (f64::from(b.light[channel]) - f64::from(a.light[channel])).abs();
        (0..3).map(off).fold(0.0, f64::max) / f64::from(largest.max(f32::MIN_POSITIVE))
    };
    let normal_error = |a: &Sample, b: &Sample| {
        let off = Vec3::from(a.normal).as_dvec3() - Vec3::from(b.normal).as_dvec3();
        off.length()
    };
    for (given, found) in samples.iter().zip(&unpacked) {
        let what = format!("{given:?} {found:?}");
        assert_eq!(found.kind, given.kind, "{what}");
        assert_eq!(found.mixing, given.mixing, "{what}");
        let depth_off = (found.depth_m / given.depth_m - 1.0).abs();
        assert!(depth_off <= DEPTH_BOUND, "{what}");
        assert!(light_error(given, found) <= LIGHT_BOUND, "{what}");
        assert!(normal_error(given, found) <= NORMAL_BOUND, "{what}");
        for axis in 0..2 {
            let off = (found.place_in_pixel[axis] - given.place_in_pixel[axis]).abs();
            assert!(off <= PLACE_BOUND, "{what}");
        }
        if given.place_in_pixel == centre {
            assert_eq!(found.place_in_pixel, centre, "{what}");
        }
    }
    // A channel that the surface does not reflect is 0, whatever it holds.
    let hidden = samples.iter().map(|sample| Sample {
        unlit: 1.0,
        ..*sample
    });
    let hidden: Vec<_> = hidden.collect();
    for (given, found) in hidden.iter().zip(there_and_back(&context, &hidden)) {
        let [red, _, blue] = given.light;
        let rest = Sample {
            light: [red, 0.0, blue],
            ..*given
        };
        assert_eq!(found.light[1], 0.0, "{given:?} {found:?}");
        assert!(
            light_error(&rest, &found) <= LIGHT_BOUND,
            "{given:?} {found:?}"
        );
    }
    // Negative control: a sample's neighbour is none of these.
    let other = |pair: &[Sample], with: &Sample| {
        light_error(&pair[1], with) > LIGHT_BOUND && normal_error(&pair[1], with) > NORMAL_BOUND
    };
    let strangers = samples[..4096].windows(2).zip(&unpacked);
    assert!(strangers.filter(|(pair, found)| other(pair, found)).count() > 4000);
}
