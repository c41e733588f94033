//! What a frame reports: photons, stereo reuse and times, as `stats.jsonl` holds them.

use std::time::Instant;

use serde::Serialize;

use super::records::stereo::StereoCounters;
use crate::frame::work::Dispatched;
use crate::gpu::{HostSpan, PassTimes};

pub use super::records::stereo::Provenance;

/// Photons of a frame, for `stats.jsonl`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct PhotonStats {
    /// Whether this frame traced photons, or used those of earlier ones alone.
    pub traced: bool,
    /// Paths that this frame traced, of both maps.
    pub retraced: u32,
    /// Shares of the paths that were traced before the scene moved last: frames until the light has caught up.
    pub outdated_shares: u32,
    /// The map of all photons but caustics.
    #[serde(flatten)]
    pub map: MapStats,
    /// The map of caustics, where the scene can form them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub caustics: Option<MapStats>,
}

/// One photon map, for `stats.jsonl`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct MapStats {
    /// Paths emitted for the map in use.
    pub emitted: u32,
    /// Photons in the map.
    pub stored: u32,
    /// Photons dropped because the buffer was full.
    pub dropped: u32,
    /// Paths whose photons are all in the map; the flux is divided by this.
    pub paths_kept: u32,
    /// Photons that the list holds at most.
    pub capacity: u32,
}

/// Why pixels of the right eye were filled, summed over the frame's samples.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct FilledBecause {
    /// Outside the left image.
    pub out_of_left_view: u32,
    /// Hidden from the left eye.
    pub disoccluded: u32,
    /// The left image shows another surface there.
    pub edge: u32,
    /// What is seen depends on the viewing direction.
    pub view_dependent: u32,
    /// The left eye sees the surface, but too few of its samples agree with the point.
    pub gap: u32,
}

/// Stereo reuse of a frame, summed over its samples.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct StereoStats {
    /// Left samples that hit a surface.
    pub left_hits: u32,
    /// Those that the right eye sees, or, on triangles of less than 16 of its pixels, looks towards; with lookup, all of them.
    pub scattered: u32,
    /// Right pixels that took one over.
    pub reused: u32,
    /// Right pixels that see a surface and were filled.
    pub filled: u32,
    /// Right primary rays that were traced by `--reuse scatter`, since they met no triangle of a left hit in their pixel.
    pub traced: u32,
    /// Of the reused, glossy ones: direct light by the left light samples, scattered anew towards the right eye; indirect
    /// light per reflectance. The others took all light over.
    pub resampled: u32,
    /// `reused` / (`reused` + `filled`); 0 if the right eye sees no surface.
    pub reuse_fraction: f64,
    /// Why not reused.
    pub filled_because: FilledBecause,
}

/// Host milliseconds of a frame by stage.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct CpuTimes {
    /// Instance hierarchy, lights and their upload.
    pub update: f64,
    /// Recording, submitting and waiting for the device.
    pub render: f64,
    /// Reading back counters.
    pub read_back: f64,
}

/// What one frame did.
#[derive(Debug, Clone, Default)]
pub struct FrameResult {
    /// Device milliseconds by pass.
    pub times: PassTimes,
    /// Host milliseconds by stage.
    pub cpu_ms: CpuTimes,
    /// The same stages with their times.
    pub stages: Vec<HostSpan>,
    /// Photons, with the photon method.
    pub photons: PhotonStats,
    /// Stereo reuse; zero without it.
    pub stereo: StereoStats,
    /// Dispatches in their order, with `output.work`.
    pub work: Vec<Dispatched>,
}

impl FrameResult {
    /// Notes a stage that ends now; milliseconds.
    pub(super) fn note(&mut self, stage: &'static str, began: Instant) -> f64 {
        let span = HostSpan::since(stage, began);
        self.stages.push(span);
        span.ms()
    }
}

impl StereoStats {
    /// From the counters, as they are read back.
    pub(super) fn from_counters(counters: &StereoCounters) -> Self {
        let because = |provenance: Provenance| counters.filled_because[provenance as usize];
        let filled_because = FilledBecause {
            out_of_left_view: because(Provenance::OutOfLeftView),
            disoccluded: because(Provenance::Disoccluded),
            edge: because(Provenance::Edge),
            view_dependent: because(Provenance::ViewDependent),
            gap: because(Provenance::Gap),
        };
        let reused = counters.reused;
        let filled = counters.filled_because.iter().sum::<u32>();
        let surfaces = f64::from(reused) + f64::from(filled);
        Self {
            left_hits: counters.left_hits,
            scattered: counters.scattered,
            reused,
            filled,
            traced: counters.traced,
            resampled: counters.resampled,
            reuse_fraction: if surfaces > 0.0 {
                f64::from(reused) / surfaces
            } else {
                0.0
            },
            filled_because,
        }
    }
}
