//! From a binary tree to [`BvhNode`]s of bounded depth.
//!
//! The input is a tree that some builder made, or just the primitives. Subtrees that would not fit the traversal's
//! stack are replaced by balanced ones, as low in the tree as will do, so that the rest keeps its quality.

use glam::Vec3;

use crate::MAX_LEAF;
use crate::bounds::Bounds32;
use crate::records::BvhNode;

/// A node of the tree to convert.
#[derive(Clone, Copy, Debug)]
pub struct TreeNode {
    /// Primitives of a leaf, 0 for an inner node.
    pub count: u32,
    /// A leaf's first entry in [`Tree::order`]; an inner node's left child, with the right one behind it.
    pub first: u32,
}

/// A binary tree; node 0 is the root.
#[derive(Clone, Debug, Default)]
pub struct Tree {
    /// Nodes; empty if there is no primitive.
    pub nodes: Vec<TreeNode>,
    /// Primitive indices that leaves refer to.
    pub order: Vec<u32>,
}

/// How primitives without a tree are split.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Split {
    /// At the median centre along the longest axis: depth is the logarithm of the count.
    Median,
    /// At the best of a few planes by the surface area heuristic, at the median where that gets too deep.
    BinnedSah,
}

/// What the conversion aims at.
#[derive(Clone, Copy, Debug)]
pub struct Shape {
    /// Inner nodes allowed on a path. At least the logarithm of the number of primitives.
    pub max_depth: u32,
    /// Primitives in a leaf of a subtree that is split here.
    pub leaf_size: u32,
    /// How it is split.
    pub split: Split,
    /// Padding of every stored box, rounding units of its largest coordinate.
    pub pad_units: f64,
}

/// The converted hierarchy. Indices count from its own first node and primitive.
#[derive(Clone, Debug, Default)]
pub struct Flat {
    /// Nodes in depth-first order; never empty.
    pub nodes: Vec<BvhNode>,
    /// Primitive indices in leaf order.
    pub order: Vec<u32>,
    /// Inner nodes on the longest path.
    pub depth: u32,
    /// Unpadded bounds of all primitives.
    pub bounds: Option<Bounds32>,
    /// Subtrees that were rebuilt because they were too deep.
    pub rebuilt: u32,
}

/// Buffers that a per-frame rebuild keeps.
#[derive(Clone, Debug, Default)]
pub struct Scratch {
    stack: Vec<Item>,
    range: Vec<u32>,
    children: Vec<[Child; 2]>,
}

#[derive(Clone, Copy, Debug)]
enum Source {
    Subtree(u32),
    Range(u32, u32),
}

/// What becomes of a subtree or range: a leaf of these primitives, or a node with two sides.
enum Parts<'a> {
    Leaf(&'a [u32]),
    Sides([Source; 2]),
}

#[derive(Clone, Copy, Debug)]
struct Item {
    source: Source,
    /// Inner nodes above.
    depth: u32,
    /// Node and side to hang it on.
    parent: Option<(u32, usize)>,
}

#[derive(Clone, Copy, Debug)]
struct Child {
    bounds: Bounds32,
    index: u32,
    count: u32,
}

const NO_CHILD: Child = Child {
    bounds: Bounds32::EMPTY,
    index: 0,
    count: 0,
};

/// Inner nodes on the longest path of a balanced tree over `count` primitives.
fn balanced_depth(count: u32, leaf_size: u32) -> u32 {
    let mut depth = 0;
    let mut left = count;
    while left > leaf_size {
        left = left.div_ceil(2);
        depth += 1;
    }
    depth
}

/// Converts `tree`, or all of `boxes` where it is `None`, into nodes.
///
/// `boxes` holds each primitive's bounds. Every primitive that the tree refers to, or every one, ends in one leaf.
pub fn flatten(tree: Option<&Tree>, boxes: &[Bounds32], shape: &Shape) -> Flat {
    let mut flat = Flat::default();
    flatten_into(tree, boxes, shape, &mut Scratch::default(), &mut flat);
    flat
}

/// [`flatten`] into buffers that exist already. Primitives with empty bounds are left out where there is no tree.
pub fn flatten_into(
    tree: Option<&Tree>,
    boxes: &[Bounds32],
    shape: &Shape,
    scratch: &mut Scratch,
    flat: &mut Flat,
) {
    let leaf_size = shape.leaf_size.clamp(1, MAX_LEAF);
    flat.nodes.clear();
    flat.order.clear();
    flat.depth = 0;
    flat.rebuilt = 0;
    scratch.begin(tree, boxes);
    let Scratch {
        stack,
        range,
        children,
    } = scratch;
    let known = tree.map(|tree| (tree, measure(tree, leaf_size)));
    while let Some(item) = stack.pop() {
        let mut source = item.source;
        if let (Source::Subtree(index), Some((tree, extents))) = (source, &known)
            && must_rebuild(tree, extents, index, item.depth, shape, leaf_size)
        {
            flat.rebuilt += 1;
            let start = range.len() as u32;
            gather(tree, index, range);
            source = Source::Range(start, range.len() as u32);
        }
        let parts = match (source, tree) {
            (Source::Range(start, end), _) => {
                let primitives = &mut range[start as usize..end as usize];
                if end - start <= leaf_size {
                    Parts::Leaf(primitives)
                } else {
                    let middle =
                        start + split_range(primitives, boxes, shape, leaf_size, item.depth);
                    Parts::Sides([Source::Range(start, middle), Source::Range(middle, end)])
                }
            }
            (Source::Subtree(index), Some(tree)) => tree.parts(index),
            (Source::Subtree(_), None) => continue,
        };
        let sides = match parts {
            Parts::Sides(sides) => sides,
            Parts::Leaf(primitives) => {
                add_leaf(primitives, item.parent, boxes, children, &mut flat.order);
                continue;
            }
        };
        let node = children.len() as u32;
        children.push([NO_CHILD; 2]);
        if let Some((parent, side)) = item.parent {
            children[parent as usize][side].index = node;
        }
        let depth = item.depth + 1;
        flat.depth = flat.depth.max(depth);
        // The left side comes first.
        for side in [1, 0] {
            stack.push(Item {
                source: sides[side],
                depth,
                parent: Some((node, side)),
            });
        }
    }
    pack_nodes(children, shape.pad_units, flat);
}

impl Tree {
    fn parts(&self, index: u32) -> Parts<'_> {
        let node = self.nodes[index as usize];
        if node.count > 0 {
            let end = node.first + node.count;
            return Parts::Leaf(&self.order[node.first as usize..end as usize]);
        }
        Parts::Sides([node.first, node.first + 1].map(Source::Subtree))
    }
}

impl Scratch {
    /// Forgets what was, and puts the root on the stack.
    fn begin(&mut self, tree: Option<&Tree>, boxes: &[Bounds32]) {
        self.stack.clear();
        self.range.clear();
        self.children.clear();
        let root = match tree {
            Some(tree) => (!tree.nodes.is_empty()).then_some(Source::Subtree(0)),
            None => {
                let filled = (0..boxes.len() as u32).filter(|&i| !boxes[i as usize].is_empty());
                self.range.extend(filled);
                let count = self.range.len() as u32;
                (count > 0).then_some(Source::Range(0, count))
            }
        };
        self.stack.extend(root.map(|source| Item {
            source,
            depth: 0,
            parent: None,
        }));
    }
}

/// Completes the boxes of inner nodes, and writes all nodes.
fn pack_nodes(children: &mut Vec<[Child; 2]>, pad_units: f64, flat: &mut Flat) {
    // Children lie behind their parents, so one pass backwards completes the bounds of inner nodes.
    for node in (0..children.len()).rev() {
        for side in 0..2 {
            let child = children[node][side];
            if child.count == 0 && child.index as usize > node {
                let [left, right] = children[child.index as usize];
                children[node][side].bounds = left.bounds.union(&right.bounds);
            }
        }
    }
    if children.is_empty() {
        // Nothing at all: a root that no ray enters.
        children.push([NO_CHILD; 2]);
    }
    let bounds = children[0][0].bounds.union(&children[0][1].bounds);
    flat.bounds = (!bounds.is_empty()).then_some(bounds);
    flat.depth = flat.depth.max(1);
    let nodes = children.iter();
    flat.nodes
        .extend(nodes.map(|[left, right]| pack(left, right, pad_units)));
}

/// A node whose indices count from a hierarchy's own first node and primitive, among other hierarchies.
pub(crate) fn shifted(node: &BvhNode, root: u32, first_primitive: u32) -> BvhNode {
    let shift = |index, count| index + if count == 0 { root } else { first_primitive };
    BvhNode {
        left_index: shift(node.left_index, node.left_count),
        right_index: shift(node.right_index, node.right_count),
        ..*node
    }
}

/// Box, index and count of a node's two children.
pub(crate) fn children(node: &BvhNode) -> [(Bounds32, u32, u32); 2] {
    let bounds = |min: [f32; 3], max: [f32; 3]| Bounds32 {
        min: min.into(),
        max: max.into(),
    };
    [
        (
            bounds(node.left_min, node.left_max),
            node.left_index,
            node.left_count,
        ),
        (
            bounds(node.right_min, node.right_max),
            node.right_index,
            node.right_count,
        ),
    ]
}

fn pack(left: &Child, right: &Child, pad_units: f64) -> BvhNode {
    let left_bounds = left.bounds.padded(pad_units);
    let right_bounds = right.bounds.padded(pad_units);
    BvhNode {
        left_min: left_bounds.min.to_array(),
        left_index: left.index,
        left_max: left_bounds.max.to_array(),
        left_count: left.count,
        right_min: right_bounds.min.to_array(),
        right_index: right.index,
        right_max: right_bounds.max.to_array(),
        right_count: right.count,
    }
}

/// Hangs a leaf on its parent; a leaf at the root gets a node of its own whose other side is empty.
fn add_leaf(
    primitives: &[u32],
    parent: Option<(u32, usize)>,
    boxes: &[Bounds32],
    children: &mut Vec<[Child; 2]>,
    order: &mut Vec<u32>,
) {
    let (node, side) = parent.unwrap_or_else(|| {
        children.push([NO_CHILD; 2]);
        (children.len() as u32 - 1, 0)
    });
    children[node as usize][side] = Child {
        bounds: primitives.iter().fold(Bounds32::EMPTY, |bounds, &index| {
            bounds.union(&boxes[index as usize])
        }),
        index: order.len() as u32,
        count: primitives.len() as u32,
    };
    order.extend_from_slice(primitives);
}

/// Height in inner nodes and number of primitives of every subtree.
fn measure(tree: &Tree, leaf_size: u32) -> Vec<(u32, u32)> {
    let mut extents = vec![(0, 0); tree.nodes.len()];
    let mut preorder = Vec::with_capacity(tree.nodes.len());
    let mut stack = Vec::new();
    stack.extend((!tree.nodes.is_empty()).then_some(0u32));
    while let Some(index) = stack.pop() {
        preorder.push(index);
        let node = tree.nodes[index as usize];
        if node.count == 0 {
            stack.extend([node.first, node.first + 1]);
        }
    }
    for &index in preorder.iter().rev() {
        let node = tree.nodes[index as usize];
        extents[index as usize] = if node.count > 0 {
            let height = if node.count > MAX_LEAF {
                balanced_depth(node.count, leaf_size)
            } else {
                0
            };
            (height, node.count)
        } else {
            let (left_height, left_count) = extents[node.first as usize];
            let (right_height, right_count) = extents[node.first as usize + 1];
            (1 + left_height.max(right_height), left_count + right_count)
        };
    }
    extents
}

/// True if this subtree is too deep and its children, balanced, would be too.
fn must_rebuild(
    tree: &Tree,
    extents: &[(u32, u32)],
    index: u32,
    depth: u32,
    shape: &Shape,
    leaf_size: u32,
) -> bool {
    let node = tree.nodes[index as usize];
    if node.count > 0 {
        return node.count > MAX_LEAF;
    }
    let (height, _) = extents[index as usize];
    depth + height > shape.max_depth
        && [node.first, node.first + 1].iter().any(|&child| {
            let (height, count) = extents[child as usize];
            depth + 1 + height.min(balanced_depth(count, leaf_size)) > shape.max_depth
        })
}

fn gather(tree: &Tree, root: u32, primitives: &mut Vec<u32>) {
    let mut stack = vec![root];
    while let Some(index) = stack.pop() {
        let node = tree.nodes[index as usize];
        if node.count > 0 {
            primitives.extend_from_slice(
                &tree.order[node.first as usize..(node.first + node.count) as usize],
            );
        } else {
            stack.extend([node.first + 1, node.first]);
        }
    }
}

/// Reorders `primitives` and returns how many go left: between 1 and all but one.
fn split_range(
    primitives: &mut [u32],
    boxes: &[Bounds32],
    shape: &Shape,
    leaf_size: u32,
    depth: u32,
) -> u32 {
    let count = primitives.len() as u32;
    if shape.split == Split::BinnedSah
        && let Some(left) = split_binned(primitives, boxes)
    {
        let larger = left.max(count - left);
        if depth + 1 + balanced_depth(larger, leaf_size) <= shape.max_depth {
            return left;
        }
    }
    let centers = Bounds32::of_points(
        primitives
            .iter()
            .map(|&index| boxes[index as usize].center()),
    );
    let axis = (centers.max - centers.min).max_position();
    let left = count.div_ceil(2);
    primitives.select_nth_unstable_by(left as usize, |&a, &b| {
        // The index decides between equal centres, so that the order is one and the same on every machine.
        let (center_a, center_b) = (
            boxes[a as usize].center()[axis],
            boxes[b as usize].center()[axis],
        );
        center_a.total_cmp(&center_b).then(a.cmp(&b))
    });
    left
}

/// Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", 2007. `None` where all centres coincide.
fn split_binned(primitives: &mut [u32], boxes: &[Bounds32]) -> Option<u32> {
    const BINS: usize = 12;
    let centers = Bounds32::of_points(
        primitives
            .iter()
            .map(|&index| boxes[index as usize].center()),
    );
    let size = centers.max - centers.min;
    let axis = size.max_position();
    let scale = BINS as f32 / size[axis];
    if !scale.is_finite() {
        return None;
    }
    let bin_of = |index: u32| {
        let offset = boxes[index as usize].center()[axis] - centers.min[axis];
        ((offset * scale) as usize).min(BINS - 1)
    };
    let mut bins = [(Bounds32::EMPTY, 0u32); BINS];
    for &index in primitives.iter() {
        let bin = &mut bins[bin_of(index)];
        bin.0 = bin.0.union(&boxes[index as usize]);
        bin.1 += 1;
    }
    let mut right_cost = [0.0; BINS];
    let (mut bounds, mut count) = (Bounds32::EMPTY, 0);
    for plane in (1..BINS).rev() {
        bounds = bounds.union(&bins[plane].0);
        count += bins[plane].1;
        right_cost[plane] = bounds.half_area() * f64::from(count);
    }
    let (mut bounds, mut count) = (Bounds32::EMPTY, 0);
    let mut best = (f64::INFINITY, 0);
    for plane in 1..BINS {
        bounds = bounds.union(&bins[plane - 1].0);
        count += bins[plane - 1].1;
        let cost = bounds.half_area() * f64::from(count) + right_cost[plane];
        if cost < best.0 && count > 0 && (count as usize) < primitives.len() {
            best = (cost, plane);
        }
    }
    if best.1 == 0 {
        return None;
    }
    // In place: swap from both ends. The result depends on the input order alone.
    let (mut left, mut right) = (0, primitives.len());
    while left < right {
        if bin_of(primitives[left]) < best.1 {
            left += 1;
        } else {
            right -= 1;
            primitives.swap(left, right);
        }
    }
    Some(left as u32)
}

/// Checks a hierarchy whose root is `nodes[root]`: every primitive of `expected` in exactly one leaf, inside the boxes
/// of all its ancestors, no leaf too large, no path too deep.
///
/// # Errors
/// One line that says what is wrong and where.
pub fn check(
    nodes: &[BvhNode],
    root: u32,
    expected: std::ops::Range<u32>,
    max_depth: u32,
    bounds_of: impl Fn(u32) -> Option<Bounds32>,
) -> Result<(), String> {
    let everywhere = Bounds32 {
        min: Vec3::NEG_INFINITY,
        max: Vec3::INFINITY,
    };
    let mut seen = vec![false; expected.len()];
    let mut visited = vec![false; nodes.len()];
    let mut stack = vec![(root, everywhere, 1u32)];
    while let Some((index, outer, depth)) = stack.pop() {
        let node = nodes
            .get(index as usize)
            .ok_or_else(|| format!("node {index} does not exist"))?;
        if std::mem::replace(&mut visited[index as usize], true) {
            return Err(format!("node {index} is reached twice"));
        }
        if depth > max_depth {
            return Err(format!(
                "node {index} lies at depth {depth}, beyond {max_depth}"
            ));
        }
        for (bounds, child, count) in children(node) {
            if bounds.is_empty() {
                continue;
            }
            if !outer.contains(&bounds) {
                return Err(format!(
                    "a child of node {index} sticks out of its parent's box"
                ));
            }
            if count == 0 {
                stack.push((child, bounds, depth + 1));
                continue;
            }
            if count > MAX_LEAF {
                return Err(format!("a leaf of node {index} holds {count} primitives"));
            }
            for primitive in child..child.saturating_add(count) {
                if !expected.contains(&primitive) {
                    return Err(format!(
                        "node {index} refers to primitive {primitive}, which is not in {expected:?}"
                    ));
                }
                if std::mem::replace(&mut seen[(primitive - expected.start) as usize], true) {
                    return Err(format!("primitive {primitive} lies in two leaves"));
                }
                let Some(own) = bounds_of(primitive) else {
                    return Err(format!("primitive {primitive} is to lie in no leaf"));
                };
                if !bounds.contains(&own) {
                    return Err(format!(
                        "primitive {primitive} sticks out of its leaf's box in node {index}"
                    ));
                }
            }
        }
    }
    let is_missing = |primitive: &u32| {
        !seen[(primitive - expected.start) as usize] && bounds_of(*primitive).is_some()
    };
    match expected.clone().find(is_missing) {
        Some(missing) => Err(format!("primitive {missing} lies in no leaf")),
        None => Ok(()),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn unit_boxes(count: u32) -> Vec<Bounds32> {
        (0..count)
            .map(|i| Bounds32::of_points([Vec3::X * i as f32, Vec3::new(i as f32 + 0.5, 1.0, 1.0)]))
            .collect()
    }

    /// A tree with one primitive per level: the worst that a builder could hand over.
    fn comb(count: u32) -> Tree {
        let mut nodes = vec![TreeNode { count: 0, first: 1 }];
        for i in 0..count - 1 {
            let next = nodes.len() as u32 + 2;
            nodes.push(TreeNode { count: 1, first: i });
            nodes.push(if i + 2 < count {
                TreeNode {
                    count: 0,
                    first: next,
                }
            } else {
                TreeNode {
                    count: 1,
                    first: i + 1,
                }
            });
        }
        Tree {
            nodes,
            order: (0..count).collect(),
        }
    }

    #[test]
    fn deep_trees_are_made_to_fit() {
        for (count, max_depth) in [
            (40, 48),
            (49, 48),
            (50, 48),
            (3000, 48),
            (3000, 12),
            (100_000, 20),
        ] {
            let boxes = unit_boxes(count);
            let shape = Shape {
                max_depth,
                leaf_size: 4,
                split: Split::Median,
                pad_units: 0.0,
            };
            let flat = flatten(Some(&comb(count)), &boxes, &shape);
            assert!(
                flat.depth <= max_depth,
                "{count} primitives: depth {}",
                flat.depth
            );
            assert_eq!(flat.rebuilt > 0, count > max_depth + 1);
            // A comb that is cut keeps its upper part: the rebuilt subtree hangs as low as it can.
            assert!(flat.rebuilt <= 1);
            check(&flat.nodes, 0, 0..count, max_depth, |i| {
                Some(boxes[flat.order[i as usize] as usize])
            })
            .unwrap();
        }
    }

    #[test]
    fn check_notices_faults() {
        let boxes = unit_boxes(100);
        let shape = Shape {
            max_depth: 48,
            leaf_size: 1,
            split: Split::BinnedSah,
            pad_units: 0.0,
        };
        let flat = flatten(None, &boxes, &shape);
        let check = |nodes: &[BvhNode], depth| {
            check(nodes, 0, 0..100, depth, |i| {
                Some(boxes[flat.order[i as usize] as usize])
            })
        };
        check(&flat.nodes, flat.depth).unwrap();
        assert!(
            check(&flat.nodes, flat.depth - 1)
                .unwrap_err()
                .contains("depth")
        );
        let mut broken = flat.nodes.clone();
        broken[5].left_max[0] -= 0.6;
        assert!(check(&broken, 48).is_err());
        let mut broken = flat.nodes.clone();
        let leaf = broken.iter().position(|node| node.left_count > 0).unwrap();
        broken[leaf].left_count += 1;
        assert!(check(&broken, 48).is_err());
        let mut broken = flat.nodes;
        broken[leaf].left_min = [1e18; 3];
        broken[leaf].left_max = [-1e18; 3];
        assert!(check(&broken, 48).unwrap_err().contains("no leaf"));
    }
}
