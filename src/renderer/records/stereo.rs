//! What stereo reuse says of itself: `shaders/shared/stereo.wesl`.

use stereolux_bvh::shared_record;

/// Where the right eye's pixels came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Provenance {
    /// No surface.
    Background = 0,
    /// Reused: all of the light was carried over.
    Reused = 1,
    /// Filled: outside the left image.
    OutOfLeftView = 2,
    /// Filled: hidden from the left eye.
    Disoccluded = 3,
    /// Filled: the left image shows another surface there.
    Edge = 4,
    /// Filled: what is seen depends on the viewing direction.
    ViewDependent = 5,
    /// Filled: the left eye sees the surface, but too few samples agree with the point.
    Gap = 6,
    /// Reused: directions of light were carried over, and scattered anew.
    Resampled = 7,
}

impl Provenance {
    /// Whether a pixel of provenance `code` takes light over.
    #[must_use]
    pub fn is_reused(code: u32) -> bool {
        code == Self::Reused as u32 || code == Self::Resampled as u32
    }
}

/// With the left pixel that won a right one: its triangle is too small there to be met by another ray. `shaders/shared/stereo.wesl`.
#[cfg(feature = "internals")]
pub const SMALL_WINNER: u32 = 1 << 31;

shared_record! {
    /// Sums over the samples of a frame.
    #[derive(Default, Eq)]
    pub struct StereoCounters {
        /// Left samples that hit a surface.
        pub left_hits: u32,
        /// Those that the right eye sees, or, on triangles of less than 16 of its pixels, looks towards; with lookup, all of them.
        pub scattered: u32,
        /// Right pixels that took one over.
        pub reused: u32,
        /// Right primary rays that met no triangle scattered to them, and were traced.
        pub traced: u32,
        /// Of the reused, those that scattered the left light samples anew.
        pub resampled: u32,
        /// Filled pixels by [`Provenance`].
        pub filled_because: [u32; Provenance::Gap as usize + 1],
    }
}
