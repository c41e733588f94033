//! Changes of the scene while it is shown: what an application moves between frames, and edits.
//!
//! [`Renderer::apply_scene`] takes a scene over that differs from the one shown in nodes, materials and lights. No
//! hierarchy over triangles is built and no texture uploaded: what an edit costs goes with instances, materials and lights.
//!
//! The next frame is the one that a renderer made from the edited scene would render, bit for bit: records get the same
//! values in the same order, which decides what random numbers pick. Two things can set it apart. Features that were
//! compiled in and are no longer needed ([`InPlace::spare_features`]) leave another program, whose sums round differently.
//! And with `reconstruct.*` the frames before count, as they do when something moves.

use glam::DAffine3;

use super::radii::{area_m2, radii_m};
use super::scene_buffers::{Edited, SceneChange};
use super::{
    InstanceId, RenderError, Renderer, eye_paths_per_thread, photon_paths_per_thread,
    shader_features,
};
use crate::bvh::MaterialMarks;
use crate::gpu::features::{DecidedBy, MEANINGS, ShaderFeatures, WORDS};
use crate::renderer::packing::{LightKinds, PackedEnvironment, pack_environment};
use crate::scene::mesh_statistics::MeshStatistics;
use crate::scene::{Material, Needs, Player, PunctualLight, Scene, ScenePose, SceneStatistics};

/// What became of an edited scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Applied {
    /// The next frame shows it.
    InPlace(InPlace),
    /// It asks for what was not compiled or uploaded. The renderer is as it was; a new one can show the scene.
    NeedsRebuild {
        /// In words: "glass in the shaders is not compiled in".
        why: String,
    },
}

/// What an edit in place did.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct InPlace {
    /// Instances have other numbers, because some came or went: whoever keeps an [`InstanceId`] has to ask anew.
    pub renumbered: bool,
    /// Shader features that are compiled in and that the scene no longer needs. They cost time and change rounding; a new
    /// renderer does without.
    pub spare_features: Vec<String>,
    /// Bytes of materials and triangles uploaded by the call. Instances and lights follow with the next frame
    /// (`SceneBuffers::upload_bytes`).
    pub uploaded_bytes: u64,
}

/// What a renderer remembers of the scene that it shows.
#[derive(Clone, Debug, Default)]
pub(super) struct EditBase {
    pub(super) statistics: SceneStatistics,
    materials: Vec<Material>,
    lights: Vec<PunctualLight>,
    /// Node and light of each light that is shown.
    lit_nodes: Vec<(usize, usize)>,
    repainted: Vec<Vec<[u32; 2]>>,
    counts: [usize; 4],
    image_sizes: Vec<[u32; 2]>,
    has_environment: bool,
    /// Of the scene that is shown.
    pub(super) needs: Needs,
    most_user_bsdf: u32,
    /// The surroundings are others than those that light samples were packed for.
    relights: bool,
    /// Photons are of the scene before an edit.
    pub(super) outdates_photons: bool,
}

impl EditBase {
    /// Looks at every triangle once.
    pub(super) fn new(scene: &Scene) -> Self {
        let mut base = Self {
            statistics: SceneStatistics::of(scene),
            ..Self::default()
        };
        base.needs = Needs::with_statistics(scene, &base.statistics);
        let numbers = scene.materials.iter().map(|material| material.user_bsdf);
        base.most_user_bsdf = numbers.max().unwrap_or_default();
        base.note(scene);
        base
    }

    /// The next scene to be shown has other lists, and it is known how they differ.
    pub(super) fn expect(&mut self, scene: &Scene) {
        self.counts = counts(scene);
        let meshes = scene.meshes.iter().skip(self.repainted.len());
        self.repainted
            .extend(meshes.map(|mesh| mesh.repainted.clone()));
        self.repainted.truncate(scene.meshes.len());
        for (known, mesh) in self.repainted.iter_mut().zip(&scene.meshes) {
            if mesh.triangles.is_empty() {
                known.clone_from(&mesh.repainted);
            }
        }
    }

    fn note(&mut self, scene: &Scene) {
        self.materials.clone_from(&scene.materials);
        self.lights.clone_from(&scene.lights);
        self.lit_nodes = lit_nodes(scene);
        self.repainted = scene
            .meshes
            .iter()
            .map(|mesh| mesh.repainted.clone())
            .collect();
        self.counts = counts(scene);
        let sizes = scene.images.iter().map(|image| [image.width, image.height]);
        self.image_sizes = sizes.collect();
        self.has_environment = scene.environment.is_some();
        self.relights = false;
    }

    /// Why the scene is none that the one shown can be edited into.
    fn why_rebuild(&self, scene: &Scene) -> Option<String> {
        let same = self.counts == counts(scene)
            && self.has_environment == scene.environment.is_some()
            && self
                .statistics
                .meshes
                .iter()
                .zip(&scene.meshes)
                .all(|(statistics, mesh)| statistics.triangles == mesh.triangles.len());
        (!same).then(|| {
            "the scene has other meshes, textures, skins or surroundings than the one shown"
                .to_owned()
        })
    }
}

fn counts(scene: &Scene) -> [usize; 4] {
    [
        scene.meshes.len(),
        scene.textures.len(),
        scene.images.len(),
        scene.skins.len(),
    ]
}

fn lit_nodes(scene: &Scene) -> Vec<(usize, usize)> {
    let lights = scene.light_instances();
    lights.iter().map(|lit| (lit.node, lit.light)).collect()
}

/// Whether photons have anything to start from.
pub(super) fn shines(needs: &Needs) -> bool {
    needs.environment || needs.lights != Default::default()
}

/// Whether a triangle of `after` emits otherwise than one of `before`.
fn glows_otherwise(before: &Material, after: &Material) -> bool {
    let glow = |material: &Material| {
        let emits = material.is_emissive();
        emits.then_some((
            material.emission,
            material.coverage(),
            material.emissive_texture,
            material.double_sided,
        ))
    };
    glow(before) != glow(after)
}

impl Renderer {
    /// The last frame was given up between its passes ([`GpuContext::set_gate`](crate::gpu::GpuContext::set_gate)): nothing
    /// is taken over from it, and without its photons they are all traced anew. Whether meshes took its pose nobody knows.
    /// `mean_frames` that the mean had before stay in it.
    pub(crate) fn give_up_frame(&mut self, without_photons: bool, mean_frames: u32) {
        self.forget_frames();
        self.still.frames = mean_frames;
        if let Some(deformer) = self.scene.deformer_mut() {
            deformer.pose_again();
        }
        self.edit_base.outdates_photons |= without_photons;
    }

    /// Shows an edited scene from the next frame on. `scene` has the meshes, textures, images, skins and surroundings of the
    /// one shown; transforms, visibility, nodes, materials, lights, and the materials of a mesh's triangles
    /// ([`crate::scene::Mesh::repainted`]) may differ. A clip that plays goes on; poses and placements that were set
    /// through [`Renderer::set_pose`] and its like are to be set again.
    ///
    /// Work is in proportion to nodes, instances, materials and lights. Beyond that, triangles of a mesh are looked at when
    /// they change their material, or one of theirs begins or ceases to emit, to be two-sided or to let rays pass; and
    /// emissive triangles when any of them moves, comes or goes.
    ///
    /// # Errors
    /// More instances or lights than the adapter binds.
    pub fn apply_scene(&mut self, scene: &Scene) -> Result<Applied, RenderError> {
        self.apply_with(scene, None)
    }

    /// The same, with other surroundings.
    fn apply_with(
        &mut self,
        scene: &Scene,
        surroundings: Option<&PackedEnvironment>,
    ) -> Result<Applied, RenderError> {
        if let Some(why) = self.edit_base.why_rebuild(scene) {
            return Ok(Applied::NeedsRebuild { why });
        }
        let base = &self.edit_base;
        let other_paint: Vec<bool> = scene
            .meshes
            .iter()
            .zip(&base.repainted)
            .map(|(mesh, known)| mesh.repainted != *known)
            .collect();
        // Statistics of the meshes that have other materials now; the old ones come back if the edit cannot be shown.
        let mut kept: Vec<(usize, MeshStatistics)> = Vec::new();
        for (index, _) in other_paint.iter().enumerate().filter(|(_, other)| **other) {
            let statistics = MeshStatistics::of(&scene.meshes[index]);
            let known = &mut self.edit_base.statistics.meshes[index];
            kept.push((index, std::mem::replace(known, statistics)));
        }
        let needs = Needs::with_statistics(scene, &self.edit_base.statistics);
        let changes = self.changes_of_meshes(scene, &other_paint);
        let refused = self.why_rebuild(scene, &needs, &changes);
        let written = match surroundings {
            Some(packed) if refused.is_none() => {
                self.scene.write_environment(&self.context, packed)
            }
            _ => Ok(false),
        };
        if refused.is_some() || written.is_err() {
            for (index, statistics) in kept {
                self.edit_base.statistics.meshes[index] = statistics;
            }
        }
        self.is_bound &= !written?;
        if let Some(why) = refused {
            return Ok(Applied::NeedsRebuild { why });
        }
        self.edit_base.relights |= surroundings.is_some();
        self.take_over(scene, &needs, &changes)
            .map(Applied::InPlace)
    }

    /// Shows other texels of an image of the scene from the next frame on; its size is as it was. Costs what its texels do:
    /// nothing is compiled, and no light sample or photon is traced for it, so that a picture that shines goes on to light
    /// its surroundings as it did when photons were last traced.
    ///
    /// # Errors
    /// [`RenderError::Settings`]: no such image, or one of another size.
    pub fn repaint_image(&mut self, scene: &Scene, image: usize) -> Result<(), RenderError> {
        let size = scene.images.get(image).map(|of| [of.width, of.height]);
        if size.is_none() || size != self.edit_base.image_sizes.get(image).copied() {
            return Err(RenderError::Settings(format!(
                "image {image} of the scene cannot be repainted: it is none of those shown, or of another size"
            )));
        }
        self.scene.write_image(&self.context, scene, image);
        Ok(())
    }

    /// By mesh: whether its triangles' records change, and whether what they emit does.
    fn changes_of_meshes(&self, scene: &Scene, other_paint: &[bool]) -> [Vec<bool>; 2] {
        let base = &self.edit_base;
        let pairs = || base.materials.iter().zip(&scene.materials);
        let marks: Vec<bool> = pairs()
            .map(|(before, after)| MaterialMarks::from(before) != MaterialMarks::from(after))
            .collect();
        let glows: Vec<bool> = pairs()
            .map(|(before, after)| glows_otherwise(before, after))
            .collect();
        let uses = |mesh: usize, changed: &[bool]| {
            let mut uses = base.statistics.meshes[mesh].uses.iter();
            uses.any(|part| changed.get(part.material).copied().unwrap_or(false))
        };
        let all = |changed: &[bool]| -> Vec<bool> {
            (0..other_paint.len())
                .map(|mesh| other_paint[mesh] || uses(mesh, changed))
                .collect()
        };
        [all(&marks), all(&glows)]
    }

    /// Why the scene cannot be shown in place.
    fn why_rebuild(
        &self,
        scene: &Scene,
        needs: &Needs,
        [repainted, glow]: &[Vec<bool>; 2],
    ) -> Option<String> {
        let base = &self.edit_base;
        if !self.scene.has_nodes_alone() {
            return Some("instances were added or removed outside the scene's nodes".to_owned());
        }
        let wanted = shader_features(needs, &self.settings);
        let missing = wanted.without(*self.features());
        if let Some(meaning) = missing.select(MEANINGS).next() {
            return Some(format!("{meaning} is not compiled in"));
        }
        if shines(&base.needs) != shines(needs) {
            let what = if shines(&base.needs) {
                "no light is left"
            } else {
                "there was no light"
            };
            return Some(format!("{what}, which decides whether photons are traced"));
        }
        for material in &scene.materials {
            if material.user_bsdf > base.most_user_bsdf {
                return Some(format!("{} has another BSDF", material.name));
            }
        }
        let instances = scene.instances();
        let mut looked_at = vec![false; scene.meshes.len()];
        for placed in &instances {
            let own = self
                .scene
                .deformer()
                .and_then(|deformer| deformer.mesh_of(placed.node));
            let name = &scene.nodes[placed.node].name;
            if scene.deforms(placed.node) {
                if own.is_none() {
                    return Some(format!("{name} deforms and has not been shown yet"));
                }
                if repainted[placed.mesh] || glow[placed.mesh] {
                    return Some(format!("{name} deforms and has another material or light"));
                }
            }
            if std::mem::replace(&mut looked_at[placed.mesh], true) {
                continue;
            }
            for part in &base.statistics.meshes[placed.mesh].uses {
                let material = &scene.materials[part.material];
                let slots = material.texture_slots();
                let mut textures = slots
                    .iter()
                    .filter_map(|(name, slot)| Some((*name, (*slot)?.texture)));
                if self.features().textures
                    && textures.any(|used| !self.scene.holds_texture(scene, material, used))
                {
                    return Some(format!(
                        "{} has a texture that is not uploaded",
                        material.name
                    ));
                }
            }
        }
        None
    }

    fn take_over(
        &mut self,
        scene: &Scene,
        needs: &Needs,
        [repainted, glow]: &[Vec<bool>; 2],
    ) -> Result<InPlace, RenderError> {
        let base = &self.edit_base;
        let lights =
            base.relights || base.lights != scene.lights || base.lit_nodes != lit_nodes(scene);
        let pose = self.player.as_mut().and_then(|player| {
            player.follow(scene);
            player.last_pose()
        });
        let kinds = LightKinds {
            emitters: true,
            points: needs.lights.point > 0,
            spots: needs.lights.spot > 0,
            directionals: needs.lights.directional > 0,
            environment: true,
        };
        let change = SceneChange {
            scene,
            statistics: &base.statistics,
            repainted,
            glow,
            lights,
            kinds,
            pose: pose.as_ref(),
        };
        let Edited {
            renumbered,
            replaced,
            uploaded_bytes,
            relit,
        } = self.scene.edit(&self.context, &change)?;
        self.is_bound &= !replaced;
        let only_moved = !lights && base.materials == scene.materials && !repainted.contains(&true);
        let radii_before = [self.radius_m, self.caustic_radius_m];
        self.area_m2 = area_m2(&self.settings, &base.statistics, scene);
        [self.radius_m, self.caustic_radius_m] = radii_m(&self.settings, self.area_m2);
        self.shorten_dispatches();
        let only_moved = only_moved && !renumbered && !relit;
        if let Some(reconstruction) = self.reconstruction.as_mut().filter(|_| !only_moved) {
            reconstruction.doubt();
        }
        self.edit_base.note(scene);
        self.edit_base.needs = needs.clone();
        // Things that were put elsewhere are like those that a clip moves: photons may be retraced in shares.
        let same_radii = radii_before == [self.radius_m, self.caustic_radius_m];
        self.edit_base.outdates_photons |= !(only_moved && same_radii);
        let wanted = shader_features(needs, &self.settings);
        let spare_features = self
            .features()
            .without(wanted)
            .and(ShaderFeatures::decided_up_to(DecidedBy::Scene))
            .select(WORDS)
            .map(str::to_owned)
            .collect();
        Ok(InPlace {
            renumbered,
            spare_features,
            uploaded_bytes,
        })
    }

    /// Deeper hierarchies may need fewer paths per thread, which changes no bits: the next frame's plan has them.
    pub(super) fn shorten_dispatches(&mut self) {
        let depth = self.scene.hierarchy_depth();
        let settings = &self.settings;
        let paths =
            photon_paths_per_thread(self.frame.features(), settings.photon.max_depth, depth);
        for map in &mut self.maps {
            let run = &mut map.layout.config.paths_per_thread;
            self.is_bound &= *run <= paths;
            *run = paths.min(*run);
        }
        let paths = eye_paths_per_thread(
            settings,
            self.frame.features(),
            depth,
            self.scene.light_tree_depth(),
        );
        self.is_bound &= self.eye_paths_per_thread <= paths;
        self.eye_paths_per_thread = paths.min(self.eye_paths_per_thread);
    }

    /// Takes the scene to where its animation has it when a frame is shown (`animation.*`); the first call begins the
    /// clip. Does nothing without one.
    pub fn animate(&mut self, display_time_ns: i64) {
        if let Some(player) = &mut self.player {
            let pose = player.pose_at(display_time_ns);
            self.scene.set_pose(&pose);
        }
    }

    /// Plays a clip of the scene from the frame on that is shown at `display_time_ns`, `speed` times as fast, with `time_s` in
    /// that frame; speed 0 stands there. In place of the one that played before.
    ///
    /// # Errors
    /// [`RenderError::Settings`]: no such clip.
    pub fn play_clip(
        &mut self,
        scene: &Scene,
        clip: &str,
        speed: f64,
        time_s: f64,
        display_time_ns: i64,
    ) -> Result<(), RenderError> {
        let unknown = || RenderError::Settings(format!("the scene has no clip {clip:?}"));
        let found = scene.animations.iter().find(|known| known.name == clip);
        let found = found.ok_or_else(unknown)?;
        if self.player.is_none() {
            let made = Player::new(scene, clip, speed, time_s);
            self.player = made.map_err(|error| RenderError::Settings(error.to_string()))?;
        }
        let player = self.player.as_mut().ok_or_else(unknown)?;
        player.play(found, speed, time_s, display_time_ns);
        // What the clip before has moved and this one does not stands where the scene has it.
        self.animate(display_time_ns);
        Ok(())
    }

    /// Name of the clip that plays, and where in it the scene stands, seconds.
    #[must_use]
    pub fn clip(&self) -> Option<(&str, f64)> {
        self.player.as_ref()?.clip()
    }

    /// Shows the surroundings that the scene has by now in place of those before, from the next frame on, and all else that
    /// [`Renderer::apply_scene`] takes over. Costs what the map's texels do; nothing is compiled.
    /// [`Applied::NeedsRebuild`], with everything as it was: there were none before, or none are left.
    ///
    /// # Errors
    /// As [`Renderer::apply_scene`]; a map that the adapter cannot bind.
    pub fn replace_surroundings(&mut self, scene: &Scene) -> Result<Applied, RenderError> {
        let packed = scene.environment.as_ref().and_then(pack_environment);
        let Some(packed) = packed.filter(|_| self.features().environment) else {
            let why = "there were no surroundings that shine, or none are left".to_owned();
            return Ok(Applied::NeedsRebuild { why });
        };
        self.apply_with(scene, Some(&packed))
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

    /// Adds an instance of mesh number `mesh` of the scene. It keeps its number until it is removed. Textures and shaders are
    /// those of the meshes that nodes show: one that no node shows may lack its own.
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

    /// Hands over what was written for frames that are not rendered; the queue else keeps it all until something is submitted.
    pub(crate) fn flush_uploads(&self) {
        self.context
            .submit(self.context.encoder("uploads").finish());
    }

    /// Whether anything of the scene, the head aside, moved between the last frame and the one before it.
    pub fn scene_moved(&self) -> bool {
        self.scene.scene_moved()
    }

    /// The scene node that places an instance: what a hit's instance number says. `None` for an instance that the
    /// application added itself, or if there is none of that number.
    pub fn node_of_instance(&self, id: InstanceId) -> Option<usize> {
        self.scene.node_of_instance(id)
    }

    /// The instance that a scene node places; `None` where it places none, or is hidden.
    pub fn instance_of_node(&self, node: usize) -> Option<InstanceId> {
        self.scene.instance_of_node(node)
    }
}
