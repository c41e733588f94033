//! A renderer that takes another one's place: where a scene needs shaders, textures or maps that the present one was not made
//! with. It is made on another thread while frames go on; the application says from which frame on it is the one.

use super::{RenderError, Renderer, shader_features};
use crate::gpu::{GpuContext, ShaderFeatures, ShaderLibrary};
use crate::scene::{Needs, Player, Scene};
use crate::settings::{Eyes, RenderSettings};
use crate::xr::HiddenArea;

/// All that a renderer is made with but its scene.
#[derive(Clone)]
pub(super) struct MadeWith {
    pub(super) context: GpuContext,
    pub(super) settings: RenderSettings,
    pub(super) eyes: Eyes,
    pub(super) size: [u32; 2],
    pub(super) hidden: Option<[HiddenArea; 2]>,
}

/// All that a renderer was made with but its scene, and what its shaders can show. Can be sent to a thread.
#[derive(Clone)]
pub struct Rebuild {
    made_with: MadeWith,
    needs: Needs,
    features: ShaderFeatures,
}

impl Rebuild {
    /// A renderer like the one that was asked, for another scene; on the same device, which goes on with other work.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn build(&self, library: &ShaderLibrary, scene: &Scene) -> Result<Renderer, RenderError> {
        Renderer::made(self.made_with.clone(), library, scene, None)
    }

    /// As [`Rebuild::build`], to take a part of these needs in place later ([`Renderer::add_part`]).
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn build_for(
        &self,
        library: &ShaderLibrary,
        scene: &Scene,
        part: &Needs,
    ) -> Result<Renderer, RenderError> {
        Renderer::made(self.made_with.clone(), library, scene, Some(part))
    }

    /// Whether a part of these needs can come into the scene shown without other shaders.
    #[must_use]
    pub fn can_show(&self, part: &Needs) -> bool {
        let both = shader_features(&self.needs.widened_by(part), &self.made_with.settings);
        both.without(self.features) == ShaderFeatures::default()
    }
}

impl Renderer {
    /// What another renderer is to be made with that takes this one's place.
    #[must_use]
    pub fn rebuild(&self) -> Rebuild {
        Rebuild {
            made_with: MadeWith {
                context: self.context.for_another_thread(),
                settings: self.settings_at_start(),
                eyes: self.eye_choice,
                size: self.full_size,
                hidden: self.hidden.as_ref().map(|hidden| hidden.areas.clone()),
            },
            needs: self.edit_base.needs.clone(),
            features: *self.features(),
        }
    }

    /// Goes on as `successor` from the next frame on: with its scene, shaders, textures and photon maps, at this one's size,
    /// quality and time of the clip. What this one was told of the scene since the other was made is to be told again
    /// ([`Renderer::apply_scene`]), and parts that the other was made with stay until the next rebuild. The next frame is
    /// a new renderer's: it waits for its photons, and reconstruction begins anew. Frames on their way may be
    /// retired as ever.
    ///
    /// # Errors
    /// As [`Renderer::resize`], if the size has changed meanwhile; this one then stays.
    pub fn succeed_by(&mut self, mut successor: Self) -> Result<(), RenderError> {
        successor.resize(self.full_size)?;
        let quality = self.quality();
        successor.quality.wanted = Some(quality);
        successor.reuse_from_now_on(quality.reuse);
        successor.frames_begun = self.frames_begun;
        successor.frames_before = self.frames_begun;
        match (&mut successor.player, self.player.take()) {
            (Some(player), Some(before)) => player.take_over(&before),
            // None is played that was not, and one that was though none was to be at the start.
            (player, before) => *player = before,
        }
        successor.take_pose();
        *self = successor;
        Ok(())
    }

    /// A clip that goes on in another renderer drives the nodes of this scene, which that one was made of.
    pub(crate) fn follow(&mut self, scene: &Scene) {
        if let Some(player) = &mut self.player {
            player.follow(scene);
        }
        self.take_pose();
    }

    fn take_pose(&mut self) {
        if let Some(pose) = self.player.as_mut().and_then(Player::last_pose) {
            self.scene.set_pose(&pose);
        }
    }
}
