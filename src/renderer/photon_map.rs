//! What is remembered of a photon map: its sizes, when it was traced, and what the trace counted.

use glam::DVec3;

use crate::frame::{AdapterLimits, MapConfig, MapKind, MapLayout};
use crate::gpu::GpuError;
use crate::settings::Loads;

pub use super::records::photon::{Photon, PhotonCounters, PhotonGrid, SortedPhoton};

/// Photons that one slice of the gather may have to walk: llvmpipe ends a thread's loops after 65,535 turns.
const PHOTONS_PER_SLICE: u64 = 60_000;
/// Runs of photons that a gather walks: in each of nine rows of cells one.
const WALKED_RUNS: u64 = 9;
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

/// What was counted in a photon map at the end of a frame.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Counted {
    /// The frame, by [`Renderer::frames_begun`](super::Renderer::frames_begun).
    pub(super) serial: u64,
    pub(super) counters: PhotonCounters,
    pub(super) longest_run: u32,
}

/// A photon map.
pub struct PhotonMap {
    pub(super) layout: MapLayout,
    /// What its buffers have room for: the layout that it was made with, and the longest list so far.
    room: MapLayout,
    /// Photons that the list was made to hold when it grew last, and for how many paths.
    grown: Option<(u32, u32)>,
    /// Render-space origin (world, metres) and frame number of the last trace.
    traced_at: Option<(DVec3, u32)>,
    /// The frame of the last trace, as [`Counted::serial`].
    traced_in: u64,
    /// What steers frames: from a fixed number of frames ago, or from a trace that was waited for.
    pub(super) steering: Counted,
    /// What arrived last.
    last: Counted,
}

impl PhotonMap {
    pub(super) fn new(layout: MapLayout) -> Self {
        Self {
            layout,
            room: layout,
            grown: None,
            traced_at: None,
            traced_in: 0,
            steering: Counted::default(),
            last: Counted::default(),
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

    /// Counters of the map in the last frame that has arrived.
    pub fn counters(&self) -> PhotonCounters {
        self.last.counters
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

    /// Notes a trace for frame `serial`. The photons' space is the render space of a head at `origin_in_world`.
    pub(super) fn note_trace(&mut self, serial: u64, origin_in_world: DVec3, frame_index: u32) {
        self.traced_in = serial;
        self.traced_at = Some((origin_in_world, frame_index));
    }

    /// Takes over what has arrived.
    pub(super) fn note_counted(&mut self, counted: Counted) {
        if counted.serial >= self.last.serial {
            self.last = counted;
        }
    }

    /// Lets counts steer the frames to come, unless those of a later frame do already: a trace that was waited for makes
    /// counts of earlier frames void.
    pub(super) fn steer(&mut self, counted: Counted) {
        if counted.serial >= self.steering.serial {
            self.steering = counted;
        }
    }

    /// Makes room for all that the trace demanded whose counts steer; true if the list grew (bind and trace again then). A fixed
    /// capacity stays, so that an overflow can be provoked and seen.
    ///
    /// # Errors
    /// As [`MapLayout::with_capacity`].
    pub(super) fn grow(&mut self, limits: &AdapterLimits) -> Result<bool, GpuError> {
        let config = self.layout.config;
        let counters = self.steering.counters;
        if counters.dropped == 0 || config.capacity != 0 {
            return Ok(false);
        }
        let largest = u64::from(config.largest_capacity(limits));
        let wanted = (u64::from(counters.demanded) * 5 / 4).min(largest) as u32;
        if wanted <= self.layout.capacity {
            return Ok(false);
        }
        self.layout = self.layout.with_capacity(wanted)?;
        self.room = self.room.with_capacity(wanted.max(self.room.capacity))?;
        self.grown = Some((wanted, config.paths));
        self.traced_at = None;
        Ok(true)
    }

    /// Holds the photons of other paths from frame `serial` on, in the buffers that there are; all are to be traced. A list
    /// that had to grow keeps its length per path.
    ///
    /// # Errors
    /// As [`MapLayout::lowered`].
    pub(super) fn remake(
        &mut self,
        config: MapConfig,
        limits: &AdapterLimits,
        serial: u64,
    ) -> Result<(), GpuError> {
        let own = self.room.lowered(config, limits)?;
        let grown = self.grown.map_or(0, |(capacity, paths)| {
            let per_path = u64::from(capacity) * u64::from(config.paths) / u64::from(paths.max(1));
            per_path.min(u64::from(self.room.capacity)) as u32
        });
        self.layout = own.with_capacity(own.capacity.max(grown))?;
        self.traced_at = None;
        self.steering = Counted {
            serial,
            ..Counted::default()
        };
        Ok(())
    }

    /// Slices that the gather needs for the photons that arrived last ([`PhotonMap::slices_for`]).
    pub fn gather_slices(&self) -> u32 {
        self.slices_for(self.last, [1, 1])
    }

    /// Slices for the next frame: exactly those of the map if its counts are known, else by the counts that steer and a
    /// quarter more, as a map changes little within a few frames.
    pub(super) fn steered_slices(&self) -> u32 {
        let margin = match self.steering.serial >= self.traced_in {
            true => [1, 1],
            false => [5, 4],
        };
        self.slices_for(self.steering, margin)
    }

    /// Slices that the gather needs so that no thread walks too many photons, if there are `margin` (a fraction) times as
    /// many as were counted. In a grid: by the bound of [`WALKED_RUNS`] as long as the longest, or all photons; where workgroups
    /// load them, or in a kd-tree, by all photons, as gathers there go on where the slice before stopped and end at once
    /// if there is nothing left.
    pub(super) fn slices_for(&self, counted: Counted, margin: [u64; 2]) -> u32 {
        let more = |count: u32| (u64::from(count) * margin[0]).div_ceil(margin[1]);
        let stored = more(counted.counters.stored).min(u64::from(self.layout.capacity));
        let (walked, per_slice) = if self.layout.is_tree() {
            // Every edge is crossed twice at most.
            (2 * stored, KD_TURNS_PER_SLICE)
        } else if self.layout.config.loads == Loads::Cooperative {
            // The last batch may begin at the list's end.
            (stored + 1, SHARED_BATCH * SHARED_BATCHES_PER_SLICE)
        } else {
            let most = (WALKED_RUNS * more(counted.longest_run)).min(stored);
            (most, PHOTONS_PER_SLICE)
        };
        walked.div_ceil(per_slice).max(1) as u32
    }
}
