//! `view`: the desktop viewer.

use super::Failure;
use crate::interrupt;
use crate::options::ViewOptions;
use crate::output::OutputFolder;
use crate::scene::edit::Document;
use crate::scene::load_environment;
use crate::viewer::memory::Memory;
use crate::viewer::{Start, show};
use crate::xr::Headset;

/// Opens the window.
pub fn view(options: &ViewOptions) -> Result<(), Failure> {
    let settings = &options.settings;
    let headset = Headset::load(&settings.headset)?;
    let mut document = Document::load(&settings.scene)?;
    if !settings.environment.path.is_empty() {
        let strength = settings.environment.strength as f32;
        let (environment, warnings) = load_environment(&settings.environment.path, strength)?;
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
    let path = Memory::path();
    let memory = path.as_deref().map(Memory::load).unwrap_or_default();
    interrupt::catch();
    Ok(show(
        Start {
            document,
            settings: settings.clone(),
            headset,
            recording: None,
            out: options.out.clone(),
            memory,
        },
        &settings.adapter,
        path,
    )?)
}
