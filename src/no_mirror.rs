//! Stands in for the mirror in a build without windows: `--mirror` is refused before the run begins.

use crate::gpu::{GpuContext, ShaderLibrary};
use crate::renderer::{RenderError, Renderer};

/// Why there is no mirror; one line.
#[derive(Debug, thiserror::Error)]
pub enum MirrorError {
    /// The feature is off.
    #[error(
        "--mirror, --session desktop: this build has no windows; build stereolux with its feature `viewer` (`mirror` will do for --mirror), or leave the flag out"
    )]
    NotBuilt,
}

/// A window; there is none.
pub enum MirrorWindow {}

impl MirrorWindow {
    /// Refuses.
    ///
    /// # Errors
    /// [`MirrorError::NotBuilt`].
    pub fn open() -> Result<Self, MirrorError> {
        Err(MirrorError::NotBuilt)
    }
}

/// A window that frames are shown in; there is none.
pub enum Mirror {}

impl Mirror {
    /// Cannot be called: there is no window.
    ///
    /// # Errors
    /// None.
    pub fn new(window: MirrorWindow, _: &GpuContext) -> Result<Self, MirrorError> {
        match window {}
    }

    /// Cannot be called.
    pub fn close(self) {
        match self {}
    }

    /// Cannot be called.
    pub fn serve(&mut self) {
        match *self {}
    }

    /// Cannot be called.
    ///
    /// # Errors
    /// None.
    pub fn show(&mut self, _: &mut Renderer, _: &ShaderLibrary) -> Result<(), RenderError> {
        match *self {}
    }
}
