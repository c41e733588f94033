//! The map of caustics: only where a scene can form them, no light lost or counted twice, and the same spot under a
//! glass ball as the path tracer's.

use std::ops::Range;

use glam::DVec3;
use stereolux::renderer::{Eye, PhotonMap, Renderer};
use stereolux::scene::Scene;
use stereolux::settings::{DirectLight, Force, Method, RenderSettings, Reuse};
use stereolux::xr::View;

use super::support::{
    builtin, frame, images_of, parallel_views, radiance, rendered, renderer, settings, square_fov,
    statistics,
};
use crate::suite::embedded_scenes::caustic;

fn photon_settings(change: impl FnOnce(&mut RenderSettings)) -> RenderSettings {
    settings(|s| {
        s.method = Method::Photon;
        s.reuse = Reuse::Off;
        change(s);
    })
}

fn views(scene: &Scene, half_degrees: f64) -> [View; 2] {
    parallel_views(scene.start_pose(), 0.0, square_fov(half_degrees))
}

#[test]
fn a_lambert_scene_has_no_caustic_pass_and_forcing_one_changes_nothing() {
    let scene = builtin("cornell");
    let views = views(&scene, 19.0);
    let caustic_names = |renderer: &Renderer| -> Vec<String> {
        let mut names = renderer.pass_names();
        names.retain(|name| name.contains("caustic"));
        names
    };
    let mut plain = renderer(&scene, &photon_settings(|_| {}), [32, 32]);
    let result = frame(&mut plain, &views);
    assert!(!plain.features().caustics);
    assert_eq!(caustic_names(&plain), Vec::<String>::new());
    assert!(plain.caustic_map().is_none() && result.photons.caustics.is_none());

    let forced = photon_settings(|s| s.force.caustics = Force::On);
    let mut forced = renderer(&scene, &forced, [32, 32]);
    let result = frame(&mut forced, &views);
    assert_eq!(caustic_names(&forced), ["caustic_gather", "caustic_trace"]);
    let caustics = result.photons.caustics.unwrap();
    // Lambert walls focus nothing.
    assert_eq!((caustics.emitted, caustics.stored), (4096, 0));
    // The same operations in another program: a compiler may fuse multiplications and additions otherwise, which moves
    // each of a pixel's terms (at most some 200 photons and one light sample) by half a unit of 2^-24 or so, and the
    // sum by as much per term at worst: 200 x 2^-23 = 2.4e-5.
    let (plain, forced) = (radiance(&plain, Eye::Left), radiance(&forced, Eye::Left));
    for (a, b) in plain.iter().flatten().zip(forced.iter().flatten()) {
        assert!((a - b).abs() <= 2.4e-5 * a.abs(), "{a} became {b}");
    }
    // Negative control: where there are caustics, taking their map away is seen.
    let scene = builtin("caustic");
    let views = self::views(&scene, 15.0);
    let image = |force| {
        let settings = photon_settings(|s| s.force.caustics = force);
        radiance(&rendered(&scene, &settings, [32, 32], &views), Eye::Left)
    };
    let (with, without) = (image(Force::Auto), image(Force::Off));
    let pairs = with.iter().flatten().zip(without.iter().flatten());
    let differ = pairs.filter(|(a, b)| (*a - *b).abs() > 2.4e-5 * a.abs());
    assert!(differ.count() > 20);
}

#[test]
fn scenes_with_glass_or_polished_metal_list_the_passes() {
    for (name, expected) in [
        ("cornell", false),
        ("sphere", false),
        ("caustic", true),
        ("gallery", true),
    ] {
        let settings = photon_settings(|s| s.photon.count = 64);
        let renderer = renderer(&builtin(name), &settings, [8, 8]);
        let listed = renderer.pass_names().contains(&"caustic_gather".to_owned());
        assert_eq!(listed, expected, "{name}");
    }
}

fn flux_per_path(map: Option<&PhotonMap>, renderer: &Renderer) -> DVec3 {
    let Some(map) = map else { return DVec3::ZERO };
    let photons = renderer.read_photons(map.kind()).unwrap().unwrap();
    let flux = photons.iter().map(|photon| photon.flux.map(f64::from));
    let sum: DVec3 = flux.map(DVec3::from_array).sum();
    sum / f64::from(map.counters().paths_kept)
}

#[test]
fn the_two_maps_share_out_the_light_of_one() {
    // Coated clay, bronze, a mirror, glass: every kind of lobe.
    let scene = builtin("gallery");
    let views = views(&scene, 40.0);
    // Frames that trace photons anew are independent runs: their random streams are keyed by the frame.
    let flux = |force: Force, direct: DirectLight, frames: Range<u32>| -> Vec<(f64, f64)> {
        let settings = photon_settings(|s| {
            s.photon.count = 20_000;
            s.photon.max_depth = 6;
            s.photon.direct = direct;
            s.photon.every_frame = true;
            s.force.caustics = force;
            // Flux as it was traced.
            s.photon.edge_correction = false;
        });
        let mut renderer = renderer(&scene, &settings, [8, 8]);
        frames
            .map(|frame_index| {
                renderer.render_frame(&views, frame_index, |_| {}).unwrap();
                let [photons, caustics] = [renderer.photon_map(), renderer.caustic_map()]
                    .map(|map| flux_per_path(map, &renderer).element_sum());
                (photons, caustics)
            })
            .collect()
    };
    for direct in [DirectLight::Nee, DirectLight::Map] {
        let (one, _): (Vec<f64>, Vec<f64>) = flux(Force::Off, direct, 0..10).into_iter().unzip();
        let two = flux(Force::On, direct, 10..20).into_iter();
        let (photons, caustics): (Vec<f64>, Vec<f64>) = two.unzip();
        let both: Vec<f64> = photons.iter().zip(caustics).map(|(p, c)| p + c).collect();
        let (expected, expected_error) = statistics(&one);
        let z = |values: &[f64]| {
            let (mean, error) = statistics(values);
            (mean - expected) / (error + expected_error).sqrt()
        };
        // Student's t with 18 degrees of freedom lies beyond 5 with probability 1e-4.
        let (z_both, z_photons) = (z(&both), z(&photons));
        assert!(z_both.abs() < 5.0, "{direct:?}: {z_both} standard errors");
        // Negative control: without the caustics the sum falls short.
        assert!(z_photons < -5.0, "{direct:?}: {z_photons} standard errors");
    }
}

/// Floor point that a pixel position sees, unless the ball is near the ray.
fn floor_point(view: &View, at: [f64; 2], size: u32) -> Option<DVec3> {
    let t = view.fov.tangents();
    let tx = t.left + (t.right - t.left) * at[0] / f64::from(size);
    let ty = t.up + (t.down - t.up) * at[1] / f64::from(size);
    let direction = (view.orientation * DVec3::new(tx, ty, -1.0)).normalize();
    let eye = view.position_in_world;
    let to_ball = DVec3::Y * caustic::RADIUS_M * caustic::FLOOR_TO_CENTRE - eye;
    let closest = to_ball - direction * to_ball.dot(direction);
    (direction.y < 0.0 && closest.length() > 1.1 * caustic::RADIUS_M)
        .then(|| eye - direction * (eye.y / direction.y))
}

/// What the pixels within `SPOT_M` of the ball's foot see: radiance integrated over the floor, and its variance along x.
fn spot(image: &[[f32; 3]], view: &View, size: u32) -> (f64, f64) {
    const SPOT_M: f64 = 0.12;
    let (mut energy, mut second) = (0.0, 0.0);
    for y in 0..size {
        for x in 0..size {
            let corners = [[0, 0], [1, 0], [1, 1], [0, 1]];
            let corners = corners
                .map(|[dx, dy]| floor_point(view, [f64::from(x + dx), f64::from(y + dy)], size));
            let [Some(a), Some(b), Some(c), Some(d)] = corners else {
                continue;
            };
            let centre = 0.25 * (a + b + c + d);
            if centre.length() > SPOT_M {
                continue;
            }
            let area = 0.5 * (c - a).cross(d - b).length();
            let light = f64::from(image[(y * size + x) as usize][0]) * area;
            energy += light;
            second += light * centre.x * centre.x;
        }
    }
    (energy, second / energy)
}

#[test]
fn the_spot_under_a_glass_ball_is_the_path_tracers() {
    const SIZE: u32 = 48;
    const RADIUS_M: f64 = 0.01;
    let scene = builtin("caustic");
    let views = views(&scene, 13.0);
    let measured = |runs: u32, change: &dyn Fn(&mut RenderSettings)| -> Vec<(f64, f64)> {
        let settings = photon_settings(|s| {
            s.photon.every_frame = true;
            change(s);
        });
        let mut renderer = renderer(&scene, &settings, [SIZE, SIZE]);
        let images = images_of(&mut renderer, &views, 0..runs);
        let spot = |image: &Vec<[f32; 3]>| spot(image, &views[0], SIZE);
        images.iter().map(spot).collect()
    };
    let path = measured(8, &|s| {
        s.method = Method::Path;
        s.spp = 96;
        s.path.max_depth = 8;
    });
    let photons = |runs, radius_m: f64| {
        measured(runs, &|s| {
            s.photon.count = 131_072;
            s.photon.max_depth = 8;
            s.photon.caustic_radius_m = radius_m;
            s.spp = 2;
        })
    };
    let moments = |runs: &[(f64, f64)]| {
        let of =
            |pick: fn(&(f64, f64)) -> f64| statistics(&runs.iter().map(pick).collect::<Vec<_>>());
        (of(|run| run.0), of(|run| run.1))
    };
    let ((energy, energy_error), (width, width_error)) = moments(&path);
    let ((found, found_error), (found_width, found_width_error)) = moments(&photons(8, RADIUS_M));
    let sigma = (energy_error + found_error).sqrt();
    let off = (found - energy).abs();
    assert!(off < 4.0 * sigma, "{found} W for {energy} +- {sigma}");
    let sigma = (width_error + found_width_error).sqrt();
    let blur = RADIUS_M * RADIUS_M / 4.0;
    // A disc of radius r spreads its light with a variance of r^2 / 4 along each axis.
    let agrees = |excess: f64| excess > -4.0 * sigma && excess < blur + 4.0 * sigma;
    let what = format!("{found_width} m^2 for {width} + {blur} +- {sigma}");
    assert!(agrees(found_width - width), "{what}");
    // Negative control: a spot blurred by 8 cm has the energy but not the shape.
    let (_, (wide, _)) = moments(&photons(2, 0.08));
    assert!(!agrees(wide - width), "{wide} m^2 for {width}");
}
