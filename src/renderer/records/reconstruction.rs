//! What the reconstruction passes know besides the frame: `shaders/shared/reconstruction.wesl`.

use stereolux_bvh::shared_record;

use super::frame::Eye;

shared_record! {
    /// Uniform block of one frame's reconstruction.
    pub struct Reconstruction {
        /// Left eye, without the frame's offset within the pixel.
        pub left: Eye,
        /// Right eye, likewise.
        pub right: Eye,
        /// Left eye of the frame before, in its render space.
        pub previous_left: Eye,
        /// Right eye of the frame before.
        pub previous_right: Eye,
        /// 1 if there was a frame before, else 0.
        pub has_history: f32,
        /// Least share of a new frame in the accumulated light.
        pub color_alpha: f32,
        /// Least share of a new frame in the luminance moments.
        pub moments_alpha: f32,
        /// Standard deviations of luminance at which a weight is 1/e.
        pub sigma_luminance: f32,
        /// Exponent of the normals' cosine.
        pub sigma_normal: f32,
        /// Pixel widths from the tangent plane at which a weight is 1/e.
        pub sigma_plane: f32,
        /// Still frames before this one.
        pub still_frames: f32,
        /// The still mean's share in the picture.
        pub still_share: f32,
        /// Factor on radiance before the filmic curve.
        pub exposure: f32,
        /// Least share of a new frame in the anti-aliased picture.
        pub taa_alpha: f32,
        /// Standard deviations that a history colour may lie from its neighbours' mean.
        pub taa_clip: f32,
        /// Frames of history up to which light is limited to its brightest neighbour's.
        pub firefly_frames: f32,
        /// From the render space of the frame before to this one's, world axes, m.
        pub origin_moved: [f32; 3],
        /// 1 while lights have come or gone a few frames ago.
        pub light_switched: f32,
        /// Greatest share of a new frame in a mean over still frames; 1 where there is none.
        pub rest_share: f32,
        /// Frames in the mean over still frames, this one included; 0 while nothing is summed.
        pub still_summed: f32,
        /// Unused.
        pub padding: [u32; 2],
    }
}

/// A pixel's motion as the pass `motion` packs it: displacement in pixels, distance before in metres, 1 if it is known, else 0.
pub fn unpack_motion([low, high]: [u32; 2]) -> [f32; 4] {
    let is_known = high >> 12 != 0xf_ffff;
    let distance_m = if is_known { high >> 12 << 11 } else { 0 };
    let [x, y, distance_m] =
        [low << 10, (low >> 22 | high << 10) << 10, distance_m].map(f32::from_bits);
    [x, y, distance_m, f32::from(u8::from(is_known))]
}

/// Variances of the luminance of direct and of indirect light, from moments as `shaders/shared/filtered_light.wesl` packs them.
pub fn unpack_variances(words: [u32; 2]) -> [f32; 2] {
    words.map(|word| f32::from_bits((word & 0x3fff) << 17))
}
