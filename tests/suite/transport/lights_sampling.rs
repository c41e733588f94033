//! Light sampling against its density: what shadow rays are aimed at.

use std::f64::consts::PI;

use glam::{DAffine3, DMat3, DVec3, Vec3};
use stereolux::scene::{Environment, LightKind, Material, Scene};

use super::chi_square::{Sampled, p_value, p_value_of_counts, sidak};
use super::lights_probe::{
    LightProbe, LightQuery, Photon, Towards, add_light, add_triangles, glowing,
};
use super::support::context;

pub const DRAWS: u32 = 200_000;
pub const LEVEL: f64 = 0.01;

pub fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// One triangle in the plane y = 0 whose front looks along -y.
pub fn ceiling_triangle() -> [DVec3; 3] {
    [v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.2), v(0.3, 0.0, 0.9)]
}

/// A scene of one ceiling triangle.
pub fn ceiling(material: Material, world_from_object: DAffine3) -> Scene {
    let mut scene = Scene::default();
    add_triangles(
        &mut scene,
        &[ceiling_triangle()],
        material,
        world_from_object,
    );
    scene
}

/// Placement that stretches, turns and moves; `mirrored` flips it over.
pub fn placement(scale: f64, mirrored: bool) -> DAffine3 {
    let turn = DMat3::from_rotation_x(0.3) * DMat3::from_rotation_y(1.1);
    let stretch = DMat3::from_diagonal(v(if mirrored { -1.5 } else { 1.5 }, 0.7, 1.2) * scale);
    DAffine3 {
        matrix3: turn * stretch,
        translation: v(0.4, 2.0, -0.3) * scale,
    }
}

fn placed(corners: [DVec3; 3], world_from_object: &DAffine3) -> [DVec3; 3] {
    corners.map(|corner| world_from_object.transform_point3(corner))
}

pub fn area(t: &[DVec3; 3]) -> f64 {
    0.5 * (t[1] - t[0]).cross(t[2] - t[0]).length()
}

/// Solid angle of a triangle seen from a point (Van Oosterom and Strackee 1983).
fn solid_angle(t: &[DVec3; 3], from: DVec3) -> f64 {
    let [a, b, c] = t.map(|corner| (corner - from).normalize());
    let volume = a.dot(b.cross(c)).abs();
    2.0 * volume.atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
}

/// Weights of the second and third corner where a ray meets the triangle's plane.
pub fn weights(t: &[DVec3; 3], from: DVec3, direction: DVec3) -> (f64, f64) {
    let (e1, e2) = (t[1] - t[0], t[2] - t[0]);
    let p = direction.cross(e2);
    let s = from - t[0];
    let q = s.cross(e1);
    (s.dot(p) / e1.dot(p), direction.dot(q) / e1.dot(p))
}

pub fn mean_and_error(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (mut count, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for value in values {
        count += 1.0;
        sum += value;
        squares += value * value;
    }
    let mean: f64 = sum / count;
    let variance = (squares / count - mean * mean).max(0.0);
    (mean, (variance / count).sqrt())
}

/// Points at these angles from the middle of a triangle, measured from the side that emits.
fn viewpoints(t: &[DVec3; 3], distance: f64) -> Vec<(f64, DVec3)> {
    let front = (t[1] - t[0]).cross(t[2] - t[0]).normalize();
    let along = (t[1] - t[0]).normalize();
    let middle = (t[0] + t[1] + t[2]) / 3.0;
    let at = |degrees: f64| {
        let angle = degrees.to_radians();
        let direction = front * angle.cos() + along * angle.sin();
        (degrees, middle + distance * direction)
    };
    [0.0, 45.0, 85.0].map(at).to_vec()
}

#[test]
fn emitting_triangles_are_sampled_as_their_density_says() {
    let context = context();
    let cases = [(1.0, false), (1.0, true), (1e-3, false), (1e5, false)];
    let level = sidak(LEVEL, cases.len() * 3);
    for (scale, mirrored) in cases {
        let place = placement(scale, mirrored);
        let scene = ceiling(glowing([2.0, 1.0, 0.5]), place);
        let origin = v(0.3, -0.2, 0.1) * scale;
        let probe = LightProbe::new(&context, &["emitters"], &scene, origin);
        let mut triangle = placed(ceiling_triangle(), &place).map(|corner| corner - origin);
        if mirrored {
            triangle.swap(1, 2);
        }
        for (degrees, from) in viewpoints(&triangle, 1.3 * scale) {
            let from = from.as_vec3().as_dvec3();
            let samples = probe.towards(from, DRAWS, 1);
            let points = |draws: &[Towards]| -> Vec<(f64, f64)> {
                let place = |s: &Towards| {
                    let (b1, b2) = weights(&triangle, from, s.direction);
                    // Rounding of positions puts some samples just outside.
                    let sum = (b1 + b2).clamp(0.0, 1.0);
                    (sum, (b2 / (b1 + b2)).clamp(0.0, 1.0))
                };
                draws.iter().filter(|s| s.pdf > 0.0).map(place).collect()
            };
            let (tested, pilot) = (points(&samples), points(&probe.towards(from, 20_000, 2)));
            // Uniform over the area: the density of (b1 + b2, b2 / (b1 + b2)) is 2 (b1 + b2).
            let sampled = Sampled::in_square(&tested, samples.len(), &pilot);
            let p = p_value(&sampled, &|sum, _| 2.0 * sum);
            let what = format!("scale {scale}, {degrees} degrees");
            assert!(p > level, "{what}: p = {p:e}");
            // The mean of 1 / pdf is the solid angle that the density covers.
            let inverse = |s: &Towards| if s.pdf > 0.0 { 1.0 / s.pdf } else { 0.0 };
            let (mean, error) = mean_and_error(samples.iter().map(inverse));
            let covered = solid_angle(&triangle, from);
            let off = (mean - covered).abs();
            let found = format!("{mean} +- {error}, the solid angle is {covered}");
            assert!(off <= 4.5 * error + 1e-4 * covered, "{what}: {found}");
            // emitter_pdf gives the same density for the same point.
            let normal = (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]);
            let normal = normal.normalize();
            let reach = |s: &Towards| normal.dot(triangle[0] - from) / normal.dot(s.direction);
            let kept = samples[..500].iter().filter(|s| s.pdf > 0.0);
            let query = |s: &Towards| LightQuery {
                from_position: from.as_vec3().to_array(),
                position: (from + s.direction * reach(s)).as_vec3().to_array(),
                geometric_normal: normal.as_vec3().to_array(),
                ..LightQuery::default()
            };
            let queries: Vec<LightQuery> = kept.clone().map(query).collect();
            for ((_, pdf), sample) in probe.densities(&queries).iter().zip(kept) {
                // Positions are rounded to 2^-24 of their size, which the cosine at 85 degrees magnifies by 12.
                let off = (pdf / sample.pdf - 1.0).abs();
                assert!(off < 1e-4, "{pdf} of emitter_pdf: {sample:?}");
                // A shadow ray must stop before the light, but not far before it.
                let reach = reach(sample);
                assert!(sample.distance < reach && sample.distance > 0.9999 * reach - 1e-4 * scale);
            }
        }
    }
}

#[test]
fn a_wrong_density_of_an_emitter_is_noticed() {
    let context = context();
    let scene = ceiling(glowing([1.0; 3]), DAffine3::IDENTITY);
    let probe = LightProbe::new(&context, &["emitters"], &scene, DVec3::ZERO);
    let from = v(0.4, -1.0, 0.4);
    let samples = probe.towards(from, DRAWS, 1);
    let (mean, error) = mean_and_error(samples.iter().map(|s| 1.01 / s.pdf));
    let off = (mean - solid_angle(&ceiling_triangle(), from)).abs();
    assert!(off > 4.5 * error, "one percent goes unnoticed");
}

#[test]
fn single_sided_emitters_shine_forwards_only_and_double_sided_both_ways() {
    let context = context();
    let (below, above) = (v(0.4, -1.0, 0.4), v(0.4, 1.0, 0.4));
    for double_sided in [false, true] {
        let material = Material {
            double_sided,
            ..glowing([1.0; 3])
        };
        let scene = ceiling(material, DAffine3::IDENTITY);
        let probe = LightProbe::new(&context, &["emitters"], &scene, DVec3::ZERO);
        let seen = |from| {
            let samples = probe.towards(from, 64, 1);
            samples.iter().filter(|s| s.pdf > 0.0).count()
        };
        assert_eq!(seen(below), 64);
        assert_eq!(seen(above), if double_sided { 64 } else { 0 });
        let photons = probe.photons(20_000, 1);
        let up = photons.iter().filter(|p| p.direction.y > 0.0).count();
        assert_eq!(up > 9_000 && up < 11_000, double_sided);
        let power = PI * area(&ceiling_triangle()) * if double_sided { 2.0 } else { 1.0 };
        assert!((probe.lights.total_power[0] - power).abs() < 1e-6 * power);
        let off = |p: &Photon| (p.flux[0] / power - 1.0).abs();
        assert!(photons.iter().all(|p| off(p) < 1e-5));
    }
}

#[test]
fn punctual_lights_follow_khr_lights_punctual() {
    let context = context();
    let (inner, outer) = (0.3f32, 0.6f32);
    let place = DAffine3 {
        matrix3: DMat3::from_rotation_x(-0.5 * PI),
        translation: v(1.0, 3.0, 2.0),
    };
    let spot = LightKind::Spot {
        inner_cone_rad: inner,
        outer_cone_rad: outer,
    };
    for (name, kind) in [
        ("points", LightKind::Point),
        ("spots", spot),
        ("directionals", LightKind::Directional),
    ] {
        let mut scene = ceiling(glowing([0.0; 3]), DAffine3::IDENTITY);
        add_light(&mut scene, kind, [4.0, 2.0, 1.0], place);
        let probe = LightProbe::new(&context, &[name], &scene, v(0.5, 0.0, 0.0));
        // -Z turned by -90 degrees about x looks down.
        for angle in [0.0f64, 0.2, 0.31, 0.45, 0.59, 0.61, 1.0] {
            let from = v(0.5, 3.0, 2.0) + 2.0 * v(angle.sin(), -angle.cos(), 0.0);
            let sample = probe.towards(from, 1, 1)[0];
            let (co, ci) = (f64::from(outer).cos(), f64::from(inner).cos());
            let cone = ((angle.cos() - co) / (ci - co)).clamp(0.0, 1.0).powi(2);
            let expected = match kind {
                LightKind::Point => 1.0,
                LightKind::Spot { .. } => 1.0 * cone,
                LightKind::Directional => 4.0,
            };
            assert!(sample.is_delta && (sample.pdf - 1.0).abs() < 1e-6);
            // The cone's ramp divides a difference of cosines by 0.13, so 2^-24 grows to about 1e-6.
            let off = (sample.radiance[0] - expected).abs();
            assert!(off < 1e-5, "{name} at {angle}: {sample:?}, not {expected}");
            let towards = match kind {
                LightKind::Directional => DVec3::Y,
                _ => (v(0.5, 3.0, 2.0) - from).normalize(),
            };
            assert!((sample.direction - towards).length() < 1e-6);
        }
        let at_light = probe.towards(v(0.5, 3.0, 2.0), 1, 1)[0];
        // A point inside the light has no direction to it.
        assert!(at_light.pdf == 0.0 || name == "directionals", "{name}");
    }
}

/// A map with a sun, a dark half, and poles that differ.
pub fn map() -> Environment {
    map_of([32, 16], |x, y| {
        let sky = if x < 16 { 0.2 + 0.05 * y as f32 } else { 0.0 };
        let sun = if (x, y) == (21, 4) { 300.0 } else { 0.0 };
        [sky + sun, 0.5 * sky + sun, 0.1 + 0.01 * x as f32]
    })
}

/// A map by the radiance of its texels.
pub fn map_of([width, height]: [u32; 2], texel: impl Fn(u32, u32) -> [f32; 3]) -> Environment {
    let texels = (0..width * height).map(|index| texel(index % width, index / width));
    Environment {
        width,
        height,
        radiance: texels.collect(),
        name: "test".to_owned(),
    }
}

/// Under a map whose radiance is linear in both coordinates, which shows them: `first` in the first texel, in steps of 1.
fn under_ramp(size: [u32; 2], first: f32) -> Scene {
    let texel = |x, y| [x as f32 + first, y as f32 + first, 1.0];
    Scene {
        environment: Some(map_of(size, texel)),
        ..environment_scene()
    }
}

#[test]
fn directions_have_their_map_coordinates() {
    let [width, height] = [64, 32];
    let scene = under_ramp([width, height], 0.0);
    let context = context();
    let probe = LightProbe::new(&context, &["environment"], &scene, DVec3::ZERO);
    // A Fibonacci spiral, and along the axes and diagonals, where the octants meet.
    let count = 100_000;
    let spiral = (0..count).map(|i| {
        let t = (f64::from(i) + 0.5) / f64::from(count);
        direction_of(
            (f64::from(i) * 0.618_033_988_75).fract(),
            (1.0 - 2.0 * t).acos() / PI,
        )
    });
    let corners = (0..27).map(|i| {
        v(
            f64::from(i % 3 - 1),
            f64::from(i / 3 % 3 - 1),
            f64::from(i / 9 - 1),
        )
    });
    let corners = corners
        .filter(|corner| *corner != DVec3::ZERO)
        .map(DVec3::normalize);
    let queries: Vec<LightQuery> = spiral.chain(corners).map(of_environment).collect();
    // 3.3e-7 rad of the polynomial; pi, the quotient, the product and two differences round by 6e-8 of 2 pi at most, in all
    // 2e-6 rad. A texel is 2 pi / 64 or pi / 32 of them; its blend rounds by 6e-8 of 64 at most, four times.
    let texel_rad = PI / f64::from(height);
    let most = 2.4e-6 / texel_rad + 4.0 * 6e-8 * f64::from(width);
    assert!(most < 1e-5 / texel_rad, "1e-5 rad would be seen");
    let mut compared = 0;
    for (query, ([x, y, _], _)) in queries.iter().zip(probe.densities(&queries)) {
        let direction = Vec3::from(query.position).as_dvec3();
        let (u, t) = map_coordinates(direction.normalize());
        let expected = [u * f64::from(width) - 0.5, t * f64::from(height) - 0.5];
        // Between the outermost texels' centres; beyond, it wraps or stays.
        let is_inside = |at: f64, size: u32| (0.0..f64::from(size - 1)).contains(&at);
        if !is_inside(expected[0], width) || !is_inside(expected[1], height) {
            continue;
        }
        compared += 1;
        // Near a pole u hangs on the smaller components' own rounding.
        let reach = direction.x.hypot(direction.z);
        let off = ((x - expected[0]).abs() * reach).max((y - expected[1]).abs());
        assert!(off < most, "{direction}: ({x}, {y}) for {expected:?}");
    }
    assert!(compared > 90_000);
}

/// Direction of map coordinates in [0, 1].
fn direction_of(u: f64, t: f64) -> DVec3 {
    let (theta, phi) = (PI * t, 2.0 * PI * (u - 0.5));
    let (x, z) = (theta.sin() * phi.sin(), -theta.sin() * phi.cos());
    v(x, theta.cos(), z)
}

pub fn map_coordinates(d: DVec3) -> (f64, f64) {
    let u = 0.5 + d.x.atan2(-d.z) / (2.0 * PI);
    (u, d.y.clamp(-1.0, 1.0).acos() / PI)
}

/// Bilinear radiance in f64.
fn map_radiance(map: &Environment, d: DVec3) -> [f64; 3] {
    let (u, t) = map_coordinates(d);
    let x = u * f64::from(map.width) - 0.5;
    let y = t * f64::from(map.height) - 0.5;
    let (left, top) = (x.floor(), y.floor());
    let texel = |column: f64, row: f64| {
        let column = (column as i64).rem_euclid(i64::from(map.width));
        let row = (row as i64).clamp(0, i64::from(map.height) - 1);
        map.radiance[(row * i64::from(map.width) + column) as usize].map(f64::from)
    };
    std::array::from_fn(|c| {
        let (fx, fy) = (x - left, y - top);
        let upper = texel(left, top)[c] * (1.0 - fx) + texel(left + 1.0, top)[c] * fx;
        let lower = texel(left, top + 1.0)[c] * (1.0 - fx) + texel(left + 1.0, top + 1.0)[c] * fx;
        upper * (1.0 - fy) + lower * fy
    })
}

pub fn environment_scene() -> Scene {
    Scene {
        environment: Some(map()),
        ..ceiling(glowing([0.0; 3]), DAffine3::IDENTITY)
    }
}

/// Probability of each cell of the map, recomputed by fine quadrature of the bilinear radiance over the cell.
pub fn cell_probabilities(map: &Environment) -> Vec<f64> {
    let mut weights = Vec::new();
    let fine = 8;
    for row in 0..map.height {
        let edge = |r: u32| (PI * f64::from(r) / f64::from(map.height)).cos();
        let solid_angle = 2.0 * PI / f64::from(map.width) * (edge(row) - edge(row + 1));
        for column in 0..map.width {
            let mut mean = 0.0;
            for sub in 0..fine * fine {
                let at = |first: u32, part: u32, count: u32| {
                    let part = (f64::from(part) + 0.5) / f64::from(fine);
                    (f64::from(first) + part) / f64::from(count)
                };
                let u = at(column, sub % fine, map.width);
                let d = direction_of(u, at(row, sub / fine, map.height));
                mean += map_radiance(map, d).iter().sum::<f64>() / 3.0;
            }
            weights.push(mean / f64::from(fine * fine) * solid_angle);
        }
    }
    let total: f64 = weights.iter().sum();
    weights.iter().map(|w| w / total).collect()
}

#[test]
fn environment_is_sampled_by_its_cells_and_oriented_as_designed() {
    let context = context();
    let scene = environment_scene();
    let map = map();
    let probe = LightProbe::new(&context, &["environment"], &scene, DVec3::ZERO);
    let samples = probe.towards(DVec3::ZERO, DRAWS, 1);
    let probabilities = cell_probabilities(&map);
    let mut observed = vec![0.0; probabilities.len()];
    let mut places = Vec::new();
    for sample in &samples {
        let (u, t) = map_coordinates(sample.direction);
        let (x, y) = (u * f64::from(map.width), t * f64::from(map.height));
        let column = (x as u32).min(map.width - 1);
        let row = (y as u32).min(map.height - 1);
        observed[(row * map.width + column) as usize] += 1.0;
        // Place within the cell, uniform in longitude and in the cosine of the polar angle.
        let edge = |r: u32| (PI * f64::from(r) / f64::from(map.height)).cos();
        let height = (edge(row) - sample.direction.y) / (edge(row) - edge(row + 1));
        places.push((x - f64::from(column), height));
    }
    let expected = probabilities.iter().map(|p| p * samples.len() as f64);
    let counts: Vec<(f64, f64)> = expected.zip(observed.iter().copied()).collect();
    let level = sidak(LEVEL, 2);
    let p = p_value_of_counts(&counts);
    assert!(p > level, "cells: p = {p:e}");
    let sampled = Sampled::in_square(&places, places.len(), &places[..20_000]);
    let p = p_value(&sampled, &|_, _| 1.0);
    assert!(p > level, "within cells: p = {p:e}");
    // Rows that are not weighed by their solid angle would be another distribution.
    let unweighed = |(i, c): (usize, &(f64, f64))| c.0 / row_sine(i, &map);
    let total: f64 = counts.iter().enumerate().map(unweighed).sum();
    let flat = counts.iter().enumerate().map(unweighed);
    let flat = flat.map(|weight| weight / total * samples.len() as f64);
    let wrong: Vec<(f64, f64)> = flat.zip(observed).collect();
    assert!(p_value_of_counts(&wrong) < 1e-9);

    // Radiance and density as environment_radiance and environment_pdf see them.
    let queries = samples[..4000].iter().map(|s| of_environment(s.direction));
    let queries: Vec<LightQuery> = queries.collect();
    let mut agreeing = 0;
    for ((radiance, pdf), sample) in probe.densities(&queries).iter().zip(&samples) {
        let due = map_radiance(&map, sample.direction);
        // atan2 in f32 is good to about 1e-6 rad; a step of 300 between texels 0.1 rad apart makes 3e-3 of it.
        let is_near = |c: usize| (radiance[c] - due[c]).abs() < 1e-3 * due[c] + 1e-2;
        assert!((0..3).all(is_near), "{radiance:?}, {due:?} is due");
        assert_eq!(*radiance, sample.radiance);
        // A sample on a cell's border may be looked up next door.
        agreeing += u32::from((pdf / sample.pdf - 1.0).abs() < 1e-4);
    }
    assert!(agreeing > 3980, "{agreeing} of 4000 densities agree");
    // The mean of 1 / pdf is the whole sphere: every cell has some light.
    let (mean, error) = mean_and_error(samples.iter().map(|s| 1.0 / s.pdf));
    assert!((mean - 4.0 * PI).abs() < 4.5 * error, "{mean} +- {error}");
}

/// What the environment shows in a direction, and its density.
fn of_environment(direction: DVec3) -> LightQuery {
    LightQuery {
        instance: u32::MAX,
        position: direction.as_vec3().to_array(),
        ..LightQuery::default()
    }
}

fn row_sine(index: usize, map: &Environment) -> f64 {
    let row = index as u32 / map.width;
    (PI * (f64::from(row) + 0.5) / f64::from(map.height)).sin()
}

#[test]
fn environment_axes_are_those_of_the_design() {
    let context = context();
    let scene = under_ramp([64, 32], 0.5);
    let probe = LightProbe::new(&context, &["environment"], &scene, DVec3::ZERO);
    let [column, row] = [0, 1];
    for (direction, axis, due) in [
        (DVec3::NEG_Z, column, 32.0),
        // At three quarters.
        (DVec3::X, column, 48.0),
        (DVec3::NEG_X, column, 16.0),
        // The seam blends the first and the last column.
        (DVec3::Z, column, 32.0),
        // The top row is clamped at the pole.
        (DVec3::Y, row, 0.5),
        (DVec3::NEG_Y, row, 31.5),
        (DVec3::X, row, 16.0),
    ] {
        let found = probe.densities(&[of_environment(direction)])[0].0[axis];
        assert!(
            (found - due).abs() < 1e-3,
            "{direction}: {found}, not {due}"
        );
    }
}
