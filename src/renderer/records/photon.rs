//! Records of the photon map that host and shaders share.

use stereolux_bvh::shared_record;

shared_record! {
    /// Twin of `PhotonCounters` in `shaders/shared/photon.wesl`.
    #[derive(Default, Eq)]
    pub struct PhotonCounters {
        /// Photons in the list.
        pub stored: u32,
        /// Photons dropped because the buffer was full.
        pub dropped: u32,
        /// Paths whose photons were all kept; the flux is divided by this.
        pub paths_kept: u32,
        /// Paths traced.
        pub paths_traced: u32,
        /// Photons that all paths made.
        pub demanded: u32,
        /// Unused.
        pub padding: [u32; 3],
    }

    /// Twin of `Photon` in `shaders/shared/photon.wesl`.
    #[derive(Default)]
    pub struct Photon {
        /// Photon space, metres.
        pub position: [f32; 3],
        /// Direction of flight, octahedral, 16 bits each.
        pub direction: u32,
        /// Power, W, before division by the number of paths.
        pub flux: [f32; 3],
        /// Normal (11 and 10 bits), whether on a blended surface (1 bit), halvings of the radius and trials that missed (2 bits each), segments from the light (6 bits).
        pub normal_depth: u32,
    }

    /// Twin of `SortedPhoton` in `shaders/shared/photon.wesl`.
    #[derive(Default)]
    pub struct SortedPhoton {
        /// Photon space, metres.
        pub position: [f32; 3],
        /// Path segments from the light.
        pub depth: u32,
        /// Unit, geometric, on the side that was hit.
        pub normal: [f32; 3],
        /// 1 on a blended surface, else 0.
        pub is_blended: u32,
        /// Unit, to where it came from.
        pub towards_light: [f32; 3],
        /// The map's radius over that of its own disc.
        pub narrower_by: f32,
        /// Power, W, before division by the number of paths.
        pub flux: [f32; 3],
        /// Share of it that is for what its disc loses over edges.
        pub edge_share: f32,
    }

    /// Twin of `PhotonGrid` in `shaders/shared/grid.wesl`.
    #[derive(Default)]
    pub struct PhotonGrid {
        /// Lower corner of the padding layer, photon space, metres.
        pub origin: [f32; 3],
        /// 1 / cell edge along y and z, 1/m.
        pub inverse_edge: f32,
        /// Cells along each axis, padding included.
        pub dims: [u32; 3],
        /// 0 for a dense grid, else the number of hashed row starts.
        pub hashed_rows: u32,
        /// Table cells in use.
        pub cell_count: u32,
        /// 1 if there are photons.
        pub has_photons: u32,
        /// Cells per edge along x.
        pub columns: u32,
        /// Gather radius that the map was made for, metres.
        pub radius: f32,
        /// Indirect dispatch over photons.
        pub photon_groups: [u32; 3],
        /// Photons that the disc of a gather holds before it is made smaller; 0: any number.
        pub most_gathered: f32,
        /// Indirect dispatch over blocks of the cells in use.
        pub block_groups: [u32; 4],
        /// Indirect dispatch over the cells in use.
        pub value_groups: [u32; 4],
        /// Indirect dispatch over blocks of what is in use of the sort's table.
        pub sort_block_groups: [u32; 4],
        /// Indirect dispatch over what is in use of it.
        pub sort_value_groups: [u32; 4],
    }
}
