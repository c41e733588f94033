//! What of the settings may change while frames run: none of it compiles or allocates.

use serde::Serialize;

use super::{Method, RenderSettings, Reuse};

/// How much work goes into a frame. A renderer is made for the most that its settings say; between two frames it may be
/// asked for less, and for as much again.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Quality {
    /// Pixels across and down, as a share of the size that the renderer was made for; 0.1 to 1. Sizes are rounded, to 1
    /// pixel at least.
    pub resolution_scale: f32,
    /// `photon.count`: photons emitted per frame, at most as many as the settings say. An automatic radius follows.
    pub photons_per_frame: u32,
    /// `photon.shares`, from 1 to that of the settings: frames over which photons are retraced once something moves.
    pub photon_shares: u32,
    /// `path.max_depth` or `photon.max_depth`, whichever is the method's, segments; from 1 to that of the settings.
    pub max_depth: u32,
    /// `path.light_candidates`, samples; 1 to 16.
    pub light_candidates: u32,
    /// `photon.half_rate`; true only if the settings say so.
    pub half_rate: bool,
    /// `reconstruct.atrous_passes`, from 0 to that of the settings.
    pub filter_passes: u32,
    /// Whether the right eye reuses the left one, as `reuse` says; true only if that is not `off` and both eyes are rendered.
    pub reuse: bool,
}

impl Quality {
    /// That of frames of both eyes with `settings`: the most that a renderer of them can do.
    #[must_use]
    pub fn of(settings: &RenderSettings) -> Self {
        Self {
            resolution_scale: 1.0,
            photons_per_frame: settings.photon.count,
            photon_shares: settings.photon.shares,
            max_depth: match settings.method {
                Method::Path => settings.path.max_depth,
                Method::Photon => settings.photon.max_depth,
            },
            light_candidates: settings.path.light_candidates,
            half_rate: settings.photon.half_rate.is_on(),
            filter_passes: settings.reconstruct.atrous_passes.with(settings.method),
            reuse: settings.reuse != Reuse::Off,
        }
    }

    /// Puts into `settings` what they have a place for: all but the scale and whether reuse is on.
    pub fn put(&self, settings: &mut RenderSettings) {
        settings.photon.count = self.photons_per_frame;
        settings.photon.shares = self.photon_shares;
        match settings.method {
            Method::Path => settings.path.max_depth = self.max_depth,
            Method::Photon => settings.photon.max_depth = self.max_depth,
        }
        settings.path.light_candidates = self.light_candidates;
        settings.photon.half_rate = self.half_rate.into();
        settings.reconstruct.atrous_passes = self.filter_passes.into();
    }

    /// `full` pixels at this scale.
    #[must_use]
    pub fn scaled(&self, full: [u32; 2]) -> [u32; 2] {
        let scale = f64::from(self.resolution_scale);
        full.map(|pixels| ((f64::from(pixels) * scale).round() as u32).max(1))
    }

    /// The first value that no renderer takes, and what is wrong with it. The ranges are those of the settings.
    pub fn out_of_range(&self) -> Option<(&'static str, String)> {
        let scale = self.resolution_scale;
        // What is no number is in no range.
        if !(0.1..=1.0).contains(&scale) {
            let what = format!("{scale} is not between 0.1 and 1");
            return Some(("resolution_scale", what));
        }
        let counts = [
            ("photons_per_frame", self.photons_per_frame, [0, 67_108_864]),
            ("photon_shares", self.photon_shares, [1, 64]),
            ("max_depth", self.max_depth, [1, 64]),
            ("light_candidates", self.light_candidates, [1, 16]),
            ("filter_passes", self.filter_passes, [0, 8]),
        ];
        let (name, value, [least, most]) = counts
            .into_iter()
            .find(|(_, value, [least, most])| !(least..=most).contains(&value))?;
        Some((name, format!("{value} is not between {least} and {most}")))
    }

    /// Checks that a renderer of `method` that was made for `most` can do it.
    ///
    /// # Errors
    /// One line: which value, what is wrong, and which setting would have to be another from the start.
    pub fn check(&self, most: &Self, method: Method) -> Result<(), String> {
        if let Some((name, what)) = self.out_of_range() {
            return Err(format!("quality.{name}: {what}"));
        }
        let depth = match method {
            Method::Path => "path.max_depth",
            Method::Photon => "photon.max_depth",
        };
        for (name, [value, most], setting) in [
            (
                "photons_per_frame",
                [self.photons_per_frame, most.photons_per_frame],
                "photon.count",
            ),
            (
                "photon_shares",
                [self.photon_shares, most.photon_shares],
                "photon.shares",
            ),
            ("max_depth", [self.max_depth, most.max_depth], depth),
            (
                "filter_passes",
                [self.filter_passes, most.filter_passes],
                "reconstruct.atrous_passes",
            ),
        ] {
            if value > most {
                return Err(format!(
                    "quality.{name}: {value} is more than the {most} that the renderer was made for; start with a larger {setting}"
                ));
            }
        }
        let reuse = "reuse = \"scatter\" or \"lookup\" and both eyes";
        for (name, wants, has, mend) in [
            (
                "half_rate",
                self.half_rate,
                most.half_rate,
                "photon.half_rate = true",
            ),
            ("reuse", self.reuse, most.reuse, reuse),
        ] {
            if wants && !has {
                return Err(format!(
                    "quality.{name}: the renderer was made without it; start with {mend}"
                ));
            }
        }
        Ok(())
    }
}
