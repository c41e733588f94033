//! Lights and the table they are picked by: `shaders/shared/material_types.wesl`.

use stereolux_bvh::shared_record;

/// [`Light::kind`]: an emissive triangle.
pub const LIGHT_TRIANGLE: u32 = 1;
/// [`Light::kind`]: a point light.
pub const LIGHT_POINT: u32 = 2;
/// [`Light::kind`]: a spot light.
pub const LIGHT_SPOT: u32 = 3;
/// [`Light::kind`]: parallel light.
pub const LIGHT_DIRECTIONAL: u32 = 4;
/// [`Light::kind`]: the environment; always light 0.
pub const LIGHT_ENVIRONMENT: u32 = 5;

shared_record! {
    /// One light: 64 bytes. Triangles find their corners through instance and triangle, so that only the other kinds
    /// depend on the origin of render space.
    #[derive(Default)]
    pub struct Light {
        /// Point and spot: position. Directional and environment: centre of the scene's box. Render space,
        /// metres.
        pub position: [f32; 3],
        /// `LIGHT_*`.
        pub kind: u32,
        /// Unit, the way the light travels: a spot's axis, a directional light's direction.
        pub direction: [f32; 3],
        /// Directional and environment: half the scene's box along x, m.
        pub half_box_x: f32,
        /// Point and spot: W/sr. Directional: W/m^2. Triangle: mean radiance, W sr^-1 m^-2, for information.
        pub radiance: [f32; 3],
        /// Probability of being picked, in proportion to power.
        pub pick_pdf: f32,
        /// Triangle: instance. Environment: columns of the map.
        pub instance: u32,
        /// Triangle: index into the triangles in leaf order. Environment: rows of the map.
        pub triangle: u32,
        /// Spot: attenuation is clamp(cos * scale + offset, 0, 1)^2. Directional and environment: half the scene's box along y
        /// and, in `spot_offset`, z, m.
        pub spot_scale: f32,
        /// See `spot_scale`.
        pub spot_offset: f32,
    }

    /// Entry of Vose's alias table. Entry 0 is a header: its `alias_index` is the number of lights n; light i has entry
    /// i + 1. The count lies here because a buffer may be longer than what it holds.
    #[derive(Default)]
    pub struct LightAlias {
        /// Chance to stay at this light, 0 to 1.
        pub threshold: f32,
        /// The light to take otherwise.
        pub alias_index: u32,
    }
}
