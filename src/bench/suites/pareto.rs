//! `pareto`: photon mapping over photons, radius, kernel, source of direct light, rate of gathering, choice of lights and
//! samples, and the path tracer over samples: milliseconds against error, one eye.

use serde_json::json;

use super::super::BenchError;
use super::super::measure::{Candidate, GroupPlan};
use super::super::reference::PixelFilter;
use super::super::scenes::SceneSource;
use super::{
    Extent, INDIRECT_SCENE, SuiteBase, candidate, framing_headset, scene_of, three_digits,
};
use crate::renderer::automatic_radius_m;
use crate::settings::{DirectLight, Kernel, Method, RenderSettings, Reuse};

/// Variants of a group beside the first: each holds a device of its own, so there cannot be many.
const GROUP: usize = 5;

/// What is varied.
struct Axes {
    photons: &'static [u32],
    radius_factors: &'static [f64],
    kernels: &'static [Kernel],
    directs: &'static [DirectLight],
    spps: &'static [u32],
    path_spps: &'static [u32],
}

const FULL: Axes = Axes {
    photons: &[1 << 14, 1 << 16, 1 << 18],
    radius_factors: &[0.5, 1.0, 2.0],
    kernels: &[Kernel::Constant, Kernel::Epanechnikov, Kernel::Cone],
    directs: &[DirectLight::Nee, DirectLight::Map],
    spps: &[1, 4],
    path_spps: &[1, 4, 16, 64, 256],
};
const SMOKE: Axes = Axes {
    photons: &[1 << 10, 1 << 13],
    radius_factors: &[1.0],
    kernels: &[Kernel::Constant, Kernel::Cone],
    directs: &[DirectLight::Nee, DirectLight::Map],
    spps: &[1],
    path_spps: &[1, 4, 16],
};
/// For the scene that is lit indirectly alone: what decides the time to an error, without what the other scenes show.
const INDIRECT: Axes = Axes {
    kernels: &[Kernel::Constant],
    directs: &[DirectLight::Nee],
    ..FULL
};
/// Photons that the radii of the product are automatic for; fixed over the photon counts, so that the floor of the bias
/// shows.
const RADIUS_PHOTONS: u32 = 1 << 16;

/// Settings that are varied one at a time, with the constant kernel and direct light of its own: what they bring does not
/// depend on the kernel, and the product of everything would take hours.
fn variations(settings: &RenderSettings) -> Vec<RenderSettings> {
    let mut all = vec![settings.clone()];
    let photon = &settings.photon;
    if settings.method == Method::Photon {
        if photon.kernel != Kernel::Constant || photon.direct != DirectLight::Nee {
            return all;
        }
        let mut other = settings.clone();
        other.photon.half_rate = (!photon.half_rate.is_on()).into();
        all.push(other);
    }
    if settings.path.light_candidates != 1 {
        let mut other = settings.clone();
        other.path.light_candidates = 1;
        all.push(other);
    }
    all
}

fn path(settings: RenderSettings) -> Candidate {
    let candidates = settings.path.light_candidates;
    let name = format!("path {} spp, {candidates} light candidates", settings.spp);
    let factors = [
        ("method", json!("path")),
        ("spp", json!(settings.spp)),
        ("light_candidates", json!(candidates)),
    ];
    candidate(name, settings.clone(), factors)
}

fn photon(settings: RenderSettings, radius_m: f64) -> Candidate {
    let photon = &settings.photon;
    let (kernel, direct) = (photon.kernel, photon.direct);
    let rate = if photon.half_rate.is_on() {
        "half"
    } else {
        "full"
    };
    let candidates = settings.path.light_candidates;
    let name = format!(
        "photon {} r {radius_m} {kernel} {direct} {} spp, {rate} rate, {candidates} light candidates",
        photon.count, settings.spp
    );
    let factors = [
        ("method", json!("photon")),
        ("photons", json!(photon.count)),
        ("radius_m", json!(radius_m)),
        ("kernel", json!(kernel)),
        ("direct", json!(direct)),
        ("rate", json!(rate)),
        ("light_candidates", json!(candidates)),
        ("spp", json!(settings.spp)),
    ];
    candidate(name, settings.clone(), factors)
}

pub(super) fn plans(base: &SuiteBase) -> Result<Vec<GroupPlan>, BenchError> {
    let mut plans = Vec::new();
    for scene in &base.scenes {
        let axes = match base.extent {
            Extent::Full if scene == INDIRECT_SCENE => INDIRECT,
            Extent::Full => FULL,
            Extent::Smoke => SMOKE,
        };
        let loaded = scene_of(scene, base)?;
        let view = framing_headset(&base.settings, base.size, &loaded)?;
        let automatic = automatic_radius_m(&loaded, RADIUS_PHOTONS);
        let settings = RenderSettings {
            reuse: Reuse::Off,
            ..base.settings.render.clone()
        };
        let mut all = Vec::new();
        for &count in axes.photons {
            for &factor in axes.radius_factors {
                let radius_m = three_digits(automatic * factor);
                for &kernel in axes.kernels {
                    for &direct in axes.directs {
                        for &spp in axes.spps {
                            let mut settings = RenderSettings {
                                method: Method::Photon,
                                spp,
                                ..settings.clone()
                            };
                            settings.photon.count = count;
                            settings.photon.radius_m = radius_m;
                            settings.photon.kernel = kernel;
                            settings.photon.direct = direct;
                            let varied = variations(&settings).into_iter();
                            all.extend(varied.map(|settings| photon(settings, radius_m)));
                        }
                    }
                }
            }
        }
        for &spp in axes.path_spps {
            let settings = RenderSettings {
                method: Method::Path,
                spp,
                ..settings.clone()
            };
            all.extend(variations(&settings).into_iter().map(path));
        }
        // Measured in every group, it tells how far times of different groups may be compared.
        let anchor = candidate(
            "anchor: path 1 spp",
            RenderSettings {
                method: Method::Path,
                ..settings.clone()
            },
            [("method", json!("anchor")), ("spp", json!(1))],
        );
        for (index, chunk) in all.chunks(GROUP).enumerate() {
            let name = format!("{scene}, group {}", index + 1);
            let source = SceneSource::Named(scene.clone());
            let candidates = [std::slice::from_ref(&anchor), chunk].concat();
            plans.push(GroupPlan {
                // The picture that everyone wants is filtered, so a single sample's jagged edges count as error.
                filter: Some(PixelFilter::Box),
                ..base.group("pareto", name, source, &view, candidates)
            });
        }
    }
    Ok(plans)
}
