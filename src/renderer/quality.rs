//! How much work goes into a frame, changed while frames run: [`Quality`].
//!
//! A renderer is made for the most that its settings say, and allocates and compiles for that, with all kinds of frames that
//! it can be asked for. A change puts numbers into the settings and into uniforms, and binds the passes of another plan.

use super::frame_spec::{adapter_limits, map_configs_of};
use super::radii::radii_m;
use super::{RenderError, Renderer, Reuse};
use crate::frame::{MapLayout, PlannedStage};
use crate::gpu::GpuError;
use crate::settings::{Quality, RenderSettings};

/// Qualities of a renderer's frames.
pub(super) struct Qualities {
    /// What the renderer was made for.
    most: Quality,
    /// The present scale; all other values stand where they are used.
    scale: f32,
    /// From the next frame on.
    pub(super) wanted: Option<Quality>,
    /// Somebody has set it since that was asked last.
    is_told: bool,
}

impl Qualities {
    pub(super) fn new(most: Quality) -> Self {
        Self {
            most,
            scale: most.resolution_scale,
            wanted: None,
            is_told: false,
        }
    }
}

impl Renderer {
    /// The most that it was made for: what its settings say, at a scale of 1.
    #[must_use]
    pub fn most_quality(&self) -> Quality {
        self.quality.most
    }

    /// The quality of the next frame.
    #[must_use]
    pub fn quality(&self) -> Quality {
        self.quality
            .wanted
            .unwrap_or_else(|| self.present_quality())
    }

    /// The quality of the last frame.
    pub(super) fn present_quality(&self) -> Quality {
        Quality {
            resolution_scale: self.quality.scale,
            reuse: self.reuses(),
            ..Quality::of(&self.settings)
        }
    }

    /// Renders with `quality` from the next frame on, without compiling and without allocating. (Photon lists that overflow
    /// grow as ever, and so do buffers of gathers that fall into more slices.)
    ///
    /// The first frame after a change of photons or of the depth of their paths traces all of them and waits for their
    /// counts. With another resolution what reconstruction remembers is forgotten; with any other change it is kept. The
    /// frame is then bit for bit that of a renderer made so, but for one thing: paths that are retraced in fewer shares
    /// than the renderer was made for are shared out otherwise while light lags behind.
    ///
    /// # Errors
    /// [`RenderError::Settings`]: a value out of its range, or one that the renderer would have had to be made for, by name.
    pub fn set_quality(&mut self, quality: &Quality) -> Result<(), RenderError> {
        self.check_quality(quality)?;
        self.quality.wanted = Some(*quality);
        self.quality.is_told = true;
        Ok(())
    }

    /// Whether [`Renderer::set_quality`] would take it.
    pub(crate) fn check_quality(&self, quality: &Quality) -> Result<(), RenderError> {
        let checked = quality.check(&self.quality.most, self.settings.method);
        checked.map_err(RenderError::Settings)
    }

    /// What the quality was set to since this was asked last, if it was.
    pub(crate) fn take_told_quality(&mut self) -> Option<Quality> {
        let is_told = std::mem::take(&mut self.quality.is_told);
        is_told.then(|| self.quality())
    }

    /// The settings that it was made with.
    pub(super) fn settings_at_start(&self) -> RenderSettings {
        let mut settings = self.settings.clone();
        self.quality.most.put(&mut settings);
        settings
    }

    /// Makes the next frame's quality the present one.
    ///
    /// # Errors
    /// As [`MapLayout::lowered`].
    pub(super) fn take_quality_over(&mut self) -> Result<(), RenderError> {
        let now = self.present_quality();
        let Some(wanted) = self.quality.wanted.take().filter(|wanted| *wanted != now) else {
            return Ok(());
        };
        wanted.put(&mut self.settings);
        self.reuse_from_now_on(wanted.reuse);
        self.quality.scale = wanted.resolution_scale;
        let size = wanted.scaled(self.full_size);
        if std::mem::replace(&mut self.image.size, size) != size {
            self.forget_frames();
        }
        if (wanted.photons_per_frame, wanted.max_depth) != (now.photons_per_frame, now.max_depth) {
            self.remake_maps()?;
        }
        if wanted.photon_shares != now.photon_shares {
            for map in &mut self.maps {
                map.layout.shares_in_use = wanted.photon_shares;
            }
            self.refresh.begin_again(wanted.photon_shares);
        }
        self.shorten_dispatches();
        self.is_bound = false;
        Ok(())
    }

    /// Maps of the paths that the settings now ask for, and radii that go with them.
    fn remake_maps(&mut self) -> Result<(), GpuError> {
        [self.radius_m, self.caustic_radius_m] = radii_m(&self.settings, self.area_m2);
        let limits = adapter_limits(&self.context);
        let features = *self.frame.features();
        let configs = map_configs_of(&self.settings, &features, &self.scene);
        for (map, config) in self.maps.iter_mut().zip(configs) {
            map.remake(config, &limits, self.frames_begun)?;
        }
        Ok(())
    }

    /// The plans of all frames that it can be asked for; first of those that need most.
    pub(super) fn plans(&self) -> Vec<Vec<PlannedStage>> {
        let plan = |settings: &RenderSettings, reuse| self.plan_with(settings, reuse);
        plans_of_qualities(&self.settings, self.quality.most, plan)
    }

    /// Allocates, for images of `size` pixels, what frames of any quality need.
    ///
    /// # Errors
    /// As [`crate::frame::FrameRun::allocate`].
    pub(super) fn allocate_at(&mut self, size: [u32; 2]) -> Result<(), GpuError> {
        self.full_size = size;
        self.image.size = size;
        let layouts: Vec<MapLayout> = self.maps.iter().map(|map| map.layout).collect();
        // They depend on what the frame's shaders are specialised by.
        let plans = self.plans();
        let mut frame = std::mem::take(&mut self.frame);
        let mut allocated = Ok(());
        for stages in plans {
            allocated = allocated.and_then(|()| {
                frame.allocate(&self.context, &stages, &self.given(), &self.image, &layouts)
            });
        }
        self.frame = frame;
        allocated
    }
}

/// The plans of all qualities up to `most`, which is the first one's.
pub(super) fn plans_of_qualities(
    settings: &RenderSettings,
    most: Quality,
    plan: impl Fn(&RenderSettings, Reuse) -> Vec<PlannedStage>,
) -> Vec<Vec<PlannedStage>> {
    let mut plans = Vec::new();
    // The filter with fewer passes, but for one or none, needs no buffer that it lacks with the most.
    for filter_passes in [most.filter_passes, most.filter_passes.min(1), 0] {
        for half_rate in [most.half_rate, false] {
            let mut settings = settings.clone();
            let quality = Quality {
                filter_passes,
                half_rate,
                ..most
            };
            quality.put(&mut settings);
            let reuse = if most.reuse {
                settings.reuse
            } else {
                Reuse::Off
            };
            plans.push(plan(&settings, reuse));
            plans.push(plan(&settings, Reuse::Off));
        }
    }
    plans
}
