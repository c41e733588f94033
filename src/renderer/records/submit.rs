//! What the passes that hand an image to a runtime know besides the frame: `shaders/shared/submit.wesl`.

use stereolux_bvh::shared_record;

shared_record! {
    /// Uniform block of one eye's submission.
    pub struct Submit {
        /// Factor on light before the tone curve.
        pub scale: f32,
        /// Distance at which the depth image holds 1, metres.
        pub near_m: f32,
        /// 0 left, 1 right.
        pub eye: u32,
        /// Tone curve, by its number in `shaders/shared/tone.wesl`.
        pub tone: u32,
    }
}
