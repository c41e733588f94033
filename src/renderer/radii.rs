//! Gather radii, and how many paths a map of caustics gets.

use crate::scene::{Scene, SceneStatistics};
use crate::settings::RenderSettings;

/// Photons that an automatic radius gathers on average: enough that one photon more or less does not show, few enough
/// that the bias stays small. A path is taken to store one.
const AUTOMATIC_GATHER: f64 = 60.0;
/// Gather radii below this are raised to it: their square would leave f32's range.
pub(super) const LEAST_RADIUS_M: f64 = 1e-12;

/// Caustic radius over the photons' radius, where both are automatic. In `caustic`, relMSE at shares of 1 and 0.5 was 2.98
/// and 0.39 with 2^12 photons (4 passes), 0.062 and 0.084 with 2^16, 0.023 and 0.034 with 2^19; in the gallery, the same:
/// half loses little where photons are many and gains most where the whole radius would smear the spot.
const AUTOMATIC_CAUSTIC_RADIUS: f64 = 0.5;

/// The scene's area, square metres, if the radius is automatic; else 0.
pub(super) fn area_m2(
    settings: &RenderSettings,
    statistics: &SceneStatistics,
    scene: &Scene,
) -> f64 {
    if settings.photon.radius_m > 0.0 {
        0.0
    } else {
        statistics.area_m2(scene)
    }
}

/// Radii of photons and of caustics, metres: those of the settings, or automatic ones for a scene of so much area.
pub(super) fn radii_m(settings: &RenderSettings, area_m2: f64) -> [f64; 2] {
    let photon = &settings.photon;
    let radius_m = if photon.radius_m > 0.0 {
        photon.radius_m.max(LEAST_RADIUS_M)
    } else {
        radius_for_area_m(area_m2, photon.count)
    };
    let caustic_radius_m = if photon.caustic_radius_m > 0.0 {
        photon.caustic_radius_m.max(LEAST_RADIUS_M)
    } else {
        radius_m * AUTOMATIC_CAUSTIC_RADIUS
    };
    [radius_m, caustic_radius_m]
}

/// Radius in metres that gathers about [`AUTOMATIC_GATHER`] photons on a scene's mean square metre.
pub fn automatic_radius_m(scene: &Scene, paths: u32) -> f64 {
    radius_for_area_m(SceneStatistics::of(scene).area_m2(scene), paths)
}

/// As [`automatic_radius_m`], for a scene whose area is known.
fn radius_for_area_m(area_m2: f64, paths: u32) -> f64 {
    let photons = f64::from(paths.max(1));
    let radius = (AUTOMATIC_GATHER * area_m2 / (std::f64::consts::PI * photons)).sqrt();
    if radius.is_finite() && radius > 0.0 {
        radius
    } else {
        0.1
    }
}

/// Paths emitted for the map of caustics.
pub fn caustic_paths(settings: &RenderSettings) -> u32 {
    match settings.photon.caustic_count {
        0 => settings.photon.count,
        count => count,
    }
}

/// Most that shading normals raise a photon's power by (`shaders/shared/surface.wesl`) in progressive pass `pass`. It grows, since
/// bounds do not shrink with the radius: the light that they take on average over n passes falls with the square root of n.
pub fn most_correction(pass: u32) -> f64 {
    8.0 * f64::sqrt(1.0 + f64::from(pass))
}

/// A pass of progressive photon mapping, and how far it narrows radii.
#[derive(Debug, Clone, Copy)]
pub(super) struct ProgressivePass {
    /// From 0.
    pub index: u32,
    alpha: f64,
    /// Of the first pass's squared radius.
    squared: f64,
}

impl ProgressivePass {
    /// The first one.
    pub fn first(alpha: f64) -> Self {
        Self {
            index: 0,
            alpha,
            squared: 1.0,
        }
    }

    /// Another one: r_(i+1)^2 = r_i^2 (i + alpha) / (i + 1), i from 1. The mean over passes then converges, its bias falling
    /// with the radius: Knaus and Zwicker 2011, "Progressive photon mapping: a probabilistic approach", eq. 15.
    pub fn go_to(&mut self, index: u32) {
        if index < self.index {
            *self = Self::first(self.alpha);
        }
        for i in self.index + 1..=index {
            self.squared *= (f64::from(i) + self.alpha) / (f64::from(i) + 1.0);
        }
        self.index = index;
    }

    /// Its radius, of the first pass's.
    pub fn radius_m(&self, first_radius_m: f64) -> f64 {
        (first_radius_m * first_radius_m * self.squared)
            .sqrt()
            .max(LEAST_RADIUS_M)
    }
}

/// Radius of progressive pass `pass` (from 0).
pub fn progressive_radius_m(first_radius_m: f64, alpha: f64, pass: u32) -> f64 {
    let mut at = ProgressivePass::first(alpha);
    at.go_to(pass);
    at.radius_m(first_radius_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_bound_takes_falls_over_progressive_passes() {
        // To first order it is in inverse proportion to the bound; the mean of 1 / sqrt(i) for i up to n is 2 / sqrt(n) but for 1.5 / n.
        for passes in [100, 10_000] {
            let taken = (0..passes).map(|pass| 1.0 / most_correction(pass));
            let mean = taken.sum::<f64>() / f64::from(passes);
            let expected = 2.0 / (8.0 * f64::from(passes).sqrt());
            assert!((mean - expected).abs() < 1.5 / (8.0 * f64::from(passes)));
            assert!(mean < 0.25 * (1.0 / most_correction(0)));
        }
    }
}
