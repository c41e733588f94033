//! The photon map: tracing in batches, storage, and the grid.

use std::collections::BTreeMap;

use glam::DVec3;

use super::kd_tree::{KdTree, walk_slices};
use super::kernels::KernelSet;
use super::map_config::largest_capacity;
use crate::gpu::buffers::read_buffer;
use crate::gpu::kernel::{Bound, dispatch_table, linear_groups};
use crate::gpu::texels::CopiedBuffer;
use crate::gpu::{FrameRecorder, GpuContext, GpuError, Resources, storage_buffer};
use crate::passes::{self, Pass};
use crate::settings::{Loads, Search};

pub use super::map_config::{MapKind, PhotonMapConfig};
pub use super::photon_records::{Photon, PhotonCounters, PhotonGrid};

/// Scratch for the paths of one batch, bytes. Smaller batches fit a GPU's cache better but sync more often.
const BATCH_SCRATCH_BYTES: u64 = 32 << 20;
/// Bytes of one photon.
pub const PHOTON_BYTES: u64 = 32;
/// Values that three scan passes cover: 2,048 blocks of 2,048.
pub(super) const SCAN_LIMIT: u64 = 2048 * 2048;
/// Values of one scan block.
pub(super) const SCAN_BLOCK: u64 = 2048;
/// Photons that one thread of the radix sort handles; `shared/photon.wesl` holds the same number.
pub const RADIX_BLOCK: u32 = 256;
/// Photons that one slice of the gather may have to walk: llvmpipe ends a thread's loops after 65,535 turns.
const PHOTONS_PER_SLICE: u64 = 60_000;
/// Photons of one batch of the gather by workgroups, and batches of one of its slices; `passes/shared_gather.wesl` holds
/// the same numbers.
pub const SHARED_BATCH: u64 = 64;
/// See [`SHARED_BATCH`].
pub const SHARED_BATCHES_PER_SLICE: u64 = 850;

/// Byte offset of the indirect arguments in [`PhotonGrid`].
const PHOTON_GROUPS_OFFSET: u64 = std::mem::offset_of!(PhotonGrid, photon_groups) as u64;
const BLOCK_GROUPS_OFFSET: u64 = std::mem::offset_of!(PhotonGrid, block_groups) as u64;
const VALUE_GROUPS_OFFSET: u64 = std::mem::offset_of!(PhotonGrid, value_groups) as u64;

/// Photons of one batch of paths, in slots of the paths' own.
struct BatchBuffers {
    photons: wgpu::Buffer,
    counts: wgpu::Buffer,
}

/// Which paths are traced for a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Due {
    /// All.
    All,
    /// One share, counted around: the others' photons stay.
    Share(u32),
}

struct Buffers {
    /// One for all batches in turn, or, where shares of the paths are kept, one for each.
    batches: Vec<BatchBuffers>,
    path_counts: wgpu::Buffer,
    path_sums: wgpu::Buffer,
    photons: wgpu::Buffer,
    sorted: CopiedBuffer,
    radix: [wgpu::Buffer; 2],
    radix_table: wgpu::Buffer,
    radix_sums: wgpu::Buffer,
    longest_cell: wgpu::Buffer,
    kept: wgpu::Buffer,
    counters: wgpu::Buffer,
    bounds: wgpu::Buffer,
    grid: wgpu::Buffer,
    cell_starts: wgpu::Buffer,
    cell_sums: wgpu::Buffer,
    dispatch: wgpu::Buffer,
}

/// Buffers and bind groups of the photon map.
pub struct PhotonMap {
    config: PhotonMapConfig,
    capacity: u32,
    batch_paths: u32,
    slots_per_path: u32,
    buffers: Buffers,
    tree: Option<KdTree>,
    bound: BTreeMap<&'static str, Bound>,
    /// Passes over a batch's own buffers, by batch buffers, in the order of [`MapKind::batch`].
    bound_batches: Vec<Vec<Bound>>,
    bound_cell_scan: Vec<Bound>,
    bound_path_scan: Vec<Bound>,
    bound_radix_scan: Vec<Bound>,
    /// Passes of a digit, from the first buffer to the second and back.
    bound_radix: [Vec<Bound>; 2],
    longest_cell: u32,
    /// Render-space origin (world, metres) and frame number of the last trace.
    traced_at: Option<(DVec3, u32)>,
    last: PhotonCounters,
}

fn unbound(pass: &str) -> GpuError {
    GpuError::Unbound {
        pass: pass.to_owned(),
        binding: "any (the photon map was not bound)".to_owned(),
    }
}

impl PhotonMap {
    /// Allocates for `config`.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] if a buffer cannot be bound.
    pub fn new(context: &GpuContext, config: PhotonMapConfig) -> Result<Self, GpuError> {
        let slots_per_path = config.max_depth.saturating_sub(1).clamp(1, 63);
        let batch_limit = BATCH_SCRATCH_BYTES / (PHOTON_BYTES * u64::from(slots_per_path));
        let share = config.paths.div_ceil(config.shares.max(1));
        let batch_paths = u64::from(share).clamp(1, batch_limit) as u32;
        // Bright interiors store about two photons per path, and few paths meet glass; a map that overflows is grown
        // after the frame.
        let per_path = match config.kind {
            MapKind::Photons => 3,
            MapKind::Caustics => 1,
        };
        let largest = largest_capacity(context, &config);
        let capacity = match config.capacity {
            0 => config
                .paths
                .saturating_mul(per_path)
                .clamp(1024, largest.max(1024)),
            fixed => fixed,
        };
        Self::with_capacity(context, config, capacity, batch_paths, slots_per_path)
    }

    fn with_capacity(
        context: &GpuContext,
        config: PhotonMapConfig,
        capacity: u32,
        batch_paths: u32,
        slots_per_path: u32,
    ) -> Result<Self, GpuError> {
        let buffer = |label, bytes| storage_buffer(context, label, bytes);
        // One more entry marks the last run's end; together they fill whole 16-byte units, as buffers do.
        let cells = u64::from(config.table_cells()).clamp(64, SCAN_LIMIT - 4) / 4 * 4 - 1;
        let photon_bytes = u64::from(capacity) * PHOTON_BYTES;
        let kind = config.kind.index();
        let mut batches = Vec::new();
        let mut first = 0;
        while first < config.paths {
            let count = batch_paths.min(config.paths - first);
            batches.push([first, kind, count, slots_per_path]);
            first += count;
        }
        // One empty batch, for warming up; then one entry per digit of the sort.
        batches.push([0, kind, 0, slots_per_path]);
        let sums = |values: u64| (values + 1).div_ceil(SCAN_BLOCK) * 4;
        let (digits, digit_bits) = config.digits();
        let blocks = capacity.div_ceil(RADIX_BLOCK);
        let table = u64::from(blocks) << digit_bits;
        if table > SCAN_LIMIT {
            return Err(GpuError::TooLarge {
                what: "radix table".to_owned(),
                bytes: table * 4,
                limit: SCAN_LIMIT * 4,
                mend: "use fewer photons or a smaller photon.grid_cells_max",
            });
        }
        for digit in 0..digits {
            batches.push([digit * digit_bits, 0, blocks, (1 << digit_bits) - 1]);
        }
        let tree = match config.search {
            Search::Grid => None,
            Search::KdTree => {
                batches.extend(KdTree::dispatches(capacity, kind));
                Some(KdTree::new(context, capacity, config.texels)?)
            }
        };
        let path_counts = buffer("photon path counts", (u64::from(batch_paths) + 1) * 4)?;
        let slot_bytes = u64::from(batch_paths) * u64::from(slots_per_path) * PHOTON_BYTES;
        let batch_buffers = if config.shares > 1 {
            (0..config.paths.div_ceil(batch_paths).max(1))
                .map(|_| {
                    Ok(BatchBuffers {
                        photons: buffer("photon path slots", slot_bytes)?,
                        counts: buffer("kept photon path counts", path_counts.size())?,
                    })
                })
                .collect::<Result<Vec<_>, GpuError>>()?
        } else {
            vec![BatchBuffers {
                photons: buffer("photon path slots", slot_bytes)?,
                counts: path_counts.clone(),
            }]
        };
        let buffers = Buffers {
            batches: batch_buffers,
            path_counts,
            path_sums: buffer("photon path block sums", sums(u64::from(batch_paths)))?,
            photons: buffer("photon list", photon_bytes)?,
            sorted: CopiedBuffer::new(
                context,
                "photons in cell order",
                photon_bytes,
                config.texels,
            )?,
            radix: [
                buffer("photon cells, even digits", u64::from(capacity) * 8)?,
                buffer("photon cells, odd digits", u64::from(capacity) * 8)?,
            ],
            radix_table: buffer("radix table", table * 4)?,
            radix_sums: buffer("radix block sums", sums(table))?,
            longest_cell: buffer("longest photon cell", 16)?,
            kept: buffer("photon paths kept", 8)?,
            counters: buffer("photon counters", size_of::<PhotonCounters>() as u64)?,
            bounds: buffer("photon bounds", 24)?,
            grid: buffer("photon grid", size_of::<PhotonGrid>() as u64)?,
            cell_starts: buffer("photon cell starts", (cells + 1) * 4)?,
            cell_sums: buffer("photon cell block sums", sums(cells + 4))?,
            dispatch: dispatch_table(context, "photon batches", &batches),
        };
        Ok(Self {
            config,
            capacity,
            batch_paths,
            slots_per_path,
            buffers,
            tree,
            bound: BTreeMap::new(),
            bound_batches: Vec::new(),
            bound_cell_scan: Vec::new(),
            bound_path_scan: Vec::new(),
            bound_radix_scan: Vec::new(),
            bound_radix: [Vec::new(), Vec::new()],
            longest_cell: 0,
            traced_at: None,
            last: PhotonCounters::default(),
        })
    }

    /// Photons that the list can hold.
    pub fn capacity(&self) -> u32 {
        self.capacity
    }

    /// Paths that one thread traces.
    pub(super) fn paths_per_thread(&self) -> u32 {
        self.config.paths_per_thread
    }

    /// Counters of the last trace.
    pub fn counters(&self) -> PhotonCounters {
        self.last
    }

    /// Where (world, metres) and in which frame the photons were traced last.
    pub fn traced_at(&self) -> Option<(DVec3, u32)> {
        self.traced_at
    }

    /// What gathering passes read.
    pub fn resources(&self) -> Resources<'_> {
        let resources = Resources::new()
            .with("photon_grid", &self.buffers.grid)
            .with("cell_starts", &self.buffers.cell_starts)
            .with("photon_counters", &self.buffers.counters);
        let resources = self.buffers.sorted.read_by(resources, "sorted_photons");
        match &self.tree {
            None => resources,
            Some(tree) => tree.nodes().read_by(resources, "kd_nodes"),
        }
    }

    /// Binds every pass anew: at the start, after growing, and when scene buffers were replaced.
    ///
    /// # Errors
    /// As [`crate::gpu::Kernel::bind`].
    pub fn bind(
        &mut self,
        context: &GpuContext,
        kernels: &KernelSet,
        scene: &Resources<'_>,
    ) -> Result<(), GpuError> {
        let b = &self.buffers;
        let own = Resources::new()
            .with("dispatch", &b.dispatch)
            .with("path_starts", &b.path_counts)
            .with("photon_counters", &b.counters)
            .with("photons", &b.photons)
            .with("photon_kept", &b.kept)
            .with("photon_bounds", &b.bounds)
            .with("photon_grid", &b.grid)
            .with("cell_starts", &b.cell_starts)
            // `cell_count` fills the first buffer; an odd number of digits ends in the second.
            .with("radix_to", &b.radix[0])
            .with("radix_from", &b.radix[1])
            .with("longest_cell", &b.longest_cell)
            .with("sorted_photons", &b.sorted.buffer);
        let mut all = scene.clone().and(&own);
        if let Some(tree) = &self.tree {
            all = all.with("kd_groups", tree.groups());
        }
        let mut bound = BTreeMap::new();
        let others = self.config.layout().iter().chain(self.config.finish());
        for pass in others {
            bound.insert(pass.name, kernels.get(pass)?.bind(context, &all)?);
        }
        let bound_batches = b.batches.iter().map(|batch| {
            let resources = all
                .clone()
                .with("path_photons", &batch.photons)
                .with("path_counts", &batch.counts);
            let passes = self.config.kind.batch().iter();
            passes
                .map(|pass| kernels.get(pass)?.bind(context, &resources))
                .collect::<Result<Vec<_>, GpuError>>()
        });
        self.bound_batches = bound_batches.collect::<Result<Vec<_>, GpuError>>()?;
        if let Some(tree) = &mut self.tree {
            // An even number of digits ends where it began.
            tree.bind(context, kernels, &own, &b.radix[0])?;
        }
        let scan = |values, sums| {
            passes::SCAN
                .iter()
                .map(|pass| {
                    kernels.get(pass)?.bind(
                        context,
                        &Resources::new()
                            .with("scan_values", values)
                            .with("scan_sums", sums),
                    )
                })
                .collect::<Result<Vec<_>, GpuError>>()
        };
        self.bound_path_scan = scan(&b.path_counts, &b.path_sums)?;
        self.bound_cell_scan = scan(&b.cell_starts, &b.cell_sums)?;
        self.bound_radix_scan = scan(&b.radix_table, &b.radix_sums)?;
        let digit = |from, to| {
            let resources = Resources::new()
                .with("dispatch", &b.dispatch)
                .with("photon_counters", &b.counters)
                .with("radix_table", &b.radix_table)
                .with("radix_from", from)
                .with("radix_to", to);
            passes::RADIX_DIGIT
                .iter()
                .map(|pass| kernels.get(pass)?.bind(context, &resources))
                .collect::<Result<Vec<_>, GpuError>>()
        };
        self.bound_radix = [
            digit(&b.radix[0], &b.radix[1])?,
            digit(&b.radix[1], &b.radix[0])?,
        ];
        self.bound = bound;
        Ok(())
    }

    fn bound(&self, pass: &Pass) -> Result<&Bound, GpuError> {
        self.bound.get(pass.name).ok_or_else(|| unbound(pass.name))
    }

    fn scan(
        &self,
        recorder: &mut FrameRecorder<'_>,
        kernels: &KernelSet,
        bound: &[Bound],
        values: &wgpu::Buffer,
    ) -> Result<(), GpuError> {
        let count = (values.size() / 4) as u32;
        let blocks = count.div_ceil(SCAN_BLOCK as u32);
        for (pass, bound) in passes::SCAN.iter().zip(bound) {
            let groups = match pass.over {
                passes::Over::ScanBlocks => linear_groups(blocks, 1),
                passes::Over::ScanValues => linear_groups(count, 256),
                _ => [1, 1, 1],
            };
            recorder.dispatch(
                &self.config.kind.label(pass),
                kernels.get(pass)?,
                bound,
                0,
                groups,
            );
        }
        Ok(())
    }

    /// Scans the grid's cells in use, which `grid_setup` counted: a table may have many times as many.
    fn scan_cells(
        &self,
        recorder: &mut FrameRecorder<'_>,
        kernels: &KernelSet,
    ) -> Result<(), GpuError> {
        for (pass, bound) in passes::SCAN.iter().zip(&self.bound_cell_scan) {
            let kernel = kernels.get(pass)?;
            let label = self.config.kind.label(pass);
            let offset = match pass.over {
                passes::Over::ScanBlocks => BLOCK_GROUPS_OFFSET,
                passes::Over::ScanValues => VALUE_GROUPS_OFFSET,
                _ => {
                    recorder.dispatch(&label, kernel, bound, 0, [1, 1, 1]);
                    continue;
                }
            };
            recorder.dispatch_indirect(&label, kernel, bound, 0, &self.buffers.grid, offset);
        }
        Ok(())
    }

    /// Batches of the paths.
    fn batch_count(&self) -> u32 {
        self.config.paths.div_ceil(self.batch_paths)
    }

    /// Shares in which the paths can be traced anew.
    pub fn shares(&self) -> u32 {
        self.config.shares.min(self.batch_count()).max(1)
    }

    /// Records tracing what is due, and sorting. The photons' space is the render space of a head at `origin_in_world`:
    /// this frame's where all paths are due, else that of the photons that stay. Returns the number of paths traced.
    ///
    /// # Errors
    /// [`GpuError::Unbound`] before [`PhotonMap::bind`].
    pub fn record(
        &mut self,
        recorder: &mut FrameRecorder<'_>,
        kernels: &KernelSet,
        origin_in_world: DVec3,
        frame_index: u32,
        due: Due,
    ) -> Result<u32, GpuError> {
        let mut paths_traced = 0;
        let shares = self.shares();
        let is_due = |batch: u32| match due {
            Due::All => true,
            Due::Share(share) => batch % shares == share % shares,
        };
        let b = &self.buffers;
        for buffer in [
            &b.counters,
            &b.kept,
            &b.bounds,
            &b.cell_starts,
            &b.longest_cell,
        ] {
            recorder.clear(buffer);
        }
        let batches = self.batch_count();
        for batch in 0..batches {
            let count = self
                .batch_paths
                .min(self.config.paths - batch * self.batch_paths);
            let kept = self.config.shares > 1;
            let index = if kept { batch as usize } else { 0 };
            let (Some(own), Some(bound)) = (b.batches.get(index), self.bound_batches.get(index))
            else {
                return Err(unbound("photon batch"));
            };
            for (step, (pass, bound)) in self.config.kind.batch().iter().zip(bound).enumerate() {
                let kernel = kernels.get(pass)?;
                let traces = step == 0;
                let groups = match pass.over {
                    passes::Over::Batch if traces => {
                        kernel.groups_for(self.config.tracing_threads(count))
                    }
                    passes::Over::Batch => kernel.groups_for(count),
                    _ => [1, 1, 1],
                };
                if traces && is_due(batch) {
                    recorder.clear(&own.counts);
                    paths_traced += count;
                }
                if !traces || is_due(batch) {
                    let label = self.config.kind.label(pass);
                    recorder.dispatch(&label, kernel, bound, batch, groups);
                }
                if traces {
                    if kept {
                        // The scan is in place, and these counts serve again.
                        recorder.copy(&own.counts, &b.path_counts, own.counts.size());
                    }
                    self.scan(recorder, kernels, &self.bound_path_scan, &b.path_counts)?;
                }
            }
        }
        for pass in self.config.layout() {
            self.record_over_photons(recorder, kernels, pass)?;
        }
        let sort =
            |recorder: &mut FrameRecorder<'_>| self.record_sort(recorder, kernels, batches + 1);
        match &self.tree {
            None => {
                self.scan_cells(recorder, kernels)?;
                sort(recorder)?;
            }
            Some(tree) => tree.record(
                recorder,
                kernels,
                batches + 1 + self.config.digits().0,
                &|pass| self.config.kind.label(pass),
                (&b.grid, PHOTON_GROUPS_OFFSET),
                &sort,
            )?,
        }
        for pass in self.config.finish() {
            self.record_over_photons(recorder, kernels, pass)?;
        }
        let kind = self.config.kind;
        if let Some(tree) = &self.tree {
            let label = kind.label(&passes::kd_place::PASS);
            b.sorted.record(recorder, &label);
            tree.nodes().record(recorder, &label);
        } else {
            b.sorted
                .record(recorder, &kind.label(&passes::photon_reorder::PASS));
        }
        self.traced_at = Some((origin_in_world, frame_index));
        Ok(paths_traced)
    }

    /// Sorts by key; `first_entry` is that of the lowest digit in the dispatch table.
    fn record_sort(
        &self,
        recorder: &mut FrameRecorder<'_>,
        kernels: &KernelSet,
        first_entry: u32,
    ) -> Result<(), GpuError> {
        let b = &self.buffers;
        let blocks = self.capacity.div_ceil(RADIX_BLOCK);
        for digit in 0..self.config.digits().0 {
            recorder.clear(&b.radix_table);
            let bound = &self.bound_radix[(digit % 2) as usize];
            for (step, (pass, bound)) in passes::RADIX_DIGIT.iter().zip(bound).enumerate() {
                let kernel = kernels.get(pass)?;
                recorder.dispatch(
                    &self.config.kind.label(pass),
                    kernel,
                    bound,
                    first_entry + digit,
                    kernel.groups_for(blocks),
                );
                if step == 0 {
                    self.scan(recorder, kernels, &self.bound_radix_scan, &b.radix_table)?;
                }
            }
        }
        Ok(())
    }

    fn record_over_photons(
        &self,
        recorder: &mut FrameRecorder<'_>,
        kernels: &KernelSet,
        pass: &Pass,
    ) -> Result<(), GpuError> {
        let kernel = kernels.get(pass)?;
        let bound = self.bound(pass)?;
        let name = self.config.kind.label(pass);
        match pass.over {
            passes::Over::Photons => recorder.dispatch_indirect(
                &name,
                kernel,
                bound,
                0,
                &self.buffers.grid,
                PHOTON_GROUPS_OFFSET,
            ),
            passes::Over::PhotonSixteenths => {
                let groups = kernel.groups_for(self.capacity.div_ceil(16));
                recorder.dispatch(&name, kernel, bound, 0, groups);
            }
            _ => recorder.dispatch(&name, kernel, bound, 0, [1, 1, 1]),
        }
        Ok(())
    }

    /// Slices that the gather needs so that no thread walks too many photons. In a grid: by the bound of 27 cells as full
    /// as the fullest, or all photons; where workgroups load them, or in a kd-tree, by all photons, as gathers there go
    /// on where the slice before stopped and end at once if there is nothing left.
    pub fn gather_slices(&self) -> u32 {
        if self.tree.is_some() {
            return walk_slices(self.last.stored);
        }
        if self.config.loads == Loads::Cooperative {
            let most = SHARED_BATCH * SHARED_BATCHES_PER_SLICE;
            // The last batch may begin at the list's end.
            return (u64::from(self.last.stored) + 1).div_ceil(most).max(1) as u32;
        }
        let most = (27 * u64::from(self.longest_cell)).min(u64::from(self.last.stored));
        most.div_ceil(PHOTONS_PER_SLICE).max(1) as u32
    }

    /// Records every pass over nothing.
    ///
    /// # Errors
    /// [`GpuError::Unbound`] before [`PhotonMap::bind`].
    pub fn record_warm_up(
        &self,
        recorder: &mut FrameRecorder<'_>,
        kernels: &KernelSet,
    ) -> Result<(), GpuError> {
        let empty_batch = self.batch_count();
        let batch = self.bound_batches.iter().take(1).flatten();
        for (pass, bound) in self.config.kind.batch().iter().zip(batch) {
            recorder.dispatch(pass.name, kernels.get(pass)?, bound, empty_batch, [1, 1, 1]);
        }
        for pass in self.config.layout().iter().chain(self.config.finish()) {
            let bound = self.bound(pass)?;
            recorder.dispatch(pass.name, kernels.get(pass)?, bound, empty_batch, [1, 1, 1]);
        }
        if let Some(tree) = &self.tree {
            tree.record_warm_up(recorder, kernels, empty_batch)?;
        }
        let radix = passes::RADIX_DIGIT.iter().zip(&self.bound_radix[0]);
        for (pass, bound) in passes::SCAN.iter().zip(&self.bound_cell_scan).chain(radix) {
            recorder.dispatch(pass.name, kernels.get(pass)?, bound, empty_batch, [1, 1, 1]);
        }
        Ok(())
    }

    /// Reads the counters of the trace that was just submitted.
    ///
    /// # Errors
    /// As [`read_buffer`].
    pub fn read_counters(&mut self, context: &GpuContext) -> Result<PhotonCounters, GpuError> {
        let counters: Vec<PhotonCounters> =
            read_buffer(context, "photon counters", &self.buffers.counters, 1)?;
        self.last = counters.first().copied().unwrap_or_default();
        let longest: Vec<u32> = read_buffer(
            context,
            "longest photon cell",
            &self.buffers.longest_cell,
            1,
        )?;
        self.longest_cell = longest.first().copied().unwrap_or_default();
        Ok(self.last)
    }

    /// Makes room for all that the last trace demanded; true if the list grew (bind and trace again then). A fixed
    /// capacity stays, so that an overflow can be provoked and seen.
    ///
    /// # Errors
    /// As [`storage_buffer`].
    pub fn grow(&mut self, context: &GpuContext) -> Result<bool, GpuError> {
        if self.last.dropped == 0 || self.config.capacity != 0 {
            return Ok(false);
        }
        let largest = largest_capacity(context, &self.config);
        let wanted = (u64::from(self.last.demanded) * 5 / 4).min(u64::from(largest)) as u32;
        if wanted <= self.capacity {
            return Ok(false);
        }
        let last = self.last;
        *self = Self::with_capacity(
            context,
            self.config,
            wanted,
            self.batch_paths,
            self.slots_per_path,
        )?;
        self.last = last;
        Ok(true)
    }

    /// The kd-tree, where photons are searched by one.
    pub fn tree(&self) -> Option<&KdTree> {
        self.tree.as_ref()
    }

    /// Reads back the photons in cell order, or in the kd-tree's: for tests and diagnostics.
    ///
    /// # Errors
    /// As [`read_buffer`].
    pub fn read_photons(&self, context: &GpuContext) -> Result<Vec<Photon>, GpuError> {
        read_buffer(
            context,
            "photons",
            &self.buffers.sorted.buffer,
            self.last.stored as usize,
        )
    }

    /// Reads back the grid and the first `cells + 1` cell starts: for tests and diagnostics.
    ///
    /// # Errors
    /// As [`read_buffer`].
    pub fn read_grid(&self, context: &GpuContext) -> Result<(PhotonGrid, Vec<u32>), GpuError> {
        let grid: Vec<PhotonGrid> = read_buffer(context, "photon grid", &self.buffers.grid, 1)?;
        let grid = grid.first().copied().unwrap_or_default();
        let starts = read_buffer(
            context,
            "photon cell starts",
            &self.buffers.cell_starts,
            grid.cell_count as usize + 1,
        )?;
        Ok((grid, starts))
    }
}
