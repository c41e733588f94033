//! What binary glTF 2.0 is written with.

use serde_json::{Value, json};

use super::{LightKind, SceneError};

/// A `.glb` of its two chunks; they are padded to whole words (glTF 2.0, section 4.4.3).
///
/// # Errors
/// [`SceneError::Write`] beyond 4 GiB.
pub fn assemble(mut json: Vec<u8>, mut bin: Vec<u8>) -> Result<Vec<u8>, SceneError> {
    pad(&mut json, b' ');
    pad(&mut bin, 0);
    let bin_chunk = if bin.is_empty() { 0 } else { 8 + bin.len() };
    let total = u32::try_from(12 + 8 + json.len() + bin_chunk).map_err(|_| SceneError::Write {
        what: "the scene is larger than 4 GiB".to_owned(),
    })?;
    let mut file = Vec::with_capacity(total as usize);
    file.extend_from_slice(b"glTF");
    file.extend_from_slice(&2_u32.to_le_bytes());
    file.extend_from_slice(&total.to_le_bytes());
    for (kind, chunk) in [(b"JSON", &json), (b"BIN\0", &bin)] {
        if !chunk.is_empty() {
            // Fits: the total does.
            file.extend_from_slice(&(chunk.len() as u32).to_le_bytes());
            file.extend_from_slice(kind);
            file.extend_from_slice(chunk);
        }
    }
    Ok(file)
}

fn pad(bytes: &mut Vec<u8>, filler: u8) {
    bytes.resize(bytes.len().next_multiple_of(4), filler);
}

/// Writes the kind of a punctual light into its glTF object, over another kind if need be.
pub fn put_light_kind(value: &mut Value, kind: LightKind) {
    match kind {
        LightKind::Point => value["type"] = json!("point"),
        LightKind::Directional => value["type"] = json!("directional"),
        LightKind::Spot {
            inner_cone_rad,
            outer_cone_rad,
        } => {
            value["type"] = json!("spot");
            if !value["spot"].is_object() {
                value["spot"] = json!({});
            }
            value["spot"]["innerConeAngle"] = number(inner_cone_rad);
            value["spot"]["outerConeAngle"] = number(outer_cone_rad);
            return;
        }
    }
    if let Some(object) = value.as_object_mut() {
        object.shift_remove("spot");
    }
}

/// The shortest decimal that reads back as this f32.
pub fn number(value: f32) -> Value {
    json!(value.to_string().parse::<f64>().unwrap_or_default())
}

/// As [`number`].
pub fn numbers(values: &[f32]) -> Value {
    Value::Array(values.iter().map(|value| number(*value)).collect())
}
