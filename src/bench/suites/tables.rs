//! `tables`: the tables of the 2020 report, with its photon counts and radii. Tables 1 to 4 compare ways to gather, which share their
//! first variant, what the renderer does by default; table 5 compares two eyes by themselves with stereo reuse.
//!
//! The report does not state the unit of its radii: here the scene is [`BOX_WIDTH_IN_TABLE_UNITS`] wide, as its box is.

use serde_json::json;
use stereolux_report::records::{BOX_WIDTH_IN_TABLE_UNITS, DEFAULT_WAY};
use stereolux_report::report_2020::photons_and_radii;

use super::super::BenchError;
use super::super::measure::{Candidate, GroupPlan};
use super::super::reference::PixelFilter;
use super::super::scenes::SceneSource;
use super::{Extent, SuiteBase, candidate, framing_headset, scene_of, stereo, three_digits};
use crate::settings::{Eyes, Loads, PhotonEstimate, RenderSettings, Reuse, Schedule, Search};

/// Photons and radius of the one row in `smoke`.
const SMOKE_ROW: (u32, f64) = (128 * 128, 0.1);

/// The ways to gather: the default, then those of each table.
fn ways(
    settings: &RenderSettings,
    factors: &[(&'static str, serde_json::Value)],
) -> Vec<Candidate> {
    let mut all = Vec::new();
    let mut add = |name: &str, table: u32, change: fn(&mut RenderSettings)| {
        let mut settings = RenderSettings {
            reuse: Reuse::Off,
            ..settings.clone()
        };
        // Whatever else the settings say, the first variant is the default.
        settings.photon.search = Search::Grid;
        settings.photon.estimate = PhotonEstimate::Radius;
        settings.photon.schedule = Schedule::Split;
        settings.photon.loads = Loads::Direct;
        change(&mut settings);
        let own = [("table", json!(table)), ("way", json!(name))];
        all.push(candidate(
            name,
            settings,
            factors.iter().cloned().chain(own),
        ));
    };
    add(DEFAULT_WAY, 0, |_| {});
    add("kd-tree", 1, |s| s.photon.search = Search::KdTree);
    add("nearest", 2, |s| {
        s.photon.estimate = PhotonEstimate::Nearest;
    });
    add("nearest, kd-tree", 2, |s| {
        s.photon.estimate = PhotonEstimate::Nearest;
        s.photon.search = Search::KdTree;
    });
    add("fused", 3, |s| s.photon.schedule = Schedule::Fused);
    add("cooperative", 4, |s| s.photon.loads = Loads::Cooperative);
    all
}

pub(super) fn plans(base: &SuiteBase) -> Result<Vec<GroupPlan>, BenchError> {
    let mut plans = Vec::new();
    for scene in &base.scenes {
        let loaded = scene_of(scene, base)?;
        let diffuse = stereo::is_diffuse(&loaded);
        let view = framing_headset(&base.settings, base.size, &loaded)?;
        let width_m = loaded
            .bounds_in_world()
            .map_or(BOX_WIDTH_IN_TABLE_UNITS, |bounds| bounds.size().x);
        let rows = match base.extent {
            Extent::Full => photons_and_radii(),
            Extent::Smoke => vec![SMOKE_ROW],
        };
        for (count, radius) in rows {
            let radius_m = three_digits(radius * width_m / BOX_WIDTH_IN_TABLE_UNITS);
            let mut settings = base.settings.render.clone();
            settings.photon.count = count;
            settings.photon.radius_m = radius_m;
            let factors = [
                ("photons", json!(count)),
                ("radius", json!(radius)),
                ("radius_m", json!(radius_m)),
            ];
            let five: Vec<_> = [("table", json!(5)), ("diffuse", json!(diffuse))]
                .into_iter()
                .chain(factors.iter().cloned())
                .collect();
            let name = format!("{scene}, {count} photons, radius {radius}");
            for (name, eyes, candidates) in [
                (
                    name.clone(),
                    Eyes::Both,
                    stereo::candidates(&settings, &five),
                ),
                (
                    format!("{name}, ways to gather"),
                    Eyes::Left,
                    ways(&settings, &factors),
                ),
            ] {
                let source = SceneSource::Named(scene.clone());
                plans.push(GroupPlan {
                    eyes,
                    filter: Some(PixelFilter::Center),
                    ..base.group("tables", name, source, &view, candidates)
                });
            }
        }
    }
    Ok(plans)
}
