//! Plays a clip by the display times of frames.

use super::{Animation, Scene, SceneError, ScenePose};

/// A clip, and when it began.
#[derive(Clone, Debug)]
pub struct Player {
    /// Nodes alone.
    skeleton: Scene,
    clip: Animation,
    speed: f64,
    start_s: f64,
    first_ns: Option<i64>,
    last_ns: Option<i64>,
}

impl Player {
    /// Plays the clip that `wanted` names ([`Scene::clip`]), `speed` times as fast, from `start_s` on; `None` if there
    /// is nothing to play.
    ///
    /// # Errors
    /// As [`Scene::clip`].
    pub fn new(
        scene: &Scene,
        wanted: &str,
        speed: f64,
        start_s: f64,
    ) -> Result<Option<Self>, SceneError> {
        Ok(scene.clip(wanted)?.map(|clip| Self {
            skeleton: Scene {
                nodes: scene.nodes.clone(),
                roots: scene.roots.clone(),
                ..Scene::default()
            },
            clip: clip.clone(),
            speed,
            start_s,
            first_ns: None,
            last_ns: None,
        }))
    }

    /// The pose of a frame that is shown at `display_time_ns`; the first one asked for begins the clip. A function of
    /// the differences of display times alone, so that a replay shows the same.
    pub fn pose_at(&mut self, display_time_ns: i64) -> ScenePose {
        self.last_ns = Some(display_time_ns);
        let first = *self.first_ns.get_or_insert(display_time_ns);
        let elapsed_s = display_time_ns.wrapping_sub(first) as f64 * 1e-9;
        self.skeleton
            .pose_at(&self.clip, self.start_s + self.speed * elapsed_s)
    }

    /// Goes on where another player stands.
    pub fn take_over_clock(&mut self, before: &Self) {
        (self.first_ns, self.last_ns) = (before.first_ns, before.last_ns);
    }

    /// The pose that was asked for last; `None` before the first.
    pub fn last_pose(&mut self) -> Option<ScenePose> {
        self.last_ns.map(|time_ns| self.pose_at(time_ns))
    }

    /// Goes on with the nodes of an edited scene. What the clip drives it goes on to drive.
    pub fn follow(&mut self, scene: &Scene) {
        self.skeleton.nodes.clone_from(&scene.nodes);
        self.skeleton.roots.clone_from(&scene.roots);
        let edited = scene
            .animations
            .iter()
            .find(|clip| clip.name == self.clip.name && clip.nodes.len() == self.clip.nodes.len());
        for (tracks, edited) in self
            .clip
            .nodes
            .iter_mut()
            .zip(edited.into_iter().flat_map(|clip| &clip.nodes))
        {
            if tracks.node == edited.node {
                tracks.rest = edited.rest;
            }
        }
    }
}
