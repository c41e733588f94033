//! Runs a plan: compiles its passes, allocates and binds their buffers, and records stages.

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;

use super::bind::{Buffers, Meaning, Place, Use, meaning};
use super::buffers::ImageLayout;
use super::homes::{moments, note_the_rest};
use super::passes::{Domain, Pass, background, inspect_surfaces, photon_edges, scatter_depth};
use super::photon_layout::MapLayout;
use super::step::{Action, Only, PlannedStage, Size, Stage, Step, Words};
use super::work::{Dispatched, Traffic, WorkLog, traffic};
use crate::gpu::features::ShaderFeatures;
use crate::gpu::kernel::{Binding, BindingKind, DISPATCH_BINDING, DispatchTable, linear_groups};
use crate::gpu::raster::Raster;
use crate::gpu::{
    FrameRecorder, GpuContext, GpuError, Kernel, PassTimes, Resources, ShaderLibrary, Workgroups,
};

/// Samples per submission; the dispatch table numbers them.
pub const SAMPLES_PER_SUBMISSION: u32 = 64;

/// Features that `pass` is compiled with in a frame of `features`. Passes over hits always run over a list, those over tiles where
/// their step does.
#[must_use]
pub fn specialised(pass: &Pass, features: &ShaderFeatures, from_list: bool) -> ShaderFeatures {
    let shared = if pass.sees_scene {
        *features
    } else {
        ShaderFeatures {
            // Photons are read by others too.
            record_texels: features.record_texels,
            wide_machine: features.wide_machine,
            passthrough: features.passthrough,
            ..ShaderFeatures::default()
        }
    };
    ShaderFeatures {
        from_list: pass.over == Domain::Hits,
        from_tiles: pass.over == Domain::SeenTiles && from_list,
        inspects: *pass == inspect_surfaces,
        // The share of a photon's disc that lies on surfaces, and what may be on the way from a hit to the other eye.
        meets_blended: shared.alpha && [photon_edges, scatter_depth].contains(pass),
        // No other pass asks, nor is compiled anew for it.
        anti_aliased: shared.anti_aliased && *pass == background,
        ..shared
    }
}

type KernelKey = (String, ShaderFeatures);

/// Workgroups of a bound dispatch.
enum Groups {
    Direct([u32; 3]),
    /// Counted on the device: at a byte offset; and at another those of one thread per entry.
    Indirect(wgpu::Buffer, [u64; 2]),
}

enum BoundAction {
    Dispatch {
        kernel: KernelKey,
        /// By parity of the frame; one if nothing is double-buffered.
        bound: Vec<wgpu::BindGroup>,
        groups: Groups,
        /// Which of the stage's words.
        pattern: u32,
        /// Bytes that it is bound to.
        traffic: Traffic,
    },
    /// Buffers and how many bytes of each.
    Clear(Vec<(wgpu::Buffer, u64)>),
    /// From, to in frames of either parity, and how many bytes.
    Copy([[wgpu::Buffer; 2]; 2], u64),
    CopyTexels(Meaning),
}

struct BoundStep {
    label: String,
    only: Only,
    action: BoundAction,
}

/// A bound stage.
struct BoundStage {
    steps: Vec<BoundStep>,
    patterns: u32,
    /// Number of the table's last entry, of zeroes.
    empty: u32,
}

/// Parameters of one run of a stage.
#[derive(Clone, Copy)]
pub struct Play<'a> {
    /// Number of the sample within the submission.
    pub sample: u32,
    /// Parity of the frame, 0 or 1.
    pub parity: usize,
    /// Whether a conditional step runs.
    pub is_due: &'a dyn Fn(Only) -> bool,
}

impl Default for Play<'_> {
    fn default() -> Self {
        Self {
            sample: 0,
            parity: 0,
            is_due: &|_| true,
        }
    }
}

/// Runs a plan.
#[derive(Default)]
pub struct FrameRun {
    features: ShaderFeatures,
    kernels: BTreeMap<KernelKey, Kernel>,
    /// The frame's buffers.
    pub buffers: Buffers,
    stages: BTreeMap<Stage, BoundStage>,
    /// The stages' dispatch tables, also of stages that are not in the plan now.
    tables: BTreeMap<Stage, DispatchTable>,
    /// What dispatches did, where that is counted.
    work: Option<WorkLog>,
}

impl FrameRun {
    /// A run without compiled passes; shaders will be specialised by `features`.
    #[must_use]
    pub fn new(features: ShaderFeatures) -> Self {
        Self {
            features,
            ..Self::default()
        }
    }

    /// What shaders are specialised by.
    #[must_use]
    pub fn features(&self) -> &ShaderFeatures {
        &self.features
    }

    /// Names of all compiled passes.
    #[must_use]
    pub fn pass_names(&self) -> Vec<String> {
        let mut names = BTreeSet::new();
        let stages = self
            .stages
            .iter()
            .filter(|(stage, _)| **stage != Stage::Inspect);
        for step in stages.flat_map(|(_, stage)| &stage.steps) {
            if let BoundAction::Dispatch { kernel, .. } = &step.action {
                names.insert(kernel.0.clone());
            }
        }
        names.into_iter().collect()
    }

    fn key(&self, step: &Step, pass: &Pass) -> KernelKey {
        let features = specialised(pass, &self.features, step.runs_from_list());
        (pass.name.to_string(), features)
    }

    /// Compiles the passes of all `steps` that are not compiled yet, side by side.
    ///
    /// # Errors
    /// [`GpuError::Shader`] or [`GpuError::Validation`], naming the first pass that fails.
    pub fn compile<'s>(
        &mut self,
        context: &GpuContext,
        library: &ShaderLibrary,
        steps: impl IntoIterator<Item = &'s Step>,
    ) -> Result<(), GpuError> {
        let mut missing = BTreeMap::new();
        for step in steps {
            let Some(pass) = step.pass() else { continue };
            let key = self.key(step, pass);
            if !self.kernels.contains_key(&key) {
                missing.insert(key, pass.shader_name());
            }
        }
        let compiled: Vec<Result<_, GpuError>> = missing
            .into_par_iter()
            .map(|(key, shader)| {
                let kernel = Kernel::new(context, library, &shader, &key.1)?;
                Ok((key, kernel))
            })
            .collect();
        for kernel in compiled {
            self.kernels.extend([kernel?]);
        }
        context.store_pipelines();
        Ok(())
    }

    fn kernel(&self, key: &KernelKey) -> Result<&Kernel, GpuError> {
        self.kernels.get(key).ok_or_else(|| GpuError::Unbound {
            pass: key.0.clone(),
            binding: "any (the pass was not compiled for this frame)".to_owned(),
        })
    }

    /// Allocates the buffers of `stages`, as far as they are not there yet.
    ///
    /// # Errors
    /// As [`FrameRun::bind`].
    pub fn allocate(
        &mut self,
        context: &GpuContext,
        stages: &[PlannedStage],
        given: &Resources<'_>,
        image: &ImageLayout,
        maps: &[MapLayout],
    ) -> Result<(), GpuError> {
        let mut uses = BTreeMap::new();
        for (at, step) in moments(stages) {
            if let Some(pass) = step.pass() {
                let kernel = self.kernel(&self.key(step, pass))?;
                note_uses(step, at, &kernel.interface.bindings, given, &mut uses);
            }
        }
        note_the_rest(stages, &mut uses);
        self.buffers.allocate(context, &uses, image, maps)
    }

    /// Allocates what the passes of `stages` still lack and binds them: they are the plan then; `given` holds resources from
    /// outside the frame. What earlier plans had stays allocated.
    ///
    /// # Errors
    /// [`GpuError`], naming pass and binding, or a buffer that does not fit.
    pub fn bind(
        &mut self,
        context: &GpuContext,
        stages: &[PlannedStage],
        given: &Resources<'_>,
        image: &ImageLayout,
        maps: &[MapLayout],
    ) -> Result<(), GpuError> {
        self.allocate(context, stages, given, image, maps)?;
        if self.features.counts_work && self.work.is_none() {
            self.work = Some(WorkLog::new(context)?);
        }
        let mut bound = BTreeMap::new();
        for planned in stages
            .iter()
            .filter(|planned| planned.stage != Stage::After)
        {
            let stage = self.bind_stage(context, planned, given, image)?;
            bound.insert(planned.stage, stage);
        }
        self.stages = bound;
        Ok(())
    }

    /// Binds a render pass of `step` for both parities. Buffers that nothing writes get a token.
    ///
    /// # Errors
    /// As [`FrameRun::bind`].
    pub fn bind_raster(
        &mut self,
        context: &GpuContext,
        raster: &Raster,
        step: &Step,
        given: &Resources<'_>,
    ) -> Result<[wgpu::BindGroup; 2], GpuError> {
        let mut uses = BTreeMap::new();
        note_uses(step, 0, &raster.interface.bindings, given, &mut uses);
        self.buffers.give_tokens(context, uses.keys())?;
        let bind = |parity| {
            raster.interface.bind_by(context, |binding| {
                self.resource(step, binding, given, parity)
            })
        };
        Ok([bind(0)?, bind(1)?])
    }

    fn bind_stage(
        &mut self,
        context: &GpuContext,
        planned: &PlannedStage,
        given: &Resources<'_>,
        image: &ImageLayout,
    ) -> Result<BoundStage, GpuError> {
        let mut patterns: Vec<Words> = Vec::new();
        for step in &planned.steps {
            if let Action::Run { words, .. } = &step.action
                && !patterns.contains(words)
            {
                patterns.push(*words);
            }
        }
        let entries = table_entries(planned, &patterns);
        let empty = entries.len() as u32 - 1;
        let before = self.tables.remove(&planned.stage);
        let table = DispatchTable::holding(context, planned.stage.name(), entries, before);
        let buffer = table.buffer.clone();
        self.tables.insert(planned.stage, table);
        let given = given.clone().with(DISPATCH_BINDING, &buffer);
        let bind = |step: &Step| {
            let action = self.bind_action(context, step, &given, image, &patterns)?;
            Ok(BoundStep {
                label: step.label.clone(),
                only: step.only,
                action,
            })
        };
        let steps = planned.steps.iter().map(bind);
        Ok(BoundStage {
            steps: steps.collect::<Result<Vec<_>, GpuError>>()?,
            patterns: patterns.len() as u32,
            empty,
        })
    }

    fn bind_action(
        &self,
        context: &GpuContext,
        step: &Step,
        given: &Resources<'_>,
        image: &ImageLayout,
        patterns: &[Words],
    ) -> Result<BoundAction, GpuError> {
        let buffer = |name: &str| self.buffer(name, step, given, 0);
        Ok(match &step.action {
            Action::Clear(moment) => {
                let cleared = self.buffers.cleared(*moment, step.owner);
                BoundAction::Clear(cleared.collect())
            }
            // Nothing runs.
            Action::Keep(_) => BoundAction::Clear(Vec::new()),
            Action::Copy { from, to } => {
                let bytes = match meaning(from, step.owner) {
                    Some(found) => self.buffers.bytes_of(&found.place),
                    None => buffer(from)?.size(),
                };
                let of = |name, parity| self.buffer(name, step, given, parity);
                let [even, odd] = [0, 1].map(|parity| Ok([of(from, parity)?, of(to, parity)?]));
                BoundAction::Copy([even?, odd?], bytes)
            }
            Action::CopyTexels(name) => {
                let found = meaning(name, step.owner).ok_or_else(|| unbound(step, name))?;
                BoundAction::CopyTexels(found)
            }
            Action::Run {
                pass, size, words, ..
            } => {
                let key = self.key(step, pass);
                let kernel = self.kernel(&key)?;
                let groups = match *size {
                    Size::Once | Size::Fragments => Groups::Direct([1, 1, 1]),
                    Size::Groups(count) => Groups::Direct(linear_groups(count, 1)),
                    Size::Threads(count) => Groups::Direct(kernel.groups_for(count)),
                    Size::Tiles => {
                        let [width, height] = image.tiles();
                        Groups::Direct([width, height, 1])
                    }
                    Size::List(list) | Size::Runs(list) => Groups::Indirect(
                        buffer(&format!("{}_groups", list.0))?,
                        [if matches!(size, Size::Runs(_)) { 16 } else { 0 }, 0],
                    ),
                    Size::Indirect(name, offset) => Groups::Indirect(buffer(name)?, [offset; 2]),
                };
                let pattern = patterns.iter().position(|other| other == words);
                BoundAction::Dispatch {
                    bound: self.bind_pass(context, step, kernel, given)?,
                    traffic: match self.work {
                        Some(_) => traffic(step, kernel, given, &self.buffers),
                        None => Traffic::default(),
                    },
                    kernel: key,
                    groups,
                    pattern: pattern.unwrap_or(0) as u32,
                }
            }
        })
    }

    fn buffer(
        &self,
        name: &str,
        step: &Step,
        given: &Resources<'_>,
        parity: usize,
    ) -> Result<wgpu::Buffer, GpuError> {
        if let Some(wgpu::BindingResource::Buffer(binding)) = given.get(name) {
            return Ok(binding.buffer.clone());
        }
        let found = meaning(name, step.owner);
        let buffer = found.and_then(|found| self.buffers.get(&found, parity));
        buffer.cloned().ok_or_else(|| unbound(step, name))
    }

    /// Binds a pass for both parities, or once if nothing is double-buffered.
    fn bind_pass(
        &self,
        context: &GpuContext,
        step: &Step,
        kernel: &Kernel,
        given: &Resources<'_>,
    ) -> Result<Vec<wgpu::BindGroup>, GpuError> {
        let takes_turns = kernel.interface.bindings.iter().any(|binding| {
            let found = meaning(&named(step, &binding.name), step.owner);
            found.is_some_and(|found| self.buffers.takes_turns(&found.place))
        });
        (0..if takes_turns { 2 } else { 1 })
            .map(|parity| {
                kernel.interface.bind_by(context, |binding| {
                    self.resource(step, binding, given, parity)
                })
            })
            .collect()
    }

    /// Resolves a binding of a step's shader in frames of `parity`.
    pub fn resource<'a>(
        &'a self,
        step: &Step,
        binding: &Binding,
        given: &Resources<'a>,
        parity: usize,
    ) -> Option<wgpu::BindingResource<'a>> {
        let name = named(step, &binding.name);
        if let Some(resource) = given.get(&name) {
            return Some(resource);
        }
        let found = meaning(&name, step.owner)?;
        if binding.kind == BindingKind::Texels {
            let view = self.buffers.texels(&found)?.view()?;
            return Some(wgpu::BindingResource::TextureView(view));
        }
        self.buffers.bound(&found, parity)
    }

    /// Whether the plan has the stage.
    #[must_use]
    pub fn has(&self, stage: Stage) -> bool {
        self.stages.contains_key(&stage)
    }

    /// Upper bound on a stage's dispatches.
    #[must_use]
    pub fn length(&self, stage: Stage) -> usize {
        self.stages.get(&stage).map_or(0, |stage| stage.steps.len())
    }

    /// Records a stage, if the plan has it.
    ///
    /// # Errors
    /// [`GpuError::Unbound`] if a pass was not compiled.
    pub fn play(
        &self,
        recorder: &mut FrameRecorder<'_>,
        stage: Stage,
        how: &Play<'_>,
    ) -> Result<(), GpuError> {
        let Some(bound) = self.stages.get(&stage) else {
            return Ok(());
        };
        let first = if stage.is_per_sample() {
            how.sample * bound.patterns
        } else {
            0
        };
        for step in bound.steps.iter().filter(|step| (how.is_due)(step.only)) {
            match &step.action {
                BoundAction::Clear(buffers) => {
                    for (buffer, bytes) in buffers {
                        recorder.clear(buffer, *bytes);
                    }
                }
                BoundAction::Copy(turns, bytes) => {
                    let [from, to] = &turns[how.parity];
                    recorder.copy((from, 0), (to, 0), *bytes);
                }
                BoundAction::CopyTexels(found) => {
                    let parts = self.buffers.get(found, 0).zip(self.buffers.texels(found));
                    if let Some((buffer, texels)) = parts {
                        let bytes = self.buffers.bytes_of(&found.place);
                        recorder.copy_to_texels(&step.label, buffer, bytes, texels);
                    }
                }
                BoundAction::Dispatch {
                    kernel,
                    bound,
                    groups,
                    pattern,
                    traffic,
                } => {
                    let kernel = self.kernel(kernel)?;
                    let bound = &bound[how.parity % bound.len()];
                    let entry = first + pattern;
                    let [run, noted] = match groups {
                        Groups::Direct(groups) => [Workgroups::Direct(*groups); 2],
                        Groups::Indirect(counted, places) => {
                            places.map(|at| Workgroups::Indirect(counted, at))
                        }
                    };
                    recorder.dispatch(&step.label, kernel, bound, entry, run);
                    if let Some(log) = &self.work {
                        let who = (step.label.as_str(), kernel, *traffic);
                        log.note(recorder, &self.buffers, who, noted);
                    }
                }
            }
        }
        Ok(())
    }

    /// What the dispatches since the last call did, in their order; nothing unless `output.work` is on. Waits for the device.
    ///
    /// # Errors
    /// As [`crate::gpu::buffers::read_buffer`].
    pub fn take_work(&self, context: &GpuContext) -> Result<Vec<Dispatched>, GpuError> {
        let log = self.work.as_ref();
        log.map_or(Ok(Vec::new()), |log| log.take(context))
    }

    /// Runs every compiled pass once over nothing: some drivers compile a shader only when it is first dispatched. The frame
    /// uniform must say that images have no pixels. Waits for each, so that another renderer's frames on this device wait for
    /// one shader at most.
    ///
    /// # Errors
    /// As [`FrameRun::play`].
    pub fn warm_up(&self, context: &GpuContext) -> Result<(), GpuError> {
        let mut warm: Vec<&KernelKey> = Vec::new();
        for stage in self.stages.values() {
            for step in &stage.steps {
                let BoundAction::Dispatch { kernel, bound, .. } = &step.action else {
                    continue;
                };
                if !warm.contains(&kernel) {
                    warm.push(kernel);
                    let one = Workgroups::Direct([1, 1, 1]);
                    let mut recorder = FrameRecorder::new(context, None, "warm-up");
                    recorder.dispatch(&kernel.0, self.kernel(kernel)?, &bound[0], stage.empty, one);
                    recorder.submit("warm-up", &mut PassTimes::default())?;
                }
            }
        }
        Ok(())
    }
}

/// The name of a binding in a step, by rules 1 and 3 of [`super::bind`].
pub fn named(step: &Step, binding: &str) -> String {
    let Action::Run {
        names,
        list,
        appends,
        ..
    } = &step.action
    else {
        return binding.to_owned();
    };
    let renamed = names.iter().rev().find(|(shader, _)| *shader == binding);
    if let Some((_, buffer)) = renamed {
        return (*buffer).to_owned();
    }
    let (list, part) = match binding {
        "pixel_list" => (list, "list"),
        "pixel_count" => (list, "count"),
        "list_groups" => (list, "groups"),
        "appended_list" => (appends, "list"),
        "appended_count" => (appends, "count"),
        _ => return binding.to_owned(),
    };
    list.map_or_else(|| binding.to_owned(), |list| format!("{}_{part}", list.0))
}

/// Notes how a pass at moment `at` uses which buffers; passes come in order.
pub fn note_uses(
    step: &Step,
    at: u32,
    bindings: &[Binding],
    given: &Resources<'_>,
    uses: &mut BTreeMap<Place, Use>,
) {
    for binding in bindings {
        let name = named(step, &binding.name);
        if given.get(&name).is_some() {
            continue;
        }
        if let Some(found) = meaning(&name, step.owner) {
            let usage = uses.entry(found.place).or_default();
            usage.add(binding.kind, found.is_before, at);
        }
    }
}

fn unbound(step: &Step, name: &str) -> GpuError {
    GpuError::Unbound {
        pass: step.label.clone(),
        binding: name.to_owned(),
    }
}

/// A stage's dispatch table: its words for each sample of a submission, or once. The last entry is of zeroes.
fn table_entries(planned: &PlannedStage, patterns: &[Words]) -> Vec<[u32; 4]> {
    let mut entries = Vec::new();
    if planned.stage.is_per_sample() {
        for sample in 0..SAMPLES_PER_SUBMISSION {
            let of_sample = |words: &Words| [sample, words.eye, words.count, words.of];
            entries.extend(patterns.iter().map(of_sample));
        }
    } else {
        let as_is = |words: &Words| [words.index, words.eye, words.count, words.of];
        entries.extend(patterns.iter().map(as_is));
    }
    entries.push([0; 4]);
    entries
}
