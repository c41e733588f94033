//! What is remembered from frame to frame, so that clean pictures can be made of noisy frames: where the eyes were, and for
//! how long nothing has moved. The passes stand in [`crate::frame::plan`].
//!
//! What a frame keeps lies in two buffers that take turns, so that no pass writes what it reads and nothing is copied or
//! allocated per frame.

use glam::DVec3;

use crate::gpu::{GpuContext, uniform_buffer};
use crate::renderer::records::frame::{Eye as EyeUniform, Frame};
use crate::renderer::records::reconstruction::Reconstruction as Uniform;
use crate::settings::{ReconstructSettings, RenderSettings};

/// Frames after which the offsets within the pixel begin again: as many as `reconstruct.still_until`.
const OFFSETS: u32 = 64;

/// Where in every pixel of both eyes a frame's only sample lies, from the pixel's centre, in pixels: the first 64 points of
/// Sobol's sequence in two dimensions, each in the middle of its cell, with the highest bit flipped, so that the first frame
/// looks nearly through the centre. Any 2, 4, ... 64 frames from a multiple of that number are spread evenly (digital nets
/// in base 2), and the mean of 64 is exactly 0.
pub(super) fn pixel_offset(frame_index: u32) -> [f32; 2] {
    let index = frame_index % OFFSETS;
    // Columns of the generator matrices: the mirrored identity, and Pascal's triangle modulo 2.
    let columns = [[32, 16, 8, 4, 2, 1], [32, 48, 40, 60, 34, 51]];
    columns.map(|columns: [u32; 6]| {
        let bits = (0..6).filter(|bit| index >> bit & 1 == 1);
        let point = bits.fold(OFFSETS / 2, |sum, bit| sum ^ columns[bit]);
        (point as f32 + 0.5) / OFFSETS as f32 - 0.5
    })
}

/// As [`Frame::pixel_offset`] holds it.
pub(super) fn pack_offset(offset: [f32; 2]) -> u32 {
    let [x, y] = offset.map(|c| (c * 32767.0).round() as i16 as u16);
    u32::from(x) | u32::from(y) << 16
}

/// Frames in which history is compared with new light after lights came or went: noise may hide it in the first of them.
/// Photons that are retraced in shares see it later.
const WATCHED_FRAMES: u32 = 4;
/// Share of the lights' power that a switched light changes. Moving ones change it by rounding.
const SWITCHED_SHARE: f64 = 1e-3;

/// Whether lights of such powers (W) differ by more than rounding.
fn differ(before_w: [f64; 3], after_w: [f64; 3]) -> bool {
    let pairs = before_w.into_iter().zip(after_w);
    pairs
        .into_iter()
        .any(|(before, after)| (before - after).abs() > SWITCHED_SHARE * before.max(after))
}

/// Frames that the mean of still frames is made of at most: more would change f32's last bits alone, and a sum would drift.
const MOST_STILL: u32 = 8192;

/// How many of `frames` still frames are in their mean. The first, which any frame of a moving head is, counts where nothing else
/// averages over frames.
fn still_summed(settings: &ReconstructSettings, frames: u32) -> u32 {
    let summed = match (settings.still.is_on(), settings.follows_motion()) {
        (false, _) => 0,
        (true, false) => frames,
        (true, true) => frames - 1,
    };
    summed.min(MOST_STILL)
}

/// Share of the mean of `summed` still frames in the picture. Where nothing else averages over frames, all of it.
fn still_share(settings: &ReconstructSettings, summed: u32) -> f32 {
    if !settings.still.is_on() {
        return 0.0;
    }
    if !settings.follows_motion() {
        return 1.0;
    }
    let [from, until] = [settings.still_from, settings.still_until].map(f64::from);
    ((f64::from(summed) - from) / (until - from).max(1.0)).clamp(0.0, 1.0) as f32
}

/// The memory from frame to frame.
pub struct Reconstruction {
    pub(super) uniform: wgpu::Buffer,
    /// The frame's number modulo 2: which of two buffers it writes.
    parity: usize,
    before: Option<Before>,
    still_frames: u32,
    power_w: Option<[f64; 3]>,
    /// The scene has other materials, lights or instances than the frame before showed.
    is_doubted: bool,
    /// Frames for which history is still compared with what is new, this one included.
    switched_frames_left: u32,
}

/// What is remembered of the frame before.
#[derive(Clone, Copy, PartialEq)]
struct Before {
    left: EyeUniform,
    right: EyeUniform,
    origin_in_world: DVec3,
}

impl Before {
    fn of(frame: &Frame, origin_in_world: DVec3) -> Self {
        Self {
            left: frame.left,
            right: frame.right,
            origin_in_world,
        }
    }
}

impl Reconstruction {
    pub(super) fn new(context: &GpuContext) -> Self {
        Self {
            uniform: uniform_buffer(context, "reconstruction", size_of::<Uniform>() as u64),
            parity: 0,
            before: None,
            still_frames: 0,
            power_w: None,
            is_doubted: false,
            switched_frames_left: 0,
        }
    }

    /// Frames, this one included, since anything moved.
    pub fn still_frames(&self) -> u32 {
        self.still_frames
    }

    /// Frames until the last that had these eyes, without a move between them.
    pub(super) fn frames_alike(&self, frame: &Frame, origin_in_world: DVec3) -> u32 {
        match self.before == Some(Before::of(frame, origin_in_world)) {
            true => self.still_frames,
            false => 0,
        }
    }

    /// From here on the buffers that take turns are those of the next frame.
    pub(super) fn take_turns(&mut self) {
        self.parity = 1 - self.parity;
    }

    /// Which of two buffers the frame writes, where two take turns.
    pub(super) fn parity(&self) -> usize {
        self.parity
    }

    /// Forgets the frames before: the next one begins anew.
    pub fn reset(&mut self) {
        self.before = None;
        self.still_frames = 0;
        self.power_w = None;
        self.is_doubted = false;
        self.switched_frames_left = 0;
    }

    /// Light may be other than in the frames before, which the next ones compare with their own.
    pub(super) fn doubt(&mut self) {
        self.is_doubted = true;
    }

    /// Says what the frame that is about to be reconstructed has to do with the one before. `frame` has the eyes without the
    /// frame's offset. `changed`: anything in the scene has moved or changed since then. `power_w`: all that its lights emit.
    pub(super) fn begin_frame(
        &mut self,
        context: &GpuContext,
        frame: &Frame,
        origin_in_world: DVec3,
        settings: &RenderSettings,
        changed: bool,
        power_w: [f64; 3],
    ) {
        let now = Before::of(frame, origin_in_world);
        let before = self.before.unwrap_or(now);
        let is_doubted = std::mem::take(&mut self.is_doubted);
        self.still_frames = if self.before == Some(now) && !changed && !is_doubted {
            self.still_frames.saturating_add(1)
        } else {
            1
        };
        let watched = WATCHED_FRAMES + settings.photon.shares - 1;
        let known = self.power_w.replace(power_w);
        self.switched_frames_left =
            if is_doubted || known.is_some_and(|known| differ(known, power_w)) {
                watched
            } else {
                self.switched_frames_left.saturating_sub(1)
            };
        let own = &settings.reconstruct;
        let summed = still_summed(own, self.still_frames);
        let uniform = Uniform {
            left: now.left,
            right: now.right,
            previous_left: before.left,
            previous_right: before.right,
            has_history: if self.before.is_some() { 1.0 } else { 0.0 },
            color_alpha: own.color_alpha as f32,
            moments_alpha: own.moments_alpha as f32,
            sigma_luminance: own.sigma_luminance as f32,
            sigma_normal: own.sigma_normal as f32,
            sigma_plane: own.sigma_plane_px as f32,
            still_frames: (self.still_frames - 1) as f32,
            still_share: still_share(own, summed),
            exposure: settings.output.exposure as f32,
            taa_alpha: own.taa_alpha as f32,
            taa_clip: own.taa_clip as f32,
            firefly_frames: own.firefly_frames as f32,
            light_switched: f32::from(self.switched_frames_left > 0),
            rest_share: if own.still.is_on() {
                1.0 / self.still_frames as f32
            } else {
                1.0
            },
            origin_moved: (origin_in_world - before.origin_in_world)
                .as_vec3()
                .to_array(),
            still_summed: summed as f32,
            padding: [0; 2],
        };
        context
            .queue
            .write_buffer(&self.uniform, 0, bytemuck::bytes_of(&uniform));
        self.before = Some(now);
    }
}
