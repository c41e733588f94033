//! Materials and the textures that they use.

use std::collections::HashMap;

use gltf::json;
use gltf::json::extensions::texture::TextureTransform;
use gltf::json::validation::Checked;
use serde::Deserialize as _;
use serde_json::Value;

use super::super::material::{AlphaMode, Filter, Material, Texture, TextureRef, Wrap};
use super::super::mesh::Mesh;
use super::super::{SceneError, panes};
use super::document::Document;
use super::{Notes, named};

/// Materials in file order, with the textures and images that they really use.
#[derive(Default)]
pub struct Library {
    pub materials: Vec<Material>,
    pub textures: Vec<Texture>,
    /// Index in the file of each image that is used, in the order of [`super::super::Scene::images`].
    pub image_sources: Vec<usize>,
    /// Where a texture of the file stands in `textures`, and an image of the file in `image_sources`.
    texture_of: HashMap<usize, u32>,
    image_of: HashMap<usize, u32>,
    default_material: Option<u32>,
}

impl Library {
    /// Imports every material.
    pub fn import(document: &Document<'_>, notes: &mut Notes) -> Result<Self, SceneError> {
        let mut library = Self::default();
        for (index, source) in document.root.materials.iter().enumerate() {
            let name = named(&source.name, "material", index);
            let mut slot = MaterialImport {
                document,
                library: &mut library,
                notes,
                place: format!("materials[{index}] '{name}'"),
                raw: document.raw_item("materials", index),
            };
            let material = slot.import(name, source)?;
            library.materials.push(material);
        }
        Ok(library)
    }

    /// Says of glass without a thickness whether it is a thin wall, as by the standard, or solid.
    pub fn find_panes(&mut self, meshes: &[Mesh], notes: &mut Notes) {
        let open = panes::open_materials(&self.materials, meshes);
        for ((index, material), is_open) in self.materials.iter_mut().enumerate().zip(open) {
            material.is_open = is_open == Some(true);
            if is_open == Some(false) {
                notes.warn(format_args!(
                    "materials[{index}] '{}': transmission without a thickness (KHR_materials_volume) is a thin wall by the \
                     standard; its surfaces are closed, so here it is solid glass",
                    material.name
                ));
            }
        }
    }

    /// Index of glTF's default material, appended when it is first needed.
    pub fn default_material(&mut self) -> u32 {
        *self.default_material.get_or_insert_with(|| {
            self.materials.push(Material::default());
            self.materials.len() as u32 - 1
        })
    }

    /// Index of a texture of the file among those in use.
    fn texture(&mut self, document: &Document<'_>, source: usize) -> Option<u32> {
        if let Some(known) = self.texture_of.get(&source) {
            return Some(*known);
        }
        let texture = document.root.textures.get(source)?;
        let image_source = texture.source.value();
        if image_source >= document.root.images.len() {
            return None;
        }
        let image = *self.image_of.entry(image_source).or_insert_with(|| {
            self.image_sources.push(image_source);
            self.image_sources.len() as u32 - 1
        });
        let sampler = texture
            .sampler
            .and_then(|sampler| document.root.samplers.get(sampler.value()));
        let wrap = |mode: Checked<json::texture::WrappingMode>| match mode {
            Checked::Valid(json::texture::WrappingMode::ClampToEdge) => Wrap::Clamp,
            Checked::Valid(json::texture::WrappingMode::MirroredRepeat) => Wrap::Mirror,
            Checked::Valid(json::texture::WrappingMode::Repeat) | Checked::Invalid => Wrap::Repeat,
        };
        let filter = match sampler.and_then(|sampler| sampler.mag_filter) {
            Some(Checked::Valid(json::texture::MagFilter::Nearest)) => Filter::Nearest,
            _ => Filter::Linear,
        };
        self.textures.push(Texture {
            image,
            wrap_u: sampler.map_or(Wrap::Repeat, |sampler| wrap(sampler.wrap_s)),
            wrap_v: sampler.map_or(Wrap::Repeat, |sampler| wrap(sampler.wrap_t)),
            filter,
        });
        let index = self.textures.len() as u32 - 1;
        self.texture_of.insert(source, index);
        Some(index)
    }
}

/// One material on its way in.
struct MaterialImport<'a, 'd> {
    document: &'a Document<'d>,
    library: &'a mut Library,
    notes: &'a mut Notes,
    place: String,
    raw: Option<&'a Value>,
}

impl MaterialImport<'_, '_> {
    fn import(&mut self, name: String, source: &json::Material) -> Result<Material, SceneError> {
        let pbr = &source.pbr_metallic_roughness;
        // What is absent has the extensions' defaults.
        let extensions = source.extensions.clone().unwrap_or_default();
        let specular = extensions.specular.unwrap_or_default();
        let transmission = extensions.transmission.unwrap_or_default();
        let volume = extensions.volume.unwrap_or_default();
        let strength = extensions.emissive_strength.unwrap_or_default();
        let ior = extensions.ior.unwrap_or_default().ior.0;
        if extensions.unlit.is_some() {
            self.notes.warn(format_args!(
                "{}: unlit, shaded as a lit surface",
                self.place
            ));
        }

        let strength = strength.emissive_strength.0;
        let strength = self.at_least("emissiveStrength", strength, 0.0)?;
        let mut emission = source.emissive_factor.0;
        for channel in &mut emission {
            *channel = self.at_least("emissiveFactor", *channel, 0.0)? * strength;
            if !channel.is_finite() {
                return Err(self.fault("emissiveFactor times emissiveStrength is not finite"));
            }
        }
        let ior = if ior == 0.0 {
            0.0
        } else {
            self.at_least("ior", ior, 1.0)?
        };

        let normal = source.normal_texture.as_ref();
        let normal_texture = match normal {
            Some(normal) => self.texture(
                "normalTexture",
                normal.index.value(),
                normal.tex_coord,
                self.raw_transform("normalTexture")?.as_ref(),
            ),
            None => None,
        };
        let mut attenuation_distance_m = volume.attenuation_distance.0;
        if attenuation_distance_m.is_nan() || attenuation_distance_m <= 0.0 {
            self.notes.warn(format_args!(
                "{}: attenuationDistance {attenuation_distance_m} is not above 0, taken as infinite",
                self.place
            ));
            attenuation_distance_m = f32::INFINITY;
        }
        Ok(Material {
            name,
            base_color: self.unit("baseColorFactor", pbr.base_color_factor.0)?,
            base_color_texture: self.info("baseColorTexture", pbr.base_color_texture.as_ref()),
            metallic: self.unit("metallicFactor", [pbr.metallic_factor.0])?[0],
            roughness: self.unit("roughnessFactor", [pbr.roughness_factor.0])?[0],
            metallic_roughness_texture: self.info(
                "metallicRoughnessTexture",
                pbr.metallic_roughness_texture.as_ref(),
            ),
            normal_texture,
            normal_scale: match normal {
                Some(normal) if !normal.scale.is_finite() => {
                    return Err(self.fault("normalTexture.scale is not finite"));
                }
                Some(normal) => normal.scale,
                None => 1.0,
            },
            emission,
            emissive_texture: self.info("emissiveTexture", source.emissive_texture.as_ref()),
            ior,
            specular: self.unit("specularFactor", [specular.specular_factor.0])?[0],
            specular_texture: self.info("specularTexture", specular.specular_texture.as_ref()),
            specular_color: {
                let mut color = specular.specular_color_factor.0;
                for channel in &mut color {
                    *channel = self.at_least("specularColorFactor", *channel, 0.0)?;
                }
                color
            },
            specular_color_texture: self.info(
                "specularColorTexture",
                specular.specular_color_texture.as_ref(),
            ),
            transmission: self.unit("transmissionFactor", [transmission.transmission_factor.0])?[0],
            transmission_texture: self.info(
                "transmissionTexture",
                transmission.transmission_texture.as_ref(),
            ),
            thickness: self.at_least("thicknessFactor", volume.thickness_factor.0, 0.0)?,
            // Known once there are meshes.
            is_open: false,
            attenuation_distance_m,
            attenuation_color: self.unit("attenuationColor", volume.attenuation_color.0)?,
            alpha_mode: match source.alpha_mode {
                Checked::Valid(json::material::AlphaMode::Mask) => {
                    let cutoff = source.alpha_cutoff.map_or(0.5, |cutoff| cutoff.0);
                    AlphaMode::Mask {
                        cutoff: self.at_least("alphaCutoff", cutoff, 0.0)?,
                    }
                }
                Checked::Valid(json::material::AlphaMode::Blend) => AlphaMode::Blend,
                Checked::Valid(json::material::AlphaMode::Opaque) | Checked::Invalid => {
                    AlphaMode::Opaque
                }
            },
            double_sided: source.double_sided,
            user_bsdf: 0,
        })
    }

    fn fault(&self, what: &str) -> SceneError {
        self.document.fault(format!("{}: {what}", self.place))
    }

    /// Factors from 0 to 1; others are clamped with a warning.
    fn unit<const N: usize>(
        &mut self,
        field: &str,
        values: [f32; N],
    ) -> Result<[f32; N], SceneError> {
        if values.iter().any(|value| !value.is_finite()) {
            return Err(self.fault(&format!("{field} is not finite")));
        }
        if values.iter().any(|value| !(0.0..=1.0).contains(value)) {
            self.notes.warn(format_args!(
                "{}: {field} {values:?} is clamped to 0..1",
                self.place
            ));
        }
        Ok(values.map(|value| value.clamp(0.0, 1.0)))
    }

    fn at_least(&mut self, field: &str, value: f32, least: f32) -> Result<f32, SceneError> {
        if !value.is_finite() {
            return Err(self.fault(&format!("{field} is not finite")));
        }
        if value < least {
            self.notes.warn(format_args!(
                "{}: {field} {value} is raised to {least}",
                self.place
            ));
        }
        Ok(value.max(least))
    }

    fn info(&mut self, field: &str, info: Option<&json::texture::Info>) -> Option<TextureRef> {
        let info = info?;
        let transform = info
            .extensions
            .as_ref()
            .and_then(|extensions| extensions.texture_transform.as_ref());
        self.texture(field, info.index.value(), info.tex_coord, transform)
    }

    /// KHR_texture_transform of a slot whose typed form drops it.
    fn raw_transform(&self, field: &str) -> Result<Option<TextureTransform>, SceneError> {
        let extensions = self.raw.and_then(|raw| raw.get(field)?.get("extensions"));
        let transform = extensions.and_then(|found| found.get("KHR_texture_transform"));
        let read = transform.map(TextureTransform::deserialize).transpose();
        read.map_err(|error| self.fault(&format!("{field}.KHR_texture_transform: {error}")))
    }

    fn texture(
        &mut self,
        field: &str,
        source: usize,
        tex_coord: u32,
        transform: Option<&TextureTransform>,
    ) -> Option<TextureRef> {
        let uv_set = transform.and_then(|transform| transform.tex_coord);
        let uv_set = uv_set.unwrap_or(tex_coord);
        if uv_set > 1 {
            self.notes.warn(format_args!("{}: {field} reads TEXCOORD_{uv_set}; only sets 0 and 1 are supported, the texture is left out", self.place));
            return None;
        }
        let Some(texture) = self.library.texture(self.document, source) else {
            self.notes.warn(format_args!(
                "{}: {field} has no PNG or JPEG image, the texture is left out",
                self.place
            ));
            return None;
        };
        let texcoord_from_uv = transform.map_or(TextureRef::IDENTITY, matrix_of);
        if texcoord_from_uv.iter().any(|value| !value.is_finite()) {
            self.notes.warn(format_args!(
                "{}: the texture transform of {field} is not finite, the texture is left out",
                self.place
            ));
            return None;
        }
        Some(TextureRef {
            texture,
            uv_set,
            texcoord_from_uv,
        })
    }
}

/// Translation * rotation * scale. The rotation is counter-clockwise as seen with v pointing down, which turns +u
/// towards -v: so reads the extension's example that takes the lower left quadrant with offset (0, 1).
fn matrix_of(transform: &TextureTransform) -> [f32; 6] {
    let (sin, cos) = f64::from(transform.rotation.0).sin_cos();
    let [su, sv] = transform.scale.0.map(f64::from);
    let offset = transform.offset.0;
    [
        (cos * su) as f32,
        (sin * sv) as f32,
        offset[0],
        (-sin * su) as f32,
        (cos * sv) as f32,
        offset[1],
    ]
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn texture_transform_follows_the_extension() {
        let matrix = |offset: [f32; 2], scale: [f32; 2]| {
            let rotation = std::f32::consts::FRAC_PI_2;
            let json = json!({"offset": offset, "rotation": rotation, "scale": scale});
            matrix_of(&TextureTransform::deserialize(json).unwrap())
        };
        let m = matrix([0.25, 0.5], [2.0, 3.0]);
        let apply = |u: f32, v: f32| [m[0] * u + m[1] * v + m[2], m[3] * u + m[4] * v + m[5]];
        // Rounding of f32 sums of magnitude 3.
        let close =
            |a: [f32; 2], b: [f32; 2]| (a[0] - b[0]).abs() < 1e-6 && (a[1] - b[1]).abs() < 1e-6;
        assert!(close(apply(0.0, 0.0), [0.25, 0.5]));
        assert!(
            close(apply(1.0, 0.0), [0.25, 0.5 - 2.0]),
            "{:?}",
            apply(1.0, 0.0)
        );
        assert!(
            close(apply(0.0, 1.0), [0.25 + 3.0, 0.5]),
            "{:?}",
            apply(0.0, 1.0)
        );

        // The extension's own example: the lower left quadrant, turned by 90 degrees.
        let m = matrix([0.0, 1.0], [0.5, 0.5]);
        for (u, v) in [(0.01, 0.01), (0.99, 0.01), (0.01, 0.99), (0.99, 0.99)] {
            let (u, v) = (m[0] * u + m[1] * v + m[2], m[3] * u + m[4] * v + m[5]);
            assert!(
                (0.0..=0.5).contains(&u) && (0.5..=1.0).contains(&v),
                "({u}, {v}) lies outside the quadrant"
            );
        }
    }
}
