//! What the rounds of a variant add up to: series of figures, one per round, and the records made of them.

use std::collections::BTreeMap;

use crate::records::{BiasVariance, REFERENCE_SHARE, RegionErrors, StereoFigures, Timing};
use crate::statistics::{Spread, mean, median, paired_ratio, spread};

/// Figures of a name, one per round.
type Series = BTreeMap<String, Vec<f64>>;

/// Milliseconds of a variant, round by round.
#[derive(Debug, Default)]
pub struct TimeSamples {
    ms: Series,
    pass_ms: Series,
}

impl TimeSamples {
    /// Takes in a round's milliseconds of a group of passes.
    pub fn add(&mut self, group: &str, ms: f64) {
        self.ms.entry(group.to_owned()).or_default().push(ms);
    }

    /// Takes in a round's milliseconds of a pass.
    pub fn add_pass(&mut self, name: &str, ms: f64) {
        self.pass_ms.entry(name.to_owned()).or_default().push(ms);
    }

    /// Milliseconds of a group of passes, round by round.
    #[must_use]
    pub fn ms(&self, group: &str) -> &[f64] {
        self.ms.get(group).map_or(&[], Vec::as_slice)
    }

    /// Medians and spreads, and ratios to the first variant's times, round by round. `clock` as in [`Timing::clock`].
    #[must_use]
    pub fn timing(&self, first: &Self, clock: &str, rounds: u32, warm_up: u32) -> Timing {
        let spreads = |all: &Series| -> BTreeMap<String, Spread> {
            all.iter()
                .filter_map(|(name, values)| Some((name.clone(), spread(values)?)))
                .collect()
        };
        let ratio = self.ms.iter().filter_map(|(name, values)| {
            Some((name.clone(), paired_ratio(values, first.ms.get(name)?)?))
        });
        Timing {
            clock: clock.to_owned(),
            rounds,
            warm_up,
            ms: spreads(&self.ms),
            ratio: ratio.collect(),
            pass_ms: spreads(&self.pass_ms),
        }
    }
}

/// Errors of one part of the picture, one per judged round.
#[derive(Debug, Default)]
pub struct RegionSamples {
    /// Pixels.
    pub pixels: Vec<f64>,
    /// Relative MSE, of the rounds where it is defined.
    pub rel_mse: Vec<f64>,
    /// Root mean square error.
    pub rmse: Vec<f64>,
    /// (mean - reference's mean) / reference's mean, of the rounds where it is defined.
    pub mean_rel_bias: Vec<f64>,
    /// FLIP; empty for a part of an eye.
    pub flip: Vec<f64>,
    /// Relative MSE of the group's first variant on the same pixels.
    pub first_rel_mse: Vec<f64>,
}

impl RegionSamples {
    /// The record of them. `reference_variance` in units of relative MSE.
    #[must_use]
    pub fn errors(
        &self,
        bias_variance: Option<BiasVariance>,
        reference_variance: Option<f64>,
    ) -> RegionErrors {
        let rel_mse = mean(&self.rel_mse);
        RegionErrors {
            pixels: mean(&self.pixels).map_or(0.0, |found| found.value),
            rel_mse,
            rmse: mean(&self.rmse),
            mean_rel_bias: mean(&self.mean_rel_bias),
            flip: mean(&self.flip),
            bias_variance,
            rel_mse_ratio: paired_ratio(&self.rel_mse, &self.first_rel_mse),
            reference_variance,
            reference_settled: rel_mse
                .zip(reference_variance)
                .is_some_and(|(error, variance)| variance <= REFERENCE_SHARE.powi(2) * error.value),
        }
    }
}

/// Stereo reuse of a variant, round by round.
#[derive(Debug, Default)]
pub struct StereoSamples {
    /// Reused over all right-eye pixels that see a surface.
    pub reuse_fraction: Vec<f64>,
    /// Pixels reused.
    pub reused: Vec<f64>,
    /// Pixels filled.
    pub filled: Vec<f64>,
    /// Why, by reason.
    pub because: Series,
    /// Binocular relative MSE, of judged rounds in which both eyes see a point.
    pub binocular: Vec<f64>,
    /// Pairs of pixels that it is a mean over.
    pub pairs: Vec<f64>,
}

impl StereoSamples {
    /// The record of them; `None` without a right eye.
    #[must_use]
    pub fn figures(&self, first: &Self) -> Option<StereoFigures> {
        if self.reuse_fraction.is_empty() && self.binocular.is_empty() {
            return None;
        }
        let middle = |values: &[f64]| median(values).unwrap_or(0.0);
        Some(StereoFigures {
            reuse_fraction: spread(&self.reuse_fraction).unwrap_or_default(),
            reused: middle(&self.reused),
            filled: middle(&self.filled),
            because: self
                .because
                .iter()
                .map(|(reason, counts)| (reason.clone(), middle(counts)))
                .collect(),
            binocular_rel_mse: mean(&self.binocular),
            binocular_ratio: paired_ratio(&self.binocular, &first.binocular),
            binocular_pairs: middle(&self.pairs),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reference_settles_an_error_of_ten_times_its_own() {
        let samples = RegionSamples {
            rel_mse: vec![1.0, 1.0],
            first_rel_mse: vec![0.25, 0.25],
            ..RegionSamples::default()
        };
        // The roots are to be 1 to 10.
        assert!(samples.errors(None, Some(0.01)).reference_settled);
        assert!(!samples.errors(None, Some(0.0101)).reference_settled);
        assert!(!samples.errors(None, None).reference_settled);
        let ratio = samples.errors(None, None).rel_mse_ratio.unwrap();
        assert_eq!((ratio.median, ratio.count), (4.0, 2));
    }

    #[test]
    fn times_are_compared_round_by_round() {
        let [mut first, mut own] = [TimeSamples::default(), TimeSamples::default()];
        for slow in [1.0, 10.0, 3.0] {
            first.add("frame", slow);
            own.add("frame", 1.5 * slow);
            own.add("fill", slow);
            own.add_pass("left.direct_light", slow);
        }
        let timing = own.timing(&first, "device", 3, 1);
        assert_eq!(timing.ms["frame"].median, 4.5);
        assert_eq!(timing.ratio["frame"].mad, 0.0);
        assert!(!timing.ratio.contains_key("fill"), "the first has none");
        assert_eq!(timing.pass_ms["left.direct_light"].count, 3);
    }

    #[test]
    fn what_has_no_right_eye_has_no_reuse() {
        let none = StereoSamples::default();
        assert!(none.figures(&none).is_none());
        let judged = StereoSamples {
            binocular: vec![0.5],
            pairs: vec![7.0],
            ..StereoSamples::default()
        };
        let found = judged.figures(&judged).unwrap();
        assert_eq!(found.binocular_pairs, 7.0);
        assert_eq!(found.reuse_fraction.count, 0);
    }
}
