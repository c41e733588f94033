//! The path tracer's two ways to find lights: each alone, and both weighted, have one mean.

use std::f64::consts::PI;

use glam::{DQuat, DVec3};
use stereolux::scene::{Material, Scene};
use stereolux::settings::{Method, RenderSettings, Reuse, Sampler, Technique};
use stereolux::xr::View;

use super::bsdf_twin::{Twin, direction};
use super::chi_square::integrate;
use super::hard_support::{
    add, add_point_light, constant_environment, cube, eyes_at, eyes_at_origin, images,
    square_ahead, tiles,
};
use super::lights_sampling::map_of;
use super::support::{
    builtin, images_of, parallel_views, renderer, settings, square_fov, statistics,
};

const SIZE: u32 = 64;
const BLOCK: u32 = 8;
const RUNS: u32 = 12;

pub fn settings_of(method: Method, technique: Technique, depth: u32, spp: u32) -> RenderSettings {
    settings(|s| {
        s.method = method;
        s.reuse = Reuse::Off;
        s.path.technique = technique;
        s.path.max_depth = depth;
        s.photon.max_depth = depth;
        s.spp = spp;
    })
}

/// Means of one channel over the blocks of `RUNS` independent images; sets share no random numbers with one another.
pub fn blocks(
    scene: &Scene,
    views: &[View; 2],
    settings: &RenderSettings,
    set: u32,
) -> Vec<Vec<f64>> {
    let mut renderer = renderer(scene, settings, [SIZE, SIZE]);
    let first = 1000 * set;
    let images = images_of(&mut renderer, views, first..first + RUNS);
    let means = |image: &Vec<[f32; 3]>| {
        let green: Vec<_> = image.iter().map(|color| [color[1]; 3]).collect();
        tiles(&green, SIZE as usize, BLOCK as usize)
    };
    images.iter().map(means).collect()
}

/// Welch's statistic per block; blocks without any light in either are left out.
fn z_values(a: &[Vec<f64>], b: &[Vec<f64>]) -> Vec<f64> {
    (0..a[0].len())
        .filter_map(|block| {
            let [(mean_a, error_a), (mean_b, error_b)] = [a, b].map(|runs| {
                let of_block: Vec<f64> = runs.iter().map(|run| run[block]).collect();
                statistics(&of_block)
            });
            let error = (error_a + error_b).sqrt();
            (error > 0.0).then(|| (mean_a - mean_b) / error)
        })
        .collect()
}

/// Share of blocks whose statistic lies within `limit`.
fn share_within(z: &[f64], limit: f64) -> f64 {
    z.iter().filter(|z| z.abs() <= limit).count() as f64 / z.len() as f64
}

/// Whether two sets of images have one mean, or how they have not: Welch's t
/// with 11 to 22 degrees of freedom lies beyond 5.5 with probability 2e-4 at most, so that one block in 192 does so by chance
/// in 4 % of scenes, and 99.75 % of 64 means that none may; the root mean square of t with 11 degrees is sqrt(11 / 9) = 1.1.
pub fn agree(a: &[Vec<f64>], b: &[Vec<f64>]) -> Result<(), String> {
    let z = z_values(a, b);
    let worst = z.iter().fold(0.0_f64, |worst, z| worst.max(z.abs()));
    let rms = (z.iter().map(|z| z * z).sum::<f64>() / z.len() as f64).sqrt();
    if z.len() <= 40 {
        Err(format!("only {} blocks are lit", z.len()))
    } else if share_within(&z, 5.5) < 0.9975 || rms >= 1.6 {
        Err(format!("worst block at {worst}, rms {rms} standard errors"))
    } else {
        Ok(())
    }
}

/// The same images, 5 % brighter: a negative control.
pub fn brighter(runs: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let of = |run: &Vec<f64>| run.iter().map(|mean| mean * 1.05).collect();
    runs.iter().map(of).collect()
}

fn check(name: &str, scene: &Scene, views: &[View; 2]) {
    let of = |set, method, technique, depth, spp| {
        let settings = settings_of(method, technique, depth, spp);
        blocks(scene, views, &settings, set)
    };
    let mis = of(0, Method::Path, Technique::Mis, 3, 8);
    let light = of(1, Method::Path, Technique::Light, 3, 8);
    // Directions of the surfaces find a small lamp rarely: more of them, so that a block's mean is near normal.
    let bsdf = of(2, Method::Path, Technique::Bsdf, 3, 32);
    // The photon method's direct light is that of paths of two segments, and metal finds it by following paths.
    let paths = of(3, Method::Path, Technique::Mis, 2, 8);
    let photons = of(4, Method::Photon, Technique::Mis, 2, 8);
    for (pair, a, b) in [
        ("mis and light", &mis, &light),
        ("mis and bsdf", &mis, &bsdf),
        ("light and bsdf", &light, &bsdf),
        ("paths and photons", &paths, &photons),
    ] {
        if let Err(reason) = agree(a, b) {
            panic!("{name}, {pair}: {reason}");
        }
    }
    // Negative controls: both techniques without weights count the light twice, and 5 % too much is seen as well.
    let sum: Vec<Vec<f64>> = light
        .iter()
        .zip(&bsdf)
        .map(|(light, bsdf)| light.iter().zip(bsdf).map(|(a, b)| a + b).collect())
        .collect();
    let twice = share_within(&z_values(&mis, &sum), 5.5);
    assert!(twice < 0.5, "{name}: twice the light passes");
    let more = agree(&brighter(&mis), &light);
    assert!(more.is_err(), "{name}: 5 % too much passes");
}

/// Cornell with a lamp large enough to be found by chance, and `change` on every other material.
pub fn box_with(change: impl Fn(&mut Material)) -> (Scene, [View; 2]) {
    let mut scene = builtin("cornell");
    let others = scene.materials.iter_mut();
    others.filter(|m| !m.is_emissive()).for_each(change);
    let views = parallel_views(scene.start_pose(), 0.0, square_fov(19.0));
    (scene, views)
}

#[test]
fn techniques_agree_on_diffuse_walls() {
    let (scene, views) = box_with(|_| {});
    check("diffuse", &scene, &views);
}

#[test]
fn techniques_agree_on_glossy_walls() {
    // Wide enough that light samples alone keep a finite, moderate variance: GGX alpha 0.16 to 0.36.
    let (scene, views) = box_with(|material| {
        material.specular = 1.0;
        material.roughness = 0.5;
        material.metallic = f32::from(u8::from(material.name.contains("red")));
    });
    check("glossy", &scene, &views);
}

/// Photons are kept on no surface of such a pane, and no path meets a light without a size: only the surface behind the first one
/// can ask for it.
#[test]
fn a_lamp_without_a_size_shines_through_frosted_glass_by_both_methods() {
    let pane = cube().into_iter().map(|corners| {
        let flat = DVec3::new(2.0, 2.0, 0.05);
        corners.map(|p| p * flat - 2.0 * DVec3::Z)
    });
    let frosted = Material {
        metallic: 0.0,
        transmission: 1.0,
        ior: 1.5,
        roughness: 0.5,
        ..Material::default()
    };
    let mut scene = Scene::default();
    add(&mut scene, &pane.collect::<Vec<_>>(), frosted);
    add_point_light(&mut scene, DVec3::new(0.3, 0.2, -4.0), 10.0);
    let views = eyes_at_origin(30.0);
    let of = |set, method| {
        let settings = settings_of(method, Technique::Mis, 4, 32);
        blocks(&scene, &views, &settings, set)
    };
    let (paths, photons) = (of(0, Method::Path), of(1, Method::Photon));
    agree(&paths, &photons).unwrap_or_else(|why| panic!("{why}"));
    let more = agree(&paths, &brighter(&photons));
    assert!(more.is_err(), "5 % too much passes");
}

#[test]
fn techniques_agree_under_a_sky() {
    // A gradient with a bright patch, so that light sampling has something to gain.
    let (mut scene, views) = box_with(|material| {
        material.specular = 1.0;
        material.roughness = 0.6;
    });
    for material in &mut scene.materials {
        material.emission = [0.0; 3];
    }
    scene.environment = Some(map_of([32, 16], |x, y| {
        let is_patch = (14..18).contains(&x) && (6..9).contains(&y);
        let patch = if is_patch { 6.0 } else { 0.0 };
        let base = 0.5 + 0.5 * y as f32 / 16.0;
        [base + patch, base + patch, base]
    }));
    // Seen from outside through the open front, where the sky comes in.
    check("sky", &scene, &views);
}

/// A metal wall under an even sky shows the sky's radiance times its directional albedo, the integral of f cos over the
/// hemisphere. Photons' eye paths follow such a lobe into the sky, and what they meet is weighed against a sample by the lights.
#[test]
fn a_metal_wall_under_an_even_sky_shows_its_directional_albedo_by_both_methods() {
    const SIZE: u32 = 16;
    const SKY: f32 = 2.0;
    let metal = Material {
        base_color: [0.6, 0.6, 0.6, 1.0],
        metallic: 1.0,
        roughness: 0.5,
        ..Material::default()
    };
    let twin = Twin::new(&metal, 0);
    let mut scene = Scene::default();
    add(&mut scene, &square_ahead(100.0, 2.0), metal);
    scene.environment = Some(constant_environment([SKY; 3]));
    for degrees in [0.0_f64, 65.0] {
        let angle = degrees.to_radians();
        let wo = DVec3::new(angle.sin(), 0.0, angle.cos());
        let reflected = |z: f64, phi: f64| twin.eval(wo, direction(z, phi))[0] * z;
        let cells = (-8..8).map(|step| [step, step + 1].map(|step| f64::from(step) * PI / 8.0));
        let albedo: f64 = cells
            .map(|cell| integrate(&reflected, [0.0, 1.0], cell, 0))
            .sum();
        let views = eyes_at(DVec3::ZERO, DQuat::from_rotation_y(angle), 1.0);
        for method in [Method::Photon, Method::Path] {
            let mut settings = settings_of(method, Technique::Mis, 2, 256);
            settings.path.sampler = Sampler::Random;
            let [image, _] = images(&scene, &settings, [SIZE; 2], &views);
            let ratios: Vec<f64> = image
                .iter()
                .map(|color| f64::from(color[0]) / (f64::from(SKY) * albedo))
                .collect();
            let (mean, square) = statistics(&ratios);
            let error = square.sqrt();
            let what = format!("{method:?} at {degrees} degrees: {mean} +- {error} of {albedo}");
            eprintln!("{what}");
            // Quadrature is good to 1e-4; the albedo's bend over a view of 2 degrees is its Laplacian, at most 5, times
            // 0.0175^2 / 6.
            let is_due = |share: f64| (mean - share).abs() <= 4.0 * error + 4e-4;
            assert!(is_due(1.0), "{what}");
            assert!(!is_due(1.05), "{what}: 5 % too much passes");
        }
    }
}
