//! Meshes that come and go while others stay where they are.

use std::ops::Range;

use crate::mesh::{MeshHierarchies, MeshRange};
use crate::records::{BvhNode, Triangle};
use crate::tree;
use crate::{BvhError, MAX_INDEX};

/// Places in an array that others keep their places in.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Places {
    /// Length of the array.
    len: usize,
    /// What nobody uses of it, in order; no two touch, and none reaches the end.
    free: Vec<Range<usize>>,
}

impl Places {
    /// An array whose first `len` places are taken.
    #[must_use]
    pub fn new(len: usize) -> Self {
        Self {
            len,
            free: Vec::new(),
        }
    }

    /// Length of the array.
    #[must_use]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether nothing is taken.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Takes `count` places in a row: the first gap that holds them, else the end. What is given depends on what was taken
    /// and given back alone.
    pub fn take(&mut self, count: usize) -> Range<usize> {
        let gap = self.free.iter().position(|gap| gap.len() >= count);
        let Some(at) = gap.filter(|_| count > 0) else {
            self.len += count;
            return self.len - count..self.len;
        };
        let gap = &mut self.free[at];
        let taken = gap.start..gap.start + count;
        gap.start = taken.end;
        if gap.start == gap.end {
            self.free.remove(at);
        }
        taken
    }

    /// Gives places back that were taken; the array shrinks where they are its end.
    pub fn give_back(&mut self, mut places: Range<usize>) {
        if places.is_empty() {
            return;
        }
        let at = self.free.partition_point(|gap| gap.start < places.start);
        if self
            .free
            .get(at)
            .is_some_and(|next| next.start == places.end)
        {
            places.end = self.free.remove(at).end;
        }
        if at > 0 && self.free[at - 1].end == places.start {
            places.start = self.free.remove(at - 1).start;
        }
        if places.end == self.len {
            self.len = places.start;
        } else {
            let at = self.free.partition_point(|gap| gap.start < places.start);
            self.free.insert(at, places);
        }
    }
}

/// Writes `values` at `places` of an array, which grows if need be.
fn put<T: Clone + Default>(
    array: &mut Vec<T>,
    places: &Range<usize>,
    values: impl Iterator<Item = T>,
) {
    if array.len() < places.end {
        array.resize(places.end, T::default());
    }
    for (slot, value) in array[places.clone()].iter_mut().zip(values) {
        *slot = value;
    }
}

/// Shortens an array, and gives memory back where most of it is unused.
fn shorten<T>(array: &mut Vec<T>, len: usize) {
    array.truncate(len);
    if array.capacity() > 2 * len {
        array.shrink_to(len + len / 4);
    }
}

/// Where meshes lie that were added or built anew.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Grafted {
    /// Nodes.
    pub nodes: Range<usize>,
    /// Triangles, and their vertices.
    pub triangles: Range<usize>,
}

/// Which places of [`MeshHierarchies`]' arrays are taken.
#[derive(Clone, Debug, Default)]
pub struct Room {
    /// Those of the nodes.
    pub nodes: Places,
    /// Those of the triangles, and of their vertices.
    pub triangles: Places,
}

impl Room {
    /// All that there is now is taken.
    #[must_use]
    pub fn of(hierarchies: &MeshHierarchies) -> Self {
        Self {
            nodes: Places::new(hierarchies.nodes.len()),
            triangles: Places::new(hierarchies.triangles.len()),
        }
    }
}

impl MeshHierarchies {
    /// Adds meshes after those that there are: `part` was built over them alone. Their materials count from `material`,
    /// their vertices from `first_vertex`. Time in proportion to the part.
    ///
    /// # Errors
    /// [`BvhError::TooMany`]; nothing is changed then.
    pub fn graft(
        &mut self,
        part: &Self,
        room: &mut Room,
        material: u32,
        first_vertex: u32,
    ) -> Result<Grafted, BvhError> {
        let count =
            self.triangles.len() + part.triangles.len() + self.meshes.len() + part.meshes.len();
        if count > (MAX_INDEX / 4) as usize {
            return Err(BvhError::TooMany {
                what: "triangles",
                count,
                limit: MAX_INDEX / 4,
            });
        }
        let nodes = room.nodes.take(part.nodes.len());
        let triangles = room.triangles.take(part.triangles.len());
        let (root, first) = (nodes.start as u32, triangles.start as u32);
        let shifted = part
            .nodes
            .iter()
            .map(|node| tree::shifted(node, root, first));
        put(&mut self.nodes, &nodes, shifted);
        let painted = part.triangles.iter().map(|triangle| Triangle {
            material: triangle.material + material,
            ..*triangle
        });
        put(&mut self.triangles, &triangles, painted);
        let corners = part.triangle_vertices.iter();
        let corners = corners.map(|[a, b, c, index]| {
            let [a, b, c] = [a, b, c].map(|vertex| vertex + first_vertex);
            [a, b, c, *index]
        });
        put(&mut self.triangle_vertices, &triangles, corners);
        self.meshes
            .extend(part.meshes.iter().map(|range| MeshRange {
                root: range.root + root,
                first_triangle: range.first_triangle + first,
                first_vertex: range.first_vertex + first_vertex,
                ..*range
            }));
        self.max_depth = self.max_depth.max(part.max_depth);
        self.revision += 1;
        Ok(Grafted { nodes, triangles })
    }

    /// Takes meshes out that [`MeshHierarchies::graft`] put at `grafted`: those of the numbers `meshes` have no triangles
    /// from now on, and all keep their numbers.
    pub fn prune(&mut self, meshes: Range<usize>, grafted: &Grafted, room: &mut Room) {
        for range in self.meshes.get_mut(meshes).into_iter().flatten() {
            *range = MeshRange {
                is_rigid: true,
                ..MeshRange::default()
            };
        }
        // What is left is never read; blank, it depends on nothing that was.
        self.nodes[grafted.nodes.clone()].fill(BvhNode::default());
        self.triangles[grafted.triangles.clone()].fill(Triangle::default());
        self.triangle_vertices[grafted.triangles.clone()].fill([0; 4]);
        room.nodes.give_back(grafted.nodes.clone());
        room.triangles.give_back(grafted.triangles.clone());
        shorten(&mut self.nodes, room.nodes.len());
        shorten(&mut self.triangles, room.triangles.len());
        shorten(&mut self.triangle_vertices, room.triangles.len());
        let depths = self.meshes.iter().map(|range| range.depth);
        self.max_depth = depths.max().unwrap_or_default();
        self.revision += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_taken_from_gaps_and_come_back() {
        let mut places = Places::new(10);
        let [a, b, c] = [4, 6, 2].map(|count| places.take(count));
        assert_eq!((&a, &b, &c), (&(10..14), &(14..20), &(20..22)));
        places.give_back(a.clone());
        assert_eq!(places.take(5), 22..27, "the gap holds four");
        assert_eq!(places.take(3), 10..13);
        places.give_back(10..13);
        places.give_back(b);
        let gaps: Vec<_> = places.free.iter().map(|gap| (gap.start, gap.end)).collect();
        assert_eq!(gaps, [(10, 20)], "gaps that touch are one");
        places.give_back(22..27);
        assert_eq!(places.len(), 22);
        places.give_back(c);
        assert_eq!(places, Places::new(10));
        assert_eq!(places.take(0), 10..10);
    }
}
