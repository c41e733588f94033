//! The reference that the error view compares with: a [`RenderEngine`](super::render_engine::RenderEngine) of these settings,
//! one frame at a time, while nothing else changes.

use crate::settings::{Method, Mips, ReconstructSettings, Reuse, Settings};

/// Frames of the reference have numbers of their own, so that their noise is independent of the picture's.
pub const FIRST_FRAME: u32 = 1 << 31;

/// Settings of the reference to a picture: both eyes path traced by themselves, with nothing filtered, at the depth of
/// what is compared.
pub fn settings(settings: &Settings) -> Settings {
    let mut reference = settings.clone();
    let render = &mut reference.render;
    if render.method == Method::Photon {
        render.path.max_depth = render.photon.max_depth;
    }
    render.method = Method::Path;
    render.reuse = Reuse::Off;
    render.reconstruct = ReconstructSettings::default();
    render.textures.mips = Mips::Off;
    reference
}
