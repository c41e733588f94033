//! The frame as a list: which passes a scene and its settings make run, in which order, and what each reads, writes and
//! keeps from the frame before. No device is needed to know.

use serde::Serialize;

use crate::gpu::shaders::ShaderFeatures;
use crate::passes::{self, Pass};
use crate::settings::{Eyes as EyeChoice, Method, RenderSettings, Search};

use super::choices::{carries_indirect, forms_caustics, sample_passes, stereo_passes};
use super::reconstruction::ReconstructionPlan;

/// Passes that run one after the other, and when.
#[derive(Debug, Clone, Serialize)]
pub struct Stage {
    /// Name, as pass times begin with it where they do.
    pub stage: &'static str,
    /// How often.
    pub when: &'static str,
    /// In order. Passes that a stage runs several times are named once.
    pub passes: Vec<StagePass>,
}

/// One pass of a stage.
#[derive(Debug, Clone, Serialize)]
pub struct StagePass {
    /// Name of pass and shader.
    pub pass: &'static str,
    /// One sentence.
    pub what: &'static str,
    /// Buffers that it only reads, besides the scene's.
    pub reads: &'static [&'static str],
    /// Buffers that it writes.
    pub writes: &'static [&'static str],
    /// Those of `reads` that hold what the frame before has left.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub keeps: Vec<&'static str>,
}

impl From<&&'static Pass> for StagePass {
    fn from(pass: &&'static Pass) -> Self {
        let is_kept = |name: &&str| passes::KEPT.iter().any(|(kept, _)| kept == name);
        Self {
            pass: pass.name,
            what: pass.what,
            reads: pass.reads,
            writes: pass.writes,
            keeps: pass.reads.iter().copied().filter(is_kept).collect(),
        }
    }
}

fn stage(
    stage: &'static str,
    when: &'static str,
    passes: impl IntoIterator<Item = &'static Pass>,
) -> Stage {
    Stage {
        stage,
        when,
        passes: passes
            .into_iter()
            .map(|pass| StagePass::from(&pass))
            .collect(),
    }
}

/// The stages of a frame of a scene with `features`, in order.
#[must_use]
pub fn frame_list(
    settings: &RenderSettings,
    features: &ShaderFeatures,
    eyes: EyeChoice,
) -> Vec<Stage> {
    let mut list = Vec::new();
    let photon = settings.method == Method::Photon;
    let caustics = photon && forms_caustics(features);
    if photon {
        let tree = settings.photon.search == Search::KdTree;
        let map = |batch: &'static [&'static Pass], tree: bool| {
            let (layout, finish) = if tree {
                (
                    [passes::PHOTON_EXTENT, passes::KD_ORDER, passes::KD_LEVEL],
                    passes::KD_FINISH,
                )
            } else {
                ([passes::PHOTON_GRID, &[], &[]], passes::PHOTON_FINISH)
            };
            let sorting = passes::SCAN.iter().chain(passes::RADIX_DIGIT);
            batch
                .iter()
                .chain(layout.into_iter().flatten())
                .chain(sorting)
                .chain(finish)
                .copied()
        };
        let when = if settings.photon.every_frame {
            "every frame"
        } else if settings.photon.progressive {
            "every sample"
        } else {
            "when the map is missing or something has moved: all, or a share per frame"
        };
        list.push(stage("photons", when, map(passes::PHOTON_BATCH, tree)));
        if caustics {
            list.push(stage(
                "photons.caustics",
                when,
                map(passes::CAUSTIC_BATCH, false),
            ));
        }
    }
    let sample = sample_passes(settings, caustics);
    let whole = || {
        sample.iter().flat_map(|&pass| {
            let half_rate = settings.photon.half_rate && passes::GATHERS.contains(&pass);
            let [before, after] = if half_rate {
                [passes::COARSE_FIRST, passes::COARSE_SPREAD]
            } else {
                [&[][..]; 2]
            };
            let gathers_again = half_rate.then_some(pass);
            let around = before.iter().copied().chain([pass]);
            around.chain(after.iter().copied()).chain(gathers_again)
        })
    };
    list.push(stage("left", "every sample", whole()));
    let both = eyes == EyeChoice::Both;
    if both {
        let stereo = stereo_passes(settings.reuse);
        if stereo.is_empty() {
            list.push(stage("right", "every sample", whole()));
        } else {
            let fill = sample.into_iter().flat_map(|pass| {
                let before =
                    carries_indirect(settings, features) && passes::GATHERS.contains(&pass);
                let carried: &[&Pass] = if before { passes::FILL_INDIRECT } else { &[] };
                carried.iter().copied().chain([pass])
            });
            let reuse = stereo.iter().copied();
            let reasons = passes::FILL_REASONS.iter().copied();
            list.push(stage(
                "right",
                "every sample: what can be taken over",
                reuse,
            ));
            list.push(stage(
                "right",
                "every sample: pixels that stayed empty",
                fill.chain(reasons),
            ));
        }
    }
    if let Some(plan) = ReconstructionPlan::of(&settings.reconstruct, both) {
        list.push(stage(
            "reconstruction",
            "once per eye, after all samples",
            plan.passes(),
        ));
    }
    list
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(settings: &RenderSettings, eyes: EyeChoice) -> Vec<&'static str> {
        frame_list(settings, &ShaderFeatures::new(), eyes)
            .iter()
            .flat_map(|stage| stage.passes.iter().map(|pass| pass.pass))
            .collect()
    }

    #[test]
    fn a_stage_is_listed_only_where_it_runs() {
        let mut settings = RenderSettings::default();
        let plain = names(&settings, EyeChoice::Both);
        assert!(plain.contains(&"photon_trace") && plain.contains(&"reuse_resolve"));
        assert!(!plain.contains(&"motion") && !plain.contains(&"caustic_trace"));
        assert!(!names(&settings, EyeChoice::Left).contains(&"reuse_resolve"));
        settings.method = Method::Path;
        settings.reconstruct.svgf = true;
        let path = names(&settings, EyeChoice::Both);
        assert!(!path.contains(&"photon_trace") && path.contains(&"stereo_share"));
        assert!(!path.contains(&"taa"));
        assert!(!names(&settings, EyeChoice::Left).contains(&"stereo_share"));
    }

    #[test]
    fn what_is_kept_is_written_by_one_pass_and_read_by_another() {
        for (kept, written) in passes::KEPT {
            let reads = passes::ALL.iter().any(|pass| pass.reads.contains(kept));
            let writes = passes::ALL.iter().any(|pass| pass.writes.contains(written));
            assert!(reads && writes, "{kept} of {written}");
        }
    }

    #[test]
    fn no_pass_writes_what_it_reads() {
        for pass in passes::ALL {
            for name in pass.writes {
                assert!(!pass.reads.contains(name), "{} of {}", name, pass.name);
            }
        }
    }
}
