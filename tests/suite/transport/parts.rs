//! `output.parts`: radiance split into direct and indirect light, and the albedo.

use glam::DVec3;
use stereolux::images::read_image;
use stereolux::renderer::{Eye, RadianceParts, Renderer};
use stereolux::scene::{Material, Scene};
use stereolux::settings::{DirectLight, Method, RenderSettings, Reuse};
use stereolux::xr::View;

use super::hard_support::{add, add_point_light, constant_environment, eyes_at_origin, quad};
use crate::suite::embedded_scenes::cornell;
use crate::suite::support::{
    Folder, assert_success, bits, builtin, mean, parallel_views, radiance, run_into, settings,
    square_fov, start_views,
};

const SIZE: [u32; 2] = [32, 32];
const EYES: [Eye; 2] = [Eye::Left, Eye::Right];

fn rendered(scene: &Scene, settings: &RenderSettings, views: &[View; 2]) -> Renderer {
    super::support::rendered(scene, settings, SIZE, views)
}

fn with(method: Method, reuse: Reuse, depth: u32, parts: bool) -> RenderSettings {
    settings(|s| {
        s.method = method;
        s.reuse = reuse;
        s.spp = 3;
        s.path.max_depth = depth;
        s.photon.max_depth = depth;
        s.output.parts = parts;
    })
}

fn parts(renderer: &Renderer, eye: Eye) -> RadianceParts {
    renderer.read_parts(eye).unwrap().unwrap()
}

/// Greatest |direct + indirect - radiance| over radiance + direct, of all pixels and channels.
fn worst_sum(parts: &RadianceParts, radiance: &[[f32; 3]]) -> f64 {
    let mut worst: f64 = 0.0;
    for (pixel, all) in radiance.iter().enumerate() {
        for channel in 0..3 {
            let [direct, indirect] =
                [&parts.direct, &parts.indirect].map(|part| f64::from(part[pixel][channel]));
            let all = f64::from(all[channel]);
            assert!(direct >= 0.0 && indirect >= 0.0);
            if all + direct > 0.0 {
                worst = worst.max((direct + indirect - all).abs() / (all + direct));
            }
        }
    }
    worst
}

/// A sample's light is rounded about once per segment, by 2^-24 of the sum so far, samples likewise: 12 + 3 roundings.
const ROUNDING: f64 = 16.0 / (1u64 << 24) as f64;

#[test]
fn direct_and_indirect_add_up_and_direct_is_light_of_two_segments() {
    let scene = builtin("cornell");
    let views = start_views(&scene, 21.0);
    for method in [Method::Path, Method::Photon] {
        for reuse in [Reuse::Off, Reuse::Scatter, Reuse::Lookup] {
            let what = format!("{method:?} {reuse:?}");
            let whole = rendered(&scene, &with(method, reuse, 12, true), &views);
            let plain = rendered(&scene, &with(method, reuse, 12, false), &views);
            // Emission and light scattered once: no mirrors here, so just these two segments.
            let direct = rendered(&scene, &with(method, reuse, 2, false), &views);
            for eye in EYES {
                let split = parts(&whole, eye);
                let all = radiance(&whole, eye);
                let what = format!("{what} {eye:?}");
                let worst = worst_sum(&split, &all);
                assert!(worst <= ROUNDING, "{what}: {worst:e}");
                // Asking for parts does not change the image, and direct light is that of two segments; but these are other
                // kernels, which a card's driver may round otherwise, and now and then a path ends by it.
                let strays = usize::from(!whole.context().adapter.is_software()) * all.len() / 100;
                for (with, other) in [(&all, &plain), (&split.direct, &direct)] {
                    let without = radiance(other, eye);
                    let pixels = with.as_flattened().iter().zip(without.as_flattened());
                    let off =
                        pixels.filter(|(a, b)| (**a - **b).abs() > ROUNDING as f32 * (**a + **b));
                    let is_same = strays == 0 && bits(with) == bits(&without);
                    assert!(is_same || off.count() < strays, "{what}");
                }
                // Neither part is all there is: in this room some two fifths of the light are indirect.
                let share = mean(&split.indirect) / mean(&all);
                assert!(share > 0.1 && share < 0.9, "{what}: {share}");
                assert!(plain.read_parts(eye).unwrap().is_none());
            }
            // Negative control: with another depth direct light is not the image, and parts of another image do not
            // add up to this one.
            let left = parts(&whole, Eye::Left);
            assert!(bits(&left.direct) != bits(&radiance(&whole, Eye::Left)));
            assert!(worst_sum(&left, &radiance(&direct, Eye::Left)) > ROUNDING);
        }
    }
}

#[test]
fn albedo_is_the_first_surfaces() {
    let scene = builtin("cornell");
    let views = start_views(&scene, 25.0);
    for method in [Method::Path, Method::Photon] {
        for reuse in [Reuse::Off, Reuse::Scatter, Reuse::Lookup] {
            let renderer = rendered(&scene, &with(method, reuse, 2, true), &views);
            for eye in EYES {
                let albedo = parts(&renderer, eye).albedo;
                let at = |x: usize, y: usize| albedo[y * SIZE[0] as usize + x];
                // Half way up, just within the room's sides; the floor beside the blocks; beside the box nothing.
                for (found, expected, name) in [
                    (at(6, 12), cornell::RED, "red wall"),
                    (at(25, 12), cornell::GREEN, "green wall"),
                    (at(10, 26), cornell::WHITE, "floor"),
                    (at(0, 16), [1.0; 3], "nothing"),
                ] {
                    for channel in 0..3 {
                        let off = (found[channel] / expected[channel] - 1.0).abs();
                        assert!(off < 1e-6, "{method:?} {reuse:?} {eye:?} {name}: {found:?}");
                    }
                }
            }
        }
    }
}

/// A mirror half a metre ahead on the left, a wall behind it on the right, and a lamp behind the eyes.
pub fn hall_of_mirrors(roughness: f32) -> Scene {
    let mut scene = Scene::default();
    let mirror = Material {
        base_color: [0.5, 0.6, 0.7, 1.0],
        metallic: 1.0,
        roughness,
        ..Material::default()
    };
    let square = |left| quad(DVec3::new(left, -1.0, -1.0), DVec3::X * 2.0, DVec3::Y * 2.0);
    add(&mut scene, &square(-2.0), mirror);
    let wall = Material::lambert("wall", [0.8; 3]);
    add(&mut scene, &square(0.0), wall.clone());
    let behind = quad(DVec3::new(-3.0, -3.0, 3.0), DVec3::Y * 6.0, DVec3::X * 6.0);
    add(&mut scene, &behind, wall);
    add_point_light(&mut scene, DVec3::new(0.0, 0.5, 1.0), 5.0);
    scene
}

#[test]
fn mirrors_before_the_first_surface_do_not_count() {
    let views = eyes_at_origin(30.0);
    for method in [Method::Path, Method::Photon] {
        let split = |scene: &Scene, depth| {
            let renderer = rendered(scene, &with(method, Reuse::Off, depth, true), &views);
            let all = radiance(&renderer, Eye::Left);
            let parts = parts(&renderer, Eye::Left);
            assert!(worst_sum(&parts, &all) <= ROUNDING);
            (parts, all)
        };
        // Eye, mirror, wall, lamp: direct. The wall's own light from the wall behind is three segments as well.
        let (parts, all) = split(&hall_of_mirrors(0.0), 3);
        let width = SIZE[0] as usize;
        for (pixel, whole) in all.iter().enumerate() {
            if pixel % width < width / 2 - 1 {
                assert!(whole[0] > 0.0, "{method:?}: the mirror shows nothing");
                assert_eq!(parts.indirect[pixel], [0.0; 3], "{method:?}: {pixel}");
                // A mirror's albedo is its Fresnel reflectance, F0 up to 40 degrees and 2 % more.
                let albedo = parts.albedo[pixel][0];
                assert!((albedo / 0.5 - 1.0).abs() < 0.02, "{albedo}");
            }
        }
        let indirect = |parts: &RadianceParts, left: bool| -> f64 {
            let chosen = parts.indirect.iter().enumerate().filter(|(pixel, _)| {
                let x = pixel % width;
                (left && x < width / 2 - 1) || (!left && x > width / 2)
            });
            chosen.map(|(_, c)| f64::from(c[0])).sum()
        };
        // Walls light each other.
        assert!(indirect(&parts, false) > 0.0, "{method:?}");
        // One segment more, and the mirror shows light from wall to wall too. Negative control: a rough metal is a surface of
        // its own, and what it shows of the wall is indirect, also where photons' paths follow it.
        for (roughness, depth) in [(0.0, 5), (0.6, 3), (0.2, 3)] {
            let shown = indirect(&split(&hall_of_mirrors(roughness), depth).0, true);
            assert!(shown > 0.0, "{method:?}, roughness {roughness}");
        }
    }
}

#[test]
fn with_direct_light_from_the_map_direct_is_emission_alone() {
    let scene = builtin("cornell");
    let views = start_views(&scene, 21.0);
    let mut from_map = with(Method::Photon, Reuse::Off, 12, true);
    from_map.photon.direct = DirectLight::Map;
    let emission = with(Method::Path, Reuse::Off, 1, false);
    let found = parts(&rendered(&scene, &from_map, &views), Eye::Left).direct;
    assert!(bits(&found) == bits(&radiance(&rendered(&scene, &emission, &views), Eye::Left)));
    assert!(mean(&found) > 0.0);
}

#[test]
fn parts_are_written_where_they_are_asked_for() {
    let folder = Folder::new("parts");
    let run = |name: &str, parts: &str| {
        let out = folder.join(name);
        let command = "render --size 16x16 --photons 500";
        let set = format!("--set=output.parts={parts}");
        assert_success(&run_into(&out, command, &[&set]));
        out
    };
    let (with, without) = (run("with", "true"), run("without", "false"));
    for eye in ["left", "right"] {
        let read =
            |part: &str| read_image(&with.join(format!("frame_0000_{eye}{part}.exr"))).unwrap();
        let split = RadianceParts {
            direct: read("_direct").pixels,
            indirect: read("_indirect").pixels,
            albedo: read("_albedo").pixels,
        };
        assert!(worst_sum(&split, &read("").pixels) <= ROUNDING);
        assert!(mean(&split.albedo) > 0.1);
        for part in ["direct", "indirect", "albedo"] {
            let part = without.join(format!("frame_0000_{eye}_{part}.exr"));
            assert!(!part.exists());
        }
    }
}

#[test]
fn equal_eyes_have_equal_parts() {
    let scene = builtin("cornell");
    let views = parallel_views(scene.start_pose(), 0.0, square_fov(25.0));
    for reuse in [Reuse::Scatter, Reuse::Lookup] {
        let renderer = rendered(&scene, &with(Method::Photon, reuse, 12, true), &views);
        let [left, right] = EYES.map(|eye| parts(&renderer, eye));
        assert!(bits(&left.direct) == bits(&right.direct), "{reuse:?}");
        assert!(bits(&left.indirect) == bits(&right.indirect), "{reuse:?}");
        // Two shaders evaluate the reflectance with the lookup: a rounding or two each.
        for (pixel, (left, right)) in left.albedo.iter().zip(&right.albedo).enumerate() {
            for channel in 0..3 {
                let off = (left[channel] - right[channel]).abs();
                assert!(off <= 4.0 * f32::EPSILON, "{reuse:?} pixel {pixel}: {off}");
            }
        }
    }
}

#[test]
fn the_light_of_a_sky_seen_or_scattered_once_is_direct_to_the_last_bit() {
    const SKY: [f32; 3] = [2.0, 1.0, 0.5];
    let views = eyes_at_origin(30.0);
    let width = SIZE[0] as usize;
    let metal = Material {
        roughness: 0.5,
        ..Material::default()
    };
    for (name, material) in [
        ("Lambert", Material::lambert("wall", [0.5; 3])),
        ("metal", metal),
    ] {
        // A wall on the left, the sky on the right.
        let mut scene = Scene::default();
        let wall = quad(DVec3::new(-2.0, -1.0, -1.0), DVec3::X * 2.0, DVec3::Y * 2.0);
        add(&mut scene, &wall, material.clone());
        scene.environment = Some(constant_environment(SKY));
        // Negative control: another wall lights the first one.
        let mut corner = scene.clone();
        let side = quad(DVec3::new(-1.0, -1.0, -1.0), DVec3::Y * 2.0, DVec3::Z * 2.0);
        add(&mut corner, &side, Material::lambert("side", [0.5; 3]));
        for method in [Method::Path, Method::Photon] {
            for reuse in [Reuse::Off, Reuse::Scatter, Reuse::Lookup] {
                let what = format!("{name} {method:?} {reuse:?}");
                let renderer = rendered(&scene, &with(method, reuse, 2, true), &views);
                for eye in EYES {
                    let (split, all) = (parts(&renderer, eye), radiance(&renderer, eye));
                    assert!(bits(&split.direct) == bits(&all), "{what} {eye:?}");
                    assert_eq!(split.indirect, vec![[0.0; 3]; all.len()], "{what} {eye:?}");
                    let row = &all[all.len() / 2..][..width];
                    assert!(row[2] != SKY && row[2][0] > 0.1, "{what}: no wall");
                    assert_eq!(row[width - 3], SKY, "{what}: no sky");
                }
                let renderer = rendered(&corner, &with(method, reuse, 3, true), &views);
                for eye in EYES {
                    let shown = mean(&parts(&renderer, eye).indirect);
                    assert!(shown > 0.0, "{what} {eye:?}: no light between walls");
                }
            }
        }
    }
}
