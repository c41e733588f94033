//! What the rounds of a variant add up to: times, errors by part of the picture, noise, reuse.

use std::collections::BTreeMap;

use stereolux_report::records::{RegionErrors, StereoFigures, Timing, leaves};
use stereolux_report::samples::{RegionSamples, StereoSamples, TimeSamples};

use super::BenchError;
use super::reference::Reference;
use crate::frame::passes::Pass;
use crate::frame::plan::{GATHERS, PATH_PASSES};
use crate::images::{Image, ImageRgb};
use crate::metrics::{
    Comparison, FlipView, Mask, MetricsError, RenderMoments, binocular_error, compare, error_image,
};
use crate::renderer::{FrameResult, Provenance, Renderer};
use crate::settings::{Method, RenderSettings, Reuse};

/// One frame of one variant.
pub struct Frame {
    /// Times and counters.
    pub result: FrameResult,
    /// Host milliseconds of the whole frame, waiting for the device included.
    pub host_ms: f64,
    /// Left and right eye, where read.
    pub images: [Option<ImageRgb>; 2],
    /// Provenance of the right eye's pixels, where there is reuse.
    pub provenance: Option<Vec<u32>>,
}

/// What frames are judged by.
#[derive(Default)]
pub struct Truth {
    /// References of both eyes.
    pub references: [Option<Reference>; 2],
    /// Left pixel that sees what a right pixel sees.
    pub correspondence: Option<Image<Option<u32>>>,
}

/// Names of the eyes as parts of the picture.
const EYES: [&str; 2] = ["left", "right"];
/// Reused pixels of the right eye.
const REUSED: &str = "right_reused";
/// Filled pixels of the right eye.
const FILLED: &str = "right_filled";

/// Everything of one variant, round by round.
#[derive(Default)]
pub struct VariantStatistics {
    times: TimeSamples,
    regions: BTreeMap<&'static str, RegionSamples>,
    /// Parts of an eye, as of the last judged round.
    masks: BTreeMap<&'static str, Mask>,
    moments: [Option<RenderMoments>; 2],
    noise: Vec<f64>,
    previous: Option<ImageRgb>,
    stereo: StereoSamples,
    last: FrameResult,
}

/// The parts of an eye beside the whole: for a right eye that reuses, reused and filled pixels.
pub fn region_masks(frame: &Frame, eye: usize, size: [u32; 2]) -> Vec<(&'static str, Mask)> {
    let Some(provenance) = frame.provenance.as_ref().filter(|_| eye == 1) else {
        return Vec::new();
    };
    let mask = |wanted: fn(u32) -> bool| Mask {
        width: size[0],
        height: size[1],
        pixels: provenance.iter().map(|&code| wanted(code)).collect(),
    };
    vec![
        (REUSED, mask(Provenance::is_reused)),
        (
            FILLED,
            mask(|code| !Provenance::is_reused(code) && code != Provenance::Background as u32),
        ),
    ]
}

/// Errors of a part of an image; `None` where it has no pixel.
///
/// # Errors
/// [`MetricsError`] for sizes that differ.
pub fn judge_part(
    image: &ImageRgb,
    truth: &ImageRgb,
    mask: Option<&Mask>,
) -> Result<Option<Comparison>, BenchError> {
    match compare(image, truth, mask, FlipView::default()) {
        Ok(comparison) => Ok(Some(comparison)),
        Err(MetricsError::NothingCounted(_)) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

/// What finding photons costs: `build` is what follows their tracing (prefix sums over paths, the same for every search,
/// included, caustics not), `gather` the pass that finds them for the eyes, `build_gather` both. A fused kernel has no
/// such pass.
fn search_groups(times: &BTreeMap<String, (f64, u32)>) -> Vec<(&'static str, f64)> {
    let is_one_of = |name: &str, list: &[&Pass]| list.iter().any(|pass| pass.name == name);
    let (mut build, mut gather) = (0.0, None);
    for (name, (ms, _)) in times {
        match name.split_once('.') {
            Some(("photons", pass)) => {
                let traces = is_one_of(pass, &PATH_PASSES);
                if !traces && !pass.starts_with("caustics.") {
                    build += ms;
                }
            }
            Some((eye, pass)) if EYES.contains(&eye) && is_one_of(pass, &GATHERS) => {
                *gather.get_or_insert(0.0) += ms;
            }
            _ => (),
        }
    }
    let mut groups = vec![("build", build)];
    if let Some(gather) = gather {
        groups.extend([("gather", gather), ("build_gather", build + gather)]);
    }
    groups
}

impl VariantStatistics {
    /// Takes a frame's times and counters in.
    pub fn time(&mut self, frame: &Frame, settings: &RenderSettings) {
        let times = &frame.result.times.passes;
        let reuses = settings.reuse != Reuse::Off;
        let sum = |wanted: &dyn Fn(&str) -> bool| frame.result.times.sum_ms(wanted);
        let under = |prefix: &'static str| move |name: &str| name.starts_with(prefix);
        let mut groups = vec![
            ("host_update", frame.result.cpu_ms.update),
            ("host_frame", frame.host_ms),
        ];
        if !times.is_empty() {
            let (left, right) = (sum(&under("left.")), sum(&under("right.")));
            groups.extend([
                ("left", left),
                ("eyes", left + right),
                ("frame", frame.result.times.total_ms()),
            ]);
            if settings.method == Method::Photon {
                groups.push(("photons", sum(&under("photons."))));
                groups.extend(search_groups(times));
            }
            if right > 0.0 {
                groups.push(("right", right));
            }
            if right > 0.0 && reuses {
                // What fills is what renders the left eye.
                let fills = |name: &str| {
                    let pass = name.strip_prefix("right.");
                    pass.is_some_and(|pass| times.contains_key(&format!("left.{pass}")))
                };
                let filling = sum(&fills);
                groups.extend([("fill", filling), ("carry", right - filling)]);
            }
        }
        for (name, ms) in groups {
            self.times.add(name, ms);
        }
        for (name, (ms, _)) in times {
            self.times.add_pass(name, *ms);
        }
        if reuses {
            let stereo = &frame.result.stereo;
            self.stereo.reuse_fraction.push(stereo.reuse_fraction);
            self.stereo.reused.push(f64::from(stereo.reused));
            self.stereo.filled.push(f64::from(stereo.filled));
            for (reason, count) in leaves(&stereo.filled_because) {
                let counts = self.stereo.because.entry(reason).or_default();
                counts.extend(count.as_f64());
            }
        }
        self.last = frame.result.clone();
    }

    /// Judges a frame beside the first variant's frame of the same round. `still`: every round shows the same view, so that
    /// rounds can be averaged.
    ///
    /// # Errors
    /// [`BenchError::Metrics`].
    pub fn judge(
        &mut self,
        frame: &Frame,
        first: &Frame,
        truth: &Truth,
        still: bool,
    ) -> Result<(), BenchError> {
        if still {
            self.add_noise(frame);
        }
        let mut signed_errors = [None, None];
        for eye in 0..2 {
            let (Some(image), Some(reference)) = (&frame.images[eye], &truth.references[eye])
            else {
                continue;
            };
            let truth = reference.moments.mean_image();
            signed_errors[eye] = Some(error_image(image, &truth)?);
            if still {
                self.moments[eye]
                    .get_or_insert_with(|| RenderMoments::new(image.width, image.height))
                    .add(image)?;
            }
            let parts = region_masks(frame, eye, [truth.width, truth.height]);
            let parts = parts.into_iter().map(|(name, mask)| (name, Some(mask)));
            for (name, mask) in std::iter::once((EYES[eye], None)).chain(parts) {
                let Some(found) = judge_part(image, &truth, mask.as_ref())? else {
                    continue;
                };
                let beside = match &first.images[eye] {
                    Some(beside) => judge_part(beside, &truth, mask.as_ref())?,
                    None => None,
                };
                let region = self.regions.entry(name).or_default();
                region.pixels.push(found.pixels as f64);
                region.rmse.push(found.rmse);
                region.rel_mse.extend(found.rel_mse);
                region.mean_rel_bias.extend(found.mean_rel_bias);
                if mask.is_none() {
                    region.flip.push(found.flip);
                }
                region
                    .first_rel_mse
                    .extend(beside.and_then(|beside| beside.rel_mse));
                if let Some(mask) = mask {
                    self.masks.insert(name, mask);
                }
            }
        }
        if let ([Some(left), Some(right)], Some(map), Some(reference)) =
            (&signed_errors, &truth.correspondence, &truth.references[1])
        {
            match binocular_error(left, right, &reference.moments.mean_image(), map) {
                Ok(found) => {
                    self.stereo.binocular.extend(found.rel_mse);
                    self.stereo.pairs.push(found.pairs as f64);
                }
                // Eyes that share no point have nothing to disagree about.
                Err(MetricsError::NothingCounted(_)) => {}
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }

    /// Noise from two successive frames x and y: half the mean of (x - y)^2 over the mean of ((x + y) / 2)^2.
    fn add_noise(&mut self, frame: &Frame) {
        let Some(image) = &frame.images[0] else {
            return;
        };
        if let Some(previous) = self.previous.take() {
            let (mut square, mut level) = (0.0, 0.0);
            let channels = image.pixels.iter().flatten();
            for (x, y) in channels.zip(previous.pixels.iter().flatten()) {
                let (x, y) = (f64::from(*x), f64::from(*y));
                square += 0.5 * (x - y).powi(2);
                level += (0.5 * (x + y)).powi(2);
            }
            if level > 0.0 && square.is_finite() {
                self.noise.push(square / level);
            }
        } else {
            self.previous = Some(image.clone());
        }
    }

    /// Noise of each pair of frames; pairs share no frame.
    pub fn noise(&self) -> &[f64] {
        &self.noise
    }

    /// The last frame.
    pub fn last(&self) -> &FrameResult {
        &self.last
    }

    /// Times, and their ratios to the first variant's.
    pub fn timing(&self, first: &Self, renderer: &Renderer, rounds: u32, warm_up: u32) -> Timing {
        let clock = super::clock(renderer.context());
        self.times.timing(&first.times, clock, rounds, warm_up)
    }

    /// Errors by part of the picture.
    pub fn errors(&self, truth: &Truth) -> BTreeMap<String, RegionErrors> {
        let errors = |(name, region): (&&'static str, &RegionSamples)| {
            let eye = usize::from(*name != EYES[0]);
            let mask = self.masks.get(name);
            let reference = truth.references[eye].as_ref().map(|found| &found.moments);
            let bias_variance = self.moments[eye]
                .as_ref()
                .zip(reference)
                .filter(|_| mask.is_none())
                .and_then(|(moments, reference)| moments.bias_and_variance(reference).ok());
            let variance = reference.and_then(|found| found.relative_variance_of_mean(mask));
            ((*name).to_owned(), region.errors(bias_variance, variance))
        };
        self.regions.iter().map(errors).collect()
    }

    /// Reuse and binocular error; `None` without a right eye.
    pub fn stereo(&self, first: &Self) -> Option<StereoFigures> {
        self.stereo.figures(&first.stereo)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(right: f32, passes: &[(&str, f64)]) -> Frame {
        let mut result = FrameResult::default();
        for &(name, ms) in passes {
            result.times.passes.insert(name.to_owned(), (ms, 1));
        }
        Frame {
            result,
            host_ms: 100.0,
            images: [
                Some(Image::filled(16, 16, [1.0; 3]).unwrap()),
                Some(Image::filled(16, 16, [right; 3]).unwrap()),
            ],
            // First column background, the next seven reused, the rest filled.
            provenance: Some(
                (0..256)
                    .map(|i| match i % 16 {
                        0 => Provenance::Background as u32,
                        1..8 => Provenance::Reused as u32,
                        _ => Provenance::Gap as u32,
                    })
                    .collect(),
            ),
        }
    }

    fn reference(level: f32) -> Reference {
        let mut moments = RenderMoments::new(16, 16);
        for _ in 0..2 {
            moments
                .add(&Image::filled(16, 16, [level; 3]).unwrap())
                .unwrap();
        }
        Reference {
            moments,
            capped: false,
        }
    }

    #[test]
    fn passes_are_summed_into_their_groups() {
        let mut statistics = VariantStatistics::default();
        let settings = RenderSettings::default();
        let passes = [
            ("photons.photon_trace", 7.0),
            ("photons.kd_move", 0.75),
            ("photons.caustics.cell_count", 0.25),
            ("left.photon_gather", 4.0),
            ("right.scatter_depth", 0.5),
            ("right.photon_gather", 1.0),
        ];
        statistics.time(&frame(1.0, &passes), &settings);
        let of = |name: &str| statistics.times.ms(name)[0];
        assert_eq!((of("photons"), of("left"), of("right")), (8.0, 4.0, 1.5));
        assert_eq!((of("eyes"), of("frame")), (5.5, 13.5));
        assert_eq!((of("fill"), of("carry")), (1.0, 0.5));
        assert_eq!((of("build"), of("gather")), (0.75, 5.0));
        assert_eq!(of("build_gather"), 5.75);
        assert_eq!(of("host_frame"), 100.0);
        // One kernel for tracing and gathering: what it spends on which is not known.
        let mut fused = VariantStatistics::default();
        fused.time(&frame(1.0, &[("left.eye_fused", 4.0)]), &settings);
        assert!(fused.times.ms("gather").is_empty() && fused.times.ms("build") == [0.0]);
    }

    #[test]
    fn parts_are_judged_apart_and_against_the_first_variant_on_the_same_pixels() {
        // The reference is 2; this variant's right eye shows 3, the first variant's 2.5: relative MSE 1 / 4.04 against
        // 0.25 / 4.04, on every part alike, so the ratio is 4.
        let truth = Truth {
            references: [Some(reference(1.0)), Some(reference(2.0))],
            correspondence: Some(
                Image::new(16, 16, (0..256).map(Some).collect::<Vec<_>>()).unwrap(),
            ),
        };
        let mut statistics = VariantStatistics::default();
        for _ in 0..3 {
            statistics
                .judge(&frame(3.0, &[]), &frame(2.5, &[]), &truth, true)
                .unwrap();
        }
        let errors = statistics.errors(&truth);
        assert_eq!(
            errors.keys().collect::<Vec<_>>(),
            ["left", "right", "right_filled", "right_reused"]
        );
        for (name, pixels) in [("right", 256.0), (REUSED, 112.0), (FILLED, 128.0)] {
            let found = &errors[name];
            assert_eq!(found.pixels, pixels, "{name}");
            assert!((found.rel_mse.unwrap().value - 1.0 / 4.04).abs() < 1e-12);
            assert!((found.rel_mse_ratio.unwrap().median - 4.0).abs() < 1e-12);
            assert_eq!(found.flip.is_some(), name == "right");
            assert!(
                found.reference_settled,
                "a reference without spread is exact"
            );
        }
        assert_eq!(errors["left"].rel_mse.unwrap().value, 0.0);
        // The eyes' errors are 0 and 1 everywhere: they disagree by 1.
        assert!((statistics.stereo.binocular[0] - 1.0 / 4.04).abs() < 1e-12);
        // A bias of 1 without noise.
        let split = errors["right"].bias_variance.unwrap();
        assert!((split.bias_squared - 1.0 / 4.04).abs() < 1e-12 && split.variance == 0.0);
    }

    #[test]
    fn a_noisy_reference_does_not_count_as_settled() {
        let mut noisy = RenderMoments::new(16, 16);
        for level in [1.5, 2.5] {
            noisy
                .add(&Image::filled(16, 16, [level; 3]).unwrap())
                .unwrap();
        }
        // Variance of the mean 0.25 / 4.04, error 1 / 4.04: a share of 1/2, not 1/10.
        let truth = Truth {
            references: [
                None,
                Some(Reference {
                    moments: noisy,
                    capped: true,
                }),
            ],
            correspondence: None,
        };
        let mut statistics = VariantStatistics::default();
        let shown = frame(3.0, &[]);
        statistics.judge(&shown, &shown, &truth, true).unwrap();
        assert!(!statistics.errors(&truth)["right"].reference_settled);
    }

    #[test]
    fn noise_is_half_the_square_difference_of_pairs() {
        let mut statistics = VariantStatistics::default();
        let level = |value| {
            let mut shown = frame(0.0, &[]);
            shown.images[0] = Some(Image::filled(16, 16, [value; 3]).unwrap());
            shown
        };
        for value in [1.0, 3.0, 2.0] {
            statistics.add_noise(&level(value));
        }
        // (1, 3): half of 4 over 2^2; the third frame waits for a partner.
        assert_eq!(statistics.noise(), [0.5]);
    }
}
