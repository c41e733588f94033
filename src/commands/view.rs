//! `view`: the desktop viewer.

use super::Failure;
use super::run::replay_options;
use crate::interrupt;
use crate::limits::LoadBudget;
use crate::options::ViewOptions;
use crate::output::OutputFolder;
use crate::scene::edit::Document;
use crate::scene::load_environment_within;
use crate::viewer::memory::Memory;
use crate::viewer::session::Recording;
use crate::viewer::{Start, show};
use crate::xr::{Headset, Pose, ReplaySession, Validated};

/// Opens the window.
pub fn view(options: &ViewOptions) -> Result<(), Failure> {
    let settings = &options.settings;
    let headset = Headset::load(&settings.headset)?;
    let budget = LoadBudget::new(settings.limits.load());
    let mut document = Document::load_within(&settings.scene, &budget)?;
    if !settings.environment.path.is_empty() {
        let strength = settings.environment.strength as f32;
        let (environment, warnings) =
            load_environment_within(&settings.environment.path, strength, &budget)?;
        document.set_environment(Some(environment));
        for warning in warnings {
            log::warn!("{warning}");
        }
    }
    document.scene().clip(&settings.animation.clip)?;
    for warning in &document.scene().warnings {
        log::warn!("{warning}");
    }
    OutputFolder::check(&options.out)?;
    let recording = match &options.trace {
        Some(trace) => {
            let start = document.scene().start_pose();
            let start = Pose::new(start.position, start.orientation);
            let replay = replay_options(trace, headset.clone(), start);
            let session = ReplaySession::open(&trace.path, replay)?;
            Some(Recording::of(&mut Validated::new(session))?)
        }
        None => None,
    };
    let path = Memory::path();
    let memory = path.as_deref().map(Memory::load).unwrap_or_default();
    interrupt::catch();
    Ok(show(
        Start {
            document,
            settings: settings.clone(),
            headset,
            recording,
            out: options.out.clone(),
            memory,
        },
        &settings.adapter,
        path,
    )?)
}
