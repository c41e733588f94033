//! The tree by which shadow rays pick lights for a point (`shaders/shared/light_tree.wesl`): two clusters of lights each, down to
//! groups of lights so close together that power alone tells them apart.
//!
//! Whatever the bounds, picking stays unbiased: every light with power has a chance everywhere.

use std::ops::Range;

use glam::DVec3;

use super::alias::{alias_table, chances};
use crate::scene::Bounds;

/// So many lights near by are picked by power where none shines from afar: the samples that a surface chooses from meet all of
/// them, if they are alike.
const MOST_LIGHTS_BY_POWER: usize = 4;
/// So many lights are grouped anew where any of them moves; more stay in the groups that they had, however far they go.
pub const MOST_REGROUPED: usize = 512;
/// Words of four: before the pairs, and of each pair.
pub const HEADER_WORDS: usize = 1;
const PAIR_WORDS: usize = 3;
/// Lights whose group and share in it are in a word.
const SHARES_PER_WORD: usize = 2;
/// What the root is of.
const NO_CLUSTER: u32 = u32::MAX;
/// Marks a child that is a group.
const IS_GROUP: u32 = 1 << 31;
/// Lights are a group within so much of the extent of all.
const GROUP_EXTENT: f64 = 1.0 / 128.0;
/// Places along an axis where a cluster may be split.
const BINS: usize = 16;
/// Clusters below so many others are halved by number: the tree stays at most so much deeper than a balanced one.
const MOST_UNBALANCED: u32 = 24;

/// A light, or several, as the tree sees them.
#[derive(Clone, Copy, Debug)]
pub struct Cluster {
    /// Where they are, world space; none for light from afar.
    pub bounds: Option<Bounds>,
    /// Mean over all directions, W/sr; from afar irradiance, W/m^2; of all lights' power together as 1 W, for f32's sake.
    pub intensity: f64,
}

impl Cluster {
    /// Changes nothing that it is joined with.
    const NOTHING: Self = Self {
        bounds: None,
        intensity: 0.0,
    };

    fn joined(self, other: Self) -> Self {
        if other.intensity == 0.0 {
            return self;
        }
        if self.intensity == 0.0 {
            return other;
        }
        Self {
            bounds: Bounds::around(self.bounds.into_iter().chain(other.bounds)),
            intensity: self.intensity + other.intensity,
        }
    }

    fn center(&self) -> DVec3 {
        self.bounds.map_or(DVec3::ZERO, |bounds| bounds.center())
    }

    fn extent(&self) -> f64 {
        self.bounds.map_or(0.0, |bounds| bounds.size().length())
    }

    /// How much light it takes from others' points to be one: wide clusters of strong lights are worst.
    fn cost(&self) -> f64 {
        self.intensity * self.extent() * self.extent()
    }

    /// Middle and radius in the tree's space, above 0 by which sign tells light near by; from afar the radius is below 0, of what does
    /// not shine 0.
    fn place(&self, anchor: DVec3) -> [u32; 4] {
        let afar = if self.intensity > 0.0 { -1.0 } else { 0.0 };
        let (middle, radius) = self.bounds.map_or((DVec3::ZERO, afar), |bounds| {
            let radius = (0.5 * self.extent()).max(f32::MIN_POSITIVE.into());
            (bounds.center() - anchor, radius)
        });
        middle
            .as_vec3()
            .extend(radius as f32)
            .to_array()
            .map(f32::to_bits)
    }

    /// The upper half of f32, to the nearest; of what shines never 0.
    fn rough_intensity(&self) -> u32 {
        let rough = ((self.intensity as f32).to_bits() + 0x8000) >> 16;
        rough.max(u32::from(self.intensity > 0.0))
    }
}

/// Two clusters of the tree; a child is another pair, or the first of a group in the order of lights.
#[derive(Clone, Copy, Debug, Default)]
struct Pair {
    children: [u32; 2],
    /// Twice the pair that this one is a child of, and 1 if the second; [`NO_CLUSTER`] for the root.
    own_cluster: u32,
}

/// Lights so close together that power alone tells them apart.
#[derive(Clone, Debug)]
struct Group {
    /// Where they stand in the order of lights.
    members: Range<usize>,
    own_cluster: u32,
}

/// All lights of a scene, or none where power alone tells them apart.
#[derive(Clone, Debug, Default)]
pub struct LightTree {
    /// The first is the root; children come after parents.
    pairs: Vec<Pair>,
    groups: Vec<Group>,
    /// The lights, group by group.
    order: Vec<u32>,
    depth: u32,
    /// Origin of its space, world space.
    anchor: DVec3,
    words: Vec<[u32; 4]>,
}

impl LightTree {
    /// Groups lights by where they are. [`LightTree::weigh`] and [`LightTree::follow`] have to come after it.
    pub fn new(lights: &[Cluster]) -> Self {
        let mut tree = Self {
            order: (0..lights.len() as u32).collect(),
            ..Self::default()
        };
        let is_afar = |light: &u32| lights[*light as usize].bounds.is_none();
        tree.order.sort_by_key(is_afar);
        let near = tree.order.partition_point(|light| !is_afar(light));
        let is_near_alone = near == lights.len();
        if near == 0 || is_near_alone && near <= MOST_LIGHTS_BY_POWER {
            return tree;
        }
        let all = Cluster {
            bounds: Bounds::around(lights.iter().filter_map(|light| light.bounds)),
            intensity: 1.0,
        };
        tree.anchor = all.center();
        let group_extent = all.extent() * GROUP_EXTENT;
        if is_near_alone {
            tree.split(lights, group_extent, 0..near, NO_CLUSTER, 0);
        } else {
            let halves = [0..near, near..lights.len()];
            tree.push_pair(lights, group_extent, halves, NO_CLUSTER, 0);
        }
        tree
    }

    /// Makes a subtree of part of the order the child `own_cluster` of a pair, and returns it as its parent names it.
    fn split(
        &mut self,
        lights: &[Cluster],
        group_extent: f64,
        members: Range<usize>,
        own_cluster: u32,
        depth: u32,
    ) -> u32 {
        let chosen = &mut self.order[members.clone()];
        let is_afar = lights[chosen[0] as usize].bounds.is_none();
        let boxes = chosen
            .iter()
            .filter_map(|light| lights[*light as usize].bounds);
        let extent = Bounds::around(boxes).map_or(0.0, |around| around.size().length());
        if is_afar || chosen.len() == 1 || extent <= group_extent {
            let first = members.start as u32;
            self.depth = self.depth.max(depth);
            self.groups.push(Group {
                members,
                own_cluster,
            });
            return first | IS_GROUP;
        }
        let middle = members.start + split_place(lights, chosen, depth);
        let halves = [members.start..middle, middle..members.end];
        self.push_pair(lights, group_extent, halves, own_cluster, depth)
    }

    fn push_pair(
        &mut self,
        lights: &[Cluster],
        group_extent: f64,
        halves: [Range<usize>; 2],
        own_cluster: u32,
        depth: u32,
    ) -> u32 {
        let pair = self.pairs.len() as u32;
        self.pairs.push(Pair {
            own_cluster,
            ..Pair::default()
        });
        for (second, members) in halves.into_iter().enumerate() {
            let own_cluster = 2 * pair + second as u32;
            let child = self.split(lights, group_extent, members, own_cluster, depth + 1);
            self.pairs[pair as usize].children[second] = child;
        }
        pair
    }

    /// Takes powers over, in any unit: lights of a group are picked by them.
    pub fn weigh(&mut self, weights: &[f64]) {
        self.words.clear();
        if !self.picks() {
            return;
        }
        let first_entry = self.first_entry();
        let first_share = first_entry + self.order.len();
        let shares = self.order.len().div_ceil(SHARES_PER_WORD);
        self.words.resize(first_share + shares, [0; 4]);
        for group in &self.groups {
            let lights = &self.order[group.members.clone()];
            let own: Vec<f64> = lights
                .iter()
                .map(|light| weights[*light as usize])
                .collect();
            let (table, chances) = alias_table(&chances(&own));
            for (at, (light, entry)) in lights.iter().zip(&table[1..]).enumerate() {
                let other = lights[entry.alias_index as usize];
                self.words[first_entry + group.members.start + at] = [
                    *light,
                    other,
                    entry.threshold.to_bits(),
                    lights.len() as u32,
                ];
                let (word, half) = (
                    *light as usize / SHARES_PER_WORD,
                    *light as usize % SHARES_PER_WORD,
                );
                let share = (chances[at] as f32).to_bits();
                self.words[first_share + word][2 * half..][..2]
                    .copy_from_slice(&[group.own_cluster, share]);
            }
        }
    }

    /// Lights have moved, or shine otherwise: the clusters are still the same.
    pub fn follow(&mut self, lights: &[Cluster]) {
        if !self.picks() {
            return;
        }
        let mut clusters = vec![[Cluster::NOTHING; 2]; self.pairs.len()];
        for group in &self.groups {
            let members = self.order[group.members.clone()].iter();
            let joined = members.fold(Cluster::NOTHING, |sum, light| {
                sum.joined(lights[*light as usize])
            });
            clusters[group.own_cluster as usize / 2][group.own_cluster as usize % 2] = joined;
        }
        for (index, pair) in self.pairs.iter().enumerate().rev() {
            let [first, second] = clusters[index];
            let intensities = first.rough_intensity() | (second.rough_intensity() << 16);
            let [child, other] = pair.children;
            self.words[HEADER_WORDS + PAIR_WORDS * index..][..PAIR_WORDS].copy_from_slice(&[
                first.place(self.anchor),
                second.place(self.anchor),
                [intensities, child, other, pair.own_cluster],
            ]);
            if pair.own_cluster != NO_CLUSTER {
                clusters[pair.own_cluster as usize / 2][pair.own_cluster as usize % 2] =
                    first.joined(second);
            }
        }
    }

    /// Moves the origin of render space.
    pub fn set_origin(&mut self, origin_in_world: DVec3) {
        let moved = (self.anchor - origin_in_world).as_vec3();
        let [x, y, z] = moved.to_array().map(f32::to_bits);
        self.words
            .resize(self.words.len().max(HEADER_WORDS), [0; 4]);
        self.words[0] = [x, y, z, self.pairs.len() as u32];
    }

    /// What is uploaded: a header that follows the origin, then pairs, groups, and what group each light is of.
    pub fn words(&self) -> &[[u32; 4]] {
        &self.words
    }

    /// How many lights it groups.
    pub fn lights(&self) -> usize {
        self.order.len()
    }

    /// Pairs from the root to a light, at most.
    pub fn depth(&self) -> u32 {
        self.depth
    }

    /// Whether lights are picked by it.
    pub fn picks(&self) -> bool {
        !self.pairs.is_empty()
    }

    fn first_entry(&self) -> usize {
        HEADER_WORDS + PAIR_WORDS * self.pairs.len()
    }
}

/// Sorts `chosen` into two parts and returns where the second begins: the cheapest of several planes across each axis.
fn split_place(lights: &[Cluster], chosen: &mut [u32], depth: u32) -> usize {
    let middle = |light: u32| lights[light as usize].center();
    let around = Bounds::of_points(chosen.iter().map(|light| middle(*light)));
    let (least, size) = around.map_or((DVec3::ZERO, DVec3::ZERO), |b| (b.min, b.size()));
    let bin_of = |light: u32, axis: usize| {
        // `as` saturates.
        let place = (middle(light)[axis] - least[axis]) / size[axis] * BINS as f64;
        (place as usize).min(BINS - 1)
    };
    let mut best = (f64::INFINITY, 0, 0);
    for axis in (0..3).filter(|axis| size[*axis] > 0.0) {
        let mut bins = [Cluster::NOTHING; BINS];
        let mut counts = [0; BINS];
        for light in chosen.iter() {
            let bin = bin_of(*light, axis);
            bins[bin] = bins[bin].joined(lights[*light as usize]);
            counts[bin] += 1;
        }
        let mut above = [Cluster::NOTHING; BINS + 1];
        for bin in (0..BINS).rev() {
            above[bin] = above[bin + 1].joined(bins[bin]);
        }
        let mut below = Cluster::NOTHING;
        let mut count = 0;
        for bin in 1..BINS {
            below = below.joined(bins[bin - 1]);
            count += counts[bin - 1];
            let cost = below.cost() + above[bin].cost();
            if count > 0 && count < chosen.len() && cost < best.0 {
                best = (cost, axis, bin);
            }
        }
    }
    let (cost, axis, bin) = best;
    if cost == f64::INFINITY || depth >= MOST_UNBALANCED {
        return chosen.len() / 2;
    }
    chosen.sort_by_key(|light| bin_of(*light, axis) >= bin);
    chosen.partition_point(|light| bin_of(*light, axis) < bin)
}
