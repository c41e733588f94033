//! Records of the two-level hierarchy, shared with `shaders/shared/bvh_types.wesl`.
//!
//! Layouts are those of WGSL storage buffers: a `vec3f` is followed by a scalar that fills its
//! 16 bytes, so none of these types has padding.

/// Where the fields of a struct lie that host and shaders share.
#[derive(Debug, Clone, Copy)]
pub struct RecordLayout {
    /// Name of the struct on both sides.
    pub name: &'static str,
    /// Bytes.
    pub size: usize,
    /// Names and offsets in bytes.
    pub fields: &'static [(&'static str, usize)],
}

/// Declares structs of plain values that host and shaders share, laid out as C does, with a constant `LAYOUT` each
/// ([`RecordLayout`](crate::records::RecordLayout)) that tests compare with the shaders' own.
#[macro_export]
macro_rules! shared_record {
    ($($(#[$about:meta])* pub struct $name:ident {
        $($(#[$field_about:meta])* pub $field:ident: $kind:ty),+ $(,)?
    })+) => {$(
        $(#[$about])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, PartialEq, ::bytemuck::Pod, ::bytemuck::Zeroable)]
        pub struct $name {
            $($(#[$field_about])* pub $field: $kind),+
        }

        impl $name {
            /// What tests compare with the shaders' layout.
            pub const LAYOUT: $crate::records::RecordLayout = $crate::records::RecordLayout {
                name: stringify!($name),
                size: ::std::mem::size_of::<$name>(),
                fields: &[$((stringify!($field), ::std::mem::offset_of!($name, $field))),+],
            };
        }
    )+};
}

/// What [`Triangle::emitter`] holds where a triangle does not emit.
pub const NO_EMITTER: u32 = u32::MAX;
/// [`Instance::flags`]: the matrix has a negative determinant.
pub const INSTANCE_MIRRORED: u32 = 1;
/// [`Instance::flags`]: where the instance's number begins.
pub const INSTANCE_NUMBER_SHIFT: u32 = 1;
/// [`Triangle::flags`]: the material may let rays pass (alpha mask or blend).
pub const TRIANGLE_ALPHA: u32 = 1;

shared_record! {
    /// An inner node that holds the bounds of both its children: 64 bytes, one cache line.
    ///
    /// A child with count 0 is the inner node at its index. Otherwise the index is the first of `count`
    /// primitives in leaf order: triangles in a mesh hierarchy, exactly one instance at the top. A child
    /// that does not exist has bounds with min > max.
    #[derive(Default)]
    pub struct BvhNode {
        /// Lower corner of the left child's bounds, metres.
        pub left_min: [f32; 3],
        /// Inner node or first primitive of the left child.
        pub left_index: u32,
        /// Upper corner of the left child's bounds, metres.
        pub left_max: [f32; 3],
        /// Primitives in the left child, 0 for an inner node.
        pub left_count: u32,
        /// Lower corner of the right child's bounds, metres.
        pub right_min: [f32; 3],
        /// Inner node or first primitive of the right child.
        pub right_index: u32,
        /// Upper corner of the right child's bounds, metres.
        pub right_max: [f32; 3],
        /// Primitives in the right child, 0 for an inner node.
        pub right_count: u32,
    }

    /// A placed mesh: 112 bytes.
    #[derive(Default)]
    pub struct Instance {
        /// Row 0 of the 3x4 matrix that takes object space to render space.
        pub render_from_object_0: [f32; 4],
        /// Row 1.
        pub render_from_object_1: [f32; 4],
        /// Row 2.
        pub render_from_object_2: [f32; 4],
        /// Row 0 of the inverse, rounded from its own f64 value.
        pub object_from_render_0: [f32; 4],
        /// Row 1 of the inverse.
        pub object_from_render_1: [f32; 4],
        /// Row 2 of the inverse.
        pub object_from_render_2: [f32; 4],
        /// Where a ray begins in the mesh, as a stack entry: its root in the array of mesh nodes, or its few triangles.
        pub blas_root: u32,
        /// Where the emissive triangles of this instance begin in the table of lights.
        pub first_emitter: u32,
        /// [`INSTANCE_MIRRORED`], and from [`INSTANCE_NUMBER_SHIFT`] on the instance's number, which parts of it have too.
        pub flags: u32,
        /// The scene node that places it.
        pub node: u32,
    }

    /// Where an instance was in the previous frame: 64 bytes.
    #[derive(Default)]
    pub struct PreviousInstance {
        /// Row 0 of the 3x4 matrix that took object space to the previous frame's render space.
        pub render_from_object_0: [f32; 4],
        /// Row 1.
        pub render_from_object_1: [f32; 4],
        /// Row 2.
        pub render_from_object_2: [f32; 4],
        /// 1 if the previous frame showed this instance.
        pub exists: u32,
        /// Where its mesh's vertices begin in the previous frame's deformed positions, or [`NO_POSITIONS`] of a rigid
        /// mesh.
        pub first_position: u32,
        /// Its mesh's first vertex.
        pub first_vertex: u32,
        /// Unused.
        pub padding: u32,
    }
}

/// [`PreviousInstance::first_position`]: the mesh does not deform.
pub const NO_POSITIONS: u32 = u32::MAX;

shared_record! {
    /// A triangle in object space, in leaf order: 48 bytes.
    #[derive(Default)]
    pub struct Triangle {
        /// First vertex.
        pub v0: [f32; 3],
        /// Index into the scene's materials.
        pub material: u32,
        /// Second vertex.
        pub v1: [f32; 3],
        /// Ordinal among the emissive triangles of its mesh in the mesh's own order, or [`NO_EMITTER`].
        pub emitter: u32,
        /// Third vertex.
        pub v2: [f32; 3],
        /// [`TRIANGLE_ALPHA`].
        pub flags: u32,
    }
}
