//! What reconstruction gains over a recorded head motion, and what it costs.
//!
//! `cargo run --release --example reconstruction -- SCENE TRACE [--frames N] [--size N] [--reference N] [--out DIR] [--shaders
//! DIR]` renders
//! the first frames of a native trace (`stereolux run --record`) at one sample per pixel, raw and filtered, and prints per
//! method and filter: the mean relMSE over the frames, how many times less than raw that is, how much the error changes
//! from frame to frame, how much the eyes disagree, and device milliseconds per megapixel and pass. References are means of
//! frames through the pixels' centres. With `--out` the shown pictures of the last frame are written.

use std::collections::BTreeMap;
use std::path::PathBuf;

use stereolux::bench::views::{left_from_right, views_of_session};
use stereolux::gpu::{GpuContext, ShaderLibrary};
use stereolux::images::{Image, ImageRgb, encode_display, tone_map, write_png};
use stereolux::metrics::{binocular_error, error_image};
use stereolux::options::{Eyes, Method, Reuse, Settings};
use stereolux::renderer::{Eye, Renderer};
use stereolux::scene::Scene;
use stereolux::xr::{Headset, Pose, ReplayOptions, ReplaySession, View};

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

const EYES: [Eye; 2] = [Eye::Left, Eye::Right];

struct Options {
    scene: String,
    trace: PathBuf,
    frames: usize,
    size: u32,
    reference: u32,
    out: Option<PathBuf>,
    shaders: String,
}

fn options() -> Outcome<Options> {
    let mut words = std::env::args().skip(1);
    let (Some(scene), Some(trace)) = (words.next(), words.next()) else {
        return Err(
            "usage: reconstruction SCENE TRACE [--frames N] [--size N] [--reference N] [--out DIR] [--shaders DIR]"
                .into(),
        );
    };
    let mut options = Options {
        scene,
        trace: trace.into(),
        frames: 60,
        size: 64,
        reference: 256,
        out: None,
        shaders: String::new(),
    };
    while let Some(flag) = words.next() {
        let value = words.next().ok_or(format!("{flag} needs a value"))?;
        match flag.as_str() {
            "--frames" => options.frames = value.parse()?,
            "--size" => options.size = value.parse()?,
            "--reference" => options.reference = value.parse()?,
            "--shaders" => options.shaders = value,
            "--out" => options.out = Some(value.into()),
            _ => return Err(format!("unknown flag {flag}").into()),
        }
    }
    Ok(options)
}

fn open(scene: &Scene, settings: &Settings, size: u32) -> Outcome<Renderer> {
    let context = GpuContext::open(
        Some(&settings.adapter)
            .filter(|name| !name.is_empty())
            .map(String::as_str),
    )?;
    let library = match settings.gpu.shader_folder.as_str() {
        "" => ShaderLibrary::embedded(),
        folder => ShaderLibrary::with_folder(folder.as_ref())?,
    };
    Ok(Renderer::new(
        context,
        &library,
        scene,
        settings,
        Eyes::Both,
        [size, size],
    )?)
}

fn image(size: u32, pixels: Vec<[f32; 3]>) -> Outcome<ImageRgb> {
    Ok(Image::new(size, size, pixels)?)
}

/// Both eyes' mean over `frames` frames through the pixels' centres.
fn reference(
    renderer: &mut Renderer,
    views: &[View; 2],
    frames: u32,
    size: u32,
) -> Outcome<[ImageRgb; 2]> {
    for frame in 0..frames {
        renderer.render_frame(views, frame, |_| {})?;
    }
    let read = |eye| image(size, renderer.read_radiance(eye)?.unwrap_or_default());
    Ok([read(Eye::Left)?, read(Eye::Right)?])
}

/// Relative squared error of every pixel, DESIGN's relMSE before the mean.
fn relative_errors(image: &ImageRgb, reference: &ImageRgb) -> Vec<f64> {
    let square = |v: f32| f64::from(v) * f64::from(v);
    let count = (reference.pixels.len() * 3) as f64;
    let s = reference
        .pixels
        .iter()
        .flatten()
        .map(|&r| square(r))
        .sum::<f64>()
        / count;
    let pixels = image.pixels.iter().zip(&reference.pixels);
    pixels
        .map(|(x, r)| {
            let terms = (0..3)
                .map(|c| (f64::from(x[c]) - f64::from(r[c])).powi(2) / (square(r[c]) + 0.01 * s));
            terms.sum::<f64>() / 3.0
        })
        .collect()
}

#[derive(Default)]
struct Tally {
    errors: Vec<f64>,
    /// Signed relative error by pixel, of the frame before.
    before: Option<Vec<[f64; 3]>>,
    flicker: Vec<f64>,
    binocular: Vec<f64>,
    pass_ms: BTreeMap<String, Vec<f64>>,
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or_default()
}

fn main() -> Outcome<()> {
    let options = options()?;
    let scene = Scene::builtin(&options.scene).or_else(|_| Scene::load(&options.scene))?;
    let headset = Headset::load("symmetric")?;
    let start = scene.start_pose();
    let replay = ReplayOptions::new(headset, Pose::new(start.position, start.orientation));
    let mut session = ReplaySession::open(&options.trace, replay)?;
    let views: Vec<[View; 2]> = views_of_session(&mut session)?
        .into_iter()
        .take(options.frames)
        .collect();
    let size = options.size;

    let mut settings = Settings {
        method: Method::Path,
        reuse: Reuse::Off,
        seed: 99,
        ..Settings::default()
    };
    settings.reconstruct.still = true;
    settings.reconstruct.still_from = 0;
    settings.reconstruct.still_until = 1;
    settings.gpu.timestamps = false;
    let mut judge = open(&scene, &settings, size)?;
    eprintln!(
        "references: {} frames of {} samples",
        views.len(),
        options.reference
    );
    let mut references = Vec::new();
    let mut pairs = Vec::new();
    for views in &views {
        if let Some(reconstruction) = judge.reconstruction_mut() {
            reconstruction.reset();
        }
        references.push(reference(&mut judge, views, options.reference, size)?);
        let hits = |eye| judge.eyes().read_hit_rays(judge.context(), eye);
        let (left, right) = (
            hits(Eye::Left)?.unwrap_or_default(),
            hits(Eye::Right)?.unwrap_or_default(),
        );
        pairs.push(left_from_right(views, [size, size], &left, &right));
    }
    drop(judge);

    println!(
        "| method | reuse | filter | relMSE | raw over it | change of error per frame | binocular RMSE | reconstruction, ms per megapixel |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    let mut costs = BTreeMap::new();
    for (method, reuse) in [
        (Method::Path, Reuse::Off),
        (Method::Path, Reuse::Scatter),
        (Method::Photon, Reuse::Off),
        (Method::Photon, Reuse::Lookup),
    ] {
        let mut raw_error = 0.0;
        for (name, svgf, stereo) in [
            ("none", false, false),
            ("each eye by itself", true, false),
            ("shared", true, true),
        ] {
            let mut settings = Settings {
                method,
                reuse,
                ..Settings::default()
            };
            settings.photon.count = 65_536;
            settings.gpu.shader_folder.clone_from(&options.shaders);
            settings.reconstruct.svgf = svgf;
            settings.reconstruct.stereo = stereo;
            settings.reconstruct.taa = svgf;
            let mut renderer = open(&scene, &settings, size)?;
            let mut tally = Tally::default();
            for (frame, views) in views.iter().enumerate() {
                let result = renderer.render_frame(views, frame as u32, |_| {})?;
                let shown = EYES.map(|eye| renderer.read_radiance(eye));
                let [left, right] = shown;
                let shown = [
                    image(size, left?.unwrap_or_default())?,
                    image(size, right?.unwrap_or_default())?,
                ];
                for (image, reference) in shown.iter().zip(&references[frame]) {
                    tally.errors.push(mean(&relative_errors(image, reference)));
                }
                let errors = [
                    error_image(&shown[0], &references[frame][0])?,
                    error_image(&shown[1], &references[frame][1])?,
                ];
                // How the left eye's error changes: a picture whose error stays does not flicker.
                let residual: Vec<[f64; 3]> =
                    errors[0].pixels.iter().map(|p| p.map(f64::from)).collect();
                if let Some(before) = &tally.before {
                    let changes: Vec<f64> = residual
                        .iter()
                        .zip(before)
                        .flat_map(|(now, before)| (0..3).map(|c| (now[c] - before[c]).powi(2)))
                        .collect();
                    tally.flicker.push(mean(&changes));
                }
                tally.before = Some(residual);
                let binocular =
                    binocular_error(&errors[0], &errors[1], &references[frame][1], &pairs[frame])?;
                tally.binocular.push(binocular.rmse);
                for (pass, (ms, _)) in &result.times.passes {
                    if pass.starts_with("reconstruction.") {
                        tally.pass_ms.entry(pass.clone()).or_default().push(*ms);
                    }
                }
            }
            let error = mean(&tally.errors);
            if name == "none" {
                raw_error = error;
            }
            let megapixels = 2.0 * f64::from(size * size) * 1e-6;
            let cost: f64 = tally.pass_ms.values().map(|ms| median(ms)).sum();
            println!(
                "| {method:?} | {reuse:?} | {name} | {error:.4} | {:.1} | {:.4} | {:.4} | {:.0} |",
                raw_error / error,
                mean(&tally.flicker).sqrt(),
                mean(&tally.binocular.iter().map(|b| b * b).collect::<Vec<_>>()).sqrt(),
                cost / megapixels,
            );
            if stereo && method == Method::Path && reuse == Reuse::Off {
                for (pass, ms) in &tally.pass_ms {
                    let pass = pass.rsplit('.').next().unwrap_or_default().to_owned();
                    *costs.entry(pass).or_insert(0.0) += median(ms) / megapixels;
                }
            }
            if let Some(out) = &options.out {
                std::fs::create_dir_all(out)?;
                let pictures = EYES.map(|eye| -> Outcome<_> {
                    Ok(match renderer.read_displayed(eye)? {
                        Some(shown) => encode_display(&image(size, shown)?),
                        None => tone_map(
                            &image(size, renderer.read_radiance(eye)?.unwrap_or_default())?,
                            1.0,
                        ),
                    })
                });
                let [left, right] = pictures;
                let file =
                    format!("{method:?}_{reuse:?}_{}.png", name.replace(' ', "_")).to_lowercase();
                write_png(&out.join(file), &Image::side_by_side(&left?, &right?)?)?;
            }
        }
    }
    println!("\n| pass | ms per megapixel |\n|---|---|");
    for (pass, cost) in costs {
        println!("| {pass} | {cost:.1} |");
    }
    Ok(())
}
