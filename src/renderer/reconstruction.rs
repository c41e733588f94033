//! What is remembered from frame to frame, so that clean pictures can be made of noisy frames: where the eyes were, and for
//! how long nothing has moved. The passes stand in [`crate::frame::plan`].
//!
//! What a frame keeps lies in two buffers that take turns, so that no pass writes what it reads and nothing is copied or
//! allocated per frame.

use glam::DVec3;

use crate::gpu::{GpuContext, uniform_buffer};
use crate::renderer::records::frame::{Eye as EyeUniform, Frame};
use crate::renderer::records::reconstruction::Reconstruction as Uniform;
use crate::settings::RenderSettings;

/// The memory from frame to frame.
pub struct Reconstruction {
    pub(super) uniform: wgpu::Buffer,
    /// The frame's number modulo 2: which of two buffers it writes.
    parity: usize,
    before: Option<Before>,
    still_frames: u32,
}

/// What is remembered of the frame before.
#[derive(Clone, Copy, PartialEq)]
struct Before {
    left: EyeUniform,
    right: EyeUniform,
    origin_in_world: DVec3,
}

impl Reconstruction {
    pub(super) fn new(context: &GpuContext) -> Self {
        Self {
            uniform: uniform_buffer(context, "reconstruction", size_of::<Uniform>() as u64),
            parity: 0,
            before: None,
            still_frames: 0,
        }
    }

    /// Frames, this one included, since anything moved.
    pub fn still_frames(&self) -> u32 {
        self.still_frames
    }

    /// Which of two buffers the last frame wrote, where two take turns.
    pub(super) fn parity(&self) -> usize {
        self.parity
    }

    /// Forgets the frames before: the next one begins anew.
    pub fn reset(&mut self) {
        self.before = None;
        self.still_frames = 0;
    }

    /// Says what the frame that is about to be reconstructed has to do with the one before. `moved`: something in the
    /// scene has moved or changed since then.
    pub(super) fn begin_frame(
        &mut self,
        context: &GpuContext,
        frame: &Frame,
        origin_in_world: DVec3,
        settings: &RenderSettings,
        moved: bool,
    ) {
        self.parity = 1 - self.parity;
        let now = Before {
            left: frame.left,
            right: frame.right,
            origin_in_world,
        };
        let before = self.before.unwrap_or(now);
        self.still_frames = if self.before == Some(now) && !moved {
            self.still_frames.saturating_add(1)
        } else {
            1
        };
        let own = &settings.reconstruct;
        let uniform = Uniform {
            previous_left: before.left,
            previous_right: before.right,
            has_history: if self.before.is_some() { 1.0 } else { 0.0 },
            color_alpha: own.color_alpha as f32,
            moments_alpha: own.moments_alpha as f32,
            sigma_luminance: own.sigma_luminance as f32,
            sigma_normal: own.sigma_normal as f32,
            sigma_plane: own.sigma_plane_px as f32,
            still_frames: (self.still_frames - 1) as f32,
            still_from: own.still_from as f32,
            still_until: own.still_until as f32,
            exposure: settings.output.exposure as f32,
            taa_alpha: own.taa_alpha as f32,
            taa_clip: own.taa_clip as f32,
            firefly_frames: own.firefly_frames as f32,
            padding: [0; 3],
        };
        context
            .queue
            .write_buffer(&self.uniform, 0, bytemuck::bytes_of(&uniform));
        self.before = Some(now);
    }
}
