//! Instances that move between the rounds of a variant.

use std::time::Instant;

use glam::DAffine3;

use crate::bvh::{MaterialMarks, MeshHierarchies};
use crate::gpu::timing::milliseconds_since;
use crate::renderer::{InstanceId, RenderError, Renderer};
use crate::scene::Scene;

/// What moves does so by this much per round, metres: the host and the device do a moving scene's work, the picture stays.
const STEP_M: f64 = 1e-6;

/// What of the scene moves between rounds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum InstanceMotion {
    /// Nothing.
    #[default]
    Nothing,
    /// The last instance.
    One,
    /// The last instance, and the host builds all hierarchies anew for it: what it would take without two levels. Only
    /// the host's building is done twice; nothing more is uploaded.
    OneRebuilt,
    /// Every instance of the last one's mesh.
    All,
}

/// Moves instances of one scene.
pub struct InstanceMover {
    moving: Vec<(usize, DAffine3)>,
    rebuilds: bool,
}

impl InstanceMover {
    /// What `motion` names of `scene`.
    #[must_use]
    pub fn new(scene: &Scene, motion: InstanceMotion) -> Self {
        let instances = scene.instances();
        let last = instances.last().copied();
        let moving = instances
            .iter()
            .enumerate()
            .filter(|(index, placed)| match motion {
                InstanceMotion::Nothing => false,
                InstanceMotion::One | InstanceMotion::OneRebuilt => index + 1 == instances.len(),
                InstanceMotion::All => last.is_some_and(|last| last.mesh == placed.mesh),
            })
            .map(|(_, placed)| (placed.node, placed.world_from_object))
            .collect();
        Self {
            moving,
            rebuilds: motion == InstanceMotion::OneRebuilt,
        }
    }

    /// Moves everything to where round `index` has it; returns the host's milliseconds.
    ///
    /// # Errors
    /// Geometry that no hierarchy can hold.
    pub fn step(
        &self,
        renderer: &mut Renderer,
        scene: &Scene,
        index: u32,
    ) -> Result<f64, RenderError> {
        let began = Instant::now();
        for (node, world_from_object) in &self.moving {
            let id: Option<InstanceId> = renderer.scene().instance_of_node(*node);
            let mut at = *world_from_object;
            at.translation.x += STEP_M * f64::from(index + 1);
            if let Some(id) = id {
                renderer.set_instance_transform(id, at);
            }
        }
        if self.rebuilds {
            let marks: Vec<MaterialMarks> =
                scene.materials.iter().map(MaterialMarks::from).collect();
            std::hint::black_box(MeshHierarchies::build(&scene.meshes, &marks)?);
        }
        Ok(milliseconds_since(began))
    }
}

#[cfg(test)]
mod tests {
    use super::super::scenes::Generated;
    use super::*;

    #[test]
    fn the_boxes_of_a_generated_room_move() {
        let made = Generated {
            boxes: 5,
            ..Generated::default()
        };
        let scene = made.scene();
        let count = |motion| InstanceMover::new(&scene, motion).moving.len();
        assert_eq!(
            [
                InstanceMotion::Nothing,
                InstanceMotion::One,
                InstanceMotion::OneRebuilt,
                InstanceMotion::All
            ]
            .map(count),
            [0, 1, 1, 5]
        );
        let boxes = InstanceMover::new(&scene, InstanceMotion::All);
        let names = boxes
            .moving
            .iter()
            .map(|(node, _)| &scene.nodes[*node].name);
        assert!(names.into_iter().all(|name| name == "box"));
    }
}
