//! `view`: the desktop viewer.

use std::path::Path;

use super::Failure;
use super::source::replay_options;
use crate::frame::user_passes::shader_library;
use crate::interrupt;
use crate::options::ViewOptions;
use crate::output::OutputFolder;
use crate::scene_loading::LoadedDocument;
use crate::settings::Settings;
use crate::viewer::session::Recording;
use crate::viewer::window_state::WindowState;
use crate::viewer::{Start, show};
use crate::xr::{Headset, ReplaySession, Validated};

/// Opens the window.
pub fn view(options: &ViewOptions) -> Result<(), Failure> {
    let settings = &options.settings;
    // Faults of shaders and of passes of the user's own are told before a window opens.
    shader_library(&settings.gpu.shader_folder, &settings.render.user_passes)
        .map_err(Failure::unusable)?;
    let headset = Headset::load(&settings.headset)?;
    let LoadedDocument {
        document,
        settings,
        light,
        warnings,
    } = LoadedDocument::open(settings, false)?;
    for warning in &warnings {
        log::warn!("{warning}");
    }
    if let Some(light) = &light {
        eprint_line!("light: {light}");
    }
    document.scene().clip(&settings.render.animation.clip)?;
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
    let mut window_state = state_path
        .as_deref()
        .map(WindowState::load)
        .unwrap_or_default();
    let trace = options.recording.trace.as_deref();
    remember_files(&mut window_state, &settings, trace);
    interrupt::catch();
    Ok(show(
        Start {
            document,
            settings,
            is_auto_lit: light.is_some_and(|light| light.is_auto),
            headset,
            recording,
            out: options.shared.out.clone(),
            window_state,
        },
        &options.settings.adapter,
        state_path,
    )?)
}

/// What the command line opens is found again as what the window opens is, the scene first.
fn remember_files(state: &mut WindowState, settings: &Settings, trace: Option<&Path>) {
    let trace = trace.map_or_else(Default::default, |path| path.to_string_lossy());
    for path in [&*trace, &settings.environment.path, &settings.scene] {
        state.remember_file(path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_the_command_line_are_among_the_recent_ones() {
        let mut state = WindowState::default();
        let mut settings = Settings {
            scene: "builtin:cornell".to_owned(),
            ..Settings::default()
        };
        remember_files(&mut state, &settings, None);
        assert!(state.recent.is_empty(), "{:?}", state.recent);
        settings.scene = "room.glb".to_owned();
        settings.environment.path = "sky.hdr".to_owned();
        remember_files(&mut state, &settings, Some(Path::new("walk.jsonl")));
        let here = std::env::current_dir().unwrap();
        let found = state.recent.iter().map(Path::new);
        let names = ["room.glb", "sky.hdr", "walk.jsonl"];
        assert!(
            found.eq(names
                .map(|name| here.join(name))
                .iter()
                .map(|path| path.as_path()))
        );
    }
}
