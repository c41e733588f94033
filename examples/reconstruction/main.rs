//! What reconstruction gains over a recorded head motion, and what it costs.
//!
//! `cargo run --release --example reconstruction -- SCENE TRACE [flags]` renders the first frames of a trace (whatever
//! `stereolux run --trace` reads) at one sample per pixel, raw and filtered, and prints per method and filter: the mean
//! relMSE over the frames that were judged, how many times less than raw that is, how bright the pictures are against
//! their references, how much the error changes from frame to frame, how much the eyes disagree, and device milliseconds
//! per megapixel and pass.
//!
//! - `--frames N`, `--size N`: how many frames of which size.
//! - `--reference N`: samples per pixel of each of the two references of a frame (`paired_references`), through the centres.
//! - `--pose "X Y Z"`: where a trajectory starts, level and looking along -Z; the scene's own start without it.
//! - `--every N`: judges two frames in the middle of every N; all are rendered.
//! - `--keep DIR`: references are kept there for the next run of the same code, scene (by its name) and views.
//! - `--out DIR`: pictures and radiance of frames 10, 50, 100 and the last are written there.
//! - `--set KEY=VALUE`: a setting, for all variants; may be repeated.

use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::path::{Path, PathBuf};

use glam::{DQuat, DVec3};
use stereolux::bench::RENDER_CODE;
use stereolux::bench::correspondence::left_from_right;
use stereolux::gpu::{GpuContext, ShaderLibrary};
use stereolux::images::{Image, ImageRgb, read_image, tone_map, write_exr, write_png};
use stereolux::options::SettingsFile as _;
use stereolux::renderer::{Eye, Renderer};
use stereolux::scene::Scene;
use stereolux::settings::{Eyes, Method, RenderSettings, Reuse, Settings};
use stereolux::xr::{Headset, Pose, ReplayOptions, ReplaySession, View, all_frames};

mod paired_references;

use paired_references::{
    Differences, References, binocular_square, change_square, differences, relative_square,
};

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

const EYES: [Eye; 2] = [Eye::Left, Eye::Right];

/// Frames whose pictures are written, and the last.
const PICTURES: [usize; 3] = [10, 50, 100];

struct Options {
    scene: String,
    trace: PathBuf,
    frames: usize,
    size: u32,
    reference: u32,
    every: usize,
    pose: Option<DVec3>,
    keep: Option<PathBuf>,
    out: Option<PathBuf>,
    set: Vec<(String, serde_json::Value)>,
}

fn options() -> Outcome<Options> {
    let mut words = std::env::args().skip(1);
    let (Some(scene), Some(trace)) = (words.next(), words.next()) else {
        return Err("usage: reconstruction SCENE TRACE [--frames N] [--size N] [--reference N] [--pose \"X Y Z\"] [--every N] [--keep DIR] [--out DIR] [--set KEY=VALUE]".into());
    };
    let mut options = Options {
        scene,
        trace: trace.into(),
        frames: 60,
        size: 64,
        reference: 128,
        every: 1,
        pose: None,
        keep: None,
        out: None,
        set: Vec::new(),
    };
    while let Some(flag) = words.next() {
        let value = words.next().ok_or(format!("{flag} needs a value"))?;
        match flag.as_str() {
            "--frames" => options.frames = value.parse()?,
            "--size" => options.size = value.parse()?,
            "--reference" => options.reference = value.parse()?,
            "--pose" => {
                let numbers = value.split_whitespace().map(str::parse);
                let numbers = numbers.collect::<Result<Vec<f64>, _>>()?;
                let place = <[f64; 3]>::try_from(numbers).map_err(|_| "--pose \"X Y Z\"")?;
                options.pose = Some(place.into());
            }
            "--every" => options.every = value.parse::<usize>()?.max(1),
            "--keep" => options.keep = Some(value.into()),
            "--out" => options.out = Some(value.into()),
            "--set" => {
                let (key, value) = value.split_once('=').ok_or("--set KEY=VALUE")?;
                let value = serde_json::from_str(value)?;
                options.set.push((key.to_owned(), value));
            }
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
        &settings.render,
        Eyes::Both,
        [size, size],
    )?)
}

fn image(size: u32, pixels: Vec<[f32; 3]>) -> Outcome<ImageRgb> {
    Ok(Image::new(size, size, pixels)?)
}

/// A frame that is judged.
struct Judged {
    /// By eye.
    references: [References; 2],
    /// For each pixel of the right eye, the left eye's that sees the same point.
    left_from_right: Image<Option<u32>>,
}

/// Renders references of the frames that are judged, or takes them from `--keep`.
fn judge(options: &Options, scene: &Scene, views: &[[View; 2]]) -> Outcome<Vec<Option<Judged>>> {
    let size = options.size;
    let mut render = RenderSettings {
        method: Method::Path,
        reuse: Reuse::Off,
        seed: 99,
        ..RenderSettings::default()
    };
    render.reconstruct.still = true.into();
    render.reconstruct.still_from = 0;
    render.reconstruct.still_until = 1;
    render.gpu.timestamps = false.into();
    let settings = Settings {
        render,
        ..Settings::default()
    };
    let mut renderer = open(scene, &settings, size)?;
    let mut judged = Vec::new();
    for (frame, views) in views.iter().enumerate() {
        // Two in a row show how the error changes; from the middle of their block, so that the first frames, which have no
        // history, count no more than they should.
        let after_middle = (frame % options.every).checked_sub(options.every / 2);
        if after_middle.is_none_or(|after| after > 1) {
            judged.push(None);
            continue;
        }
        let mut halves = Vec::new();
        for half in 0..2 {
            let kept = options.keep.as_deref().map(|folder| {
                let mut hasher = DefaultHasher::new();
                let what = (&options.scene, size, options.reference, half);
                (what, format!("{views:?}"), RENDER_CODE).hash(&mut hasher);
                let key = hasher.finish();
                ["left", "right"].map(|eye| folder.join(format!("{key:016x}_{eye}.exr")))
            });
            halves.push(match kept {
                Some([left, right]) if left.exists() && right.exists() => {
                    [read_image(&left)?, read_image(&right)?]
                }
                kept => {
                    if let Some(reconstruction) = renderer.reconstruction_mut() {
                        reconstruction.reset();
                    }
                    // Frames of other numbers draw other samples.
                    for index in 0..options.reference {
                        renderer.render_frame(views, half * options.reference + index, |_| {})?;
                    }
                    let both = [
                        image(size, renderer.read_radiance(Eye::Left)?.unwrap_or_default())?,
                        image(
                            size,
                            renderer.read_radiance(Eye::Right)?.unwrap_or_default(),
                        )?,
                    ];
                    if let Some(paths) = kept {
                        write_exr(&paths[0], &both[0])?;
                        write_exr(&paths[1], &both[1])?;
                    }
                    both
                }
            });
        }
        // Which points both eyes see, by what this frame's rays hit.
        renderer.render_frame(views, 0, |_| {})?;
        let [left, right] = EYES.map(|eye| renderer.read_hit_rays(eye));
        let (left, right) = (left?.unwrap_or_default(), right?.unwrap_or_default());
        let of = |eye: usize| [halves[0][eye].clone(), halves[1][eye].clone()];
        judged.push(Some(Judged {
            references: [of(0), of(1)],
            left_from_right: left_from_right(views, [size, size], &left, &right),
        }));
    }
    Ok(judged)
}

#[derive(Default)]
struct Tally {
    errors: Vec<f64>,
    /// Sums of all channels, of the pictures and of their references.
    shown_and_reference: [f64; 2],
    /// Of the left eye, and which frame that was.
    before: Option<(usize, Differences)>,
    changes: Vec<f64>,
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

/// Square root that keeps the sign: a product of differences may be negative by chance.
fn root(square: f64) -> f64 {
    square.abs().sqrt().copysign(square)
}

impl Tally {
    fn judge(
        &mut self,
        frame: usize,
        renderer: &Renderer,
        judged: &Judged,
        size: u32,
    ) -> Outcome<()> {
        let mut found = Vec::new();
        for (eye, references) in EYES.into_iter().zip(&judged.references) {
            let shown = image(size, renderer.read_radiance(eye)?.unwrap_or_default())?;
            let differences = differences(&shown, references);
            let sum = |image: &ImageRgb| {
                image
                    .pixels
                    .iter()
                    .flatten()
                    .map(|&c| f64::from(c))
                    .sum::<f64>()
            };
            self.shown_and_reference[0] += sum(&shown);
            self.shown_and_reference[1] += 0.5 * (sum(&references[0]) + sum(&references[1]));
            self.errors.push(relative_square(&differences, references));
            found.push(differences);
        }
        self.binocular.push(binocular_square(
            &found[0],
            &found[1],
            &judged.left_from_right,
        ));
        let left = found.swap_remove(0);
        if let Some((before, differences)) = &self.before
            && before + 1 == frame
        {
            self.changes.push(change_square(&left, differences));
        }
        self.before = Some((frame, left));
        Ok(())
    }
}

/// What a headset would show, both eyes side by side, and each eye's radiance beside it.
fn write_picture(path: &Path, renderer: &Renderer, size: u32) -> Outcome<()> {
    let mut pictures = Vec::new();
    for (eye, name) in EYES.into_iter().zip(["left", "right"]) {
        let radiance = image(size, renderer.read_radiance(eye)?.unwrap_or_default())?;
        write_exr(&path.with_extension(format!("{name}.exr")), &radiance)?;
        pictures.push(tone_map(&radiance, 1.0));
    }
    write_png(path, &Image::side_by_side(&pictures[0], &pictures[1])?)?;
    Ok(())
}

fn main() -> Outcome<()> {
    let options = options()?;
    if let Some(out) = &options.out {
        std::fs::create_dir_all(out)?;
    }
    let scene = Scene::builtin(&options.scene).or_else(|_| Scene::load(&options.scene))?;
    let headset = Headset::load("symmetric")?;
    let start = match options.pose {
        Some(place) => Pose::new(place, DQuat::IDENTITY),
        None => scene.start_pose(),
    };
    let replay = ReplayOptions::new(headset, start);
    let mut session = ReplaySession::open(&options.trace, replay)?;
    let frames = all_frames(&mut session, options.frames)?;
    let views: Vec<[View; 2]> = frames.into_iter().map(|(_, views)| views).collect();
    let size = options.size;

    if let Some(folder) = &options.keep {
        std::fs::create_dir_all(folder)?;
    }
    let judged = judge(&options, &scene, &views)?;

    println!(
        "| method | reuse | filter | relMSE | raw over it | brightness | change of error per frame | binocular RMSE | reconstruction, ms per megapixel |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
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
            ("eyes separately", true, false),
            ("shared", true, true),
        ] {
            let mut settings = Settings::default();
            settings.render.method = method;
            settings.render.reuse = reuse;
            settings.render.photon.count = 65_536;
            settings.render.reconstruct.svgf = svgf.into();
            settings.render.reconstruct.stereo = stereo;
            settings.render.reconstruct.taa = svgf.into();
            for (key, value) in &options.set {
                settings = settings.with(key, value)?;
            }
            let mut renderer = open(&scene, &settings, size)?;
            let mut tally = Tally::default();
            for (frame, views) in views.iter().enumerate() {
                let result = renderer.render_frame(views, frame as u32, |_| {})?;
                for (pass, (ms, _)) in &result.times.passes {
                    if pass.starts_with("reconstruction.") {
                        tally.pass_ms.entry(pass.clone()).or_default().push(*ms);
                    }
                }
                if let Some(judged) = &judged[frame] {
                    tally.judge(frame, &renderer, judged, size)?;
                }
                if let Some(out) = &options.out
                    && (PICTURES.contains(&frame) || frame + 1 == options.frames)
                {
                    let file = format!("{method:?}_{reuse:?}_{name}_{frame:03}.png");
                    let file = file.replace(' ', "_").to_lowercase();
                    write_picture(&out.join(file), &renderer, size)?;
                }
            }
            let error = mean(&tally.errors);
            if name == "none" {
                raw_error = error;
            }
            let megapixels = 2.0 * f64::from(size * size) * 1e-6;
            let cost: f64 = tally.pass_ms.values().map(|ms| median(ms)).sum();
            println!(
                "| {method:?} | {reuse:?} | {name} | {error:.4} | {:.1} | {:.3} | {:.4} | {:.4} | {:.0} |",
                raw_error / error,
                tally.shown_and_reference[0] / tally.shown_and_reference[1],
                root(mean(&tally.changes)),
                root(mean(&tally.binocular)),
                cost / megapixels,
            );
            if stereo && method == Method::Path && reuse == Reuse::Off {
                for (pass, ms) in &tally.pass_ms {
                    let pass = pass.rsplit('.').next().unwrap_or_default().to_owned();
                    *costs.entry(pass).or_insert(0.0) += median(ms) / megapixels;
                }
            }
        }
    }
    println!("\n| pass | ms per megapixel |\n|---|---|");
    for (pass, cost) in costs {
        println!("| {pass} | {cost:.1} |");
    }
    Ok(())
}
