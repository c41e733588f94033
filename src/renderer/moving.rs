//! What an application moves between frames.

use glam::DAffine3;

use super::{InstanceId, RenderError, Renderer};
use crate::scene::ScenePose;

impl Renderer {
    /// Takes the scene to where its animation has it when a frame is shown (`animation.*`); the first call begins the
    /// clip. Does nothing without one.
    pub fn animate(&mut self, display_time_ns: i64) {
        if let Some(player) = &mut self.player {
            let pose = player.pose_at(display_time_ns);
            self.scene.set_pose(&pose);
        }
    }

    /// Shows the scene in another pose from the next frame on: instances and lights of nodes go where it has them. Work
    /// in proportion to nodes and what moves of them; no mesh is touched.
    pub fn set_pose(&mut self, pose: &ScenePose) {
        self.scene.set_pose(pose);
    }

    /// Moves an instance, from the next frame on; false if there is none of that number, or it stands there already.
    pub fn set_instance_transform(&mut self, id: InstanceId, world_from_object: DAffine3) -> bool {
        self.scene.place_instance(id, world_from_object)
    }

    /// Adds an instance of mesh number `mesh` of the scene. It keeps its number until it is removed.
    ///
    /// # Errors
    /// [`RenderError::Settings`]: no such mesh.
    pub fn add_instance(
        &mut self,
        mesh: usize,
        world_from_object: DAffine3,
    ) -> Result<InstanceId, RenderError> {
        self.scene.add_instance(mesh, world_from_object)
    }

    /// Takes an instance out of the scene; false if there is none of that number.
    pub fn remove_instance(&mut self, id: InstanceId) -> bool {
        self.scene.remove_instance(id)
    }

    /// Whether anything of the scene, the head aside, moved between the last frame and the one before it.
    pub fn scene_moved(&self) -> bool {
        self.scene.scene_moved()
    }
}
