//! One frame: the scene moved to the head, photons, both eyes' samples, reconstruction, and what is asked for afterwards.

use std::ops::ControlFlow;
use std::time::Instant;

use super::frames_in_flight::Flight;
use super::{FrameResult, MapKind, PhotonMap, RenderError, Renderer, Stage};
use crate::frame::{GatherSlices, Only, Play};
use crate::gpu::{FrameRecorder, GpuError, PassTimes, Submission};
use crate::renderer::records::frame::Frame;
use crate::settings::{Loads, PhotonEstimate, Search};
use crate::xr::View;

/// Frames at rest after which the map stays as it is: by then the mean over frames is.
const MOST_FRAMES_AT_REST: u32 = 65_536;
/// Stride of photon keys between frames; progressive mode numbers its samples in between.
const PHOTON_KEY_STRIDE: u32 = 1_000_003;

/// Progress that never breaks a frame off.
fn going_on(mut progress: impl FnMut(u32)) -> impl FnMut(u32) -> ControlFlow<()> {
    move |done| {
        progress(done);
        ControlFlow::Continue(())
    }
}

impl Renderer {
    /// Renders one frame and waits for it. `progress` receives the number of finished samples.
    ///
    /// # Errors
    /// [`RenderError::Gpu`] naming the pass.
    pub fn render_frame(
        &mut self,
        views: &[View; 2],
        frame_index: u32,
        progress: impl FnMut(u32),
    ) -> Result<FrameResult, RenderError> {
        let flight = self.prepare_frame(views, frame_index)?;
        let flight = self.send_eyes(flight, views, frame_index, true, going_on(progress))?;
        self.retire(flight)
    }

    /// Hands one frame's work to the device and waits for it only where photons are all traced anew: the map was just made,
    /// it has grown, an edit asks for it, or it is progressive. [`Renderer::retire`] frames in their order; before
    /// another is sent, at most two may be on their way.
    ///
    /// # Errors
    /// [`RenderError::Gpu`] naming the pass.
    pub fn send_frame(
        &mut self,
        views: &[View; 2],
        frame_index: u32,
        progress: impl FnMut(u32),
    ) -> Result<Flight, RenderError> {
        let flight = self.prepare_frame(views, frame_index)?;
        self.send_eyes(flight, views, frame_index, false, going_on(progress))
    }

    /// The first part of a frame, all but the eyes: moves the scene to the head, deforms meshes, traces photons.
    /// [`Renderer::send_eyes`] is the other part.
    ///
    /// # Errors
    /// As [`Renderer::send_frame`].
    pub(crate) fn prepare_frame(
        &mut self,
        views: &[View; 2],
        frame_index: u32,
    ) -> Result<Flight, RenderError> {
        self.frames_begun += 1;
        let mut flight = Flight::new(self.frames_begun, self.settings.output.chrome_trace);
        let began = Instant::now();
        self.take_quality_over()?;
        self.settle();
        if let Some(reconstruction) = &mut self.reconstruction {
            // Images of all samples, and what photons are traced with, may lie there.
            reconstruction.take_turns();
        }
        self.origin_in_world = View::midpoint_in_world(views);
        let replaced = self
            .scene
            .begin_frame(&self.context, self.origin_in_world)?;
        // Instances may have been added one by one.
        self.shorten_dispatches();
        if replaced || !self.is_bound {
            self.bind()?;
        }
        flight.result.cpu_ms.update = flight.result.note("update", began);

        let began = Instant::now();
        self.pose(&mut flight)?;
        self.trace_for_sample(views, frame_index, 0, &mut flight)?;
        flight.result.cpu_ms.render = flight.result.note("render", began);
        Ok(flight)
    }

    /// Whether photons are traced anew for every sample, with a smaller radius each time.
    fn is_progressive(&self) -> bool {
        !self.maps.is_empty() && self.settings.photon.progressive
    }

    /// Which pass of progressive photon mapping a frame is, so that the mean of frames at rest converges: one per frame that
    /// saw the same as those before, or per several where their pixels are fewer than the photons' paths, so that frames do not
    /// take many times as long. 0, and with it the whole radius, once anything moves.
    fn pass_at_rest(&self, views: &[View; 2]) -> u32 {
        let settings = &self.settings;
        let refines = settings.photon.refine_at_rest && settings.reconstruct.still.is_on();
        let Some(known) = self.reconstruction.as_ref().filter(|_| refines) else {
            return 0;
        };
        let moved = self.scene.scene_moved() || self.scene.has_repainted_image();
        if self.edit_base.outdates_photons || moved {
            return 0;
        }
        let eyes = if self.has_both_eyes() { 2 } else { 1 };
        let pixels = eyes * self.image.pixels();
        let paths = self.maps.iter().map(|map| map.layout.config.paths);
        let paths: u64 = paths.map(u64::from).sum();
        let frame = self.frame_uniform(views, 0, 0, None);
        let alike = known.frames_alike(&frame, self.origin_in_world);
        let frames = paths.div_ceil(pixels.max(1)).max(1);
        (u64::from(alike.min(MOST_FRAMES_AT_REST)) / frames) as u32
    }

    /// Traces what photons are due for a sample.
    fn trace_for_sample(
        &mut self,
        views: &[View; 2],
        frame_index: u32,
        sample: u32,
        flight: &mut Flight,
    ) -> Result<(), RenderError> {
        let pass = match self.is_progressive() {
            true => sample,
            false => self.pass_at_rest(views),
        };
        self.progressive_pass.go_to(pass);
        let photon_key = frame_index
            .wrapping_mul(PHOTON_KEY_STRIDE)
            .wrapping_add(sample);
        let anew = std::mem::take(&mut self.edit_base.outdates_photons) || self.is_progressive();
        self.trace_photons(views, frame_index, photon_key, anew, flight)?;
        Ok(self.slice_gathers()?)
    }

    /// The eyes of a frame that was prepared, as `views` have them by now; they may have moved a little since. `lands`:
    /// waits for the frame's end, as a part of rendering it.
    ///
    /// # Errors
    /// As [`Renderer::send_frame`].
    pub(crate) fn send_eyes(
        &mut self,
        mut flight: Flight,
        views: &[View; 2],
        frame_index: u32,
        lands: bool,
        mut progress: impl FnMut(u32) -> ControlFlow<()>,
    ) -> Result<Flight, RenderError> {
        let began = Instant::now();
        self.update_hidden(views);
        let samples = self.settings.spp;
        let progressive = self.is_progressive();
        let pixels = self.image.pixels();
        flight.eye_paths = pixels * u64::from(samples.max(1));
        let limits = self.work_limits;
        let per_submission = match progressive {
            true => 1,
            false => limits.samples(&self.settings, pixels, self.pixel_ms),
        };
        let mut first = 0;
        while first < samples {
            let count = per_submission.min(samples - first);
            if first > 0 && progressive {
                self.trace_for_sample(views, frame_index, first, &mut flight)?;
            }
            let photons = self.photon_map().and_then(PhotonMap::traced_at);
            let frame = self.frame_uniform(views, frame_index, first, photons);
            self.write_frame_uniform(&frame);
            self.render_samples(views, &frame, [first, count], &mut flight)?;
            flight.eyes_sent.get_or_insert_with(Instant::now);
            first += count;
            if progress(first).is_break() && first < samples {
                return Err(RenderError::Interrupted);
            }
        }
        if lands {
            flight.land(&self.context)?;
        }
        flight.result.cpu_ms.render += flight.result.note("render", began);
        Ok(flight)
    }

    /// Times passes that do nothing, each in a submission of its own: what the device's clock says while the host's is
    /// known. Empty without timestamps.
    ///
    /// # Errors
    /// [`RenderError::Gpu`].
    #[cfg_attr(not(feature = "internals"), doc(hidden))]
    pub fn compare_clocks(&self) -> Result<Vec<Submission>, RenderError> {
        const TIMES: usize = 8;
        let mut times = PassTimes {
            submissions: Some(Vec::new()),
            ..PassTimes::default()
        };
        for _ in 0..TIMES {
            let mut recorder = FrameRecorder::new(&self.context, self.timer.as_ref(), "clock");
            recorder.nothing("clock");
            recorder.submit("clock", &mut times)?;
        }
        Ok(times.submissions.unwrap_or_default())
    }

    /// Deforms skinned and morphed meshes for the frame.
    pub(super) fn pose(&mut self, flight: &mut Flight) -> Result<(), RenderError> {
        let Some(is_new) = self.scene.pose_due() else {
            return Ok(());
        };
        let mut recorder = FrameRecorder::new(&self.context, self.timer.as_ref(), "pose");
        let how = Play {
            is_due: &|only| only == Only::Always || is_new,
            ..Play::default()
        };
        self.frame.play(&mut recorder, Stage::Pose, &how)?;
        flight.tickets.push(recorder.send("pose")?);
        self.scene.note_posed(&self.context)
    }

    /// Renders samples `first` to `first + count` of both eyes, and reconstructs after the last one.
    fn render_samples(
        &mut self,
        views: &[View; 2],
        frame: &Frame,
        [first, count]: [u32; 2],
        flight: &mut Flight,
    ) -> Result<(), RenderError> {
        let right = if views[0] == views[1] && self.frame.has(Stage::RightEqual) {
            Stage::RightEqual
        } else {
            Stage::Right
        };
        let is_last = first + count >= self.settings.spp;
        if let Some(reconstruction) = self.reconstruction.as_mut().filter(|_| is_last) {
            reconstruction.begin_frame(
                &self.context,
                frame,
                self.origin_in_world,
                &self.settings,
                self.scene.scene_moved() | self.scene.take_repainted_image(),
                self.scene.total_power_w(),
            );
        }
        let new_recorder = || FrameRecorder::new(&self.context, self.timer.as_ref(), "frame");
        let mut recorder = new_recorder();
        let mut how = Play {
            parity: self.parity(),
            ..Play::default()
        };
        if first == 0 {
            self.frame.play(&mut recorder, Stage::Begin, &how)?;
        }
        let eyes = [Stage::Left, right, Stage::Reconstruct];
        let longest: usize = eyes.map(|stage| self.frame.length(stage)).iter().sum();
        while how.sample < count {
            if recorder.room() < longest {
                let full = std::mem::replace(&mut recorder, new_recorder());
                flight.tickets.push(full.send("frame")?);
            }
            self.frame.play(&mut recorder, Stage::Left, &how)?;
            self.frame.play(&mut recorder, right, &how)?;
            how.sample += 1;
        }
        if is_last {
            self.frame.play(&mut recorder, Stage::Reconstruct, &how)?;
            self.ask_counters(&mut recorder, flight);
        }
        flight.tickets.push(recorder.send("frame")?);
        if is_last {
            if let Some(deformer) = self.scene.deformer_mut() {
                deformer.note_asked();
            }
            self.inspector.note(frame, self.origin_in_world);
        }
        Ok(())
    }

    /// Sets the gather's slices by what the maps hold.
    fn slice_gathers(&mut self) -> Result<(), GpuError> {
        let of = |kind| self.map(kind).map_or(1, PhotonMap::steered_slices);
        let [photons, caustics] = MapKind::ALL.map(of);
        let photon = &self.settings.photon;
        let slices = if photon.search == Search::Grid && photon.loads == Loads::Direct {
            // Slices share out cells, and both maps' gathers count them alike.
            let most = photons.max(caustics);
            GatherSlices {
                photons: most,
                caustics: most,
            }
        } else {
            GatherSlices { photons, caustics }
        };
        if slices == self.gather_slices {
            return Ok(());
        }
        self.gather_slices = slices;
        if slices.photons > 1 && photon.estimate == PhotonEstimate::Nearest {
            self.image.heap_bytes = (u64::from(photon.nearest) + 1) * 8;
        }
        self.bind()
    }
}
