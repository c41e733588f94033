//! Hard cases of number and distance: a million photons in one cell, eyes half a metre apart, a scene 1e6 m away.

use std::f64::consts::PI;

use glam::{DAffine3, DVec3};
use stereolux::renderer::{Eye, MapKind};
use stereolux::scene::{LightKind, Material, Scene};
use stereolux::settings::{DirectLight, Method, RenderSettings, Reuse};
use stereolux::xr::Pose;

use super::hard_support::*;
use crate::suite::support::{
    assert_clean, builtin, frame, mean, method, parallel_views, placed, radiance, renderer,
    settings, square_fov,
};

#[test]
fn a_million_photons_in_one_cell_are_all_gathered() {
    const PHOTONS: u32 = 1_000_000;
    const RADIUS_M: f64 = 10.0;
    const ALBEDO: f32 = 0.5;
    const INTENSITY: f32 = 100.0;
    let (inner, outer) = (0.1_f64, 0.2_f64);
    let mut scene = Scene::default();
    add(
        &mut scene,
        &square_ahead(0.5, 2.0),
        Material::lambert("wall", [ALBEDO; 3]),
    );
    // A metre before the wall: its whole cone lands within 0.2 m of the middle.
    add_point_light(&mut scene, DVec3::NEG_Z, INTENSITY);
    scene.lights[0].kind = LightKind::Spot {
        inner_cone_rad: inner as f32,
        outer_cone_rad: outer as f32,
    };
    let settings = settings(|s| {
        s.reuse = Reuse::Off;
        s.photon.count = PHOTONS;
        s.photon.max_depth = 2;
        s.photon.direct = DirectLight::Map;
        s.photon.radius_m = RADIUS_M;
        // Most of the disc is no wall.
        s.photon.edge_correction = false;
    });
    let mut renderer = renderer(&scene, &settings, [4, 4]);
    let result = frame(&mut renderer, &eyes_at_origin(8.0));
    let grid = renderer.read_photon_grid(MapKind::Photons).unwrap();
    let (grid, starts) = grid.unwrap();
    assert_eq!(grid.dims, [9, 3, 3], "one cell and its padding");
    assert_eq!(starts[40 + 1] - starts[40], PHOTONS);
    assert_eq!(result.photons.map.dropped, 0);
    // The flux of the falloff ((cos - cos outer) / (cos inner - cos outer))^2, over the disc: the constant kernel.
    let ramp = inner.cos() - outer.cos();
    let flux = f64::from(INTENSITY) * 2.0 * PI * (1.0 - inner.cos() + ramp / 3.0);
    let expected = f64::from(ALBEDO) / PI * flux / (PI * RADIUS_M * RADIUS_M);
    for eye in [Eye::Left, Eye::Right] {
        let image = radiance(&renderer, eye);
        assert_clean(&image, "a million photons");
        for pixel in &image {
            // One thread adds up to 60,000 equal terms: each sum rounds by 2^-24 of itself at worst, 0.36 % in all. A
            // slice of them that is lost (as loops of more than 65,535 turns are on lavapipe) would be 6 %.
            let off = relative(f64::from(pixel[0]), expected);
            assert!(off < 0.005, "{eye:?}: {} for {expected}", pixel[0]);
        }
    }
}

#[test]
fn eyes_half_a_metre_apart_see_the_plane_in_closed_form() {
    const N: u32 = 32;
    let scene = builtin("plane");
    let views = parallel_views(Pose::IDENTITY, 0.5, square_fov(45.0));
    // Disparity: N ipd / (2 m (tan 45 - tan -45)), four pixels exactly.
    let shift = 4;
    for kind in [Method::Photon, Method::Path] {
        // A carried sample lies within half a pixel's diagonal of the pixel's centre: 0.125 m / sqrt 2. Light falls off
        // by 3 r / (r^2 + h^2) <= 3 / 2h = 1 per metre: exp(0.0884) - 1.
        for (reuse, most) in [
            (Reuse::Off, CLOSED_FORM),
            (Reuse::Scatter, 0.0925),
            (Reuse::Lookup, 0.0925),
        ] {
            let mut renderer = renderer(&scene, &method(kind, reuse), [N, N]);
            let stereo = frame(&mut renderer, &views).stereo;
            for (view, eye) in views.iter().zip([Eye::Left, Eye::Right]) {
                let image = radiance(&renderer, eye);
                assert_clean(&image, "half a metre");
                let allowed = if eye == Eye::Left { CLOSED_FORM } else { most };
                let off = worst(&image, &plane_in_closed_form(view, N, 1.0));
                assert!(off < allowed, "{kind:?} {reuse:?} {eye:?}: {off}");
            }
            if reuse == Reuse::Scatter {
                assert_eq!(stereo.reused, (N - shift) * N, "{kind:?}");
            } else if reuse == Reuse::Lookup {
                // Interpolation may lose the column whose neighbours are outside.
                assert!(stereo.reused >= (N - shift - 1) * N, "{kind:?}: {stereo:?}");
            }
        }
    }
    // Negative control: the other eye's closed form is another image.
    let [left, right] = images(&scene, &method(Method::Path, Reuse::Off), [N, N], &views);
    assert!(worst(&left, &right) > 0.0925);
}

#[test]
fn images_a_thousand_kilometres_out_are_those_at_the_origin() {
    let scene = builtin("cornell");
    // f64 holds these to 2^-32 m, so geometry and views are the same but for that; an f32 would be off by 6 cm.
    let far = DVec3::new(1.0, -1.0, 1.0) * 1_048_576.0;
    for kind in [Method::Photon, Method::Path] {
        let settings = RenderSettings {
            spp: 2,
            ..method(kind, Reuse::Off)
        };
        let render = |offset: DVec3, aside: DVec3| {
            let scene = placed(scene.clone(), DAffine3::from_translation(offset));
            let mut pose = scene.start_pose();
            pose.position += aside;
            let views = parallel_views(pose, 0.063, square_fov(19.0));
            images(&scene, &settings, [24, 24], &views)
        };
        let near = render(DVec3::ZERO, DVec3::ZERO);
        let found = render(far, DVec3::ZERO);
        for eye in 0..2 {
            // The same random numbers make the same paths; one that passes within 1e-9 of an edge may change sides.
            let count = off_by(&found[eye], &near[eye], 1e-3);
            assert!(count <= 4, "{kind:?} eye {eye}: {count} pixels differ");
            assert!(relative(mean(&found[eye]), mean(&near[eye])) < 1e-3);
        }
        // Negative control: a head that stands 6 cm aside, as f32 coordinates would have it.
        let aside = render(far, DVec3::X * 0.06);
        assert!(off_by(&aside[0], &near[0], 1e-3) > 100, "{kind:?}");
    }
}
