//! The passes of a frame, in order.
//!
//! A pass is one compute shader: `shaders/passes/NAME.wesl` beside `src/passes/NAME.rs`, which declares what it reads
//! and writes (a test compares that with what naga finds in the shader). Resources are named buffers; a name that a
//! shader declares and the frame does not hold is an error. The lists below are the whole frame: there is no graph.
//!
//! ```text
//! pose         DEFORM, with `refit` once per level, where a mesh has a skin or morph targets and its pose changed
//! photon map   PHOTON_BATCH per batch of paths, PHOTON_GRID, RADIX_DIGIT three times, PHOTON_FINISH
//!              (once for a static scene)
//! kd-tree      instead of the grid and its sort, where `photon.search` asks for it: PHOTON_EXTENT, KD_ORDER with
//!              RADIX_DIGIT for each axis, KD_LEVEL per level, KD_FINISH
//! caustic map  the same with CAUSTIC_BATCH, only where the scene can form caustics; always in a grid
//! left eye     EYE_PHOTON... or EYE_PATH over all pixels                 (per sample); another of GATHERS may stand for
//!              photon_gather, and eye_fused for eye_hits and photon_gather. With photon.half_rate COARSE_FIRST before
//!              the gather, then COARSE_SPREAD and the gather once more
//! right eye    off:     the same over all pixels
//!              scatter: STEREO_SCATTER, then the same over the list of empty pixels, then FILL_REASONS
//!              lookup:  STEREO_LOOKUP, then likewise
//!              both:    STEREO_EQUAL instead, where both eyes see the same
//! both eyes    RECONSTRUCT_SVGF, RECONSTRUCT_SHOWN, as far as settings ask for them (once, after all samples)
//! runtime      SUBMISSION, where an OpenXR runtime takes the images     (once, after all samples)
//! window       MIRROR, where a desktop window shows them                (likewise)
//! views        INSPECTION, and `motion` once more, when a view of intermediate results is asked for, after a frame
//! ```

use std::fmt;

macro_rules! passes {
    ($($name:ident),* $(,)?) => {
        $(pub mod $name;)*
        /// Every pass there is, by name.
        pub const ALL: &[&Pass] = &[$(&$name::PASS),*];
    };
}

passes!(
    deform,
    deform_triangles,
    refit,
    photon_trace,
    caustic_trace,
    scan_blocks,
    scan_sums,
    scan_add,
    photon_append,
    photon_count,
    photon_bounds,
    grid_setup,
    cell_count,
    radix_count,
    radix_scatter,
    photon_reorder,
    kd_setup,
    kd_keys,
    kd_orders,
    kd_axis,
    kd_flag,
    kd_move,
    kd_place,
    eye_hits,
    eye_fused,
    direct_light,
    photon_gather,
    kd_gather,
    nearest_gather,
    kd_nearest_gather,
    shared_gather,
    coarse_list,
    coarse_irradiance,
    coarse_spread,
    caustic_gather,
    eye_combine,
    path_trace,
    scatter_depth,
    scatter_winner,
    reuse_resolve,
    left_irradiance,
    indirect_lookup,
    reuse_lookup,
    left_copy,
    list_setup,
    fill_reasons,
    motion,
    svgf_temporal,
    stereo_share,
    svgf_variance,
    svgf_atrous,
    recombine,
    taa,
    xr_submit,
    xr_submit_depth,
    mirror,
    inspect_surfaces,
    inspect_photons,
    inspect_dots,
    inspect_caustics,
);

/// What a pass is dispatched over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Over {
    /// One workgroup.
    Once,
    /// Vertices, triangles or nodes of meshes that change their shape.
    Deforming,
    /// The photon paths of a batch.
    Batch,
    /// Blocks of 2,048 values of a prefix sum.
    ScanBlocks,
    /// Values of a prefix sum.
    ScanValues,
    /// Photons, sixteen per thread, by the list's capacity.
    PhotonSixteenths,
    /// Stored photons, indirectly.
    Photons,
    /// Blocks of the radix sort.
    Blocks,
    /// Nodes of one level of the kd-tree.
    Level,
    /// Places of the three orders of photons, indirectly.
    Orders,
    /// All pixels in 8x8 tiles, or the pixels of the fill list, indirectly.
    Pixels,
    /// The pixels of an eye that see a surface, indirectly.
    Hits,
    /// All pixels, as fragments of one triangle: a render pass into a texture.
    Fragments,
}

/// Declaration of one pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pass {
    /// Name of shader, source file, label and timing.
    pub name: &'static str,
    /// One sentence.
    pub what: &'static str,
    /// Domain.
    pub over: Over,
    /// Whether it is specialised by what the scene needs: it sees hierarchies, materials and lights, or handles parts
    /// of the light that only some scenes or settings have.
    pub traces: bool,
    /// Buffers that it only reads, besides the scene's.
    pub reads: &'static [&'static str],
    /// Buffers that it writes.
    pub writes: &'static [&'static str],
}

impl fmt::Display for Pass {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}({}) -> {}",
            self.name,
            self.reads.join(", "),
            self.writes.join(", ")
        )
    }
}

/// Takes skinned and morphed meshes to the frame's pose; [`refit`] once per level of the deepest hierarchy.
pub const DEFORM: &[&Pass] = &[&deform::PASS, &deform_triangles::PASS, &refit::PASS];

/// Prefix sum over one buffer.
pub const SCAN: &[&Pass] = &[&scan_blocks::PASS, &scan_sums::PASS, &scan_add::PASS];

/// Traces one batch of photon paths; [`SCAN`] over the paths' counts runs in between.
pub const PHOTON_BATCH: &[&Pass] = &[
    &photon_trace::PASS,
    &photon_append::PASS,
    &photon_count::PASS,
];

/// Traces one batch of the caustic map's paths, otherwise as [`PHOTON_BATCH`].
pub const CAUSTIC_BATCH: &[&Pass] = &[
    &caustic_trace::PASS,
    &photon_append::PASS,
    &photon_count::PASS,
];

/// Lays the grid and notes every photon's cell; [`SCAN`] over the cells' counts runs after it.
pub const PHOTON_GRID: &[&Pass] = &[&photon_bounds::PASS, &grid_setup::PASS, &cell_count::PASS];

/// One digit of the sort by cell; [`SCAN`] over the digits' counts runs in between.
pub const RADIX_DIGIT: &[&Pass] = &[&radix_count::PASS, &radix_scatter::PASS];

/// Puts the sorted photons where gathering reads them.
pub const PHOTON_FINISH: &[&Pass] = &[&photon_reorder::PASS];

/// What stands for [`PHOTON_GRID`] where photons are searched by a kd-tree: the map's extent, radius and dispatch sizes.
pub const PHOTON_EXTENT: &[&Pass] = &[&photon_bounds::PASS, &grid_setup::PASS, &kd_setup::PASS];

/// Sorts the photons along one axis for the kd-tree: [`RADIX_DIGIT`] four times in between.
pub const KD_ORDER: &[&Pass] = &[&kd_keys::PASS, &kd_orders::PASS];

/// One level of the kd-tree; [`SCAN`] over the marks runs after the second.
pub const KD_LEVEL: &[&Pass] = &[&kd_axis::PASS, &kd_flag::PASS, &kd_move::PASS];

/// Puts the photons where gathering reads them, where photons are searched by a kd-tree.
pub const KD_FINISH: &[&Pass] = &[&kd_place::PASS];

/// Passes that estimate radiance from the map of photons; one of them runs, [`photon_gather`] unless a setting asks for
/// another.
pub const GATHERS: &[&Pass] = &[
    &photon_gather::PASS,
    &kd_gather::PASS,
    &nearest_gather::PASS,
    &kd_nearest_gather::PASS,
    &shared_gather::PASS,
];

/// Before photons are gathered at half rate: lists the pixels that gather first.
pub const COARSE_FIRST: &[&Pass] = &[&coarse_list::PASS, &list_setup::PASS];

/// After they gathered: interpolates between them and lists the pixels that must gather after all.
pub const COARSE_SPREAD: &[&Pass] = &[
    &coarse_irradiance::PASS,
    &coarse_spread::PASS,
    &list_setup::PASS,
];

/// One sample of an eye by photon mapping.
pub const EYE_PHOTON: &[&Pass] = &[
    &eye_hits::PASS,
    &list_setup::PASS,
    &direct_light::PASS,
    &photon_gather::PASS,
    &eye_combine::PASS,
];

/// [`EYE_PHOTON`] where the scene can form caustics.
pub const EYE_PHOTON_CAUSTICS: &[&Pass] = &[
    &eye_hits::PASS,
    &list_setup::PASS,
    &direct_light::PASS,
    &photon_gather::PASS,
    &caustic_gather::PASS,
    &eye_combine::PASS,
];

/// One sample of an eye by photon mapping with direct light from the map.
pub const EYE_PHOTON_MAP_ONLY: &[&Pass] = &[
    &eye_hits::PASS,
    &list_setup::PASS,
    &photon_gather::PASS,
    &eye_combine::PASS,
];

/// [`EYE_PHOTON_MAP_ONLY`] where the scene can form caustics.
pub const EYE_PHOTON_MAP_ONLY_CAUSTICS: &[&Pass] = &[
    &eye_hits::PASS,
    &list_setup::PASS,
    &photon_gather::PASS,
    &caustic_gather::PASS,
    &eye_combine::PASS,
];

/// One sample of an eye by path tracing.
pub const EYE_PATH: &[&Pass] = &[&path_trace::PASS, &list_setup::PASS];

/// Carries the left eye's sample over to the right eye and lists what is left.
pub const STEREO_SCATTER: &[&Pass] = &[
    &scatter_depth::PASS,
    &scatter_winner::PASS,
    &reuse_resolve::PASS,
    &list_setup::PASS,
];

/// Traces the right eye's primary rays, lights what they meet from the left eye's samples, and lists what is left.
pub const STEREO_LOOKUP: &[&Pass] = &[
    &left_irradiance::PASS,
    &reuse_lookup::PASS,
    &list_setup::PASS,
];

/// What stands for all of the right eye's passes in frames whose eyes have one pose and the same angles.
pub const STEREO_EQUAL: &[&Pass] = &[&left_copy::PASS];

/// Before photons are gathered for the right eye's filled pixels: takes over what it can and lists the rest.
pub const FILL_INDIRECT: &[&Pass] = &[&indirect_lookup::PASS, &list_setup::PASS];

/// Filters an eye's light. [`motion`] and [`svgf_temporal`] of both eyes come before [`stereo_share`], which runs once more
/// on what [`svgf_atrous`] leaves after its last pass; both only where the eyes share.
pub const RECONSTRUCT_SVGF: &[&Pass] = &[
    &motion::PASS,
    &svgf_temporal::PASS,
    &stereo_share::PASS,
    &svgf_variance::PASS,
    &svgf_atrous::PASS,
];

/// Makes the picture that is shown of what the samples or the filter left.
pub const RECONSTRUCT_SHOWN: &[&Pass] = &[&recombine::PASS, &taa::PASS];

/// What passes read of the frame before, and what that was called when it was written.
pub const KEPT: &[(&str, &str)] = &[
    ("seen_before", "seen_surfaces"),
    ("direct_history", "direct_to"),
    ("indirect_history", "indirect_to"),
    ("moments_before", "moments"),
    ("length_before", "history_length"),
    ("displayed_before", "displayed"),
];

/// Hands an eye's image, and its depth where the runtime takes it, to an OpenXR runtime.
pub const SUBMISSION: &[&Pass] = &[&xr_submit::PASS, &xr_submit_depth::PASS];

/// Draws an eye's image into its half of a desktop window.
pub const MIRROR: &[&Pass] = &[&mirror::PASS];

/// Views of intermediate results. They run after a frame, if they are asked for, and are compiled when that happens first;
/// [`inspect_surfaces`] comes before the others.
pub const INSPECTION: &[&Pass] = &[
    &inspect_surfaces::PASS,
    &inspect_photons::PASS,
    &inspect_dots::PASS,
    &inspect_caustics::PASS,
];

/// Diagnosis of the filled pixels.
pub const FILL_REASONS: &[&Pass] = &[&fill_reasons::PASS];
