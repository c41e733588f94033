//! `Renderer::set_quality`: the frames of a renderer made so, without another renderer, without compiling or allocating.

use glam::{DAffine3, DVec3};
use stereolux::FrameLoop;
use stereolux::gpu::ShaderLibrary;
use stereolux::renderer::{InstanceId, PhotonStats, RenderError, Renderer, StereoStats};
use stereolux::scene::Scene;
use stereolux::settings::{Method, PhotonEstimate, Quality, RenderSettings, Reuse, Search};
use stereolux::xr::{
    FrameState, FrameSubmission, Headset, LocatedViews, Motion, RenderTargets, SessionInfo,
    SimulatedSession, View, XrError, XrSession,
};

use super::support::{
    assert_says, both_bits, builtin, context, renderer, settings, start_views, white_box,
};

const SIZE: [u32; 2] = [45, 34];

fn views(scene: &Scene) -> [View; 2] {
    start_views(scene, 25.0)
}

/// All that a frame gives: both eyes' bits, the right one's provenance, what was counted.
type Given = (
    [Vec<[u32; 3]>; 2],
    Option<Vec<u32>>,
    PhotonStats,
    StereoStats,
);

fn shown(renderer: &mut Renderer, scene: &Scene, index: u32) -> Given {
    let result = renderer.render_frame(&views(scene), index, |_| {}).unwrap();
    let eyes = both_bits(renderer);
    let provenance = renderer.read_provenance().unwrap();
    (eyes, provenance, result.photons, result.stereo)
}

/// A frame without reading its images, and how many buffers, textures and pipelines it made.
fn made_by(renderer: &mut Renderer, scene: &Scene, index: u32) -> u64 {
    let before = renderer.context().resources_made();
    renderer.render_frame(&views(scene), index, |_| {}).unwrap();
    renderer.context().resources_made() - before
}

/// A change of quality and its name.
type Change = (&'static str, fn(&mut Quality));

const SCALE: Change = ("scale", |q| q.resolution_scale = 0.6);
const PHOTONS: Change = ("photons", |q| q.photons_per_frame = 1111);
const NO_PHOTONS: Change = ("no photons", |q| q.photons_per_frame = 0);
const SHARES: Change = ("shares", |q| q.photon_shares = 1);
const DEPTH: Change = ("depth", |q| q.max_depth = 3);
const CANDIDATES: Change = ("candidates", |q| q.light_candidates = 9);
const ONE_CANDIDATE: Change = ("one candidate", |q| q.light_candidates = 1);
const FULL_RATE: Change = ("full rate", |q| q.half_rate = false);
const ONE_PASS: Change = ("one pass", |q| q.filter_passes = 1);
const NO_PASSES: Change = ("no passes", |q| q.filter_passes = 0);
const NO_REUSE: Change = ("no reuse", |q| q.reuse = false);
const ALL: Change = ("all", |q| {
    *q = Quality {
        resolution_scale: 0.4,
        photons_per_frame: q.photons_per_frame / 3,
        photon_shares: 1,
        max_depth: 4,
        light_candidates: 2,
        half_rate: false,
        filter_passes: 0,
        reuse: false,
    }
});

/// What a renderer is made with that is made for `quality`.
fn made_so(quality: &Quality, settings: &RenderSettings) -> (RenderSettings, [u32; 2]) {
    let mut settings = settings.clone();
    settings.photon.count = quality.photons_per_frame;
    settings.photon.shares = quality.photon_shares;
    settings.path.max_depth = quality.max_depth;
    settings.photon.max_depth = quality.max_depth;
    settings.path.light_candidates = quality.light_candidates;
    settings.photon.half_rate = quality.half_rate.into();
    settings.reconstruct.atrous_passes = quality.filter_passes.into();
    if !quality.reuse {
        settings.reuse = Reuse::Off;
    }
    let scale = f64::from(quality.resolution_scale);
    let size = SIZE.map(|pixels| (f64::from(pixels) * scale).round() as u32);
    (settings, size)
}

/// Two frames of a renderer that is told of each change in turn, and back again, against one made so; and nothing is made
/// for it. With a `history` each frame depends on those before, so that a renderer is told before its first.
fn changed_and_made(scene: &str, settings: &RenderSettings, has_history: bool, changes: &[Change]) {
    let scene = builtin(scene);
    let mut told = renderer(&scene, settings, SIZE);
    let mut untold = renderer(&scene, settings, SIZE);
    let most = told.most_quality();
    assert_eq!(most, Quality::of(settings));
    if !has_history {
        for renderer in [&mut told, &mut untold] {
            shown(renderer, &scene, 0);
            made_by(renderer, &scene, 0);
        }
    }
    for (name, change) in changes {
        if has_history {
            told = renderer(&scene, settings, SIZE);
            made_by(&mut told, &scene, 0);
            told.reconstruction_mut().unwrap().reset();
        }
        let mut quality = most;
        change(&mut quality);
        assert_ne!(quality, most, "{name} changes nothing");
        let (own, size) = made_so(&quality, settings);
        let mut made = renderer(&scene, &own, size);
        told.set_quality(&quality).unwrap();
        assert_eq!(told.quality(), quality);
        assert_eq!(made_by(&mut told, &scene, 1), 0, "{name} makes something");
        assert_eq!(told.size(), size);
        assert_eq!(told.quality(), quality);
        made.render_frame(&views(&scene), 1, |_| {}).unwrap();
        for index in 2..4 {
            let [told, made] = [&mut told, &mut made].map(|one| shown(one, &scene, index));
            assert_eq!(told.2.map.stored, made.2.map.stored, "{name}");
            assert_eq!(told.3, made.3, "{name}");
            assert!(told == made, "{name}: frame {index} differs");
            assert_eq!(told.0[0].len(), (size[0] * size[1]) as usize);
        }
        // Back again. An unapplied change would have been seen.
        let changed = shown(&mut told, &scene, 4);
        told.set_quality(&most).unwrap();
        assert_eq!(made_by(&mut told, &scene, 5), 0, "{name}: back again");
        // Shares depend on the frames before.
        if !has_history && settings.photon.shares == 1 {
            let again = [&mut told, &mut untold].map(|one| shown(one, &scene, 4));
            assert!(again[0] == again[1], "{name}: not as it was before");
            assert!(again[0] != changed, "{name} shows nothing");
        }
    }
}

#[test]
fn photons_and_lookup() {
    let every_frame = |estimate, search| {
        settings(|s| {
            s.reuse = Reuse::Lookup;
            s.photon.half_rate = true.into();
            s.photon.shares = 4;
            s.photon.every_frame = true;
            s.photon.estimate = estimate;
            s.photon.search = search;
        })
    };
    let in_a_grid = every_frame(PhotonEstimate::Radius, Search::Grid);
    changed_and_made("cornell", &in_a_grid, false, &[SHARES]);
    let at_once = |mut settings: RenderSettings| {
        settings.photon.shares = 1;
        settings
    };
    let changes = [
        SCALE, PHOTONS, NO_PHOTONS, DEPTH, CANDIDATES, FULL_RATE, NO_REUSE, ALL,
    ];
    changed_and_made("cornell", &at_once(in_a_grid), false, &changes);
    let in_a_tree = at_once(every_frame(PhotonEstimate::Nearest, Search::KdTree));
    changed_and_made("cornell", &in_a_tree, false, &[PHOTONS, NO_REUSE, ALL]);
}

#[test]
fn caustics_and_scatter_over_glossy_surfaces() {
    let settings = settings(|s| {
        s.reuse = Reuse::Scatter;
        s.photon.every_frame = true;
        s.spp = 2;
    });
    let changes = [SCALE, PHOTONS, DEPTH, ONE_CANDIDATE, NO_REUSE];
    changed_and_made("gallery", &settings, false, &changes);
    changed_and_made("caustic", &settings, false, &[PHOTONS, ALL]);
}

#[test]
fn paths_and_lookup() {
    let settings = settings(|s| {
        s.method = Method::Path;
        s.reuse = Reuse::Lookup;
        s.spp = 3;
    });
    let changes = [SCALE, DEPTH, CANDIDATES, ONE_CANDIDATE, NO_REUSE, ALL];
    changed_and_made("cornell", &settings, false, &changes);
}

fn reconstructed() -> RenderSettings {
    settings(|s| {
        s.method = Method::Path;
        s.reuse = Reuse::Scatter;
        s.reconstruct.svgf = true.into();
        s.reconstruct.taa = true.into();
        s.reconstruct.still = true.into();
    })
}

#[test]
fn reconstruction_from_the_first_frame_on() {
    let changes = [SCALE, DEPTH, CANDIDATES, ONE_PASS, NO_PASSES, NO_REUSE, ALL];
    changed_and_made("cornell", &reconstructed(), true, &changes);
}

#[test]
fn history_begins_anew_with_the_resolution_and_with_nothing_else() {
    let scene = builtin("cornell");
    let settings = reconstructed();
    for (name, change) in [SCALE, DEPTH, CANDIDATES, ONE_PASS, NO_PASSES, NO_REUSE] {
        let mut told = renderer(&scene, &settings, SIZE);
        for index in 0..3 {
            shown(&mut told, &scene, index);
        }
        let mut quality = told.most_quality();
        change(&mut quality);
        let (settings, size) = made_so(&quality, &settings);
        let mut made = renderer(&scene, &settings, size);
        told.set_quality(&quality).unwrap();
        let first = [&mut told, &mut made].map(|one| shown(one, &scene, 3));
        let still = told.reconstruction().unwrap().still_frames();
        if name == SCALE.0 {
            assert!(first[0] == first[1], "history of another resolution");
            assert_eq!(still, 1);
        } else {
            assert!(first[0] != first[1], "{name}: history is lost");
            assert_eq!(still, 4, "{name}");
        }
    }
}

#[test]
fn lists_that_grew_serve_fewer_photons_and_as_many_again() {
    let scene = white_box();
    let settings = settings(|s| {
        s.photon.max_depth = 32;
        s.photon.every_frame = true;
    });
    // Also what does not fit is the same as in a list that was made so.
    let mut told = renderer(&scene, &settings, SIZE);
    let few = Quality {
        photons_per_frame: 1024,
        ..told.most_quality()
    };
    told.set_quality(&few).unwrap();
    let mut made = renderer(&scene, &made_so(&few, &settings).0, SIZE);
    let [told, made] = [&mut told, &mut made].map(|one| shown(one, &scene, 0));
    assert!(told.2.map.dropped > 0, "nothing overflowed");
    assert!(told == made);
    let mut renderer = renderer(&scene, &settings, SIZE);
    let first = shown(&mut renderer, &scene, 0).2.map;
    assert!(first.dropped > 0, "nothing overflowed");
    for index in 1..5 {
        shown(&mut renderer, &scene, index);
    }
    let most = renderer.most_quality();
    let grown = shown(&mut renderer, &scene, 5).2.map;
    assert!(grown.dropped == 0 && grown.capacity > first.capacity);
    for (photons, capacity) in [(1024, grown.capacity / 4), (4096, grown.capacity)] {
        let quality = Quality {
            photons_per_frame: photons,
            ..most
        };
        renderer.set_quality(&quality).unwrap();
        for index in 6..10 {
            assert_eq!(made_by(&mut renderer, &scene, index), 0);
        }
        let map = shown(&mut renderer, &scene, 10).2.map;
        assert_eq!((map.emitted, map.dropped), (photons, 0));
        assert_eq!(map.capacity, capacity);
    }
}

#[test]
fn fewer_shares_take_fewer_frames() {
    let scene = builtin("cornell");
    let settings = settings(|s| s.photon.shares = 4);
    let mut renderer = renderer(&scene, &settings, SIZE);
    shown(&mut renderer, &scene, 0);
    let push = |renderer: &mut Renderer, to: f64| {
        let aside = DAffine3::from_translation(DVec3::X * to);
        assert!(renderer.set_instance_transform(InstanceId(6), aside));
    };
    let traced = |renderer: &mut Renderer, index| {
        let photons = shown(renderer, &scene, index).2;
        (photons.retraced, photons.outdated_shares)
    };
    push(&mut renderer, 0.01);
    assert_eq!(traced(&mut renderer, 1), (1024, 3));
    // While light lags behind: all of it is due, in halves.
    let quality = Quality {
        photon_shares: 2,
        ..renderer.quality()
    };
    renderer.set_quality(&quality).unwrap();
    assert_eq!(traced(&mut renderer, 2), (2048, 1));
    assert_eq!(traced(&mut renderer, 3), (2048, 0));
    assert_eq!(traced(&mut renderer, 4), (0, 0));
    // While nothing does, nothing is traced for it.
    let most = renderer.most_quality();
    renderer.set_quality(&most).unwrap();
    assert_eq!(traced(&mut renderer, 5), (0, 0));
    push(&mut renderer, 0.02);
    assert_eq!(traced(&mut renderer, 6), (1024, 3));
}

#[test]
fn a_rebuilt_and_resized_renderer_keeps_its_quality() {
    let scene = builtin("cornell");
    let library = ShaderLibrary::embedded();
    let settings = settings(|s| s.reuse = Reuse::Lookup);
    let mut renderer = renderer(&scene, &settings, SIZE);
    let mut quality = renderer.most_quality();
    (ALL.1)(&mut quality);
    renderer.set_quality(&quality).unwrap();
    let as_told = shown(&mut renderer, &scene, 0);
    let successor = renderer.rebuild().build(&library, &scene).unwrap();
    assert_eq!(successor.quality(), renderer.most_quality());
    renderer.succeed_by(successor).unwrap();
    assert_eq!(renderer.quality(), quality);
    assert!(shown(&mut renderer, &scene, 0) == as_told);
    renderer.resize([90, 68]).unwrap();
    assert_eq!(renderer.size(), [36, 27]);
    renderer.resize(SIZE).unwrap();
    renderer.set_quality(&renderer.most_quality()).unwrap();
    assert_eq!(made_by(&mut renderer, &scene, 1), 0);
    assert_eq!(renderer.size(), SIZE);
}

#[test]
fn what_the_renderer_was_not_made_for_is_refused_by_name() {
    let scene = builtin("cornell");
    let made = settings(|s| s.reuse = Reuse::Off);
    let mut renderer = renderer(&scene, &made, SIZE);
    let most = renderer.quality();
    let mut refuses = |words: [&str; 2], change: fn(&mut Quality)| {
        let mut quality = most;
        change(&mut quality);
        let error = renderer.set_quality(&quality).unwrap_err();
        assert!(matches!(error, RenderError::Settings(_)));
        let text = error.to_string();
        assert_says(&text, &words);
        assert!(!text.contains('\n'), "{text}");
        assert_eq!(renderer.quality(), most);
    };
    refuses(["resolution_scale", "1.01"], |q| q.resolution_scale = 1.01);
    refuses(["resolution_scale", "0.1"], |q| q.resolution_scale = 0.09);
    refuses(["resolution_scale", "NaN"], |q| {
        q.resolution_scale = f32::NAN
    });
    refuses(["photons_per_frame", "photon.count"], |q| {
        q.photons_per_frame = 4097
    });
    refuses(["photon_shares", "photon.shares"], |q| q.photon_shares = 2);
    refuses(["photon_shares", "between 1 and 64"], |q| {
        q.photon_shares = 0
    });
    refuses(["max_depth", "photon.max_depth"], |q| q.max_depth = 13);
    refuses(["light_candidates", "16"], |q| q.light_candidates = 17);
    refuses(["half_rate", "photon.half_rate = true"], |q| {
        q.half_rate = true
    });
    refuses(["filter_passes", "reconstruct.atrous_passes"], |q| {
        q.filter_passes = 5
    });
    refuses(["reuse", "lookup"], |q| q.reuse = true);
}

/// A simulated headset that notes what it is handed: the size of the images, and the scale that was set.
struct Noting(SimulatedSession, Vec<(Option<[u32; 2]>, Option<f32>)>);

impl XrSession for Noting {
    fn info(&self) -> &SessionInfo {
        self.0.info()
    }

    fn wait_frame(&mut self) -> Result<Option<FrameState>, XrError> {
        self.0.wait_frame()
    }

    fn begin_frame(&mut self) -> Result<(), XrError> {
        self.0.begin_frame()
    }

    fn locate_views(&mut self, time_ns: i64) -> Result<Option<LocatedViews>, XrError> {
        self.0.locate_views(time_ns)
    }

    fn acquire_targets(&mut self) -> Result<RenderTargets, XrError> {
        self.0.acquire_targets()
    }

    fn end_frame(&mut self, submission: FrameSubmission<'_>) -> Result<(), XrError> {
        let scale = submission.quality.map(|quality| quality.resolution_scale);
        self.1.push((submission.size, scale));
        self.0.end_frame(submission)
    }
}

#[test]
fn a_session_is_told_how_large_its_images_are() {
    let scene = builtin("cornell");
    let headset = Headset::load("symmetric").unwrap();
    let session = SimulatedSession::new(headset, Motion::Still, scene.start_pose(), Some(4));
    let library = ShaderLibrary::embedded();
    let made = settings(|_| {});
    let session = Noting(session, Vec::new());
    let mut frames = FrameLoop::new(context(), library, session, &scene, &made, [40, 30]).unwrap();
    for scale in [None, Some(0.5), None, Some(1.0)] {
        let told = frames.next_frame(|renderer, _| {
            if let Some(resolution_scale) = scale {
                let quality = Quality {
                    resolution_scale,
                    ..renderer.quality()
                };
                renderer.set_quality(&quality).unwrap();
            }
        });
        assert!(told.unwrap().is_some());
    }
    let (whole, half) = (Some([40, 30]), Some([20, 15]));
    let [unset, at_half, at_all] = [None, Some(0.5), Some(1.0)];
    let expected = [
        (whole, unset),
        (half, at_half),
        (half, unset),
        (whole, at_all),
    ];
    assert_eq!(frames.session().1, expected);
}
