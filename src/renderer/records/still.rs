//! What the pass that averages frames of a still view knows besides the frame: `shaders/passes/still_picture.wesl`.

use stereolux_bvh::shared_record;

shared_record! {
    /// Uniform block of both eyes.
    pub struct Still {
        /// Factor that makes a mean of the sum over a frame's samples.
        pub per_sample: f32,
        /// Factor on the mean before the tone curve.
        pub exposure: f32,
        /// Frames that the mean is made of, this one among them: 1 or more.
        pub frames: u32,
        /// Tone curve, by its number in `shaders/shared/tone.wesl`.
        pub tone: u32,
    }
}
