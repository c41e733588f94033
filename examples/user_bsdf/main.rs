//! A BSDF of your own, in one shader file and one entry.
//!
//! ```sh
//! cargo run --release --example user_bsdf                # writes to out/user_bsdf
//! cargo run --release --example user_bsdf -- my/folder
//! ```
//!
//! renders `builtin:cornell` twice, with its two blocks as they are and of clay, a rough diffuse material that glTF
//! does not have. What it takes:
//!
//! 1. a shader file, `oren_nayar.wesl` beside this one, with three functions: value, density, sample;
//! 2. an entry in the shader library: [`library`];
//! 3. materials that carry the entry's number: [`clay`].
//!
//! Everything else, path tracer, photon map and stereo reuse alike, works as with the built-in models.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use stereolux::{
    Eye, Eyes, Fov, GpuContext, Headset, Image, ImageRgb, Material, Method, RenderSettings,
    Renderer, Scene, ShaderLibrary, UserBsdf, disable_device_select_layer, install_user_bsdfs,
    tone_map, write_exr, write_png,
};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// The shaders, with the model added. Several go into one list; the first is number 1.
pub fn library() -> Result<ShaderLibrary> {
    let mut library = ShaderLibrary::embedded();
    let oren_nayar = UserBsdf::new("oren_nayar", include_str!("oren_nayar.wesl"));
    install_user_bsdfs(&mut library, &[oren_nayar])?;
    Ok(library)
}

/// A material of the model. The shader reads its `roughness` as the spread of the facets' slopes, radians: 0 is
/// Lambert.
pub fn clay(spread_rad: f32, reflectance: [f32; 3]) -> Material {
    Material {
        user_bsdf: 1,
        roughness: spread_rad,
        ..Material::lambert("clay", reflectance)
    }
}

/// The Cornell box with the meshes named here of one material.
pub fn cornell_with(meshes: &[&str], material: &Material) -> Result<Scene> {
    let mut scene = Scene::builtin("cornell")?;
    for mesh in meshes {
        let painted = scene.paint(mesh, material.clone());
        if painted == 0 {
            return Err(format!("the scene has no mesh named {mesh:?}").into());
        }
    }
    Ok(scene)
}

/// What the scene's own camera sees, in a square image.
pub fn render(
    context: GpuContext,
    library: &ShaderLibrary,
    scene: &Scene,
    settings: &RenderSettings,
    side: u32,
) -> Result<ImageRgb> {
    let size = [side, side];
    let mut renderer = Renderer::new(context, library, scene, settings, Eyes::Left, size)?;
    let head = scene.start_pose();
    let headset =
        Headset::load("symmetric")?.with_fov(Fov::from_degrees(-19.65, 19.65, 19.65, -19.65))?;
    renderer.render_frame(&headset.views_from_head(&head), 0, |_| {})?;
    let radiance = renderer.read_radiance(Eye::Left)?;
    Ok(Image::new(
        side,
        side,
        radiance.ok_or("the left eye was not rendered")?,
    )?)
}

/// Renders both boxes and writes `plain.exr`, `clay.exr` and, side by side for looking at, `plain_and_clay.png`.
pub fn compare(out: &Path, adapter: Option<&str>, side: u32, samples: u32) -> Result<()> {
    // First: rendering takes longer than being told that there is no place for it.
    std::fs::create_dir_all(out).map_err(|error| format!("{}: {error}", out.display()))?;
    let settings = RenderSettings {
        method: Method::Path,
        spp: samples,
        ..RenderSettings::default()
    };
    let blocks = ["short block", "tall block"];
    let white = [0.725, 0.71, 0.68]; // the box's own
    let library = library()?;
    let mut images = Vec::new();
    for material in [Material::lambert("plain", white), clay(0.6, white)] {
        let scene = cornell_with(&blocks, &material)?;
        let context = GpuContext::open(adapter)?;
        images.push(render(context, &library, &scene, &settings, side)?);
    }
    let (plain, clay) = (&images[0], &images[1]);
    write_exr(&out.join("plain.exr"), plain)?;
    write_exr(&out.join("clay.exr"), clay)?;
    let both = Image::side_by_side(plain, clay)?;
    write_png(&out.join("plain_and_clay.png"), &tone_map(&both, 1.0))?;
    Ok(())
}

fn main() -> ExitCode {
    disable_device_select_layer();
    let out = std::env::args_os()
        .nth(1)
        .map_or_else(|| PathBuf::from("out/user_bsdf"), PathBuf::from);
    match compare(&out, None, 160, 32) {
        Ok(()) => {
            println!(
                "plain_and_clay.png, plain.exr and clay.exr are in {}",
                out.display()
            );
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
