//! Frames on their way through the device, and what they counted.
//!
//! A frame's submissions give tickets. Its times and counters arrive when it is retired: at once in
//! [`Renderer::render_frame`], up to [`MOST`] - 1 frames later in a frame loop. What counters steer (growing photon
//! lists, slices of gathers, hierarchies built anew) therefore applies [`MOST`] frames later, however many frames are in
//! flight, so that images are the same bit for bit. Only a trace that is waited for steers at once
//! ([`Renderer::trace_photons`]).

use std::time::Instant;

use super::deform::ratios;
use super::photon_map::Counted;
use super::records::photon::PhotonCounters;
use super::records::stereo::StereoCounters;
use super::stats::{FrameResult, MapStats, StereoStats};
use super::{RenderError, Renderer};
use crate::frame::MapKind;
use crate::frame::bind::Whose;
use crate::gpu::{FrameRecorder, GpuContext, GpuError, PassTimes, Ticket};

/// Most frames on their way at once, and how many frames after its own a counter applies.
pub const MOST: u64 = 3;

/// A value that a frame asked for.
enum Asked {
    /// Counters of a map, as the frame was sent: the map, photons that its list held at most, slices of its gather.
    Map {
        index: usize,
        kind: MapKind,
        capacity: u32,
        slices: u32,
    },
    /// Counters of stereo reuse.
    Stereo,
    /// Costs of refitted hierarchies: those when they were built.
    Costs(Vec<f64>),
}

/// What a frame counted and later ones go by.
pub(super) enum Steers {
    /// Counters of a map, by its index.
    Map(usize, Counted),
    /// Costs of refitted hierarchies over those when they were built.
    Costs(Vec<f64>),
}

/// A frame on its way.
pub struct Flight {
    /// Number of the frame among all that the renderer began, from 1.
    pub(super) serial: u64,
    pub(super) result: FrameResult,
    pub(super) tickets: Vec<Ticket>,
    /// Pixels of an eye times samples.
    pub(super) eye_paths: u64,
    /// When the eyes' first passes had been recorded and handed to the device.
    pub(super) eyes_sent: Option<Instant>,
    asked: Vec<Asked>,
    landed: Vec<Vec<u8>>,
}

impl Flight {
    pub(super) fn new(serial: u64, keeps_submissions: bool) -> Self {
        let times = PassTimes {
            submissions: keeps_submissions.then(Vec::new),
            ..PassTimes::default()
        };
        Self {
            serial,
            result: FrameResult {
                times,
                ..FrameResult::default()
            },
            tickets: Vec::new(),
            eye_paths: 1,
            eyes_sent: None,
            asked: Vec::new(),
            landed: Vec::new(),
        }
    }

    /// When the eyes' first passes had been recorded and handed to the device; `None` before.
    pub(crate) fn eyes_sent(&self) -> Option<Instant> {
        self.eyes_sent
    }

    /// Waits until all that was submitted so far is done. Those submissions end together, so that the spans of one
    /// thread nest.
    pub(super) fn land(&mut self, context: &GpuContext) -> Result<(), GpuError> {
        let times = &mut self.result.times;
        let known = times.submissions.as_ref().map_or(0, Vec::len);
        for ticket in self.tickets.drain(..) {
            self.landed.extend(ticket.arrive(context, times)?);
        }
        let ended = Instant::now();
        for submission in times.submissions.iter_mut().flatten().skip(known) {
            submission.host.ended = ended;
        }
        Ok(())
    }

    /// Waits for the counts that the last submission asked for, and takes them out.
    pub(super) fn counts_now(&mut self, context: &GpuContext) -> Result<Counted, GpuError> {
        self.land(context)?;
        let bytes = self.landed.pop().unwrap_or_default();
        Ok(counted(self.serial, &bytes))
    }
}

/// From what [`Renderer::read_counts`] asked for.
fn counted(serial: u64, bytes: &[u8]) -> Counted {
    let (counters, rest) = bytes.split_at(bytes.len().min(size_of::<PhotonCounters>()));
    Counted {
        serial,
        counters: record(counters),
        longest_run: record(rest),
    }
}

/// The record that `bytes` begin with; zeros if they are too few, as for a buffer that no pass of the plan writes.
fn record<T: bytemuck::AnyBitPattern>(bytes: &[u8]) -> T {
    let own = bytes.get(..size_of::<T>());
    own.map_or_else(bytemuck::Zeroable::zeroed, bytemuck::pod_read_unaligned)
}

/// A map's statistics in the frame's, and a warning if the frame's list was too short.
fn report_counts(
    kind: MapKind,
    counters: &PhotonCounters,
    capacity: u32,
    result: &mut FrameResult,
) {
    let stats = MapStats {
        emitted: counters.paths_traced,
        stored: counters.stored,
        dropped: counters.dropped,
        paths_kept: counters.paths_kept,
        capacity,
    };
    match kind {
        MapKind::Photons => result.photons.map = stats,
        MapKind::Caustics => result.photons.caustics = Some(stats),
    }
    if result.photons.traced && counters.dropped > 0 {
        log::warn!(
            "the photon buffer is full: {} of {} photons dropped; {} of {} paths count",
            counters.dropped,
            counters.demanded,
            counters.paths_kept,
            counters.paths_traced
        );
    }
}

impl Renderer {
    /// Asks for a map's counters, after what is recorded.
    pub(super) fn read_counts(&self, recorder: &mut FrameRecorder<'_>, index: usize) {
        let whose = Whose::Map(self.maps[index].kind());
        let buffers = &self.frame.buffers;
        let sizes = [
            ("photon_counters", size_of::<PhotonCounters>() as u64),
            ("longest_run", 4),
        ];
        let ranges: Vec<_> = sizes
            .iter()
            .filter_map(|(name, bytes)| Some((buffers.written((whose, *name))?, 0, *bytes)))
            .collect();
        recorder.read(&ranges);
    }

    /// Asks for all that the frame counts, after its last pass.
    pub(super) fn ask_counters(&self, recorder: &mut FrameRecorder<'_>, flight: &mut Flight) {
        for (index, map) in self.maps.iter().enumerate() {
            self.read_counts(recorder, index);
            flight.asked.push(Asked::Map {
                index,
                kind: map.kind(),
                capacity: map.capacity(),
                slices: match map.kind() {
                    MapKind::Photons => self.gather_slices.photons,
                    MapKind::Caustics => self.gather_slices.caustics,
                },
            });
        }
        let stereo = (Whose::Frame, "stereo_counters");
        if let Some(counters) = self.frame.buffers.written(stereo).filter(|_| self.reuses()) {
            recorder.read(&[(counters, 0, size_of::<StereoCounters>() as u64)]);
            flight.asked.push(Asked::Stereo);
        }
        if let Some(built) = self.scene.ask_costs(recorder) {
            flight.asked.push(Asked::Costs(built));
        }
    }

    /// Waits for the end of the oldest frame on its way and takes over what it counted.
    ///
    /// # Errors
    /// [`RenderError::Gpu`] naming the pass.
    pub fn retire(&mut self, mut flight: Flight) -> Result<FrameResult, RenderError> {
        let began = Instant::now();
        flight.land(&self.context)?;
        let landed = std::mem::take(&mut flight.landed);
        for (asked, bytes) in std::mem::take(&mut flight.asked).into_iter().zip(landed) {
            self.arrive(asked, &bytes, &mut flight);
        }
        let passes = &flight.result.times.passes;
        let eyes = passes
            .iter()
            .filter(|(name, _)| name.starts_with("left.") || name.starts_with("right."));
        let eyes_ms: f64 = eyes.map(|(_, (ms, _))| ms).sum();
        if eyes_ms > 0.0 {
            self.pixel_ms = Some(eyes_ms / flight.eye_paths as f64);
        }
        flight.result.work = self.frame.take_work(&self.context)?;
        flight.result.cpu_ms.read_back = flight.result.note("read_back", began);
        Ok(flight.result)
    }

    /// Takes a value into the frame's statistics, and into what steers later frames, unless another renderer, for another scene,
    /// began the frame.
    fn arrive(&mut self, asked: Asked, bytes: &[u8], flight: &mut Flight) {
        let is_own = flight.serial > self.frames_before;
        let steers = match asked {
            Asked::Stereo => {
                flight.result.stereo = StereoStats::from_counters(&record(bytes));
                return;
            }
            Asked::Costs(built) if is_own => Steers::Costs(ratios(bytes, built)),
            Asked::Costs(_) => return,
            Asked::Map {
                index,
                kind,
                capacity,
                slices,
            } => {
                let counted = counted(flight.serial, bytes);
                report_counts(kind, &counted.counters, capacity, &mut flight.result);
                if !is_own {
                    return;
                }
                self.maps[index].note_counted(counted);
                let needed = self.maps[index].slices_for(counted, [1, 1]);
                if needed > slices {
                    log::warn!(
                        "the photons grew denser within {MOST} frames than gathers were made for ({needed} slices, not \
                         {slices}): this frame may lack light on drivers that end long loops"
                    );
                }
                Steers::Map(index, counted)
            }
        };
        self.steers.push_back((flight.serial, steers));
    }

    /// Lets what frames counted that began [`MOST`] or more before this one steer it.
    pub(super) fn settle(&mut self) {
        let due = |serial: u64, begun: u64| serial + MOST <= begun;
        while let Some((_, steers)) = self
            .steers
            .pop_front_if(|(serial, _)| due(*serial, self.frames_begun))
        {
            match steers {
                Steers::Map(index, counted) => self.maps[index].steer(counted),
                Steers::Costs(ratios) => {
                    if let Some(deformer) = self.scene.deformer_mut() {
                        deformer.note_costs(&ratios);
                    }
                }
            }
        }
    }
}
