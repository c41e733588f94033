//! When photons are traced anew, and how many of them.
//!
//! Photons of a scene that stands still serve every frame. Once something has moved, all paths are out of date. Traced
//! all at once they cost most of a frame; with `photon.shares` = K each frame traces one share of them, in turn, until
//! every share has seen the scene as it stands. Light lags behind by K frames at most, and as only a K-th of the photons
//! changes between two frames, so does their noise.
//!
//! At rest (`photon.refine_at_rest`) new maps of smaller radii are traced, one per frame or every few, and the mean of still
//! frames converges. The first frame in which anything moves traces one of the whole radius, which then stays.

use glam::DVec3;

use super::frames_in_flight::Flight;
use super::photon_map::Due;
use super::{RenderError, Renderer, Stage, adapter_limits};
use crate::frame::{Only, Play};
use crate::gpu::FrameRecorder;
use crate::xr::View;

/// Share of the gather radius by which f32 may misplace photons that were traced around another place than the eyes.
const PLACE_ERROR: f64 = 1e-3;
/// Units in the last place of f32 per unit.
const F32_STEPS: f64 = 16_777_216.0;

/// Where the tracing in turn stands.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Refresh {
    /// The share that is next.
    next: u32,
    /// Shares that were traced before the scene moved last.
    outdated: u32,
}

impl Refresh {
    /// Paths are shared out otherwise from now on: if light lags behind, all shares are due.
    pub(super) fn begin_again(&mut self, shares: u32) {
        *self = Self {
            next: 0,
            outdated: if self.outdated > 0 { shares } else { 0 },
        };
    }
}

impl Renderer {
    /// Traces what is due of the photons. `anew`: all of them, whatever moved. Waits for what was counted where the map was
    /// just made, has just grown or is traced `anew`: counts of earlier frames say nothing of such a map.
    ///
    /// # Errors
    /// [`RenderError::Gpu`].
    pub(super) fn trace_photons(
        &mut self,
        views: &[View; 2],
        frame_index: u32,
        photon_key: u32,
        anew: bool,
        flight: &mut Flight,
    ) -> Result<(), RenderError> {
        self.grow_maps()?;
        // Counts within a smaller radius say nothing of the whole one.
        let anew = anew || self.traced_pass > self.progressive_pass.index;
        let waits = anew || self.maps.iter().any(|map| map.traced_at().is_none());
        if let Some((due, origin)) = self.photons_due(anew) {
            // The map that is about to be traced, not the one before it.
            let photons = Some((origin, photon_key));
            self.write_frame_uniform(&self.frame_uniform(views, frame_index, 0, photons));
            for index in 0..self.maps.len() {
                let paths = self.trace_map(index, due, waits, flight)?;
                let photons = &mut flight.result.photons;
                photons.retraced = photons.retraced.saturating_add(paths);
                self.maps[index].note_trace(flight.serial, origin, photon_key);
            }
            self.traced_pass = self.progressive_pass.index;
        }
        flight.result.photons.traced = flight.result.photons.retraced > 0;
        flight.result.photons.outdated_shares = self.refresh.outdated;
        Ok(())
    }

    /// Makes room for all photons that were demanded by the traces whose counts steer.
    fn grow_maps(&mut self) -> Result<(), RenderError> {
        let limits = adapter_limits(&self.context);
        let mut grew = false;
        for map in &mut self.maps {
            let dropped = map.steering.counters.dropped;
            if map.grow(&limits)? {
                log::info!(
                    "the photon list overflowed by {dropped} photons and now holds {}",
                    map.capacity()
                );
                grew = true;
            }
        }
        if grew {
            self.bind()?;
        }
        Ok(())
    }

    /// Traces what is due of a map, and sorts it; `waits` for its counts, which then steer at once. Returns the number of
    /// paths traced.
    fn trace_map(
        &mut self,
        index: usize,
        due: Due,
        waits: bool,
        flight: &mut Flight,
    ) -> Result<u32, RenderError> {
        let map = &self.maps[index];
        let mut recorder = FrameRecorder::new(&self.context, self.timer.as_ref(), "photon map");
        let how = Play {
            is_due: &|only| match only {
                Only::BatchDue(batch) => map.is_due(batch, due),
                _ => true,
            },
            parity: self.parity(),
            ..Play::default()
        };
        self.frame
            .play(&mut recorder, Stage::Photons(map.kind()), &how)?;
        let paths = map.paths_due(due);
        if waits {
            self.read_counts(&mut recorder, index);
        }
        flight.tickets.push(recorder.send("photon map")?);
        if waits {
            self.context.count_wait();
            let counted = flight.counts_now(&self.context)?;
            let map = &mut self.maps[index];
            map.note_counted(counted);
            map.steer(counted);
        }
        Ok(paths)
    }

    /// What is to be traced for this frame, and the origin of the photons' space (world, metres).
    fn photons_due(&mut self, anew: bool) -> Option<(Due, DVec3)> {
        let shares = self.maps.iter().map(|map| map.layout.shares()).max()?;
        // The maps of a frame have one origin, so they are traced together.
        let origins: Option<Vec<DVec3>> = self
            .maps
            .iter()
            .map(|map| map.traced_at().map(|(origin, _)| origin))
            .collect();
        let moved = self.settings.photon.every_frame || self.scene.scene_moved();
        let reach_m = PLACE_ERROR * F32_STEPS * self.radius_m.min(self.caustic_radius_m);
        let kept = origins
            .and_then(|origins| origins.first().copied())
            .filter(|origin| origin.distance(self.origin_in_world) <= reach_m);
        let missing = self.maps.iter().any(|map| map.traced_at().is_none());
        let refines = self.progressive_pass.index > self.traced_pass;
        let is_outdated = moved || self.refresh.outdated > 0;
        if anew || missing || refines || (is_outdated && (shares == 1 || kept.is_none())) {
            self.refresh.outdated = 0;
            return Some((Due::All, self.origin_in_world));
        }
        if moved {
            self.refresh.outdated = shares;
        }
        let origin = kept.filter(|_| self.refresh.outdated > 0)?;
        let share = self.refresh.next % shares;
        self.refresh.next = (share + 1) % shares;
        self.refresh.outdated -= 1;
        Some((Due::Share(share), origin))
    }
}
