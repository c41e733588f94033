//! `tables`: the tables of the 2020 report. Table 5, two eyes by themselves against stereo reuse, is the one that the report
//! left empty and that can be measured so far; the others compare kernels that do not exist yet, and the report says so.

use serde_json::json;

use super::super::BenchError;
use super::super::measure::{GroupPlan, ViewPlan};
use super::super::reference::PixelFilter;
use super::super::scenes::SceneSource;
use super::{Extent, SuiteBase, framing_headset, scene_of, settings_for, stereo, three_digits};
use crate::options::Eyes;

/// Photons of the report: squares of 128, 256 and 512.
const PHOTONS: [u32; 3] = [128 * 128, 256 * 256, 512 * 512];
/// Gather radii, in units in which the scene is [`BOX_WIDTH_IN_TABLE_UNITS`] wide, as the report's box is.
pub const RADII_IN_TABLE_UNITS: [f64; 3] = [0.05, 0.1, 0.2];
/// Width of the report's box.
pub const BOX_WIDTH_IN_TABLE_UNITS: f64 = 2.0;

/// Tables that are not measured, and why.
pub const NOT_MEASURED: [(u32, &str); 4] = [
    (1, "kd-tree against hash grid"),
    (2, "k-nearest with a bounded heap against fixed radius"),
    (
        3,
        "one kernel that traces and gathers against split kernels",
    ),
    (4, "shared-memory gather against direct gather"),
];

pub(super) fn plans(base: &SuiteBase) -> Result<Vec<GroupPlan>, BenchError> {
    let mut plans = Vec::new();
    for scene in &base.scenes {
        let loaded = scene_of(scene, base)?;
        let (headset, headset_label) = framing_headset(base, &loaded)?;
        let width_m = loaded
            .bounds_in_world()
            .map_or(BOX_WIDTH_IN_TABLE_UNITS, |bounds| bounds.size().x);
        let (counts, radii): (&[u32], &[f64]) = match base.extent {
            Extent::Full => (&PHOTONS, &RADII_IN_TABLE_UNITS),
            Extent::Smoke => (&PHOTONS[..1], &RADII_IN_TABLE_UNITS[1..2]),
        };
        for &count in counts {
            for &radius in radii {
                let radius_m = three_digits(radius * width_m / BOX_WIDTH_IN_TABLE_UNITS);
                let mut settings = settings_for(base, scene);
                settings.photon.count = count;
                settings.photon.radius_m = radius_m;
                plans.push(GroupPlan {
                    suite: "tables",
                    name: format!("{scene}, {count} photons, radius {radius}"),
                    scene: SceneSource::Named(scene.clone()),
                    headset: headset.clone(),
                    headset_label: headset_label.clone(),
                    views: ViewPlan::Start,
                    size: base.size,
                    eyes: Eyes::Both,
                    filter: Some(PixelFilter::Center),
                    candidates: stereo::candidates(
                        &settings,
                        &[
                            ("table", json!(5)),
                            ("photons", json!(count)),
                            ("radius", json!(radius)),
                            ("radius_m", json!(radius_m)),
                        ],
                    ),
                    rounds: base.rounds,
                    warm_up: base.warm_up,
                });
            }
        }
    }
    Ok(plans)
}
