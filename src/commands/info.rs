//! `info`: what there is, as JSON on stdout.

use serde_json::{Value, json};

use super::{Failure, load_scene};
use crate::gpu::context::adapters;
use crate::options::{Eyes, InfoOptions, Settings, registry};
use crate::printable;
use crate::renderer::frame_list::frame_list;
use crate::renderer::{automatic_radius_m, forms_caustics, sample_passes, shader_features};
use crate::scene::Needs;

/// Prints adapters, OpenXR state and, with a scene, its needs.
pub fn info(options: &InfoOptions) -> Result<(), Failure> {
    let mut report = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "adapters": adapters(),
        "openxr": openxr_report(),
    });
    if let Some(name) = &options.scene {
        report["scene"] = scene_report(name, &options.settings)?;
    }
    if options.list_settings {
        report["settings"] = json!(registry::rows());
    }
    let text = serde_json::to_string_pretty(&report).map_err(Failure::failed)?;
    println!("{}", printable::json(&text));
    Ok(())
}

/// The runtime and its headset, or why there is none.
fn openxr_report() -> Value {
    #[cfg(not(target_vendor = "apple"))]
    let found = crate::xr::openxr::Runtime::find().map(|runtime| runtime.report());
    #[cfg(target_vendor = "apple")]
    let found = Err::<Value, _>("no OpenXR runtime for Metal exists");
    found.unwrap_or_else(|reason| {
        json!({
            "runtime": Value::Null,
            "reason": reason.to_string(),
        })
    })
}

fn scene_report(name: &str, settings: &Settings) -> Result<Value, Failure> {
    let settings = Settings {
        scene: name.to_owned(),
        ..settings.clone()
    };
    let scene = load_scene(&settings)?;
    let needs = Needs::of(&scene);
    let features = shader_features(&needs, &settings);
    Ok(json!({
        "name": name,
        "warnings": scene.warnings,
        "outside_files": scene.source.outside_files,
        "too_bright_lights": scene.source.too_bright_lights,
        "bounds_in_world": scene
            .bounds_in_world()
            .map(|bounds| [bounds.min.to_array(), bounds.max.to_array()]),
        "surface_area_m2": scene.surface_area_m2(),
        "automatic_radius_m": automatic_radius_m(&scene, settings.photon.count),
        "needs": needs,
        "shader_features": features,
        "passes_per_sample": sample_passes(&settings, forms_caustics(&features))
            .iter()
            .map(|pass| pass.to_string())
            .collect::<Vec<_>>(),
        "frame": frame_list(&settings, &features, Eyes::Both),
    }))
}
