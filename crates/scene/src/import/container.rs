//! Files, the GLB container and `data:` URIs.

use std::borrow::Cow;
use std::path::Path;

use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use base64::{DecodeError, Engine as _};

use super::super::SceneError;
use super::Notes;
use stereolux_base::files;
use stereolux_base::limits::LoadBudget;

/// Chunk types of GLB (glTF 2.0, section 4.4.3), little-endian.
const CHUNK_JSON: u32 = u32::from_le_bytes(*b"JSON");
const CHUNK_BIN: u32 = u32::from_le_bytes(*b"BIN\0");

/// The parts of a glTF file.
pub struct Parts<'a> {
    pub json: &'a [u8],
    /// The GLB's binary chunk.
    pub blob: Option<&'a [u8]>,
}

/// Reads a regular file, once `budget` allows it.
pub fn read_file(path: &Path, budget: &LoadBudget) -> Result<Vec<u8>, SceneError> {
    files::load_regular(path, budget).map_err(|reason| SceneError::read(path, reason))
}

/// Finds the JSON and binary parts of a `.gltf` or `.glb`.
pub fn split<'a>(path: &Path, bytes: &'a [u8], notes: &mut Notes) -> Result<Parts<'a>, SceneError> {
    if bytes.is_empty() {
        return Err(SceneError::invalid(path, "the file is empty"));
    }
    if bytes.starts_with(b"glTF") {
        return split_glb(path, bytes, notes);
    }
    let is_glb = path
        .extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("glb"));
    let first = bytes.iter().find(|byte| !byte.is_ascii_whitespace());
    if is_glb && first != Some(&b'{') {
        return Err(SceneError::invalid(
            path,
            "not a binary glTF file: it does not begin with 'glTF'",
        ));
    }
    Ok(Parts {
        json: bare(bytes),
        blob: None,
    })
}

/// JSON without a UTF-8 byte order mark before it and zeros behind it: glTF allows neither, files have them, and they are harmless.
fn bare(json: &[u8]) -> &[u8] {
    let json = json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json);
    let length = json.iter().rposition(|byte| *byte != 0);
    &json[..length.map_or(0, |last| last + 1)]
}

fn split_glb<'a>(path: &Path, bytes: &'a [u8], notes: &mut Notes) -> Result<Parts<'a>, SceneError> {
    let truncated = |need: u64| {
        SceneError::invalid(
            path,
            format!(
                "truncated binary glTF: {need} bytes are declared, the file has {}",
                bytes.len()
            ),
        )
    };
    let word = |at: usize| -> Option<u32> {
        Some(u32::from_le_bytes(
            bytes.get(at..at.checked_add(4)?)?.try_into().ok()?,
        ))
    };
    let (Some(version), Some(declared)) = (word(4), word(8)) else {
        return Err(truncated(12));
    };
    if version != 2 {
        return Err(SceneError::invalid(
            path,
            format!("binary glTF version {version} is not supported; version 2 is"),
        ));
    }
    let declared = declared as usize;
    if declared > bytes.len() {
        return Err(truncated(declared as u64));
    }
    if declared < bytes.len() {
        notes.warn(format_args!(
            "{} bytes after the end of the binary glTF are ignored",
            bytes.len() - declared
        ));
    }
    let body = &bytes[..declared];
    let mut json = None;
    let mut blob = None;
    let mut at = 12;
    while at < body.len() {
        let (Some(length), Some(kind)) = (word(at), word(at + 4)) else {
            return Err(truncated(at as u64 + 8));
        };
        let start = at + 8;
        let chunk = start
            .checked_add(length as usize)
            .and_then(|end| body.get(start..end))
            .ok_or_else(|| {
                SceneError::invalid(
                    path,
                    format!(
                        "truncated binary glTF: the chunk at byte {at} declares {length} bytes"
                    ),
                )
            })?;
        match (kind, json.is_some()) {
            (CHUNK_JSON, false) => json = Some(bare(chunk)),
            (_, false) => {
                return Err(SceneError::invalid(
                    path,
                    "binary glTF: the first chunk is not JSON",
                ));
            }
            (CHUNK_BIN, true) if blob.is_none() => blob = Some(chunk),
            _ => {}
        }
        at = start + chunk.len();
    }
    let json = json.ok_or_else(|| SceneError::invalid(path, "binary glTF without a JSON chunk"))?;
    Ok(Parts { json, blob })
}

/// Whether a URI holds its data itself. The names of schemes have no case (RFC 3986, section 3.1).
pub fn is_data_uri(uri: &str) -> bool {
    let scheme = uri.as_bytes().get(..5);
    scheme.is_some_and(|scheme| scheme.eq_ignore_ascii_case(b"data:"))
}

/// The payload of a `data:` URI.
pub fn decode_data_uri(uri: &str) -> Result<Vec<u8>, String> {
    let Some((head, payload)) = uri.split_once(',') else {
        return Err("the data URI has no comma".to_owned());
    };
    if !head.ends_with(";base64") {
        return percent_decode(payload);
    }
    // As a part of a URI it may be percent-encoded on top (RFC 2397).
    if payload.contains('%') {
        let decoded = percent_decode(payload)?;
        return decode_base64(&String::from_utf8_lossy(&decoded));
    }
    decode_base64(payload)
}

/// Base64 (RFC 4648, section 4), padding optional. White space is skipped, and not counted in messages.
pub fn decode_base64(text: &str) -> Result<Vec<u8>, String> {
    const LENIENT: GeneralPurposeConfig = GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true);
    let is_space = |c: char| matches!(c, ' ' | '\n' | '\r' | '\t');
    let plain = if text.contains(is_space) {
        Cow::Owned(text.replace(is_space, ""))
    } else {
        Cow::Borrowed(text)
    };
    GeneralPurpose::new(&STANDARD, LENIENT)
        .decode(plain.as_bytes())
        .map_err(|error| match error {
            DecodeError::InvalidByte(at, byte) if byte != b'=' => {
                format!("character {} of the base64 data is not base64", at + 1)
            }
            other => format!("the base64 data is broken: {other}"),
        })
}

/// Undoes percent-encoding (RFC 3986, section 2.1). The `percent-encoding` crate would let broken escapes pass.
pub fn percent_decode(text: &str) -> Result<Vec<u8>, String> {
    let hex = |byte: u8| char::from(byte).to_digit(16).map(|digit| digit as u8);
    let source = text.as_bytes();
    let mut bytes = Vec::with_capacity(source.len());
    let mut at = 0;
    while at < source.len() {
        if source[at] == b'%' {
            let digits = source
                .get(at + 1)
                .copied()
                .and_then(hex)
                .zip(source.get(at + 2).copied().and_then(hex));
            let Some((high, low)) = digits else {
                return Err(format!("broken percent-encoding at character {}", at + 1));
            };
            bytes.push(high * 16 + low);
            at += 3;
        } else {
            bytes.push(source[at]);
            at += 1;
        }
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_follows_rfc_4648() {
        for (text, plain) in [
            ("", ""),
            ("Zg==", "f"),
            ("Zm8=", "fo"),
            ("Zm9v", "foo"),
            ("Zm9vYmFy", "foobar"),
            ("Zm8", "fo"),
        ] {
            assert_eq!(decode_base64(text).unwrap(), plain.as_bytes(), "{text}");
        }
        assert_eq!(decode_base64(" +/\n\tA=\r").unwrap(), [0xfb, 0xf0]);
        for broken in ["Z", "Zm9v!", "Zg==Zg=="] {
            assert!(decode_base64(broken).is_err(), "{broken}");
        }
        assert_eq!(decode_data_uri("data:;base64,Zg%3D%3D").unwrap(), b"f");
        assert!(decode_data_uri("data:;base64,Zg%3").is_err());
        assert!(is_data_uri("DATA:;base64,Zg") && !is_data_uri("data.bin"));
    }

    #[test]
    fn percent_encoding_is_undone() {
        assert_eq!(percent_decode("a%20b%2Fc").unwrap(), b"a b/c");
        assert!(percent_decode("a%2").is_err());
        assert!(percent_decode("a%zz").is_err());
    }

    #[test]
    fn data_uris() {
        let coded = decode_data_uri("data:image/png;base64,Zm9v");
        assert_eq!(coded.unwrap(), b"foo");
        assert_eq!(decode_data_uri("data:,f%6fo").unwrap(), b"foo");
        assert!(decode_data_uri("data:nothing").is_err());
    }
}
