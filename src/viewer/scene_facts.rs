//! What the window asks of a scene.

use crate::scene::{Bounds, Scene};

impl Scene {
    /// Whether the scene holds a node: not after it or what it hangs on was deleted.
    pub fn reaches(&self, node: usize) -> bool {
        let mut at = node;
        // A tree is no deeper than it has nodes.
        for _ in 0..self.nodes.len() {
            let Some(found) = self.nodes.get(at) else {
                return false;
            };
            match found.parent {
                Some(parent) => {
                    let holds = self
                        .nodes
                        .get(parent)
                        .is_some_and(|p| p.children.contains(&at));
                    if !holds {
                        return false;
                    }
                    at = parent;
                }
                None => return self.roots.contains(&at),
            }
        }
        false
    }

    /// The box around all meshes at a node and below it, in world space, with lights and empty nodes as points; `None` for
    /// a node that the scene does not hold. Boxes of meshes are turned with their nodes, so it may be larger than needed.
    pub fn bounds_below(&self, node: usize) -> Option<Bounds> {
        if !self.reaches(node) {
            return None;
        }
        let world = self.rest_pose().world_from_node;
        let mut points = Vec::new();
        let mut pending = vec![node];
        while let Some(index) = pending.pop() {
            let found = &self.nodes[index];
            pending.extend(&found.children);
            match found.mesh.and_then(|mesh| self.meshes.get(mesh)) {
                Some(mesh) => {
                    let positions = mesh
                        .positions
                        .iter()
                        .map(|p| glam::Vec3::from(*p).as_dvec3());
                    if let Some(Bounds { min, max }) = Bounds::of_points(positions) {
                        points.extend((0..8).map(|corner| {
                            let pick = |axis: usize| {
                                if corner >> axis & 1 == 0 {
                                    min[axis]
                                } else {
                                    max[axis]
                                }
                            };
                            let corner = glam::DVec3::new(pick(0), pick(1), pick(2));
                            world[index].transform_point3(corner)
                        }));
                    }
                }
                None => points.push(world[index].translation),
            }
        }
        Bounds::of_points(points)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::edit::Edit;

    #[test]
    fn boxes_lie_around_what_is_below() {
        let scene = Scene::builtin("cornell").unwrap();
        let all = scene.bounds_in_world().unwrap();
        for root in scene
            .roots
            .iter()
            .filter(|root| scene.nodes[**root].mesh.is_some())
        {
            let own = scene.bounds_below(*root).unwrap();
            // A box of f32 corners in f64: nothing is rounded beyond the transforms.
            assert!((own.min - all.min).min_element() > -1e-9, "{own:?}");
            assert!((all.max - own.max).min_element() > -1e-9, "{own:?}");
        }
        // A camera is a point, wherever it stands.
        let camera = scene.nodes.iter().position(|node| node.camera.is_some());
        let point = scene.bounds_below(camera.unwrap()).unwrap();
        assert_eq!(point.min, point.max);
        assert!(scene.bounds_below(10_000).is_none());
    }

    #[test]
    fn what_is_deleted_is_not_reached() {
        let mut scene = Scene::builtin("gallery").unwrap();
        let node = scene.roots[0];
        assert!(scene.reaches(node));
        Edit::Delete { node }.apply(&mut scene).unwrap();
        assert!(!scene.reaches(node));
        assert!(!scene.reaches(usize::MAX));
        assert!(scene.bounds_below(node).is_none());
    }
}
