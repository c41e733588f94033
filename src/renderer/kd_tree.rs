//! The kd-tree over the photons, in place of the grid: `photon.search = "kd-tree"`.
//!
//! Left-balanced and built on the device: photons are sorted once along each axis, and level by level all three orders
//! are parted at the medians (Brown 2015, "Building a balanced k-d tree in O(kn log n) time"). Where a node's photons
//! lie follows from the node's number alone (`shaders/shared/kd_tree.wesl`), so no pass asks another how long its work
//! is. The order of equal coordinates is that of the paths: the same photons give the same tree.

use super::kernels::KernelSet;
use super::photon_map::SCAN_LIMIT;
use crate::gpu::buffers::read_buffer;
use crate::gpu::kernel::{Bound, linear_groups};
use crate::gpu::texels::CopiedBuffer;
use crate::gpu::{FrameRecorder, GpuContext, GpuError, Resources, storage_buffer};
use crate::passes::{self, Over, Pass};

/// Bits of a digit of the sorts along the axes.
pub const KD_DIGIT_BITS: u32 = 8;
/// Digits of a coordinate. Even: the sort ends in the buffer that it began in.
pub const KD_DIGITS: u32 = 4;
/// Turns of a walk in one slice of a gather.
pub const KD_TURNS_PER_SLICE: u64 = 60_000;
/// Bytes of a node.
const NODE_BYTES: u64 = 16;
/// Bytes of the arguments of an indirect dispatch, as the shaders lay them out.
const GROUPS_BYTES: u64 = 16;
/// Threads of a workgroup of the tree's passes.
const GROUP: u32 = 256;

/// Photons that a tree can be built over: one scan covers the marks of three orders.
pub const fn largest_tree() -> u64 {
    (SCAN_LIMIT - 4) / 3
}

/// Slices in which a whole tree of `stored` photons is walked for certain: every edge is crossed twice at most.
pub fn walk_slices(stored: u32) -> u32 {
    (2 * u64::from(stored)).div_ceil(KD_TURNS_PER_SLICE).max(1) as u32
}

/// Buffers and bind groups of the tree.
pub struct KdTree {
    capacity: u32,
    /// Photon numbers in the orders of x, y and z; levels read one and write the other.
    orders: [wgpu::Buffer; 2],
    axes: wgpu::Buffer,
    marks: wgpu::Buffer,
    mark_sums: wgpu::Buffer,
    /// Workgroups: see `kd_setup`.
    groups: wgpu::Buffer,
    nodes: CopiedBuffer,
    keys: Option<Bound>,
    sorted: Option<Bound>,
    /// From the first pair of orders to the second and back.
    levels: [Vec<Bound>; 2],
    scan: Vec<Bound>,
    place: Option<Bound>,
}

impl KdTree {
    /// Allocates for `capacity` photons. `texels`: gathers walk a copy of the nodes in a texture.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] if there are more than [`largest_tree`], or a buffer cannot be bound.
    pub fn new(context: &GpuContext, capacity: u32, texels: bool) -> Result<Self, GpuError> {
        let places = u64::from(capacity) * 3;
        if u64::from(capacity) > largest_tree() {
            return Err(GpuError::TooLarge {
                what: "kd-tree's orders".to_owned(),
                bytes: places * 4,
                limit: SCAN_LIMIT * 4,
                mend: "use fewer photons, or photon.search = \"grid\"",
            });
        }
        let buffer = |label, bytes| storage_buffer(context, label, bytes);
        Ok(Self {
            capacity,
            orders: [
                buffer("photons by axis, even levels", places * 4)?,
                buffer("photons by axis, odd levels", places * 4)?,
            ],
            axes: buffer("kd-tree axes", u64::from(capacity) * 4)?,
            // One more entry marks the end of the last order.
            marks: buffer("kd-tree marks", (places + 1) * 4)?,
            mark_sums: buffer(
                "kd-tree mark block sums",
                (places + 4).div_ceil(super::photon_map::SCAN_BLOCK) * 4,
            )?,
            groups: buffer("kd-tree groups", 3 * GROUPS_BYTES)?,
            nodes: CopiedBuffer::new(
                context,
                "kd-tree nodes",
                u64::from(capacity) * NODE_BYTES,
                texels,
            )?,
            keys: None,
            sorted: None,
            levels: [Vec::new(), Vec::new()],
            scan: Vec::new(),
            place: None,
        })
    }

    /// Levels that are parted in a full tree: all but the bottom one.
    fn parted_levels(capacity: u32) -> u32 {
        capacity.checked_ilog2().unwrap_or(0)
    }

    /// Entries of the map's dispatch table that the tree's passes use: one per axis, then one per level.
    pub fn dispatches(capacity: u32, kind: u32) -> Vec<[u32; 4]> {
        let entry = |index| [index, kind, capacity, 0];
        (0..3)
            .chain(0..Self::parted_levels(capacity))
            .map(entry)
            .collect()
    }

    /// Workgroups of the tree's passes, which a pass of the map writes.
    pub fn groups(&self) -> &wgpu::Buffer {
        &self.groups
    }

    /// What gathering passes read, beside the photons in heap order.
    pub fn nodes(&self) -> &CopiedBuffer {
        &self.nodes
    }

    /// Binds the passes; `map` holds the map's own buffers, `digits` the buffer that the sorts begin and end in.
    ///
    /// # Errors
    /// As [`crate::gpu::Kernel::bind`].
    pub fn bind(
        &mut self,
        context: &GpuContext,
        kernels: &KernelSet,
        map: &Resources<'_>,
        digits: &wgpu::Buffer,
    ) -> Result<(), GpuError> {
        let resources = |from: usize| {
            map.clone()
                .with("radix_from", digits)
                .with("radix_to", digits)
                .with("kd_from", &self.orders[from])
                .with("kd_to", &self.orders[1 - from])
                .with("kd_axes", &self.axes)
                .with("kd_marks", &self.marks)
                .with("kd_nodes", &self.nodes.buffer)
                .with("scan_values", &self.marks)
                .with("scan_sums", &self.mark_sums)
        };
        let bind = |list: &[&Pass], from: usize| {
            list.iter()
                .map(|pass| kernels.get(pass)?.bind(context, &resources(from)))
                .collect::<Result<Vec<_>, GpuError>>()
        };
        let mut order = bind(passes::KD_ORDER, 1)?.into_iter();
        let levels = [bind(passes::KD_LEVEL, 0)?, bind(passes::KD_LEVEL, 1)?];
        let scan = bind(passes::SCAN, 0)?;
        let last = Self::parted_levels(self.capacity) as usize % 2;
        let place = bind(passes::KD_FINISH, last)?.pop();
        self.keys = order.next();
        self.sorted = order.next();
        self.levels = levels;
        self.scan = scan;
        self.place = place;
        Ok(())
    }

    /// Records the building. `entry` is the tree's first one in the dispatch table, `label` names a pass in timings,
    /// `groups` holds the workgroups of a pass over photons, and `sort` records the digits of a sort.
    ///
    /// # Errors
    /// [`GpuError::Unbound`] before [`KdTree::bind`].
    pub fn record(
        &self,
        recorder: &mut FrameRecorder<'_>,
        kernels: &KernelSet,
        entry: u32,
        label: &dyn Fn(&Pass) -> String,
        groups: (&wgpu::Buffer, u64),
        sort: &dyn Fn(&mut FrameRecorder<'_>) -> Result<(), GpuError>,
    ) -> Result<(), GpuError> {
        let over_photons =
            |recorder: &mut FrameRecorder<'_>, pass: &Pass, bound: &Option<Bound>, entry: u32| {
                let kernel = kernels.get(pass)?;
                let bound = bound.as_ref().ok_or_else(|| unbound(pass))?;
                recorder.dispatch_indirect(&label(pass), kernel, bound, entry, groups.0, groups.1);
                Ok::<(), GpuError>(())
            };
        for axis in 0..3 {
            let entry = entry + axis;
            over_photons(recorder, &passes::kd_keys::PASS, &self.keys, entry)?;
            sort(recorder)?;
            over_photons(recorder, &passes::kd_orders::PASS, &self.sorted, entry)?;
        }
        for level in 0..Self::parted_levels(self.capacity) {
            let entry = entry + 3 + level;
            let bound = &self.levels[(level % 2) as usize];
            for (pass, bound) in passes::KD_LEVEL.iter().zip(bound) {
                let kernel = kernels.get(pass)?;
                if pass.over == Over::Level {
                    let groups = linear_groups(1 << level, GROUP);
                    recorder.dispatch(&label(pass), kernel, bound, entry, groups);
                    continue;
                }
                recorder.dispatch_indirect(&label(pass), kernel, bound, entry, &self.groups, 0);
                if pass.name != passes::kd_flag::PASS.name {
                    continue;
                }
                for (pass, bound) in passes::SCAN.iter().zip(&self.scan) {
                    let (kernel, label) = (kernels.get(pass)?, label(pass));
                    let at = match pass.over {
                        Over::ScanBlocks => GROUPS_BYTES,
                        Over::ScanValues => 2 * GROUPS_BYTES,
                        _ => {
                            recorder.dispatch(&label, kernel, bound, 0, [1, 1, 1]);
                            continue;
                        }
                    };
                    recorder.dispatch_indirect(&label, kernel, bound, 0, &self.groups, at);
                }
            }
        }
        over_photons(recorder, &passes::kd_place::PASS, &self.place, entry)
    }

    /// Records every pass over nothing, with a dispatch entry of none.
    ///
    /// # Errors
    /// [`GpuError::Unbound`] before [`KdTree::bind`].
    pub fn record_warm_up(
        &self,
        recorder: &mut FrameRecorder<'_>,
        kernels: &KernelSet,
        empty_entry: u32,
    ) -> Result<(), GpuError> {
        let order = self.keys.iter().chain(&self.sorted);
        let bound = order.chain(&self.levels[0]).chain(&self.place);
        for (pass, bound) in Self::passes().zip(bound) {
            recorder.dispatch(pass.name, kernels.get(pass)?, bound, empty_entry, [1, 1, 1]);
        }
        Ok(())
    }

    /// The tree's own passes.
    pub fn passes() -> impl Iterator<Item = &'static &'static Pass> {
        passes::KD_ORDER
            .iter()
            .chain(passes::KD_LEVEL)
            .chain(passes::KD_FINISH)
    }

    /// Reads back the first `count` nodes: position (photon space, metres) and axis, 0 to 2, along which the node parts
    /// its subtree. For tests and diagnostics.
    ///
    /// # Errors
    /// As [`read_buffer`].
    pub fn read(&self, context: &GpuContext, count: u32) -> Result<Vec<[f32; 4]>, GpuError> {
        read_buffer(context, "kd-tree nodes", &self.nodes.buffer, count as usize)
    }
}

fn unbound(pass: &Pass) -> GpuError {
    GpuError::Unbound {
        pass: pass.name.to_owned(),
        binding: "any (the kd-tree was not bound)".to_owned(),
    }
}
