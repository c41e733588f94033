//! When photons are traced anew, and how many of them.
//!
//! Photons of a scene that stands still serve every frame. Once something has moved, all paths are out of date. Traced
//! all at once they cost most of a frame; with `photon.shares` = K each frame traces one share of them, in turn, until
//! every share has seen the scene as it stands. Light lags behind by K frames at most, and as only a K-th of the photons
//! changes between two frames, so does their noise.

use glam::DVec3;

use super::photon_map::{Due, PhotonMap};
use super::{MapStats, RenderError, Renderer, Stage, adapter_limits};
use crate::frame::{Only, Play};
use crate::gpu::FrameRecorder;
use crate::renderer::FrameResult;
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

impl Renderer {
    /// Traces what is due of the photons. `anew`: all of them, whatever moved.
    ///
    /// # Errors
    /// [`RenderError::Gpu`].
    pub(super) fn trace_photons(
        &mut self,
        views: &[View; 2],
        frame_index: u32,
        photon_key: u32,
        anew: bool,
        result: &mut FrameResult,
    ) -> Result<(), RenderError> {
        self.grow_maps()?;
        if let Some((due, origin)) = self.photons_due(anew) {
            // The map that is about to be traced, not the one before it.
            let photons = Some((origin, photon_key));
            self.write_frame_uniform(&self.frame_uniform(views, frame_index, 0, photons));
            for index in 0..self.maps.len() {
                result.photons.retraced += self.trace_map(index, due, result)?;
                let (context, buffers) = (&self.context, &self.frame.buffers);
                let map = &mut self.maps[index];
                let counters = map.note_trace(context, buffers, origin, photon_key)?;
                if counters.dropped > 0 {
                    log::warn!(
                        "the photon buffer is full: {} of {} photons dropped; {} of {} paths count",
                        counters.dropped,
                        counters.demanded,
                        counters.paths_kept,
                        counters.paths_traced
                    );
                }
            }
        }
        result.photons.traced = result.photons.retraced > 0;
        result.photons.outdated_shares = self.refresh.outdated;
        let stats = |map: &PhotonMap| {
            let counters = map.counters();
            MapStats {
                emitted: counters.paths_traced,
                stored: counters.stored,
                dropped: counters.dropped,
                paths_kept: counters.paths_kept,
                capacity: map.capacity(),
            }
        };
        result.photons.map = self.photon_map().map(stats).unwrap_or_default();
        result.photons.caustics = self.caustic_map().map(stats);
        Ok(())
    }

    /// Makes room for all photons that the last traces demanded.
    fn grow_maps(&mut self) -> Result<(), RenderError> {
        let limits = adapter_limits(&self.context);
        let mut grew = false;
        for map in &mut self.maps {
            let dropped = map.counters().dropped;
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

    /// Traces what is due of a map, and sorts it. Returns the number of paths traced.
    fn trace_map(
        &self,
        index: usize,
        due: Due,
        result: &mut FrameResult,
    ) -> Result<u32, RenderError> {
        let map = &self.maps[index];
        let mut recorder = FrameRecorder::new(&self.context, self.timer.as_ref(), "photon map");
        let how = Play {
            is_due: &|only| match only {
                Only::BatchDue(batch) => map.is_due(batch, due),
                _ => true,
            },
            ..Play::default()
        };
        self.frame
            .play(&mut recorder, Stage::Photons(map.kind()), &how)?;
        recorder.submit("photon map", &mut result.times)?;
        Ok(map.paths_due(due))
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
        if anew || missing || (moved && (shares == 1 || kept.is_none())) {
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
