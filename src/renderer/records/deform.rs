//! Records of meshes that change their shape, shared with `shaders/shared/deform_types.wesl`.

use stereolux_bvh::shared_record;

shared_record! {
    /// A vertex as the file has it: 80 bytes.
    #[derive(Default)]
    pub struct RestVertex {
        /// Mesh space, metres.
        pub position: [f32; 3],
        /// Index of its deforming mesh.
        pub mesh: u32,
        /// Unit, or 0 where the surface takes its triangle's own normal.
        pub normal: [f32; 3],
        /// Index into the vertices of all meshes.
        pub vertex: u32,
        /// Unit, and the bitangent's side.
        pub tangent: [f32; 4],
        /// Numbers in the skin.
        pub joints: [u32; 4],
        /// They sum to 1.
        pub weights: [f32; 4],
    }

    /// A deforming mesh: 32 bytes.
    #[derive(Default)]
    pub struct DeformMesh {
        /// First row of its joints' matrices, three each; `0xffffffff` without a skin.
        pub first_joint: u32,
        /// First of its targets' weights.
        pub first_weight: u32,
        /// Morph targets.
        pub target_count: u32,
        /// First of its targets' deltas.
        pub first_delta: u32,
        /// Where its vertices lie among all deforming ones.
        pub first_vertex: u32,
        /// Vertices.
        pub vertex_count: u32,
        /// Unused.
        pub padding_0: u32,
        /// Unused.
        pub padding_1: u32,
    }
}
