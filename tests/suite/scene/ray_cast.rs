//! Rays that the host casts: against what the device sees, and against every triangle of what moves, bends and is hidden.

use glam::{DAffine3, DVec3};
use stereolux::gpu::ShaderLibrary;
use stereolux::renderer::{Eye, RayHit, Renderer};
use stereolux::scene::edit::Edit;
use stereolux::scene::{Scene, ScenePose};
use stereolux::settings::{Method, Reuse};

use super::support::{
    builtin, frame, meet, method, parallel_views, pixel_ray, renderer, square_fov,
};
use super::trace_probe::Random;

const SIZE: [u32; 2] = [48, 48];

fn small(scene: &Scene) -> Renderer {
    renderer(scene, &method(Method::Path, Reuse::Off), SIZE)
}

/// Pixels whose cast ray meets something else than the device's primary ray did, and pixels that see a surface.
fn other_pixels(scene: &Scene, renderer: &mut Renderer) -> (usize, usize) {
    let views = parallel_views(scene.start_pose(), 0.06, square_fov(35.0));
    frame(renderer, &views);
    let library = ShaderLibrary::embedded();
    let seen = renderer.inspect_surfaces(&library, Eye::Left).unwrap();
    let (mut others, mut surfaces, mut renamed) = (0, 0, 0);
    for (pixel, seen) in seen.iter().enumerate() {
        let ray = pixel_ray(&views[0], pixel, SIZE);
        let hit = renderer.cast_ray(ray.origin, ray.direction, f64::INFINITY);
        let (Some(hit), Some(instance)) = (hit, seen.instance) else {
            others += usize::from(hit.is_some() || seen.instance.is_some());
            continue;
        };
        surfaces += 1;
        let triangles = &renderer.scene().hierarchies().triangle_vertices;
        let normal: DVec3 = glam::Vec3::from(seen.geometric_normal_in_world).as_dvec3();
        let is_same = hit.instance == instance
            && hit.node == seen.node.map(|node| node as usize)
            && hit.is_front == seen.is_front
            // The device's normal is packed; its distance has some tens of roundings of f32.
            && hit.normal_in_world.distance(normal) < 1e-3
            && (hit.distance_m / f64::from(seen.distance_m) - 1.0).abs() < 1e-4;
        // On a border f32 and f64 may each choose a side.
        let least = hit.barycentrics.iter().copied().fold(1.0, f64::min);
        others += usize::from(!is_same && least > 1e-3);
        renamed += usize::from(hit.triangle != triangles[seen.triangle as usize][3]);
    }
    // Borders, and where a mesh's triangles overlap in one plane.
    assert!(renamed * 50 < surfaces, "{renamed} other triangles");
    (others, surfaces)
}

#[test]
fn the_host_meets_what_the_device_sees() {
    for name in ["gallery", "parade"] {
        let scene = builtin(name);
        let mut renderer = small(&scene);
        let (others, surfaces) = other_pixels(&scene, &mut renderer);
        assert!(surfaces > 1000, "{name}: {surfaces} pixels see a surface");
        assert_eq!(others, 0, "{name}");
    }
}

/// Node, triangle and distance of everything along a ray, as a pose has it, nearest first.
fn searched(
    scene: &Scene,
    pose: &ScenePose,
    origin: DVec3,
    direction: DVec3,
) -> Vec<(usize, u32, f64)> {
    let mut met = Vec::new();
    for placed in scene.instances() {
        let mesh = &scene.meshes[placed.mesh];
        let positions = scene.positions_in_world(placed.node, mesh, pose);
        for (number, triangle) in (0..).zip(&mesh.triangles) {
            let corners = triangle.vertices.map(|vertex| positions[vertex as usize]);
            if let Some((t, _)) = meet(origin, direction, corners)
                && t > 0.0
            {
                met.push((placed.node, number, t));
            }
        }
    }
    met.sort_by(|a, b| a.2.total_cmp(&b.2));
    met
}

fn is_same(hit: Option<RayHit>, wanted: &[(usize, u32, f64)]) -> bool {
    // Both are f64, at some metres: a plane that is met at a slant of 1e-3 leaves 1e-11 m. Of what stands on the floor either
    // may be named.
    const ROUNDING_M: f64 = 1e-11;
    let Some(hit) = hit else {
        return wanted.is_empty();
    };
    let near = |t: f64| (hit.distance_m - t).abs() < ROUNDING_M;
    let is_it = |(node, triangle, t): &(usize, u32, f64)| {
        near(*t) && (hit.node, hit.triangle) == (Some(*node), *triangle)
    };
    wanted.first().is_some_and(|(.., t)| near(*t)) && wanted.iter().any(is_it)
}

/// No frame is rendered in between: what the renderer has been told of counts.
#[test]
fn what_bends_is_met_as_it_is_bent_now() {
    let scene = builtin("parade");
    let mut renderer = small(&scene);
    let clip = scene.clip("parade").unwrap().unwrap();
    let mut bent = scene.instances();
    bent.retain(|instance| scene.deforms(instance.node));
    let mut random = Random(5);
    let (mut met, mut stale) = (0, 0);
    for step in 0..4 {
        let pose = scene.pose_at(clip, 0.4 + 0.63 * f64::from(step));
        renderer.set_pose(&pose);
        for _ in 0..150 {
            let at = bent[random.below(bent.len())];
            let positions = scene.positions_in_world(at.node, &scene.meshes[at.mesh], &pose);
            let target = positions[random.below(positions.len())] + 0.02 * random.vector();
            let origin = target + 3.0 * random.direction();
            let direction = (target - origin).normalize();
            let hit = renderer.cast_ray(origin, direction, 1e3);
            let wanted = searched(&scene, &pose, origin, direction);
            assert!(is_same(hit, &wanted), "{hit:?} {:?}", wanted.first());
            met += usize::from(hit.is_some_and(|hit| scene.deforms(hit.node.unwrap())));
            let rest = searched(&scene, &scene.rest_pose(), origin, direction);
            stale += usize::from(!is_same(hit, &rest));
        }
    }
    assert!(met > 30, "{met} rays meet what bends");
    // Negative control: the rest pose is told apart.
    assert!(stale > 30, "{stale}");
}

#[test]
fn what_is_hidden_or_gone_is_not_met() {
    let mut scene = builtin("cornell");
    let mut renderer = small(&scene);
    let pose = scene.start_pose();
    let cast = |renderer: &Renderer| {
        let forward = pose.orientation * DVec3::NEG_Z;
        renderer.cast_ray(pose.position, 3.0 * forward, f64::INFINITY)
    };
    let first = cast(&renderer).unwrap();
    let node = first.node.unwrap();
    assert!(first.normal_in_world.dot(pose.orientation * DVec3::Z) > 0.0);
    let hide = |is_hidden| Edit::Visibility { node, is_hidden };
    hide(true).apply(&mut scene).unwrap();
    renderer.apply_scene(&scene).unwrap();
    let behind = cast(&renderer);
    assert!(behind.is_none_or(|hit| hit.node != Some(node) && hit.distance_m > first.distance_m));
    hide(false).apply(&mut scene).unwrap();
    renderer.apply_scene(&scene).unwrap();
    assert_eq!(cast(&renderer), Some(first));
    // An instance of the application's own stands before it, and goes.
    let mesh = scene.nodes[node].mesh.unwrap();
    let at = renderer.scene().placement(first.instance).unwrap();
    let nearer = DAffine3::from_translation(pose.orientation * DVec3::Z * 0.25) * at;
    let own = renderer.add_instance(mesh, nearer).unwrap();
    let hit = cast(&renderer).unwrap();
    assert_eq!((hit.instance, hit.node), (own, None));
    assert!((hit.distance_m - (first.distance_m - 0.25)).abs() < 1e-12);
    assert!(renderer.remove_instance(own));
    assert_eq!(cast(&renderer), Some(first));
    // Rays that are none.
    for direction in [DVec3::ZERO, DVec3::NAN, DVec3::INFINITY] {
        assert_eq!(renderer.cast_ray(pose.position, direction, 1.0), None);
    }
    assert_eq!(renderer.cast_ray(DVec3::NAN, DVec3::X, 1.0), None);
    assert_eq!(renderer.cast_ray(pose.position, DVec3::X, f64::NAN), None);
}
