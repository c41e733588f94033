//! Configuration of a photon map and the sizes that follow: batches of paths, capacities, digits of the sort.

use crate::gpu::GpuError;
use crate::gpu::buffers::allocated_bytes;
use crate::gpu::texels::{ROW_TEXELS, TEXEL_BYTES};
use crate::settings::{Loads, Search};

/// Scratch for the paths of one batch, bytes: what a software adapter's caches hold, or, for wide machines, the default number of
/// photons in one batch. That lies where images of a headset's size do, and each batch costs seven dispatches.
const BATCH_SCRATCH_BYTES: [u64; 2] = [32 << 20, 128 << 20];
/// Bytes of one photon.
pub const PHOTON_BYTES: u64 = 32;
/// Bytes of one in the order of gathers, unpacked.
pub const SORTED_PHOTON_BYTES: u64 = 64;
/// Values of one scan block.
pub const SCAN_BLOCK: u64 = 2048;
/// Values that three scan passes cover: the blocks' totals are one block.
pub const SCAN_LIMIT: u64 = SCAN_BLOCK * SCAN_BLOCK;
/// Photons of a block of the radix sort, and threads of a workgroup that sorts one; `shared/photon.wesl` holds the same number.
pub const RADIX_BLOCK: u32 = 256;
/// Paths of which one has its photons corrected at edges; `shared/photon.wesl` holds the same number.
pub const PATHS_PER_TRIED: u32 = 2;
/// Cells of the guide of emission, each tried by one path; `shared/guide_cells.wesl` holds the same number.
pub const GUIDE_CELLS: u32 = 1 << 15;
/// Number of the first pilot path, beyond those of all others; `shared/photon_guide.wesl` holds the same number.
pub const FIRST_PILOT: u32 = 1 << 30;
/// Bytes of the guide's sums: one more is that of all.
pub const GUIDE_BYTES: u64 = (GUIDE_CELLS as u64 + 1) * 4;
/// Paths per pilot path from which on the latter pay.
const PATHS_PER_PILOT: u32 = 4;
/// Digits of the sort by cell. Odd: the sort ends in the buffer that it did not begin in.
const RADIX_DIGITS: u32 = 3;
/// Bits of a digit of the sorts along the axes of the kd-tree.
pub const KD_DIGIT_BITS: u32 = 8;
/// Digits of a coordinate. Even: the sort ends in the buffer that it began in.
pub const KD_DIGITS: u32 = 4;
/// Least threads of a batch, if it has as many paths: enough for every core of a software adapter.
const LEAST_TRACING_THREADS: u32 = 4096;

stereolux_base::words! {
    /// Which photons a map holds, with the prefix of its passes in timings; every photon pass begins with `photons.`.
    #[derive(PartialOrd, Ord)]
    pub enum MapKind: label {
        /// All photons that scattered, except those of the caustic map.
        Photons = "photons",
        /// Photons that came over narrow lobes only: caustics.
        Caustics = "photons.caustics",
    }
}

impl MapKind {
    /// `Dispatch.eye` of the map's passes.
    #[must_use]
    pub fn index(self) -> u32 {
        self as u32
    }
}

/// Configuration of a photon map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapConfig {
    /// Which photons.
    pub kind: MapKind,
    /// Paths per frame.
    pub paths: u32,
    /// Shares of the paths that can be retraced one at a time; 1 traces all or none.
    pub shares: u32,
    /// Longest light path from eye to light, in segments.
    pub max_depth: u32,
    /// Paths that one thread traces, one after the other.
    pub paths_per_thread: u32,
    /// Photons that the list holds; 0 lets it grow by demand.
    pub capacity: u32,
    /// Cells of the table.
    pub cells: u32,
    /// Search structure.
    pub search: Search,
    /// How a gather loads photons.
    pub loads: Loads,
    /// Whether gathers read a texture copy: the feature `record_texels`.
    pub texels: bool,
    /// Whether a first few paths guide the others: the feature `guided_photons`.
    pub guided: bool,
    /// Whether a workgroup or a single thread sorts a block of photons: the feature `wide_machine`.
    pub wide_machine: bool,
}

/// Limits of an adapter.
#[derive(Debug, Clone, Copy)]
pub struct AdapterLimits {
    /// Largest buffer that can be bound, bytes.
    pub binding_bytes: u64,
    /// Rows of a texture.
    pub texture_rows: u64,
}

impl AdapterLimits {
    /// No limit: for listings without a device.
    pub const NONE: Self = Self {
        binding_bytes: u64::MAX,
        texture_rows: u64::MAX,
    };
}

/// A photon map's sizes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapLayout {
    /// Its configuration.
    pub config: MapConfig,
    /// Photons that the list holds.
    pub capacity: u32,
    /// Paths of a batch.
    pub batch_paths: u32,
    /// Photons that a path may store.
    pub slots_per_path: u32,
    /// Shares in which the paths are retraced now: at most `config.shares`, by which batches keep their photons.
    pub shares_in_use: u32,
}

impl MapLayout {
    /// Sizes for `config`, with room for about as many photons as its paths store.
    ///
    /// # Errors
    /// As [`MapLayout::with_capacity`].
    pub fn new(config: MapConfig, limits: &AdapterLimits) -> Result<Self, GpuError> {
        let slots_per_path = config.max_depth.saturating_sub(1).clamp(1, 63);
        let scratch =
            BATCH_SCRATCH_BYTES[usize::from(config.wide_machine)].min(limits.binding_bytes);
        let batch_limit = scratch / (PHOTON_BYTES * u64::from(slots_per_path));
        // Counts of a batch's paths are scanned, and one value more.
        let batch_limit = batch_limit.clamp(1, SCAN_LIMIT - 4);
        let share = config.paths.div_ceil(config.shares.max(1));
        // Bright interiors store about two photons per path, and of the paths towards what focuses one in thirty; a map that
        // overflows is grown after the frame.
        let paths = u64::from(config.paths);
        let stored = match config.kind {
            MapKind::Photons => 3 * paths,
            MapKind::Caustics => paths / 16,
        };
        let capacity = match config.capacity {
            0 => {
                let largest = u64::from(config.largest_capacity(limits));
                stored.clamp(1024, largest.max(1024)) as u32
            }
            fixed => fixed,
        };
        Self {
            config,
            capacity,
            batch_paths: u64::from(share).clamp(1, batch_limit) as u32,
            slots_per_path,
            shares_in_use: config.shares,
        }
        .checked()
    }

    /// Sizes for `config`, whose paths are no more than this map's and no longer, in buffers of this map's sizes. The list is
    /// that of a map of its own: it has the order of the paths, in however many batches they are traced.
    ///
    /// # Errors
    /// As [`MapLayout::with_capacity`].
    pub fn lowered(&self, config: MapConfig, limits: &AdapterLimits) -> Result<Self, GpuError> {
        let own = Self::new(config, limits)?;
        let least = config.paths.div_ceil(self.batch_count().max(1));
        Ok(Self {
            config: MapConfig {
                shares: self.config.shares,
                ..config
            },
            batch_paths: own.batch_paths.max(least).min(self.batch_paths),
            ..own
        })
    }

    /// The same with room for `capacity` photons.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] for more photons than the sort or the kd-tree can count.
    pub fn with_capacity(self, capacity: u32) -> Result<Self, GpuError> {
        Self { capacity, ..self }.checked()
    }

    fn checked(self) -> Result<Self, GpuError> {
        let too_large = |what: &str, values: u64, mend| GpuError::TooLarge {
            what: what.to_owned(),
            bytes: values * 4,
            limit: SCAN_LIMIT * 4,
            mend,
        };
        if self.radix_bytes() > SCAN_LIMIT * 4 {
            let mend = "use fewer photons or a smaller photon.grid_cells_max";
            return Err(too_large("radix table", self.radix_bytes() / 4, mend));
        }
        if self.is_tree() && u64::from(self.capacity) > largest_tree() {
            let mend = "use fewer photons, or photon.search = \"grid\"";
            return Err(too_large("kd-tree's orders", self.kd_places(), mend));
        }
        Ok(self)
    }

    /// Whether photons are searched by a kd-tree.
    #[must_use]
    pub fn is_tree(&self) -> bool {
        self.config.search == Search::KdTree
    }

    /// Batches of the paths: number of the first path, and paths, of each.
    pub fn batches(&self) -> impl Iterator<Item = (u32, u32)> + use<> {
        let (paths, batch) = (self.config.paths, self.batch_paths);
        (0..self.batch_count()).map(move |index| {
            let first = index * batch;
            (first, batch.min(paths - first))
        })
    }

    /// Number of batches.
    #[must_use]
    pub fn batch_count(&self) -> u32 {
        self.config.paths.div_ceil(self.batch_paths)
    }

    /// Whether each batch keeps its photons, so that shares of the paths can be retraced.
    #[must_use]
    pub fn keeps_batches(&self) -> bool {
        self.config.shares > 1
    }

    /// Shares in which the paths can be retraced.
    #[must_use]
    pub fn shares(&self) -> u32 {
        self.shares_in_use.min(self.batch_count()).max(1)
    }

    /// Paths that are traced to learn where to emit the others.
    #[must_use]
    pub fn pilot_paths(&self) -> u32 {
        let pays = self.config.guided && self.config.paths / PATHS_PER_PILOT >= GUIDE_CELLS;
        if pays { GUIDE_CELLS } else { 0 }
    }

    /// Threads that trace `paths` paths.
    #[must_use]
    pub fn tracing_threads(&self, paths: u32) -> u32 {
        paths
            .div_ceil(self.config.paths_per_thread.max(1))
            .max(LEAST_TRACING_THREADS.min(paths))
    }

    /// Blocks of the radix sort.
    #[must_use]
    pub fn blocks(&self) -> u32 {
        self.capacity.div_ceil(RADIX_BLOCK)
    }

    /// Levels of a full kd-tree that are split: all but the bottom one.
    #[must_use]
    pub fn parted_levels(&self) -> u32 {
        self.capacity.checked_ilog2().unwrap_or(0)
    }

    /// Bytes of the counts of a batch's paths, and their sum.
    #[must_use]
    pub fn path_count_bytes(&self) -> u64 {
        (u64::from(self.batch_paths) + 1) * 4
    }

    /// Bytes of the table of cells. One more entry marks the last run's end; together they fill whole 16-byte units.
    #[must_use]
    pub fn cell_bytes(&self) -> u64 {
        // A kd-tree has no cells, but the pass that lays the map out wants a token.
        let cells = if self.is_tree() {
            64
        } else {
            self.config.cells
        };
        u64::from(cells).clamp(64, SCAN_LIMIT - 4) / 4 * 16
    }

    /// Bytes of the table of the radix sort.
    #[must_use]
    pub fn radix_bytes(&self) -> u64 {
        (u64::from(self.blocks()) << self.config.digits().1) * 4
    }

    /// Places of the kd-tree's three orders of photons.
    #[must_use]
    pub fn kd_places(&self) -> u64 {
        u64::from(self.capacity) * 3
    }

    /// Values of a prefix sum over a buffer of `bytes` bytes.
    #[must_use]
    pub fn scan_values(bytes: u64) -> u32 {
        (allocated_bytes(bytes) / 4) as u32
    }

    /// Bytes of the blocks' sums of a prefix sum over a buffer of `bytes` bytes.
    #[must_use]
    pub fn sum_bytes(bytes: u64) -> u64 {
        (u64::from(Self::scan_values(bytes)) + 1).div_ceil(SCAN_BLOCK) * 4
    }
}

impl MapConfig {
    /// Digits of a sort and bits of a digit.
    #[must_use]
    pub fn digits(&self) -> (u32, u32) {
        match self.search {
            Search::KdTree => (KD_DIGITS, KD_DIGIT_BITS),
            Search::Grid => {
                let cells = (u64::from(self.cells) + 4).next_power_of_two();
                (RADIX_DIGITS, cells.trailing_zeros().div_ceil(RADIX_DIGITS))
            }
        }
    }

    /// Largest capacity of a growing list: bounded by the adapter's bindings, a texture copy, the sort's table and the kd-tree.
    #[must_use]
    pub fn largest_capacity(&self, limits: &AdapterLimits) -> u32 {
        let bound = limits.binding_bytes / SORTED_PHOTON_BYTES;
        let sorted = (SCAN_LIMIT >> self.digits().1) * u64::from(RADIX_BLOCK);
        let treed = match self.search {
            Search::Grid => u64::MAX,
            Search::KdTree => largest_tree(),
        };
        let copied = if self.texels {
            limits
                .texture_rows
                .saturating_mul(u64::from(ROW_TEXELS) * TEXEL_BYTES / SORTED_PHOTON_BYTES)
        } else {
            u64::MAX
        };
        bound
            .min(sorted)
            .min(treed)
            .min(copied)
            .min(u64::from(u32::MAX)) as u32
    }
}

/// Photons that a tree can be built over: one scan covers the marks of three orders.
#[must_use]
pub const fn largest_tree() -> u64 {
    (SCAN_LIMIT - 4) / 3
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_of_paths_is_scanned() {
        // Of one photon each a batch would hold one more than a scan counts.
        for paths in [1, (1 << 22) - 1, 1 << 22, (1 << 22) + 1, 1 << 26] {
            let layout = MapLayout::new(
                MapConfig {
                    kind: MapKind::Photons,
                    paths,
                    shares: 1,
                    max_depth: 2,
                    paths_per_thread: 1,
                    capacity: 0,
                    cells: 4096,
                    search: Search::Grid,
                    loads: Loads::Direct,
                    texels: false,
                    guided: false,
                    wide_machine: true,
                },
                &AdapterLimits::NONE,
            );
            let layout = layout.unwrap();
            assert!(layout.path_count_bytes() <= SCAN_LIMIT * 4, "{paths}");
            let traced: u64 = layout.batches().map(|(_, count)| u64::from(count)).sum();
            assert_eq!(traced, u64::from(paths));
        }
    }
}
