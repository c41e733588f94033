//! The runtime's own models of the controllers.

use glam::DAffine3;

use crate::app::world::World;
use crate::app::{AppError, PartLoading};
use crate::scene::{Scene, ScenePart};
use crate::xr::{ControllerModel, Side};

/// Frames from a model's arrival to its picture; a thread has that long to load it, and then it is waited for. Counted in
/// frames, so that a replay has the same.
const LEAD_FRAMES: u32 = 60;

/// One model is loaded at a time: two that come in one frame would have the renderer made anew.
#[derive(Default)]
pub(super) struct Models {
    /// Left, right.
    pub(super) shown: [Option<ScenePart>; 2],
    coming: Option<Coming>,
}

struct Coming {
    side: Side,
    loading: PartLoading,
    frames_left: u32,
}

fn name(side: Side) -> String {
    format!("the runtime's model of the {} controller", side.word())
}

/// A model as a scene; its parts stay where they are.
fn read(side: Side, glb: &[u8]) -> Result<Scene, AppError> {
    let mut scene = Scene::self_contained(&name(side), glb)?;
    if scene.triangle_count() == 0 {
        return Err("it has no triangles".into());
    }
    for warning in &scene.warnings {
        log::warn!("{}: {warning}", name(side));
    }
    scene.animations.clear();
    Ok(scene)
}

impl World<'_> {
    /// Whether a session may give a model.
    pub(in crate::app) fn takes_model(&mut self) -> bool {
        let hands = self.kept.hands.as_mut();
        hands.is_some_and(|hands| hands.is_shown && hands.models.coming.is_none())
    }

    /// Begins to load a model.
    pub(in crate::app) fn take_model(&mut self, ControllerModel { side, glb }: ControllerModel) {
        let loading = self.make_part(move || read(side, &glb));
        if let Some(hands) = self.kept.hands.as_mut() {
            hands.models.coming = Some(Coming {
                side,
                loading,
                frames_left: LEAD_FRAMES,
            });
        }
    }

    /// Counts a frame, and adds the model whose time has come. Where it cannot be shown, a warning says so.
    pub(super) fn bring_model(&mut self) {
        let is_due = |coming: &mut Coming| {
            coming.frames_left = coming.frames_left.saturating_sub(1);
            coming.frames_left == 0
        };
        let hands = self.kept.hands.as_mut();
        let Some(Coming { side, loading, .. }) =
            hands.and_then(|hands| hands.models.coming.take_if(is_due))
        else {
            return;
        };
        match self.add_part(loading, &name(side), DAffine3::IDENTITY) {
            Ok(part) => {
                if let Some(hands) = self.kept.hands.as_mut() {
                    hands.models.shown[side as usize] = Some(part);
                }
            }
            Err(error) => log::warn!("{} cannot be shown, a plain one is: {error}", name(side)),
        }
    }
}
