//! Whole scenes that are added to the one shown and taken out again, without a new renderer.
//!
//! What takes time is done beforehand on another thread ([`PartPreparation::prepare`]): hierarchies, packed vertices and
//! textures. [`Renderer::add_part`] then hands them to the device. Everything that was there keeps its place, so that nothing
//! of it is touched; where a buffer is too small, the device copies it to a larger one.

use super::{Applied, PartPreparation, PreparedPart, RenderError, Renderer};
use crate::scene::{Scene, ScenePart};

impl Renderer {
    /// How parts of the scene are to be prepared for this renderer.
    #[must_use]
    pub fn part_preparation(&self) -> PartPreparation {
        let features = self.features();
        PartPreparation {
            has_textures: features.textures,
            has_mips: features.textures && features.mips,
            max_binding_bytes: self.context.max_binding_bytes,
        }
    }

    /// Shows a scene from the next frame on that differs from the one shown by `part`, which [`Scene::add_part`] has just
    /// added, and by what [`Renderer::apply_scene`] takes over. `prepared` was made from what was added.
    ///
    /// The host copies the part's arrays, some 150 bytes per triangle; the rest is an edit. Frames are those of a renderer made
    /// from the scene, as after an edit.
    ///
    /// [`Applied::NeedsRebuild`], with everything as it was: the part needs shaders that are not compiled in (`force.*` brings
    /// them in beforehand), it deforms, or the scene has deforming meshes of which several instances are shown.
    ///
    /// # Errors
    /// As [`Renderer::apply_scene`]; more than the adapter binds. The renderer is as it was.
    pub fn add_part(
        &mut self,
        scene: &Scene,
        part: &ScenePart,
        prepared: &PreparedPart,
    ) -> Result<Applied, RenderError> {
        if let Some(why) = self.why_no_part(scene, part, prepared) {
            return Ok(Applied::NeedsRebuild { why });
        }
        let before = self.edit_base.clone();
        match self.scene.add_part(&self.context, scene, part, prepared) {
            Ok(replaced) => self.is_bound &= !replaced,
            Err(error) => {
                self.is_bound = false;
                return Err(error);
            }
        }
        self.edit_base
            .statistics
            .add_part(&prepared.statistics, part);
        self.edit_base.expect(scene);
        let applied = self.apply_scene(scene);
        if !matches!(applied, Ok(Applied::InPlace(_))) {
            self.edit_base = before;
            let meshes = part.meshes.start;
            let replaced = self.scene.remove_part(&self.context, part, meshes)?;
            self.is_bound &= !replaced;
        }
        applied
    }

    fn why_no_part(
        &self,
        scene: &Scene,
        part: &ScenePart,
        prepared: &PreparedPart,
    ) -> Option<String> {
        let meshes = prepared.statistics.meshes.len();
        let follows = part.meshes.start + meshes == scene.meshes.len()
            && self.edit_base.statistics.meshes.len() == part.meshes.start;
        if !follows {
            return Some(
                "the part is not the one thing that was added since the scene was shown".to_owned(),
            );
        }
        if prepared.has_textures != self.features().textures {
            return Some("the part was prepared for other shaders".to_owned());
        }
        if !self.scene.has_meshes(part.meshes.start) {
            return Some("a mesh that deforms is shown more than once".to_owned());
        }
        None
    }

    /// Shows a scene from the next frame on from which [`Scene::remove_part`] has just taken `part`, and gives the memory back
    /// that the part took, on the host and on the device.
    ///
    /// [`Applied::NeedsRebuild`], with everything as it was: the part was not added to this renderer, or what is left has no
    /// light. A map of caustics stays, and is empty if nothing focuses light any more.
    ///
    /// # Errors
    /// As [`Renderer::apply_scene`].
    pub fn remove_part(&mut self, scene: &Scene, part: &ScenePart) -> Result<Applied, RenderError> {
        if !self.scene.holds_part(part) {
            let why = "the part was not added to this renderer".to_owned();
            return Ok(Applied::NeedsRebuild { why });
        }
        let before = self.edit_base.clone();
        self.edit_base.statistics.remove_part(scene, part);
        self.edit_base.expect(scene);
        let applied = self.apply_scene(scene);
        if matches!(applied, Ok(Applied::InPlace(_))) {
            let meshes = scene.meshes.len();
            let replaced = self.scene.remove_part(&self.context, part, meshes)?;
            self.is_bound &= !replaced;
        } else {
            self.edit_base = before;
        }
        applied
    }
}
