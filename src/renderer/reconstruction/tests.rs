//! Light samples of the frame before (`photon.light_history`).

use glam::{DAffine3, DVec3};

use super::*;
use crate::bench::scenes::Generated;
use crate::gpu::ShaderLibrary;
use crate::renderer::test_support::replaced;
use crate::renderer::{Eye, InstanceId, Renderer};
use crate::scene::Scene;
use crate::settings::{Eyes, Settings};
use crate::xr::{Fov, Headset, Pose, View};

const SIZE: usize = 48;
const BLOCK: usize = 8;
const BLOCKS: usize = SIZE / BLOCK;
/// Independent runs.
const RUNS: u32 = 12;
/// Frames of a run; its last one is looked at.
const FRAMES: u32 = 9;

fn settings(frames: u32) -> RenderSettings {
    let mut settings = RenderSettings::default();
    // Direct light alone.
    settings.photon.max_depth = 2;
    settings.photon.count = 0;
    settings.photon.light_history = frames;
    settings.reconstruct.svgf = true.into();
    settings.reconstruct.taa = false.into();
    settings.reconstruct.still = false.into();
    settings.output.parts = true;
    settings
}

fn renderer(library: &ShaderLibrary, scene: &Scene, settings: &RenderSettings) -> Renderer {
    let context = GpuContext::open(Some(&Settings::default().adapter)).unwrap();
    let size = [SIZE as u32; 2];
    Renderer::new(context, library, scene, settings, Eyes::Both, size).unwrap()
}

/// Views from where the scene starts, `away` from there.
fn views(scene: &Scene, away: DVec3) -> [View; 2] {
    let headset = Headset::load(&Settings::default().headset).unwrap();
    let start = scene.start_pose();
    let views = headset.views_from_head(&Pose::new(start.position + away, start.orientation));
    // The Cornell box fills such views.
    let fov = Fov::from_degrees(-20.0, 20.0, 20.0, -20.0);
    views.map(|view| View { fov, ..view })
}

/// Direct light of both eyes, one channel, before any filter.
fn direct_light(renderer: &Renderer) -> Vec<f64> {
    let of_eye = |eye| renderer.read_parts(eye).unwrap().unwrap().direct;
    let both = Eye::BOTH.map(of_eye).concat();
    both.iter().map(|pixel| f64::from(pixel[1])).collect()
}

/// What may happen before frame `left` of a run from its last.
type Happens<'a> = &'a dyn Fn(&mut Renderer, u32);

/// Direct light in the last frames of runs that share no random number; `step_m` is how far the head moves per frame.
fn runs(
    library: &ShaderLibrary,
    scene: &Scene,
    [set, frames]: [u32; 2],
    step_m: DVec3,
    happens: Happens<'_>,
) -> Vec<Vec<f64>> {
    let mut renderer = renderer(library, scene, &settings(frames));
    let one = |run| {
        renderer.reconstruction.as_mut().unwrap().reset();
        for left in (0..FRAMES).rev() {
            happens(&mut renderer, left);
            let views = views(scene, step_m * f64::from(left));
            let frame = 10_000 * set + 100 * run + FRAMES - 1 - left;
            renderer.render_frame(&views, frame, |_| {}).unwrap();
        }
        direct_light(&renderer)
    };
    (0..RUNS).map(one).collect()
}

/// Mean and the square of its standard error.
fn statistics(values: impl Iterator<Item = f64> + Clone) -> [f64; 2] {
    let n = f64::from(RUNS);
    let mean = values.clone().sum::<f64>() / n;
    let squares: f64 = values.map(|value| (value - mean).powi(2)).sum();
    [mean, squares / (n * (n - 1.0))]
}

/// Means over 8x8 pixels of either eye.
fn blocks(image: &[f64]) -> Vec<f64> {
    let mut means = vec![0.0; 2 * BLOCKS * BLOCKS];
    for (pixel, light) in image.iter().enumerate() {
        let (row, column) = (pixel / SIZE / BLOCK, pixel % SIZE / BLOCK);
        means[row * BLOCKS + column] += light / (BLOCK * BLOCK) as f64;
    }
    means
}

/// How the means of two sets of runs differ, if they do: Welch's t with 11 degrees of freedom or more lies beyond 5.5 with
/// probability 2e-4 at most, in one of 72 blocks in 1 % of comparisons, and its root mean square is 1.1. Blocks with little light
/// are left out: where the lamp's horizon or a surface's passes through a pixel, history finds less light.
fn differ(a: &[Vec<f64>], b: &[Vec<f64>]) -> Option<String> {
    let [a, b] = [a, b].map(|runs| runs.iter().map(|run| blocks(run)).collect::<Vec<_>>());
    let both = |block: usize| [&a, &b].map(|runs| statistics(runs.iter().map(|run| run[block])));
    let count = a[0].len();
    let mut lights: Vec<f64> = (0..count).map(|block| both(block)[1][0]).collect();
    lights.sort_by(f64::total_cmp);
    let lit = (0..count)
        .map(both)
        .filter(|[_, b]| b[0] > 0.1 * lights[count / 2]);
    let t: Vec<f64> = lit
        .map(|[a, b]| (a[0] - b[0]).abs() / (a[1] + b[1]).sqrt())
        .collect();
    assert!(t.len() > count / 3, "{} blocks are lit", t.len());
    let worst = t.iter().copied().fold(0.0, f64::max);
    let rms = (t.iter().map(|t| t * t).sum::<f64>() / t.len() as f64).sqrt();
    (worst > 5.5 || rms > 1.6).then(|| format!("worst {worst}, rms {rms} standard errors"))
}

/// Sum of the pixels' variances.
fn noise(runs: &[Vec<f64>]) -> f64 {
    let of_pixel = |pixel: usize| statistics(runs.iter().map(|run| run[pixel]))[1];
    (0..runs[0].len()).map(of_pixel).sum()
}

fn brighter(runs: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let of_run = |run: &Vec<f64>| run.iter().map(|light| 1.05 * light).collect();
    runs.iter().map(of_run).collect()
}

#[test]
fn light_history_changes_the_noise_of_ten_thousand_lights_and_not_the_mean() {
    let scene = Generated {
        lights: 10_000,
        ..Generated::default()
    }
    .scene();
    let embedded = ShaderLibrary::embedded();
    // The present counts whole beside the past: a weight that is not normalised.
    let mut wrong = ShaderLibrary::embedded();
    let name = "shared/resampled_light";
    let (_, source) = wrong.sources().find(|(known, _)| *known == name).unwrap();
    let mended = source.replace(
        "max_component(now.light) / frames",
        "max_component(now.light)",
    );
    assert_ne!(mended, source);
    wrong.insert(name, mended);
    let by_power = replaced(
        &embedded,
        "shared/light_tree",
        "select(header.w, 0u, first == 0u)",
        "0u",
    );
    for (set, step_m) in [(1_u32, DVec3::ZERO), (2, DVec3::new(0.004, 0.003, -0.002))] {
        let by = |library, number, frames| {
            runs(
                library,
                &scene,
                [10 * set + number, frames],
                step_m,
                &|_, _| {},
            )
        };
        let without = by(&embedded, 0, 0);
        let with = by(&embedded, 1, 20);
        assert_eq!(differ(&with, &without), None, "step {step_m}");
        // Negative controls.
        assert!(differ(&brighter(&with), &without).is_some(), "5 % too much");
        assert!(
            differ(&by(&wrong, 2, 20), &without).is_some(),
            "wrong weight"
        );
        // Where lights are picked by power 0.70 is found: the shadow rays' noise stays, that of the choice of lights is averaged
        // over the frames. Picked for a point they have as little without history, which has nothing to add.
        let noises = [without, with, by(&by_power, 3, 0), by(&by_power, 4, 20)];
        let [near, near_with, far, far_with] = noises.map(|runs| noise(&runs));
        let what =
            format!("step {step_m}: {near}, {near_with} with history; by power {far}, {far_with}");
        assert!(far_with < 0.8 * far && near < 0.8 * far, "{what}");
        assert!(near_with < 1.1 * near, "{what}");
    }
}

/// The first instance that shines.
fn lamp_of(scene: &Scene) -> InstanceId {
    let shines = |mesh: usize| {
        let mut triangles = scene.meshes[mesh].triangles.iter();
        triangles.any(|t| scene.materials[t.material as usize].is_emissive())
    };
    let instances = scene.instances();
    let found = instances.iter().position(|placed| shines(placed.mesh));
    InstanceId(found.unwrap() as u32)
}

#[test]
fn lamps_that_move_or_go_out_leave_nothing_to_the_light_history() {
    let scene = Scene::builtin("cornell").unwrap();
    let library = ShaderLibrary::embedded();
    let lamp = lamp_of(&scene);
    let at = scene.instances()[lamp.0 as usize].world_from_object;
    // In the last frame the lamp is elsewhere.
    let aside = DAffine3::from_translation(DVec3::new(0.3, 0.0, 0.2)) * at;
    let moves = |renderer: &mut Renderer, left: u32| {
        renderer.set_instance_transform(lamp, if left == 0 { aside } else { at });
    };
    let stays = |renderer: &mut Renderer, _| {
        renderer.set_instance_transform(lamp, aside);
    };
    let moved = runs(&library, &scene, [1, 20], DVec3::ZERO, &moves);
    let there = runs(&library, &scene, [2, 0], DVec3::ZERO, &stays);
    let before = runs(&library, &scene, [3, 0], DVec3::ZERO, &|_, _| {});
    assert_eq!(differ(&moved, &there), None);
    assert!(differ(&before, &there).is_some(), "the lamp did not move");

    let mut renderer = renderer(&library, &scene, &settings(20));
    let views = views(&scene, DVec3::ZERO);
    let light = |renderer: &mut Renderer, frame| {
        renderer.render_frame(&views, frame, |_| {}).unwrap();
        direct_light(renderer).iter().sum::<f64>()
    };
    for frame in 0..4 {
        assert!(light(&mut renderer, frame) > 0.0);
    }
    assert!(renderer.remove_instance(lamp));
    assert_eq!(light(&mut renderer, 4), 0.0);
}

#[test]
fn a_mean_of_still_frames_takes_no_light_history() {
    let scene = Scene::builtin("cornell").unwrap();
    let library = ShaderLibrary::embedded();
    let views = views(&scene, DVec3::ZERO);
    // Pixels of a third frame at rest that light history changes by more than the rounding of a sample's place.
    let changed = |still: bool| {
        let of = |frames| {
            let mut settings = settings(frames);
            settings.reconstruct.still = still.into();
            let mut renderer = renderer(&library, &scene, &settings);
            for frame in 0..3 {
                renderer.render_frame(&views, frame, |_| {}).unwrap();
            }
            direct_light(&renderer)
        };
        let pairs = of(0).into_iter().zip(of(20));
        pairs.filter(|(a, b)| (a - b).abs() > 1e-3 * a).count()
    };
    // A shadow's edge may lie within rounding.
    let at_rest = changed(true);
    assert!(at_rest < 8, "{at_rest}");
    let always = changed(false);
    assert!(always > SIZE * SIZE, "{always}");
}

#[test]
fn only_sequences_of_single_samples_keep_lights() {
    assert!(settings(1).keeps_lights());
    let changed = |change: fn(&mut RenderSettings)| {
        let mut settings = settings(1);
        change(&mut settings);
        settings.keeps_lights()
    };
    assert!(!changed(|s| s.photon.light_history = 0));
    assert!(!changed(|s| s.spp = 2));
    assert!(!changed(|s| s.method = crate::settings::Method::Path));
    assert!(!changed(
        |s| s.photon.direct = crate::settings::DirectLight::Map
    ));
    assert!(!changed(|s| s.reconstruct.svgf = false.into()));
}
