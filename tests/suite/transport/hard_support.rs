//! Scenes, views and comparators that the hard cases share.

use glam::{DAffine3, DQuat, DVec3};
use stereolux::renderer::Eye;
use stereolux::scene::{Environment, LightKind, Material, Mesh, Node, Scene};
use stereolux::settings::{DirectLight, Method, RenderSettings, Reuse};
use stereolux::xr::view::RayInWorld;
use stereolux::xr::{Pose, View};

use super::lights_probe::add_light;
pub use super::lights_probe::glowing;
use super::lights_sampling::map_of;
use crate::suite::embedded_scenes::plane;
use crate::suite::support::{
    assert_clean, both, mean, method, parallel_views, pixel_ray, rendered, settings, square_fov,
};

pub type Triangle = [DVec3; 3];

/// A mesh with flat normals; triangles without area get +Z.
pub fn mesh(triangles: &[Triangle], material: u32) -> Mesh {
    let normal = |[a, b, c]: &Triangle| (b - a).cross(c - a).normalize_or(DVec3::Z);
    let arrays = |points: Vec<DVec3>| points.iter().map(|p| p.as_vec3().into()).collect();
    let normals = triangles.iter().flat_map(|triangle| [normal(triangle); 3]);
    let corners = (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]);
    let positions = arrays(triangles.as_flattened().to_vec());
    Mesh::plain(positions, arrays(normals.collect()), corners, material)
}

/// Adds triangles of one material as an instance of their own.
pub fn add(scene: &mut Scene, triangles: &[Triangle], material: Material) {
    scene.roots.push(scene.nodes.len());
    scene.nodes.push(Node {
        name: material.name.clone(),
        ..Node::of_mesh(scene.meshes.len())
    });
    let mesh = mesh(triangles, scene.materials.len() as u32);
    scene.meshes.push(mesh);
    scene.materials.push(material);
}

pub fn add_point_light(scene: &mut Scene, position: DVec3, intensity: f32) {
    let place = DAffine3::from_translation(position);
    add_light(scene, LightKind::Point, [intensity; 3], place);
}

/// A sun in the direction `to_sun`, of that irradiance at normal incidence. Lights shine along their -Z.
pub fn add_sun(scene: &mut Scene, to_sun: DVec3, irradiance: f32) {
    let turn = DQuat::from_rotation_arc(DVec3::Z, to_sun.normalize());
    let place = DAffine3::from_quat(turn);
    add_light(scene, LightKind::Directional, [irradiance; 3], place);
}

/// A parallelogram with its front along `u` x `v`.
pub fn quad(corner: DVec3, u: DVec3, v: DVec3) -> Vec<Triangle> {
    vec![
        [corner, corner + u, corner + u + v],
        [corner, corner + u + v, corner + v],
    ]
}

/// The cube from -1 to 1, fronts outside. The last two triangles are the side at y = 1.
pub fn cube() -> Vec<Triangle> {
    let mut all = Vec::new();
    for (n, u, v) in [
        (DVec3::X, DVec3::Y, DVec3::Z),
        (DVec3::Z, DVec3::X, DVec3::Y),
        (DVec3::Y, DVec3::Z, DVec3::X),
    ] {
        all.extend(quad(-n - u - v, 2.0 * v, 2.0 * u));
        all.extend(quad(n - u - v, 2.0 * u, 2.0 * v));
    }
    all
}

pub fn flipped(triangles: Vec<Triangle>) -> Vec<Triangle> {
    triangles.into_iter().map(|[a, b, c]| [a, c, b]).collect()
}

pub fn constant_environment(radiance: [f32; 3]) -> Environment {
    map_of([8, 4], |_, _| radiance)
}

/// Each eye by itself, by paths.
pub fn paths(depth: u32, spp: u32) -> RenderSettings {
    settings(|s| {
        s.method = Method::Path;
        s.reuse = Reuse::Off;
        s.spp = spp;
        s.path.max_depth = depth;
    })
}

/// Photons that come from the lights on their own, gathered as direct light.
pub fn direct_from_map(paths: u32) -> RenderSettings {
    settings(|s| {
        s.reuse = Reuse::Off;
        s.photon.count = paths;
        s.photon.direct = DirectLight::Map;
        s.photon.max_depth = 2;
    })
}

/// Both eyes' images; neither has a NaN, an infinity or a negative value.
pub fn images(
    scene: &Scene,
    settings: &RenderSettings,
    size: [u32; 2],
    views: &[View; 2],
) -> [Vec<[f32; 3]>; 2] {
    let images = both(&rendered(scene, settings, size, views));
    for (image, eye) in images.iter().zip(Eye::ALL) {
        assert_clean(image, &format!("{} {eye:?}", scene.name));
        assert_eq!(image.len(), (size[0] * size[1]) as usize);
    }
    images
}

pub fn eyes_at(position: DVec3, orientation: DQuat, half_degrees: f64) -> [View; 2] {
    let head = Pose::new(position, orientation);
    parallel_views(head, 0.063, square_fov(half_degrees))
}

/// A square of this half edge, `ahead` of the origin, its front towards it.
pub fn square_ahead(half: f64, ahead: f64) -> Vec<Triangle> {
    let edge = 2.0 * half;
    quad(
        DVec3::new(-half, -half, -ahead),
        DVec3::X * edge,
        DVec3::Y * edge,
    )
}

/// Both eyes at one place, looking along -Z.
pub fn looking_ahead(position: DVec3, half_degrees: f64) -> [View; 2] {
    let head = Pose::new(position, DQuat::IDENTITY);
    parallel_views(head, 0.0, square_fov(half_degrees))
}

/// Both eyes at the origin.
pub fn eyes_at_origin(half_degrees: f64) -> [View; 2] {
    eyes_at(DVec3::ZERO, DQuat::IDENTITY, half_degrees)
}

/// Both eyes' images against `builtin:plane` in closed form, by each method.
pub fn check_closed_form(
    scene: &Scene,
    views: &[View; 2],
    size: u32,
    scale: f64,
    tolerance: f64,
    what: &str,
) {
    let radiance = |ray: &RayInWorld| plane_at(ray, scale);
    check_radiance(scene, views, size, tolerance, what, radiance);
}

/// Both eyes' images against the radiance along the rays through pixel centres, by each method.
pub fn check_radiance(
    scene: &Scene,
    views: &[View; 2],
    size: u32,
    tolerance: f64,
    what: &str,
    radiance: impl Fn(&RayInWorld) -> f64,
) {
    for kind in [Method::Photon, Method::Path] {
        let found = images(scene, &method(kind, Reuse::Off), [size; 2], views);
        for (view, image) in views.iter().zip(&found) {
            let off = worst(image, &image_of(view, size, &radiance));
            assert!(off < tolerance, "{what} {kind:?}: {off}");
        }
    }
}

pub fn is_black(image: &[[f32; 3]]) -> bool {
    image.iter().flatten().all(|&channel| channel == 0.0)
}

/// Greatest relative difference between two images; pixels that are 0 in one must be 0 in the other.
pub fn worst(image: &[[f32; 3]], expected: &[[f32; 3]]) -> f64 {
    assert_eq!(image.len(), expected.len());
    image
        .iter()
        .flatten()
        .zip(expected.iter().flatten())
        .map(|(&a, &b)| relative(f64::from(a), f64::from(b)))
        .fold(0.0, f64::max)
}

/// Pixels of which a channel is off by more than `tolerance` of the expected value.
pub fn off_by(found: &[[f32; 3]], expected: &[[f32; 3]], tolerance: f64) -> usize {
    let pairs = found.iter().zip(expected);
    let is_off = |(a, b): &(&[f32; 3], &[f32; 3])| worst(&[**a], &[**b]) > tolerance;
    pairs.filter(is_off).count()
}

pub fn relative(found: f64, expected: f64) -> f64 {
    if found == expected {
        0.0
    } else {
        (found - expected).abs() / expected.abs().max(1e-30)
    }
}

/// Means of square tiles of a square image, row by row.
pub fn tiles(image: &[[f32; 3]], width: usize, edge: usize) -> Vec<f64> {
    let across = width / edge;
    (0..across * across)
        .map(|tile| {
            let corner = tile / across * edge * width + tile % across * edge;
            let pixels: Vec<[f32; 3]> = (0..edge * edge)
                .map(|i| image[corner + i / edge * width + i % edge])
                .collect();
            mean(&pixels)
        })
        .collect()
}

/// Gray image of the radiance along the rays through pixel centres.
fn image_of(view: &View, size: u32, radiance: impl Fn(&RayInWorld) -> f64) -> Vec<[f32; 3]> {
    (0..(size * size) as usize)
        .map(|pixel| [radiance(&pixel_ray(view, pixel, [size, size])) as f32; 3])
        .collect()
}

/// What `builtin:plane` looks like in closed form, pixel centres, black beside the plane; `scale` in metres per metre.
pub fn plane_in_closed_form(view: &View, size: u32, scale: f64) -> Vec<[f32; 3]> {
    image_of(view, size, |ray| plane_at(ray, scale))
}

fn plane_at(ray: &RayInWorld, scale: f64) -> f64 {
    let distance = (-plane::DISTANCE_M * scale - ray.origin.z) / ray.direction.z;
    let point = (ray.origin + ray.direction * distance) / scale;
    let beside = point.x.abs().max(point.y.abs()) > plane::HALF_EDGE_M;
    if distance <= 0.0 || beside {
        0.0
    } else {
        plane::radiance_at(point.x, point.y)
    }
}

/// Some twenty f32 steps from pixel to radiance keep 2e-6, and 3e-5 where a ray meets the plane at a cosine c and the
/// hit's place is off by 1 / c of that: 16 at 85 degrees in both directions. The rest is for a driver's division.
pub const CLOSED_FORM: f64 = 1e-4;
