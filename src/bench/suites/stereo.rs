//! `stereo`: every reuse mode beside two eyes rendered by themselves, over scenes, distances between the eyes, headsets and
//! a recorded trace.

use clap::ValueEnum as _;
use serde_json::json;

use super::super::BenchError;
use super::super::measure::{Candidate, GroupPlan, ViewPlan};
use super::super::reference::PixelFilter;
use super::super::scenes::SceneSource;
use super::{Extent, SuiteBase, candidate, headset, settings_for, word};
use crate::options::{Eyes, Reuse, Settings};
use crate::xr::Headset;

/// Distances between the eyes, millimetres: none, and the 5th, 50th and 95th percentile of adults, about (Dodgson 2004,
/// "Variation and extrema of human interpupillary distance").
const IPDS_MM: [f64; 4] = [0.0, 55.0, 63.0, 75.0];

/// Reuse modes, each eye by itself first.
pub(super) fn modes() -> Vec<Reuse> {
    let others = Reuse::value_variants()
        .iter()
        .copied()
        .filter(|mode| *mode != Reuse::Off);
    std::iter::once(Reuse::Off).chain(others).collect()
}

/// One candidate per reuse mode.
pub(super) fn candidates(
    settings: &Settings,
    factors: &[(&'static str, serde_json::Value)],
) -> Vec<Candidate> {
    modes()
        .into_iter()
        .map(|reuse| {
            let settings = Settings {
                reuse,
                ..settings.clone()
            };
            let reuse = word(reuse);
            let all = factors.iter().cloned().chain([("reuse", json!(reuse))]);
            candidate(reuse.clone(), settings, all)
        })
        .collect()
}

pub(super) fn plans(base: &SuiteBase) -> Result<Vec<GroupPlan>, BenchError> {
    let own = headset(base)?;
    let mut plans = Vec::new();
    for scene in &base.scenes {
        let group = |name: String, headset: Headset, label: String, views: ViewPlan| GroupPlan {
            suite: "stereo",
            name: format!("{scene}, {name}"),
            scene: SceneSource::Named(scene.clone()),
            candidates: candidates(
                &Settings {
                    headset: headset.name.clone(),
                    ..settings_for(base, scene)
                },
                &[
                    ("ipd_mm", json!((headset.ipd_m * 1e4).round() / 10.0)),
                    ("headset", json!(label)),
                    (
                        "motion",
                        json!(if views == ViewPlan::Trace {
                            "sway"
                        } else {
                            "still"
                        }),
                    ),
                ],
            ),
            headset,
            headset_label: label,
            rounds: if views == ViewPlan::Trace {
                base.frames
            } else {
                base.rounds
            },
            views,
            size: base.size,
            eyes: Eyes::Both,
            // A frame of one sample looks through the pixels' centres, and so does what it is judged by.
            filter: Some(PixelFilter::Center),
            warm_up: base.warm_up,
        };
        let ipds: &[f64] = match base.extent {
            Extent::Full => &IPDS_MM,
            Extent::Smoke => &[0.0, 63.0],
        };
        for &ipd_mm in ipds {
            let headset = own.clone().with_ipd(ipd_mm * 1e-3)?;
            let label = format!("{}, parallel eyes", own.name);
            plans.push(group(
                format!("ipd {ipd_mm} mm"),
                headset,
                label,
                ViewPlan::Start,
            ));
        }
        if base.extent == Extent::Full {
            for name in Headset::names() {
                let headset = Headset::load(name)?;
                let label = format!("{name}, as its profile has it");
                plans.push(group(
                    format!("headset {name}"),
                    headset,
                    label,
                    ViewPlan::Start,
                ));
            }
        }
        let label = format!("{}, as its profile has it", own.name);
        plans.push(group(
            "trace".to_owned(),
            own.clone(),
            label,
            ViewPlan::Trace,
        ));
    }
    Ok(plans)
}
