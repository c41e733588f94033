//! Images and lists read back from the device. Each waits for it.

use super::records::photon::{PhotonGrid, SortedPhoton};
use super::records::reconstruction::{unpack_motion, unpack_variances};
#[cfg(feature = "internals")]
use super::records::stereo::SMALL_WINNER;
use super::{Eye, RenderError, Renderer};
use crate::frame::MapKind;
use crate::frame::bind::{Place, Whose, label};
use crate::frame::plan::shown_light;
use crate::settings::Eyes as EyeChoice;

/// An eye's radiance in parts, means over a frame's samples, row 0 on top.
#[derive(Debug, Clone, PartialEq)]
pub struct RadianceParts {
    /// Emission and surroundings that the eye sees, and light that came from a light source and was scattered once, at
    /// the first surface that is no mirror and no smooth glass. The photon method counts lobes that eye paths follow
    /// among the mirrors; with `photon.direct=map` direct light is among the indirect.
    pub direct: Vec<[f32; 3]>,
    /// The rest of the radiance: exactly what `read_radiance` gives less `direct`, in f32, but never below 0.
    pub indirect: Vec<[f32; 3]>,
    /// Reflectance of the first surface towards the eye, by its Fresnel terms; 1 where a sample met no surface.
    pub albedo: Vec<[f32; 3]>,
}

/// What [`Renderer::read_motion`] reads: records of `shaders/shared/reconstruction.wesl` and of the pass `motion`.
pub type SeenAndMotion = (Vec<[u32; 4]>, Vec<[f32; 4]>);

fn rgb(read: Vec<[f32; 4]>) -> Vec<[f32; 3]> {
    read.iter().map(|c| [c[0], c[1], c[2]]).collect()
}

impl Renderer {
    pub(super) fn read<T: bytemuck::Pod>(
        &self,
        place: Place,
        count: usize,
    ) -> Result<Option<Vec<T>>, RenderError> {
        self.check_kept(place)?;
        let buffers = &self.frame.buffers;
        Ok(buffers.read(&self.context, place, self.parity(), count)?)
    }

    /// Refuses what holds nothing after a frame.
    pub(super) fn check_kept(&self, place: Place) -> Result<(), RenderError> {
        if !self.frame.buffers.is_spent(&place) {
            return Ok(());
        }
        Err(RenderError::Settings(format!(
            "{} holds nothing after a frame of these settings; output.kept=all keeps it",
            label(place)
        )))
    }

    /// One element per pixel.
    pub(super) fn read_pixels<T: bytemuck::Pod>(
        &self,
        place: Place,
    ) -> Result<Option<Vec<T>>, RenderError> {
        self.read(place, self.pixels())
    }

    fn read_colors(
        &self,
        eye: Eye,
        name: &'static str,
    ) -> Result<Option<Vec<[f32; 3]>>, RenderError> {
        Ok(self.read_pixels((Whose::Eye(eye), name))?.map(rgb))
    }

    /// Radiance of an eye's pixels, row 0 on top: the mean over the frame's samples, or the picture that was reconstructed
    /// from it, after all filters and temporal anti-aliasing. It is what is shown, before exposure and tone curve.
    ///
    /// # Errors
    /// [`RenderError::Gpu`].
    pub fn read_radiance(&self, eye: Eye) -> Result<Option<Vec<[f32; 3]>>, RenderError> {
        let Some(eye) = self.buffers_of(eye) else {
            return Ok(None);
        };
        match &self.reconstruction {
            Some(_) => self.read_colors(eye, shown_light(&self.settings)),
            None => self.read_samples(eye),
        }
    }

    /// Mean radiance over the frame's samples alone, whatever is reconstructed from it. `eye` names the buffers: a single
    /// eye lies in the left ones.
    ///
    /// # Errors
    /// [`RenderError::Gpu`]; [`RenderError::Settings`] where a reconstructed frame does not keep it (`output.kept`).
    pub fn read_samples(&self, eye: Eye) -> Result<Option<Vec<[f32; 3]>>, RenderError> {
        self.read_sample_mean(eye, "radiance_sum")
    }

    /// A sum over the frame's samples, divided by their number.
    fn read_sample_mean(
        &self,
        eye: Eye,
        name: &'static str,
    ) -> Result<Option<Vec<[f32; 3]>>, RenderError> {
        let scale = 1.0 / self.settings.spp.max(1) as f32;
        let sums = self.read_colors(eye, name)?;
        let mean = |sum: [f32; 3]| sum.map(|channel| channel * scale);
        Ok(sums.map(|sums| sums.into_iter().map(mean).collect()))
    }

    /// Mean radiance of an eye split into direct and indirect light, and the albedo; `None` for an eye that is not
    /// rendered, or without `output.parts`.
    ///
    /// # Errors
    /// [`RenderError::Gpu`].
    pub fn read_parts(&self, eye: Eye) -> Result<Option<RadianceParts>, RenderError> {
        let Some(eye) = self.buffers_of(eye).filter(|_| self.settings.output.parts) else {
            return Ok(None);
        };
        let parts = self.read_direct_and_indirect(eye)?;
        let albedo = self.read_sample_mean(eye, "albedo_sum")?;
        Ok(parts
            .zip(albedo)
            .map(|([direct, indirect], albedo)| RadianceParts {
                direct,
                indirect,
                albedo,
            }))
    }

    /// The first two of [`RadianceParts`], wherever radiance is split for whatever reason; `eye` names the buffers.
    pub(super) fn read_direct_and_indirect(
        &self,
        eye: Eye,
    ) -> Result<Option<[Vec<[f32; 3]>; 2]>, RenderError> {
        let Some(direct) = self.read_sample_mean(eye, "direct_sum")? else {
            return Ok(None);
        };
        let Some(radiance) = self.read_samples(eye)? else {
            return Ok(None);
        };
        let indirect = radiance
            .iter()
            .zip(&direct)
            // Where nothing is indirect the two sums were rounded differently.
            .map(|(all, direct)| [0, 1, 2].map(|channel| (all[channel] - direct[channel]).max(0.0)))
            .collect();
        Ok(Some([direct, indirect]))
    }

    /// Ray direction (unit, render space) and distance of every pixel's first hit in the last sample; 0 is a miss. `eye`
    /// names the buffers, as for [`Renderer::read_samples`].
    ///
    /// # Errors
    /// [`RenderError::Gpu`].
    #[cfg_attr(not(feature = "internals"), doc(hidden))]
    pub fn read_hit_rays(&self, eye: Eye) -> Result<Option<Vec<[f32; 4]>>, RenderError> {
        self.read_pixels((Whose::Eye(eye), "hit_rays"))
    }

    /// Where the right eye's pixels of the last sample came from ([`super::Provenance`]), or `None` without reuse.
    ///
    /// # Errors
    /// [`RenderError::Gpu`].
    pub fn read_provenance(&self) -> Result<Option<Vec<u32>>, RenderError> {
        if !self.reuses() {
            return Ok(None);
        }
        self.read_pixels((Whose::Frame, "provenance"))
    }

    /// Left pixel that each right pixel of the last sample was taken from (`u32::MAX`: none, or on a triangle too small to take
    /// one from); `None` without scatter.
    ///
    /// # Errors
    /// [`RenderError::Gpu`].
    #[cfg(feature = "internals")]
    pub fn read_winners(&self) -> Result<Option<Vec<u32>>, RenderError> {
        if !self.reuses() {
            return Ok(None);
        }
        let complements = self.read_pixels::<u32>((Whose::Frame, "scatter_winners"))?;
        let winner = |complement: u32| {
            if complement & SMALL_WINNER == 0 {
                u32::MAX
            } else {
                !complement
            }
        };
        Ok(complements.map(|values| values.into_iter().map(winner).collect()))
    }

    /// Variance of the luminance of light over albedo as accumulated over frames, direct and indirect light added; `None`
    /// without filtering, 0 where no surface is seen. `eye` names the buffers.
    ///
    /// # Errors
    /// [`RenderError::Gpu`].
    #[cfg_attr(not(feature = "internals"), doc(hidden))]
    pub fn read_variance(&self, eye: Eye) -> Result<Option<Vec<f32>>, RenderError> {
        let moments = self.read_pixels((Whose::Eye(eye), "moments"))?;
        let seen = self.read_pixels::<[u32; 4]>((Whose::Eye(eye), "seen_surfaces"))?;
        // Nothing is written for surroundings.
        let sum = |(words, [distance, ..]): ([u32; 2], [u32; 4])| match distance {
            0 => 0.0,
            _ => unpack_variances(words).iter().sum(),
        };
        let both = moments.zip(seen);
        Ok(both.map(|(moments, seen)| moments.into_iter().zip(seen).map(sum).collect()))
    }

    /// What every pixel of an eye saw: distance in metres (bits), normal, instance and flags, place in the pixel; and its
    /// motion: displacement in pixels, distance before, whether it is known. For tests and views. `eye` names the buffers.
    ///
    /// # Errors
    /// [`RenderError::Gpu`].
    #[cfg_attr(not(feature = "internals"), doc(hidden))]
    pub fn read_motion(&self, eye: Eye) -> Result<Option<SeenAndMotion>, RenderError> {
        let seen = self.read_pixels((Whose::Eye(eye), "seen_surfaces"))?;
        let motion = self.read_pixels((Whose::Eye(eye), "motion"))?;
        Ok(seen.zip(motion.map(|words| words.into_iter().map(unpack_motion).collect())))
    }

    /// The photons of a map in cell order, or in the kd-tree's; `None` if there is no such map. For tests and diagnostics.
    ///
    /// # Errors
    /// [`RenderError::Gpu`].
    #[cfg(feature = "internals")]
    pub fn read_photons(&self, kind: MapKind) -> Result<Option<Vec<SortedPhoton>>, RenderError> {
        let Some(map) = self.map(kind) else {
            return Ok(None);
        };
        let stored = map.counters().stored as usize;
        self.read((Whose::Map(kind), "sorted_photons"), stored)
    }

    /// A map's grid and the starts of its cells. As [`Renderer::read_photons`].
    ///
    /// # Errors
    /// [`RenderError::Gpu`].
    #[cfg(feature = "internals")]
    pub fn read_photon_grid(
        &self,
        kind: MapKind,
    ) -> Result<Option<(PhotonGrid, Vec<u32>)>, RenderError> {
        let grid = self.read::<PhotonGrid>((Whose::Map(kind), "photon_grid"), 1)?;
        let Some(&grid) = grid.as_ref().and_then(|grid| grid.first()) else {
            return Ok(None);
        };
        let cells = grid.cell_count as usize + 1;
        let starts = self.read((Whose::Map(kind), "cell_starts"), cells)?;
        Ok(starts.map(|starts| (grid, starts)))
    }

    /// The first `count` nodes of a map's kd-tree: position (photon space, metres) and axis, 0 to 2, along which the node
    /// parts its subtree. As [`Renderer::read_photons`].
    ///
    /// # Errors
    /// [`RenderError::Gpu`].
    #[cfg(feature = "internals")]
    pub fn read_kd_nodes(
        &self,
        kind: MapKind,
        count: u32,
    ) -> Result<Option<Vec<[f32; 4]>>, RenderError> {
        self.read((Whose::Map(kind), "kd_nodes"), count as usize)
    }

    /// Whose buffers hold an eye's image: a single eye is rendered into the left ones.
    pub(super) fn buffers_of(&self, eye: Eye) -> Option<Eye> {
        match (self.eye_choice, eye) {
            (EyeChoice::Both, eye) => Some(eye),
            (EyeChoice::Left, Eye::Left) | (EyeChoice::Right, Eye::Right) => Some(Eye::Left),
            _ => None,
        }
    }
}
