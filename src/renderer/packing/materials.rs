//! Materials, with references into the packed textures.

use crate::renderer::records::material::{
    MATERIAL_ALPHA_BLEND, MATERIAL_ALPHA_MASK, MATERIAL_DOUBLE_SIDED, MATERIAL_THIN_WALL,
    MOST_MATERIALS, Material, TEXTURE_UV1_BIT, TextureSlot,
};
use crate::scene::{self, AlphaMode, Scene, TextureRef};

use super::PackError;
use super::textures::PackedTextures;

/// Stands for an infinite index of refraction, KHR_materials_ior's special value 0: F0 is 1 in f32.
const INFINITE_IOR: f32 = 1.0e8;
/// Attenuation colours are kept above this, so that Beer's exponent stays finite.
const DARKEST_ATTENUATION: f32 = 1.0e-30;

/// Packs all materials of the scene in order. Slots whose texture `textures` left out read no texture.
///
/// # Errors
///
/// [`PackError::TooManyMaterials`].
pub fn pack_materials(
    scene: &Scene,
    textures: &PackedTextures,
) -> Result<Vec<Material>, PackError> {
    let count = scene.materials.len();
    if count > MOST_MATERIALS {
        return Err(PackError::TooManyMaterials { count });
    }
    let materials = scene.materials.iter();
    let packed = materials.map(|material| pack_material(material, textures));
    Ok(packed.collect())
}

fn pack_material(material: &scene::Material, textures: &PackedTextures) -> Material {
    let mut flags = 0;
    if material.double_sided {
        flags |= MATERIAL_DOUBLE_SIDED;
    }
    if material.is_thin_wall() {
        flags |= MATERIAL_THIN_WALL;
    }
    let mut alpha_cutoff = 0.0;
    match material.alpha_mode {
        AlphaMode::Opaque => {}
        AlphaMode::Mask { cutoff } => {
            flags |= MATERIAL_ALPHA_MASK;
            alpha_cutoff = cutoff;
        }
        AlphaMode::Blend => flags |= MATERIAL_ALPHA_BLEND,
    }
    let [
        base_color_map,
        metallic_roughness_map,
        normal_map,
        emissive_map,
        specular_map,
        specular_color_map,
        transmission_map,
    ] = material.texture_slots().map(|(name, reference)| {
        let info = |reference: TextureRef| textures.info(material, name, reference.texture);
        let packed = reference.and_then(|reference| Some((reference, info(reference)?)));
        packed.map_or(TextureSlot::NONE, |(reference, info)| {
            pack_slot(reference, info)
        })
    });
    Material {
        base_color: material.base_color,
        emission: material.emission,
        flags,
        specular_color: material.specular_color,
        specular: material.specular,
        attenuation_per_m: attenuation_per_m(material),
        ior: if material.ior > 0.0 {
            material.ior
        } else {
            INFINITE_IOR
        },
        metallic: material.metallic,
        roughness: material.roughness,
        transmission: material.transmission,
        normal_scale: material.normal_scale,
        alpha_cutoff,
        user_bsdf: material.user_bsdf,
        reserved_0: 0,
        reserved_1: 0,
        base_color_map,
        metallic_roughness_map,
        normal_map,
        emissive_map,
        specular_map,
        specular_color_map,
        transmission_map,
    }
}

/// KHR_materials_volume: the colour is what is left after the attenuation distance.
fn attenuation_per_m(material: &scene::Material) -> [f32; 3] {
    let distance = material.attenuation_distance_m;
    if material.is_thin_wall() || !(distance > 0.0 && distance.is_finite()) {
        return [0.0; 3];
    }
    material.attenuation_color.map(|color| {
        let exponent = -color.clamp(DARKEST_ATTENUATION, 1.0).ln() / distance;
        exponent.clamp(0.0, f32::MAX)
    })
}

fn pack_slot(reference: TextureRef, info: u32) -> TextureSlot {
    let [m0, m1, m2, m3, m4, m5] = reference.texcoord_from_uv;
    TextureSlot {
        row_u: [m0, m1, m2],
        info: if reference.uv_set == 1 {
            info | TEXTURE_UV1_BIT
        } else {
            info
        },
        row_v: [m3, m4, m5],
        reserved: 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::renderer::records::material::NO_TEXTURE;

    fn packed(material: scene::Material) -> Material {
        let scene = Scene {
            materials: vec![material],
            ..Scene::default()
        };
        pack_materials(&scene, &PackedTextures::default()).unwrap()[0]
    }

    #[test]
    fn more_materials_than_a_ray_can_tell_apart_are_refused() {
        let packed = |count: usize| {
            let scene = Scene {
                materials: vec![scene::Material::default(); count],
                ..Scene::default()
            };
            pack_materials(&scene, &PackedTextures::default()).map(|materials| materials.len())
        };
        assert_eq!(packed(MOST_MATERIALS), Ok(MOST_MATERIALS));
        let count = MOST_MATERIALS + 1;
        assert_eq!(packed(count), Err(PackError::TooManyMaterials { count }));
    }

    #[test]
    fn attenuation_leaves_the_colour_at_the_distance() {
        let material = packed(scene::Material {
            attenuation_distance_m: 0.5,
            attenuation_color: [0.25, 1.0, 0.0],
            ..scene::Material::default()
        });
        let left = material.attenuation_per_m.map(|sigma| (-sigma * 0.5).exp());
        assert!((left[0] - 0.25).abs() < 1e-6);
        assert_eq!(material.attenuation_per_m[1], 0.0);
        assert!(left[2] < 1e-29 && material.attenuation_per_m[2].is_finite());
        assert_eq!(
            packed(scene::Material::default()).attenuation_per_m,
            [0.0; 3]
        );
    }

    #[test]
    fn flags_follow_the_alpha_mode() {
        let mask = packed(scene::Material {
            alpha_mode: AlphaMode::Mask { cutoff: 0.3 },
            double_sided: true,
            ..scene::Material::default()
        });
        assert_eq!(mask.flags, MATERIAL_ALPHA_MASK | MATERIAL_DOUBLE_SIDED);
        assert_eq!(mask.alpha_cutoff, 0.3);
        let blend = packed(scene::Material {
            alpha_mode: AlphaMode::Blend,
            ..scene::Material::default()
        });
        assert_eq!(blend.flags, MATERIAL_ALPHA_BLEND);
    }

    #[test]
    fn special_ior_reflects_everything_and_missing_textures_are_none() {
        let material = packed(scene::Material {
            ior: 0.0,
            base_color_texture: Some(TextureRef::plain(7)),
            ..scene::Material::default()
        });
        let ratio = (material.ior - 1.0) / (material.ior + 1.0);
        assert_eq!(ratio * ratio, 1.0);
        assert_eq!(material.base_color_map.info, NO_TEXTURE);
    }
}
