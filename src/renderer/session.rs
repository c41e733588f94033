//! What a session asks of the renderer besides frames: pixels that nobody sees, switching reuse, another image size,
//! handing images over.

use crate::gpu::ShaderLibrary;
use crate::xr::view::Tangents;
use crate::xr::{HiddenArea, RuntimeTargets, View};

use super::mirror::MirrorPass;
use super::raster::{Shown, ShownLight};
use super::{Eye, Eyes, Reconstruction, RenderError, Renderer, Submitter};

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

    /// Size of each eye's image, pixels: width, height.
    #[must_use]
    pub fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// Makes the frames to come `size` pixels wide and high, per eye. Scene, kernels and photon maps stay as they are; images
    /// are allocated anew, and what reconstruction remembers of earlier frames is forgotten. The next frame is bit for
    /// bit that of a renderer made at this size which traced its photons in the same frame. Does nothing if that is
    /// the size already.
    ///
    /// # Errors
    /// [`RenderError::Settings`] for a size without pixels, [`RenderError::Gpu`] if the images do not fit the adapter; the
    /// old size then stays.
    pub fn resize(&mut self, size: [u32; 2]) -> Result<(), RenderError> {
        if size.contains(&0) {
            return Err(RenderError::Settings(format!(
                "an image of {}x{} has no pixels; width and height must be at least 1",
                size[0], size[1]
            )));
        }
        if size == self.size() {
            return Ok(());
        }
        let both = self.eyes.has_right();
        let mut eyes = Eyes::new(&self.context, size, self.eyes.plan().clone(), both)?;
        eyes.set_reuse(self.eyes.reuse());
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let reconstruction = self
            .reconstruction
            .as_ref()
            .map(|old| Reconstruction::new(&self.context, old.plan(), pixels, both))
            .transpose()?;
        self.eyes = eyes;
        self.reconstruction = reconstruction;
        [self.width, self.height] = size;
        if let Some(hidden) = &mut self.hidden {
            hidden.tangents = None;
        }
        // Both are bound to the old images.
        self.submitter = None;
        self.mirror = None;
        self.inspector.forget_frames();
        self.is_bound = false;
        Ok(())
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
