//! Instances by number: a slot keeps its number as long as its instance lives, so that frames can be compared.

use std::collections::BTreeSet;

use glam::{DAffine3, DMat3, DVec3};

use crate::bvh::records::{NO_EMITTER, NO_POSITIONS, PreviousInstance};
use crate::bvh::{InstanceSource, MeshRange};

/// Names an instance: its place in the shaders' `instances`. A number is used again only after the frame that no longer
/// shows it has begun.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct InstanceId(pub u32);

/// What stands in a slot that no instance holds: nothing can meet an instance without extent.
const NOWHERE: DAffine3 = DAffine3 {
    matrix3: DMat3::ZERO,
    translation: DVec3::ZERO,
};

/// All instances, and where the last two frames had them.
#[derive(Debug, Default)]
pub struct InstanceTable {
    sources: Vec<InstanceSource>,
    is_live: Vec<bool>,
    free: BTreeSet<u32>,
    /// Left in this frame: free from the next one on.
    leaving: Vec<u32>,
    /// Changed since the last frame began, each once.
    changed: Vec<u32>,
    is_changed: Vec<bool>,
    /// Changed between the last two frames.
    moved: Vec<u32>,
    shown: Vec<Option<DAffine3>>,
    shown_origin: Option<DVec3>,
    previous: Vec<PreviousInstance>,
    /// The last frame differed from the one before it.
    was_unsettled: bool,
    /// Nobody asks for [`InstanceTable::previous`].
    skips_previous: bool,
}

/// What begins with a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Begun {
    /// Instances or the origin differ from the last frame.
    pub is_new: bool,
    /// [`InstanceTable::previous`] is not what it was.
    pub previous_is_new: bool,
}

impl InstanceTable {
    /// Takes over `sources`, slot by slot.
    pub fn new(sources: Vec<InstanceSource>) -> Self {
        let count = sources.len();
        Self {
            sources,
            is_live: vec![true; count],
            is_changed: vec![false; count],
            shown: vec![None; count],
            ..Self::default()
        }
    }

    /// Whether [`InstanceTable::previous`] is to be kept, from the next frame on; it is until something else is said.
    pub fn keep_previous(&mut self, keeps: bool) {
        if keeps && self.skips_previous {
            self.shown.fill(None);
            self.shown_origin = None;
        }
        self.skips_previous = !keeps;
    }

    /// Whether [`InstanceTable::previous`] is kept.
    pub fn keeps_previous(&self) -> bool {
        !self.skips_previous
    }

    /// One per slot; empty slots have a matrix of zeros.
    pub fn sources(&self) -> &[InstanceSource] {
        &self.sources
    }

    /// Slots that hold an instance.
    pub fn live_count(&self) -> usize {
        self.is_live.iter().filter(|live| **live).count()
    }

    /// Where an instance stands; `None` if there is none of that number.
    pub fn placement(&self, id: InstanceId) -> Option<DAffine3> {
        let slot = id.0 as usize;
        let live = self.is_live.get(slot).copied().unwrap_or(false);
        live.then(|| self.sources[slot].world_from_object)
    }

    /// Places an instance; true if that changes anything.
    pub fn place(&mut self, id: InstanceId, world_from_object: DAffine3) -> bool {
        match self.placement(id) {
            Some(at) if at != world_from_object => {
                self.sources[id.0 as usize].world_from_object = world_from_object;
                self.note(id.0);
                true
            }
            _ => false,
        }
    }

    /// Adds an instance in the lowest free slot.
    pub fn add(&mut self, source: InstanceSource) -> InstanceId {
        // The lowest, so that numbers depend on what was added and removed, not on how the list happens to lie.
        let slot = match self.free.pop_first() {
            Some(slot) => {
                self.sources[slot as usize] = source;
                self.is_live[slot as usize] = true;
                slot
            }
            None => {
                self.sources.push(source);
                self.is_live.push(true);
                self.is_changed.push(false);
                self.shown.push(None);
                self.sources.len() as u32 - 1
            }
        };
        self.note(slot);
        InstanceId(slot)
    }

    /// Takes an instance out; true if there was one.
    pub fn remove(&mut self, id: InstanceId) -> bool {
        if self.placement(id).is_none() {
            return false;
        }
        let slot = id.0 as usize;
        self.is_live[slot] = false;
        self.sources[slot].world_from_object = NOWHERE;
        self.sources[slot].first_emitter = NO_EMITTER;
        self.leaving.push(id.0);
        self.note(id.0);
        true
    }

    /// Takes over other sources, slot by slot, all at once. `was` gives the slot that an instance had before, so that it is
    /// known where the last frame showed it.
    pub fn replace(&mut self, sources: Vec<InstanceSource>, was: impl Fn(usize) -> Option<u32>) {
        let count = sources.len();
        let shown = (0..count).map(|slot| {
            let old = was(slot)? as usize;
            self.shown.get(old).copied().flatten()
        });
        self.shown = shown.collect();
        self.sources = sources;
        self.is_live = vec![true; count];
        self.is_changed = vec![true; count];
        self.changed = (0..count as u32).collect();
        self.free.clear();
        self.leaving.clear();
    }

    /// Where a new instance's emissive triangles begin in the table of lights.
    pub fn set_first_emitter(&mut self, id: InstanceId, first_emitter: u32) {
        if let Some(source) = self.sources.get_mut(id.0 as usize) {
            source.first_emitter = first_emitter;
        }
    }

    /// Says that a mesh's shape has changed: so have all its instances.
    pub fn note_mesh(&mut self, mesh: u32) {
        for slot in 0..self.sources.len() {
            if self.sources[slot].mesh == mesh && self.is_live[slot] {
                self.note(slot as u32);
            }
        }
    }

    /// Says that an instance, its place or its shape has changed.
    pub fn note(&mut self, slot: u32) {
        if let Some(changed) = self.is_changed.get_mut(slot as usize)
            && !std::mem::replace(changed, true)
        {
            self.changed.push(slot);
        }
    }

    /// A frame begins with its origin at `origin_in_world`: what the last frame showed becomes the previous one.
    ///
    /// `meshes` are the scene's; `first_position` says where a mesh's vertices begin among the deforming ones'.
    pub fn begin_frame(
        &mut self,
        origin_in_world: DVec3,
        meshes: &[MeshRange],
        first_position: impl Fn(usize) -> Option<u32>,
    ) -> Begun {
        let is_new = !self.changed.is_empty() || self.shown_origin != Some(origin_in_world);
        let previous_is_new =
            self.keeps_previous() && (is_new || self.was_unsettled || self.previous.is_empty());
        if previous_is_new {
            let origin = self.shown_origin.unwrap_or(origin_in_world);
            self.previous.clear();
            self.previous
                .extend(self.shown.iter().zip(&self.sources).map(|(shown, source)| {
                    let first_vertex = meshes
                        .get(source.mesh as usize)
                        .map_or(0, |mesh| mesh.first_vertex);
                    let positions = first_position(source.mesh as usize).unwrap_or(NO_POSITIONS);
                    previous_instance(shown.filter(is_solid), origin, first_vertex, positions)
                }));
            for (slot, shown) in self.shown.iter_mut().enumerate() {
                *shown = self.is_live[slot].then(|| self.sources[slot].world_from_object);
            }
        }
        self.shown_origin = Some(origin_in_world);
        self.was_unsettled = is_new;
        std::mem::swap(&mut self.moved, &mut self.changed);
        self.changed.clear();
        for slot in &self.moved {
            self.is_changed[*slot as usize] = false;
        }
        self.free.extend(self.leaving.drain(..));
        Begun {
            is_new,
            previous_is_new,
        }
    }

    /// Forgets what was shown: the next frame has no previous one.
    pub fn forget(&mut self) {
        self.shown.fill(None);
        self.shown_origin = None;
        self.was_unsettled = true;
        self.moved.clear();
    }

    /// Slots whose instance came, went, moved or changed its shape between the last frame and the one before it, in
    /// the order in which they did.
    pub fn moved(&self) -> &[u32] {
        &self.moved
    }

    /// One per slot: where the previous frame had it; out of date where [`InstanceTable::keep_previous`] declined it.
    pub fn previous(&self) -> &[PreviousInstance] {
        &self.previous
    }
}

fn is_solid(placement: &DAffine3) -> bool {
    let determinant = placement.matrix3.determinant();
    determinant.is_finite() && determinant != 0.0
}

fn previous_instance(
    shown: Option<DAffine3>,
    origin_in_world: DVec3,
    first_vertex: u32,
    first_position: u32,
) -> PreviousInstance {
    let blank = PreviousInstance {
        first_position,
        first_vertex,
        ..PreviousInstance::default()
    };
    let Some(world_from_object) = shown else {
        return blank;
    };
    let render_from_object = DAffine3 {
        matrix3: world_from_object.matrix3,
        translation: world_from_object.translation - origin_in_world,
    };
    let [row_0, row_1, row_2] = crate::bvh::rows(&render_from_object);
    PreviousInstance {
        render_from_object_0: row_0,
        render_from_object_1: row_1,
        render_from_object_2: row_2,
        exists: 1,
        ..blank
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn source(x: f64) -> InstanceSource {
        InstanceSource {
            world_from_object: DAffine3::from_translation(DVec3::X * x),
            mesh: 0,
            node: 0,
            first_emitter: NO_EMITTER,
        }
    }

    fn x_of(previous: &PreviousInstance) -> Option<f32> {
        (previous.exists == 1).then_some(previous.render_from_object_0[3])
    }

    #[test]
    fn the_previous_frame_is_the_one_before() {
        let mut table = InstanceTable::new(vec![source(1.0), source(2.0)]);
        let frame = |table: &mut InstanceTable, origin: f64| {
            let begun = table.begin_frame(DVec3::X * origin, &[], |_| None);
            let was: Vec<_> = table.previous().iter().map(x_of).collect();
            (begun, was, table.moved().to_vec())
        };
        let (begun, was, moved) = frame(&mut table, 0.5);
        assert!(begun.is_new && moved.is_empty());
        assert_eq!(was, [None, None], "the first frame has none before it");
        table.place(InstanceId(1), DAffine3::from_translation(DVec3::X * 5.0));
        assert!(!table.place(InstanceId(0), DAffine3::from_translation(DVec3::X)));
        let (_, was, moved) = frame(&mut table, 0.25);
        assert_eq!(was, [Some(0.5), Some(1.5)], "relative to the old origin");
        assert_eq!(moved, [1]);
        let (begun, was, moved) = frame(&mut table, 0.25);
        assert!(!begun.is_new && begun.previous_is_new && moved.is_empty());
        assert_eq!(was, [Some(0.75), Some(4.75)]);
        let (begun, ..) = frame(&mut table, 0.25);
        assert!(!begun.is_new && !begun.previous_is_new, "all is at rest");
    }

    #[test]
    fn what_nobody_asks_for_is_not_kept() {
        let mut table = InstanceTable::new(vec![source(1.0)]);
        let begin = |table: &mut InstanceTable| table.begin_frame(DVec3::ZERO, &[], |_| None);
        table.keep_previous(false);
        for x in 0..3 {
            table.place(
                InstanceId(0),
                DAffine3::from_translation(DVec3::X * f64::from(x)),
            );
            let begun = begin(&mut table);
            assert!(begun.is_new && !begun.previous_is_new && table.previous().is_empty());
        }
        // Asked for again, it begins anew: the frames in between were not remembered.
        table.keep_previous(true);
        assert!(begin(&mut table).previous_is_new);
        assert_eq!(x_of(&table.previous()[0]), None);
        assert!(begin(&mut table).previous_is_new);
        assert_eq!(x_of(&table.previous()[0]), Some(2.0));
    }

    #[test]
    fn numbers_stay_and_are_not_confused() {
        let mut table = InstanceTable::new(vec![source(1.0), source(2.0), source(3.0)]);
        let begin = |table: &mut InstanceTable| table.begin_frame(DVec3::ZERO, &[], |_| None);
        begin(&mut table);
        assert!(table.remove(InstanceId(1)) && !table.remove(InstanceId(1)));
        let fourth = table.add(source(4.0));
        assert_eq!(fourth, InstanceId(3), "the last frame still shows slot 1");
        assert!(!table.place(InstanceId(1), DAffine3::IDENTITY));
        begin(&mut table);
        let fifth = table.add(source(5.0));
        assert_eq!(fifth, InstanceId(1));
        assert_eq!(
            table.placement(InstanceId(2)).map(|at| at.translation.x),
            Some(3.0)
        );
        begin(&mut table);
        let was: Vec<_> = table.previous().iter().map(x_of).collect();
        assert_eq!(was, [Some(1.0), None, Some(3.0), Some(4.0)]);
        assert_eq!(table.live_count(), 4);
        begin(&mut table);
        assert_eq!(x_of(&table.previous()[1]), Some(5.0));
    }
}
