//! Images in one pool of rgba8 texels, and the same sampling in f64 for what the host has to know of a texture.

use std::collections::{BTreeMap, BTreeSet};

use crate::images::srgb_decode;
use crate::renderer::records::material::{
    TEXTURE_LEVELS_SHIFT, TEXTURE_NEAREST_BIT, TEXTURE_WRAP_CLAMP, TEXTURE_WRAP_MIRROR,
    TEXTURE_WRAP_REPEAT, TextureInfo,
};
use crate::scene::{Filter, Image, Material, Scene, Texture, Wrap};

use super::PackError;
use super::mips::{self, Averaging};

/// The textures that materials in use refer to.
#[derive(Clone, Debug, Default)]
pub struct PackedTextures {
    /// One per level of each texture in use and of what it stands for, finest first.
    pub infos: Vec<TextureInfo>,
    /// All levels of all images in use, red in the lowest byte.
    pub texels: Vec<u32>,
    /// First of `infos` by the place in [`Scene::textures`] and what the texture stands for.
    info_of_texture: BTreeMap<(u32, Averaging), u32>,
    has_levels: bool,
}

impl PackedTextures {
    /// Place in `infos` of a texture that a material refers to under a name of [`Material::texture_slots`].
    pub fn info(&self, material: &Material, slot: &str, texture: u32) -> Option<u32> {
        let averaging = averaging_of(material, slot, self.has_levels);
        self.info_of_texture.get(&(texture, averaging)).copied()
    }

    /// Where the levels of an image begin among the texels, once for each thing that textures of it stand for.
    pub fn places_of_image(&self, scene: &Scene, image: usize) -> BTreeSet<(u32, Averaging)> {
        let known = self.info_of_texture.iter();
        let own = known.filter(|((texture, _), _)| {
            let texture = scene.textures.get(*texture as usize);
            texture.is_some_and(|texture| texture.image as usize == image)
        });
        own.filter_map(|((_, averaging), info)| {
            let info = self.infos.get(*info as usize)?;
            Some((info.offset, *averaging))
        })
        .collect()
    }

    /// Takes the textures of a part over, which were packed alone: the infos of its texture 0 are to lie at `info` and its texels
    /// at `texel`, and it is texture `texture` of the scene.
    pub fn add_part(&mut self, part: &Self, [texture, info, texel]: [u32; 3]) {
        let first = info as usize;
        let end = first + part.infos.len();
        if self.infos.len() < end {
            self.infos.resize(end, TextureInfo::default());
        }
        for (slot, own) in self.infos[first..end].iter_mut().zip(&part.infos) {
            *slot = TextureInfo {
                offset: own.offset + texel,
                ..*own
            };
        }
        let known = part.info_of_texture.iter();
        let known = known.map(|((own, averaging), at)| ((own + texture, *averaging), at + info));
        self.info_of_texture.extend(known);
    }

    /// Forgets the textures of those numbers; `info_count` infos are left.
    pub fn remove_part(&mut self, textures: &std::ops::Range<usize>, info_count: usize) {
        self.info_of_texture
            .retain(|(texture, _), _| !textures.contains(&(*texture as usize)));
        self.infos.truncate(info_count);
    }
}

fn averaging_of(material: &Material, slot: &str, with_levels: bool) -> Averaging {
    if with_levels {
        Averaging::of(material, slot)
    } else {
        Averaging::None
    }
}

/// Materials that triangles of placed meshes refer to, by index.
pub(super) fn materials_in_use(scene: &Scene) -> Vec<bool> {
    let mut mesh_seen = vec![false; scene.meshes.len()];
    let mut in_use = vec![false; scene.materials.len()];
    for instance in scene.instances() {
        if std::mem::replace(&mut mesh_seen[instance.mesh], true) {
            continue;
        }
        for triangle in &scene.meshes[instance.mesh].triangles {
            if let Some(slot) = in_use.get_mut(triangle.material as usize) {
                *slot = true;
            }
        }
    }
    in_use
}

/// Packs the images that placed triangles need, each once for all that it stands for, at full size; with coarser levels if
/// asked to.
///
/// # Errors
/// [`PackError::TexturesTooLarge`] if they take more than `budget_bytes` (the adapter's binding limit): images are
/// never scaled silently.
pub fn pack_textures(
    scene: &Scene,
    budget_bytes: u64,
    with_levels: bool,
) -> Result<PackedTextures, PackError> {
    let wanted = textures_in_use(scene, with_levels);
    let image_of = |texture: u32| {
        let image = scene.textures.get(texture as usize)?.image;
        let image = scene.images.get(image as usize).map(|_| image)?;
        Some(image)
    };
    let used: BTreeSet<(u32, Averaging)> = wanted
        .iter()
        .filter_map(|(texture, averaging)| Some((image_of(*texture)?, *averaging)))
        .collect();
    let chains = || {
        used.iter()
            .map(|(image, averaging)| (&scene.images[*image as usize], *averaging))
    };
    let bytes_of = |(image, averaging)| 4 * mips::texel_count(image, averaging);
    let bytes: u64 = chains().map(bytes_of).sum();
    if bytes > budget_bytes.min(u64::from(u32::MAX) * 4) {
        let largest = chains()
            .max_by_key(|chain| bytes_of(*chain))
            .map(|(image, _)| format!("{}, {}x{}", image.name, image.width, image.height));
        return Err(PackError::TexturesTooLarge {
            bytes,
            images: used.len(),
            budget: budget_bytes,
            without_levels: if with_levels {
                "set textures.mips=off, "
            } else {
                ""
            },
            largest: largest.unwrap_or_default(),
        });
    }

    let mut packed = PackedTextures {
        has_levels: with_levels,
        ..PackedTextures::default()
    };
    packed.texels.reserve_exact((bytes / 4) as usize);
    let mut levels_of = BTreeMap::new();
    for key in &used {
        let offset = packed.texels.len() as u32;
        let image = &scene.images[key.0 as usize];
        let sizes = mips::add_levels(image, key.1, &mut packed.texels);
        levels_of.insert(*key, (offset, sizes));
    }
    for (texture, averaging) in wanted {
        let levels = image_of(texture).and_then(|image| levels_of.get(&(image, averaging)));
        let Some((offset, sizes)) = levels.filter(|(_, sizes)| !sizes[0].contains(&0)) else {
            continue;
        };
        let mut offset = *offset;
        let first = packed.infos.len() as u32;
        packed.info_of_texture.insert((texture, averaging), first);
        for (level, [width, height]) in sizes.iter().copied().enumerate() {
            packed.infos.push(TextureInfo {
                offset,
                width,
                height,
                flags: sampler_flags(&scene.textures[texture as usize], level, sizes.len()),
            });
            offset += width * height;
        }
    }
    Ok(packed)
}

/// All levels of an image, finest first.
pub fn image_levels(image: &Image, averaging: Averaging) -> Vec<u32> {
    let mut texels = Vec::new();
    mips::add_levels(image, averaging, &mut texels);
    texels
}

/// Textures that materials on placed triangles refer to, and what they stand for there.
fn textures_in_use(scene: &Scene, with_levels: bool) -> BTreeSet<(u32, Averaging)> {
    let materials = scene.materials.iter().zip(materials_in_use(scene));
    let slots = materials
        .filter(|(_, used)| *used)
        .flat_map(|(material, _)| {
            let slots = material.texture_slots().into_iter();
            slots.filter_map(move |(name, reference)| {
                Some((
                    reference?.texture,
                    averaging_of(material, name, with_levels),
                ))
            })
        });
    slots.collect()
}

/// Coarser levels are filtered whatever the finest is.
fn sampler_flags(texture: &Texture, level: usize, levels: usize) -> u32 {
    let wrap = |wrap: Wrap| match wrap {
        Wrap::Repeat => TEXTURE_WRAP_REPEAT,
        Wrap::Mirror => TEXTURE_WRAP_MIRROR,
        Wrap::Clamp => TEXTURE_WRAP_CLAMP,
    };
    let filter = match texture.filter {
        Filter::Nearest if level == 0 => TEXTURE_NEAREST_BIT,
        Filter::Nearest | Filter::Linear => 0,
    };
    let coarser = (levels - 1 - level) as u32;
    wrap(texture.wrap_u) | (wrap(texture.wrap_v) << 2) | filter | (coarser << TEXTURE_LEVELS_SHIFT)
}

fn wrap_texel(index: i64, size: i64, wrap: Wrap) -> i64 {
    match wrap {
        Wrap::Clamp => index.clamp(0, size - 1),
        Wrap::Repeat => index.rem_euclid(size),
        Wrap::Mirror => {
            let wrapped = index.rem_euclid(2 * size);
            if wrapped < size {
                wrapped
            } else {
                2 * size - 1 - wrapped
            }
        }
    }
}

/// Samples a texture at texture coordinates (after KHR_texture_transform) in f64, as `textures.wesl` does in f32.
/// Alpha is never decoded. A texture without image is white.
pub fn sample_image(scene: &Scene, texture: u32, texcoord: [f64; 2], is_srgb: bool) -> [f64; 4] {
    let Some(texture) = scene.textures.get(texture as usize) else {
        return [1.0; 4];
    };
    let Some(image) = scene
        .images
        .get(texture.image as usize)
        .filter(|i| i.width > 0 && i.height > 0)
    else {
        return [1.0; 4];
    };
    let (width, height) = (i64::from(image.width), i64::from(image.height));
    let fetch = |x: i64, y: i64| -> [f64; 4] {
        let column = wrap_texel(x, width, texture.wrap_u);
        let row = wrap_texel(y, height, texture.wrap_v);
        let start = ((row * width + column) * 4) as usize;
        std::array::from_fn(|channel| {
            let value = f64::from(image.rgba8.get(start + channel).copied().unwrap_or(255)) / 255.0;
            if is_srgb && channel < 3 {
                srgb_decode(value)
            } else {
                value
            }
        })
    };
    let (x, y) = (texcoord[0] * width as f64, texcoord[1] * height as f64);
    if texture.filter == Filter::Nearest {
        return fetch(x.floor() as i64, y.floor() as i64);
    }
    let (left, top) = ((x - 0.5).floor(), (y - 0.5).floor());
    let (right_share, bottom_share) = (x - 0.5 - left, y - 0.5 - top);
    let (left, top) = (left as i64, top as i64);
    let corners = [
        fetch(left, top),
        fetch(left + 1, top),
        fetch(left, top + 1),
        fetch(left + 1, top + 1),
    ];
    std::array::from_fn(|channel| {
        let upper = corners[0][channel] * (1.0 - right_share) + corners[1][channel] * right_share;
        let lower = corners[2][channel] * (1.0 - right_share) + corners[3][channel] * right_share;
        upper * (1.0 - bottom_share) + lower * bottom_share
    })
}

#[cfg(test)]
mod tests;
