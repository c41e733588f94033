//! Lights chosen from several samples (`path.light_candidates`): the same mean, less noise, none where nothing is left to
//! chance.

use glam::DVec3;
use stereolux::scene::{LightKind, Scene};
use stereolux::settings::{Method, RenderSettings, Reuse};
use stereolux::xr::View;

use super::hard_support::{CLOSED_FORM, add_point_light, eyes_at_origin, images, worst};
use super::support::{builtin, pixel_ray, settings, statistics};
use super::techniques::{agree, blocks, box_with, brighter};
use crate::suite::embedded_scenes::plane;

fn with(method: Method, candidates: u32, depth: u32) -> RenderSettings {
    settings(|s| {
        s.method = method;
        s.reuse = Reuse::Off;
        s.path.light_candidates = candidates;
        s.path.max_depth = depth;
        s.photon.max_depth = depth;
        s.photon.count = 1 << 12;
    })
}

/// The plane with a second lamp as strong as its own, and what it looks like in closed form.
fn two_lamps(views: &[View; 2], size: u32) -> (Scene, Vec<[f32; 3]>) {
    let second = DVec3::new(0.9, -0.4, -1.2);
    let mut scene = builtin("plane");
    add_point_light(&mut scene, second, plane::LIGHT_INTENSITY);
    let expected = (0..size * size)
        .map(|pixel| {
            let ray = pixel_ray(&views[0], pixel as usize, [size, size]);
            let hit = ray.origin + ray.direction * (plane::DISTANCE_M / -ray.direction.z);
            let height = second.z + plane::DISTANCE_M;
            let other = f64::from(plane::ALBEDO) / std::f64::consts::PI
                * f64::from(plane::LIGHT_INTENSITY)
                * height
                / hit.distance(second).powi(3);
            [(plane::radiance_at(hit.x, hit.y) + other) as f32; 3]
        })
        .collect();
    (scene, expected)
}

#[test]
fn two_equal_lamps_leave_nothing_to_chance() {
    // Picks at equal distances along the power take each of the two lamps equally often, and the weights of the choice
    // then add up to both lamps' light whichever is chosen.
    const N: u32 = 24;
    let views = eyes_at_origin(35.0);
    let (scene, expected) = two_lamps(&views, N);
    for method in [Method::Photon, Method::Path] {
        for candidates in [2, 4, 16] {
            let found = images(&scene, &with(method, candidates, 2), [N, N], &views);
            let off = worst(&found[0], &expected);
            assert!(off < CLOSED_FORM, "{method:?}, {candidates}: {off}");
        }
        // Negative controls: one sample is one lamp counted twice, and three cannot take both equally often.
        for candidates in [1, 3] {
            let found = images(&scene, &with(method, candidates, 2), [N, N], &views);
            let off = worst(&found[0], &expected);
            assert!(off > 0.1, "{method:?}, {candidates}: {off}");
        }
    }
}

/// Sum over the blocks of the variance of their means.
fn noise(runs: &[Vec<f64>]) -> f64 {
    let of_block = |block: usize| {
        let means: Vec<f64> = runs.iter().map(|run| run[block]).collect();
        statistics(&means).1 * runs.len() as f64
    };
    (0..runs[0].len()).map(of_block).sum()
}

#[test]
fn candidates_change_the_noise_and_not_the_mean() {
    // Glossy walls under the box's lamp and a point light: weights of both techniques, lights with and without size.
    let (mut scene, views) = box_with(|material| {
        material.specular = 1.0;
        material.roughness = 0.6;
    });
    add_point_light(&mut scene, DVec3::new(0.7, -0.3, -0.6), 0.3);
    for (kind, method) in [Method::Photon, Method::Path].into_iter().enumerate() {
        // Depth 2: direct light alone, whose noise this is about.
        let sets: Vec<Vec<Vec<f64>>> = [1, 4, 16]
            .into_iter()
            .enumerate()
            .map(|(set, candidates)| {
                let set = 10 + 10 * kind + set;
                blocks(&scene, &views, &with(method, candidates, 2), set as u32)
            })
            .collect();
        for (pair, a, b) in [("1 and 4", 0, 1), ("1 and 16", 0, 2), ("4 and 16", 1, 2)] {
            if let Err(reason) = agree(&sets[a], &sets[b]) {
                panic!("{method:?}, {pair}: {reason}");
            }
        }
        let more = agree(&brighter(&sets[2]), &sets[1]);
        assert!(more.is_err(), "{method:?}: 5 % too much passes");
        // Over some 60 blocks of 11 degrees of freedom each, the ratio of two such sums varies by 2 / sqrt(60 * 11) = 8 %
        // where the blocks are alike and by perhaps 20 % where few of them hold most of it: a fifth less is no chance.
        let (one, four) = (noise(&sets[0]), noise(&sets[1]));
        assert!(four < 0.8 * one, "{method:?}: {four}, {one} with one");
    }
}

#[test]
fn a_single_light_without_size_is_not_chosen_from_several() {
    // The same bits: one candidate, whatever is asked for.
    let scene = builtin("plane");
    let mut lights = scene.lights.iter();
    assert!(lights.all(|light| matches!(light.kind, LightKind::Point)));
    let views = eyes_at_origin(35.0);
    let of = |candidates| images(&scene, &with(Method::Path, candidates, 2), [16, 16], &views);
    assert_eq!(of(1), of(16));
}
