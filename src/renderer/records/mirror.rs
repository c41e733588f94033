//! What the pass that draws an eye into a window knows besides the frame: `shaders/passes/mirror.wesl`.

use stereolux_bvh::shared_record;

shared_record! {
    /// Uniform block of one eye's picture in the window.
    pub struct Mirror {
        /// Upper left corner of its rectangle, window pixels.
        pub corner: [f32; 2],
        /// Image pixels per window pixel.
        pub scale: f32,
        /// Factor on light before the tone curve.
        pub light_scale: f32,
        /// 1 if the window's format does not encode sRGB by itself.
        pub encode: u32,
        /// Tone curve, by its number in `shaders/shared/tone.wesl`.
        pub tone: u32,
        /// Fills the block.
        pub unused_0: u32,
        /// Fills the block.
        pub unused_1: u32,
    }
}
