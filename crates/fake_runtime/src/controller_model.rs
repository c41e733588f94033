//! `XR_MSFT_controller_model`: a wedge in the right hand.
//!
//! `unsafe`: as in the crate's root.
#![allow(clippy::missing_safety_doc)]

use openxr_sys as xr;
use xr::Result as R;

use super::{asked_for, posef, state};

/// What offers the extension.
const OFFERED: [&str; 3] = [
    "controller_model",
    "bad_controller_model",
    "huge_controller_model",
];
/// The first frame, from 1, in which there is a key.
const KNOWN_FROM: u64 = 3;
const KEY: u64 = 7;

/// Where the right hand's grip is, and aims: before the head's start, turned about an axis that is none of its own.
pub const GRIP: xr::Posef = posef([0.48, 0.6, 0.0, 0.64], [0.02, -0.01, -0.3]);

/// Corners of the wedge in the grip, metres: two triangles, of which the second is the larger, as its ends.
const CORNERS: [[f32; 3]; 6] = [
    [-0.02, -0.02, -0.08],
    [0.03, -0.02, -0.08],
    [-0.02, 0.01, -0.08],
    [-0.05, -0.03, 0.05],
    [0.06, -0.03, 0.05],
    [-0.05, 0.04, 0.05],
];

/// Its faces, seen from outside against the clock, and the light that they give off.
const FACES: [(&[[usize; 3]], [f32; 3]); 5] = [
    (&[[0, 2, 1]], [0.9, 0.1, 0.1]),
    (&[[3, 4, 5]], [0.1, 0.9, 0.1]),
    (&[[0, 1, 4], [0, 4, 3]], [0.1, 0.1, 0.9]),
    (&[[0, 3, 5], [0, 5, 2]], [0.9, 0.9, 0.1]),
    (&[[1, 2, 5], [1, 5, 4]], [0.1, 0.9, 0.9]),
];

/// The wedge as binary glTF.
#[must_use]
pub fn glb() -> Vec<u8> {
    let mut bin: Vec<u8> = CORNERS
        .iter()
        .flatten()
        .flat_map(|c| c.to_le_bytes())
        .collect();
    let positions = bin.len();
    let [mut views, mut accessors, mut primitives, mut materials] = [const { Vec::new() }; 4];
    views.push(format!(r#"{{"buffer":0,"byteLength":{positions}}}"#));
    accessors.push(
        r#"{"bufferView":0,"componentType":5126,"count":6,"type":"VEC3","min":[-0.05,-0.03,-0.08],"max":[0.06,0.04,0.05]}"#
            .to_owned(),
    );
    for (face, (triangles, [r, g, b])) in FACES.into_iter().enumerate() {
        let indices = triangles.as_flattened();
        let (offset, length) = (bin.len(), 4 * indices.len());
        bin.extend(
            indices
                .iter()
                .flat_map(|index| (*index as u32).to_le_bytes()),
        );
        views.push(format!(
            r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{length}}}"#
        ));
        let (view, count) = (face + 1, indices.len());
        accessors.push(format!(
            r#"{{"bufferView":{view},"componentType":5125,"count":{count},"type":"SCALAR"}}"#
        ));
        primitives.push(format!(
            r#"{{"attributes":{{"POSITION":0}},"indices":{view},"material":{face}}}"#
        ));
        materials.push(format!(
            r#"{{"emissiveFactor":[{r},{g},{b}],"pbrMetallicRoughness":{{"baseColorFactor":[0,0,0,1],"metallicFactor":0}},"extensions":{{"KHR_materials_specular":{{"specularFactor":0}}}}}}"#
        ));
    }
    let mut json = format!(
        r#"{{"asset":{{"version":"2.0"}},"extensionsUsed":["KHR_materials_specular"],"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{}]}}],"materials":[{}],"accessors":[{}],"bufferViews":[{}],"buffers":[{{"byteLength":{}}}]}}"#,
        primitives.join(","),
        materials.join(","),
        accessors.join(","),
        views.join(","),
        bin.len()
    )
    .into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let word = |number: usize| (number as u32).to_le_bytes();
    let chunk = |kind: &[u8; 4], bytes: &[u8]| [&word(bytes.len()), &kind[..], bytes].concat();
    let chunks = [chunk(b"JSON", &json), chunk(b"BIN\0", &bin)].concat();
    [b"glTF", &word(2), &word(12 + chunks.len()), &chunks[..]].concat()
}

/// How fast it moves, m/s.
pub const VELOCITY: xr::Vector3f = xr::Vector3f {
    x: 0.5,
    y: -0.25,
    z: 2.0,
};

/// Whether the runtime has the extension.
pub(crate) fn is_offered() -> bool {
    OFFERED.into_iter().any(asked_for)
}

/// Whether the space of this name is tracked, at [`GRIP`].
pub(crate) fn is_at_grip(space: &str) -> bool {
    let is_right = ["grip/user/hand/right", "aim/user/hand/right"].contains(&space);
    is_right && (is_offered() || asked_for("plain_controller"))
}

/// A key for the right hand's, after some frames.
pub(crate) unsafe extern "system" fn key(
    _: xr::Session,
    hand: xr::Path,
    out: *mut xr::ControllerModelKeyStateMSFT,
) -> R {
    let state = state();
    let name = state.names.get(&hand.into_raw()).map(String::as_str);
    let is_known = name == Some("/user/hand/right") && state.session.waited >= KNOWN_FROM;
    (*out).model_key = xr::ControllerModelKeyMSFT::from_raw(if is_known { KEY } else { 0 });
    R::SUCCESS
}

/// The wedge, or what is none.
pub(crate) unsafe extern "system" fn load(
    _: xr::Session,
    key: xr::ControllerModelKeyMSFT,
    capacity: u32,
    count: *mut u32,
    out: *mut u8,
) -> R {
    if key.into_raw() != KEY {
        return R::ERROR_CONTROLLER_MODEL_KEY_INVALID_MSFT;
    }
    if asked_for("huge_controller_model") {
        count.write(u32::MAX);
        return R::SUCCESS;
    }
    let bytes = if asked_for("bad_controller_model") {
        b"not a model".to_vec()
    } else {
        glb()
    };
    super::fill(&bytes, capacity, count, |index, byte| {
        out.add(index).write(*byte);
    })
}
