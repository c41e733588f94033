//! Pictures of every view of intermediate results of a scene, through the library.
//!
//! `cargo run --release --example views -- SCENE FOLDER [WIDTH HEIGHT [ENVIRONMENT]]` renders two frames, the head moving a little
//! in between, writes FOLDER/NAME_EYE.png for every view of both eyes, the picture itself and its error against a better one, and
//! prints what their colours mean.

use std::path::Path;
use std::process::ExitCode;

use glam::DVec3;
use stereolux::false_color::{Coloring, Picture, Scale, picture, relative_error};
use stereolux::gpu::{GpuContext, ShaderLibrary};
use stereolux::images::{Image, tone_map, write_png};
use stereolux::renderer::{Eye, Inspection, Renderer};
use stereolux::scene::{Scene, load_environment};
use stereolux::settings::{Eyes, RenderSettings};
use stereolux::xr::{Fov, View};

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// Distance between the eyes, metres.
const IPD_M: f64 = 0.063;

fn views(scene: &Scene, step: f64) -> [View; 2] {
    let head = scene.start_pose();
    [-0.5, 0.5].map(|side| {
        let offset = DVec3::X * (side * IPD_M) + DVec3::new(0.01, 0.0, -0.03) * step;
        View {
            position_in_world: head.position + head.orientation * offset,
            orientation: head.orientation,
            fov: Fov::from_degrees(-38.0, 38.0, 30.0, -30.0),
        }
    })
}

fn write(folder: &Path, name: &str, picture: &Picture) -> Outcome<()> {
    write_png(&folder.join(format!("{name}.png")), &picture.image)?;
    println!("{name}: {}", picture.legend.line());
    Ok(())
}

fn run(name: &str, folder: &Path, size: [u32; 2], environment: Option<&str>) -> Outcome<()> {
    std::fs::create_dir_all(folder)?;
    let mut scene = match name.strip_prefix("builtin:") {
        Some(builtin) => Scene::builtin(builtin)?,
        None => Scene::load(Path::new(name))?,
    };
    if let Some(path) = environment {
        scene.environment = Some(load_environment(path, 1.0)?.0);
    }
    let library = ShaderLibrary::embedded();
    let mut settings = RenderSettings::default();
    for view in Inspection::ALL {
        settings = view.settings_for(&settings);
    }
    let open = |settings: &RenderSettings| -> Outcome<Renderer> {
        let context = GpuContext::open(None)?;
        Ok(Renderer::new(
            context,
            &library,
            &scene,
            settings,
            Eyes::Both,
            size,
        )?)
    };
    let mut renderer = open(&settings)?;
    for frame in 0..2 {
        renderer.render_frame(&views(&scene, f64::from(frame)), frame, |_| {})?;
    }
    for eye in [Eye::Left, Eye::Right] {
        for view in Inspection::ALL {
            if view == Inspection::Provenance && eye == Eye::Left {
                continue;
            }
            let found = renderer.inspect(&library, view, eye)?;
            let name = format!("{}_{}", view.name(), eye.name());
            write(folder, &name, &picture(&found, Coloring::of(view))?)?;
        }
    }
    let image = |renderer: &Renderer| -> Outcome<_> {
        let pixels = renderer.read_samples(Eye::Left)?.unwrap_or_default();
        Ok(Image::new(size[0], size[1], pixels)?)
    };
    let noisy = image(&renderer)?;
    write_png(&folder.join("picture_left.png"), &tone_map(&noisy, 1.0))?;
    drop(renderer);
    let better = RenderSettings {
        spp: 16,
        seed: 1,
        ..RenderSettings::default()
    };
    let mut reference = open(&better)?;
    reference.render_frame(&views(&scene, 1.0), 0, |_| {})?;
    let coloring = Coloring {
        scale: Scale::Log,
        range: Some([1e-4, 1.0]),
    };
    write(
        folder,
        "error_left",
        &relative_error(&noisy, &image(&reference)?, coloring)?,
    )
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let side = |index: usize, default| {
        arguments
            .get(index)
            .and_then(|text| text.parse().ok())
            .unwrap_or(default)
    };
    let (Some(scene), Some(folder)) = (arguments.first(), arguments.get(1)) else {
        eprintln!("views: give a scene and a folder for the pictures");
        return ExitCode::from(2);
    };
    let size = [side(2, 256), side(3, 192)];
    let environment = arguments.get(4).map(String::as_str);
    match run(scene, Path::new(folder), size, environment) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("views: {error}");
            ExitCode::FAILURE
        }
    }
}
