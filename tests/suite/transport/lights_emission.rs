//! Photon emission against its densities and powers.

use std::f64::consts::PI;

use glam::{DAffine3, DVec3};
use stereolux::renderer::records::light::LIGHT_TRIANGLE;
use stereolux::scene::{AlphaMode, LightKind, Material, Scene};
use stereolux::settings::{Method, Technique};

use super::chi_square::{Sampled, p_value, p_value_of_counts, sidak};
use super::lights_probe::{LightProbe, Photon, add_light, add_triangles, glowing};
use super::lights_sampling::{
    DRAWS, LEVEL, area, ceiling, ceiling_triangle, cell_probabilities, environment_scene, map,
    map_coordinates, mean_and_error, placement, v, weights,
};
use super::support::context;
use super::techniques::{agree, blocks, box_with, brighter, settings_of};

const ALL: [&str; 5] = ["emitters", "points", "spots", "directionals", "environment"];

fn spot(inner: f64, outer: f64) -> LightKind {
    LightKind::Spot {
        inner_cone_rad: inner as f32,
        outer_cone_rad: outer as f32,
    }
}

/// One light of each kind, far from the world's origin, seen from a head nearby.
fn mixed_scene() -> (Scene, DVec3) {
    let offset = v(1000.0, -500.0, 250.0);
    let shift = DAffine3::from_translation(offset);
    let mut scene = Scene {
        environment: Some(map()),
        ..Scene::default()
    };
    let place = shift * placement(1.0, false);
    let one = ceiling_triangle();
    add_triangles(&mut scene, &[one], glowing([5.0, 1.0, 0.3]), place);
    let mut double_sided = glowing([0.0, 3.0, 1.0]);
    double_sided.double_sided = true;
    let other = [v(0.0, 1.0, 0.0), v(0.0, 1.0, 1.0), v(1.0, 1.0, 0.0)];
    let mirrored = shift * placement(0.5, true);
    add_triangles(&mut scene, &[one, other], double_sided, mirrored);
    add_light(&mut scene, LightKind::Point, [1.0, 0.5, 0.2], shift);
    add_light(&mut scene, spot(0.2, 0.7), [8.0, 4.0, 1.0], place);
    add_light(&mut scene, LightKind::Directional, [0.4, 0.5, 0.9], place);
    (scene, offset + v(0.2, 0.1, 0.0))
}

#[test]
fn the_mean_photon_carries_the_total_power() {
    let context = context();
    let (scene, origin) = mixed_scene();
    let probe = LightProbe::new(&context, &ALL, &scene, origin);
    let photons = probe.photons(1 << 20, 9);
    for channel in 0..3 {
        let (mean, error) = mean_and_error(photons.iter().map(|p| p.flux[channel]));
        let power = probe.lights.total_power[channel];
        assert!(error < 0.005 * power);
        let off = (mean - power).abs();
        assert!(
            off <= 4.0 * error,
            "{channel}: {mean} +- {error} of {power}"
        );
    }
}

#[test]
fn each_kind_of_light_emits_exactly_its_power() {
    let context = context();
    let (inner, outer) = (0.2f64, 0.7f64);
    let ramp = inner.cos() - outer.cos();
    let cone = 2.0 * PI * (1.0 - inner.cos() + ramp / 3.0);
    for (feature, kind, solid_angle) in [
        ("points", LightKind::Point, 4.0 * PI),
        ("spots", spot(inner, outer), cone),
        ("spots", spot(0.0, 0.5 * PI), 2.0 * PI / 3.0),
    ] {
        let mut scene = Scene::default();
        add_light(&mut scene, kind, [2.0, 1.0, 0.5], placement(1.0, false));
        let probe = LightProbe::new(&context, &[feature], &scene, DVec3::ZERO);
        for photon in probe.photons(20_000, 1) {
            for (flux, intensity) in photon.flux.iter().zip([2.0, 1.0, 0.5]) {
                let off = (flux / (intensity * solid_angle) - 1.0).abs();
                assert!(off < 1e-5, "{kind:?}: {photon:?}");
            }
        }
    }
    // Parallel light fills the scene's box as it sees it, from behind it.
    let mut scene = ceiling(glowing([0.0; 3]), DAffine3::IDENTITY);
    let place = placement(1.0, false);
    add_light(&mut scene, LightKind::Directional, [3.0; 3], place);
    let probe = LightProbe::new(&context, &["directionals"], &scene, DVec3::ZERO);
    let half = probe.lights.packed_box().half_size;
    let center = v(0.5, 0.0, 0.45);
    assert!((half - center).abs().max_element() < 1e-4 && half.y > 0.0);
    for photon in probe.photons(20_000, 1) {
        let area = 4.0 * half.element_product() * (photon.direction / half).abs().element_sum();
        assert!((photon.flux[0] / (3.0 * area) - 1.0).abs() < 1e-5);
        let entry = photon.origin + photon.direction * half.length() - center;
        let face = (entry.abs() - half).max_position();
        let (at, along) = (entry[face], photon.direction[face]);
        assert!((at.abs() - half[face]).abs() < 1e-6 && at * along < 0.0);
    }
}

/// Cells across a face of the scene's box.
const ACROSS: usize = 8;

/// P-value of where photons come in by the faces of a box: by those in proportion to their areas across each photon's direction, and
/// by cells of a face alike. `moved` moves a place along a face, from 0 to 1.
fn entry_p_value(
    photons: &[Photon],
    center: DVec3,
    half: DVec3,
    moved: impl Fn(f64) -> f64,
    face_area: impl Fn(DVec3) -> DVec3,
) -> f64 {
    let mut counts = vec![(0.0, 0.0); 3 * ACROSS * ACROSS];
    for photon in photons {
        let areas = face_area(photon.direction);
        let due = areas / (areas.element_sum() * (ACROSS * ACROSS) as f64);
        for (cell, (expected, _)) in counts.iter_mut().enumerate() {
            *expected += due[cell / (ACROSS * ACROSS)];
        }
        let place = (photon.origin + photon.direction * half.length() - center) / half;
        let face = place.abs().max_position();
        let [x, y] = [1, 2].map(|next| {
            let along = moved((0.5 * place[(face + next) % 3] + 0.5).clamp(0.0, 1.0));
            ((along * ACROSS as f64) as usize).min(ACROSS - 1)
        });
        counts[(face * ACROSS + y) * ACROSS + x].1 += 1.0;
    }
    p_value_of_counts(&counts)
}

#[test]
fn light_from_afar_comes_in_evenly_by_all_lit_faces_of_the_scenes_box() {
    let context = context();
    let level = sidak(LEVEL, 2);
    // Turned, so that no side of the box is flat.
    let place = placement(1.0, false);
    let mut sunny = ceiling(glowing([0.0; 3]), place);
    add_light(&mut sunny, LightKind::Directional, [3.0; 3], place);
    let mut sky = ceiling(glowing([0.0; 3]), place);
    sky.environment = Some(map());
    for (scene, feature) in [(sunny, "directionals"), (sky, "environment")] {
        let probe = LightProbe::new(&context, &[feature], &scene, DVec3::ZERO);
        let photons = probe.photons(DRAWS, 1);
        let scene_box = probe.lights.packed_box();
        let (center, half) = (scene_box.center, scene_box.half_size);
        assert!(half.min_element() > 0.05, "{half}");
        for corner in ceiling_triangle() {
            let off = (place.transform_point3(corner) - center).abs() - half;
            assert!(off.max_element() < 1e-4, "{corner} in {center} +- {half}");
        }
        let areas = 4.0 * half.element_product() / half;
        let across = |direction: DVec3| areas * direction.abs();
        // Directions of the sky differ, which spreads the counts less than those of one direction.
        let p = entry_p_value(&photons, center, half, |u| u, across);
        assert!(p > level, "{feature}: p = {p:e}");
        // Negative controls: places that crowd to one side, and faces by their areas alone.
        let crowded = entry_p_value(&photons, center, half, |u| u * u, across);
        let turned = entry_p_value(&photons, center, half, |u| u, |_| areas);
        assert!(
            crowded < 1e-9 && turned < 1e-9,
            "{feature}: {crowded:e}, {turned:e}"
        );
    }
}

/// Share of rays that meet the blended lamps.
const COVERAGE: f32 = 0.4;

fn blended(lamp: &mut Material) {
    lamp.alpha_mode = AlphaMode::Blend;
    lamp.base_color[3] = COVERAGE;
}

#[test]
fn a_blended_lamps_photons_carry_what_it_covers() {
    let context = context();
    let triangle = ceiling_triangle();
    let power = |radiance: f64| radiance * PI * area(&triangle);
    for (mode, share) in [
        (AlphaMode::Blend, f64::from(COVERAGE)),
        (AlphaMode::Opaque, 1.0),
    ] {
        let mut lamp = glowing([2.0, 1.0, 0.5]);
        blended(&mut lamp);
        lamp.alpha_mode = mode;
        let scene = ceiling(lamp, DAffine3::IDENTITY);
        let probe = LightProbe::new(&context, &["emitters", "alpha"], &scene, DVec3::ZERO);
        for photon in probe.photons(20_000, 1) {
            for (flux, radiance) in photon.flux.iter().zip([2.0, 1.0, 0.5]) {
                // A dozen roundings of 2^-24.
                let off = (flux / (share * power(radiance)) - 1.0).abs();
                assert!(off < 1e-6, "{mode:?}: {photon:?}");
            }
        }
    }
}

#[test]
fn every_technique_finds_the_same_light_of_a_blended_lamp() {
    let (mut scene, views) = box_with(|_| {});
    let opaque = scene.clone();
    let lamps = scene.materials.iter_mut();
    lamps.filter(|m| m.is_emissive()).for_each(blended);
    let of = |scene: &Scene, set, method, technique, spp| {
        blocks(scene, &views, &settings_of(method, technique, 2, spp), set)
    };
    let mis = of(&scene, 0, Method::Path, Technique::Mis, 8);
    let light = of(&scene, 1, Method::Path, Technique::Light, 8);
    // Half-covered lamps are met rarely: more directions, so that a block's mean is near normal.
    let bsdf = of(&scene, 2, Method::Path, Technique::Bsdf, 48);
    let photons = of(&scene, 3, Method::Photon, Technique::Mis, 8);
    for (pair, a, b) in [
        ("mis and light", &mis, &light),
        ("mis and bsdf", &mis, &bsdf),
        ("light and bsdf", &light, &bsdf),
        ("paths and photons", &mis, &photons),
    ] {
        agree(a, b).unwrap_or_else(|why| panic!("{pair}: {why}"));
    }
    // Negative controls: 5 % more, and the lamp as if it covered all.
    assert!(agree(&brighter(&mis), &light).is_err());
    assert!(agree(&of(&opaque, 4, Method::Path, Technique::Light, 8), &bsdf).is_err());
}

fn photon_p_value(
    photons: &[Photon],
    pilot: &[Photon],
    breaks: &[f64],
    place: impl Fn(&Photon) -> (f64, f64),
    density: &dyn Fn(f64, f64) -> f64,
) -> f64 {
    let points: Vec<(f64, f64)> = photons.iter().map(&place).collect();
    let pilot: Vec<(f64, f64)> = pilot.iter().map(&place).collect();
    p_value(
        &Sampled::on_sphere(&points, points.len(), &pilot, breaks),
        density,
    )
}

#[test]
fn photons_leave_as_their_densities_say() {
    let context = context();
    let level = sidak(LEVEL, 5);
    // (cosine to an axis, azimuth) of a direction.
    let around = |axis: DVec3| {
        let x = axis.any_orthonormal_vector();
        let y = axis.cross(x);
        move |p: &Photon| {
            let cosine = p.direction.dot(axis).clamp(-1.0, 1.0);
            (cosine, p.direction.dot(y).atan2(p.direction.dot(x)))
        }
    };
    let draws =
        |probe: &LightProbe<'_>| [(DRAWS, 1), (20_000, 2)].map(|(n, seed)| probe.photons(n, seed));

    // A triangle: cosine-weighted directions, uniform positions.
    let scene = ceiling(glowing([1.0; 3]), DAffine3::IDENTITY);
    let probe = LightProbe::new(&context, &["emitters"], &scene, DVec3::ZERO);
    let [photons, pilot] = draws(&probe);
    let front = v(0.0, -1.0, 0.0);
    let cosine = |z: f64, _: f64| z.max(0.0) / PI;
    let p = photon_p_value(&photons, &pilot, &[0.0], around(front), &cosine);
    assert!(p > level, "triangle, direction: p = {p:e}");
    let triangle = ceiling_triangle();
    let on_triangle = |photon: &Photon| {
        let (b1, b2) = weights(&triangle, photon.origin - front, front);
        let [sum, share] = [b1 + b2, b2 / (b1 + b2)].map(|x| x.clamp(0.0, 1.0) * 2.0 - 1.0);
        (sum, share * PI)
    };
    let linear = |s: f64, _: f64| (s + 1.0) / (4.0 * PI);
    let p = photon_p_value(&photons, &pilot, &[], on_triangle, &linear);
    assert!(p > level, "triangle, position: p = {p:e}");
    for photon in &photons[..2000] {
        assert!((photon.pdf_direction * PI - photon.direction.dot(front)).abs() < 1e-5);
        assert!((photon.pdf_position * area(&triangle) - 1.0).abs() < 1e-5);
    }
    let even = |z: f64, _: f64| if z > 0.0 { 0.5 / PI } else { 0.0 };
    let p = photon_p_value(&photons, &pilot, &[0.0], around(front), &even);
    assert!(p < 1e-9, "negative control: p = {p:e}");

    // A point light: uniform.
    let mut scene = Scene::default();
    add_light(&mut scene, LightKind::Point, [1.0; 3], DAffine3::IDENTITY);
    let probe = LightProbe::new(&context, &["points"], &scene, DVec3::ZERO);
    let [photons, pilot] = draws(&probe);
    let p = photon_p_value(&photons, &pilot, &[], around(DVec3::Y), &|_, _| 0.25 / PI);
    assert!(p > level, "point: p = {p:e}");

    // A spot: the falloff's own shape.
    let (inner, outer) = (0.3f64, 0.9f64);
    let mut scene = Scene::default();
    add_light(&mut scene, spot(inner, outer), [1.0; 3], DAffine3::IDENTITY);
    let probe = LightProbe::new(&context, &["spots"], &scene, DVec3::ZERO);
    let [photons, pilot] = draws(&probe);
    let ramp = inner.cos() - outer.cos();
    let total = 2.0 * PI * (1.0 - inner.cos() + ramp / 3.0);
    let falloff = |z: f64, _: f64| ((z - outer.cos()) / ramp).clamp(0.0, 1.0).powi(2) / total;
    let (breaks, axis) = ([inner.cos(), outer.cos()], around(DVec3::NEG_Z));
    let p = photon_p_value(&photons, &pilot, &breaks, axis, &falloff);
    assert!(p > level, "spot: p = {p:e}");
    for photon in &photons[..2000] {
        let due = falloff(-photon.direction.z, 0.0);
        let off = (photon.pdf_direction - due).abs();
        assert!(off < 1e-4, "{photon:?}: {due} is due");
    }

    // The environment: photons fly against the sampled directions and fill the disk.
    let scene = environment_scene();
    let probe = LightProbe::new(&context, &["environment"], &scene, DVec3::ZERO);
    let photons = probe.photons(DRAWS, 1);
    let map = map();
    let mut observed = vec![0.0; (map.width * map.height) as usize];
    for photon in &photons {
        let (u, t) = map_coordinates(-photon.direction);
        let column = ((u * f64::from(map.width)) as u32).min(map.width - 1);
        let row = ((t * f64::from(map.height)) as u32).min(map.height - 1);
        observed[(row * map.width + column) as usize] += 1.0;
    }
    let expected = cell_probabilities(&map).into_iter();
    let expected = expected.map(|p| p * photons.len() as f64);
    let p = p_value_of_counts(&expected.zip(observed).collect::<Vec<_>>());
    assert!(p > level, "environment: p = {p:e}");
}

#[test]
fn many_lights_are_picked_by_power_and_degenerate_ones_never() {
    let context = context();
    let mut scene = Scene::default();
    // Power proportional to the index, and every tenth triangle without area.
    let corners: Vec<[DVec3; 3]> = (0..10_000)
        .map(|index| {
            let corner = v(f64::from(index % 100), 0.0, f64::from(index / 100));
            let size = f64::from(if index % 10 == 0 { 0 } else { index }) * 1e-4;
            [corner, corner + size * DVec3::X, corner + DVec3::Z]
        })
        .collect();
    add_triangles(&mut scene, &corners, glowing([1.0; 3]), DAffine3::IDENTITY);
    let probe = LightProbe::new(&context, &["emitters"], &scene, DVec3::ZERO);
    assert_eq!(probe.lights.records.len(), 10_000);
    let mut kinds = probe.lights.records.iter().map(|light| light.kind);
    assert!(kinds.all(|kind| kind == LIGHT_TRIANGLE));
    let photons = probe.photons(1 << 20, 4);
    let mut observed = vec![0.0; 100];
    for photon in &photons {
        // No triangle without area is picked.
        let column = photon.origin.x.floor() as u32;
        assert!(!column.is_multiple_of(10), "{photon:?}");
        let row = photon.origin.z.floor().clamp(0.0, 99.0);
        observed[row as usize] += 1.0;
    }
    let areas: Vec<f64> = corners.iter().map(area).collect();
    let total: f64 = areas.iter().sum();
    let shares = areas.chunks(100).map(|row| row.iter().sum::<f64>() / total);
    let expected = shares.map(|share| share * photons.len() as f64);
    let p = p_value_of_counts(&expected.zip(observed).collect::<Vec<_>>());
    assert!(p > LEVEL, "p = {p:e}");
}

#[test]
fn no_lights_give_no_samples_and_no_photons() {
    let context = context();
    let scene = ceiling(glowing([0.0; 3]), DAffine3::IDENTITY);
    for features in [&[][..], &ALL[..]] {
        let probe = LightProbe::new(&context, features, &scene, DVec3::ZERO);
        let samples = probe.towards(v(0.0, -1.0, 0.0), 64, 1);
        assert!(samples.iter().all(|s| s.pdf == 0.0));
        assert!(probe.photons(64, 1).iter().all(|p| p.flux == [0.0; 3]));
    }
}
