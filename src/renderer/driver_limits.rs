//! Limits on the work of one thread: llvmpipe silently aborts long loops (`docs/lavapipe.md`). And on that of a dispatch and
//! a submission: drivers of graphics cards reset a device that answers nothing for about two seconds.

use crate::frame::SAMPLES_PER_SUBMISSION;
use crate::gpu::features::ShaderFeatures;
use crate::settings::{Method, RenderSettings};

/// Loop iterations that llvmpipe allows a thread in total; it silently aborts loops beyond that.
const LOOP_TURNS: u32 = 65_535;
/// Iterations of the two searches in the environment's tables, which have fewer than 2^16 rows and columns.
const ENVIRONMENT_TURNS: u32 = 32;
/// Most paths of one thread; more gains almost nothing.
const MOST_PATHS_PER_THREAD: u32 = 16;

/// Limits on the eyes' work. Images are the same bit for bit whatever they are: they only cut what the device is given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WorkLimits {
    /// Rays of a submission, if every path were as long as settings allow, while no frame was timed.
    pub submission_rays: f64,
    /// Device milliseconds of a submission, by the last frame's times.
    pub submission_ms: f64,
}

impl WorkLimits {
    /// A software driver's, which nothing resets: who interrupts it waits for a submission. 2 M rays, and what is gathered where
    /// they end, take about 2 s.
    pub const SOFTWARE: Self = Self {
        submission_rays: 2e6,
        submission_ms: 2000.0,
    };

    /// A card's. 100 M rays take 0.2 s at half a gigaray per second; Windows resets after 2 s.
    pub const CARD: Self = Self {
        submission_rays: 1e8,
        submission_ms: 200.0,
    };

    /// Those of an adapter.
    #[must_use]
    pub fn of(is_software: bool) -> Self {
        if is_software {
            Self::SOFTWARE
        } else {
            Self::CARD
        }
    }

    /// Samples of both eyes that a submission takes, at least one: of `pixels` per eye, a sample of each having taken `pixel_ms`,
    /// if that is known.
    #[must_use]
    pub fn samples(&self, settings: &RenderSettings, pixels: u64, pixel_ms: Option<f64>) -> u32 {
        let segments = match settings.method {
            Method::Path => settings.path.max_depth,
            Method::Photon => 1,
        };
        // A segment's own ray and its shadow ray, of either eye.
        let rays = 2.0 * 2.0 * f64::from(segments) * pixels as f64;
        let samples = match pixel_ms {
            Some(ms) if ms > 0.0 => self.submission_ms / (ms * pixels as f64),
            _ => self.submission_rays / rays,
        };
        samples
            .floor()
            .clamp(1.0, f64::from(SAMPLES_PER_SUBMISSION)) as u32
    }
}

/// Paths of an eye that one thread follows, one after the other: it does not wait for the longest path of its SIMD group.
#[must_use]
pub fn eye_paths_per_thread(
    settings: &RenderSettings,
    features: &ShaderFeatures,
    hierarchy_depth: u32,
    light_tree_depth: u32,
) -> u32 {
    let per_light = if features.environment {
        ENVIRONMENT_TURNS
    } else {
        1
    };
    // A light for each sample, and the chance of one that was met; lamps that move may make the tree deeper.
    let per_pick = 2 * light_tree_depth;
    let candidates = settings.path.light_candidates;
    let per_segment =
        2 * turns_per_ray(hierarchy_depth) + candidates * (per_light + per_pick) + per_pick;
    paths_per_thread(features, per_segment, settings.path.max_depth)
}

/// The same of photon paths.
#[must_use]
pub fn photon_paths_per_thread(
    features: &ShaderFeatures,
    max_depth: u32,
    hierarchy_depth: u32,
) -> u32 {
    paths_per_thread(features, turns_per_ray(hierarchy_depth), max_depth)
}

/// A ray takes eight turns per level and some 32 for leaves, in the worst of threads that run as one (measured: the
/// gallery's paths of 12 segments of two rays take 2,048 to 4,096 turns at depth 17, the Cornell box's 1,024 to 2,048 at
/// depth 3).
fn turns_per_ray(hierarchy_depth: u32) -> u32 {
    32 + 8 * hierarchy_depth
}

/// Paths that keep well within [`LOOP_TURNS`]. On a wide machine one: fewer threads than paths would leave it idle.
fn paths_per_thread(features: &ShaderFeatures, per_segment: u32, max_depth: u32) -> u32 {
    if features.wide_machine {
        return 1;
    }
    let per_path = per_segment.saturating_mul(max_depth.max(1));
    (LOOP_TURNS / 2 / per_path).clamp(1, MOST_PATHS_PER_THREAD)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::PathSettings;

    #[test]
    fn no_submission_takes_too_long() {
        let path = |max_depth| RenderSettings {
            method: Method::Path,
            path: PathSettings {
                max_depth,
                ..PathSettings::default()
            },
            ..RenderSettings::default()
        };
        let card = WorkLimits::CARD;
        for (limits, most_rays, most_ms) in
            [(card, 1e8, 200.0), (WorkLimits::SOFTWARE, 2e6, 2000.0)]
        {
            for side in [1, 16, 512, 1024, 2048, 4096] {
                let pixels = side * side;
                for max_depth in [1, 5, 12, 64, u32::MAX] {
                    let settings = path(max_depth);
                    let rays = |samples: u32| {
                        f64::from(samples) * 4.0 * f64::from(max_depth) * pixels as f64
                    };
                    let samples = limits.samples(&settings, pixels, None);
                    assert!(
                        samples == 1 || rays(samples) <= most_rays,
                        "{side} {max_depth}"
                    );
                    // No fewer than there is room for.
                    assert!(samples == SAMPLES_PER_SUBMISSION || rays(samples + 1) > most_rays);
                    for sample_ms in [0.01, 3.0, 70.0, 5000.0] {
                        let pixel_ms = Some(sample_ms / pixels as f64);
                        let samples = limits.samples(&settings, pixels, pixel_ms);
                        assert!(samples == 1 || f64::from(samples) * sample_ms <= most_ms);
                    }
                }
            }
        }
        // 512x512, 12 segments: 6.3 M rays a sample of an eye. A photon frame's eyes trace two rays each.
        assert_eq!(card.samples(&path(12), 512 * 512, None), 7);
        let photons = RenderSettings::default();
        assert_eq!(card.samples(&photons, 2064 * 2208, None), 5);
        assert_eq!(WorkLimits::of(false), WorkLimits::CARD);
        assert_eq!(WorkLimits::of(true), WorkLimits::SOFTWARE);
    }

    #[test]
    fn threads_stay_within_their_turns() {
        let sky = ShaderFeatures {
            environment: true,
            ..ShaderFeatures::default()
        };
        let paths_among = |max_depth, features: &ShaderFeatures, depth, lights| {
            let path = PathSettings {
                max_depth,
                light_candidates: 16,
                ..PathSettings::default()
            };
            let settings = RenderSettings {
                path,
                ..RenderSettings::default()
            };
            eye_paths_per_thread(&settings, features, depth, lights)
        };
        let paths = |max_depth, features: &ShaderFeatures, depth| {
            paths_among(max_depth, features, depth, 0)
        };
        let lamps = ShaderFeatures::default();
        // Down 10 levels for each sample, and up: 176 turns and 340 more.
        assert_eq!(paths_among(12, &lamps, 6, 10), 5);
        assert_eq!(paths(12, &lamps, 5), 16);
        // 65,535 turns, halved, over 12 segments of 176.
        assert_eq!(paths(12, &lamps, 6), 15);
        assert_eq!(paths(12, &sky, 6), 4);
        assert_eq!(paths(2, &lamps, 6), MOST_PATHS_PER_THREAD);
        assert_eq!(paths(u32::MAX, &sky, 72), 1);
        for max_depth in [1, 5, 12, 64, 1000] {
            for depth in 0..72 {
                for (features, per_light) in [(&lamps, 1), (&sky, 32)] {
                    let run = paths(max_depth, features, depth);
                    let per_segment = 2 * (32 + 8 * depth) + 16 * per_light;
                    assert!(run == 1 || run * max_depth * per_segment <= LOOP_TURNS / 2);
                }
                let paths = photon_paths_per_thread(&lamps, max_depth, depth);
                assert!(paths == 1 || paths * max_depth * (32 + 8 * depth) <= LOOP_TURNS / 2);
            }
        }
        assert_eq!(
            photon_paths_per_thread(&lamps, 12, 6),
            MOST_PATHS_PER_THREAD
        );
        assert_eq!(photon_paths_per_thread(&ShaderFeatures::ALL, 12, 6), 1);
        assert_eq!(paths(12, &ShaderFeatures::ALL, 5), 1);
    }
}
