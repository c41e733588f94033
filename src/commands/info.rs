//! `info`: what there is, as JSON on stdout.

use serde_json::{Value, json};

use std::fmt::Write as _;

use super::{Failure, load_scene, print_line};
use crate::frame::listing::{list, memory};
use crate::frame::plan::on_demand;
use crate::frame::user_passes::{self, shader_library};
use crate::gpu::context::{AdapterSummary, adapters, first_wanted};
use crate::gpu::features::{DecidedBy, ShaderFeatures};
use crate::options::InfoOptions;
use crate::printable;
use crate::renderer::{PlannedScene, automatic_radius_m, plan_of_scene};
use crate::scene::Needs;
use crate::scene_loading::Loaded;
use crate::settings::{Settings, registry};
use crate::xr::Headset;

/// Prints adapters, OpenXR state and, with a scene, its needs.
pub fn info(options: &InfoOptions) -> Result<(), Failure> {
    let adapters = adapters();
    // As far as can be known without opening it.
    let chosen = match options.settings.adapter.as_str() {
        "" => adapters.first(),
        wanted => Some(first_wanted(&adapters, wanted)?),
    };
    let is_software = chosen.is_some_and(AdapterSummary::is_software);
    let mut report = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "adapters": adapters,
        "openxr": openxr_report(),
    });
    if options.names_scene {
        report["scene"] = scene_report(&options.settings, is_software)?;
    }
    if options.brief {
        return print_line(brief(&report).trim_end());
    }
    if options.lists_settings {
        report["settings"] = registry::listing();
    }
    let text = serde_json::to_string_pretty(&report).map_err(Failure::failed)?;
    print_line(&printable::json(&text))
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

/// The report in some ten lines for people.
fn brief(report: &Value) -> String {
    let text = |value: &Value| printable::line(value.as_str().unwrap_or_default());
    let mut lines = format!("stereolux {}\n", text(&report["version"]));
    // Writing to a String cannot fail.
    let mut say = |what: &str, line: String| {
        let _ = writeln!(lines, "{what:<10}{line}");
    };
    let adapters = report["adapters"].as_array();
    for (at, adapter) in adapters.into_iter().flatten().enumerate() {
        let what = if at == 0 { "adapter" } else { "" };
        let (name, kind) = (text(&adapter["name"]), text(&adapter["kind"]));
        say(
            what,
            format!("{name} ({kind}, {})", text(&adapter["backend"])),
        );
    }
    let openxr = &report["openxr"];
    say(
        "OpenXR",
        match openxr["runtime"].as_str() {
            Some(runtime) => printable::line(runtime),
            None => format!("none: {}", text(&openxr["reason"])),
        },
    );
    let scene = &report["scene"];
    if scene.is_null() {
        return lines;
    }
    let needs = &scene["needs"];
    let corner = |end: usize, axis: usize| scene["bounds_in_world"][end][axis].as_f64();
    let size = |axis| Some(format!("{:.3}", corner(1, axis)? - corner(0, axis)?));
    let size: Option<Vec<String>> = (0..3).map(size).collect();
    say("scene", text(&scene["name"]));
    say(
        "size",
        size.map_or("nothing in it".to_owned(), |size| size.join(" x ") + " m"),
    );
    say(
        "contents",
        format!(
            "{} triangles, {} instances",
            needs["stored_triangles"], needs["instances"]
        ),
    );
    let lights = needs["lights"].as_object();
    let lights = lights
        .into_iter()
        .flatten()
        .filter(|(_, count)| count.as_u64() > Some(0));
    let mut lights: Vec<String> = lights
        .map(|(kind, count)| format!("{count} {}", kind.replace('_', " ")))
        .collect();
    if needs["environment"].as_bool() == Some(true) {
        lights.push(scene["light"].as_str().unwrap_or("environment").to_owned());
    }
    say(
        "lights",
        if lights.is_empty() {
            "none".to_owned()
        } else {
            lights.join(", ")
        },
    );
    say(
        "radius",
        format!(
            "{:.4} m (automatic)",
            scene["automatic_radius_m"].as_f64().unwrap_or_default()
        ),
    );
    let memory = &scene["memory"];
    say(
        "memory",
        format!(
            "{:.2} GB for frames of 2 x {}x{} pixels, and the scene's own",
            memory["total_bytes"].as_f64().unwrap_or_default() * 1e-9,
            memory["size"][0],
            memory["size"][1]
        ),
    );
    let warnings = scene["warnings"].as_array();
    for warning in warnings.into_iter().flatten() {
        say("warning", text(warning));
    }
    lines
}

fn scene_report(settings: &Settings, is_software: bool) -> Result<Value, Failure> {
    let Loaded {
        scene,
        mut settings,
        light,
    } = load_scene(settings)?;
    // As `run` does.
    settings.render.decide_switches(true);
    let settings = &settings;
    let needs = Needs::of(&scene);
    let PlannedScene {
        mut stages,
        lower,
        features,
        maps,
    } = plan_of_scene(&scene, &settings.render, is_software)?;
    let size = match settings.size {
        Some(size) => size,
        None => Headset::load(&settings.headset)?.size,
    };
    let passes = &settings.render.user_passes;
    let library = shader_library(&settings.gpu.shader_folder, passes).map_err(Failure::unusable)?;
    // Which buffers are given besides the frame's own, a renderer knows.
    user_passes::check(passes, &stages, &library, &features, |_| true)?;
    let plans = [&stages].into_iter().chain(&lower);
    let memory = memory(plans, &features, &library, size, &maps)?;
    stages.extend(on_demand(&settings.render));
    Ok(json!({
        "name": settings.scene,
        "warnings": scene.warnings,
        "light": light.map(|light| light.to_string()),
        "outside_files": scene.source.outside_files,
        "too_bright_lights": scene.source.too_bright_lights,
        "bounds_in_world": scene
            .bounds_in_world()
            .map(|bounds| [bounds.min.to_array(), bounds.max.to_array()]),
        "surface_area_m2": scene.surface_area_m2(),
        "automatic_radius_m": automatic_radius_m(&scene, settings.render.photon.count),
        "needs": needs,
        "shader_features": features.report(ShaderFeatures::decided_up_to(DecidedBy::Settings)),
        "memory": memory,
        "frame": list(&stages, &features, &library)?,
    }))
}
