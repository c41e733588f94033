//! The photon map: tracing in batches, storage, and the grid.

use std::collections::BTreeMap;

use bytemuck::{Pod, Zeroable};
use glam::DVec3;

use super::kernels::KernelSet;
use crate::gpu::buffers::read_buffer;
use crate::gpu::kernel::{Bound, dispatch_table, linear_groups};
use crate::gpu::{FrameRecorder, GpuContext, GpuError, Resources, storage_buffer};
use crate::passes;

/// Scratch for the paths of one batch, bytes. Smaller batches fit a GPU's cache better but sync more often.
const BATCH_SCRATCH_BYTES: u64 = 32 << 20;
/// Bytes of one photon.
pub const PHOTON_BYTES: u64 = 32;
/// Values that three scan passes cover: 2,048 blocks of 2,048.
const SCAN_LIMIT: u64 = 2048 * 2048;
/// Values of one scan block.
const SCAN_BLOCK: u64 = 2048;

/// Twin of `PhotonCounters` in `shaders/shared/photon.wesl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct PhotonCounters {
    /// Photons in the list.
    pub stored: u32,
    /// Photons that found no room.
    pub dropped: u32,
    /// Paths whose photons were all kept; the flux is divided by this.
    pub paths_kept: u32,
    /// Paths traced.
    pub paths_traced: u32,
    /// Unused between batches.
    pub batch_total: u32,
    /// Photons that all paths made.
    pub demanded: u32,
    /// Unused.
    pub padding: [u32; 2],
}

/// Twin of `Photon` in `shaders/shared/photon.wesl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
pub struct Photon {
    /// Photon space, metres.
    pub position: [f32; 3],
    /// Direction of flight, octahedral, 16 bits each.
    pub direction: u32,
    /// Power, W, before division by the number of paths.
    pub flux: [f32; 3],
    /// Normal (13 bits each) and segments from the light (6 bits).
    pub normal_depth: u32,
}

/// Twin of `PhotonGrid` in `shaders/shared/grid.wesl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
pub struct PhotonGrid {
    /// Lower corner of the padding layer, photon space, metres.
    pub origin: [f32; 3],
    /// 1 / cell edge, 1/m.
    pub inverse_edge: f32,
    /// Cells along each axis, padding included.
    pub dims: [u32; 3],
    /// 0 for a dense grid, else the number of hashed row starts.
    pub hashed_rows: u32,
    /// Table cells in use.
    pub cell_count: u32,
    /// 1 if there are photons.
    pub has_photons: u32,
    /// Cell edge, metres.
    pub edge: f32,
    /// Unused.
    pub padding: u32,
    /// Indirect dispatch over cells.
    pub cell_groups: [u32; 4],
    /// Indirect dispatch over photons.
    pub photon_groups: [u32; 4],
}

/// Byte offsets of the indirect arguments in [`PhotonGrid`].
const CELL_GROUPS_OFFSET: u64 = std::mem::offset_of!(PhotonGrid, cell_groups) as u64;
const PHOTON_GROUPS_OFFSET: u64 = std::mem::offset_of!(PhotonGrid, photon_groups) as u64;

/// What the photon map of a scene is made for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhotonMapConfig {
    /// Paths per frame.
    pub paths: u32,
    /// Longest light path from eye to light, in segments.
    pub max_depth: u32,
    /// Photons that the list holds; 0 lets it grow by demand.
    pub capacity: u32,
    /// Cells of the table.
    pub cells: u32,
}

struct Buffers {
    path_photons: wgpu::Buffer,
    path_counts: wgpu::Buffer,
    path_sums: wgpu::Buffer,
    photons: wgpu::Buffer,
    sorted: wgpu::Buffer,
    order: wgpu::Buffer,
    kept: wgpu::Buffer,
    counters: wgpu::Buffer,
    bounds: wgpu::Buffer,
    grid: wgpu::Buffer,
    cell_starts: wgpu::Buffer,
    cell_cursors: wgpu::Buffer,
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
    bound: BTreeMap<&'static str, Bound>,
    bound_cell_scan: Vec<Bound>,
    bound_path_scan: Vec<Bound>,
    /// Render-space origin (world, metres) and frame number of the last trace.
    traced_at: Option<(DVec3, u32)>,
    last: PhotonCounters,
}

impl PhotonMap {
    /// Allocates for `config`.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] if a buffer cannot be bound.
    pub fn new(context: &GpuContext, config: PhotonMapConfig) -> Result<Self, GpuError> {
        let slots_per_path = config.max_depth.saturating_sub(1).clamp(1, 63);
        let batch_limit = BATCH_SCRATCH_BYTES / (PHOTON_BYTES * u64::from(slots_per_path));
        let batch_paths = u64::from(config.paths).clamp(1, batch_limit) as u32;
        // Bright interiors store about two photons per path; a map that overflows is grown after the frame.
        let largest = (context.max_binding_bytes / PHOTON_BYTES).min(u64::from(u32::MAX)) as u32;
        let capacity = match config.capacity {
            0 => config
                .paths
                .saturating_mul(3)
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
        let cells = u64::from(config.cells).min(SCAN_LIMIT - 4);
        let photon_bytes = u64::from(capacity) * PHOTON_BYTES;
        let mut batches = Vec::new();
        let mut first = 0;
        while first < config.paths {
            let count = batch_paths.min(config.paths - first);
            batches.push([first, 0, count, slots_per_path]);
            first += count;
        }
        // One empty batch at the end, for warming up.
        batches.push([0, 0, 0, slots_per_path]);
        let sums = |values: u64| (values + 1).div_ceil(SCAN_BLOCK) * 4;
        let buffers = Buffers {
            path_photons: buffer(
                "photon path slots",
                u64::from(batch_paths) * u64::from(slots_per_path) * PHOTON_BYTES,
            )?,
            path_counts: buffer("photon path counts", (u64::from(batch_paths) + 1) * 4)?,
            path_sums: buffer("photon path block sums", sums(u64::from(batch_paths)))?,
            photons: buffer("photon list", photon_bytes)?,
            sorted: buffer("photons in cell order", photon_bytes)?,
            order: buffer("photon order", u64::from(capacity) * 4)?,
            kept: buffer("photon paths kept", 8)?,
            counters: buffer("photon counters", size_of::<PhotonCounters>() as u64)?,
            bounds: buffer("photon bounds", 24)?,
            grid: buffer("photon grid", size_of::<PhotonGrid>() as u64)?,
            cell_starts: buffer("photon cell starts", (cells + 1) * 4)?,
            cell_cursors: buffer("photon cell cursors", cells * 4)?,
            cell_sums: buffer("photon cell block sums", sums(cells + 4))?,
            dispatch: dispatch_table(context, "photon batches", &batches),
        };
        Ok(Self {
            config,
            capacity,
            batch_paths,
            slots_per_path,
            buffers,
            bound: BTreeMap::new(),
            bound_cell_scan: Vec::new(),
            bound_path_scan: Vec::new(),
            traced_at: None,
            last: PhotonCounters::default(),
        })
    }

    /// Photons that the list can hold.
    pub fn capacity(&self) -> u32 {
        self.capacity
    }

    /// Counters of the last trace.
    pub fn counters(&self) -> PhotonCounters {
        self.last
    }

    /// Where (world, metres) and in which frame the photons were traced last.
    pub fn traced_at(&self) -> Option<(DVec3, u32)> {
        self.traced_at
    }

    /// Forgets the photons: the next frame traces them again.
    pub fn invalidate(&mut self) {
        self.traced_at = None;
    }

    /// What gathering passes read.
    pub fn resources(&self) -> Resources<'_> {
        Resources::new()
            .with("photon_grid", &self.buffers.grid)
            .with("cell_starts", &self.buffers.cell_starts)
            .with("sorted_photons", &self.buffers.sorted)
            .with("photon_counters", &self.buffers.counters)
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
            .with("path_photons", &b.path_photons)
            .with("path_counts", &b.path_counts)
            .with("path_starts", &b.path_counts)
            .with("photon_counters", &b.counters)
            .with("photons", &b.photons)
            .with("photon_kept", &b.kept)
            .with("photon_bounds", &b.bounds)
            .with("photon_grid", &b.grid)
            .with("cell_starts", &b.cell_starts)
            .with("cell_cursors", &b.cell_cursors)
            .with("photon_order", &b.order)
            .with("sorted_photons", &b.sorted);
        let all = scene.clone().and(&own);
        let mut bound = BTreeMap::new();
        for pass in passes::PHOTON_BATCH.iter().chain(passes::PHOTON_GRID) {
            bound.insert(pass.name, kernels.get(pass)?.bind(context, &all)?);
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
        self.bound = bound;
        Ok(())
    }

    fn bound(&self, pass: &passes::Pass) -> Result<&Bound, GpuError> {
        self.bound.get(pass.name).ok_or_else(|| GpuError::Unbound {
            pass: pass.name.to_owned(),
            binding: "any (the photon map was not bound)".to_owned(),
        })
    }

    fn scan(
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
            recorder.dispatch(&label(pass), kernels.get(pass)?, bound, 0, groups);
        }
        Ok(())
    }

    /// Records tracing and sorting. The photons' space becomes the render space of this frame.
    ///
    /// # Errors
    /// [`GpuError::Unbound`] before [`PhotonMap::bind`].
    pub fn record(
        &mut self,
        recorder: &mut FrameRecorder<'_>,
        kernels: &KernelSet,
        origin_in_world: DVec3,
        frame_index: u32,
    ) -> Result<(), GpuError> {
        let b = &self.buffers;
        for buffer in [
            &b.counters,
            &b.kept,
            &b.bounds,
            &b.cell_starts,
            &b.cell_cursors,
        ] {
            recorder.clear(buffer);
        }
        let batches = self.config.paths.div_ceil(self.batch_paths);
        for batch in 0..batches {
            let count = self
                .batch_paths
                .min(self.config.paths - batch * self.batch_paths);
            recorder.clear(&b.path_counts);
            for (step, pass) in passes::PHOTON_BATCH.iter().enumerate() {
                let kernel = kernels.get(pass)?;
                let groups = match pass.over {
                    passes::Over::Batch => kernel.groups_for(count),
                    _ => [1, 1, 1],
                };
                recorder.dispatch(&label(pass), kernel, self.bound(pass)?, batch, groups);
                if step == 0 {
                    Self::scan(recorder, kernels, &self.bound_path_scan, &b.path_counts)?;
                }
            }
        }
        for pass in passes::PHOTON_GRID {
            let kernel = kernels.get(pass)?;
            let bound = self.bound(pass)?;
            let name = label(pass);
            match pass.over {
                passes::Over::Photons => recorder.dispatch_indirect(
                    &name,
                    kernel,
                    bound,
                    0,
                    &b.grid,
                    PHOTON_GROUPS_OFFSET,
                ),
                passes::Over::Cells => {
                    recorder.dispatch_indirect(&name, kernel, bound, 0, &b.grid, CELL_GROUPS_OFFSET)
                }
                passes::Over::PhotonSixteenths => recorder.dispatch(
                    &name,
                    kernel,
                    bound,
                    0,
                    kernel.groups_for(self.capacity.div_ceil(16)),
                ),
                _ => recorder.dispatch(&name, kernel, bound, 0, [1, 1, 1]),
            }
            if pass.name == passes::cell_count::PASS.name {
                Self::scan(recorder, kernels, &self.bound_cell_scan, &b.cell_starts)?;
            }
        }
        self.traced_at = Some((origin_in_world, frame_index));
        Ok(())
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
        let empty_batch = self.config.paths.div_ceil(self.batch_paths);
        for pass in passes::PHOTON_BATCH.iter().chain(passes::PHOTON_GRID) {
            recorder.dispatch(
                pass.name,
                kernels.get(pass)?,
                self.bound(pass)?,
                empty_batch,
                [1, 1, 1],
            );
        }
        for (pass, bound) in passes::SCAN.iter().zip(&self.bound_cell_scan) {
            recorder.dispatch(pass.name, kernels.get(pass)?, bound, 0, [1, 1, 1]);
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
        let largest = context.max_binding_bytes / PHOTON_BYTES;
        let wanted = (u64::from(self.last.demanded) * 5 / 4).min(largest) as u32;
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

    /// Reads back the photons in cell order: for tests and diagnostics.
    ///
    /// # Errors
    /// As [`read_buffer`].
    pub fn read_photons(&self, context: &GpuContext) -> Result<Vec<Photon>, GpuError> {
        read_buffer(
            context,
            "photons",
            &self.buffers.sorted,
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

fn label(pass: &passes::Pass) -> String {
    format!("photons.{}", pass.name)
}
