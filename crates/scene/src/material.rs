//! Materials, textures and images as the importer hands them to the renderer.

use stereolux_bvh::MaterialMarks;
use stereolux_bvh::records::TRIANGLE_ALPHA;

/// A reference from a material slot to a texture, with its coordinate set and KHR_texture_transform.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureRef {
    /// Index into [`super::Scene::textures`].
    pub texture: u32,
    /// Coordinate set: 0 reads `uv0`, 1 reads `uv1`.
    pub uv_set: u32,
    /// KHR_texture_transform as a row-major 2x3 matrix: `u' = m0 u + m1 v + m2`, `v' = m3 u + m4 v + m5`.
    pub texcoord_from_uv: [f32; 6],
}

impl TextureRef {
    /// The transform that leaves coordinates as they are.
    pub const IDENTITY: [f32; 6] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0];

    /// A texture by the first set of coordinates as they are.
    #[must_use]
    pub const fn plain(texture: u32) -> Self {
        Self {
            texture,
            uv_set: 0,
            texcoord_from_uv: Self::IDENTITY,
        }
    }
}

/// How the alpha of the base colour is read (glTF 2.0, section 3.9.4).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AlphaMode {
    /// Alpha is ignored.
    Opaque,
    /// The surface exists where alpha is at least the cutoff.
    Mask {
        /// Threshold on alpha, 0 or more.
        cutoff: f32,
    },
    /// Alpha is the probability that a ray meets the surface.
    Blend,
}

/// A glTF 2.0 material with the extensions that the renderer evaluates. Textures multiply the factor beside them.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name in the file, or `material N`.
    pub name: String,
    /// Linear RGB base colour and alpha, each 0 to 1.
    pub base_color: [f32; 4],
    /// sRGB texture, alpha linear.
    pub base_color_texture: Option<TextureRef>,
    /// 0 dielectric to 1 metal.
    pub metallic: f32,
    /// Perceptual roughness 0 to 1; GGX alpha is its square.
    pub roughness: f32,
    /// Linear texture: roughness in green, metalness in blue.
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Linear tangent-space normal texture.
    pub normal_texture: Option<TextureRef>,
    /// Scale of the normal texture's x and y.
    pub normal_scale: f32,
    /// `emissiveFactor` times `emissiveStrength`: radiance, W sr^-1 m^-2, linear RGB.
    pub emission: [f32; 3],
    /// sRGB texture.
    pub emissive_texture: Option<TextureRef>,
    /// Index of refraction, 1 or more (KHR_materials_ior; default 1.5). 0 is the extension's special value: F0 of one.
    pub ior: f32,
    /// KHR_materials_specular strength 0 to 1; 0 makes a dielectric an ideal Lambert surface.
    pub specular: f32,
    /// Linear texture, strength in alpha.
    pub specular_texture: Option<TextureRef>,
    /// Tint of F0, 0 or more.
    pub specular_color: [f32; 3],
    /// sRGB texture.
    pub specular_color_texture: Option<TextureRef>,
    /// Share of the non-metal, non-reflected light that passes through, 0 to 1 (KHR_materials_transmission).
    pub transmission: f32,
    /// Linear texture, share in red.
    pub transmission_texture: Option<TextureRef>,
    /// KHR_materials_volume thickness factor. Real geometry bounds the medium here; 0 lets open surfaces be thin walls.
    pub thickness: f32,
    /// Most of its surfaces are open: without a thickness its glass is a thin wall ([`Material::is_thin_wall`]).
    pub is_open: bool,
    /// Distance in metres at which white light has become `attenuation_color`; infinity means no absorption.
    pub attenuation_distance_m: f32,
    /// What is left of white light after `attenuation_distance_m`, each 0 to 1.
    pub attenuation_color: [f32; 3],
    /// How alpha is read.
    pub alpha_mode: AlphaMode,
    /// Emission on both sides. Opaque surfaces scatter on both sides either way.
    pub double_sided: bool,
    /// 0: the glTF model; otherwise the number of a BSDF that the user registered.
    pub user_bsdf: u32,
}

impl Default for Material {
    /// glTF's default material: white, metallic 1, roughness 1 (glTF 2.0, section 3.7.2.1).
    fn default() -> Self {
        Self {
            name: "default".to_owned(),
            base_color: [1.0; 4],
            base_color_texture: None,
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            emission: [0.0; 3],
            emissive_texture: None,
            ior: 1.5,
            specular: 1.0,
            specular_texture: None,
            specular_color: [1.0; 3],
            specular_color_texture: None,
            transmission: 0.0,
            transmission_texture: None,
            thickness: 0.0,
            is_open: false,
            attenuation_distance_m: f32::INFINITY,
            attenuation_color: [1.0; 3],
            alpha_mode: AlphaMode::Opaque,
            double_sided: false,
            user_bsdf: 0,
        }
    }
}

impl Material {
    /// An ideal Lambert surface: non-metal with KHR_materials_specular strength 0, as the embedded scenes use.
    pub fn lambert(name: &str, albedo: [f32; 3]) -> Self {
        Self {
            name: name.to_owned(),
            base_color: [albedo[0], albedo[1], albedo[2], 1.0],
            metallic: 0.0,
            specular: 0.0,
            ..Self::default()
        }
    }

    /// Whether the material scatters as an ideal Lambert surface and nothing else.
    /// A textured factor of 0 stays 0, because textures only multiply.
    ///
    /// Of a non-metal's factors the specular strength alone switches the layer off: an index of 1 and a black specular
    /// colour leave F0 = 0 but F90 = strength, and the layer reflects at grazing angles (KHR_materials_specular,
    /// "Implementation": `dielectric_f90 = specular`).
    pub fn is_lambert(&self) -> bool {
        self.user_bsdf == 0
            && self.metallic == 0.0
            && self.transmission == 0.0
            && self.specular == 0.0
    }

    /// Whether the layer over the base can be a full mirror: KHR_materials_ior's special value 0, for materials that
    /// come from the specular-glossiness model, where the specular colour is F0 itself.
    pub fn has_metal_like_layer(&self) -> bool {
        self.ior == 0.0 && self.specular > 0.0 && self.has_base_layer()
    }

    /// Whether any part of the light passes through the surface as through glass.
    pub fn is_dielectric(&self) -> bool {
        self.transmission > 0.0 && self.can_be_non_metal()
    }

    /// Whether its glass has no thickness, as far as the file says.
    pub(super) fn may_be_thin(&self) -> bool {
        self.is_dielectric() && self.thickness == 0.0
    }

    /// Whether what passes through it passes both faces of a thin wall at once: it is not bent, and enters no body.
    pub fn is_thin_wall(&self) -> bool {
        self.may_be_thin() && self.is_open
    }

    /// Whether any part of the surface scatters light diffusely: neither all metal nor all glass.
    pub fn has_base_layer(&self) -> bool {
        self.can_be_non_metal() && (self.transmission < 1.0 || self.transmission_texture.is_some())
    }

    fn can_be_non_metal(&self) -> bool {
        self.metallic < 1.0 || self.metallic_roughness_texture.is_some()
    }

    /// Chance that a ray meets it where its base colour texture is opaque: the alpha factor of blended surfaces, else 1.
    #[must_use]
    pub fn coverage(&self) -> f32 {
        match self.alpha_mode {
            AlphaMode::Blend => self.base_color[3],
            _ => 1.0,
        }
    }

    /// Whether triangles of this material emit light.
    pub fn is_emissive(&self) -> bool {
        self.emission.iter().any(|channel| *channel > 0.0)
    }

    /// Every texture slot, in the order of [`Material::texture_slots`].
    pub(super) fn texture_slots_mut(&mut self) -> [&mut Option<TextureRef>; 7] {
        [
            &mut self.base_color_texture,
            &mut self.metallic_roughness_texture,
            &mut self.normal_texture,
            &mut self.emissive_texture,
            &mut self.specular_texture,
            &mut self.specular_color_texture,
            &mut self.transmission_texture,
        ]
    }

    /// Every texture slot with a short name of its use, in a fixed order.
    pub fn texture_slots(&self) -> [(&'static str, Option<TextureRef>); 7] {
        [
            ("base_color", self.base_color_texture),
            ("metallic_roughness", self.metallic_roughness_texture),
            ("normal", self.normal_texture),
            ("emissive", self.emissive_texture),
            ("specular", self.specular_texture),
            ("specular_color", self.specular_color_texture),
            ("transmission", self.transmission_texture),
        ]
    }
}

/// What a texture coordinate outside 0 to 1 reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Wrap {
    /// The image repeats.
    #[default]
    Repeat,
    /// The image repeats, every other time mirrored.
    Mirror,
    /// The edge texel goes on.
    Clamp,
}

/// How texels of a level are combined. Only magnification counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Filter {
    /// The nearest texel.
    Nearest,
    /// Bilinear.
    #[default]
    Linear,
}

/// An image with the way it is sampled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Texture {
    /// Index into [`super::Scene::images`].
    pub image: u32,
    /// Wrap along u.
    pub wrap_u: Wrap,
    /// Wrap along v.
    pub wrap_v: Wrap,
    /// Filter.
    pub filter: Filter,
}

/// Decoded image, 8 bits per channel as stored in the file (not yet linearised). Row 0 is v = 0, the top.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Image {
    /// Name or file name, or `image N`.
    pub name: String,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width * height * 4` bytes, R G B A.
    pub rgba8: Vec<u8>,
}

impl From<&Material> for MaterialMarks {
    /// A material emits where any channel's factor is above 0.
    fn from(material: &Material) -> Self {
        let flags = match material.alpha_mode {
            AlphaMode::Opaque => 0,
            AlphaMode::Mask { .. } | AlphaMode::Blend => TRIANGLE_ALPHA,
        };
        Self {
            emits: material.is_emissive(),
            flags,
        }
    }
}
