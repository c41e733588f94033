//! Where everything stands at one time.

use glam::DAffine3;

use super::{Animation, Scene};

/// A pose of a scene: what animations change.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ScenePose {
    /// Placement of every node of [`Scene::nodes`]; nodes that the scene does not reach hang on their own root.
    pub world_from_node: Vec<DAffine3>,
    /// Weights of the morph targets of every node's mesh; empty where there are none.
    pub morph_weights: Vec<Vec<f64>>,
}

impl Scene {
    /// The pose in which the file stores its nodes.
    pub fn rest_pose(&self) -> ScenePose {
        self.pose_at(&Animation::default(), 0.0)
    }

    /// Where one node is stored to stand; the identity for one that the scene does not have.
    pub fn world_from_node(&self, node: usize) -> DAffine3 {
        let up = std::iter::successors(self.nodes.get(node), |at| self.nodes.get(at.parent?));
        up.fold(DAffine3::IDENTITY, |below, at| at.parent_from_node * below)
    }

    /// Placements of all nodes from their local transforms, one per node.
    pub fn world_from_nodes(&self, parent_from_node: &[DAffine3]) -> Vec<DAffine3> {
        let mut world = vec![DAffine3::IDENTITY; self.nodes.len()];
        let mut pending: Vec<(usize, DAffine3)> = self
            .nodes
            .iter()
            .enumerate()
            .filter(|(_, node)| node.parent.is_none())
            .map(|(index, _)| (index, DAffine3::IDENTITY))
            .collect();
        while let Some((index, world_from_parent)) = pending.pop() {
            let (Some(node), Some(local)) = (self.nodes.get(index), parent_from_node.get(index))
            else {
                continue;
            };
            let world_from_node = world_from_parent * *local;
            world[index] = world_from_node;
            pending.extend(node.children.iter().map(|child| (*child, world_from_node)));
        }
        world
    }
}
