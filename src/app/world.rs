//! What an application can change: the scene, by name.

use std::collections::BTreeSet;
use std::ops::Range;
use std::path::Path;

use glam::{DAffine3, DVec3};
use thiserror::Error;

use super::hands::Hands;
use super::kept::{Arrival, Kept, PartChange};
use super::loading::{Loaded, Maker, PartLoading};
use super::{AppError, FrameInput};
use crate::limits::LoadBudget;
use crate::printable::{did_you_mean, line};
use crate::renderer::packing::check_user_bsdfs;
use crate::renderer::{RayHit, Renderer};
use crate::scene::edit::{Edit, EditError, NewContent, NewNode, Placement};
use crate::scene::{Environment, Material, Node, PunctualLight, Scene, ScenePart};
use crate::settings::Quality;
use crate::xr::{ActionError, ActionKind, Pulse, PulseOf, Side};

/// What falls along an arc, and for how long: 2 m/s upwards from a hand come down within half of it.
const GRAVITY_M_PER_S2: f64 = 9.81;
const ARC_S: f64 = 2.0;
/// Straight pieces of an arc; each is within 0.3 mm of the parabola (g dt^2 / 8).
const ARC_STEPS: u32 = 128;

/// The scene that is shown, to be changed between frames. Nodes, materials and lights are numbers into the scene's lists
/// ([`World::scene`]) and keep them for good.
///
/// What is changed shows in the frame under way. Only what needs other shaders or textures than those in use (the scene's
/// first glass, say) is compiled first: it shows one frame later, and that frame takes as long as compiling does.
pub struct World<'a> {
    pub(super) kept: &'a mut Kept,
    renderer: Option<&'a Renderer>,
    pub(super) frame: Option<&'a FrameInput>,
}

/// What an application asked for and cannot have; one line.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum WorldError {
    /// No node, material, light or clip of that name.
    #[error("{}", line(&format!("the scene has no {what} '{name}'{hint}")))]
    Unknown {
        /// `node`, `material`, `light`, `clip`.
        what: &'static str,
        /// What was asked for.
        name: String,
        /// The nearest name that there is, in words; may be empty.
        hint: String,
    },
    /// A part that cannot be loaded or prepared.
    #[error("{}", line(.0))]
    Part(String),
    /// A material that the shaders have no model for.
    #[error("{}", line(.0))]
    Material(String),
    /// A clip that cannot be played so.
    #[error("clip: {}", line(.0))]
    Clip(String),
    /// Surroundings that cannot be.
    #[error("surroundings: {}", line(.0))]
    Surroundings(String),
    /// A panel that cannot be, or was removed.
    #[error("panel: {}", line(.0))]
    Panel(String),
    /// A quality that the renderer was not made for, or a question that comes too early.
    #[error("{}", line(.0))]
    Quality(String),
    /// A way that nobody can be moved by.
    #[error("moving the wearer: {0}")]
    Move(String),
    /// An action that was not declared, or one of another kind.
    #[error(transparent)]
    Action(#[from] ActionError),
    /// A number that is none of the scene's, or a value that no scene can have.
    #[error(transparent)]
    Edit(#[from] EditError),
}

impl<'a> World<'a> {
    /// `renderer`: who shows it, once there is one. `frame`: the one under way.
    pub(super) fn new(
        kept: &'a mut Kept,
        renderer: Option<&'a Renderer>,
        frame: Option<&'a FrameInput>,
    ) -> Self {
        Self {
            kept,
            renderer,
            frame,
        }
    }

    /// The scene as it is now.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.kept.scene
    }

    /// The first node of that name that is in the scene.
    ///
    /// # Errors
    /// [`WorldError::Unknown`].
    pub fn node(&self, name: &str) -> Result<usize, WorldError> {
        let hands = self.of_hands(|part| part.nodes.clone());
        let scene = &self.kept.scene;
        let nodes = scene.nodes.iter().map(|node| &*node.name).enumerate();
        let placed = nodes.filter(|(node, _)| scene.reaches(*node));
        numbered("node", name, placed, &hands)
    }

    /// The first material of that name.
    ///
    /// # Errors
    /// [`WorldError::Unknown`].
    pub fn material(&self, name: &str) -> Result<usize, WorldError> {
        let hands = self.of_hands(|part| part.materials.clone());
        let materials = self.kept.scene.materials.iter();
        let names = materials.map(|material| &*material.name);
        numbered("material", name, names.enumerate(), &hands)
    }

    /// The first punctual light of that name that a node in the scene has.
    ///
    /// # Errors
    /// [`WorldError::Unknown`].
    pub fn light(&self, name: &str) -> Result<usize, WorldError> {
        let scene = &self.kept.scene;
        let nodes = scene.nodes.iter().enumerate();
        let placed = nodes.filter_map(|(node, of)| of.light.filter(|_| scene.reaches(node)));
        let placed: BTreeSet<usize> = placed.collect();
        let names = scene.lights.iter().map(|light| &*light.name).enumerate();
        let names = names.filter(|(light, _)| placed.contains(light));
        numbered("light", name, names, &[])
    }

    /// Where a node stands, the scene's own animation left aside.
    ///
    /// # Errors
    /// [`WorldError::Edit`]: no such node.
    pub fn world_from_node(&self, node: usize) -> Result<DAffine3, WorldError> {
        self.known(node)?;
        Ok(self.kept.scene.world_from_node(node))
    }

    /// The middle of what hangs on a node, in the world: of its triangles and those below it; its origin if there are none.
    ///
    /// # Errors
    /// [`WorldError::Edit`]: no such node.
    pub fn center_in_world(&self, node: usize) -> Result<DVec3, WorldError> {
        let world_from_node = self.world_from_node(node)?;
        Ok(self.kept.scene.center_of_node(node, &world_from_node))
    }

    fn known(&self, node: usize) -> Result<&Node, WorldError> {
        entry("node", &self.kept.scene.nodes, node)
    }

    /// A node that was not removed.
    fn placed(&self, node: usize) -> Result<&Node, WorldError> {
        let known = self.known(node)?;
        if self.kept.scene.reaches(node) {
            return Ok(known);
        }
        let name = known.name.clone();
        Err(EditError::Gone { name }.into())
    }

    /// Puts a node, with everything below it, where `world_from_node` says.
    ///
    /// # Errors
    /// [`WorldError::Edit`]: no such node in the scene, or a transform that is not finite.
    pub fn place(&mut self, node: usize, world_from_node: DAffine3) -> Result<(), WorldError> {
        let world_from_parent = match self.placed(node)?.parent {
            Some(parent) => self.world_from_node(parent)?,
            None => DAffine3::IDENTITY,
        };
        let parent_from_node = world_from_parent.inverse() * world_from_node;
        self.edit(Edit::place(node, parent_from_node))
    }

    /// Shows or hides a node with everything below it.
    ///
    /// # Errors
    /// [`WorldError::Edit`]: no such node in the scene.
    pub fn set_visible(&mut self, node: usize, is_visible: bool) -> Result<(), WorldError> {
        self.placed(node)?;
        self.edit(Edit::Visibility {
            node,
            is_hidden: !is_visible,
        })
    }

    /// Adds an empty node, a light or another instance of a mesh at a place in the world; returns the node's number.
    ///
    /// # Errors
    /// [`WorldError::Edit`]: no such mesh, or a value that no scene can have.
    pub fn add(
        &mut self,
        name: &str,
        world_from_node: DAffine3,
        content: NewContent,
    ) -> Result<usize, WorldError> {
        let node = NewNode {
            name: name.to_owned(),
            to: Placement::of(world_from_node),
            content,
        };
        self.edit(Edit::Add { parent: None, node })?;
        Ok(self.kept.scene.nodes.len() - 1)
    }

    /// Takes a node out of the scene with everything below it. Its number is not given away again.
    ///
    /// # Errors
    /// [`WorldError::Edit`]: no such node, or one that was removed before.
    pub fn remove(&mut self, node: usize) -> Result<(), WorldError> {
        self.edit(Edit::Delete { node })
    }

    /// Changes a material wherever it is used.
    ///
    /// # Errors
    /// [`WorldError::Edit`]: no such material, or a value that no material can have. [`WorldError::Material`]: a BSDF that is not
    /// installed.
    pub fn change_material(
        &mut self,
        material: usize,
        change: impl FnOnce(&mut Material),
    ) -> Result<(), WorldError> {
        let mut to = entry("material", &self.kept.scene.materials, material)?.clone();
        change(&mut to);
        check_user_bsdfs(&self.kept.library, std::slice::from_ref(&to))
            .map_err(|error| WorldError::Material(error.to_string()))?;
        let to = Box::new(to);
        self.edit(Edit::Material { material, to })
    }

    /// Changes a light at all nodes that have it.
    ///
    /// # Errors
    /// [`WorldError::Edit`]: no such light, or a value that no light can have.
    pub fn change_light(
        &mut self,
        light: usize,
        change: impl FnOnce(&mut PunctualLight),
    ) -> Result<(), WorldError> {
        let mut to = entry("light", &self.kept.scene.lights, light)?.clone();
        change(&mut to);
        self.edit(Edit::Light { light, to })
    }

    /// Any other edit, of those that [`Edit`] lists.
    ///
    /// # Errors
    /// [`WorldError::Edit`]; the scene is then as it was.
    pub fn edit(&mut self, edit: Edit) -> Result<(), WorldError> {
        let undo = edit.clone().apply(&mut self.kept.scene)?;
        // What is shown already costs nothing, however often it is asked for.
        self.kept.is_changed |= !edit.left_all(&undo);
        Ok(())
    }

    /// Plays one of the scene's clips from the frame under way on, `speed` times as fast (0: stands, below 0: backwards), with
    /// `time_s` in that frame; it repeats. In place of what played before: nodes of that clip alone go back to where the
    /// scene has them.
    ///
    /// # Errors
    /// [`WorldError::Unknown`]; [`WorldError::Clip`]: a speed or time that is not finite.
    pub fn play_clip(&mut self, name: &str, speed: f64, time_s: f64) -> Result<(), WorldError> {
        let clips = &self.kept.scene.animations;
        let names = clips.iter().map(|clip| &*clip.name).enumerate();
        numbered("clip", name, names, &[])?;
        if !(speed.is_finite() && time_s.is_finite()) {
            let fault = format!("speed {speed} and time {time_s} s are not both finite");
            return Err(WorldError::Clip(fault));
        }
        self.kept.clip = Some((name.to_owned(), speed, time_s));
        Ok(())
    }

    /// The clip that plays, and where in it the frame under way is, seconds; what was asked for in this frame counts.
    #[must_use]
    pub fn clip(&self) -> Option<(&str, f64)> {
        if let Some((name, _, time_s)) = &self.kept.clip {
            return Some((name, *time_s));
        }
        self.renderer?.clip()
    }

    /// Lets the clip that plays stand where it is.
    ///
    /// # Errors
    /// As [`World::play_clip`].
    pub fn stop_clip(&mut self) -> Result<(), WorldError> {
        match self.clip().map(|(name, time_s)| (name.to_owned(), time_s)) {
            Some((name, time_s)) => self.play_clip(&name, 0.0, time_s),
            None => Ok(()),
        }
    }

    /// Puts other surroundings around the scene, from the frame under way on: [`crate::load_environment`] reads one from a file
    /// or makes an embedded one (on a thread of the application's own, if frames are not to wait), [`Environment::scaled`]
    /// makes it brighter or darker. The frame waits for the map to be packed and uploaded, and where the scene had none,
    /// for compiling.
    ///
    /// # Errors
    /// [`WorldError::Surroundings`]: radiance that is negative or not finite, or not as much as its size says.
    pub fn set_surroundings(&mut self, surroundings: Environment) -> Result<(), WorldError> {
        surroundings.check().map_err(WorldError::Surroundings)?;
        self.kept.surroundings += 1;
        let had_some = self.kept.scene.environment.replace(surroundings).is_some();
        self.kept.has_other_surroundings |= had_some;
        self.kept.is_changed |= !had_some;
        Ok(())
    }

    /// Begins to load a glTF file on another thread, which also prepares it for the renderer. Where it needs shaders that are
    /// not compiled in, the thread makes another renderer, which takes the present one's place with the part: until then both
    /// take memory, and after it reconstruction begins anew. Shaders for meshes that deform are compiled in the frame that shows
    /// them. The file may take and reach what the scene's may (`limits.*`).
    #[must_use]
    pub fn load_part(&mut self, path: impl AsRef<Path>) -> PartLoading {
        let (path, limits) = (path.as_ref().to_owned(), self.kept.limits);
        self.make_part(move || Ok(Scene::load_within(&path, &LoadBudget::new(limits))?))
    }

    /// As [`World::load_part`], of a scene that `make` makes on that thread: in code, or from wherever it is kept.
    #[must_use]
    pub fn make_part(
        &mut self,
        make: impl FnOnce() -> Result<Scene, AppError> + Send + 'static,
    ) -> PartLoading {
        let library = &self.kept.library;
        let maker = self.renderer.map(|renderer| Maker::of(renderer, library));
        PartLoading::begin(self.kept, make, maker)
    }

    /// Adds what was loaded, below a new node `name`, and waits for it if it is not there yet: frames go on undisturbed if it
    /// has had the time. It shows one frame later where the thread made another renderer for it. Which frame calls this is
    /// the application's to say, and not how fast a disk was, so that a replay has the same frames. [`ScenePart::root`] is the
    /// new node.
    ///
    /// # Errors
    /// [`WorldError::Part`]: a file that cannot be used; [`WorldError::Edit`].
    pub fn add_part(
        &mut self,
        loading: PartLoading,
        name: &str,
        world_from_part: DAffine3,
    ) -> Result<ScenePart, WorldError> {
        let loaded = loading.end(self.kept, self.renderer);
        let loaded =
            loaded.ok_or_else(|| WorldError::Part("the thread that loads it ended".into()))?;
        let in_words = |error: AppError| WorldError::Part(error.to_string());
        self.insert(loaded.map_err(in_words)?, name, world_from_part)
    }

    /// Adds a scene below a new node, prepared or not.
    pub(super) fn insert(
        &mut self,
        loaded: impl Into<Loaded>,
        name: &str,
        world_from_part: DAffine3,
    ) -> Result<ScenePart, WorldError> {
        let mut loaded = loaded.into();
        if loaded.prepared.is_none() {
            let whole = loaded.scene.check();
            whole.map_err(|error| WorldError::Part(error.to_string()))?;
        }
        if let (None, Some(renderer)) = (&loaded.prepared, self.renderer) {
            // It was made here, or loaded before there was a renderer.
            let kept = &self.kept;
            let is_alone = kept.part.is_none() && kept.needs_rebuild.is_none();
            let shown = || is_alone.then(|| (kept.scene.clone(), kept.surroundings));
            let now = Maker::of(renderer, &kept.library).prepare(loaded.scene, shown);
            loaded = now.map_err(|error| WorldError::Part(error.to_string()))?;
        }
        let Loaded {
            scene,
            prepared,
            successor,
        } = loaded;
        let at = Placement::of(world_from_part);
        let part = self.kept.scene.add_part(scene, name, None, at)?;
        let change = prepared.map(|prepared| {
            PartChange::Added(Arrival {
                part: part.clone(),
                prepared: Box::new(prepared),
                successor,
            })
        });
        self.kept.note(change);
        Ok(part)
    }

    /// Takes a part out again and gives its memory back; numbers of its nodes, materials and lights may be given out again.
    ///
    /// # Errors
    /// [`WorldError::Edit`]: it was taken out before, or something else still shows a mesh or a light of it.
    pub fn remove_part(&mut self, part: &ScenePart) -> Result<(), WorldError> {
        self.kept.scene.remove_part(part)?;
        self.kept.note(Some(PartChange::Removed(part.clone())));
        Ok(())
    }

    /// Gives an image of the scene other texels, as many as it has.
    #[cfg(feature = "panels")]
    pub(super) fn repaint(&mut self, image: usize, rgba8: Vec<u8>) {
        if let Some(known) = self.kept.scene.images.get_mut(image) {
            known.rgba8 = rgba8;
            self.kept.repainted.push(image);
        }
    }

    /// Where the wearer's hands and controllers lie in one of the scene's lists.
    fn of_hands(&self, list: impl Fn(&ScenePart) -> Range<usize>) -> Vec<Range<usize>> {
        let hands = self.kept.hands.iter();
        hands.flat_map(Hands::parts).map(list).collect()
    }

    /// The wearer's hands, and `nodes` with all below them.
    fn passed(&self, nodes: &[usize]) -> Vec<Range<usize>> {
        let mut passed = self.of_hands(|part| part.nodes.clone());
        for node in nodes {
            let below = self.kept.scene.subtree(*node).into_iter().enumerate();
            passed.extend(below.filter(|below| below.1).map(|(at, _)| at..at + 1));
        }
        passed
    }

    /// What a ray meets first within `max_distance_m` (may be infinite), from either side: what does a hand point at? It goes
    /// through the wearer's own hands, and through the nodes `past` with all below them: what a hand holds. The
    /// scene's animation is that of the frame under way, what the application changed in this frame does not count yet.
    /// Nothing is met in [`super::App::start`]. As [`Renderer::cast_ray`].
    #[must_use]
    pub fn cast_ray(
        &self,
        origin_in_world: DVec3,
        direction: DVec3,
        max_distance_m: f64,
        past: &[usize],
    ) -> Option<RayHit> {
        let past = self.passed(past);
        self.renderer?
            .cast_ray_past(&past, origin_in_world, direction, max_distance_m)
    }

    /// Where something lands that is thrown from a hand: what a parabola meets first that leaves `origin_in_world` with this
    /// velocity and falls for two seconds; its `distance_m` is along the way. A place to teleport to
    /// ([`World::move_wearer`]), if its normal points up. Otherwise as [`World::cast_ray`].
    #[must_use]
    pub fn cast_arc(
        &self,
        origin_in_world: DVec3,
        velocity_m_per_s: DVec3,
        past: &[usize],
    ) -> Option<RayHit> {
        let (renderer, past) = (self.renderer?, self.passed(past));
        let at = |step: u32| {
            let seconds = f64::from(step) * ARC_S / f64::from(ARC_STEPS);
            let fallen_m = 0.5 * GRAVITY_M_PER_S2 * seconds * seconds;
            origin_in_world + velocity_m_per_s * seconds - DVec3::Y * fallen_m
        };
        let mut way_m = 0.0;
        for step in 0..ARC_STEPS {
            let (from, to) = (at(step), at(step + 1));
            let length_m = from.distance(to);
            if let Some(mut hit) = renderer.cast_ray_past(&past, from, to - from, length_m) {
                hit.distance_m += way_m;
                return Some(hit);
            }
            way_m += length_m;
        }
        None
    }

    /// Moves the wearer, eyes and hands, through the world from the next frame on. A replay shows the recorded views, in which
    /// the move is.
    ///
    /// # Errors
    /// [`WorldError::Move`]: not finite.
    pub fn move_wearer(&mut self, by_m: DVec3) -> Result<(), WorldError> {
        let moved_m = self.kept.moved_m + by_m;
        if !moved_m.is_finite() {
            return Err(WorldError::Move(format!("{moved_m} is not finite")));
        }
        self.kept.moved_m = moved_m;
        Ok(())
    }

    /// The quality of the frame under way, as far as it was set; in a replay, as it was recorded.
    ///
    /// # Errors
    /// [`WorldError::Quality`] in [`super::App::start`]: nothing is rendered yet.
    pub fn quality(&self) -> Result<Quality, WorldError> {
        let renderer = self.renderer_for_quality()?;
        Ok(self.kept.quality.unwrap_or_else(|| renderer.quality()))
    }

    /// The most that the settings allow, and what the first frame has unless another quality is set.
    ///
    /// # Errors
    /// As [`World::quality`].
    pub fn most_quality(&self) -> Result<Quality, WorldError> {
        Ok(self.renderer_for_quality()?.most_quality())
    }

    /// Renders with `quality` from the frame under way on, as [`Renderer::set_quality`] has it: nothing is compiled and
    /// nothing allocated. It is recorded, so it may depend on how long frames took: a replay of a recording in which
    /// quality was set goes by the recording, and what is asked for here is only checked.
    ///
    /// # Errors
    /// [`WorldError::Quality`]: out of its range, more than the settings allow, or in [`super::App::start`].
    pub fn set_quality(&mut self, quality: &Quality) -> Result<(), WorldError> {
        let checked = self.renderer_for_quality()?.check_quality(quality);
        checked.map_err(|error| WorldError::Quality(error.to_string()))?;
        self.kept.quality = Some(*quality);
        Ok(())
    }

    fn renderer_for_quality(&self) -> Result<&'a Renderer, WorldError> {
        self.renderer.ok_or_else(|| {
            WorldError::Quality("nothing is rendered yet; ask for a quality in `update`".into())
        })
    }

    /// Lets a controller vibrate for a while, `amplitude` 0 to 1; nothing happens where there is none that can.
    pub fn vibrate(&mut self, side: Side, duration_s: f64, amplitude: f64) {
        self.pulse(PulseOf::Hand(side), duration_s, amplitude);
    }

    /// As [`World::vibrate`], of what an action of kind haptic is bound to.
    ///
    /// # Errors
    /// [`WorldError::Action`]: no such action, or one of another kind.
    pub fn vibrate_action(
        &mut self,
        action: &str,
        duration_s: f64,
        amplitude: f64,
    ) -> Result<(), WorldError> {
        self.kept.actions.known(action, ActionKind::Haptic)?;
        self.pulse(PulseOf::Action(action.to_owned()), duration_s, amplitude);
        Ok(())
    }

    fn pulse(&mut self, of: PulseOf, duration_s: f64, amplitude: f64) {
        self.kept.pulses.push(Pulse {
            of,
            duration_s: duration_s.max(0.0),
            // `clamp` alone would keep NaN.
            amplitude: amplitude.max(0.0).clamp(0.0, 1.0),
        });
    }

    /// Ends the run after the frame under way.
    pub fn quit(&mut self) {
        self.kept.is_over = true;
    }
}

/// An entry of one of the scene's lists.
fn entry<'a, T>(what: &'static str, list: &'a [T], index: usize) -> Result<&'a T, WorldError> {
    let count = list.len();
    let missing = EditError::Missing { what, index, count };
    Ok(list.get(index).ok_or(missing)?)
}

/// The number of the first of the numbered `names` that is `name`; those numbered `past` do not count.
fn numbered<'a>(
    what: &'static str,
    name: &str,
    names: impl Iterator<Item = (usize, &'a str)> + Clone,
    past: &[Range<usize>],
) -> Result<usize, WorldError> {
    let is_past = |at: &usize| past.iter().any(|numbers| numbers.contains(at));
    let names = names.filter(|(at, _)| !is_past(at));
    let found = names.clone().find(|(_, known)| *known == name);
    found.map(|(at, _)| at).ok_or_else(|| WorldError::Unknown {
        what,
        name: name.to_owned(),
        hint: did_you_mean(name, names.map(|(_, known)| known)),
    })
}
