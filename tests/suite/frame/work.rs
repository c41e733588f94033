//! Counts of work (`output.work`): what can be known of them, and that counting changes nothing.

use std::collections::BTreeMap;

use stereolux::frame::work::{Dispatched, WorkCounts};
use stereolux::settings::{DirectLight, Method, RenderSettings, Reuse};

use super::support::{assert_begins, both, builtin, renderer, settings, start_views};

const SIZE: [u32; 2] = [24, 16];
const PIXELS: u64 = 24 * 16;

/// Dispatches of a frame, and its images.
fn frame(settings: &RenderSettings) -> (Vec<Dispatched>, [Vec<[f32; 3]>; 2]) {
    let scene = builtin("cornell");
    let mut renderer = renderer(&scene, settings, SIZE);
    // The box fills the view: every ray meets it.
    let views = start_views(&scene, 8.0);
    let result = renderer.render_frame(&views, 0, |_| {}).unwrap();
    (result.work, both(&renderer))
}

#[test]
fn counts_are_those_that_can_be_known() {
    for reuse in [Reuse::Off, Reuse::Lookup] {
        let with = |work| {
            frame(&settings(|s| {
                s.method = Method::Photon;
                s.reuse = reuse;
                s.photon.count = 2000;
                s.output.work = work;
            }))
        };
        let (nothing, plain) = with(false);
        assert!(nothing.is_empty());
        let (work, images) = with(true);
        assert!(images == plain, "{reuse:?}: counting changes the images");
        let mut passes: BTreeMap<&str, WorkCounts> = BTreeMap::new();
        for dispatched in &work {
            *passes.entry(dispatched.label.as_str()).or_default() += dispatched.counts;
        }
        let of = |pass: &str| passes.get(pass).copied().unwrap_or_default();
        let first = of("left.first_hits");
        assert_eq!(first.rays, PIXELS);
        // A hit ray enters the root of both levels' hierarchies at least, and tests a triangle.
        let least = first.nodes.min(first.triangles);
        assert!(least >= PIXELS, "{first:?}");
        let direct = of("left.direct_light");
        assert!((1..=2 * PIXELS).contains(&direct.rays), "{direct:?}");
        let gather = of("left.photon_gather");
        assert!(gather.photons_tested > gather.photons_counted && gather.photons_counted > 0);
        assert_eq!((gather.rays, gather.nodes, gather.triangles), (0, 0, 0));
        // At least one segment of each path.
        let rays = ["photons.trace", "photons.photon_trace"].map(|pass| of(pass).rays);
        assert!(rays[0].max(rays[1]) >= 2000, "{:?}", passes.keys());
        // Tiles of 8x8 cover the image; lists are no longer than it, but for their last workgroup.
        let find = |label: &str| work.iter().find(|d| d.label == label).unwrap();
        let whole = find("left.first_hits");
        assert!(!whole.over_list && whole.threads == PIXELS);
        let listed = find("left.photon_gather");
        let is_short = (PIXELS..PIXELS + 64).contains(&listed.threads);
        assert!(listed.over_list && is_short, "{listed:?}");
        let right = of("right.direct_light").rays;
        match reuse {
            Reuse::Off => assert!(right > PIXELS / 2, "{right}"),
            _ => assert!(right < direct.rays / 2, "{right} of {}", direct.rays),
        }
    }
}

/// In a closed sphere every path of two segments is one ray to a photon that is stored; within a radius larger than the
/// sphere every gather point, one per pixel, counts every photon.
#[test]
fn rays_and_photons_are_counted_one_by_one() {
    let settings = settings(|s| {
        s.photon.count = 2000;
        s.photon.max_depth = 2;
        s.photon.radius_m = 100.0;
        s.photon.direct = DirectLight::Map;
        s.photon.edge_correction = false;
        s.output.work = true;
    });
    let scene = builtin("sphere");
    let mut renderer = renderer(&scene, &settings, SIZE);
    let result = renderer.render_frame(&start_views(&scene, 30.0), 0, |_| {});
    let result = result.unwrap();
    assert_eq!(result.photons.map.stored, 2000);
    let of = |pass: &str| {
        let mut counts = WorkCounts::default();
        let dispatched = result.work.iter().filter(|d| d.label == pass);
        dispatched.for_each(|d| counts += d.counts);
        counts
    };
    assert_eq!(of("photons.photon_trace").rays, 2000);
    let gather = of("left.photon_gather");
    assert_eq!(gather.photons_tested, 2000 * PIXELS);
    assert_eq!(gather.photons_counted, 2000 * PIXELS);
}

#[test]
fn gathers_that_are_not_counted_are_refused() {
    let counted = settings(|s| s.output.work = true);
    assert_eq!(counted.check(), Ok(()));
    let tree = settings(|s| {
        s.output.work = true;
        s.photon.search = stereolux::settings::Search::KdTree;
    });
    let error = tree.check().unwrap_err();
    assert_begins(&error, "output.work counts gathers with photon.search");
}
