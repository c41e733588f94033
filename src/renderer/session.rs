//! What a session asks of the renderer besides frames: pixels that nobody sees, switching reuse, handing images over.

use crate::gpu::ShaderLibrary;
use crate::xr::view::Tangents;
use crate::xr::{HiddenArea, RuntimeTargets, View};

use super::mirror::MirrorPass;
use super::raster::{Shown, ShownLight};
use super::{Eye, RenderError, Renderer, Submitter};

/// What the lenses hide, and for which fields of view the device knows it.
pub(super) struct Hidden {
    areas: [HiddenArea; 2],
    tangents: Option<[Tangents; 2]>,
}

impl Hidden {
    pub(super) fn new(areas: &[HiddenArea; 2]) -> Self {
        Self {
            areas: areas.clone(),
            tangents: None,
        }
    }
}

impl Renderer {
    /// Says which pixels the lenses hide, if that or the fields of view are new.
    pub(super) fn update_hidden(&mut self, views: &[View; 2]) {
        let Some(hidden) = &mut self.hidden else {
            return;
        };
        let tangents = views.map(|view| view.fov.tangents());
        if hidden.tangents == Some(tangents) {
            return;
        }
        for ((eye, area), tangents) in [Eye::Left, Eye::Right]
            .into_iter()
            .zip(&hidden.areas)
            .zip(&tangents)
        {
            let bits = area.pixels(tangents, [self.width, self.height]);
            self.eyes.write_hidden(&self.context, eye, &bits);
        }
        hidden.tangents = Some(tangents);
    }

    /// Switches stereo reuse for the frames to come; false if the settings have none to switch.
    pub fn switch_reuse(&mut self) -> bool {
        let changed = self.eyes.set_reuse(!self.eyes.reuse());
        if changed {
            self.is_bound = false;
        }
        changed
    }

    fn shown(&self) -> Shown<'_> {
        Shown {
            eyes: &self.eyes,
            reconstruction: self.reconstruction.as_ref(),
            frame_uniform: &self.frame_uniform,
        }
    }

    fn shown_light(&self) -> ShownLight {
        self.shown()
            .light(self.settings.output.exposure, self.settings.spp)
    }

    /// Writes the last frame's images into a runtime's textures, on the device; does not wait for it.
    ///
    /// # Errors
    /// [`RenderError::Gpu`], also if only one eye is rendered.
    pub fn submit_to(
        &mut self,
        library: &ShaderLibrary,
        targets: &RuntimeTargets,
    ) -> Result<(), RenderError> {
        let submitter = match self.submitter.take().filter(|known| known.fits(targets)) {
            Some(submitter) => submitter,
            None => Submitter::new(&self.context, library, self.shown(), targets)?,
        };
        submitter.submit(
            &self.context,
            targets,
            self.shown_light(),
            self.eyes.carries_rays(),
        )?;
        self.submitter = Some(submitter);
        Ok(())
    }

    /// Draws the last frame's images side by side into a window's texture, on the device; does not wait for it.
    ///
    /// # Errors
    /// [`RenderError::Gpu`], also if only one eye is rendered.
    pub fn mirror_to(
        &mut self,
        library: &ShaderLibrary,
        view: &wgpu::TextureView,
    ) -> Result<(), RenderError> {
        let format = view.texture().format();
        let pass = match self.mirror.take().filter(|known| known.format() == format) {
            Some(pass) => pass,
            None => MirrorPass::new(&self.context, library, self.shown(), format)?,
        };
        let size = [self.width, self.height];
        pass.draw(&self.context, view, size, self.shown_light())?;
        self.mirror = Some(pass);
        Ok(())
    }
}
