//! `bench motion`: what reconstruction makes of a moving head, and what it costs. Scene by scene and by both methods, the
//! same swaying head is rendered raw, filtered and filtered by both eyes together, and the last frames are judged by errors
//! of which all but the RMSE do not hold their references' noise ([`super::paired_references`]).

use std::time::Instant;

use glam::DVec3;
use stereolux_report::motion::{MotionRow, files};
use stereolux_report::statistics::spread;

use super::correspondence::{left_from_right, pixel_at};
use super::measure::swaying;
use super::paired_references::{
    References, binocular_square, change_square, differences, mean_product, relative_square,
};
use super::reference::{self, PixelFilter, ReferenceSpec};
use super::scenes::SceneSource;
use super::suites::framing_headset;
use super::{
    BenchError, BenchProgress, JUDGED_BY, Outcome, circumstances, clock, go_on, make_folder,
    references_folder, scenes_or, suites, write_table,
};
use crate::gpu::timing::milliseconds_since;
use crate::gpu::{GpuContext, ShaderLibrary};
use crate::images::{Image, ImageRgb};
use crate::options::BenchOptions;
use crate::renderer::{Eye, Renderer};
use crate::scene::Scene;
use crate::settings::{Choice as _, Eyes, Kept, Method, RenderSettings, Settings, Tone};
use crate::tone::shown;
use crate::xr::{Headset, View, all_frames};

/// Pixels per eye without `--size`.
const SIZE: [u32; 2] = [96, 96];
/// Frames without `--frames`.
const FRAMES: u32 = 40;
/// Rounds without `--rounds`: whatever else the machine does only adds to a frame's time.
const ROUNDS: u32 = 2;
/// Frames whose mean is the brightness: a single one's depends on which of a small lamp's edges its offset meets.
const BRIGHTNESS_FRAMES: usize = 16;
/// Display light by which neighbours may differ on an even surface.
const EVEN: f32 = 0.1;
/// Least cosine between the normals on all sides of a point on an even surface: what the filters take for one surface.
const FLAT: f64 = 0.95;
/// Samples per pixel that a reference of the other frames needs at most: their mean over the picture alone counts.
const MEAN_SAMPLES: u32 = 64;
/// Frames whose error is judged, by two references each: the last, and the one before it.
const JUDGED: usize = 2;

/// Of `run`'s settings.
type Change = fn(&mut RenderSettings);

/// What is reconstructed, by the name that rows give it.
const VARIANTS: [(&str, Change); 3] = [
    ("raw", |render| {
        let own = &mut render.reconstruct;
        for switch in [&mut own.svgf, &mut own.taa, &mut own.still] {
            *switch = false.into();
        }
    }),
    ("separate", |render| render.reconstruct.stereo = false),
    ("default", |_| {}),
];

/// What a variant showed.
struct Shown {
    /// Radiance of the frames that are judged, by eye.
    frames: Vec<[ImageRgb; 2]>,
    /// Mean radiance over [`BRIGHTNESS_FRAMES`], by eye.
    mean: [f64; 2],
    /// Milliseconds of each frame, by [`clock`].
    ms: Vec<f64>,
}

/// Two references of an eye's view, of radiance and of what is displayed.
struct Pair {
    radiance: References,
    displayed: References,
}

impl Pair {
    fn of(radiance: References) -> Self {
        let displayed = [0, 1].map(|half: usize| displayed(&radiance[half]));
        Self {
            radiance,
            displayed,
        }
    }
}

/// What the rows of a scene share.
struct Stage<'a> {
    options: &'a BenchOptions,
    device: &'a GpuContext,
    library: &'a ShaderLibrary,
    name: &'a str,
    scene: &'a Scene,
    size: [u32; 2],
    rounds: u32,
    views: &'a [[View; 2]],
    truth: &'a Truth,
}

/// What should be seen.
struct Truth {
    /// By judged frame and eye.
    judged: Vec<[Pair; 2]>,
    /// Mean radiance over [`BRIGHTNESS_FRAMES`], by eye. One view's will not do: a sun fills more pixels in a corner than ahead.
    mean: [f64; 2],
}

/// Measures, and writes the report.
///
/// # Errors
/// [`BenchError`].
pub(super) fn run(
    options: &BenchOptions,
    library: &ShaderLibrary,
    progress: &mut dyn BenchProgress,
) -> Result<Outcome, BenchError> {
    let settings = &options.settings;
    let size = settings.size.unwrap_or(SIZE);
    let fewest = BRIGHTNESS_FRAMES as u32;
    let frames = options.frames.unwrap_or(FRAMES).max(fewest);
    let rounds = options.rounds.unwrap_or(ROUNDS);
    let most = suites::reference_samples(options);
    let device = GpuContext::open(Some(&settings.adapter))?;
    let about = circumstances(&device, settings);
    let out = options.out.as_path();
    make_folder(out)?;
    let folder = references_folder(options)?;
    let open = |samples: u32| {
        reference::References::open(&folder, samples, library.clone(), about.machine.clone())
    };
    let mut whole = open(most.min(MEAN_SAMPLES));
    // Nobody asks for the spread of a picture's mean.
    whole.fewest_batches = 1;
    let halves = open(most / 2);
    let samples = 2 * halves.most_samples(PixelFilter::Box);
    let mut rows = Vec::new();
    for name in scenes_or(options, &JUDGED_BY) {
        let source = SceneSource::Named(name.clone());
        let scene = source.load(settings)?;
        let fingerprint = source.fingerprint(settings)?;
        let (headset, _) = framing_headset(settings, size, &scene)?;
        let views = sway(&headset, &scene, frames)?;
        progress.says(&format!("{name}: references of {samples} samples"));
        let reference = |view: View, half: Option<u32>| -> Result<ImageRgb, BenchError> {
            let mut settings = settings.clone();
            let seed = &mut settings.render.seed;
            *seed = seed.wrapping_add(half.unwrap_or_default());
            let references = if half.is_some() { &halves } else { &whole };
            let spec = ReferenceSpec {
                scene: &scene,
                scene_fingerprint: &fingerprint,
                settings: &settings,
                view,
                size,
                filter: PixelFilter::Box,
            };
            let found = references.get(&spec, 0.0, &mut |_, _| {})?.moments.mean;
            let pixels = found.pixels.iter().map(|pixel| pixel.map(|c| c as f32));
            Ok(Image::new(size[0], size[1], pixels.collect())?)
        };
        let truth = truth_of(&views, &reference)?;
        let stage = Stage {
            options,
            device: &device,
            library,
            name: &name,
            scene: &scene,
            size,
            rounds,
            views: &views,
            truth: &truth,
        };
        for method in [Method::Photon, Method::Path] {
            rows.extend(stage.measure(method, progress)?);
        }
    }
    let what = format!(
        "{frames} frames of a swaying head, {}x{} pixels per eye, on {}. References: {samples} samples spread over \
         each pixel, rendered in two halves. RMSE, flicker (change of the error between the last two frames) and binocular \
         (the eyes' errors apart, away from edges, with its standard error) in display light, 0 to 1. Brightness: mean radiance of the last \
         {BRIGHTNESS_FRAMES} frames over that of their references. Milliseconds: lower quartile of {rounds} rounds in turn.",
        size[0],
        size[1],
        about.machine.label(),
    );
    write_table(options, rows.len(), files(&rows, &what, &about)?)
}

impl Stage<'_> {
    /// Renders every variant in turn, round by round; a row for each.
    fn measure(
        &self,
        method: Method,
        progress: &mut dyn BenchProgress,
    ) -> Result<Vec<MotionRow>, BenchError> {
        let settings = &self.options.settings;
        let word = method.word();
        let mut found: Vec<Option<Shown>> = VARIANTS.iter().map(|_| None).collect();
        let mut seen = None;
        for round in 1..=self.rounds {
            for ((variant, change), found) in VARIANTS.iter().zip(&mut found) {
                go_on()?;
                progress.says(&format!(
                    "{}: {word}, {variant}, round {round} of {}",
                    self.name, self.rounds
                ));
                let render = settings_of(settings, method, change);
                let context = self.device.clone();
                let (scene, size) = (self.scene, self.size);
                let mut renderer =
                    Renderer::new(context, self.library, scene, &render, Eyes::Both, size)?;
                let now = render_all(&mut renderer, self.views)?;
                if seen.is_none() {
                    seen = self.seen_by_both(&renderer)?;
                }
                // The pictures are those of every round, bit for bit.
                match found {
                    Some(before) => before.ms.extend(now.ms),
                    None => *found = Some(now),
                }
            }
        }
        let seen = seen.unwrap_or_else(|| Image {
            width: self.size[0],
            height: self.size[1],
            pixels: Vec::new(),
        });
        let rows = VARIANTS
            .iter()
            .zip(found)
            .filter_map(|((variant, _), found)| {
                let first = self.views.first()?;
                Some(MotionRow {
                    scene: self.name.to_owned(),
                    method: word.to_owned(),
                    variant: (*variant).to_owned(),
                    clock: clock(self.device).to_owned(),
                    pixels_per_degree: pixels_per_degree(&first[0], self.size[0]),
                    ..judge(&found?, self.truth, &seen)
                })
            });
        Ok(rows.collect())
    }

    /// Where the left eye sees the point of each pixel of the right eye in the last frame, away from edges.
    fn seen_by_both(
        &self,
        renderer: &Renderer,
    ) -> Result<Option<Image<Option<[f64; 2]>>>, BenchError> {
        let hits = |eye| renderer.read_hit_rays(eye);
        let both = hits(Eye::Left)?.zip(hits(Eye::Right)?);
        let last = self.views.last().zip(self.truth.judged.last());
        Ok(both.zip(last).map(|((left, right), (views, truth))| {
            let seen = left_from_right(views, self.size, &left, &right);
            let even = [0, 1]
                .map(|eye: usize| even_pixels([&left, &right][eye], &truth[eye].displayed[0]));
            away_from_edges(&seen, &even)
        }))
    }
}

/// The references of a moving head's last views; `reference` renders a view's first or second half, or all that its mean needs.
fn truth_of(
    views: &[[View; 2]],
    reference: &dyn Fn(View, Option<u32>) -> Result<ImageRgb, BenchError>,
) -> Result<Truth, BenchError> {
    let mut truth = Truth {
        judged: Vec::new(),
        mean: [0.0; 2],
    };
    let first = views.len().saturating_sub(BRIGHTNESS_FRAMES);
    for (frame, pair) in views.iter().enumerate().skip(first) {
        let mut means = [0.0; 2];
        if views.len() - frame > JUDGED {
            for (mean_of_eye, view) in means.iter_mut().zip(pair) {
                *mean_of_eye = mean(&reference(*view, None)?);
            }
        } else {
            let [left, right] = *pair;
            let both = |view| {
                Ok::<_, BenchError>(Pair::of([
                    reference(view, Some(0))?,
                    reference(view, Some(1))?,
                ]))
            };
            let pairs = [both(left)?, both(right)?];
            means = [0, 1].map(|eye: usize| {
                let [one, other] = &pairs[eye].radiance;
                0.5 * (mean(one) + mean(other))
            });
            truth.judged.push(pairs);
        }
        for (sum, mean) in truth.mean.iter_mut().zip(means) {
            *sum += mean / BRIGHTNESS_FRAMES as f64;
        }
    }
    Ok(truth)
}

/// Views of a swaying head that begins where the scene does.
fn sway(headset: &Headset, scene: &Scene, frames: u32) -> Result<Vec<[View; 2]>, BenchError> {
    let mut session = swaying(headset, scene.start_pose(), frames);
    let frames = all_frames(&mut session, usize::MAX)?;
    Ok(frames.into_iter().map(|(_, views)| views).collect())
}

/// `run`'s settings, changed.
fn settings_of(settings: &Settings, method: Method, change: &Change) -> RenderSettings {
    let mut render = settings.render.clone();
    render.method = method;
    render.spp = 1;
    render.gpu.timestamps = true.into();
    render.output.kept = Kept::Depth;
    change(&mut render);
    render.decide_switches(true);
    render
}

fn render_all(renderer: &mut Renderer, views: &[[View; 2]]) -> Result<Shown, BenchError> {
    let [width, height] = renderer.size();
    let mut shown = Shown {
        frames: Vec::new(),
        mean: [0.0; 2],
        ms: Vec::new(),
    };
    for (frame, pair) in (0..).zip(views) {
        let began = Instant::now();
        let result = renderer.render_frame(pair, frame, |_| {})?;
        let host_ms = milliseconds_since(began);
        let frame = frame as usize;
        // Photon lists and histories grow in the first quarter.
        if frame >= views.len() / 4 {
            shown.ms.push(match renderer.context().has_timestamps {
                true => result.times.total_ms(),
                false => host_ms,
            });
        }
        let left = views.len() - frame;
        if left > BRIGHTNESS_FRAMES {
            continue;
        }
        let read = |eye| {
            let pixels = renderer.read_radiance(eye)?.unwrap_or_default();
            Ok::<_, BenchError>(Image::new(width, height, pixels)?)
        };
        let eyes = [read(Eye::Left)?, read(Eye::Right)?];
        for (sum, eye) in shown.mean.iter_mut().zip(&eyes) {
            *sum += mean(eye) / BRIGHTNESS_FRAMES as f64;
        }
        if left <= JUDGED {
            shown.frames.push(eyes);
        }
    }
    Ok(shown)
}

fn mean(image: &ImageRgb) -> f64 {
    let channels = image.pixels.iter().flatten();
    let sum: f64 = channels.map(|&channel| f64::from(channel)).sum();
    sum / (3 * image.pixels.len().max(1)) as f64
}

fn displayed(image: &ImageRgb) -> ImageRgb {
    image.like(image.pixels.iter().map(|&pixel| shown(Tone::Aces, pixel)))
}

/// Square root that keeps the sign: a product of differences may be negative by chance.
fn root(square: f64) -> f64 {
    square.abs().sqrt().copysign(square)
}

/// What a variant's frames come to, beside names. `seen`: where the left eye sees the point of each pixel of the right eye in the
/// last frame.
fn judge(shown: &Shown, truth: &Truth, seen: &Image<Option<[f64; 2]>>) -> MotionRow {
    let mut row = MotionRow::default();
    let eyes = [0, 1].map(|eye: usize| {
        let mut errors = shown
            .frames
            .iter()
            .zip(&truth.judged)
            .map(|(frame, pairs)| differences(&displayed(&frame[eye]), &pairs[eye].displayed));
        (
            errors.next().unwrap_or_default(),
            errors.next().unwrap_or_default(),
        )
    });
    [row.flicker_left, row.flicker_right] =
        [0, 1].map(|eye: usize| root(change_square(&eyes[eye].1, &eyes[eye].0)));
    for (eye, (_, last)) in eyes.iter().enumerate() {
        let Some((frame, pairs)) = shown.frames.last().zip(truth.judged.last()) else {
            continue;
        };
        let pair = &pairs[eye].radiance;
        row.rel_mse += 0.5 * relative_square(&differences(&frame[eye], pair), pair);
        row.brightness += 0.5 * shown.mean[eye] / truth.mean[eye];
        // Both halves together are the better reference.
        let both = last[0].iter().zip(&last[1]);
        let mean: Vec<_> = both
            .map(|(a, b)| std::array::from_fn(|c| 0.5 * (a[c] + b[c])))
            .collect();
        row.rmse += 0.5 * mean_product(&mean, &mean);
    }
    row.rmse = root(row.rmse);
    let apart = binocular_square(&eyes[0].1, &eyes[1].1, seen);
    row.binocular = root(apart.mean());
    // By the delta method.
    let error = apart.standard_error();
    row.binocular_se = error.map_or(f64::NAN, |error| error / (2.0 * row.binocular.abs()));
    row.ms = spread(&shown.ms).map_or(f64::NAN, |ms| ms.lower_quartile);
    row
}

/// Which pixels lie amid an even surface: it is flat there, and `displayed` is alike in their eight neighbours.
fn even_pixels(hits: &[[f32; 4]], displayed: &ImageRgb) -> Vec<bool> {
    let [width, height] = [i64::from(displayed.width), i64::from(displayed.height)];
    let at = |x: i64, y: i64| {
        let is_inside = (0..width).contains(&x) && (0..height).contains(&y);
        let index = usize::try_from(y * width + x).ok().filter(|_| is_inside)?;
        let [x, y, z, distance] = hits.get(index)?.map(f64::from);
        (distance > 0.0).then_some((DVec3::new(x, y, z) * distance, displayed.pixels[index]))
    };
    let is_even = |x: i64, y: i64| -> Option<bool> {
        let (here, light) = at(x, y)?;
        let mut normals = Vec::with_capacity(4);
        for (side, up) in [(1, 1), (-1, 1), (1, -1), (-1, -1)] {
            let (across, down) = (at(x + side, y)?.0 - here, at(x, y + up)?.0 - here);
            normals.push((across.cross(down) * (side * up) as f64).try_normalize()?);
        }
        let mut pairs = normals
            .iter()
            .flat_map(|a| normals.iter().map(|b| a.dot(*b)));
        if pairs.any(|cosine| cosine < FLAT) {
            return Some(false);
        }
        for (dx, dy) in (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy))) {
            let (_, other) = at(x + dx, y + dy)?;
            let mut colors = light.iter().zip(other);
            if colors.any(|(a, b)| (a - b).abs() > EVEN) {
                return Some(false);
            }
        }
        Some(true)
    };
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    pixels.map(|(x, y)| is_even(x, y) == Some(true)).collect()
}

/// Leaves the points amid even surfaces, of the right pixel and of the four left ones around the point: a pixel over an edge shows
/// each eye another mixture, and is no disagreement. `even`: of the left and of the right eye.
fn away_from_edges(
    seen: &Image<Option<[f64; 2]>>,
    even: &[Vec<bool>; 2],
) -> Image<Option<[f64; 2]>> {
    let is_even = |eye: usize, index: usize| even[eye].get(index).copied().unwrap_or(false);
    let is_away = |here: usize, place: [f64; 2]| {
        let around = [-0.5, 0.5].map(|dy| [-0.5, 0.5].map(|dx| [place[0] + dx, place[1] + dy]));
        let mut around = around.into_iter().flatten();
        is_even(1, here) && around.all(|tap| is_even(0, pixel_at(tap, seen.width) as usize))
    };
    let kept = |(here, to): (usize, &Option<[f64; 2]>)| to.filter(|&to| is_away(here, to));
    seen.like(seen.pixels.iter().enumerate().map(kept))
}

/// Pixels per degree in the middle of a picture `width` pixels wide.
fn pixels_per_degree(view: &View, width: u32) -> f64 {
    let span = view.fov.angle_right.tan() - view.fov.angle_left.tan();
    f64::from(width) / span * 1.0_f64.to_radians()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(level: f32) -> ImageRgb {
        Image::filled(4, 4, [level; 3]).unwrap()
    }

    /// The middle of a pixel.
    fn middle(index: u32, width: u32) -> [f64; 2] {
        [index % width, index / width].map(|at| f64::from(at) + 0.5)
    }

    fn pairs(level: f32) -> [Pair; 2] {
        let pair = || Pair::of([image(level), image(level)]);
        [pair(), pair()]
    }

    #[test]
    fn what_stays_wrong_does_not_flicker_and_what_both_eyes_have_wrong_is_no_disagreement() {
        let truth = Truth {
            judged: vec![pairs(0.2), pairs(0.2)],
            mean: [0.2; 2],
        };
        let everywhere = Image {
            width: 4,
            height: 4,
            pixels: (0..16).map(|i| Some(middle(i, 4))).collect(),
        };
        let shown_as = |frames: [[f32; 2]; 2]| Shown {
            mean: frames[1].map(f64::from),
            frames: frames.map(|eyes| eyes.map(image)).into(),
            ms: vec![3.0, 1.0, 2.0],
        };
        let still = judge(&shown_as([[0.3; 2]; 2]), &truth, &everywhere);
        let off = shown(Tone::Aces, [0.3; 3])[0] - shown(Tone::Aces, [0.2; 3])[0];
        assert!((still.rmse - f64::from(off)).abs() < 1e-6, "{still:?}");
        assert!((still.brightness - 1.5).abs() < 1e-6, "{still:?}");
        assert_eq!(
            (still.flicker_left, still.flicker_right, still.binocular),
            (0.0, 0.0, 0.0)
        );
        // The right eye is right in the last frame alone.
        let one = judge(&shown_as([[0.3; 2], [0.3, 0.2]]), &truth, &everywhere);
        assert_eq!(one.flicker_left, 0.0);
        assert!((one.flicker_right - f64::from(off)).abs() < 1e-6, "{one:?}");
        assert!((one.binocular - f64::from(off)).abs() < 1e-6, "{one:?}");
        assert!((one.ms - 1.5).abs() < 0.6, "{one:?}");
    }

    fn view(yaw: f64) -> View {
        View {
            position_in_world: DVec3::ZERO,
            orientation: glam::DQuat::from_rotation_y(yaw),
            fov: crate::xr::Fov::from_degrees(-45.0, 45.0, 45.0, -45.0),
        }
    }

    #[test]
    fn brightness_is_that_of_the_frames_own_views() {
        // A view is as bright as it is turned: frame n by n / 20, the right eye's twice that.
        let frames = 20;
        let turned = |frame| 0.05 * f64::from(frame);
        let views: Vec<_> = (0..frames)
            .map(|frame| [view(turned(frame)), view(2.0 * turned(frame))])
            .collect();
        let bright = |of: View, _| Ok(image(of.orientation.to_axis_angle().1 as f32));
        let truth = truth_of(&views, &bright).unwrap();
        let mean = (4..frames).map(turned).sum::<f64>() / 16.0;
        for (found, wanted) in truth.mean.iter().zip([mean, 2.0 * mean]) {
            assert!((found - wanted).abs() < 1e-5, "{found} for {wanted}");
        }
        let judged: Vec<f32> = truth
            .judged
            .iter()
            .map(|[left, _]| left.radiance[1].pixels[0][0])
            .collect();
        assert!(
            (judged[0] - 0.9).abs() < 1e-5 && (judged[1] - 0.95).abs() < 1e-5,
            "{judged:?}"
        );
    }

    /// First hits of `view`, 12x8 pixels, on two walls that meet two metres ahead in the plane x = `corner_x`: one faces the eye,
    /// the other comes towards it at `angle`.
    fn hits_of_walls(view: &View, corner_x: f64, angle: f64) -> Vec<[f32; 4]> {
        let normals = [DVec3::Z, DVec3::new(-angle.sin(), 0.0, angle.cos())];
        let corner = DVec3::new(corner_x, 0.0, -2.0) - view.position_in_world;
        let hit = |index: u32| {
            let [column, row] = middle(index, 12);
            let ray = view.ray_through_pixel(column, row, 12, 8).direction;
            let distances = normals.map(|normal| normal.dot(corner) / normal.dot(ray));
            let ahead = distances.into_iter().filter(|distance| *distance > 0.0);
            let [x, y, z] = ray.as_vec3().to_array();
            [x, y, z, ahead.fold(f64::MAX, f64::min) as f32]
        };
        (0..96).map(hit).collect()
    }

    #[test]
    fn points_beside_an_edge_are_left_out() {
        // A pixel is 4 m / 12 = 1/3 m wide on the wall, and the eyes lie a pixel apart, and another quarter.
        let views = [-0.5, 0.5].map(|side| View {
            position_in_world: DVec3::X * (side * 1.25 / 3.0),
            ..view(0.0)
        });
        let plain = Image::filled(12, 8, [0.5; 3]).unwrap();
        let columns = |angle: f64, lit: &ImageRgb| -> Vec<usize> {
            let hits = [0, 1].map(|eye: usize| hits_of_walls(&views[eye], 0.1, angle));
            let seen = left_from_right(&views, [12, 8], &hits[0], &hits[1]);
            let even = [0, 1].map(|eye: usize| even_pixels(&hits[eye], lit));
            let kept = away_from_edges(&seen, &even);
            assert!(kept.pixels[..12].iter().all(Option::is_none));
            (0..12)
                .filter(|x| kept.pixels[3 * 12 + x].is_some())
                .collect()
        };
        // One wall: all but what lies beside an eye's border. What the right eye sees in column c lies between the left eye's c + 1 and c + 2.
        assert_eq!(columns(0.0, &plain), [1, 2, 3, 4, 5, 6, 7, 8]);
        // The corner lies at 5.7 for the right eye and at 6.9 for the left one: columns 5 and 6, and 6 and 7, have the other wall
        // beside them. What column 8 sees of that wall, which comes nearer, lies beside the left image's border.
        assert_eq!(columns(1.0, &plain), [1, 2, 3, 7]);
        // Bent no more than a sphere, it would be flat.
        assert_eq!(columns(0.1, &plain), [1, 2, 3, 4, 5, 6, 7, 8]);
        // A bright point in the left eye's column 4, too.
        let mut lamp = plain.clone();
        lamp.pixels[3 * 12 + 4] = [0.5, 0.5, 0.9];
        assert_eq!(columns(0.0, &lamp), [6, 7, 8]);
    }

    #[test]
    fn pixels_per_degree_are_those_of_the_middle() {
        // One degree in the middle of 2 m at a metre's distance: 0.017453 m of 2 m.
        let found = pixels_per_degree(&view(0.0), 2000);
        assert!((found - 17.453).abs() < 1e-3, "{found}");
    }
}
