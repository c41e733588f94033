//! Which glTF extensions are evaluated, and what happens to a file that uses others.

use std::collections::HashSet;

use super::super::SceneError;
use super::Notes;
use super::document::Document;

/// Extensions that are evaluated in full.
const SUPPORTED: [&str; 9] = [
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_node_visibility",
    "KHR_texture_transform",
];

/// Compressions: without them there is no geometry at all.
const COMPRESSIONS: [&str; 3] = [
    "KHR_draco_mesh_compression",
    "EXT_meshopt_compression",
    "KHR_meshopt_compression",
];

/// What is missing from the picture without an extension that is not evaluated.
fn consequence(name: &str) -> &'static str {
    match name {
        "KHR_materials_pbrSpecularGlossiness" => {
            "its materials are read as metallic-roughness, with the values given there"
        }
        "KHR_materials_clearcoat" => "surfaces are shown without their clear coat",
        "KHR_materials_sheen" => "surfaces are shown without sheen",
        "KHR_materials_iridescence" => "surfaces are shown without iridescence",
        "KHR_materials_anisotropy" => "highlights are isotropic",
        "KHR_materials_dispersion" => "glass refracts all colours alike",
        "KHR_materials_diffuse_transmission" => "thin surfaces let no diffuse light through",
        "KHR_materials_unlit" => {
            "unlit materials are shaded as lit surfaces, because light transport has no unlit surface"
        }
        "KHR_materials_variants" => "the default variant is shown",
        "KHR_texture_basisu" | "EXT_texture_webp" | "EXT_texture_avif" | "MSFT_texture_dds" => {
            "textures are read from their PNG or JPEG fallback, or left out"
        }
        "EXT_mesh_gpu_instancing" => "each mesh is shown once",
        "KHR_animation_pointer" => "such animations are not played",
        "EXT_lights_image_based" => {
            "the scene has no environment from the file; set environment.path"
        }
        _ if COMPRESSIONS.contains(&name) => "the copies that are not compressed are read",
        _ => "what it describes is left out",
    }
}

/// Refuses files that require what is not supported, and warns of the rest.
pub fn check(document: &Document<'_>, notes: &mut Notes) -> Result<(), SceneError> {
    for name in &document.root.extensions_required {
        if SUPPORTED.contains(&name.as_str()) {
            continue;
        }
        let advice = if COMPRESSIONS.contains(&name.as_str()) {
            "decompress the file first, for example with gltf-transform"
        } else {
            "export the file again without it"
        };
        return Err(document.fault(format!(
            "the file requires the extension {name}, which is not supported: {advice}"
        )));
    }
    let mut seen: HashSet<&str> = HashSet::new();
    for name in &document.root.extensions_used {
        if SUPPORTED.contains(&name.as_str()) || !seen.insert(name) {
            continue;
        }
        let why = consequence(name);
        notes.warn(format_args!("extension {name} is not supported: {why}"));
        notes.leave_out(name, why);
    }
    Ok(())
}

/// The compression extension named in `object.extensions`, if any.
pub fn compression_of(object: Option<&serde_json::Value>) -> Option<&'static str> {
    let extensions = object?.get("extensions")?;
    COMPRESSIONS
        .into_iter()
        .find(|name| extensions.get(name).is_some())
}
