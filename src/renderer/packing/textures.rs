//! Images in one pool of rgba8 texels, and the same sampling in f64 for what the host has to know of a texture.

use crate::renderer::records::material::{
    TEXTURE_NEAREST_BIT, TEXTURE_WRAP_CLAMP, TEXTURE_WRAP_MIRROR, TEXTURE_WRAP_REPEAT, TextureInfo,
};
use crate::scene::{Filter, Image, Scene, Texture, Wrap};

use super::PackError;

/// The textures that materials in use refer to.
#[derive(Clone, Debug, Default)]
pub struct PackedTextures {
    /// One per texture in use.
    pub infos: Vec<TextureInfo>,
    /// All images in use, red in the lowest byte.
    pub texels: Vec<u32>,
    /// For each of [`Scene::textures`] its place in `infos`, none if nothing in use refers to it.
    pub info_of_texture: Vec<Option<u32>>,
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

/// Packs the images that placed triangles need, each once, at full size.
///
/// # Errors
/// [`PackError::TexturesTooLarge`] if they take more than `budget_bytes` (the adapter's binding limit): images are
/// never scaled silently.
pub fn pack_textures(scene: &Scene, budget_bytes: u64) -> Result<PackedTextures, PackError> {
    let mut wanted = vec![false; scene.textures.len()];
    for (material, _) in scene
        .materials
        .iter()
        .zip(materials_in_use(scene))
        .filter(|(_, used)| *used)
    {
        for reference in material
            .texture_slots()
            .iter()
            .filter_map(|(_, reference)| *reference)
        {
            if let Some(slot) = wanted.get_mut(reference.texture as usize) {
                *slot = true;
            }
        }
    }
    let mut image_used = vec![false; scene.images.len()];
    for (texture, _) in scene
        .textures
        .iter()
        .zip(&wanted)
        .filter(|(_, wanted)| **wanted)
    {
        if let Some(slot) = image_used.get_mut(texture.image as usize) {
            *slot = true;
        }
    }
    let used = || {
        scene
            .images
            .iter()
            .zip(&image_used)
            .filter(|(_, used)| **used)
            .map(|(image, _)| image)
    };
    let bytes: u64 = used().map(byte_count).sum();
    if bytes > budget_bytes.min(u64::from(u32::MAX) * 4) {
        let largest = used()
            .max_by_key(|image| byte_count(image))
            .map(|image| format!("{}, {}x{}", image.name, image.width, image.height));
        return Err(PackError::TexturesTooLarge {
            bytes,
            images: used().count(),
            budget: budget_bytes,
            largest: largest.unwrap_or_default(),
        });
    }

    let mut packed = PackedTextures::default();
    packed.texels.reserve_exact((bytes / 4) as usize);
    let offsets: Vec<u32> = scene
        .images
        .iter()
        .zip(&image_used)
        .map(|(image, used)| {
            let offset = packed.texels.len() as u32;
            if *used {
                let texels = image.rgba8.chunks_exact(4);
                packed
                    .texels
                    .extend(texels.map(|t| u32::from_le_bytes([t[0], t[1], t[2], t[3]])));
            }
            offset
        })
        .collect();
    packed.info_of_texture = scene
        .textures
        .iter()
        .zip(&wanted)
        .map(|(texture, wanted)| {
            let image = scene.images.get(texture.image as usize)?;
            if !wanted || image.width == 0 || image.height == 0 {
                return None;
            }
            packed.infos.push(TextureInfo {
                offset: offsets[texture.image as usize],
                width: image.width,
                height: image.height,
                flags: sampler_flags(texture),
            });
            Some(packed.infos.len() as u32 - 1)
        })
        .collect();
    Ok(packed)
}

fn byte_count(image: &Image) -> u64 {
    u64::from(image.width) * u64::from(image.height) * 4
}

fn sampler_flags(texture: &Texture) -> u32 {
    let wrap = |wrap: Wrap| match wrap {
        Wrap::Repeat => TEXTURE_WRAP_REPEAT,
        Wrap::Mirror => TEXTURE_WRAP_MIRROR,
        Wrap::Clamp => TEXTURE_WRAP_CLAMP,
    };
    let filter = match texture.filter {
        Filter::Nearest => TEXTURE_NEAREST_BIT,
        Filter::Linear => 0,
    };
    wrap(texture.wrap_u) | (wrap(texture.wrap_v) << 2) | filter
}

/// Linear value of an sRGB channel, 0 to 1 (IEC 61966-2-1).
pub fn linear_from_srgb(channel: f64) -> f64 {
    if channel <= 0.04045 {
        channel / 12.92
    } else {
        ((channel + 0.055) / 1.055).powf(2.4)
    }
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
                linear_from_srgb(value)
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
