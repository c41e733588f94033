//! What a frame says of itself: a line of `stats.jsonl`.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::frame::work::{Dispatched, WorkCounts};
use crate::gpu::PassTimes;
use crate::renderer::{CpuTimes, FrameResult, PhotonStats, StereoStats};

/// One line of `stats.jsonl`.
#[derive(Debug, Clone, Serialize)]
pub struct FrameStats {
    /// Frame number from 0.
    pub frame: u32,
    /// Predicted display time, nanoseconds.
    pub display_time_ns: i64,
    /// Device milliseconds by pass; `left.` and `right.` passes belong to that eye, `photons.` to
    /// both, `reconstruction.` to the eye named next.
    pub pass_ms: BTreeMap<String, f64>,
    /// Device milliseconds of the photon map, the left eye, the right eye, reconstruction, and all together.
    pub gpu_ms: GpuSums,
    /// Host milliseconds by stage.
    pub cpu_ms: CpuMs,
    /// The photon map.
    pub photons: PhotonStats,
    /// Stereo reuse.
    pub stereo: StereoStats,
    /// Pixels of this frame's images that were not finite and were written as 0; must be 0.
    pub non_finite_pixels: usize,
    /// Whether the tracker had no usable pose, so that the last good one was shown again.
    pub pose_repeated: bool,
    /// How old the pose was by which the eyes were rendered: host milliseconds from asking the session for it to having
    /// handed the eyes' passes to the device.
    pub pose_age_ms: f64,
    /// What each pass did, with `output.work`.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub work: BTreeMap<String, WorkCounts>,
    /// Waits for the device while the frame was rendered and handed over, besides those for a frame's end: 0 but where
    /// photons are all traced anew and steer the same frame. Reading images that were asked for is none of them.
    pub host_waits: u64,
}

impl FrameStats {
    /// What the renderer reports of frame `frame`; 0 what only a session knows.
    pub(crate) fn of(frame: u32, result: FrameResult) -> Self {
        let passes = result.times.passes.iter();
        Self {
            frame,
            display_time_ns: 0,
            pass_ms: passes.map(|(name, (ms, _))| (name.clone(), *ms)).collect(),
            gpu_ms: GpuSums::of(&result.times),
            cpu_ms: CpuMs {
                renderer: result.cpu_ms,
                ..CpuMs::default()
            },
            photons: result.photons,
            stereo: result.stereo,
            non_finite_pixels: 0,
            pose_repeated: false,
            pose_age_ms: 0.0,
            work: counts_by_pass(&result.work),
            host_waits: 0,
        }
    }
}

/// Counts by pass, those of several dispatches added.
fn counts_by_pass(work: &[Dispatched]) -> BTreeMap<String, WorkCounts> {
    let mut passes: BTreeMap<String, WorkCounts> = BTreeMap::new();
    for dispatched in work {
        *passes.entry(dispatched.label.clone()).or_default() += dispatched.counts;
    }
    passes
}

/// Device milliseconds by part of the frame.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct GpuSums {
    /// Photon tracing and sorting.
    pub photons: f64,
    /// Left eye.
    pub left: f64,
    /// Right eye.
    pub right: f64,
    /// Reconstruction of both eyes.
    pub reconstruction: f64,
    /// All passes.
    pub total: f64,
}

impl GpuSums {
    fn of(times: &PassTimes) -> Self {
        let sum = |prefix: &str| times.sum_ms(|name| name.starts_with(prefix));
        Self {
            photons: sum("photons."),
            left: sum("left."),
            right: sum("right."),
            reconstruction: sum("reconstruction."),
            total: times.total_ms(),
        }
    }
}

/// Host milliseconds by stage.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct CpuMs {
    /// Stages of the renderer.
    #[serde(flatten)]
    pub renderer: CpuTimes,
    /// Waiting until the session wants the next frame.
    pub wait: f64,
    /// The session's other calls: begin frame, locate views, acquire targets, end frame.
    pub session: f64,
    /// Recording the copies to a runtime's images; 0 without a runtime.
    pub submit: f64,
    /// Drawing and presenting the desktop mirror; 0 without one.
    pub mirror: f64,
    /// Reading images back and writing files.
    pub write: f64,
    /// The rest of the frame.
    pub overhead: f64,
    /// The whole frame, waiting for the session included.
    pub frame: f64,
}
