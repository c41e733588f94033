//! `photon.half_rate`: every other pixel gathers, the others interpolate.

use glam::{DQuat, DVec3};
use stereolux::gpu::ShaderLibrary;
use stereolux::renderer::Eye;
use stereolux::scene::{Material, Mesh, Node};
use stereolux::settings::{DirectLight, Eyes, Method, RenderSettings, Reuse, Schedule};
use stereolux::xr::{Pose, View};

use super::cornell::rel_mse;
use super::hard_support::{eyes_at, eyes_at_origin, images};
use super::parts::hall_of_mirrors;
use super::support::{
    assert_says, bits, builtin, mean, parallel_views, pixel_ray, play, radiance, renderer_by,
    settings, square_fov, start_views,
};
use crate::suite::frame::layout::changed;
use crate::suite::frame::reconstruction::{IPD_M, glossy_board};
use crate::suite::transport::gathers::{Change, KD, KD_NEAREST, NEAREST};

/// Odd, so that the last column and row gather, and even, so that they do not.
const SIZES: [[u32; 2]; 2] = [[33, 25], [32, 24]];

/// The same settings without and with half rate.
fn both_rates(change: impl Fn(&mut RenderSettings)) -> [RenderSettings; 2] {
    [false, true].map(|half_rate| {
        settings(|s| {
            s.reuse = Reuse::Off;
            s.photon.half_rate = half_rate.into();
            change(s);
        })
    })
}

/// Pixels that gather at half rate and lie at most one away, all of one weight.
fn gathered_around([x, y]: [usize; 2], [width, height]: [usize; 2]) -> Vec<usize> {
    let near = |a: usize, end: usize| {
        let first = a - a % 2;
        let last = first + 2 * (a % 2);
        [Some(first), (last != first && last < end).then_some(last)]
    };
    let rows = near(y, height).into_iter().flatten();
    rows.flat_map(|row| {
        let columns = near(x, width).into_iter().flatten();
        columns.map(move |column| row * width + column)
    })
    .collect()
}

#[test]
fn light_between_gathered_pixels_is_bilinear() {
    // One plane of one colour whose light is all gathered: every pixel finds all samples that lie within the image.
    let scene = builtin("plane");
    let views = eyes_at_origin(40.0);
    let [full, half] = both_rates(|s| s.photon.direct = DirectLight::Map);
    for size in SIZES {
        let full = images(&scene, &full, size, &views);
        let half = images(&scene, &half, size, &views);
        let [width, height] = size.map(|n| n as usize);
        let mut as_full = 0;
        for (full, half) in full.iter().zip(&half) {
            for (pixel, found) in half.iter().enumerate() {
                let (x, y) = (pixel % width, pixel / width);
                if x % 2 == 0 && y % 2 == 0 {
                    assert_eq!(found, &full[pixel], "({x}, {y}) of {size:?} gathers");
                    continue;
                }
                // f64 twin: the mean of the gathered pixels at most one away, all of one weight.
                let around = gathered_around([x, y], [width, height]);
                let sum = |channel: usize| -> f64 {
                    around.iter().map(|&at| f64::from(full[at][channel])).sum()
                };
                let expected = [0, 1, 2].map(|channel| sum(channel) / around.len() as f64);
                let channels = around.iter().flat_map(|&at| full[at]);
                let largest = channels.fold(0.0_f32, f32::max);
                // Packing is off by 2^-17 of the largest channel; dividing by the reflectance, adding four and
                // multiplying take a dozen roundings of f32.
                let bound =
                    f64::from(largest) * (1.0 / f64::from(1 << 17) + 12.0 / f64::from(1 << 24));
                for channel in 0..3 {
                    let off = (f64::from(found[channel]) - expected[channel]).abs();
                    assert!(off <= bound, "({x}, {y}) of {size:?}: {off} of {bound}");
                }
                // Negative control: gathering there would have given something else, but where the plane is dark.
                let own = f64::from(full[pixel][0]);
                as_full += usize::from((own - expected[0]).abs() <= bound);
            }
        }
        assert!(as_full < width * height / 8, "{as_full} as at full rate");
    }
}

const VARNISHED: [f32; 3] = [0.5, 0.3, 0.1];
/// Index of 1.5.
const COAT_F0: f64 = 0.04;

/// What the base under a smooth coat reflects by channels, and one over the chance that a path gathers there: the base by its loss
/// at normal incidence, beside what the coat mirrors.
fn varnish(view: &View, pixel: usize, size: [u32; 2]) -> ([f64; 3], f64) {
    let cosine = -pixel_ray(view, pixel, size).direction.z;
    let mirrored = COAT_F0 + (1.0 - COAT_F0) * (1.0 - cosine).powi(5);
    let base = (1.0 - COAT_F0) * f64::from(VARNISHED[0]);
    let reflected = VARNISHED.map(|albedo| f64::from(albedo) * (1.0 - mirrored));
    (reflected, (base + mirrored) / base)
}

#[test]
fn light_of_a_varnished_plane_is_carried_per_reflectance_and_chance_to_gather() {
    // A perfect coat mirrors black space, so that pixels without light are those that follow it.
    let mut scene = builtin("plane");
    let [r, g, b] = VARNISHED;
    scene.materials[0] = Material {
        base_color: [r, g, b, 1.0],
        metallic: 0.0,
        roughness: 0.0,
        ..Material::default()
    };
    // Of rays up to 73 degrees from the normal the coat mirrors a fifth.
    let views = eyes_at(
        DVec3::ZERO,
        DQuat::from_rotation_y(-30_f64.to_radians()),
        40.0,
    );
    let [full, half] = both_rates(|s| {
        s.photon.direct = DirectLight::Map;
        s.photon.count = 65_536;
        // Some 40 photons where they are fewest.
        s.photon.radius_m = 1.0;
    });
    // By reflectance and chance, by one of them, by none.
    const TWINS: [[bool; 2]; 4] = [[true, true], [true, false], [false, true], [false, false]];
    for size in SIZES {
        let full = images(&scene, &full, size, &views);
        let half = images(&scene, &half, size, &views);
        let [width, height] = size.map(|n| n as usize);
        let (mut spread, mut followed, mut off) = (0, 0, [0; 4]);
        for ((view, full), half) in views.iter().zip(&full).zip(&half) {
            let is_gathered = |at: &usize| full[*at] != [0.0; 3];
            for (pixel, found) in half.iter().enumerate() {
                let (x, y) = (pixel % width, pixel / width);
                let mut around = gathered_around([x, y], [width, height]);
                around.retain(is_gathered);
                if (x % 2 == 0 && y % 2 == 0) || !is_gathered(&pixel) || around.is_empty() {
                    assert_eq!(
                        found, &full[pixel],
                        "({x}, {y}) of {size:?} gathers or follows"
                    );
                    followed += usize::from(!is_gathered(&pixel));
                    continue;
                }
                spread += 1;
                for (twin, off) in TWINS.iter().zip(&mut off) {
                    let share = |pixel: usize| {
                        let (reflected, chance) = varnish(view, pixel, size);
                        let chance = if twin[1] { chance } else { 1.0 };
                        reflected.map(|channel| chance * if twin[0] { channel } else { 1.0 })
                    };
                    let light = |at: &usize| {
                        let share = share(*at);
                        [0, 1, 2].map(|channel| f64::from(full[*at][channel]) / share[channel])
                    };
                    let lights: Vec<[f64; 3]> = around.iter().map(light).collect();
                    let largest = lights.iter().flatten().copied().fold(0.0, f64::max);
                    // Packing is off by 2^-17 of the largest channel. Roundings of 2^-24: four of the ray's cosine are twenty
                    // of its fifth power, which the shares here and there hold; with those of the mean fewer than 64.
                    let bound = largest * (1.0 / f64::from(1 << 17) + 64.0 / f64::from(1 << 24));
                    let share = share(pixel);
                    *off += usize::from((0..3).any(|channel| {
                        let sum: f64 = lights.iter().map(|light| light[channel]).sum();
                        let due = sum / lights.len() as f64;
                        (f64::from(found[channel]) / share[channel] - due).abs() > bound
                    }));
                }
            }
        }
        println!("{size:?}: {spread} spread, {followed} followed, off {off:?}");
        assert!(spread > width * height / 2 && followed > width * height / 10);
        assert_eq!(off[0], 0, "{off:?} of {spread} at {size:?}");
        // Negative controls: a share that lacks a part. Where rays are steep the chance hardly changes between neighbours.
        assert!(
            off[1] > spread / 4 && off[2] > spread / 2 && off[3] > spread / 2,
            "{off:?}"
        );
    }
}

#[test]
fn every_way_to_gather_is_the_same_at_the_pixels_that_gather() {
    let scene = builtin("cornell");
    let views = start_views(&scene, 21.0);
    let default: Change = |_| {};
    let ways = [default, KD, NEAREST, KD_NEAREST];
    for (number, way) in ways.into_iter().enumerate() {
        let size = SIZES[number % 2];
        let [full, half] = both_rates(way).map(|settings| images(&scene, &settings, size, &views));
        for (full, half) in full.iter().zip(&half) {
            let (mut same, mut other) = (0, 0);
            for (pixel, found) in half.iter().enumerate() {
                let (x, y) = (pixel % size[0] as usize, pixel / size[0] as usize);
                if x % 2 == 0 && y % 2 == 0 {
                    assert_eq!(found, &full[pixel], "({x}, {y}), way {number}");
                } else if found == &full[pixel] {
                    same += 1;
                } else {
                    other += 1;
                }
            }
            // Beyond the box nothing is seen; within it nearly all is interpolated.
            assert!(other > same, "way {number}: {same} as before, {other} not");
        }
    }
}

#[test]
fn what_mirrors_show_is_gathered_by_every_pixel() {
    let scene = hall_of_mirrors(0.0);
    let views = eyes_at_origin(30.0);
    let size = SIZES[1];
    let [full, half] = both_rates(|_| {}).map(|settings| images(&scene, &settings, size, &views));
    let width = size[0] as usize;
    let differing = |columns: std::ops::Range<usize>| {
        let pixels = (0..full[0].len()).filter(|pixel| columns.contains(&(pixel % width)));
        let differ = pixels.filter(|&pixel| full[0][pixel] != half[0][pixel]);
        differ.count()
    };
    // The mirror's picture stays.
    assert_eq!(differing(0..width / 2 - 1), 0);
    // Negative control: the wall beside it is interpolated.
    assert!(differing(width / 2 + 1..width) > full[0].len() / 4);
}

#[test]
fn half_rate_is_about_as_true_as_full_rate() {
    const SIZE: [u32; 2] = [64, 64];
    let scene = builtin("cornell");
    let views = start_views(&scene, 21.0);
    let reference = settings(|s| {
        s.method = Method::Path;
        s.reuse = Reuse::Off;
        s.spp = 256;
        s.seed = 99;
    });
    let truth = images(&scene, &reference, SIZE, &views);
    let all = vec![true; truth[0].len()];
    for reuse in [Reuse::Off, Reuse::Scatter, Reuse::Lookup] {
        let [full, half] = both_rates(|s| {
            s.reuse = reuse;
            s.spp = 4;
            s.photon.count = 65_536;
        })
        .map(|settings| images(&scene, &settings, SIZE, &views));
        for eye in 0..2 {
            let error = |image: &[[f32; 3]]| rel_mse(image, &truth[eye], &all);
            let (at_full, at_half) = (error(&full[eye]), error(&half[eye]));
            println!("{reuse:?} eye {eye}: {at_full:.5} at full rate, {at_half:.5} at half");
            assert!(bits(&full[eye]) != bits(&half[eye]));
            // Measured: 0.87 to 0.93. The photons' noise is the same for both; interpolation takes some of it away and adds
            // what the light bends between neighbours.
            assert!(at_half <= 1.05 * at_full, "{reuse:?} eye {eye}");
            // Negative control: a picture that is off by the distance between gathered pixels is found out.
            let mut moved = half[eye].clone();
            moved.rotate_right(1);
            assert!(error(&moved) > 1.05 * at_full);
        }
    }
}

/// The light of a lobe does not grow with the base below it, by which gathered light is divided: it goes to like bases alone,
/// between an eye's pixels and between the eyes.
#[test]
fn gathered_highlights_on_textures_are_as_bright_as_they_were() {
    const SIZE: [u32; 2] = [40, 40];
    let pose = Pose::new(DVec3::Z * 1.6, DQuat::IDENTITY);
    let views = parallel_views(pose, IPD_M, square_fov(45.0));
    let gathered = |s: &mut RenderSettings| {
        s.spp = 8;
        s.photon.count = 131_072;
    };
    let brightness = |library: &ShaderLibrary, greys| {
        let mut scene = glossy_board(greys);
        // In place of the lamp a wall, which another lamp lights that the floor does not see.
        scene.meshes[1].positions = [[-2.0, -1.0], [2.0, -1.0], [2.0, 3.0], [-2.0, 3.0]]
            .map(|[x, y]| [x, y, -2.0])
            .to_vec();
        let lamp = std::mem::replace(&mut scene.materials[1], Material::lambert("wall", [0.8; 3]));
        scene.materials.push(Material {
            emission: [30.0; 3],
            ..lamp
        });
        let corners =
            [[-1.0, -0.9], [-1.0, -0.1], [1.0, -0.1], [1.0, -0.9]].map(|[x, y]| [x, y, -1.2]);
        let back = [[0.0, 0.0, -1.0]; 4];
        let indices = [[0, 1, 2], [0, 2, 3]];
        scene
            .meshes
            .push(Mesh::plain(corners.to_vec(), back.to_vec(), indices, 2));
        scene.roots.push(2);
        scene.nodes.push(Node::of_mesh(2));
        let image = |settings: &RenderSettings| {
            let renderer = renderer_by(library, &scene, settings, Eyes::Both, SIZE);
            let mut renderer = renderer.unwrap();
            play(&mut renderer, &views, 0..1);
            [Eye::Left, Eye::Right].map(|eye| {
                let image = radiance(&renderer, eye);
                let rows = image.chunks_exact(SIZE[0] as usize).skip(30);
                // The middle of the floor.
                mean(
                    &rows
                        .flat_map(|row| row[10..30].to_vec())
                        .collect::<Vec<_>>(),
                )
            })
        };
        let [full, half] = both_rates(gathered).map(|s| image(&s));
        let mut reused = both_rates(gathered)[0].clone();
        reused.reuse = Reuse::Scatter;
        [half[0] / full[0], image(&reused)[1] / full[1]]
    };
    // Of one grey, nothing is mixed that differs: what is off there is the photons' noise, and the same for all boards.
    let embedded = ShaderLibrary::embedded();
    let even = brightness(&embedded, [150, 150]);
    for off in even {
        assert!((off - 1.0).abs() < 0.06, "{even:?}");
    }
    for greys in [[0, 230], [90, 200]] {
        let found = brightness(&embedded, greys);
        for (found, even) in found.iter().zip(even) {
            // A twentieth of what the negative control adds.
            assert!(
                (found / even - 1.0).abs() < 0.03,
                "{greys:?}: {found}, {even}"
            );
        }
    }
    let alike = changed(
        "shared/mixing",
        "select(select(alike, DARK_LOG2, is_other)",
        "select(0.0",
    );
    let found = brightness(&alike, [0, 230]);
    assert!(found.iter().all(|found| *found > 1.5), "{found:?}");
}

#[test]
fn one_kernel_does_not_gather_at_half_rate() {
    let refused = settings(|s| {
        s.photon.half_rate = true.into();
        s.photon.schedule = Schedule::Fused;
    });
    let error = refused.photon.check_gather().unwrap_err();
    assert_says(&error, &["photon.half_rate", "photon.schedule"]);
    for settings in both_rates(|_| {}) {
        assert!(settings.photon.check_gather().is_ok());
    }
}
