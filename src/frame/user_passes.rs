//! User passes: a WESL file and a few lines of TOML add a pass to the frame:
//!
//! ```toml
//! [[pass]]
//! file = "outline.wesl"   # beside the config file
//! name = "outline"
//! after = "remodulate"    # a pass of an eye or of reconstruction, or another user pass
//! over = "pixels"         # or "hits": the pixels of the eye that see a surface
//! ```
//!
//! The file has one entry point, `main`, and declares the buffers of [`super::buffers`] that it reads and writes by their
//! names, which resolve as in the pass that it follows. It runs for each eye in which that pass runs, over the whole image.
//! docs/architecture.md has the details.

use std::collections::BTreeSet;
use std::path::Path;

use super::bind::meaning;
use super::passes::{self, Domain, Pass};
use super::run::{named, specialised};
use super::step::{Action, Eye, List, PlannedStage, Size, Stage, Step};
use crate::files;
use crate::gpu::kernel::{BindingKind, reflect_bindings};
use crate::gpu::{GpuError, ShaderFeatures, ShaderLibrary};
use crate::printable::did_you_mean;
use crate::settings::{UserDomain, UserPass};

/// The pass of a user's entry.
fn pass_of(user_pass: &UserPass) -> Pass {
    Pass {
        name: user_pass.name.clone().into(),
        what: format!("A pass of the user's: {}.", user_pass.file.display()).into(),
        over: match user_pass.over {
            UserDomain::Pixels => Domain::Step,
            UserDomain::Hits => Domain::Hits,
        },
        sees_scene: true,
    }
}

/// A fault of a pass, in one line.
fn fault(user_pass: &UserPass, reason: impl std::fmt::Display) -> GpuError {
    GpuError::UserPass(format!(
        "pass {:?} ({}): {reason}",
        user_pass.name,
        user_pass.file.display()
    ))
}

/// The embedded shaders, or those of `folder` unless it is empty, with the user passes read from their files.
///
/// # Errors
/// [`GpuError::UserPass`], naming file or pass: unreadable, name invalid or taken, or order impossible.
/// [`GpuError::Shader`] if a file of the folder cannot be read.
pub fn shader_library(folder: &str, user_passes: &[UserPass]) -> Result<ShaderLibrary, GpuError> {
    let mut library = match folder {
        "" => ShaderLibrary::embedded(),
        folder => ShaderLibrary::with_folder(folder.as_ref())?,
    };
    let is_name = |name: &str| {
        let is_letter = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
        name.starts_with(|c: char| c.is_ascii_lowercase()) && name.chars().all(is_letter)
    };
    for pass in ordered(user_passes)? {
        if !is_name(&pass.name) {
            return Err(fault(
                pass,
                "a name is made of small letters, digits and underscores, and begins with a letter",
            ));
        }
        let source = read_source(&pass.file)
            .map_err(|reason| fault(pass, format_args!("cannot be read: {reason}")))?;
        library.insert(&pass_of(pass).shader_name(), source);
    }
    Ok(library)
}

fn read_source(path: &Path) -> Result<String, String> {
    /// Longest shader that is read, bytes.
    const MOST_BYTES: u64 = 1 << 20;
    let bytes = files::read_at_most(path, MOST_BYTES)?
        .ok_or_else(|| format!("it is longer than {MOST_BYTES} bytes"))?;
    String::from_utf8(bytes).map_err(|error| error.to_string())
}

/// The passes, each after the one that it follows.
fn ordered(user_passes: &[UserPass]) -> Result<Vec<&UserPass>, GpuError> {
    let is_own = |name: &str| passes::ALL.iter().any(|pass| pass.name == name);
    let mut names = BTreeSet::new();
    for pass in user_passes {
        if is_own(&pass.name) || !names.insert(pass.name.as_str()) {
            return Err(fault(
                pass,
                "another pass has that name; give it a name of its own",
            ));
        }
    }
    let mut waiting: Vec<&UserPass> = user_passes.iter().collect();
    let mut order: Vec<&UserPass> = Vec::new();
    while let Some(index) = waiting.iter().position(|pass| {
        is_own(&pass.after) || order.iter().any(|before| before.name == pass.after)
    }) {
        order.push(waiting.remove(index));
    }
    let Some(stuck) = waiting.first() else {
        return Ok(order);
    };
    if let Some(lost) = waiting
        .iter()
        .find(|pass| !names.contains(pass.after.as_str()))
    {
        let known = passes::ALL.iter().map(|pass| &*pass.name).chain(names);
        let nearest = did_you_mean(&lost.after, known);
        return Err(fault(
            lost,
            format_args!(
                "there is no pass {:?} to follow{nearest}; `after` names a pass of an eye, of reconstruction, or another of \
                 the user's",
                lost.after
            ),
        ));
    }
    let circle: Vec<&str> = waiting.iter().map(|pass| pass.name.as_str()).collect();
    Err(fault(
        stuck,
        format_args!(
            "follows itself in a circle of {}; let one of them follow a pass of the frame",
            circle.join(", ")
        ),
    ))
}

/// Inserts the user passes into the stages of eyes and reconstruction, each after the one that it follows. Passes that
/// follow nothing that runs are left out; [`check`] names them.
pub(super) fn insert(stages: &mut [PlannedStage], user_passes: &[UserPass]) {
    for pass in ordered(user_passes).unwrap_or_default() {
        let left = stages.iter().find(|planned| planned.stage == Stage::Left);
        let in_left =
            left.is_some_and(|left| left.steps.iter().any(|step| runs(step, &pass.after)));
        for planned in &mut *stages {
            match planned.stage {
                Stage::Left | Stage::Right | Stage::RightEqual | Stage::Reconstruct => (),
                _ => continue,
            }
            for eye in Eye::ALL {
                let follows = |step: &Step| step.owner.eye == eye && runs(step, &pass.after);
                if let Some(at) = planned.steps.iter().rposition(follows) {
                    let step = following(&planned.steps[at], pass);
                    planned.steps.insert(at + 1, step);
                } else if in_left && eye == Eye::Right && planned.stage != Stage::Reconstruct {
                    // The right eye got its sample by reuse.
                    let is_run = |step: &&Step| step.pass().is_some() && step.owner.eye == eye;
                    if let Some(last) = planned.steps.iter().rfind(is_run) {
                        let step = following(last, pass);
                        planned.steps.push(step);
                    }
                }
            }
        }
    }
}

fn runs(step: &Step, name: &str) -> bool {
    step.pass().is_some_and(|pass| pass.name == name)
}

/// The step of a user pass after `before`.
fn following(before: &Step, user_pass: &UserPass) -> Step {
    let mut step = before.clone();
    let prefix = before
        .label
        .rsplit_once('.')
        .map_or("", |(prefix, _)| prefix);
    step.label = format!("{prefix}.{}", user_pass.name);
    if let Action::Run {
        pass,
        size,
        list,
        appends,
        words,
        ..
    } = &mut step.action
    {
        *pass = pass_of(user_pass);
        (*size, *list) = match user_pass.over {
            UserDomain::Pixels => (Size::Tiles, None),
            UserDomain::Hits => (Size::List(List::HITS), Some(List::HITS)),
        };
        *appends = None;
        words.count = 0;
    }
    step
}

/// Checks that every user pass runs in `stages`, compiles, and finds its buffers. `is_given` says which names exist
/// besides the frame's buffers.
///
/// # Errors
/// [`GpuError::UserPass`], one line that names the pass and the remedy.
pub fn check(
    user_passes: &[UserPass],
    stages: &[PlannedStage],
    library: &ShaderLibrary,
    features: &ShaderFeatures,
    is_given: impl Fn(&str) -> bool,
) -> Result<(), GpuError> {
    for user_pass in ordered(user_passes)? {
        let mut steps = stages.iter().flat_map(|planned| &planned.steps);
        let Some(step) = steps.find(|step| runs(step, &user_pass.name)) else {
            return Err(fault(
                user_pass,
                format_args!(
                    "follows {:?}, which does not run over an image with these settings; see `info --scene`",
                    user_pass.after
                ),
            ));
        };
        check_shader(user_pass, step, stages, library, features, &is_given)?;
    }
    Ok(())
}

fn check_shader(
    user_pass: &UserPass,
    step: &Step,
    stages: &[PlannedStage],
    library: &ShaderLibrary,
    features: &ShaderFeatures,
    is_given: &impl Fn(&str) -> bool,
) -> Result<(), GpuError> {
    let pass = pass_of(user_pass);
    let own = specialised(&pass, features, step.runs_from_list());
    let shader = library.compile(&pass.shader_name(), &own);
    let shader = shader.and_then(|shader| shader.validate().map(|_| shader));
    let shader = shader.map_err(|error| fault(user_pass, error))?;
    let entry = shader.module.entry_points.iter().find(|e| e.name == "main");
    let size = entry.map(|entry| entry.workgroup_size);
    if size.is_none_or(|[x, y, z]| x * y * z != 64) {
        return Err(fault(
            user_pass,
            "needs one entry point, `main`, with @workgroup_size(64)",
        ));
    }
    for binding in reflect_bindings(&shader).map_err(|error| fault(user_pass, error))? {
        let name = named(step, &binding.name);
        if is_given(&name) || name == crate::gpu::kernel::DISPATCH_BINDING {
            continue;
        }
        let Some(found) = meaning(&name, step.owner) else {
            return Err(fault(
                user_pass,
                format_args!(
                    "declares {:?}, which is no buffer of the frame; `info --scene` lists them",
                    binding.name
                ),
            ));
        };
        let is_read = binding.kind != BindingKind::ReadWrite;
        if is_read && !writes(stages, library, features, found.place, &user_pass.name)? {
            return Err(fault(
                user_pass,
                format_args!(
                    "reads {:?}, which no pass writes with these settings",
                    binding.name
                ),
            ));
        }
    }
    Ok(())
}

/// Whether a pass of the plan other than `except` writes a buffer.
fn writes(
    stages: &[PlannedStage],
    library: &ShaderLibrary,
    features: &ShaderFeatures,
    place: super::bind::Place,
    except: &str,
) -> Result<bool, GpuError> {
    for step in stages.iter().flat_map(|planned| &planned.steps) {
        let Some(pass) = step.pass().filter(|pass| pass.name != except) else {
            continue;
        };
        let own = specialised(pass, features, step.runs_from_list());
        let shader = library.compile(&pass.shader_name(), &own)?;
        let writes = reflect_bindings(&shader)?.iter().any(|binding| {
            let found = meaning(&named(step, &binding.name), step.owner);
            binding.kind == BindingKind::ReadWrite
                && found.is_some_and(|found| found.place == place)
        });
        if writes {
            return Ok(true);
        }
    }
    Ok(false)
}
