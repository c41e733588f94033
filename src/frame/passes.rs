//! Every pass: one compute shader of `shaders/passes/`, one row here.
//!
//! What a pass reads and writes is not repeated: it is reflected from the shader ([`crate::gpu::kernel::reflect_bindings`]).
//! In which order passes run stands in [`super::plan`].

#![allow(non_upper_case_globals)] // The constants bear their shaders' names.

use std::borrow::Cow;

/// What a pass runs over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Domain {
    /// One workgroup.
    Once,
    /// Vertices, triangles or nodes of meshes that change their shape.
    Deforming,
    /// The photon paths of a batch.
    Paths,
    /// Blocks of 2,048 values of a prefix sum.
    ScanBlocks,
    /// Values of a prefix sum.
    ScanValues,
    /// Photons, sixteen per thread, by the list's capacity.
    PhotonSixteenths,
    /// Stored photons.
    Photons,
    /// Blocks of the radix sort.
    Blocks,
    /// Nodes of one level of the kd-tree.
    Level,
    /// Places of the three orders of photons.
    Orders,
    /// All pixels in 8x8 tiles, or those of a list.
    Pixels,
    /// The pixels of a list: those of an eye that see a surface, or some of them.
    Hits,
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
    /// Whether it is specialised by what the scene needs: it sees hierarchies, materials and lights, or handles parts
    /// of the light that only some scenes or settings have.
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
    deform: Deforming,
        "Vertices of skinned and morphed meshes in their instance's object space.";
    deform_triangles: Deforming,
        "Puts the deformed vertices into the triangles that rays meet.";
    refit: Deforming,
        "Boxes of one level of the deforming meshes' hierarchies, from the leaves up.";
    photon_trace: Paths scene,
        "Emits photon paths, follows them, and leaves each path's photons in slots of its own.";
    caustic_trace: Paths scene,
        "Emits the photon paths of the caustic map and follows them over narrow lobes.";
    scan_blocks: ScanBlocks,
        "Prefix sum, first step: scans blocks of 2,048 values.";
    scan_sums: Once,
        "Prefix sum, second step: scans the blocks' totals.";
    scan_add: ScanValues,
        "Prefix sum, last step: adds each block's start.";
    photon_append: Paths,
        "Appends a batch's photons to the list in path order, whole paths only.";
    photon_count: Once,
        "Books a batch: what was stored, dropped, kept.";
    photon_bounds: PhotonSixteenths,
        "Finds the box around the photons.";
    grid_setup: Once,
        "Lays the grid over the photons' box.";
    cell_count: Photons,
        "Counts the photons of every cell and notes each photon's cell.";
    radix_count: Blocks,
        "Counts a digit of the photons' cells, block by block.";
    radix_scatter: Blocks,
        "Moves the photons' entries into the order of a digit, stably.";
    photon_reorder: Photons,
        "Copies photons into cell order and finds the longest cell.";
    kd_setup: Once,
        "Workgroups of the kd-tree's passes.";
    kd_keys: Photons,
        "Takes one coordinate of every photon as its key.";
    kd_orders: Photons,
        "Keeps the photons' order along one axis.";
    kd_axis: Level,
        "Chooses the axis along which each node of a level parts its photons.";
    kd_flag: Orders,
        "Marks the photons that go to their node's left subtree.";
    kd_move: Orders,
        "Parts the photons of every node of a level.";
    kd_place: Photons,
        "Puts photons and nodes into heap order.";
    eye_hits: Pixels scene,
        "Traces primary rays, over mirrors and through glass, to the first surface that gathers photons.";
    eye_fused: Pixels scene,
        "Traces the eye's paths and gathers photons where they end, in one kernel.";
    direct_light: Hits scene,
        "Direct light at the gathered surfaces, by light samples and by the surface's own directions.";
    photon_gather: Hits scene,
        "Radiance estimate from the photons around the gathered surfaces.";
    kd_gather: Hits scene,
        "Radiance estimate from the photons around the gathered surfaces, found in a kd-tree.";
    nearest_gather: Hits scene,
        "Radiance estimate from the nearest photons, found in the grid.";
    kd_nearest_gather: Hits scene,
        "Radiance estimate from the nearest photons, found in a kd-tree.";
    shared_gather: Hits scene,
        "Radiance estimate from photons that a workgroup loads together.";
    coarse_list: Hits scene,
        "Lists the pixels that gather for themselves at half rate.";
    coarse_irradiance: Hits scene,
        "Divides the gathered pixels' light by the reflectance that it came from.";
    coarse_spread: Hits scene,
        "Interpolates gathered light between the pixels that gathered, and lists what must gather by itself.";
    caustic_gather: Hits scene,
        "Radiance estimate from the caustic photons around the gathered surfaces.";
    eye_combine: Pixels scene,
        "Adds up a sample's light and accumulates samples.";
    path_trace: Pixels scene,
        "Path tracing with next-event estimation: the reference.";
    scatter_depth: Hits scene,
        "Projects left hits into the right eye and keeps the nearest distance per right pixel.";
    scatter_winner: Hits,
        "Settles ties: the lowest left pixel at the nearest distance wins.";
    reuse_resolve: Pixels scene,
        "Copies the winners' radiance and lists the pixels that are still empty.";
    left_irradiance: Hits scene,
        "Divides the left samples' radiance by the reflectance that it came from.";
    indirect_lookup: Hits scene,
        "Takes the indirect light of glossy surfaces over from the left samples around them, and lists the rest.";
    reuse_lookup: Pixels scene,
        "Traces the right eye's primary rays, lights what they meet by the left samples around it, and lists the rest.";
    left_copy: Pixels scene,
        "Gives the right eye the left eye's sample, where both see the same.";
    list_setup: Once,
        "Turns the length of a pixel list into workgroups.";
    fill_reasons: Hits scene,
        "Says of every filled pixel that sees a surface why it could not be reused.";
    motion: Pixels scene,
        "What every pixel sees, and where that was in the frame before.";
    svgf_temporal: Pixels,
        "Averages light over the frames in which its surface was seen.";
    stereo_share: Pixels,
        "Takes in the other eye's accumulated light where both see a surface.";
    svgf_variance: Pixels,
        "Estimates the variance of the accumulated light.";
    svgf_atrous: Pixels,
        "One pass of the edge-avoiding wavelet filter.";
    remodulate: Pixels scene,
        "Puts the filtered light, the albedo and the mean of still frames together.";
    taa: Pixels,
        "Averages what is shown over frames, after the filmic curve.";
    xr_submit: Fragments,
        "Writes an eye's image into a runtime's texture.";
    xr_submit_depth: Fragments,
        "Writes an eye's depth into a runtime's texture.";
    mirror: Fragments,
        "Draws an eye's image into its rectangle of a desktop window.";
    inspect_surfaces: Pixels scene,
        "Notes what the ray through each pixel's centre meets: instance, triangle, material, distance, normals, base colour, nodes.";
    inspect_photons: Pixels,
        "Counts the photons around the surface that each pixel sees: within the gather radius, and in its cell of the grid.";
    inspect_dots: Photons,
        "Counts the photons that an eye sees in each of its pixels.";
    inspect_caustics: Pixels scene,
        "Gathers the map of caustics alone, where the path of each pixel's centre ends.";
}
