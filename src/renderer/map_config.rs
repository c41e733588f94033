//! What a photon map is made for, and which passes follow from that.

use super::kd_tree::{KD_DIGIT_BITS, KD_DIGITS, KdTree, largest_tree};
use super::photon_map::{PHOTON_BYTES, RADIX_BLOCK, SCAN_LIMIT};
use crate::gpu::GpuContext;
use crate::gpu::texels::{ROW_TEXELS, TEXEL_BYTES};
use crate::passes::{self, Pass};
use crate::settings::{Loads, Search};

/// Digits of the sort by cell.
const RADIX_DIGITS: u32 = 3;

/// Threads that are left to trace a batch, where it has as many paths: enough for every core of a software adapter.
const LEAST_TRACING_THREADS: u32 = 4096;

/// Which photons a map holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MapKind {
    /// All that scattered, or all where no map of caustics exists.
    Photons,
    /// Photons that came over narrow lobes alone.
    Caustics,
}

impl MapKind {
    /// Passes of one batch of paths.
    pub fn batch(self) -> &'static [&'static Pass] {
        match self {
            Self::Photons => passes::PHOTON_BATCH,
            Self::Caustics => passes::CAUSTIC_BATCH,
        }
    }

    /// Name of a pass in timings; every photon pass begins with `photons.`.
    pub(super) fn label(self, pass: &Pass) -> String {
        match self {
            Self::Photons => format!("photons.{}", pass.name),
            Self::Caustics => format!("photons.caustics.{}", pass.name),
        }
    }

    /// `Dispatch.eye` of the map's passes.
    pub(super) fn index(self) -> u32 {
        match self {
            Self::Photons => 0,
            Self::Caustics => 1,
        }
    }
}

/// What the photon map of a scene is made for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhotonMapConfig {
    /// Which photons.
    pub kind: MapKind,
    /// Paths per frame.
    pub paths: u32,
    /// Shares of the paths that can be traced anew one at a time; 1 traces all or none.
    pub shares: u32,
    /// Longest light path from eye to light, in segments.
    pub max_depth: u32,
    /// Paths that one thread traces, one after the other.
    pub paths_per_thread: u32,
    /// Photons that the list holds; 0 lets it grow by demand.
    pub capacity: u32,
    /// Cells of the table.
    pub cells: u32,
    /// What photons are searched by.
    pub search: Search,
    /// How a gather loads them.
    pub loads: Loads,
    /// Gathers read them from a copy in a texture: the feature `record_texels`.
    pub texels: bool,
}

impl PhotonMapConfig {
    /// Threads that trace `paths` paths.
    pub(super) fn tracing_threads(&self, paths: u32) -> u32 {
        paths
            .div_ceil(self.paths_per_thread.max(1))
            .max(LEAST_TRACING_THREADS.min(paths))
    }

    /// Passes between tracing and sorting.
    pub(super) fn layout(&self) -> &'static [&'static Pass] {
        match self.search {
            Search::Grid => passes::PHOTON_GRID,
            Search::KdTree => passes::PHOTON_EXTENT,
        }
    }

    /// Passes after the sort, where the map has one sort.
    pub(super) fn finish(&self) -> &'static [&'static Pass] {
        match self.search {
            Search::Grid => passes::PHOTON_FINISH,
            Search::KdTree => &[],
        }
    }

    /// All passes that the map's kernels are compiled for.
    pub fn passes(&self) -> Vec<&'static Pass> {
        let own = self.kind.batch().iter().chain(self.layout());
        let mut all: Vec<&Pass> = own.chain(self.finish()).copied().collect();
        all.extend(passes::SCAN.iter().chain(passes::RADIX_DIGIT));
        if self.search == Search::KdTree {
            all.extend(KdTree::passes());
        }
        all
    }

    /// Digits of a sort and bits of a digit.
    pub(super) fn digits(&self) -> (u32, u32) {
        match self.search {
            Search::Grid => (RADIX_DIGITS, digit_bits(self.cells)),
            Search::KdTree => (KD_DIGITS, KD_DIGIT_BITS),
        }
    }

    /// Cells of the table in use: a kd-tree has none, but the pass that lays the map out wants a token.
    pub(super) fn table_cells(&self) -> u32 {
        match self.search {
            Search::Grid => self.cells,
            Search::KdTree => 64,
        }
    }
}

/// Bits of one digit of the sort, for a table of `cells` cells.
fn digit_bits(cells: u32) -> u32 {
    let cell_bits = (u64::from(cells) + 4).next_power_of_two().trailing_zeros();
    cell_bits.div_ceil(RADIX_DIGITS)
}

/// Photons that a list which grows by itself may reach: what the adapter binds, a texture of their copies holds, and the
/// sort's table and a kd-tree can count.
pub(super) fn largest_capacity(context: &GpuContext, config: &PhotonMapConfig) -> u32 {
    let bound = context.max_binding_bytes / PHOTON_BYTES;
    let sorted = (SCAN_LIMIT >> config.digits().1) * u64::from(RADIX_BLOCK);
    let treed = match config.search {
        Search::Grid => u64::MAX,
        Search::KdTree => largest_tree(),
    };
    let copied = if config.texels {
        let rows = u64::from(context.device.limits().max_texture_dimension_2d);
        rows * u64::from(ROW_TEXELS) * TEXEL_BYTES / PHOTON_BYTES
    } else {
        u64::MAX
    };
    bound
        .min(sorted)
        .min(treed)
        .min(copied)
        .min(u64::from(u32::MAX)) as u32
}
