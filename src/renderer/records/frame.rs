//! The frame uniform: `shaders/shared/frame.wesl`.

use stereolux_bvh::shared_record;

shared_record! {
    /// One eye in render space (world axes, origin at the head).
    pub struct Eye {
        /// Eye position in render space, metres.
        pub position: [f32; 3],
        /// Tangent of the field of view's left edge (negative for a symmetric view).
        pub tan_left: f32,
        /// First column of render_from_eye.
        pub axis_x: [f32; 3],
        /// Tangent of the right edge.
        pub tan_right: f32,
        /// Second column of render_from_eye.
        pub axis_y: [f32; 3],
        /// Tangent of the upper edge.
        pub tan_up: f32,
        /// Third column of render_from_eye; the eye looks along its negative.
        pub axis_z: [f32; 3],
        /// Tangent of the lower edge.
        pub tan_down: f32,
    }

    /// Uniform block of one frame.
    pub struct Frame {
        /// Left eye.
        pub left: Eye,
        /// Right eye.
        pub right: Eye,
        /// Left eye's position minus the right eye's, metres, subtracted in f64.
        pub left_from_right: [f32; 3],
        /// `FRAME_*` bits.
        pub flags: u32,
        /// Render space minus photon space, metres.
        pub photon_offset: [f32; 3],
        /// Gather radius of the next photon map, metres.
        pub photon_radius: f32,
        /// Pixels per eye, across.
        pub width: u32,
        /// Pixels per eye, down.
        pub height: u32,
        /// Random seed.
        pub seed: u32,
        /// Frame number.
        pub frame_index: u32,
        /// Sample number of dispatch entry 0.
        pub first_sample: u32,
        /// Samples per pixel of the whole frame.
        pub sample_count: u32,
        /// Longest light path from eye to light, in segments.
        pub max_depth: u32,
        /// Gather radius of the next caustic map, metres.
        pub caustic_radius: f32,
        /// Frame number that keys the photons' random streams.
        pub photon_frame_index: u32,
        /// Least cosine between a photon's normal and that of the surface that gathers it.
        pub normal_min_cos: f32,
        /// Dependence on the viewing direction (0 Lambert, 1 mirror) up to which light is taken over as it is.
        pub reuse_max_view_dependence: f32,
        /// GGX alpha below which eye paths follow a reflection instead of gathering.
        pub follow_max_alpha: f32,
        /// Share of its width by which a lobe may move between the eyes for its light to be reused.
        pub reuse_max_lobe_shift: f32,
        /// Photons that the estimate from the nearest takes.
        pub nearest_photons: u32,
        /// Samples of lights that one shadow ray's is chosen from, 1 or more.
        pub light_candidates: u32,
        /// Where in every pixel a frame's only sample lies, from the pixel's centre, in pixels (two snorm of 16 bits), if it is
        /// offset there; 0 otherwise.
        pub pixel_offset: u32,
        /// Most that shading normals raise a photon's power by.
        pub most_correction: f32,
        /// Unused.
        pub padding: [u32; 3],
    }
}

/// Paths end by Russian roulette.
pub const FRAME_RUSSIAN_ROULETTE: u32 = 1;
/// Direct light comes from the photon map.
pub const FRAME_DIRECT_FROM_MAP: u32 = 2;
/// Density kernel: Epanechnikov.
pub const FRAME_KERNEL_EPANECHNIKOV: u32 = 4;
/// Density kernel: cone.
pub const FRAME_KERNEL_CONE: u32 = 8;
/// Gathers make the radius smaller where photons are dense.
pub const FRAME_ADAPTIVE_RADIUS: u32 = 16;
/// The same for caustics.
pub const FRAME_ADAPTIVE_CAUSTIC_RADIUS: u32 = 32;
/// Photon maps follow one another with smaller radii.
pub const FRAME_PROGRESSIVE: u32 = 64;
