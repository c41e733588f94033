//! `Renderer::resize`: the frames of another size, without a new renderer.

use stereolux::gpu::ShaderLibrary;
use stereolux::renderer::{Eye, RenderError, Renderer};
use stereolux::scene::Scene;
use stereolux::settings::{Eyes, Method, PhotonEstimate, RenderSettings, Reuse};
use stereolux::xr::View;

use crate::suite::support::{
    bits, both_bits, builtin, frame, play, radiance, rendered, renderer, renderer_by, settings,
    start_views,
};

const SMALL: [u32; 2] = [24, 20];
const LARGE: [u32; 2] = [48, 33];

fn views(scene: &Scene) -> [View; 2] {
    start_views(scene, 25.0)
}

/// Both eyes' bits, what the right eye took over, and what else is switched on.
fn picture(renderer: &Renderer) -> ([Vec<[u32; 3]>; 2], Option<Vec<u32>>, Vec<Vec<u32>>) {
    let taken = renderer.read_provenance().unwrap();
    (both_bits(renderer), taken, others(renderer))
}

/// Images that only some settings have, as bits: the light in parts, what was seen and how it moved, variances.
fn others(renderer: &Renderer) -> Vec<Vec<u32>> {
    let mut all = Vec::new();
    for eye in Eye::ALL {
        if let Some(parts) = renderer.read_parts(eye).unwrap() {
            all.extend(
                [parts.direct, parts.indirect, parts.albedo].map(|part| bits(&part).concat()),
            );
        }
        if let Some((seen, motion)) = renderer.read_motion(eye).unwrap() {
            let motion = motion.as_flattened().iter();
            all.extend([seen.concat(), motion.map(|word| word.to_bits()).collect()]);
        }
        let variance = renderer.read_variance(eye).unwrap();
        all.extend(variance.map(|all| all.into_iter().map(f32::to_bits).collect()));
    }
    all
}

/// Frame 0 of a renderer that has shown it at `SMALL` before, and that of one made at `LARGE`; twice each, the second as
/// frame 1, so that history counts. Returns the latter.
fn resized_and_made(scene: &Scene, settings: &RenderSettings) -> Renderer {
    let views = views(scene);
    let mut resized = rendered(scene, settings, SMALL, &views);
    let small = picture(&resized);
    resized.resize(LARGE).unwrap();
    assert_eq!(resized.size(), LARGE);
    let mut made = renderer(scene, settings, LARGE);
    for index in 0..2 {
        for renderer in [&mut resized, &mut made] {
            play(renderer, &views, index..index + 1);
        }
        let what = format!("{:?} {:?}: frame {index}", settings.method, settings.reuse);
        assert!(picture(&resized) == picture(&made), "{what}");
    }
    // Another frame's noise would have been noticed.
    let noisy = picture(&resized);
    play(&mut resized, &views, 2..3);
    assert!(picture(&resized) != noisy);
    // And back again, to what the first frame was.
    resized.resize(SMALL).unwrap();
    frame(&mut resized, &views);
    let again = picture(&resized);
    assert_eq!(again.0[0].len(), 24 * 20);
    assert!(again == small, "the old size again");
    made
}

#[test]
fn a_resized_renderer_gives_the_frames_of_one_made_at_that_size() {
    for (name, method, reuse) in [
        ("gallery", Method::Photon, Reuse::Lookup),
        ("cornell", Method::Photon, Reuse::Scatter),
        ("cornell", Method::Path, Reuse::Off),
    ] {
        let settings = settings(|s| {
            s.method = method;
            s.reuse = reuse;
            s.spp = 2;
            s.path.max_depth = 4;
            s.photon.count = 2048;
        });
        resized_and_made(&builtin(name), &settings);
    }
}

#[test]
fn reconstruction_parts_and_heaps_follow_the_size() {
    let scene = builtin("cornell");
    let all = settings(|s| {
        s.reuse = Reuse::Lookup;
        s.output.parts = true;
        s.reconstruct.svgf = true.into();
        s.reconstruct.taa = true.into();
        s.reconstruct.still = true.into();
    });
    let heaps = settings(|s| {
        // A radius so large that gathers run in slices, each of which keeps a heap.
        s.photon.estimate = PhotonEstimate::Nearest;
        s.photon.radius_m = 5.0;
        s.photon.count = 65_536;
    });
    let made = resized_and_made(&scene, &all);
    let lengths: Vec<_> = others(&made).iter().map(Vec::len).collect();
    // Direct, indirect, albedo, what was seen, motion, variance: words a pixel.
    let pixels = (LARGE[0] * LARGE[1]) as usize;
    let of_an_eye = [3, 3, 3, 4, 4, 1].map(|words| words * pixels);
    assert_eq!(lengths, [of_an_eye; 2].concat());
    let made = resized_and_made(&scene, &heaps);
    assert!(made.photon_map().unwrap().gather_slices() > 1, "one slice");
}

#[test]
fn photons_stay_and_switched_reuse_stays_switched() {
    let scene = builtin("cornell");
    let views = views(&scene);
    let settings = settings(|s| s.reuse = Reuse::Lookup);
    let mut renderer = renderer(&scene, &settings, SMALL);
    assert!(frame(&mut renderer, &views).photons.traced);
    assert!(renderer.switch_reuse());
    renderer.resize(LARGE).unwrap();
    assert!(!renderer.reuses());
    let again = renderer.render_frame(&views, 1, |_| {}).unwrap();
    assert!(!again.photons.traced);
    // The right eye rendered by itself: as without reuse.
    let mut settings = settings.clone();
    settings.reuse = Reuse::Off;
    let mut off = super::support::renderer(&scene, &settings, LARGE);
    play(&mut off, &views, 0..2);
    let [off, right] = [&off, &renderer].map(|r| bits(&radiance(r, Eye::Right)));
    assert!(right == off);
}

#[test]
fn sizes_without_pixels_are_refused_and_leave_the_old_one() {
    let scene = builtin("cornell");
    let (library, settings) = (ShaderLibrary::embedded(), settings(|_| {}));
    let made = renderer_by(&library, &scene, &settings, Eyes::Right, SMALL);
    let mut renderer = made.unwrap();
    let views = views(&scene);
    frame(&mut renderer, &views);
    let before = bits(&radiance(&renderer, Eye::Right));
    let error = renderer.resize([0, 5]).unwrap_err();
    assert!(matches!(error, RenderError::Settings(_)));
    assert!(error.to_string().contains("0x5"), "{error}");
    assert_eq!(renderer.size(), SMALL);
    // More than the adapter binds: 16 bytes for each of these pixels.
    assert!(renderer.resize([1 << 20, 1 << 20]).is_err());
    assert_eq!(renderer.size(), SMALL);
    renderer.resize(SMALL).unwrap();
    frame(&mut renderer, &views);
    assert!(bits(&radiance(&renderer, Eye::Right)) == before);
    // A single eye keeps its own buffers.
    renderer.resize(LARGE).unwrap();
    frame(&mut renderer, &views);
    assert_eq!(radiance(&renderer, Eye::Right).len(), 48 * 33);
    assert!(renderer.read_radiance(Eye::Left).unwrap().is_none());
}

#[test]
fn renderers_without_pixels_samples_or_whole_scenes_are_refused() {
    let (library, good) = (ShaderLibrary::embedded(), settings(|_| {}));
    let scene = builtin("cornell");
    let mut torn = scene.clone();
    torn.meshes[1].triangles[0].material = 99;
    let without_samples = settings(|s| s.spp = 0);
    for (scene, settings, size, says) in [
        (&scene, &good, [5, 0], "5x0"),
        (&scene, &without_samples, SMALL, "spp"),
        (&torn, &good, SMALL, "meshes[1] names material 99"),
    ] {
        let made = renderer_by(&library, scene, settings, Eyes::Both, size);
        let error = made.err().map(|error| error.to_string());
        assert!(
            error.as_ref().is_some_and(|e| e.contains(says)),
            "{error:?}"
        );
    }
}
