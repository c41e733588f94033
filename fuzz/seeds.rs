//! Inputs that are right, made by code: what mutations begin with.

use std::io::Cursor;

use base64::prelude::{BASE64_STANDARD_NO_PAD, Engine as _};
use glam::DVec3;
use image::{DynamicImage, ImageFormat, Rgb32FImage, RgbImage, RgbaImage};
use serde_json::{Value, json};
use stereolux::options::{Extent, to_toml};
use stereolux::scene::builtin;
use stereolux::settings::{Quality, RenderSettings, Settings};
use stereolux::viewer::window_state::WindowState;
use stereolux::xr::trace;
use stereolux::xr::{HandScript, Headset, Motion, Pose, SimulatedSession, XrSession as _};
use stereolux_report::records::Row;

/// Pictures of one kind.
pub fn pictures(format: ImageFormat) -> Vec<Vec<u8>> {
    let rgb = RgbImage::from_fn(13, 7, |x, y| image::Rgb([x as u8 * 19, y as u8 * 36, 90]));
    let rgba = RgbaImage::from_fn(8, 8, |x, y| {
        image::Rgba([x as u8, y as u8, 3, x as u8 * 30])
    });
    let floats = Rgb32FImage::from_fn(16, 8, |x, y| {
        image::Rgb([x as f32 * 0.1, y as f32 * 3.0, 0.5])
    });
    let pictures: Vec<DynamicImage> = match format {
        ImageFormat::Hdr | ImageFormat::OpenExr => vec![floats.into()],
        ImageFormat::Jpeg => vec![rgb.into()],
        _ => vec![
            rgb.clone().into(),
            rgba.into(),
            DynamicImage::from(rgb.clone()).to_luma8().into(),
            DynamicImage::from(rgb).to_rgb16().into(),
        ],
    };
    let mut files: Vec<Vec<u8>> = pictures
        .iter()
        .filter_map(|picture| {
            let mut bytes = Cursor::new(Vec::new());
            picture.write_to(&mut bytes, format).ok()?;
            Some(bytes.into_inner())
        })
        .collect();
    if format == ImageFormat::OpenExr {
        let path = std::env::temp_dir().join(format!("stereolux-seed-{}.exr", std::process::id()));
        let picture = stereolux::images::ImageRgb::filled(9, 5, [0.25, 1.0, 7.0]);
        if picture.is_ok_and(|picture| stereolux::images::write_exr(&path, &picture).is_ok()) {
            files.extend(std::fs::read(&path));
            let _ = std::fs::remove_file(&path);
        }
    }
    files
}

/// Small glTF documents as JSON, self-contained.
pub fn documents() -> Vec<Value> {
    let floats = |values: &[f32]| bytemuck::cast_slice(values).to_vec();
    let corners = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.5];
    let parts: [Vec<u8>; 7] = [
        floats(&corners),
        bytemuck::cast_slice(&[0_u16, 1, 2, 2, 1, 3]).to_vec(),
        floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0]),
        [[0, 0, 0, 0], [1, 0, 0, 0]].concat().repeat(2),
        [255, 0, 0, 0].repeat(4),
        floats(&[0.0, 0.5, 1.0]),
        pictures(ImageFormat::Png).swap_remove(0),
    ];
    let (mut bytes, mut views) = (Vec::new(), Vec::new());
    for part in parts {
        views.push(json!({ "buffer": 0, "byteOffset": bytes.len(), "byteLength": part.len() }));
        bytes.extend(part);
    }
    let data = BASE64_STANDARD_NO_PAD.encode(&bytes);
    let uri = format!("data:application/octet-stream;base64,{data}");
    let accessor = |view: usize, component: u32, count: u32, kind: &str| json!({ "bufferView": view, "componentType": component, "count": count, "type": kind });
    let whole = json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0, 2, 3, 4] }],
        "nodes": [
            { "name": "root", "children": [1], "mesh": 0, "translation": [0, 1, 2], "rotation": [0, 0, 0, 1] },
            { "mesh": 1, "skin": 0, "scale": [1, 2, 1] },
            { "camera": 0, "matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,5,1] },
            { "extensions": { "KHR_lights_punctual": { "light": 0 } } },
            { "mesh": 0, "weights": [0.5], "extensions": { "KHR_node_visibility": { "visible": true } } },
        ],
        "meshes": [
            { "weights": [0.25], "primitives": [{
                "attributes": { "POSITION": 0, "TEXCOORD_0": 2 }, "indices": 1, "material": 0,
                "targets": [{ "POSITION": 0, "NORMAL": 0 }],
            }] },
            { "primitives": [{
                "attributes": { "POSITION": 0, "NORMAL": 0, "JOINTS_0": 3, "WEIGHTS_0": 4, "COLOR_0": 0 }, "mode": 5,
            }] },
        ],
        "skins": [{ "joints": [0, 1] }],
        "animations": [{
            "samplers": [{ "input": 5, "output": 6 }, { "input": 5, "output": 5, "interpolation": "STEP" }],
            "channels": [
                { "sampler": 0, "target": { "node": 0, "path": "translation" } },
                { "sampler": 1, "target": { "node": 4, "path": "weights" } },
            ],
        }],
        "cameras": [{ "type": "perspective", "perspective": { "yfov": 0.8, "znear": 0.1 } }],
        "materials": [{
            "pbrMetallicRoughness": {
                "baseColorTexture": { "index": 0, "extensions": { "KHR_texture_transform": { "scale": [2, 2] } } },
                "roughnessFactor": 0.5,
            },
            "normalTexture": { "index": 0, "scale": 0.5, "extensions": { "KHR_texture_transform": { "offset": [0.5, 0] } } },
            "emissiveFactor": [1, 0.5, 0], "alphaMode": "MASK", "doubleSided": true,
            "extensions": {
                "KHR_materials_ior": { "ior": 1.4 },
                "KHR_materials_transmission": { "transmissionFactor": 0.5 },
                "KHR_materials_volume": { "attenuationDistance": 2, "thicknessFactor": 1 },
                "KHR_materials_emissive_strength": { "emissiveStrength": 3 },
                "KHR_materials_specular": { "specularFactor": 0.5 },
            },
        }],
        "textures": [{ "source": 0, "sampler": 0 }],
        "samplers": [{ "wrapS": 33071, "magFilter": 9728 }],
        "images": [{ "bufferView": 6, "mimeType": "image/png", "name": "picture" }],
        "accessors": [
            accessor(0, 5126, 4, "VEC3"), accessor(1, 5123, 6, "SCALAR"), accessor(2, 5126, 4, "VEC2"),
            accessor(3, 5121, 4, "VEC4"),
            { "bufferView": 4, "componentType": 5121, "count": 4, "type": "VEC4", "normalized": true },
            accessor(5, 5126, 3, "SCALAR"), accessor(0, 5126, 3, "VEC3"),
            { "componentType": 5126, "count": 4, "type": "VEC3", "sparse": {
                "count": 1,
                "indices": { "bufferView": 1, "componentType": 5123 },
                "values": { "bufferView": 0 },
            } },
        ],
        "bufferViews": views,
        "buffers": [{ "byteLength": bytes.len(), "uri": uri }],
        "extensionsUsed": ["KHR_lights_punctual", "KHR_materials_ior", "KHR_materials_sheen"],
        "extensions": { "KHR_lights_punctual": { "lights": [
            { "type": "spot", "color": [1, 1, 0.5], "intensity": 40, "spot": { "outerConeAngle": 0.6 } },
            { "type": "point", "intensity": 3, "range": 10 },
            { "type": "directional" },
        ] } },
    });
    vec![whole]
}

/// Binary glTF.
pub fn glbs() -> Vec<Vec<u8>> {
    ["plane", "caustic"]
        .into_iter()
        .filter_map(|name| builtin::glb(name).ok())
        .map(std::borrow::Cow::into_owned)
        .collect()
}

/// Recordings: native, TUM and EuRoC.
pub fn traces() -> Vec<Vec<u8>> {
    let mut native = String::new();
    if let Ok(headset) = Headset::load("symmetric") {
        let header = trace::TraceHeader {
            headset: "symmetric".to_owned(),
            refresh_hz: 90.0,
            hidden: None,
        };
        native.push_str(&trace::header_line(&header, 2).unwrap_or_default());
        let hands =
            "[[right]]\nat_s = 0.02\nreach = 'a'\npress = ['squeeze']\nstick = [0.5, -1.0]\n";
        let place_of = |_: &str| Ok(DVec3::ONE);
        let hands = HandScript::parse("hands", hands, &Pose::IDENTITY, &place_of);
        let mut session = SimulatedSession::new(headset, Motion::Walk, Pose::IDENTITY, Some(6))
            .with_hands(hands.unwrap_or_default());
        while let Ok(Some(state)) = session.wait_frame() {
            let time = state.predicted_display_time_ns;
            let _ = session.begin_frame();
            if let Ok(Some(views)) = session.locate_views(time) {
                let frame = trace::TraceFrame {
                    t_ns: time,
                    views,
                    located: (time > 20_000_000).then_some(views.views),
                    switch_reuse: false,
                    refresh_hz: (time > 0).then_some(72.0),
                    hidden: (time > 0).then(Default::default),
                    quality: (time > 0).then(|| Quality::of(&RenderSettings::default())),
                    controller_model: [None, None],
                    input: session.locate_input(time).unwrap_or_default(),
                };
                native.push_str(&trace::frame_line(&frame).unwrap_or_default());
            }
            let _ = session.end_frame(stereolux::xr::FrameSubmission::new(time, None));
        }
    }
    let tum = "# timestamp tx ty tz qx qy qz qw\n1.0 0 0 1 0 0 0 1\n1.1 0.1 0 1 0 0 0.1 0.995\n1.3 0.2 0 1 0 0 0 1\n";
    let euroc = "#timestamp [ns],p x,p y,p z,q w,q x,q y,q z\n1000000000,0,0,1,1,0,0,0\n1050000000,0.1,0,1,1,0,0,0\n";
    [native, tum.to_owned(), euroc.to_owned()]
        .map(String::into_bytes)
        .into()
}

/// Headset profiles.
pub fn profiles() -> Vec<Vec<u8>> {
    [
        include_str!("../config/headsets/quest3.toml"),
        include_str!("../config/headsets/index.toml"),
    ]
    .map(|text| text.as_bytes().to_vec())
    .into()
}

/// Actions of an application.
pub fn actions() -> Vec<Vec<u8>> {
    vec![include_bytes!("../examples/gallery_tour_actions.toml").to_vec()]
}

/// Settings files.
pub fn settings() -> Vec<Vec<u8>> {
    let all = to_toml(&Settings::default(), Extent::All);
    vec![
        all.into_bytes(),
        include_bytes!("../config/example.toml").to_vec(),
    ]
}

/// Layouts of the viewer.
pub fn layouts() -> Vec<Vec<u8>> {
    let text = toml::to_string(&WindowState::default()).unwrap_or_default();
    vec![text.into_bytes()]
}

/// Journals of a bench.
pub fn journals() -> Vec<Vec<u8>> {
    let row = serde_json::to_string(&Row::default()).unwrap_or_default();
    vec![format!("{row}\n{row}\n").into_bytes()]
}
