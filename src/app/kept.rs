//! What of a world outlives a call of the application, and how it comes to be shown.

use std::collections::BTreeSet;

use glam::DVec3;

use super::hands::Hands;
use super::loading::{Maker, Questions, Successor};
use crate::gpu::ShaderLibrary;
use crate::limits::LoadLimits;
use crate::renderer::{Applied, PreparedPart, RenderError, Renderer};
use crate::scene::{Scene, ScenePart};
use crate::settings::Quality;
use crate::xr::{Actions, Pulse};

/// A part of the scene that comes or goes.
pub(super) enum PartChange {
    Added(Arrival),
    Removed(ScenePart),
}

/// A part that was added.
pub(super) struct Arrival {
    pub(super) part: ScenePart,
    pub(super) prepared: Box<PreparedPart>,
    /// Who takes the renderer's place if that lacks shaders.
    pub(super) successor: Option<Box<Successor>>,
}

/// What of a world outlives a call of the application.
#[derive(Default)]
pub(crate) struct Kept {
    pub(crate) scene: Scene,
    pub(super) actions: Actions,
    /// The scene differs from what the renderer shows.
    pub(super) is_changed: bool,
    /// The scene part that came or went in this frame.
    pub(super) part: Option<PartChange>,
    /// Why the renderer cannot show it.
    pub(super) needs_rebuild: Option<String>,
    /// A part that the renderer cannot show and its successor can.
    pub(super) arrival: Option<Arrival>,
    /// Shaders of all renderers.
    pub(super) library: ShaderLibrary,
    /// What a load may take and reach.
    pub(super) limits: LoadLimits,
    /// What threads that load parts ask for.
    pub(super) asked: Questions,
    /// For parts that began to be loaded before there was a renderer.
    pub(super) first_maker: Option<Maker>,
    /// How often the surroundings were replaced.
    pub(super) surroundings: u32,
    /// The surroundings are others.
    pub(super) has_other_surroundings: bool,
    /// The clip that plays from this frame on: name, speed, where it begins in seconds.
    pub(super) clip: Option<(String, f64, f64)>,
    /// Images of the scene that have other texels now.
    pub(super) repainted: Vec<usize>,
    /// Images that ever were repainted.
    painted: BTreeSet<usize>,
    /// The wearer's hands, once they were asked for.
    pub(super) hands: Option<Hands>,
    #[cfg(feature = "panels")]
    pub(super) panels: Vec<Option<super::panels::Kept>>,
    /// The quality that was set in this frame.
    pub(super) quality: Option<Quality>,
    /// The controllers' vibrations that were asked for.
    pub(crate) pulses: Vec<Pulse>,
    /// How far the wearer is moved.
    pub(crate) moved_m: DVec3,
    pub(crate) is_over: bool,
}

impl Kept {
    pub(crate) fn new(scene: Scene, actions: Actions) -> Self {
        Self {
            scene,
            actions,
            ..Self::default()
        }
    }

    /// Notes a part that came or went; the second in a frame is one too many to be shown in place.
    pub(super) fn note(&mut self, change: Option<PartChange>) {
        self.is_changed = true;
        if self.part.is_some() {
            self.needs_rebuild = Some("several parts came or went in one frame".to_owned());
        }
        self.part = change;
    }

    /// The renderer to come is made from the scene as it is.
    pub(crate) fn settled(&mut self) {
        self.is_changed = false;
        self.part = None;
        self.needs_rebuild = None;
        self.has_other_surroundings = false;
        self.repainted.clear();
    }

    /// Shows what was changed, as far as the renderer can.
    ///
    /// # Errors
    /// As [`Renderer::apply_scene`].
    pub(crate) fn show(
        &mut self,
        renderer: &mut Renderer,
        display_time_ns: i64,
    ) -> Result<(), RenderError> {
        if let Some(quality) = self.quality.take() {
            renderer.set_quality(&quality)?;
        }
        let part = self.part.take();
        // What waits for another renderer is all in the scene.
        if std::mem::take(&mut self.is_changed) && self.needs_rebuild.is_none() {
            let scene = &self.scene;
            let applied = match part {
                None => renderer.apply_scene(scene)?,
                Some(PartChange::Added(arrival)) => {
                    let successor = arrival.successor.as_ref();
                    let applied = if successor.is_some_and(|own| own.is_needed(renderer)) {
                        // Uploaded once, by the renderer that shows it.
                        let why = "the part needs other shaders".to_owned();
                        Applied::NeedsRebuild { why }
                    } else {
                        renderer.add_part(scene, &arrival.part, &arrival.prepared)?
                    };
                    if matches!(applied, Applied::NeedsRebuild { .. }) {
                        self.arrival = Some(arrival);
                    }
                    applied
                }
                Some(PartChange::Removed(part)) => renderer.remove_part(scene, &part)?,
            };
            if let Applied::NeedsRebuild { why } = applied {
                self.needs_rebuild = Some(why);
            }
        }
        if std::mem::take(&mut self.has_other_surroundings) && self.needs_rebuild.is_none() {
            let applied = renderer.replace_surroundings(&self.scene)?;
            if let Applied::NeedsRebuild { why } = applied {
                self.needs_rebuild = Some(why);
            }
        }
        if let Some((clip, speed, time_s)) = self.clip.take() {
            renderer.play_clip(&self.scene, &clip, speed, time_s, display_time_ns)?;
        }
        for image in self.repainted.drain(..) {
            self.painted.insert(image);
            // A panel that was drawn may have been removed since.
            let is_there = image < self.scene.images.len();
            if self.needs_rebuild.is_none() && is_there {
                renderer.repaint_image(&self.scene, image)?;
            }
        }
        Ok(())
    }

    /// Makes the renderer anew where the last frame's changes asked for it.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub(crate) fn rebuild(&mut self, renderer: &mut Renderer) -> Result<(), RenderError> {
        if let Some(why) = self.needs_rebuild.take() {
            log::info!("the renderer is made anew: {why}");
            self.is_changed = false;
            if let Some(arrival) = self.arrival.take()
                && self.make_way(renderer, arrival)?
            {
                return Ok(());
            }
            let successor = renderer.rebuild().build(&self.library, &self.scene)?;
            renderer.succeed_by(successor)?;
            renderer.follow(&self.scene);
        }
        Ok(())
    }

    /// Lets the successor that came with a part take the renderer's place, and tells it what has changed since it was made;
    /// whether it can show all of that.
    fn make_way(
        &self,
        renderer: &mut Renderer,
        Arrival {
            part,
            prepared,
            successor,
        }: Arrival,
    ) -> Result<bool, RenderError> {
        // Other parts that came or went meanwhile may be as large as those before, which nobody would notice.
        let is_of_these = |successor: &Successor| {
            self.scene.parts.split_last() == Some((&part.serial, &successor.parts[..]))
        };
        let Some(successor) = successor.filter(|own| is_of_these(own)) else {
            return Ok(false);
        };
        renderer.succeed_by(successor.renderer)?;
        let scene = &self.scene;
        let is_shown = |applied| matches!(applied, Applied::InPlace(_));
        let has_other_surroundings = successor.surroundings != self.surroundings;
        if !is_shown(renderer.add_part(scene, &part, &prepared)?)
            || has_other_surroundings && !is_shown(renderer.replace_surroundings(scene)?)
        {
            return Ok(false);
        }
        let painted = self.painted.iter().copied();
        for image in painted.filter(|image| *image < scene.images.len()) {
            renderer.repaint_image(scene, image)?;
        }
        Ok(true)
    }
}
