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
    /// Something else is played than it was made for.
    is_told: bool,
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
            is_told: false,
        }))
    }

    /// The pose of a frame that is shown at `display_time_ns`; the first one asked for begins the clip. A function of
    /// the differences of display times alone, so that a replay shows the same.
    pub fn pose_at(&mut self, display_time_ns: i64) -> ScenePose {
        self.last_ns = Some(display_time_ns);
        self.first_ns.get_or_insert(display_time_ns);
        let time_s = self.clip_s(display_time_ns);
        self.skeleton.pose_at(&self.clip, time_s)
    }

    /// Goes on where another player stands; with its clip, speed and time too, where they were set since it was made.
    pub fn take_over(&mut self, before: &Self) {
        (self.first_ns, self.last_ns) = (before.first_ns, before.last_ns);
        if before.is_told {
            self.clip.clone_from(&before.clip);
            (self.speed, self.start_s, self.is_told) = (before.speed, before.start_s, true);
        }
    }

    /// Plays a clip `speed` times as fast, with `time_s` in the frame that is shown at `display_time_ns`. Speed 0 stands there.
    pub fn play(&mut self, clip: &Animation, speed: f64, time_s: f64, display_time_ns: i64) {
        self.clip.clone_from(clip);
        (self.speed, self.start_s, self.is_told) = (speed, time_s, true);
        self.first_ns = Some(display_time_ns);
    }

    /// Where in the clip a frame is, seconds.
    fn clip_s(&self, display_time_ns: i64) -> f64 {
        let first = self.first_ns.unwrap_or(display_time_ns);
        let elapsed_s = display_time_ns.wrapping_sub(first) as f64 * 1e-9;
        self.start_s + self.speed * elapsed_s
    }

    /// Name of the clip, and where in it the pose is that was asked for last, seconds; `None` before the first.
    #[must_use]
    pub fn clip(&self) -> Option<(&str, f64)> {
        let time_ns = self.last_ns?;
        Some((&self.clip.name, self.clip_s(time_ns)))
    }

    /// The pose that was asked for last; `None` before the first.
    pub fn last_pose(&mut self) -> Option<ScenePose> {
        self.last_ns.map(|time_ns| self.pose_at(time_ns))
    }

    /// Goes on with the nodes of an edited scene. What the clip drives it goes on to drive, unless the clip went with the part that
    /// it came with: other nodes may have their numbers then.
    pub fn follow(&mut self, scene: &Scene) {
        self.skeleton.nodes.clone_from(&scene.nodes);
        self.skeleton.roots.clone_from(&scene.roots);
        if !scene.animations.contains(&self.clip) {
            self.clip.nodes.clear();
        }
    }
}
