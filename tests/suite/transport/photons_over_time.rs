//! Photons that stay, and shares of them that are traced anew once something moves.

use std::collections::BTreeSet;

use glam::{DAffine3, DVec3};
use stereolux::renderer::{Eye, FrameResult, InstanceId, MapKind, Renderer};
use stereolux::scene::Scene;
use stereolux::settings::{Method, RenderSettings, Reuse};
use stereolux::xr::{Pose, View};

use super::support::{
    builtin, mean, method, parallel_views, radiance, renderer, square_fov, statistics,
};

const SHARES: u32 = 4;
const PATHS: u32 = 4096;

fn settings(change: impl FnOnce(&mut RenderSettings)) -> RenderSettings {
    let mut settings = method(Method::Photon, Reuse::Off);
    settings.photon.count = PATHS;
    settings.photon.shares = SHARES;
    // All light is the map's.
    settings.photon.direct = stereolux::settings::DirectLight::Map;
    change(&mut settings);
    settings
}

fn views_from(offset: DVec3) -> [View; 2] {
    let start = builtin("cornell").start_pose();
    let head = Pose::new(start.position + offset, start.orientation);
    parallel_views(head, 0.063, square_fov(21.0))
}

fn step(renderer: &mut Renderer, views: &[View; 2], frame: u32) -> FrameResult {
    renderer.render_frame(views, frame, |_| {}).unwrap()
}

/// The photons' bits, whatever their order.
fn photons(renderer: &Renderer) -> BTreeSet<Vec<u8>> {
    let photons = renderer.read_photons(MapKind::Photons).unwrap().unwrap();
    let bytes = photons.iter().map(bytemuck::bytes_of);
    bytes.map(<[u8]>::to_vec).collect()
}

/// A block of the Cornell box, a little to the side.
fn nudge(renderer: &mut Renderer, by_m: f64) {
    let aside = DAffine3::from_translation(DVec3::X * by_m);
    assert!(renderer.set_instance_transform(InstanceId(6), aside));
}

/// As by an instance that is moved; what changes otherwise may change how all photons fly.
#[test]
fn an_edit_that_only_places_nodes_has_shares_traced_and_another_one_all() {
    let mut scene = builtin("cornell");
    let mut renderer = renderer(&scene, &settings(|_| {}), [16, 16]);
    let views = views_from(DVec3::ZERO);
    let mut retraced = |scene: &Scene, frame| {
        renderer.apply_scene(scene).unwrap();
        step(&mut renderer, &views, frame).photons.retraced
    };
    assert_eq!(retraced(&scene, 0), PATHS);
    let block = scene
        .nodes
        .iter()
        .position(|node| node.name == "short block");
    let block = &mut scene.nodes[block.unwrap()];
    block.parent_from_node.translation.x += 0.05;
    block.parts = None;
    assert_eq!(retraced(&scene, 1), PATHS / SHARES);
    scene.materials[0].base_color[1] *= 0.5;
    assert_eq!(retraced(&scene, 2), PATHS);
    let light = scene.nodes.iter().position(|node| node.name == "lamp");
    scene.nodes[light.unwrap()].parent_from_node.matrix3 *= 0.5;
    assert_eq!(retraced(&scene, 3), PATHS);
}

#[test]
fn a_share_per_frame_is_traced_until_all_have_seen_the_scene_as_it_stands() {
    let scene = builtin("cornell");
    let mut renderer = renderer(&scene, &settings(|_| {}), [16, 16]);
    let views = views_from(DVec3::ZERO);
    let first = step(&mut renderer, &views, 0).photons;
    assert_eq!((first.retraced, first.outdated_shares), (PATHS, 0));
    let still = step(&mut renderer, &views, 1).photons;
    assert_eq!((still.retraced, still.traced), (0, false));
    let mut before = photons(&renderer);
    let first_map = before.clone();
    nudge(&mut renderer, 0.05);
    for turn in 0..SHARES {
        let stats = step(&mut renderer, &views, 2 + turn).photons;
        assert_eq!(stats.retraced, PATHS / SHARES, "turn {turn}");
        assert_eq!(stats.outdated_shares, SHARES - 1 - turn, "turn {turn}");
        assert_eq!(stats.map.emitted, PATHS);
        // The other shares' photons are the same, bit for bit; of the one, none: its random numbers are new.
        let now = photons(&renderer);
        let same = now.intersection(&before).count() as f64 / before.len() as f64;
        // A share's photons are a quarter of all, give or take 4 standard deviations of a binomial count with the
        // variance that about two photons per path add.
        let spread = 4.0 * (0.75 * 0.25 * 3.0 / f64::from(PATHS)).sqrt();
        assert!((same - 0.75).abs() < spread, "turn {turn}: {same} stayed");
        let old = now.intersection(&first_map).count() as f64 / first_map.len() as f64;
        let expected = 1.0 - f64::from(turn + 1) / f64::from(SHARES);
        let off = (old - expected).abs();
        assert!(off < spread, "turn {turn}: {old} of the first map");
        before = now;
    }
    let done = step(&mut renderer, &views, 2 + SHARES).photons;
    let done = (done.retraced, done.traced, done.outdated_shares);
    assert_eq!(done, (0, false, 0));
}

#[test]
fn shares_and_whole_maps_give_the_same_light_wherever_the_head_goes() {
    // The block moves and comes back; the head walks on meanwhile, so that shares are traced from four places.
    let scene = builtin("cornell");
    let light = |shares: u32, frames: u32| {
        let mut renderer = renderer(&scene, &settings(|s| s.photon.shares = shares), [16, 16]);
        let mut means = Vec::new();
        for frame in 0..frames {
            nudge(&mut renderer, if frame % 2 == 0 { 0.01 } else { 0.0101 });
            let away = DVec3::new(0.02, 0.01, 0.03) * f64::from(frame % 8);
            step(&mut renderer, &views_from(away), frame);
            if frame >= 8 {
                // Without the lamp, whose pixels shine at 10 and more: what comes from the map is below 2.
                let seen = radiance(&renderer, Eye::Left);
                let lit: Vec<[f32; 3]> = seen.into_iter().filter(|p| p[0] < 2.0).collect();
                means.push(mean(&lit));
            }
        }
        means
    };
    // Whole maps are independent from frame to frame; frames of shares have three quarters in common, so that of the
    // differences between the two only every fourth counts.
    let (whole, shared) = (light(1, 40), light(SHARES, 40));
    let z = |factor: f64| {
        let pairs = whole.iter().zip(&shared);
        let differences: Vec<f64> = pairs.map(|(a, b)| a - factor * b).collect();
        let (mean, squared_error) = statistics(&differences);
        mean / (f64::from(SHARES) * squared_error).sqrt()
    };
    assert!(z(1.0).abs() < 4.0, "z {}", z(1.0));
    // Negative control: a share that is counted twice, or lost, changes the light by a quarter.
    assert!(z(1.25).abs() > 4.0, "z {}", z(1.25));
}

#[test]
fn at_rest_photons_are_traced_anew_until_something_moves() {
    const RESTING_PATHS: u32 = 1024;
    let scene = builtin("cornell");
    let made = |refines: bool| {
        let mut settings = settings(|s| s.photon.shares = 1);
        settings.photon.refine_at_rest = refines;
        // Two frames' pixels.
        settings.photon.count = RESTING_PATHS;
        settings.reconstruct.still = true.into();
        settings.reconstruct.still_from = 0;
        settings.reconstruct.still_until = 1;
        renderer(&scene, &settings, [16, 16])
    };
    let [here, there] = [0.0, 0.01].map(|x| views_from(DVec3::X * x));
    let (mut refined, mut kept) = (made(true), made(false));
    for frame in 0..5 {
        let due = [frame % 2 == 0, frame == 0].map(|is_due| u32::from(is_due) * RESTING_PATHS);
        let traced = [&mut refined, &mut kept].map(|r| step(r, &here, frame).photons.retraced);
        assert_eq!(traced, due, "frame {frame}");
    }
    // A head that moves has a map of the whole radius, which stays: bit for bit what begins with that frame.
    let mut anew = made(true);
    let elsewhere = views_from(DVec3::X * 0.02);
    let steps = [
        (5, &there, RESTING_PATHS),
        (6, &elsewhere, 0),
        (7, &there, 0),
    ];
    for (frame, views, paths) in steps {
        let traced = [&mut refined, &mut anew].map(|r| step(r, views, frame).photons.retraced);
        assert_eq!(traced, [paths; 2], "frame {frame}");
        let shown = [&refined, &anew].map(|r| radiance(r, Eye::Left));
        assert!(shown[0] == shown[1], "frame {frame}");
    }
    // So does a scene that moves, and rests again.
    nudge(&mut refined, 0.05);
    for frame in 8..11 {
        let due = if frame % 2 == 0 { RESTING_PATHS } else { 0 };
        assert_eq!(step(&mut refined, &there, frame).photons.retraced, due);
    }
}
