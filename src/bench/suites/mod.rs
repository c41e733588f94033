//! The suites: which groups of variants each measures. A plan is data; [`plans`] makes it, and nothing is rendered here.

mod pareto;
mod scaling;
mod stereo;
mod tables;

use std::collections::BTreeMap;

use serde_json::Value;

use super::instance_motion::InstanceMotion;
use super::measure::{Candidate, GroupPlan, ViewPlan};
use super::scenes::SceneSource;
use super::{BenchError, scenes_or};
use crate::options::{BenchOptions, Suite};
use crate::scene::Scene;
use crate::settings::{Eyes, RenderSettings, Settings};
use crate::xr::{Fov, Headset};

pub use super::scenes::INDIRECT_SCENE;

/// Sizes of a suite: the full ones, or those that fit into two minutes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// What the suite is for.
    Full,
    /// A little of everything.
    Smoke,
}

/// What all groups of a suite share.
#[derive(Clone, Debug)]
pub struct SuiteBase {
    /// Settings under those that a suite varies.
    pub settings: Settings,
    /// Scenes by name.
    pub scenes: Vec<String>,
    /// Pixels per eye.
    pub size: [u32; 2],
    /// Rounds that count.
    pub rounds: u32,
    /// Rounds before them.
    pub warm_up: u32,
    /// Frames of the recorded trace.
    pub frames: u32,
    /// Full or smoke.
    pub extent: Extent,
}

impl SuiteBase {
    /// A group as most are: one eye from the start, without a reference.
    fn group(
        &self,
        suite: &'static str,
        name: String,
        scene: SceneSource,
        (headset, headset_label): &(Headset, String),
        candidates: Vec<Candidate>,
    ) -> GroupPlan {
        GroupPlan {
            suite,
            name,
            scene,
            headset: headset.clone(),
            headset_label: headset_label.clone(),
            views: ViewPlan::Start,
            size: self.size,
            eyes: Eyes::Left,
            filter: None,
            candidates,
            rounds: self.rounds,
            warm_up: self.warm_up,
        }
    }
}

/// Rounds without `--rounds`.
pub const ROUNDS: u32 = 8;
/// The same in `smoke`.
const SMOKE_ROUNDS: u32 = 3;
/// Frames of the recorded trace without `--frames`.
pub const FRAMES: u32 = 24;
/// The same in `smoke`.
const SMOKE_FRAMES: u32 = 4;
/// Pixels per eye without `--size`.
pub const SIZE: [u32; 2] = [256, 256];
/// The same in `smoke`.
const SMOKE_SIZE: [u32; 2] = [32, 32];
/// Most samples per pixel of a reference without `--reference-spp`, in `smoke` too: with fewer its references miss what is
/// asked of them.
pub const REFERENCE_SAMPLES: u32 = 4096;
/// Photons in `smoke`, unless the settings name another number.
const SMOKE_PHOTONS: u32 = 4096;

/// Most samples per pixel of a reference.
#[must_use]
pub fn reference_samples(options: &BenchOptions) -> u32 {
    options.reference_spp.unwrap_or(REFERENCE_SAMPLES)
}

fn base(options: &BenchOptions) -> SuiteBase {
    let extent = match options.suite {
        Suite::Smoke => Extent::Smoke,
        _ => Extent::Full,
    };
    let pick = |full: u32, smoke: u32| match extent {
        Extent::Full => full,
        Extent::Smoke => smoke,
    };
    let size = options.settings.size.unwrap_or(match extent {
        Extent::Full => SIZE,
        Extent::Smoke => SMOKE_SIZE,
    });
    let mut settings = options.settings.clone();
    // Frames are to be independent renders, and to be timed.
    let render = &mut settings.render;
    render.photon.every_frame = true;
    render.gpu.timestamps = true.into();
    render.spp = 1;
    if extent == Extent::Smoke && render.photon.count == RenderSettings::default().photon.count {
        render.photon.count = SMOKE_PHOTONS;
    }
    let default_scenes: &[&str] = match options.suite {
        Suite::Stereo => &["builtin:cornell", "builtin:gallery", "builtin:caustic"],
        Suite::Pareto => &[
            "builtin:cornell",
            "builtin:gallery",
            "builtin:caustic",
            INDIRECT_SCENE,
        ],
        Suite::Scaling | Suite::Tables | Suite::Smoke | Suite::Work | Suite::Motion => {
            &["builtin:cornell"]
        }
    };
    SuiteBase {
        scenes: scenes_or(options, default_scenes),
        settings,
        size,
        rounds: options.rounds.unwrap_or(pick(ROUNDS, SMOKE_ROUNDS)),
        warm_up: pick(2, 1),
        frames: options.frames.unwrap_or(pick(FRAMES, SMOKE_FRAMES)),
        extent,
    }
}

/// The groups of a suite, in the order in which they are measured.
///
/// # Errors
/// [`BenchError`]: a scene or headset that cannot be read.
pub fn plans(options: &BenchOptions) -> Result<Vec<GroupPlan>, BenchError> {
    let base = base(options);
    Ok(match options.suite {
        Suite::Tables => tables::plans(&base)?,
        Suite::Stereo => stereo::plans(&base)?,
        Suite::Pareto => pareto::plans(&base)?,
        Suite::Scaling => scaling::plans(&base)?,
        // They compare no variants ([`super::motion`], [`super::work`]).
        Suite::Motion | Suite::Work => Vec::new(),
        Suite::Smoke => {
            let mut all = tables::plans(&base)?;
            all.extend(stereo::plans(&base)?);
            all.extend(pareto::plans(&base)?);
            all.extend(scaling::plans(&base)?);
            all
        }
    })
}

/// A scene of the suite, for what its plan depends on.
fn scene_of(name: &str, base: &SuiteBase) -> Result<Scene, BenchError> {
    SceneSource::Named(name.to_owned()).load(&base.settings)
}

/// The settings' headset with the opening of the scene's camera, where it has one, so that the scene fills the picture
/// instead of a corner of a headset's wide view; and what that is in words.
pub(super) fn framing_headset(
    settings: &Settings,
    size: [u32; 2],
    scene: &Scene,
) -> Result<(Headset, String), BenchError> {
    let own = Headset::load(&settings.headset)?;
    let camera = scene.start_camera().and_then(|camera| camera.yfov_rad);
    let Some(yfov_rad) = camera else {
        let label = format!("{}, its own view", own.name);
        return Ok((own, label));
    };
    let up = 0.5 * f64::from(yfov_rad);
    let aspect = f64::from(size[0]) / f64::from(size[1]);
    let right = (up.tan() * aspect).atan();
    let [up, right] = [up, right].map(|angle| angle.to_degrees().min(89.0));
    let label = format!(
        "{}, parallel eyes, {:.1} x {:.1} degrees",
        own.name,
        2.0 * right,
        2.0 * up
    );
    Ok((
        own.with_fov(Fov::from_degrees(-right, right, up, -up))?,
        label,
    ))
}

fn candidate(
    variant: impl Into<String>,
    settings: RenderSettings,
    factors: impl IntoIterator<Item = (&'static str, Value)>,
) -> Candidate {
    Candidate {
        variant: variant.into(),
        settings,
        factors: factors
            .into_iter()
            .map(|(name, value)| (name.to_owned(), value))
            .collect::<BTreeMap<_, _>>(),
        motion: InstanceMotion::Nothing,
    }
}

/// To three significant digits: radii in settings should be readable, and need not be exact.
fn three_digits(value: f64) -> f64 {
    if value <= 0.0 {
        return value;
    }
    let scale = 10.0_f64.powf(2.0 - value.log10().floor());
    (value * scale).round() / scale
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use std::ffi::OsString;

    use stereolux_report::records::DEFAULT_WAY;
    use stereolux_report::report_2020::photons_and_radii;

    use crate::options::{Options, parse};
    use crate::settings::{Choice as _, Reuse};

    fn options(suite: Suite) -> BenchOptions {
        let args = ["stereolux", "bench", suite.word()];
        match parse(args.map(OsString::from)) {
            Ok(Options::Bench(options)) => *options,
            other => panic!("{other:?}"),
        }
    }

    fn all_plans(suite: Suite) -> Vec<GroupPlan> {
        plans(&options(suite)).unwrap()
    }

    #[test]
    fn names_are_unique_and_every_group_has_variants() {
        let own = [Suite::Motion, Suite::Work];
        assert!(own.into_iter().all(|suite| all_plans(suite).is_empty()));
        for &suite in Suite::ALL.iter().filter(|suite| !own.contains(suite)) {
            let mut seen = BTreeSet::new();
            for plan in all_plans(suite) {
                assert!(
                    !plan.candidates.is_empty() && plan.rounds > 0,
                    "{}",
                    plan.name
                );
                for candidate in &plan.candidates {
                    let name = (plan.suite, plan.name.clone(), candidate.variant.clone());
                    assert!(seen.insert(name.clone()), "{name:?} twice");
                    assert!(candidate.settings.photon.every_frame);
                }
            }
            assert!(!seen.is_empty());
        }
    }

    #[test]
    fn stereo_takes_every_reuse_mode_from_the_enum_with_off_first() {
        for plan in all_plans(Suite::Stereo) {
            let modes: Vec<Reuse> = plan
                .candidates
                .iter()
                .map(|candidate| candidate.settings.reuse)
                .collect();
            assert_eq!(modes[0], Reuse::Off, "{}", plan.name);
            assert_eq!(modes.len(), Reuse::ALL.len());
        }
        let names: Vec<String> = all_plans(Suite::Stereo)
            .into_iter()
            .map(|plan| plan.name)
            .collect();
        for wanted in [
            "ipd 0 mm",
            "ipd 55 mm",
            "ipd 63 mm",
            "ipd 75 mm",
            "quest3",
            "trace",
        ] {
            assert!(
                names.iter().any(|name| name.contains(wanted)),
                "{wanted}: {names:?}"
            );
        }
    }

    #[test]
    fn pareto_covers_the_product_and_every_group_shares_its_first_variant() {
        let plans = all_plans(Suite::Pareto);
        let cornell: Vec<&GroupPlan> = plans
            .iter()
            .filter(|plan| plan.scene.name() == "builtin:cornell")
            .collect();
        let first = &cornell[0].candidates[0];
        let distinct: BTreeSet<String> = cornell
            .iter()
            .flat_map(|plan| &plan.candidates)
            .filter(|candidate| candidate.variant != first.variant)
            .map(|candidate| candidate.variant.clone())
            .collect();
        // 3 photon counts x 3 radii x 3 kernels x 2 sources of direct light x 2 samples, and 5 path tracers; half rate and a
        // single light sample with one of the kernels and one of the sources, the latter by paths as well.
        assert_eq!(distinct.len(), 3 * 3 * (3 * 2 + 2) * 2 + 5 * 2);
        for plan in cornell {
            assert_eq!(plan.candidates[0].settings, first.settings);
        }
    }

    #[test]
    fn scaling_spans_what_it_promises() {
        let plans = all_plans(Suite::Scaling);
        let span = |factor: &str| {
            let values: Vec<f64> = plans
                .iter()
                .flat_map(|plan| &plan.candidates)
                .filter_map(|candidate| candidate.factors.get(factor)?.as_f64())
                .collect();
            let least = values.iter().copied().fold(f64::INFINITY, f64::min);
            let most = values.iter().copied().fold(0.0, f64::max);
            (least, most)
        };
        assert_eq!(span("triangles"), (1e3, 2e6));
        assert_eq!(span("instances"), (1.0, 1e4));
        assert_eq!(span("lights"), (1.0, 1e4));
        assert_eq!(span("photons"), (f64::from(1 << 14), f64::from(1 << 22)));
        assert_eq!(span("pixels"), (4096.0, 2064.0 * 2208.0));
    }

    #[test]
    fn tables_hold_the_reports_rows() {
        let plans = all_plans(Suite::Tables);
        assert_eq!(plans.len(), 2 * photons_and_radii().len());
        for table in 1..=5 {
            let of_table = |plan: &&GroupPlan| {
                let last = plan.candidates.iter().filter(|candidate| {
                    candidate.factors["table"] == table && candidate.variant != "off"
                });
                last.count() > 0
            };
            let of_table: Vec<_> = plans.iter().filter(of_table).collect();
            let settings = of_table.iter().map(|plan| {
                let factors = &plan.candidates[0].factors;
                (
                    factors["photons"].as_u64().unwrap() as u32,
                    factors["radius"].as_f64().unwrap(),
                )
            });
            assert_eq!(
                settings.collect::<Vec<_>>(),
                photons_and_radii(),
                "table {table}"
            );
        }
        for plan in plans {
            for candidate in &plan.candidates {
                assert_eq!(candidate.settings.photon.check_gather(), Ok(()));
            }
            let first = &plan.candidates[0];
            let photon = RenderSettings::default().photon;
            assert_eq!(first.settings.photon.search, photon.search);
            assert!(["off", DEFAULT_WAY].contains(&first.variant.as_str()));
        }
    }

    #[test]
    fn three_digits_are_kept() {
        assert_eq!(three_digits(0.012_345), 0.0123);
        assert_eq!(three_digits(1987.6), 1990.0);
        assert_eq!(three_digits(0.0), 0.0);
    }
}
