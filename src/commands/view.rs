//! `view`: the desktop viewer.

use super::Failure;
use super::run::replay_options;
use crate::frame::user_passes::shader_library;
use crate::interrupt;
use crate::limits::LoadBudget;
use crate::options::ViewOptions;
use crate::output::OutputFolder;
use crate::scene::edit::Document;
use crate::scene_loading::{light_scene, surround};
use crate::viewer::session::Recording;
use crate::viewer::window_state::WindowState;
use crate::viewer::{Start, show};
use crate::xr::{Headset, ReplaySession, Validated};

/// Opens the window.
pub fn view(options: &ViewOptions) -> Result<(), Failure> {
    let mut settings = options.settings.clone();
    settings.render.decide_reconstruction(true);
    // Faults of shaders and of passes of the user's own are told before a window opens.
    shader_library(&settings.gpu.shader_folder, &settings.render.user_passes)
        .map_err(Failure::unusable)?;
    let headset = Headset::load(&settings.headset)?;
    let budget = LoadBudget::new(settings.limits.load());
    let mut document = Document::load_within(&settings.scene, &budget)?;
    document.scale(settings.scene_scale);
    if let Some(light) = light_scene(&mut settings, document.scene()) {
        eprintln!("light: {light}");
    }
    if let Some(warning) = document.scene().size_warning() {
        log::warn!("{warning}");
    }
    let own = document.scene().environment.clone();
    let (environment, warnings) = surround(own, &settings, &budget)?;
    document.set_environment(environment);
    for warning in warnings {
        log::warn!("{warning}");
    }
    document.scene().clip(&settings.render.animation.clip)?;
    for warning in &document.scene().warnings {
        log::warn!("{warning}");
    }
    OutputFolder::check(&options.shared.out)?;
    let recording = match &options.recording.trace {
        Some(path) => {
            let start = document.scene().start_pose();
            let replay = replay_options(&options.recording, headset.clone(), start);
            let session = ReplaySession::open(path, replay)?;
            Some(Recording::of(&mut Validated::new(session))?)
        }
        None => None,
    };
    let state_path = WindowState::path();
    let window_state = state_path
        .as_deref()
        .map(WindowState::load)
        .unwrap_or_default();
    interrupt::catch();
    Ok(show(
        Start {
            document,
            settings,
            headset,
            recording,
            out: options.shared.out.clone(),
            window_state,
        },
        &options.settings.adapter,
        state_path,
    )?)
}
