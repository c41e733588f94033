//! Measuring a group of variants: rounds in turn, errors of the very frames that were timed, one record per variant.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};
use std::time::Instant;

use glam::{DQuat, DVec3};
use serde_json::Value;
use stereolux_report::ReportError;
use stereolux_report::fingerprint::Fingerprint;
use stereolux_report::journal::Journal;
use stereolux_report::records::{Load, Machine, REFERENCE_SHARE, Row};
use stereolux_report::rounds::{Round, interleave};
use stereolux_report::statistics::mean;

use super::correspondence::{left_from_right, pixel_at};
use super::instance_motion::{InstanceMotion, InstanceMover};
use super::reference::{PixelFilter, Reference, ReferenceSpec, References};
use super::scenes::SceneSource;
use super::variant_statistics::{Frame, Truth, VariantStatistics, judge_part, region_masks};
use super::{BENCH_CODE, BenchError, BenchProgress, go_on};
use crate::gpu::{GpuContext, ShaderLibrary};
use crate::images::Image;
use crate::renderer::{Eye, FrameResult, MapStats, Renderer};
use crate::scene::Scene;
use crate::settings::{Choice as _, Eyes, Kept, RenderSettings, Settings, registry};
use crate::xr::{
    Headset, Motion, Pose, Recorder, ReplayOptions, ReplaySession, SimulatedSession, View, XrError,
    all_frames,
};

/// Times that a reference's target is set anew as it becomes better.
const PILOTS: u32 = 6;
/// Some of that share is kept back: the smallest error is known only after the rounds.
const PILOT_MARGIN: f64 = 0.7;
/// The head of [`ViewPlan::Jitter`] moves this far each round: the renderer moves the scene, the picture stays.
const JITTER_M: f64 = 1e-6;

/// One way to render, among those of a group.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// Name within the group.
    pub variant: String,
    /// What the renderer takes.
    pub settings: RenderSettings,
    /// What the suite varies here.
    pub factors: BTreeMap<String, Value>,
    /// What of the scene moves between rounds.
    pub motion: InstanceMotion,
}

/// From where a group looks.
#[derive(Clone, Debug, PartialEq)]
pub enum ViewPlan {
    /// The scene's starting pose, in every round.
    Start,
    /// This far ahead of it, metres, along its heading.
    Ahead(f64),
    /// The starting pose, moved by a micrometre per round, so that the host updates the scene as for a moving head.
    Jitter,
    /// One frame per round of a recorded sway that begins there.
    Trace,
}

/// Variants measured in turn.
#[derive(Clone, Debug, PartialEq)]
pub struct GroupPlan {
    /// The suite.
    pub suite: &'static str,
    /// Name, unique in the suite.
    pub name: String,
    /// Scene.
    pub scene: SceneSource,
    /// Headset.
    pub headset: Headset,
    /// The headset in words.
    pub headset_label: String,
    /// Views.
    pub views: ViewPlan,
    /// Pixels per eye.
    pub size: [u32; 2],
    /// Both eyes, or the left one alone.
    pub eyes: Eyes,
    /// The reference's pixel filter; `None`: no reference, the noise between frames is reported alone.
    pub filter: Option<PixelFilter>,
    /// Variants; ratios refer to the first.
    pub candidates: Vec<Candidate>,
    /// Rounds that count.
    pub rounds: u32,
    /// Rounds before them.
    pub warm_up: u32,
}

impl GroupPlan {
    /// Frames of each variant.
    #[must_use]
    pub fn frames(&self) -> u64 {
        u64::from(self.rounds + self.warm_up)
    }
}

/// Seconds that `plans` take without references, roughly: by what `time_s` finds for one variant of each scene, times variants,
/// and for frames times pixels and samples. Scenes that are generated to a size pass for one.
///
/// # Errors
/// The first of `time_s`.
pub(super) fn estimated_s(
    plans: &[GroupPlan],
    mut time_s: impl FnMut(&GroupPlan, &Candidate) -> Result<VariantTime, BenchError>,
) -> Result<f64, BenchError> {
    let samples = |plan: &GroupPlan, candidate: &Candidate| {
        let [width, height] = plan.size.map(f64::from);
        width * height * f64::from(candidate.settings.spp)
    };
    let mut known: Vec<(&SceneSource, VariantTime)> = Vec::new();
    let mut total_s = 0.0;
    for plan in plans {
        let Some(first) = plan.candidates.first() else {
            continue;
        };
        let is_like = |scene: &SceneSource| match (scene, &plan.scene) {
            (SceneSource::Generated(_), SceneSource::Generated(_)) => true,
            (one, other) => one == other,
        };
        let place = match known.iter().position(|(scene, _)| is_like(scene)) {
            Some(place) => place,
            None => {
                let mut found = time_s(plan, first)?;
                found.frame_s /= samples(plan, first);
                known.push((&plan.scene, found));
                known.len() - 1
            }
        };
        let VariantTime { set_up_s, frame_s } = known[place].1;
        for candidate in &plan.candidates {
            let frames_s = frame_s * samples(plan, candidate) * plan.frames() as f64;
            total_s += set_up_s + frames_s;
        }
    }
    Ok(total_s)
}

/// How long a variant takes.
#[derive(Clone, Copy, Debug)]
pub(super) struct VariantTime {
    /// Seconds until its first frame stands.
    pub(super) set_up_s: f64,
    /// Seconds of the next one.
    pub(super) frame_s: f64,
}

/// Takes a variant's time.
///
/// # Errors
/// [`BenchError`].
pub(super) fn variant_time(
    plan: &GroupPlan,
    candidate: &Candidate,
    settings: &Settings,
    library: &ShaderLibrary,
    context: GpuContext,
) -> Result<VariantTime, BenchError> {
    go_on()?;
    let scene = plan.scene.load(settings)?;
    let began = Instant::now();
    let render = &candidate.settings;
    let mut renderer = Renderer::new(context, library, &scene, render, plan.eyes, plan.size)?;
    let views = plan.headset.views_from_head(&scene.start_pose());
    renderer.render_frame(&views, 0, |_| {})?;
    let set_up_s = began.elapsed().as_secs_f64();
    let began = Instant::now();
    renderer.render_frame(&views, 1, |_| {})?;
    Ok(VariantTime {
        set_up_s,
        frame_s: began.elapsed().as_secs_f64(),
    })
}

/// What all groups share.
pub struct Lab<'a> {
    /// Folder of the report.
    pub out: &'a Path,
    /// Settings under those of the suites.
    pub settings: &'a Settings,
    /// The adapter.
    pub machine: Machine,
    /// Shaders.
    pub library: ShaderLibrary,
    /// Finished rows.
    pub journal: Journal,
    /// References.
    pub references: References,
    /// Who is told.
    pub progress: &'a mut dyn BenchProgress,
    /// What it has come by since.
    pub known: Known,
}

/// What a lab remembers from group to group.
#[derive(Default)]
pub struct Known {
    /// Rows that came from the journal.
    pub resumed: usize,
    fingerprints: HashMap<String, String>,
    scene: Option<(SceneSource, Scene)>,
}

impl Lab<'_> {
    /// Measures a group, or takes its rows from the journal if all of them are there.
    ///
    /// # Errors
    /// [`BenchError`].
    pub fn measure(&mut self, plan: &GroupPlan) -> Result<Vec<Row>, BenchError> {
        let keys = self.keys(plan)?;
        if let Some(rows) = self.journal.all(&keys) {
            self.progress.skipped(plan);
            self.known.resumed += rows.len();
            return Ok(rows);
        }
        self.progress.began(plan);
        let rows = self.measure_anew(plan, &keys)?;
        self.journal.append(&rows)?;
        self.progress.finished(plan);
        Ok(rows)
    }

    fn fingerprint(&mut self, source: &SceneSource) -> Result<String, BenchError> {
        let name = source.name();
        if let Some(known) = self.known.fingerprints.get(&name) {
            return Ok(known.clone());
        }
        let found = source.fingerprint(self.settings)?;
        self.known.fingerprints.insert(name, found.clone());
        Ok(found)
    }

    /// All settings of a variant.
    fn settings_of(&self, plan: &GroupPlan, candidate: &Candidate) -> Settings {
        Settings {
            scene: plan.scene.name(),
            size: Some(plan.size),
            render: candidate.settings.clone(),
            ..self.settings.clone()
        }
    }

    /// One key per variant. Each covers the whole group: a variant is measured against the others.
    fn keys(&mut self, plan: &GroupPlan) -> Result<Vec<String>, BenchError> {
        let scene = self.fingerprint(&plan.scene)?;
        let mut group = Fingerprint::default()
            .with_text(BENCH_CODE)
            .with_value(&self.machine)
            .with_text(&scene)
            .with_text(&format!(
                "{} {} {:?} {} {:?} {:?} {:?} {:?} {} {}",
                plan.suite,
                plan.name,
                plan.headset,
                plan.headset_label,
                plan.views,
                plan.size,
                plan.eyes,
                plan.filter,
                plan.rounds,
                plan.warm_up
            ))
            .with_value(&self.references.max_samples());
        for (name, source) in self.library.sources() {
            group = group.with_text(name).with_text(source);
        }
        for candidate in &plan.candidates {
            group = group
                .with_text(&candidate.variant)
                .with_value(&self.settings_of(plan, candidate))
                .with_value(&candidate.factors)
                .with_text(&format!("{:?}", candidate.motion));
        }
        Ok(plan
            .candidates
            .iter()
            .map(|candidate| group.with_text(&candidate.variant).to_string())
            .collect())
    }

    fn views(&self, plan: &GroupPlan, scene: &Scene) -> Result<Vec<[View; 2]>, BenchError> {
        let start = scene.start_pose();
        let still = || plan.headset.views_from_head(&start);
        let total = plan.warm_up + plan.rounds;
        Ok(match plan.views {
            ViewPlan::Start => vec![still(); total as usize],
            ViewPlan::Ahead(metres) => {
                let heading = DQuat::from_rotation_y(start.heading_rad());
                let moved = start.position + heading * DVec3::NEG_Z * metres;
                let head = Pose::new(moved, start.orientation);
                vec![plan.headset.views_from_head(&head); total as usize]
            }
            ViewPlan::Jitter => (0..total)
                .map(|round| {
                    still().map(|mut view| {
                        view.position_in_world.x += JITTER_M * f64::from(round);
                        view
                    })
                })
                .collect(),
            ViewPlan::Trace => {
                let path = trace_path(self.out, plan)?;
                let trace = recorded_sway(&path, plan, start)?;
                let last = trace.last().copied().unwrap_or_else(still);
                // Warm-up looks from where errors are taken: from the last frame.
                let mut views = vec![last; plan.warm_up as usize];
                views.extend(trace);
                views.resize(total as usize, last);
                views
            }
        })
    }

    fn measure_anew(&mut self, plan: &GroupPlan, keys: &[String]) -> Result<Vec<Row>, BenchError> {
        let scene = match self.known.scene.take() {
            Some((source, scene)) if source == plan.scene => scene,
            _ => plan.scene.load(self.settings)?,
        };
        let rows = self.measure_scene(plan, keys, &scene);
        self.known.scene = Some((plan.scene.clone(), scene));
        rows
    }

    fn measure_scene(
        &mut self,
        plan: &GroupPlan,
        keys: &[String],
        scene: &Scene,
    ) -> Result<Vec<Row>, BenchError> {
        let fingerprint = self.fingerprint(&plan.scene)?;
        let views = self.views(plan, scene)?;
        let Some(judged_view) = views.last().copied() else {
            return Ok(Vec::new());
        };
        let mut contenders: Vec<Contender> = plan
            .candidates
            .iter()
            .map(|candidate| {
                let device = self.references.device(self.settings)?;
                Contender::open(plan, candidate, scene, &self.library, device)
            })
            .collect::<Result<_, _>>()?;
        let mut truth = Truth::default();
        if plan.filter.is_some() && plan.eyes == Eyes::Both {
            // The first variant renders each eye by itself, so both eyes' first hits are there.
            let first = &mut contenders[0].renderer;
            first.render_frame(&judged_view, 0, |_| {})?;
            truth.correspondence = correspondence(first, &judged_view, plan.size)?;
        }
        let still = plan.views != ViewPlan::Trace;
        let mut statistics: Vec<VariantStatistics> = Vec::new();
        statistics.resize_with(plan.candidates.len(), VariantStatistics::default);
        interleave(
            plan.candidates.len(),
            plan.warm_up,
            plan.rounds,
            |variant, round| {
                let place = (round.index as usize).min(views.len() - 1);
                let reads = still || !round.counts || round.is_last;
                contenders[variant].frame(plan, scene, &views[place], round, reads)
            },
            |round, frames: Vec<Frame>| {
                self.progress.round(plan, round);
                go_on()?;
                if !round.counts {
                    if round.index + 1 == plan.warm_up {
                        let settled = self.settle(plan, scene, &fingerprint, &judged_view, &frames);
                        truth.references = settled?;
                    }
                    return Ok(());
                }
                for (index, frame) in frames.iter().enumerate() {
                    let variant = &mut statistics[index];
                    variant.time(frame, &plan.candidates[index].settings);
                    if still || round.is_last {
                        variant.judge(frame, &frames[0], &truth, still)?;
                    }
                }
                Ok::<_, BenchError>(())
            },
        )?;
        let first = &statistics[0];
        let rows = statistics
            .iter()
            .zip(plan.candidates.iter().zip(keys))
            .zip(&contenders)
            .map(
                |((own, (candidate, key)), Contender { renderer, .. })| Row {
                    key: key.clone(),
                    suite: plan.suite.to_owned(),
                    group: plan.name.clone(),
                    variant: candidate.variant.clone(),
                    scene: plan.scene.name(),
                    headset: plan.headset_label.clone(),
                    size: plan.size,
                    eyes: plan.eyes.word().to_owned(),
                    factors: candidate.factors.clone(),
                    settings: differing_settings(&self.settings_of(plan, candidate)),
                    timing: own.timing(first, renderer, plan.rounds, plan.warm_up),
                    errors: own.errors(&truth),
                    frame_noise: mean(own.noise()),
                    stereo: own.stereo(first),
                    load: load(scene, renderer, own.last()),
                    machine: self.machine.clone(),
                    version: env!("CARGO_PKG_VERSION").to_owned(),
                    code: BENCH_CODE.to_owned(),
                },
            );
        Ok(rows.collect())
    }

    /// References good enough for the errors of the last warm-up round's frames, or as good as the cap allows.
    fn settle(
        &mut self,
        plan: &GroupPlan,
        scene: &Scene,
        fingerprint: &str,
        views: &[View; 2],
        frames: &[Frame],
    ) -> Result<[Option<Reference>; 2], BenchError> {
        let Some(filter) = plan.filter else {
            return Ok([None, None]);
        };
        let mut found = [None, None];
        for (eye, slot) in found.iter_mut().enumerate() {
            if eye == 1 && plan.eyes != Eyes::Both {
                continue;
            }
            let spec = ReferenceSpec {
                scene,
                scene_fingerprint: fingerprint,
                settings: self.settings,
                view: views[eye],
                size: plan.size,
                filter,
            };
            let mut target = f64::INFINITY;
            let mut reference = self.reference(plan, &spec, target)?;
            for _ in 0..PILOTS {
                let smallest = smallest_error(frames, eye, &reference)?;
                let wanted = (PILOT_MARGIN * REFERENCE_SHARE).powi(2) * smallest;
                let settled = reference
                    .moments
                    .relative_variance_of_mean(None)
                    .is_some_and(|variance| variance <= wanted);
                // `>=`: a target that does not fall asks for nothing new.
                if settled || reference.capped || wanted >= target {
                    break;
                }
                target = wanted;
                reference = self.reference(plan, &spec, target)?;
            }
            *slot = Some(reference);
        }
        Ok(found)
    }

    fn reference(
        &mut self,
        plan: &GroupPlan,
        spec: &ReferenceSpec<'_>,
        target: f64,
    ) -> Result<Reference, BenchError> {
        let progress = &mut *self.progress;
        self.references.get(spec, target, &mut |done, most| {
            progress.reference(plan, done, most)
        })
    }
}

/// The smallest relative MSE of this eye among the frames, the reference's own part taken out.
fn smallest_error(frames: &[Frame], eye: usize, reference: &Reference) -> Result<f64, BenchError> {
    let truth = reference.moments.mean_image();
    let mut smallest = f64::INFINITY;
    for frame in frames {
        let Some(image) = &frame.images[eye] else {
            continue;
        };
        let masks = region_masks(frame, eye, [truth.width, truth.height]);
        for mask in std::iter::once(None).chain(masks.iter().map(|(_, mask)| Some(mask))) {
            let own = reference
                .moments
                .relative_variance_of_mean(mask)
                .unwrap_or(0.0);
            if let Some(error) = judge_part(image, &truth, mask)?.and_then(|c| c.rel_mse) {
                // What is left may be all noise; never less than a quarter of what was seen.
                smallest = smallest.min((error - own).max(0.25 * error));
            }
        }
    }
    Ok(smallest)
}

/// The head that sways in every suite, from `start` on.
pub(super) fn swaying(headset: &Headset, start: Pose, frames: u32) -> SimulatedSession {
    let frames = Some(u64::from(frames));
    SimulatedSession::new(headset.clone(), Motion::Sway, start, frames).with_seed(1)
}

/// Records a swaying head as a native trace and returns the views as the replay gives them.
fn recorded_sway(path: &Path, plan: &GroupPlan, start: Pose) -> Result<Vec<[View; 2]>, XrError> {
    let sway = Box::new(swaying(&plan.headset, start, plan.rounds));
    all_frames(&mut Recorder::create(path, sway)?, usize::MAX)?;
    let options = ReplayOptions::new(plan.headset.clone(), start);
    let replayed = all_frames(&mut ReplaySession::open(path, options)?, usize::MAX)?;
    Ok(replayed.into_iter().map(|(_, views)| views).collect())
}

/// Settings that differ from the defaults, by dotted key.
pub(super) fn differing_settings(settings: &Settings) -> BTreeMap<String, Value> {
    registry::all()
        .map(|setting| (setting, setting.value(settings)))
        .filter(|(setting, value)| *value != setting.default_value())
        .map(|(setting, value)| (setting.key.to_owned(), value))
        .collect()
}

/// Where a group's recorded trace lies; its folder is made.
fn trace_path(out: &Path, plan: &GroupPlan) -> Result<PathBuf, BenchError> {
    let folder = out.join("traces");
    std::fs::create_dir_all(&folder).map_err(|error| ReportError::file(&folder, error))?;
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '-' };
    let name: String = plan.name.chars().map(plain).collect();
    Ok(folder.join(format!("{name}.jsonl")))
}

fn correspondence(
    renderer: &Renderer,
    views: &[View; 2],
    size: [u32; 2],
) -> Result<Option<Image<Option<u32>>>, BenchError> {
    let hits = |eye| renderer.read_hit_rays(eye);
    Ok(hits(Eye::Left)?
        .zip(hits(Eye::Right)?)
        .map(|(left, right)| {
            let places = left_from_right(views, size, &left, &right);
            let pixels = places.pixels.iter();
            places.like(pixels.map(|to| to.map(|to| pixel_at(to, size[0]))))
        }))
}

/// A variant with its renderer.
struct Contender {
    renderer: Renderer,
    mover: InstanceMover,
}

impl Contender {
    fn open(
        plan: &GroupPlan,
        candidate: &Candidate,
        scene: &Scene,
        library: &ShaderLibrary,
        context: GpuContext,
    ) -> Result<Self, BenchError> {
        let mut settings = candidate.settings.clone();
        settings.output.kept = Kept::Depth;
        Ok(Self {
            renderer: Renderer::new(context, library, scene, &settings, plan.eyes, plan.size)?,
            mover: InstanceMover::new(scene, candidate.motion),
        })
    }

    /// Renders a frame and, if `reads`, its images; reading is not timed.
    fn frame(
        &mut self,
        plan: &GroupPlan,
        scene: &Scene,
        views: &[View; 2],
        round: Round,
        reads: bool,
    ) -> Result<Frame, BenchError> {
        let renderer = &mut self.renderer;
        let moved_ms = self.mover.step(renderer, scene, round.index)?;
        let began = Instant::now();
        let mut result = renderer.render_frame(views, round.index, |_| {})?;
        let host_ms = moved_ms + crate::gpu::timing::milliseconds_since(began);
        result.cpu_ms.update += moved_ms;
        let mut images = [None, None];
        let mut provenance = None;
        if reads {
            for (eye, image) in [Eye::Left, Eye::Right].into_iter().zip(&mut images) {
                *image = renderer
                    .read_radiance(eye)?
                    .map(|pixels| Image::new(plan.size[0], plan.size[1], pixels))
                    .transpose()?;
            }
            provenance = renderer.read_provenance()?;
        }
        Ok(Frame {
            result,
            host_ms,
            images,
            provenance,
        })
    }
}

fn load(scene: &Scene, renderer: &Renderer, last: &FrameResult) -> Load {
    let photons = last.photons;
    let maps = [Some(photons.map), photons.caustics];
    let sum = |pick: fn(&MapStats) -> u32| -> u64 {
        maps.iter().flatten().map(|map| u64::from(pick(map))).sum()
    };
    Load {
        triangles: scene.triangle_count() as u64,
        instances: scene.instances().len() as u64,
        lights: renderer.scene().light_count() as u64,
        upload_bytes: renderer.scene().upload_bytes(),
        photon_paths: sum(|map| map.emitted),
        photons_stored: sum(|map| map.stored),
        photons_dropped: sum(|map| map.dropped),
        radius_m: renderer.photon_map().map(|_| renderer.radius_m()),
    }
}

#[cfg(test)]
mod tests;
