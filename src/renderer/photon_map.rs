//! What is remembered of a photon map: its sizes, when it was traced, and what the trace counted.

use glam::DVec3;

use crate::frame::bind::{Buffers, Whose};
use crate::frame::{AdapterLimits, MapKind, MapLayout};
use crate::gpu::{GpuContext, GpuError};
use crate::settings::Loads;

pub use super::records::photon::{Photon, PhotonCounters, PhotonGrid};

/// Photons that one slice of the gather may have to walk: llvmpipe ends a thread's loops after 65,535 turns.
const PHOTONS_PER_SLICE: u64 = 60_000;
/// Photons of one batch of the gather by workgroups, and batches of one of its slices.
pub const SHARED_BATCH: u64 = 64;
/// See [`SHARED_BATCH`].
pub const SHARED_BATCHES_PER_SLICE: u64 = 850;
/// Turns of a walk through a kd-tree in one slice of a gather; `shared/kd_walk.wesl` holds the same number.
pub const KD_TURNS_PER_SLICE: u64 = 60_000;

/// Which paths are traced for a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Due {
    /// All.
    All,
    /// One share, counted around: the others' photons stay.
    Share(u32),
}

/// A photon map.
pub struct PhotonMap {
    pub(super) layout: MapLayout,
    longest_cell: u32,
    /// Render-space origin (world, metres) and frame number of the last trace.
    traced_at: Option<(DVec3, u32)>,
    last: PhotonCounters,
}

impl PhotonMap {
    pub(super) fn new(layout: MapLayout) -> Self {
        Self {
            layout,
            longest_cell: 0,
            traced_at: None,
            last: PhotonCounters::default(),
        }
    }

    /// Which photons it holds.
    pub fn kind(&self) -> MapKind {
        self.layout.config.kind
    }

    /// Photons that the list can hold.
    pub fn capacity(&self) -> u32 {
        self.layout.capacity
    }

    /// Counters of the last trace.
    pub fn counters(&self) -> PhotonCounters {
        self.last
    }

    /// Where (world, metres) and in which frame the photons were traced last.
    pub fn traced_at(&self) -> Option<(DVec3, u32)> {
        self.traced_at
    }

    /// Whether a batch of the paths is traced where `due` is.
    pub(super) fn is_due(&self, batch: u32, due: Due) -> bool {
        let shares = self.layout.shares();
        match due {
            Due::All => true,
            Due::Share(share) => batch % shares == share % shares,
        }
    }

    /// Paths that are traced where `due` is.
    pub(super) fn paths_due(&self, due: Due) -> u32 {
        let batches = (0..).zip(self.layout.batches());
        let traced = batches.filter(|(batch, _)| self.is_due(*batch, due));
        traced.map(|(_, (_, paths))| paths).sum()
    }

    /// Takes over what the trace that was just submitted counted. The photons' space is the render space of a head at
    /// `origin_in_world`.
    ///
    /// # Errors
    /// As [`crate::gpu::buffers::read_buffer`].
    pub(super) fn note_trace(
        &mut self,
        context: &GpuContext,
        buffers: &Buffers,
        origin_in_world: DVec3,
        frame_index: u32,
    ) -> Result<PhotonCounters, GpuError> {
        let whose = Whose::Map(self.kind());
        let counters = buffers.read(context, (whose, "photon_counters"), 0, 1)?;
        self.last = first(counters);
        self.longest_cell = first(buffers.read(context, (whose, "longest_cell"), 0, 1)?);
        self.traced_at = Some((origin_in_world, frame_index));
        Ok(self.last)
    }

    /// Makes room for all that the last trace demanded; true if the list grew (bind and trace again then). A fixed
    /// capacity stays, so that an overflow can be provoked and seen.
    ///
    /// # Errors
    /// As [`MapLayout::with_capacity`].
    pub(super) fn grow(&mut self, limits: &AdapterLimits) -> Result<bool, GpuError> {
        let config = &self.layout.config;
        if self.last.dropped == 0 || config.capacity != 0 {
            return Ok(false);
        }
        let largest = u64::from(config.largest_capacity(limits));
        let wanted = (u64::from(self.last.demanded) * 5 / 4).min(largest) as u32;
        if wanted <= self.layout.capacity {
            return Ok(false);
        }
        self.layout = self.layout.with_capacity(wanted)?;
        self.traced_at = None;
        self.longest_cell = 0;
        Ok(true)
    }

    /// Slices that the gather needs so that no thread walks too many photons. In a grid: by the bound of 27 cells as full
    /// as the fullest, or all photons; where workgroups load them, or in a kd-tree, by all photons, as gathers there go
    /// on where the slice before stopped and end at once if there is nothing left.
    pub fn gather_slices(&self) -> u32 {
        let stored = u64::from(self.last.stored);
        let (walked, per_slice) = if self.layout.is_tree() {
            // Every edge is crossed twice at most.
            (2 * stored, KD_TURNS_PER_SLICE)
        } else if self.layout.config.loads == Loads::Cooperative {
            // The last batch may begin at the list's end.
            (stored + 1, SHARED_BATCH * SHARED_BATCHES_PER_SLICE)
        } else {
            let most = (27 * u64::from(self.longest_cell)).min(stored);
            (most, PHOTONS_PER_SLICE)
        };
        walked.div_ceil(per_slice).max(1) as u32
    }
}

fn first<T: Copy + Default>(values: Option<Vec<T>>) -> T {
    values
        .and_then(|values| values.first().copied())
        .unwrap_or_default()
}
