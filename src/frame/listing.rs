//! The plan as `info --scene` prints it.

use serde::Serialize;

use super::bind::{Whose, meaning};
use super::run::{named, specialised};
use super::step::{PlannedStage, Step};
use crate::gpu::kernel::{BindingKind, reflect_bindings};
use crate::gpu::{GpuError, ShaderFeatures, ShaderLibrary};

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
        let Some(found) = meaning(&named(step, &binding.name), step.owner) else {
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
