//! `scaling`: how the cost of a frame grows with triangles, instances, lights, photons and pixels, and what it costs
//! that something moves.

use serde_json::json;
use stereolux_report::records::REBUILT;

use super::super::BenchError;
use super::super::instance_motion::InstanceMotion;
use super::super::measure::{Candidate, GroupPlan, ViewPlan};
use super::super::reference::PixelFilter;
use super::super::scenes::{Generated, SceneSource};
use super::{Extent, SuiteBase, candidate, framing_headset, scene_of};
use crate::settings::{Method, RenderSettings, Reuse};
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
const AROUND_ONE: &str = "triangles_around_one_that_moves";
/// Series of instances that all move.
const MOVING: &str = "instances_that_move";
/// Variant of [`AROUND_ONE`] that does what the renderer does.
const TWO_LEVELS: &str = "two levels";

pub(super) fn plans(base: &SuiteBase) -> Result<Vec<GroupPlan>, BenchError> {
    let (axes, photons) = match base.extent {
        Extent::Full => (FULL, PHOTONS),
        Extent::Smoke => (SMOKE, SMOKE_PHOTONS),
    };
    let suite = Scaling {
        base,
        axes,
        photons,
    };
    let mut plans = suite.generated()?;
    for scene in &base.scenes {
        plans.extend(suite.named(scene)?);
    }
    Ok(plans)
}

/// Name, method and motion of a variant.
type Variant = (&'static str, Method, InstanceMotion);

const BOTH_METHODS: &[Variant] = &[
    ("photon", Method::Photon, InstanceMotion::Nothing),
    ("path", Method::Path, InstanceMotion::Nothing),
];

struct Scaling<'a> {
    base: &'a SuiteBase,
    axes: Axes,
    photons: u32,
}

impl Scaling<'_> {
    fn settings(&self, method: Method, photons: u32) -> RenderSettings {
        let mut settings = RenderSettings {
            method,
            reuse: Reuse::Off,
            ..self.base.settings.render.clone()
        };
        settings.photon.count = photons;
        settings
    }

    fn candidates(&self, series: &'static str, value: f64, variants: &[Variant]) -> Vec<Candidate> {
        let candidate = |&(name, method, motion): &Variant| Candidate {
            motion,
            ..candidate(
                name,
                self.settings(method, self.photons),
                [("series", json!(series)), (series, json!(value))],
            )
        };
        variants.iter().map(candidate).collect()
    }

    /// The series over generated rooms, seen from one place by a head that moves.
    fn generated(&self) -> Result<Vec<GroupPlan>, BenchError> {
        let base = self.base;
        let scene = Generated::default().scene();
        let room = framing_headset(&base.settings, base.size, &scene)?;
        let mut plans = Vec::new();
        let mut add = |series: &'static str,
                       values: &[u32],
                       made: fn(&mut Generated, u32),
                       variants: &[Variant]| {
            for &value in values {
                let mut generated = Generated::default();
                made(&mut generated, value);
                let scene = SceneSource::Generated(generated);
                let candidates = self.candidates(series, f64::from(value), variants);
                let name = format!("{series} {value}");
                plans.push(GroupPlan {
                    views: ViewPlan::Jitter,
                    ..base.group("scaling", name, scene, &room, candidates)
                });
            }
        };
        let axes = &self.axes;
        let floor = |made: &mut Generated, value| made.floor_triangles = value;
        let boxes = |made: &mut Generated, value| made.boxes = value;
        let lights = |made: &mut Generated, value| made.lights = value;
        add("triangles", axes.triangles, floor, BOTH_METHODS);
        add("instances", axes.instances, boxes, BOTH_METHODS);
        add("lights", axes.lights, lights, BOTH_METHODS);
        let one = (TWO_LEVELS, Method::Path, InstanceMotion::One);
        let rebuilt = (REBUILT, Method::Path, InstanceMotion::OneRebuilt);
        add(AROUND_ONE, axes.around_one, floor, &[one, rebuilt]);
        let all = (TWO_LEVELS, Method::Path, InstanceMotion::All);
        add(MOVING, axes.moving, boxes, &[all]);
        Ok(plans)
    }

    /// The series of photons and pixels over one scene.
    fn named(&self, scene: &str) -> Result<Vec<GroupPlan>, BenchError> {
        let source = SceneSource::Named(scene.to_owned());
        let base = self.base;
        let view = framing_headset(&base.settings, base.size, &scene_of(scene, base)?)?;
        let with_photons = |&count: &u32| {
            candidate(
                format!("photon {count}"),
                self.settings(Method::Photon, count),
                [("series", json!("photons")), ("photons", json!(count))],
            )
        };
        let candidates = self.axes.photons.iter().map(with_photons).collect();
        let photons = format!("photons, {scene}");
        let mut plans = vec![GroupPlan {
            filter: Some(PixelFilter::Center),
            ..base.group("scaling", photons, source.clone(), &view, candidates)
        }];
        let mut sizes: Vec<[u32; 2]> = self.axes.sides.iter().map(|&side| [side; 2]).collect();
        if base.extent == Extent::Full {
            sizes.push(Headset::load(LARGEST_HEADSET)?.size);
        }
        for size in sizes {
            let pixels = f64::from(size[0]) * f64::from(size[1]);
            let candidates = self.candidates("pixels", pixels, BOTH_METHODS);
            let name = format!("pixels {}x{}, {scene}", size[0], size[1]);
            plans.push(GroupPlan {
                size,
                ..base.group("scaling", name, source.clone(), &view, candidates)
            });
        }
        Ok(plans)
    }
}
