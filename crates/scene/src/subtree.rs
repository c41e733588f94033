//! A node with what hangs below it.

use glam::DVec3;

use super::{Bounds, Node, Scene, as_dvec3};

impl Scene {
    /// Whether the scene holds a node: not after it or what it hangs on was deleted.
    pub fn reaches(&self, node: usize) -> bool {
        let parent_of = |at: &usize| self.nodes.get(*at)?.parent;
        let top = std::iter::successors(Some(node), parent_of).last();
        top.is_some_and(|top| self.roots.contains(&top))
    }

    /// The box around all meshes at a node and below it, in world space, with lights and empty nodes as points; `None` for
    /// a node that the scene does not hold. Boxes of meshes are turned with their nodes, so it may be larger than needed.
    pub fn bounds_below(&self, node: usize) -> Option<Bounds> {
        if !self.reaches(node) {
            return None;
        }
        let world = self.rest_pose().world_from_node;
        let boxes = (0..).zip(self.subtree(node)).filter(|(_, inside)| *inside);
        let boxes = boxes.flat_map(|(index, _): (usize, _)| {
            let mesh = self.nodes[index]
                .mesh
                .and_then(|mesh| self.meshes.get(mesh));
            let own = mesh.map_or_else(
                || Bounds::of_points([DVec3::ZERO]),
                |mesh| Bounds::of_points(mesh.positions.iter().copied().map(as_dvec3)),
            );
            own.map(|bounds| bounds.transformed(&world[index]))
        });
        Bounds::around(boxes)
    }

    /// Which nodes are `node` or hang below it, by index.
    pub fn subtree(&self, node: usize) -> Vec<bool> {
        reached_from(&self.nodes, vec![node])
    }
}

/// Which nodes are those of `pending`, or below one of them.
pub fn reached_from(nodes: &[Node], mut pending: Vec<usize>) -> Vec<bool> {
    let mut reached = vec![false; nodes.len()];
    while let Some(next) = pending.pop() {
        if let Some(mark) = reached.get_mut(next)
            && !std::mem::replace(mark, true)
        {
            pending.extend(&nodes[next].children);
        }
    }
    reached
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::edit::Edit;

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
