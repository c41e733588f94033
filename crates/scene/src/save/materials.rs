//! Materials, and which triangles have them.

use serde_json::{Value, json};

use super::super::gltf_writer::{number, numbers};
use super::super::{AlphaMode, Material, Scene, SceneError, TextureRef};
use super::{Original, entry, extension, factor_and_strength, list_mut, note_used, remove, whole};

const STRENGTH: &str = "KHR_materials_emissive_strength";
const IOR: &str = "KHR_materials_ior";
const SPECULAR: &str = "KHR_materials_specular";
const TRANSMISSION: &str = "KHR_materials_transmission";
const VOLUME: &str = "KHR_materials_volume";

/// Where each of [`Material::texture_slots`] lies in a material's JSON.
const SLOTS: [&str; 7] = [
    "/pbrMetallicRoughness/baseColorTexture",
    "/pbrMetallicRoughness/metallicRoughnessTexture",
    "/normalTexture",
    "/emissiveTexture",
    "/extensions/KHR_materials_specular/specularTexture",
    "/extensions/KHR_materials_specular/specularColorTexture",
    "/extensions/KHR_materials_transmission/transmissionTexture",
];

/// Writes what was edited of materials.
pub fn patch(root: &mut Value, original: &Original, scene: &Scene) -> Result<(), SceneError> {
    let mut used = Vec::new();
    let in_file = list_mut(root, "materials").len();
    let known = original.materials.len();
    let differs = |at: usize| original.materials.get(at) != scene.materials.get(at);
    if !(0..scene.materials.len()).any(differs) {
        return Ok(());
    }
    entry(root, "materials", || json!([]));
    // The importer appends glTF's default material where triangles have none. What comes behind it needs it in the file.
    let has_default = known > in_file && (scene.materials.len() > known || differs(in_file));
    if has_default {
        push(root, json!({ "name": Material::default().name }));
        for primitive in list_mut(root, "meshes").iter_mut().flat_map(primitives) {
            if primitive.get("material").is_none() {
                primitive["material"] = json!(in_file);
            }
        }
    }
    let before_edits: Vec<Value> = list_mut(root, "materials").to_vec();
    let sources = Sources {
        original,
        values: &before_edits,
    };
    for (index, after) in scene.materials.iter().enumerate() {
        if !differs(index) {
            continue;
        }
        let before = match original.materials.get(index) {
            Some(before) => before.clone(),
            None => {
                // A copy: of what its source is by now, so that extensions that nobody here knows come along.
                let from = source_of(scene, index).unwrap_or_default();
                let copied = list_mut(root, "materials").get(from).cloned();
                let mut copied = copied.unwrap_or_else(|| json!({}));
                // One without a name is called by its number, which the copy does not have.
                copied["name"] = json!(after.name);
                push(root, copied);
                scene.materials.get(from).cloned().unwrap_or_default()
            }
        };
        if let Some(value) = list_mut(root, "materials").get_mut(index) {
            patch_material(value, &before, after, &sources, &mut used)?;
        }
    }
    for (mesh, value) in scene.meshes.iter().zip(list_mut(root, "meshes")) {
        for primitive in primitives(value) {
            let mut material = whole(primitive, "material").unwrap_or(in_file as u64);
            let was = material;
            for [from, to] in &mesh.repainted {
                if material == u64::from(*from) {
                    material = u64::from(*to);
                }
            }
            if material != was {
                primitive["material"] = json!(material);
            }
        }
    }
    note_used(root, &used);
    Ok(())
}

fn push(root: &mut Value, material: Value) {
    if let Some(list) = root["materials"].as_array_mut() {
        list.push(material);
    }
}

fn primitives(mesh: &mut Value) -> &mut [Value] {
    list_mut(mesh, "primitives")
}

/// Of which material another one was made a copy.
fn source_of(scene: &Scene, material: usize) -> Option<usize> {
    let mut swaps = scene.meshes.iter().flat_map(|mesh| &mesh.repainted);
    let found = swaps.find(|[_, to]| *to as usize == material)?;
    Some(found[0] as usize)
}

/// Where references to textures can be copied from.
struct Sources<'a> {
    original: &'a Original,
    values: &'a [Value],
}

impl Sources<'_> {
    /// A reference to a texture as some material of the file writes it.
    fn find(&self, wanted: &TextureRef) -> Option<Value> {
        let materials = self.original.materials.iter().zip(self.values);
        materials.into_iter().find_map(|(material, value)| {
            let slots = material.texture_slots();
            let at = slots
                .iter()
                .position(|(_, slot)| slot.as_ref() == Some(wanted))?;
            let mut found = value.pointer(SLOTS[at])?.clone();
            // A normal texture's own.
            remove(&mut found, &["scale"]);
            Some(found)
        })
    }
}

fn patch_material(
    value: &mut Value,
    before: &Material,
    after: &Material,
    sources: &Sources<'_>,
    used: &mut Vec<&'static str>,
) -> Result<(), SceneError> {
    if before.name != after.name {
        value["name"] = json!(after.name);
    }
    let pbr = |value: &mut Value, key: &str, what: Value| {
        entry(value, "pbrMetallicRoughness", || json!({}))[key] = what;
    };
    if before.base_color != after.base_color {
        pbr(value, "baseColorFactor", numbers(&after.base_color));
    }
    if before.metallic != after.metallic {
        pbr(value, "metallicFactor", number(after.metallic));
    }
    if before.roughness != after.roughness {
        pbr(value, "roughnessFactor", number(after.roughness));
    }
    if before.emission != after.emission {
        let (factor, strength) = factor_and_strength(after.emission);
        value["emissiveFactor"] = numbers(&factor);
        let has_strength = value.pointer("/extensions/KHR_materials_emissive_strength");
        if strength != 1.0 || has_strength.is_some() {
            extension(value, STRENGTH, used)["emissiveStrength"] = number(strength);
        }
    }
    if before.ior != after.ior {
        extension(value, IOR, used)["ior"] = number(after.ior);
    }
    if before.specular != after.specular {
        extension(value, SPECULAR, used)["specularFactor"] = number(after.specular);
    }
    if before.specular_color != after.specular_color {
        extension(value, SPECULAR, used)["specularColorFactor"] = numbers(&after.specular_color);
    }
    if before.transmission != after.transmission {
        extension(value, TRANSMISSION, used)["transmissionFactor"] = number(after.transmission);
    }
    if before.thickness != after.thickness {
        extension(value, VOLUME, used)["thicknessFactor"] = number(after.thickness);
    }
    if before.attenuation_color != after.attenuation_color {
        extension(value, VOLUME, used)["attenuationColor"] = numbers(&after.attenuation_color);
    }
    if before.attenuation_distance_m != after.attenuation_distance_m {
        let volume = extension(value, VOLUME, used);
        if after.attenuation_distance_m.is_finite() {
            volume["attenuationDistance"] = number(after.attenuation_distance_m);
        } else {
            remove(volume, &["attenuationDistance"]);
        }
    }
    if before.alpha_mode != after.alpha_mode {
        remove(value, &["alphaCutoff"]);
        value["alphaMode"] = json!(match after.alpha_mode {
            AlphaMode::Opaque => "OPAQUE",
            AlphaMode::Mask { .. } => "MASK",
            AlphaMode::Blend => "BLEND",
        });
        if let AlphaMode::Mask { cutoff } = after.alpha_mode {
            value["alphaCutoff"] = number(cutoff);
        }
    }
    if before.double_sided != after.double_sided {
        value["doubleSided"] = json!(after.double_sided);
    }
    let slots = before
        .texture_slots()
        .into_iter()
        .zip(after.texture_slots());
    for (at, ((_, before), (name, slot))) in slots.enumerate() {
        if before == slot {
            continue;
        }
        let (container, key) = SLOTS[at].rsplit_once('/').unwrap_or_default();
        let Some(slot) = slot else {
            if let Some(holder) = value.pointer_mut(container) {
                remove(holder, &[key]);
            }
            continue;
        };
        let found = sources.find(&slot).ok_or_else(|| SceneError::Write {
            what: format!(
                "material '{}': its {name} texture is read as no material of the file reads one",
                after.name
            ),
        })?;
        let holder = match container {
            "" => &mut *value,
            "/pbrMetallicRoughness" => entry(value, "pbrMetallicRoughness", || json!({})),
            "/extensions/KHR_materials_specular" => extension(value, SPECULAR, used),
            _ => extension(value, TRANSMISSION, used),
        };
        holder[key] = found;
    }
    let scale_changes =
        before.normal_scale != after.normal_scale || before.normal_texture != after.normal_texture;
    if scale_changes && let Some(texture) = value.get_mut("normalTexture") {
        texture["scale"] = number(after.normal_scale);
    }
    Ok(())
}
