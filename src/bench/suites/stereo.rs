//! `stereo`: every reuse mode beside two eyes rendered by themselves, over scenes, distances between the eyes, headsets and
//! a recorded trace.

use serde_json::json;

use super::super::BenchError;
use super::super::measure::{Candidate, GroupPlan, ViewPlan};
use super::super::reference::PixelFilter;
use super::super::scenes::SceneSource;
use super::{Extent, SuiteBase, candidate, framing_headset, scene_of};
use crate::scene::{Needs, Scene};
use crate::settings::Choice as _;
use crate::settings::{Eyes, RenderSettings, Reuse};
use crate::xr::Headset;

/// Distances between the eyes, millimetres: none, the adult mean of about 63, and one on either side of it; nearly all
/// adults lie within 50 to 75 (Dodgson 2004, "Variation and extrema of human interpupillary distance").
const IPDS_MM: [f64; 4] = [0.0, 55.0, 63.0, 75.0];

/// How far ahead of the scene's starting pose the head stands in the groups that vary the distance, metres.
const AHEAD_M: [f64; 2] = [-0.3, 0.3];

/// Whether no surface of a scene depends on the viewing direction.
pub(super) fn is_diffuse(scene: &Scene) -> bool {
    let needs = Needs::of(scene);
    !needs.glossy && !needs.dielectric && !needs.bsdfs.contains(&"user")
}

/// One candidate per reuse mode, the one without reuse first.
pub(super) fn candidates(
    settings: &RenderSettings,
    factors: &[(&'static str, serde_json::Value)],
) -> Vec<Candidate> {
    Reuse::ALL
        .iter()
        .map(|&reuse| {
            let settings = RenderSettings {
                reuse,
                ..settings.clone()
            };
            let reuse = reuse.word();
            let all = factors.iter().cloned().chain([("reuse", json!(reuse))]);
            candidate(reuse, settings, all)
        })
        .collect()
}

pub(super) fn plans(base: &SuiteBase) -> Result<Vec<GroupPlan>, BenchError> {
    let own = Headset::load(&base.settings.headset)?;
    let mut plans = Vec::new();
    for scene in &base.scenes {
        let loaded = scene_of(scene, base)?;
        let diffuse = is_diffuse(&loaded);
        let (framing, framing_label) = framing_headset(&base.settings, base.size, &loaded)?;
        let group = |name: String, headset: Headset, label: &str, views: ViewPlan| {
            let motion = match views {
                ViewPlan::Start | ViewPlan::Jitter => "still".to_owned(),
                ViewPlan::Ahead(metres) => format!("still, {metres} m ahead"),
                ViewPlan::Trace => "sway".to_owned(),
            };
            let factors = [
                ("ipd_mm", json!((headset.ipd_m * 1e4).round() / 10.0)),
                ("headset", json!(label)),
                ("motion", json!(motion)),
                ("diffuse", json!(diffuse)),
            ];
            let candidates = candidates(&base.settings.render, &factors);
            let name = format!("{scene}, {name}");
            let source = SceneSource::Named(scene.clone());
            let view = (headset, label.to_owned());
            GroupPlan {
                rounds: if views == ViewPlan::Trace {
                    base.frames
                } else {
                    base.rounds
                },
                views,
                eyes: Eyes::Both,
                // A frame of one sample looks through the pixels' centres, and so does what it is judged by.
                filter: Some(PixelFilter::Center),
                ..base.group("stereo", name, source, &view, candidates)
            }
        };
        let ipds: &[f64] = match base.extent {
            Extent::Full => &IPDS_MM,
            Extent::Smoke => &[0.0, 63.0],
        };
        for &ipd_mm in ipds {
            let headset = framing.clone().with_ipd(ipd_mm * 1e-3)?;
            let name = format!("ipd {ipd_mm} mm");
            plans.push(group(name, headset, &framing_label, ViewPlan::Start));
        }
        if base.extent == Extent::Full {
            for metres in AHEAD_M {
                let name = format!("{metres} m ahead");
                let views = ViewPlan::Ahead(metres);
                plans.push(group(name, framing.clone(), &framing_label, views));
            }
            for name in Headset::names() {
                let label = format!("{name}, its own view");
                let headset = Headset::load(name)?;
                plans.push(group(
                    format!("headset {name}"),
                    headset,
                    &label,
                    ViewPlan::Start,
                ));
            }
        }
        let label = format!("{}, its own view", own.name);
        let (headset, label) = match base.extent {
            Extent::Full => (own.clone(), label),
            Extent::Smoke => (framing, framing_label),
        };
        plans.push(group("trace".to_owned(), headset, &label, ViewPlan::Trace));
    }
    Ok(plans)
}
