//! `scaling`: how the cost of a frame grows with triangles, instances, lights, photons and pixels, and what it costs
//! that something moves.

use serde_json::json;

use super::super::BenchError;
use super::super::measure::{Candidate, GroupPlan, ViewPlan};
use super::super::moves::Moves;
use super::super::reference::PixelFilter;
use super::super::scenes::{Generated, SceneSource};
use super::{Extent, SuiteBase, candidate, framing_headset, scene_of};
use crate::settings::{Eyes, Method, RenderSettings, Reuse};
use crate::xr::Headset;

/// What is varied.
struct Axes {
    triangles: &'static [u32],
    instances: &'static [u32],
    lights: &'static [u32],
    photons: &'static [u32],
    sides: &'static [u32],
    /// Triangles around one object that moves.
    around_one: &'static [u32],
    /// Instances that all move.
    moving: &'static [u32],
}

const FULL: Axes = Axes {
    triangles: &[1_000, 10_000, 100_000, 500_000, 2_000_000],
    instances: &[1, 10, 100, 1_000, 10_000],
    lights: &[1, 10, 100, 1_000, 10_000],
    photons: &[1 << 14, 1 << 16, 1 << 18, 1 << 20, 1 << 22],
    sides: &[64, 128, 256, 512, 1024],
    around_one: &[34_000, 1_700_000],
    moving: &[1, 10, 100, 1_000, 10_000],
};
const SMOKE: Axes = Axes {
    triangles: &[1_000, 4_000, 16_000],
    instances: &[1, 10, 100],
    lights: &[1, 10, 100],
    photons: &[1 << 10, 1 << 12, 1 << 14],
    sides: &[16, 32, 64],
    around_one: &[1_000, 16_000],
    moving: &[1, 100],
};
/// Photons in the series that vary something else: the cost of tracing them is to show, not to drown the rest.
const PHOTONS: u32 = 1 << 16;
/// The same in `smoke`.
const SMOKE_PHOTONS: u32 = 1 << 12;
/// The headset whose pixels end the series of pixels.
const LARGEST_HEADSET: &str = "quest3";

/// Series of triangles around one object that moves.
pub const AROUND_ONE: &str = "triangles_around_one_that_moves";
/// Series of instances that all move.
pub const MOVING: &str = "instances_that_move";
/// Variant of [`AROUND_ONE`] that does what the renderer does.
pub const TWO_LEVELS: &str = "two levels";
/// Variant of [`AROUND_ONE`] whose host builds all hierarchies anew beside that.
pub const REBUILT: &str = "rebuilt whole";

pub(super) fn plans(base: &SuiteBase) -> Result<Vec<GroupPlan>, BenchError> {
    let (axes, photons) = match base.extent {
        Extent::Full => (FULL, PHOTONS),
        Extent::Smoke => (SMOKE, SMOKE_PHOTONS),
    };
    let settings = |method: Method, count: u32| {
        let mut settings = RenderSettings {
            method,
            reuse: Reuse::Off,
            ..base.settings.render.clone()
        };
        settings.photon.count = count;
        settings
    };
    let group = |name: String,
                 scene: SceneSource,
                 view: &(Headset, String),
                 candidates: Vec<Candidate>| GroupPlan {
        suite: "scaling",
        name,
        scene,
        headset: view.0.clone(),
        headset_label: view.1.clone(),
        views: ViewPlan::Start,
        size: base.size,
        eyes: Eyes::Left,
        filter: None,
        candidates,
        rounds: base.rounds,
        warm_up: base.warm_up,
    };
    let both_methods = |series: &'static str, value: f64| -> Vec<Candidate> {
        [("photon", Method::Photon), ("path", Method::Path)]
            .into_iter()
            .map(|(name, method)| {
                let factors = [("series", json!(series)), (series, json!(value))];
                candidate(name, settings(method, photons), factors)
            })
            .collect()
    };
    let mut plans = Vec::new();
    let room = framing_headset(base, &Generated::default().scene())?;
    let mut generated = |series: &'static str, values: &[u32], made: &dyn Fn(u32) -> Generated| {
        for &value in values {
            let scene = SceneSource::Generated(made(value));
            let candidates = both_methods(series, f64::from(value));
            plans.push(GroupPlan {
                views: ViewPlan::Jitter,
                ..group(format!("{series} {value}"), scene, &room, candidates)
            });
        }
    };
    let default = Generated::default();
    generated("triangles", axes.triangles, &|floor_triangles| Generated {
        floor_triangles,
        ..default
    });
    generated("instances", axes.instances, &|boxes| Generated {
        boxes,
        ..default
    });
    generated("lights", axes.lights, &|lights| Generated {
        lights,
        ..default
    });
    let mut moving =
        |series: &'static str, value: u32, made: Generated, variants: &[(&str, Moves)]| {
            let scene = SceneSource::Generated(made);
            let candidates = variants
                .iter()
                .map(|&(variant, moves)| {
                    let factors = [("series", json!(series)), (series, json!(value))];
                    let settings = settings(Method::Path, photons);
                    Candidate {
                        moves,
                        ..candidate(variant, settings, factors)
                    }
                })
                .collect();
            plans.push(GroupPlan {
                views: ViewPlan::Jitter,
                ..group(format!("{series} {value}"), scene, &room, candidates)
            });
        };
    for &value in axes.around_one {
        let made = Generated {
            floor_triangles: value,
            ..default
        };
        let variants = [(TWO_LEVELS, Moves::One), (REBUILT, Moves::OneRebuilt)];
        moving(AROUND_ONE, value, made, &variants);
    }
    for &value in axes.moving {
        let made = Generated {
            boxes: value,
            ..default
        };
        moving(MOVING, value, made, &[(TWO_LEVELS, Moves::All)]);
    }
    for scene in &base.scenes {
        let source = SceneSource::Named(scene.clone());
        let view = framing_headset(base, &scene_of(scene, base)?)?;
        let candidates = axes
            .photons
            .iter()
            .map(|&count| {
                let factors = [("series", json!("photons")), ("photons", json!(count))];
                let settings = settings(Method::Photon, count);
                candidate(format!("photon {count}"), settings, factors)
            })
            .collect();
        plans.push(GroupPlan {
            filter: Some(PixelFilter::Center),
            ..group(
                format!("photons, {scene}"),
                source.clone(),
                &view,
                candidates,
            )
        });
        let mut sizes: Vec<[u32; 2]> = axes.sides.iter().map(|&side| [side, side]).collect();
        if base.extent == Extent::Full {
            sizes.push(Headset::load(LARGEST_HEADSET)?.size);
        }
        for size in sizes {
            let pixels = f64::from(size[0]) * f64::from(size[1]);
            let candidates = both_methods("pixels", pixels);
            let name = format!("pixels {}x{}, {scene}", size[0], size[1]);
            plans.push(GroupPlan {
                size,
                ..group(name, source.clone(), &view, candidates)
            });
        }
    }
    Ok(plans)
}
