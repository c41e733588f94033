//! Materials, textures and vertices: `shaders/shared/material_types.wesl`.

use stereolux_bvh::shared_record;

/// [`Material::flags`]: emission on both sides.
pub const MATERIAL_DOUBLE_SIDED: u32 = 1;
/// [`Material::flags`]: the surface exists where alpha is at least the cutoff.
pub const MATERIAL_ALPHA_MASK: u32 = 2;
/// [`Material::flags`]: alpha is the chance to meet the surface.
pub const MATERIAL_ALPHA_BLEND: u32 = 4;
/// `Material::flags`: glass is a thin wall.
pub const MATERIAL_THIN_WALL: u32 = 8;

/// Materials of a scene at most: a ray's record of the bodies that it is in (`shaders/shared/surface.wesl`) tells so many apart.
pub const MOST_MATERIALS: usize = 0x7f80;

/// [`TextureSlot::info`]: no texture.
pub const NO_TEXTURE: u32 = u32::MAX;
/// [`TextureSlot::info`]: coordinate set 1 is read.
pub const TEXTURE_UV1_BIT: u32 = 0x8000_0000;

/// [`TextureInfo::flags`], twice two bits: the image repeats. Along u as it is, along v shifted by 2.
pub const TEXTURE_WRAP_REPEAT: u32 = 0;
/// [`TextureInfo::flags`]: every other repetition is mirrored.
pub const TEXTURE_WRAP_MIRROR: u32 = 1;
/// [`TextureInfo::flags`]: the edge texel goes on.
pub const TEXTURE_WRAP_CLAMP: u32 = 2;
/// [`TextureInfo::flags`]: nearest texel instead of bilinear.
pub const TEXTURE_NEAREST_BIT: u32 = 16;

/// [`TextureInfo::flags`]: from this bit on, how many coarser levels follow.
pub const TEXTURE_LEVELS_SHIFT: u32 = 8;

shared_record! {
    /// A texture reference with KHR_texture_transform: u' = row_u . (u, v, 1), v' = row_v . (u, v, 1).
    pub struct TextureSlot {
        /// First row of the transform.
        pub row_u: [f32; 3],
        /// Index of a [`TextureInfo`], perhaps with [`TEXTURE_UV1_BIT`], or [`NO_TEXTURE`].
        pub info: u32,
        /// Second row of the transform.
        pub row_v: [f32; 3],
        /// Zero.
        pub reserved: u32,
    }
}

impl TextureSlot {
    /// No texture: the factor stands alone.
    pub const NONE: Self = Self {
        row_u: [1.0, 0.0, 0.0],
        info: NO_TEXTURE,
        row_v: [0.0, 1.0, 0.0],
        reserved: 0,
    };
}

impl Default for TextureSlot {
    fn default() -> Self {
        Self::NONE
    }
}

shared_record! {
    /// A glTF material. Textures multiply the factors. 320 bytes.
    #[derive(Default)]
    pub struct Material {
        /// Linear RGB base colour and alpha, 0 to 1.
        pub base_color: [f32; 4],
        /// Radiance, W sr^-1 m^-2.
        pub emission: [f32; 3],
        /// `MATERIAL_*` bits.
        pub flags: u32,
        /// Tint of the dielectric F0, 0 or more.
        pub specular_color: [f32; 3],
        /// Strength of the dielectric layer, 0 to 1.
        pub specular: f32,
        /// Beer's law: transmittance is exp(-attenuation_per_m * metres).
        pub attenuation_per_m: [f32; 3],
        /// Index of refraction, above 0.
        pub ior: f32,
        /// 0 dielectric to 1 metal.
        pub metallic: f32,
        /// Perceptual roughness, 0 to 1; GGX alpha is its square.
        pub roughness: f32,
        /// Share of the dielectric that is solid glass, 0 to 1.
        pub transmission: f32,
        /// Scale of the normal map's x and y.
        pub normal_scale: f32,
        /// Threshold for [`MATERIAL_ALPHA_MASK`].
        pub alpha_cutoff: f32,
        /// 0: the glTF model; else the number of a registered [`crate::renderer::packing::UserBsdf`].
        pub user_bsdf: u32,
        /// Zero.
        pub reserved_0: u32,
        /// Zero.
        pub reserved_1: u32,
        /// sRGB colour, linear alpha.
        pub base_color_map: TextureSlot,
        /// Linear: roughness in green, metalness in blue.
        pub metallic_roughness_map: TextureSlot,
        /// Linear, tangent space.
        pub normal_map: TextureSlot,
        /// sRGB.
        pub emissive_map: TextureSlot,
        /// Linear, strength in alpha.
        pub specular_map: TextureSlot,
        /// sRGB.
        pub specular_color_map: TextureSlot,
        /// Linear, share in red.
        pub transmission_map: TextureSlot,
    }

    /// Where a level of a texture's image lies in the pool of texels, and how it is sampled.
    #[derive(Default, Eq)]
    pub struct TextureInfo {
        /// First texel in the pool; row 0 (v = 0) first.
        pub offset: u32,
        /// Texels per row.
        pub width: u32,
        /// Rows.
        pub height: u32,
        /// `TEXTURE_WRAP_*` for u in bits 0 and 1, for v in bits 2 and 3, [`TEXTURE_NEAREST_BIT`], and from
        /// [`TEXTURE_LEVELS_SHIFT`] on the number of coarser levels, which follow.
        pub flags: u32,
    }

    /// What shading reads of a vertex; positions lie in the triangles. 64 bytes.
    #[derive(Default)]
    pub struct Vertex {
        /// Unit, object space.
        pub normal: [f32; 3],
        /// COLOR_0 red (low half) and green (high half), unorm16.
        pub color_rg: u32,
        /// Unit, object space; w is the handedness, +-1.
        pub tangent: [f32; 4],
        /// Coordinate set 0.
        pub uv0: [f32; 2],
        /// Coordinate set 1.
        pub uv1: [f32; 2],
        /// COLOR_0 blue (low half) and alpha (high half), unorm16.
        pub color_ba: u32,
        /// Zero.
        pub reserved_0: u32,
        /// Zero.
        pub reserved_1: u32,
        /// Zero.
        pub reserved_2: u32,
    }
}
