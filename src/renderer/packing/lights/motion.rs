//! Lights that move: what a new placement changes, and what of it has to be uploaded.

use std::ops::Range;

use super::alias::probabilities;
use super::glow::Glow;
use super::*;

/// Words of four of a record.
const WORDS_PER_LIGHT: usize = size_of::<Light>() / size_of::<[u32; 4]>();
/// A power that changes by no more than this share of the greatest channel has changed by rounding.
const SAME_POWER: f64 = 1e-9;

/// An emissive triangle of a mesh.
#[derive(Clone, Copy, Debug)]
pub(super) struct Emitter {
    triangle: usize,
    /// Index in leaf order.
    leaf: u32,
    /// Corners as the mesh has them, and as its pose does, object space.
    at_rest: [DVec3; 3],
    now: [DVec3; 3],
    mean: [f64; 3],
    boost: f64,
    sides: f64,
}

impl Emitter {
    pub(super) fn new(mesh: &Mesh, glow: Glow, leaf: u32) -> Self {
        let corners = mesh.corners(&mesh.triangles[glow.triangle]);
        Self {
            triangle: glow.triangle,
            leaf,
            at_rest: corners,
            now: corners,
            mean: glow.mean,
            boost: glow.boost,
            sides: glow.sides(),
        }
    }

    fn power(&self, world_from_object: &DAffine3) -> [f64; 3] {
        let [a, b, c] = self.now;
        let [first, second] = [b - a, c - a].map(|edge| world_from_object.matrix3 * edge);
        let area = 0.5 * first.cross(second).length();
        self.mean.map(|mean| PI * area * self.sides * mean)
    }

    fn shape(&self, world_from_object: &DAffine3) -> LightShape {
        let [a, b, c] = self.now.map(|at| world_from_object.transform_point3(at));
        LightShape::near(Bounds {
            min: a.min(b).min(c),
            max: a.max(b).max(c),
        })
    }

    /// As the mesh has it, whatever pose it was in.
    pub(super) fn lie_at_rest(&mut self) {
        self.now = self.at_rest;
    }
}

/// Where an instance's emissive triangles lie in the records.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placed {
    mesh: usize,
    first: usize,
}

/// What has changed since it was last taken.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LightUploads {
    /// Records, merged to one range; empty if none.
    pub records: Range<usize>,
    /// The table of picks.
    pub alias: bool,
    /// All of the tree; its header follows the origin anyway.
    pub tree: bool,
}

impl LightUploads {
    fn add(&mut self, range: Range<usize>) {
        self.records = if self.records.is_empty() {
            range
        } else {
            self.records.start.min(range.start)..self.records.end.max(range.end)
        };
    }
}

impl PackedLights {
    /// Moves the origin of render space: rewrites the first `origin_dependent` records.
    pub fn set_origin(&mut self, origin_in_world: DVec3) {
        for (record, position) in self.records.iter_mut().zip(&self.positions_in_world) {
            record.position = (*position - origin_in_world).as_vec3().to_array();
        }
        self.origin_in_world = origin_in_world;
        self.uploads.add(0..self.origin_dependent);
    }

    /// Moves the punctual lights of scene nodes: `placement` gives `world_from_node`. True if any moved. The records
    /// follow with the next [`PackedLights::set_origin`].
    pub fn move_nodes(&mut self, placement: impl Fn(usize) -> Option<DAffine3>) -> bool {
        let mut moved = false;
        for index in 0..self.nodes.len() {
            let Some(world_from_light) = placement(self.nodes[index]) else {
                continue;
            };
            let record = &mut self.records[index];
            let direction = direction_of(&world_from_light);
            let turned = record.direction != direction;
            record.direction = direction;
            let mut has_moved = turned;
            if record.kind != LIGHT_DIRECTIONAL {
                has_moved |= self.positions_in_world[index] != world_from_light.translation;
                self.positions_in_world[index] = world_from_light.translation;
            } else if turned {
                // The box shows it another face.
                self.weigh_from_afar(index);
            }
            if has_moved {
                self.shape_anew(index);
            }
            moved |= has_moved;
        }
        moved
    }

    fn shape_anew(&mut self, index: usize) {
        self.shapes[index] = self.shape_of(&self.records[index], self.positions_in_world[index]);
        self.uploads.tree = true;
    }

    /// A mesh changes its shape: `corners` gives those of its triangles by number, object space. Instances follow with the
    /// next [`PackedLights::place_instance`].
    pub fn reshape_mesh(&mut self, mesh: usize, corners: impl Fn(usize) -> [DVec3; 3]) {
        for emitter in self.emitters.get_mut(mesh).into_iter().flatten() {
            emitter.now = corners(emitter.triangle);
        }
    }

    /// Follows an instance to a new placement. Turning and moving leaves powers alone; what changes areas makes
    /// [`PackedLights::finish`] weigh all lights anew. Work in proportion to the instance's emissive triangles.
    pub fn place_instance(&mut self, instance: u32, world_from_object: &DAffine3) {
        let Some(Some(placed)) = self.placed.get(instance as usize).copied() else {
            return;
        };
        for at in 0..self.emitters[placed.mesh].len() {
            let (emitter, record) = (self.emitters[placed.mesh][at], placed.first + at);
            self.shapes[record] = emitter.shape(world_from_object);
            let power = emitter.power(world_from_object);
            if !is_close(power, self.powers[record]) {
                self.set_power(record, power, emitter.boost);
                self.uploads.alias = true;
            }
        }
        self.uploads.tree = true;
    }

    /// Adds the emissive triangles of a new instance of `mesh`; returns its first record, or `0xffffffff`.
    pub fn add_instance(&mut self, instance: u32, mesh: usize, world: &DAffine3) -> u32 {
        let first = self.push_emitters(instance, mesh, world);
        self.uploads.alias |= first != NO_EMITTER;
        first
    }

    /// Takes an instance's emissive triangles out: they are never picked again.
    pub fn remove_instance(&mut self, instance: u32) {
        let Some(placed) = self
            .placed
            .get_mut(instance as usize)
            .and_then(Option::take)
        else {
            return;
        };
        let count = self.emitters[placed.mesh].len();
        for record in placed.first..placed.first + count {
            self.set_power(record, [0.0; 3], 0.0);
        }
        self.holes.push((placed.first, count));
        self.uploads.alias = true;
    }

    pub(super) fn push_emitters(&mut self, instance: u32, mesh: usize, world: &DAffine3) -> u32 {
        let slot = instance as usize;
        if self.placed.len() <= slot {
            self.placed.resize(slot + 1, None);
        }
        let count = self.emitters.get(mesh).map_or(0, Vec::len);
        if count == 0 {
            return NO_EMITTER;
        }
        let hole = self.holes.iter().position(|(_, room)| *room == count);
        let first = match hole {
            Some(at) => self.holes.swap_remove(at).0,
            None => {
                let first = self.records.len();
                for _ in 0..count {
                    let nowhere = LightShape::at(DVec3::ZERO);
                    self.push([0.0; 3], 0.0, Light::default(), nowhere);
                }
                first
            }
        };
        for at in 0..count {
            let emitter = self.emitters[mesh][at];
            self.records[first + at] = Light {
                kind: LIGHT_TRIANGLE,
                radiance: emitter.mean.map(|mean| mean as f32),
                instance,
                triangle: emitter.leaf,
                ..Light::default()
            };
            self.shapes[first + at] = emitter.shape(world);
            self.set_power(first + at, emitter.power(world), emitter.boost);
        }
        // Where a hole was filled, too: other lights may have been far from it.
        self.tree = LightTree::default();
        self.placed[slot] = Some(Placed { mesh, first });
        first as u32
    }

    /// A mesh's triangles have another leaf order: `leaf_of` gives a triangle's new index.
    pub fn reorder_mesh(&mut self, mesh: usize, leaf_of: impl Fn(usize) -> u32) {
        let Some(emitters) = self.emitters.get_mut(mesh) else {
            return;
        };
        for emitter in emitters.iter_mut() {
            emitter.leaf = leaf_of(emitter.triangle);
        }
        for placed in self.placed.iter().flatten() {
            if placed.mesh != mesh {
                continue;
            }
            for (at, emitter) in emitters.iter().enumerate() {
                self.records[placed.first + at].triangle = emitter.leaf;
            }
            self.uploads
                .add(placed.first..placed.first + emitters.len());
        }
    }

    /// Makes all records anew for an edited scene, as [`pack_lights`] would, with those `kinds` of punctual lights. `instances` are numbered by their places in the
    /// list, their meshes as they were packed; `bounds` is the scene's box ([`loose_bounds`]). Work in proportion to
    /// lights, emissive triangles of all instances included. The positions follow with the next
    /// [`PackedLights::set_origin`].
    pub fn repack(
        &mut self,
        scene: &Scene,
        kinds: LightKinds,
        instances: &[Instance],
        bounds: Option<Bounds>,
    ) {
        self.kinds = LightKinds {
            // These were decided when triangles and map were packed.
            emitters: self.kinds.emitters,
            environment: self.kinds.environment,
            ..kinds
        };
        self.place_all(scene, instances, SceneBox::around(bounds, DVec3::ZERO));
        self.uploads.alias = true;
    }

    /// Looks at a mesh's triangles again: which of them emit, and how much. For [`PackedLights::repack`].
    pub fn look_at_mesh(&mut self, scene: &Scene, mesh: usize, leaf_of: &[u32]) {
        if let (true, Some(emitters)) = (self.kinds.emitters, self.emitters.get_mut(mesh)) {
            *emitters = mesh_emitters(scene, &scene.meshes[mesh], leaf_of);
        }
    }

    /// Has room for the emissive triangles of `meshes` meshes: more have none yet, fewer lose theirs.
    pub fn set_mesh_count(&mut self, meshes: usize) {
        self.emitters.resize(meshes, Vec::new());
    }

    /// A mesh has no emissive triangles any more.
    pub fn forget_mesh(&mut self, mesh: usize) {
        if let Some(emitters) = self.emitters.get_mut(mesh) {
            *emitters = Vec::new();
        }
    }

    /// Whether a mesh has emissive triangles.
    pub fn emits(&self, mesh: usize) -> bool {
        self.emitters
            .get(mesh)
            .is_some_and(|emitters| !emitters.is_empty())
    }

    /// Whether any mesh has emissive triangles, placed or not.
    pub fn has_emitters(&self) -> bool {
        self.emitters.iter().any(|emitters| !emitters.is_empty())
    }

    /// Whether the scene's box decides anything, and that around `bounds` is not the one in use.
    pub fn leaves_box(&self, bounds: Option<Bounds>) -> bool {
        self.has_infinite_lights() && SceneBox::around(bounds, DVec3::ZERO) != self.packed_box
    }

    /// Whether any light shines from infinitely far, through the scene's box.
    pub fn has_infinite_lights(&self) -> bool {
        self.records[..self.origin_dependent]
            .iter()
            .any(|record| is_afar(record.kind))
    }

    /// The box as packed.
    pub fn packed_box(&self) -> SceneBox {
        self.packed_box
    }

    /// Makes light from infinitely far come through another box: what moves may leave the one that was packed.
    /// The positions follow with the next [`PackedLights::set_origin`].
    pub fn set_box(&mut self, scene_box: SceneBox) {
        if scene_box == self.scene_box {
            return;
        }
        self.scene_box = scene_box;
        for index in 0..self.origin_dependent {
            if is_afar(self.records[index].kind) {
                self.records[index] = scene_box.shone_through(self.records[index]);
                self.positions_in_world[index] = scene_box.center;
                self.weigh_from_afar(index);
                self.shape_anew(index);
            }
        }
    }

    fn weigh_from_afar(&mut self, index: usize) {
        let power = self.power_from_afar(&self.records[index]);
        self.set_power(index, power, 1.0);
        self.uploads.alias = true;
    }

    /// Weighs all lights anew if any power has changed, takes the tree along, and says what to upload.
    pub fn finish(&mut self) -> LightUploads {
        if self.uploads.alias {
            self.pick_anew();
            self.uploads.records = 0..self.records.len();
        }
        // By where they are now alone: frames are the same in whatever order they come.
        let regroups = self.uploads.tree && self.records.len() <= MOST_REGROUPED;
        let is_new = self.tree.lights() != self.records.len() || regroups;
        if is_new || self.uploads.alias || self.uploads.tree {
            let shares = probabilities(&self.weights);
            let shapes = self.shapes.iter().zip(shares);
            let clusters: Vec<Cluster> =
                shapes.map(|(shape, share)| shape.cluster(share)).collect();
            if is_new {
                self.tree = LightTree::new(&clusters);
            }
            if is_new || self.uploads.alias {
                self.tree.weigh(&self.weights);
            }
            self.tree.follow(&clusters);
            self.uploads.tree = self.tree.picks();
        }
        self.tree.set_origin(self.origin_in_world);
        let uploads = std::mem::take(&mut self.uploads);
        let parts: [&[[u32; 4]]; 2] = [bytemuck::cast_slice(&self.records), self.tree.words()];
        let count = parts[0].len() + parts[1].len();
        if self.words.len() == count {
            let [records, tree] = self.changed_words(&uploads);
            self.words[records.clone()].copy_from_slice(&parts[0][records]);
            let changed = &parts[1][..tree.len()];
            self.words[tree].copy_from_slice(changed);
        } else {
            self.words = parts.concat();
        }
        uploads
    }

    /// What the shaders know as `lights`: all records, and behind them the tree.
    pub fn words(&self) -> &[[u32; 4]] {
        &self.words
    }

    /// Levels of the tree; 0 where lights are picked by power.
    pub fn tree_depth(&self) -> u32 {
        self.tree.depth()
    }

    /// Which of [`PackedLights::words`] have to be uploaded after a call of [`PackedLights::finish`].
    pub fn changed_words(&self, uploads: &LightUploads) -> [Range<usize>; 2] {
        let first = WORDS_PER_LIGHT * self.records.len();
        let Range { start, end } = uploads.records;
        let tree = if uploads.tree {
            self.tree.words().len()
        } else {
            HEADER_WORDS
        };
        [
            WORDS_PER_LIGHT * start..WORDS_PER_LIGHT * end,
            first..first + tree,
        ]
    }
}

/// Whether lights of a kind are infinitely far.
pub(super) fn is_afar(kind: u32) -> bool {
    kind == LIGHT_DIRECTIONAL || kind == LIGHT_ENVIRONMENT
}

/// Two powers, W; what is no number is close to none.
fn is_close(a: [f64; 3], b: [f64; 3]) -> bool {
    let most = b.into_iter().fold(0.0, f64::max);
    (0..3).all(|channel| (a[channel] - b[channel]).abs() <= SAME_POWER * most)
}
