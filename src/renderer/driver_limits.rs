//! Limits on the work of one thread: llvmpipe silently aborts long loops (`docs/lavapipe.md`).

use crate::gpu::features::ShaderFeatures;
use crate::settings::RenderSettings;

/// Loop iterations that llvmpipe allows a thread in total; it silently aborts loops beyond that.
const LOOP_TURNS: u32 = 65_535;
/// Iterations of the two searches in the environment's tables, which have fewer than 2^16 rows and columns.
const ENVIRONMENT_TURNS: u32 = 32;
/// Most samples of one dispatch of the path tracer, and most photon paths of one thread; more gains almost nothing.
const MOST_PATHS_PER_THREAD: u32 = 16;

/// Samples that one dispatch of the path tracer takes. A thread that begins its next path at once does not wait for the
/// longest path of its SIMD group.
#[must_use]
pub fn samples_per_dispatch(
    settings: &RenderSettings,
    features: &ShaderFeatures,
    hierarchy_depth: u32,
) -> u32 {
    let per_light = if features.environment {
        ENVIRONMENT_TURNS
    } else {
        1
    };
    let per_segment =
        2 * turns_per_ray(hierarchy_depth) + settings.path.light_candidates * per_light;
    // A power of two, so that submissions are whole runs.
    1 << paths_within_turns(per_segment, settings.path.max_depth).ilog2()
}

/// Photon paths that one thread traces, one after the other, for the same reason. On a GPU one: fewer threads than paths
/// would leave it idle.
#[must_use]
pub fn photon_paths_per_thread(is_software: bool, max_depth: u32, hierarchy_depth: u32) -> u32 {
    if is_software {
        paths_within_turns(turns_per_ray(hierarchy_depth), max_depth)
    } else {
        1
    }
}

/// A ray takes eight turns per level and some 32 for leaves, in the worst of threads that run as one (measured: the
/// gallery's paths of 12 segments of two rays take 2,048 to 4,096 turns at depth 17, the Cornell box's 1,024 to 2,048 at
/// depth 3).
fn turns_per_ray(hierarchy_depth: u32) -> u32 {
    32 + 8 * hierarchy_depth
}

/// Paths that keep well within [`LOOP_TURNS`].
fn paths_within_turns(per_segment: u32, max_depth: u32) -> u32 {
    let per_path = per_segment.saturating_mul(max_depth.max(1));
    (LOOP_TURNS / 2 / per_path).clamp(1, MOST_PATHS_PER_THREAD)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::PathSettings;

    #[test]
    fn dispatches_stay_within_the_turns_of_a_thread() {
        let sky = ShaderFeatures {
            environment: true,
            ..ShaderFeatures::default()
        };
        let samples = |max_depth, features: &ShaderFeatures, depth| {
            let path = PathSettings {
                max_depth,
                light_candidates: 16,
                ..PathSettings::default()
            };
            let settings = RenderSettings {
                path,
                ..RenderSettings::default()
            };
            samples_per_dispatch(&settings, features, depth)
        };
        let lamps = ShaderFeatures::default();
        assert_eq!(samples(12, &lamps, 5), 16);
        assert_eq!(samples(12, &lamps, 6), 8);
        assert_eq!(samples(12, &lamps, 15), 8);
        assert_eq!(samples(12, &sky, 6), 4);
        assert_eq!(samples(2, &lamps, 6), MOST_PATHS_PER_THREAD);
        assert_eq!(samples(u32::MAX, &sky, 72), 1);
        for max_depth in [1, 5, 12, 64, 1000] {
            for depth in 0..72 {
                for (features, per_light) in [(&lamps, 1), (&sky, 32)] {
                    let run = samples(max_depth, features, depth);
                    let per_segment = 2 * (32 + 8 * depth) + 16 * per_light;
                    assert!(run == 1 || run * max_depth * per_segment <= LOOP_TURNS / 2);
                    assert!(run.is_power_of_two());
                }
                let paths = photon_paths_per_thread(true, max_depth, depth);
                assert!(paths == 1 || paths * max_depth * (32 + 8 * depth) <= LOOP_TURNS / 2);
            }
        }
        assert_eq!(photon_paths_per_thread(true, 12, 6), MOST_PATHS_PER_THREAD);
        assert_eq!(photon_paths_per_thread(false, 12, 6), 1);
    }
}
