//! The plan as `info --scene` prints it.

use serde::Serialize;

use std::collections::BTreeMap;

use super::bind::{BytesHeld, Place, Use, Whose, label, label_in_turn, meaning};
use super::buffers::ImageLayout;
use super::homes::{moments, note_the_rest};
use super::photon_layout::MapLayout;
use super::run::{named, note_uses, specialised};
use super::step::{PlannedStage, Step};
use crate::gpu::kernel::{BindingKind, reflect_bindings};
use crate::gpu::{GpuError, Resources, ShaderFeatures, ShaderLibrary};

/// A stage of the frame.
#[derive(Debug, Clone, Serialize)]
pub struct ListedStage {
    /// Name; labels of its passes may begin with it.
    pub stage: &'static str,
    /// How often.
    pub when: &'static str,
    /// Passes in order.
    pub passes: Vec<ListedPass>,
}

/// One pass of a stage.
#[derive(Debug, Clone, Serialize)]
pub struct ListedPass {
    /// Name of pass and shader.
    pub pass: String,
    /// Name in timings.
    pub label: String,
    /// One sentence.
    pub what: String,
    /// The frame's buffers that it only reads.
    pub reads: Vec<String>,
    /// The frame's buffers that it writes.
    pub writes: Vec<String>,
    /// Those of `reads` that hold the previous frame's data.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub keeps: Vec<String>,
}

/// Memory that a frame's buffers take on the device, bytes; what the scene itself takes comes on top.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Memory {
    /// Width and height of an eye's image, pixels.
    pub size: [u32; 2],
    /// All of it.
    pub total_bytes: u64,
    /// Both eyes' own buffers.
    pub eyes_bytes: u64,
    /// What both eyes use, and memory that images use in turn.
    pub shared_bytes: u64,
    /// Photon maps.
    pub photons_bytes: u64,
    /// The largest buffers.
    pub largest: Vec<HeldBuffer>,
}

/// A buffer and its bytes.
#[derive(Debug, Clone, Serialize)]
pub struct HeldBuffer {
    /// Owner and name.
    pub buffer: String,
    /// Bytes.
    pub bytes: u64,
}

/// Counts the memory of the buffers of several plans without allocating it.
///
/// # Errors
/// As [`list`].
pub fn memory<'a>(
    plans: impl IntoIterator<Item = &'a Vec<PlannedStage>>,
    features: &ShaderFeatures,
    library: &ShaderLibrary,
    size: [u32; 2],
    maps: &[MapLayout],
) -> Result<Memory, GpuError> {
    /// How many of the largest buffers are named.
    const NAMED: usize = 10;
    let image = ImageLayout {
        size,
        ..ImageLayout::default()
    };
    let mut held = BytesHeld::default();
    for stages in plans {
        held.add(&uses(stages, features, library)?, &image, maps);
    }
    let turns: u64 = held.in_turn.iter().sum();
    let mut memory = Memory {
        size,
        total_bytes: turns,
        shared_bytes: turns,
        ..Memory::default()
    };
    for ((whose, _), bytes) in &held.own {
        let part = match whose {
            Whose::Eye(_) => &mut memory.eyes_bytes,
            Whose::Frame => &mut memory.shared_bytes,
            Whose::Map(_) | Whose::Batch(..) => &mut memory.photons_bytes,
        };
        *part += bytes;
        memory.total_bytes += bytes;
    }
    let own = held.own.into_iter();
    let own = own.map(|(place, bytes)| (label(place), bytes));
    let in_turn = (0..).map(label_in_turn).zip(held.in_turn);
    let mut largest: Vec<_> = own.chain(in_turn).collect();
    largest.sort_by_key(|(_, bytes)| std::cmp::Reverse(*bytes));
    let named = largest.into_iter().take(NAMED);
    memory.largest = named
        .map(|(buffer, bytes)| HeldBuffer { buffer, bytes })
        .collect();
    Ok(memory)
}

/// How the passes of `stages` use which buffers.
///
/// # Errors
/// As [`list`].
pub fn uses(
    stages: &[PlannedStage],
    features: &ShaderFeatures,
    library: &ShaderLibrary,
) -> Result<BTreeMap<Place, Use>, GpuError> {
    let mut uses = BTreeMap::new();
    for (at, step) in moments(stages) {
        let Some(pass) = step.pass() else { continue };
        let features = specialised(pass, features, step.runs_from_list());
        let shader = library.compile(&pass.shader_name(), &features)?;
        let given = Resources::default();
        note_uses(step, at, &reflect_bindings(&shader)?, &given, &mut uses);
    }
    note_the_rest(stages, &mut uses);
    Ok(uses)
}

/// Lists `stages`, whose shaders are specialised by `features`.
///
/// # Errors
/// [`GpuError::Shader`], naming a shader that does not compile.
pub fn list(
    stages: &[PlannedStage],
    features: &ShaderFeatures,
    library: &ShaderLibrary,
) -> Result<Vec<ListedStage>, GpuError> {
    let list_stage = |planned: &PlannedStage| {
        let passes = planned.steps.iter();
        let passes = passes.filter_map(|step| listed(step, features, library).transpose());
        Ok(ListedStage {
            stage: planned.stage.name(),
            when: planned.when,
            passes: passes.collect::<Result<_, GpuError>>()?,
        })
    };
    stages.iter().map(list_stage).collect()
}

fn listed(
    step: &Step,
    features: &ShaderFeatures,
    library: &ShaderLibrary,
) -> Result<Option<ListedPass>, GpuError> {
    let Some(pass) = step.pass() else {
        return Ok(None);
    };
    let features = specialised(pass, features, step.runs_from_list());
    let shader = library.compile(&pass.shader_name(), &features)?;
    let (mut reads, mut writes, mut keeps) = (Vec::new(), Vec::new(), Vec::new());
    for binding in reflect_bindings(&shader)? {
        let declared = named(step, &binding.name);
        let Some(found) = meaning(&declared, step.owner) else {
            continue;
        };
        let name = match found.place {
            (Whose::Eye(eye), name) if eye != step.owner.eye => format!("{}_{name}", eye.name()),
            (_, name) => name.to_owned(),
        };
        if found.is_before {
            keeps.push(name.clone());
        }
        if binding.kind == BindingKind::ReadWrite {
            writes.push(name);
        } else {
            reads.push(name);
        }
    }
    Ok(Some(ListedPass {
        pass: pass.name.to_string(),
        label: step.label.clone(),
        what: pass.what.to_string(),
        reads,
        writes,
        keeps,
    }))
}
