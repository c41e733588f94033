//! What the pointer aims at where the window draws the scene itself, see [`super::sketch`]: no frame shows it yet.

use crate::bvh::cast::{Ray, cast_at_all};
use crate::scene::Scene;
use crate::xr::View;

/// The node whose surface is seen at `at`, from (0, 0) at the top left of the picture to (1, 1), and its distance, metres.
/// The scene is taken as its nodes have it; what a material lets pass is met too.
///
/// Looks at every triangle, some 10 ns each: for a click, not for every movement of the pointer.
pub fn surface_at(scene: &Scene, view: &View, at: [f32; 2]) -> Option<(usize, f64)> {
    let [x, y] = at.map(f64::from);
    let through = view.ray_through_pixel(x, y, 1, 1);
    let mut ray = Ray {
        origin: through.origin,
        direction: through.direction,
        t_max: f64::INFINITY,
    };
    let rest = scene.rest_pose();
    let mut nearest = None;
    for instance in scene.instances() {
        let mesh = &scene.meshes[instance.mesh];
        let in_object = ray.transformed(&instance.world_from_object.inverse());
        let hit = if scene.deforms(instance.node) {
            let positions = scene.deformation(instance.node, &rest).positions(mesh);
            let corners = |vertex: u32| positions[vertex as usize];
            let triangles = mesh.triangles.iter();
            cast_at_all(triangles.map(|t| t.vertices.map(corners)), &in_object)
        } else {
            let triangles = mesh.triangles.iter();
            cast_at_all(triangles.map(|t| mesh.corners(t)), &in_object)
        };
        if let Some(hit) = hit {
            // The next one counts only where it is nearer.
            ray.t_max = hit.t;
            nearest = Some((instance.node, hit.t));
        }
    }
    nearest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::xr::Fov;

    #[test]
    fn the_nearest_surface_along_the_pixels_ray_is_found() {
        // The second one's shapes are skinned and morphed.
        for name in ["cornell", "parade"] {
            let scene = Scene::builtin(name).unwrap();
            let start = scene.start_pose();
            let view = View {
                position_in_world: start.position,
                orientation: start.orientation,
                fov: Fov::from_degrees(-40.0, 45.0, 40.0, -35.0),
            };
            let rest = scene.rest_pose();
            let instances = scene.instances();
            // All triangles in world space.
            let placed = instances.iter().flat_map(|instance| {
                let mesh = &scene.meshes[instance.mesh];
                let positions = scene.positions_in_world(instance.node, mesh, &rest);
                mesh.triangles.iter().map(move |triangle| {
                    let corners = triangle.vertices.map(|vertex| positions[vertex as usize]);
                    (instance.node, corners)
                })
            });
            let (nodes, triangles): (Vec<_>, Vec<_>) = placed.unzip();
            let mut seen = std::collections::HashSet::new();
            for (x, y) in (0..32).flat_map(|y| (0..32).map(move |x| (x, y))) {
                let through =
                    view.ray_through_pixel(f64::from(x) + 0.5, f64::from(y) + 0.5, 32, 32);
                let ray = Ray {
                    origin: through.origin,
                    direction: through.direction,
                    t_max: f64::INFINITY,
                };
                let expected = cast_at_all(triangles.iter().copied(), &ray);
                let expected = expected.map(|hit| (nodes[hit.triangle as usize], hit.t));
                let at = [x, y].map(|edge| (edge as f32 + 0.5) / 32.0);
                let found = surface_at(&scene, &view, at);
                assert_eq!(
                    found.map(|(node, _)| node),
                    expected.map(|(node, _)| node),
                    "{name} {at:?}"
                );
                seen.extend(found.map(|(node, _)| node));
                if let (Some((_, found_m)), Some((_, expected_m))) = (found, expected) {
                    // f64's half unit on metres, some tens of operations, over the cosine of a grazing ray, 1e-3.
                    assert!((found_m - expected_m).abs() < 1e-10, "{name} {at:?}");
                }
            }
            assert!(seen.len() > 3, "{name}: {seen:?}");
        }
    }
}
