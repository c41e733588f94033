//! What a session asks of the renderer besides frames: pixels that nobody sees, switching reuse, another image size,
//! handing images over.

use crate::gpu::ShaderLibrary;
use crate::settings::Eyes as EyeChoice;
use crate::xr::view::Tangents;
use crate::xr::{HiddenArea, RuntimeTargets, View};

use super::mirror::MirrorPass;
use super::still;
use super::submit::ShownLight;
use super::{Eye, RenderError, Renderer, Reuse, Submitter};
use crate::frame::FrameRun;
use crate::frame::bind::Whose;

/// What the lenses hide, and for which fields of view the device knows it.
pub(super) struct Hidden {
    pub(super) areas: [HiddenArea; 2],
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

/// Fails for an image without pixels.
pub(super) fn check_size([width, height]: [u32; 2]) -> Result<(), RenderError> {
    if width == 0 || height == 0 {
        return Err(RenderError::Settings(format!(
            "an image of {width}x{height} has no pixels; width and height must be at least 1"
        )));
    }
    Ok(())
}

impl Renderer {
    /// Follows the session, whose lenses may come to hide something else. Where the renderer was made for lenses that hide
    /// nothing and never will, all pixels stay seen.
    pub(crate) fn follow_hidden(&mut self, areas: Option<&[HiddenArea; 2]>) {
        if let Some((hidden, areas)) = self.hidden.as_mut().zip(areas)
            && hidden.areas != *areas
        {
            *hidden = Hidden::new(areas);
        }
    }

    /// Says which pixels the lenses hide, if that or the fields of view are new.
    pub(super) fn update_hidden(&mut self, views: &[View; 2]) {
        let Some(hidden) = &mut self.hidden else {
            return;
        };
        let tangents = views.map(|view| view.fov.tangents());
        if hidden.tangents == Some(tangents) {
            return;
        }
        // The right eye alone is rendered as the left one.
        let of_eyes = if self.eye_choice == EyeChoice::Right {
            [1, 0]
        } else {
            [0, 1]
        };
        for (eye, of) in Eye::ALL.into_iter().zip(of_eyes) {
            let bits = hidden.areas[of].pixels(&tangents[of], self.image.size);
            let place = (Whose::Eye(eye), "hidden_pixels");
            let bits = bytemuck::cast_slice(&bits);
            self.frame.buffers.write(&self.context, place, bits);
        }
        hidden.tangents = Some(tangents);
    }

    /// Switches stereo reuse for the frames to come; false if the settings have none to switch.
    pub fn switch_reuse(&mut self) -> bool {
        let has_reuse = self.most_quality().reuse;
        if has_reuse {
            let reuses = !self.quality().reuse;
            self.reuse_from_now_on(reuses);
            if let Some(wanted) = &mut self.quality.wanted {
                wanted.reuse = reuses;
            }
        }
        has_reuse
    }

    pub(super) fn reuse_from_now_on(&mut self, reuses: bool) {
        self.reuse = if reuses {
            self.settings.reuse
        } else {
            Reuse::Off
        };
        self.is_bound = false;
    }

    /// Size of each eye's last image, pixels: width, height.
    #[must_use]
    pub fn size(&self) -> [u32; 2] {
        self.image.size
    }

    /// Makes the frames to come `size` pixels wide and high, per eye, at a resolution scale of 1. Scene, kernels and photon maps stay as they are; images
    /// are allocated anew, and what reconstruction remembers of earlier frames is forgotten. The next frame is bit for
    /// bit that of a renderer made at this size which traced its photons in the same frame. Does nothing if that is
    /// the size already.
    ///
    /// # Errors
    /// [`RenderError::Settings`] for a size without pixels, [`RenderError::Gpu`] if the images do not fit the adapter; the
    /// old size then stays.
    pub fn resize(&mut self, size: [u32; 2]) -> Result<(), RenderError> {
        check_size(size)?;
        if size == self.full_size {
            return Ok(());
        }
        let scaled = self.present_quality().scaled(size);
        let old = [self.full_size, self.image.size];
        // Both are bound to the old images, which go whatever comes of this.
        self.submitter = None;
        self.mirror = None;
        self.frame.buffers.forget_images();
        self.forget_frames();
        if let Err(error) = self.allocate_at(size).and_then(|()| {
            self.image.size = scaled;
            self.bind()
        }) {
            [self.full_size, self.image.size] = old;
            self.is_bound = false;
            self.frame.buffers.forget_images();
            return Err(error.into());
        }
        Ok(())
    }

    /// The frames before have images of another size.
    pub(super) fn forget_frames(&mut self) {
        self.forget_mean();
        if let Some(reconstruction) = &mut self.reconstruction {
            reconstruction.reset();
        }
        if let Some(hidden) = &mut self.hidden {
            hidden.tangents = None;
        }
        self.inspector.forget_frames();
    }

    /// Samples whose sum is what is shown.
    pub(super) fn shown_samples(&self) -> u32 {
        match self.reconstruction {
            Some(_) => 1,
            None => self.settings.spp.max(1),
        }
    }

    fn shown_light(&self) -> ShownLight {
        let output = &self.settings.output;
        ShownLight {
            scale: (output.exposure / f64::from(self.shown_samples())) as f32,
            tone: still::number(output.tone),
            parity: self.parity(),
        }
    }

    /// Writes the last frame's images into a runtime's textures, on the device; does not wait for it.
    ///
    /// # Errors
    /// [`RenderError::Gpu`], also if only one eye is rendered; [`RenderError::Settings`] if depth is asked for and was not kept
    /// ([`Renderer::for_session`]).
    pub fn submit_to(
        &mut self,
        library: &ShaderLibrary,
        targets: &RuntimeTargets,
    ) -> Result<(), RenderError> {
        if targets.depth.is_some() && self.reconstruction.is_none() {
            self.check_kept((Whose::Eye(Eye::Left), "hit_rays"))?;
        }
        let submitter = match self.submitter.take().filter(|known| known.fits(targets)) {
            Some(submitter) => submitter,
            None => self.with_frame(|renderer, frame| {
                let (context, settings) = (&renderer.context, &renderer.settings);
                Submitter::new(
                    context,
                    library,
                    frame,
                    &renderer.given(),
                    settings,
                    targets,
                )
            })?,
        };
        submitter.submit(&self.context, targets, self.image.size, self.shown_light())?;
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
            None => self.with_frame(|renderer, frame| {
                let (context, settings) = (&renderer.context, &renderer.settings);
                MirrorPass::new(context, library, frame, &renderer.given(), settings, format)
            })?,
        };
        pass.draw(&self.context, view, self.image.size, self.shown_light())?;
        self.mirror = Some(pass);
        Ok(())
    }

    /// Calls `with` while the frame's passes may change.
    pub(super) fn with_frame<R>(&mut self, with: impl FnOnce(&Self, &mut FrameRun) -> R) -> R {
        let mut frame = std::mem::take(&mut self.frame);
        let made = with(self, &mut frame);
        self.frame = frame;
        made
    }
}
