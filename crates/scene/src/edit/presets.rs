//! Kinds of material that an inspector offers.

use super::super::{AlphaMode, Material};

stereolux_base::words! {
    /// A kind of material.
    #[derive(Hash)]
    pub enum MaterialPreset: name {
        /// Ideal Lambert.
        Diffuse = "diffuse",
        /// A coloured base under a smooth layer, as lacquer or plastic.
        Glossy = "glossy",
        /// Metal.
        Metal = "metal",
        /// Clear glass.
        Glass = "glass",
        /// A lamp's surface.
        Emissive = "emissive",
    }
}

/// Roughness of a gloss or a metal that was not asked for: shows highlights and blurs what it mirrors.
const ROUGHNESS: f32 = 0.3;
/// Radiance of a surface that is made a lamp, W sr^-1 m^-2: brighter than the room that it lights.
const RADIANCE: f32 = 5.0;
/// Index of refraction of window glass.
const GLASS_IOR: f32 = 1.5;

impl MaterialPreset {
    /// The kind that a material is nearest to.
    #[must_use]
    pub fn of(material: &Material) -> Self {
        if material.is_emissive() {
            Self::Emissive
        } else if material.is_dielectric() && material.transmission >= 0.5 {
            Self::Glass
        } else if material.metallic >= 0.5 {
            Self::Metal
        } else if material.is_lambert() {
            Self::Diffuse
        } else {
            Self::Glossy
        }
    }

    /// `material` as one of this kind. Name, base colour, its texture, the normal texture, alpha and sides stay, and a
    /// roughness that the kind can use; glass becomes white, because its base colour would tint what is seen through it.
    #[must_use]
    pub fn applied_to(self, material: &Material) -> Material {
        let was_dull = material.is_lambert() || material.roughness >= 1.0;
        let roughness = if was_dull {
            ROUGHNESS
        } else {
            material.roughness
        };
        let plain = Material {
            name: material.name.clone(),
            base_color: material.base_color,
            base_color_texture: material.base_color_texture,
            normal_texture: material.normal_texture,
            normal_scale: material.normal_scale,
            alpha_mode: material.alpha_mode,
            double_sided: material.double_sided,
            metallic: 0.0,
            roughness: 1.0,
            specular: 0.0,
            ..Material::default()
        };
        match self {
            Self::Diffuse => plain,
            Self::Glossy => Material {
                roughness,
                specular: 1.0,
                ..plain
            },
            Self::Metal => Material {
                metallic: 1.0,
                roughness,
                specular: 1.0,
                ..plain
            },
            Self::Glass => Material {
                base_color: [1.0; 4],
                base_color_texture: None,
                alpha_mode: AlphaMode::Opaque,
                roughness: 0.0,
                specular: 1.0,
                transmission: 1.0,
                ior: GLASS_IOR,
                ..plain
            },
            Self::Emissive => {
                let [r, g, b, _] = material.base_color;
                let most = r.max(g).max(b);
                let tint = if most > 0.0 { [r, g, b] } else { [1.0; 3] };
                Material {
                    emission: tint.map(|channel| channel * RADIANCE),
                    ..plain
                }
            }
        }
    }
}
