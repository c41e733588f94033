//! Every pass: one compute shader of `shaders/passes/`, one row here.
//!
//! What a pass reads and writes is not repeated: it is reflected from the shader ([`crate::gpu::kernel::reflect_bindings`]).
//! [`super::plan`] has their order.

#![allow(non_upper_case_globals)] // The constants bear their shaders' names.

use std::borrow::Cow;

/// Domain of a pass: what it runs over. The plan says how many there are ([`super::step::Size`]).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Domain {
    /// As many threads as its step says.
    Step,
    /// The pixels of a list: an eye's pixels that see a surface, or a part of them.
    Hits,
    /// The 8x8 tiles in which a surface is seen, all their pixels; or the whole image's, where its step says so.
    SeenTiles,
    /// All pixels, as fragments of one triangle: a render pass into a texture.
    Fragments,
}

/// One pass.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pass {
    /// Name of shader, label and timing.
    pub name: Cow<'static, str>,
    /// One sentence.
    pub what: Cow<'static, str>,
    /// Domain.
    pub over: Domain,
    /// Whether the scene's features specialise it: it reads BVHs, materials or lights, or parts of the light that only
    /// some scenes or settings have.
    pub sees_scene: bool,
}

impl Pass {
    /// Name of its shader module.
    #[must_use]
    pub fn shader_name(&self) -> String {
        format!("passes/{}", self.name)
    }
}

macro_rules! passes {
    ($($name:ident: $over:ident $($scene:ident)?, $what:literal;)*) => {
        $(
            #[doc = $what]
            pub const $name: Pass = Pass {
                name: Cow::Borrowed(stringify!($name)),
                what: Cow::Borrowed($what),
                over: Domain::$over,
                sees_scene: passes!(@ $($scene)?),
            };
        )*
        /// All of them.
        pub const ALL: &[Pass] = &[$($name),*];
    };
    (@) => { false };
    (@ scene) => { true };
}

passes! {
    deform: Step,
        "Skins and morphs vertices, in their instance's object space.";
    deform_triangles: Step,
        "Writes the deformed vertices into the BVH's triangles.";
    refit: Step,
        "Refits the boxes of one BLAS level of the deforming meshes, from the leaves up.";
    photon_trace: Step scene,
        "Emits and traces photon paths; each path stores its photons in its own slots.";
    caustic_trace: Step scene,
        "Emits the photon paths of the caustic map and traces them over narrow lobes.";
    guide_look: Step scene,
        "Finds what the pilot paths are worth, by what of their photons the head sees.";
    guide_setup: Step scene,
        "Weighs the cells of emission by what the pilot paths left.";
    photon_edges: Step scene,
        "Divides photons' flux by the share of their gather disc that surfaces cover.";
    scan_blocks: Step,
        "Prefix sum, first and second step: scans blocks of 2,048 values, then the blocks' totals.";
    scan_add: Step,
        "Prefix sum, last step: adds each block's start.";
    photon_append: Step,
        "Appends a batch's photons to the list in path order, whole paths only.";
    photon_count: Step,
        "Counts a batch's stored, dropped and kept photons.";
    photon_bounds: Step,
        "Finds the photons' bounding box.";
    grid_setup: Step,
        "Lays the grid over the photons' box.";
    cell_count: Step,
        "Counts the photons of every cell and stores each photon's cell.";
    radix_count: Step,
        "Radix sort: counts a digit of the photons' cells, block by block.";
    radix_scatter: Step,
        "Radix sort: scatters entries by a digit, stably.";
    photon_reorder: Step,
        "Copies photons into cell order and finds the longest run of a gather.";
    kd_setup: Step,
        "Computes the workgroup counts of the kd-tree's passes.";
    kd_keys: Step,
        "Takes one coordinate of every photon as its key.";
    kd_orders: Step,
        "Stores the photons' order along one axis.";
    kd_axis: Step,
        "Chooses the split axis of each node of a level.";
    kd_flag: Step,
        "Marks the photons that go to their node's left subtree.";
    kd_move: Step,
        "Partitions the photons of every node of a level.";
    kd_place: Step,
        "Puts photons and nodes into heap order.";
    first_hits: Step scene,
        "Traces primary rays, finishes what meets nothing, and lists the pixels that see a surface.";
    eye_hits: Hits scene,
        "Follows primary rays over mirrors and through glass to the first surface that gathers photons.";
    eye_fused: Hits scene,
        "Follows the eye's paths and gathers photons where they end, in one kernel.";
    direct_light: Hits scene,
        "Direct light at the gathering surfaces, by light and BSDF samples.";
    followed_light: Hits scene,
        "Light of the lights at first surfaces that are followed, by light samples.";
    photon_gather: Hits scene,
        "Radiance estimate from the photons around the gathering surfaces.";
    kd_gather: Hits scene,
        "Radiance estimate from the photons around the gathering surfaces, found in a kd-tree.";
    nearest_gather: Hits scene,
        "Radiance estimate from the k nearest photons, found in the grid.";
    kd_nearest_gather: Hits scene,
        "Radiance estimate from the k nearest photons, found in a kd-tree.";
    shared_gather: Hits scene,
        "Radiance estimate from photons that a workgroup loads into shared memory.";
    coarse_list: Hits scene,
        "Lists the pixels that gather at half rate.";
    coarse_irradiance: Hits scene,
        "Demodulates the light of the pixels that gathered.";
    coarse_spread: Hits scene,
        "Interpolates irradiance between the pixels that gathered, and lists those that must gather themselves.";
    caustic_gather: Hits scene,
        "Radiance estimate from the caustic photons around the gathering surfaces.";
    eye_combine: Hits scene,
        "Adds up a sample's light, accumulates samples, and divides what the right eye may take over by reflectance.";
    path_trace: Hits scene,
        "Path tracing with next-event estimation: the reference.";
    scatter_depth: Hits scene,
        "Reprojects left hits into the right eye and keeps the nearest distance per right pixel.";
    scatter_winner: Hits,
        "Settles ties: the lowest left pixel at the nearest distance wins.";
    reuse_hits: Step scene,
        "Finds what right primary rays meet, finishes what meets nothing, and lists the pixels that see a surface.";
    fill_hits: Hits scene,
        "Traces the primary rays of pixels whose cached hit brought no light.";
    reuse_lookup: Hits scene,
        "Lights what the right eye sees by the left samples around it, and lists the rest.";
    left_copy: Step scene,
        "Copies the left eye's sample to the right eye, if both eyes are equal.";
    list_setup: Step,
        "Computes a pixel list's workgroups from its length.";
    fill_reasons: Hits scene,
        "Finds why each filled pixel could not be reused.";
    background: Step scene,
        "Finishes the pixels that see no surface, with their motion since the previous frame, and lists the tiles of the others.";
    motion: SeenTiles scene,
        "Writes what the pixels' centres see, a surface or what shows in it, and its motion since the previous frame.";
    svgf_temporal: SeenTiles,
        "SVGF: accumulates light over frames by reprojection.";
    svgf_young: SeenTiles,
        "SVGF: estimates the variance of light with a short history by its neighbours, and limits it to theirs.";
    svgf_atrous: SeenTiles,
        "SVGF: one pass of the a-trous wavelet filter.";
    remodulate: SeenTiles scene,
        "Mixes in the other eye's filtered light, remodulates it by albedo and blends in the mean of still frames.";
    taa: SeenTiles,
        "Temporal anti-aliasing of what is shown, in linear light.";
    xr_submit: Fragments,
        "Writes an eye's image into a runtime's texture.";
    xr_submit_depth: Fragments,
        "Writes an eye's depth into a runtime's texture.";
    mirror: Fragments,
        "Draws an eye's image into its rectangle of a desktop window.";
    still_picture: Step,
        "Averages frames of a still view and tone maps the mean, 8 bits a channel.";
    inspect_surfaces: Step scene,
        "Traces each pixel's centre: instance, triangle, material, distance, normals, base colour, BVH nodes visited.";
    inspect_photons: Step,
        "Counts the photons around each pixel's surface: within the gather radius, and in its grid cell.";
    inspect_dots: Step,
        "Counts the photons that an eye sees in each of its pixels.";
    inspect_caustics: Step scene,
        "Gathers only the caustic map, at the end of each pixel centre's path.";
}
