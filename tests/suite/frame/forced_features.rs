//! Shader features that a scene does not need change nothing when they are forced in.

use std::path::Path;

use stereolux::gpu::ShaderLibrary;
use stereolux::renderer::{Eye, Renderer};
use stereolux::scene::{Scene, load_environment};
use stereolux::settings::{Eyes, Force, ForceSettings, Method, Reuse};

use super::layout::changed;
use super::support::{
    builtin, frame, parallel_views, radiance, rendered, renderer_by, settings, square_fov,
};
use super::trace_probe::features;

/// Each switch alone, by name.
const SWITCHES: [(&str, Switch); 8] = [
    ("glossy", |f| &mut f.glossy),
    ("dielectric", |f| &mut f.dielectric),
    ("textures", |f| &mut f.textures),
    ("normal_maps", |f| &mut f.normal_maps),
    ("alpha", |f| &mut f.alpha),
    ("vertex_colors", |f| &mut f.vertex_colors),
    ("environment", |f| &mut f.environment),
    ("caustics", |f| &mut f.caustics),
];
type Switch = fn(&mut ForceSettings) -> &mut Force;

fn is_compiled_in(renderer: &Renderer, name: &str) -> bool {
    let on = renderer.features().and(features(&[name]));
    on == features(&[name])
}

/// The same operations in another program: a compiler may fuse or reorder them, which moves a result by a few units of
/// 2^-24 per operation. A pixel's value has some 500 operations behind it (a path of 4 segments, or a sum over photons):
/// 500 x 2^-24 = 3e-5. What it could also do is turn a decision (which triangle, which photon) at a difference of that
/// size: a pixel in ten thousand.
const ROUNDING: f32 = 3e-5;

fn image(
    scene: &Scene,
    method: Method,
    half_degrees: f64,
    force: ForceSettings,
) -> (Vec<[f32; 3]>, Renderer) {
    let settings = settings(|s| {
        s.method = method;
        s.reuse = Reuse::Off;
        s.path.max_depth = 4;
        s.photon.max_depth = 4;
        s.force = force;
    });
    let views = parallel_views(scene.start_pose(), 0.0, square_fov(half_degrees));
    let renderer = rendered(scene, &settings, [24, 24], &views);
    (radiance(&renderer, Eye::Left), renderer)
}

fn strays(a: &[[f32; 3]], b: &[[f32; 3]]) -> usize {
    super::support::strays(a, b, ROUNDING)
}

#[test]
fn every_feature_forced_into_a_lambert_scene_leaves_its_image() {
    let scene = builtin("cornell");
    let (plain, renderer) = image(&scene, Method::Path, 19.0, ForceSettings::default());
    for (name, switch) in SWITCHES {
        // What is needed must be tried in another scene.
        assert!(!is_compiled_in(&renderer, name), "{name} is needed");
        let mut force = ForceSettings::default();
        *switch(&mut force) = Force::On;
        let (forced, renderer) = image(&scene, Method::Path, 19.0, force);
        assert!(is_compiled_in(&renderer, name), "{name} was left out");
        assert_eq!(strays(&plain, &forced), 0, "{name}");
    }
    // Negative control: a thousandth more is seen.
    let brighter: Vec<[f32; 3]> = plain.iter().map(|p| p.map(|c| c * 1.001)).collect();
    assert!(strays(&plain, &brighter) > 300);
}

#[test]
fn all_features_together_leave_the_images_of_both_methods() {
    for (name, half_degrees) in [("cornell", 19.0), ("gallery", 40.0)] {
        let scene = builtin(name);
        for method in [Method::Path, Method::Photon] {
            let (plain, _) = image(&scene, method, half_degrees, ForceSettings::default());
            let mut force = ForceSettings::default();
            for (_, switch) in SWITCHES {
                *switch(&mut force) = Force::On;
            }
            let (forced, renderer) = image(&scene, method, half_degrees, force);
            let mut names = SWITCHES.iter().map(|(name, _)| name);
            assert!(names.all(|name| is_compiled_in(&renderer, name)));
            assert_eq!(strays(&plain, &forced), 0, "{name} by {method:?}");
        }
    }
}

#[test]
fn normal_maps_bring_textures_and_go_with_them() {
    let textured = builtin("gallery");
    let (_, plain) = image(&textured, Method::Path, 40.0, ForceSettings::default());
    assert!(plain.features().textures, "the gallery is textured");
    let alone = ForceSettings {
        normal_maps: Force::On,
        ..ForceSettings::default()
    };
    let (_, brought) = image(&builtin("cornell"), Method::Path, 19.0, alone.clone());
    assert!(brought.features().textures);
    let without = ForceSettings {
        textures: Force::Off,
        ..alone
    };
    let (pixels, gone) = image(&textured, Method::Path, 40.0, without);
    assert!(!gone.features().normal_maps && !gone.features().uv1);
    assert!(pixels.iter().flatten().any(|&channel| channel > 0.0));
}

/// Where the scene's records lie must not show: textures, emitters, caustics, many lights, an environment.
#[test]
fn records_in_textures_render_the_same_image() {
    let [gallery, caustic] = ["gallery", "caustic"].map(builtin);
    let of = |name| Path::new("tests/reference").join(name);
    let [lights, mut sky] =
        ["many_lights.gltf", "environment.gltf"].map(|name| Scene::load(of(name)).unwrap());
    sky.environment = Some(load_environment(of("environment.hdr"), 1.0).unwrap().0);
    let names = ["gallery", "caustic", "lights", "sky"];
    for (name, scene) in names.into_iter().zip([gallery, caustic, lights, sky]) {
        for method in [Method::Path, Method::Photon] {
            let [plain, copied] = [Force::Off, Force::On].map(|record_texels| {
                let force = ForceSettings {
                    record_texels,
                    ..ForceSettings::default()
                };
                let (pixels, renderer) = image(&scene, method, 40.0, force);
                let on = record_texels == Force::On;
                assert_eq!(renderer.features().record_texels, on);
                pixels
            });
            assert!(plain.iter().flatten().any(|&value| value > 0.0), "{name}");
            assert_eq!(strays(&plain, &copied), 0, "{name} by {method:?}");
        }
    }
}

/// What embedded kernels are to Vulkan says what their WGSL says, which wgpu is left to translate where a module is changed.
#[test]
fn kernels_are_what_wgpu_makes_of_them() {
    let changed = changed(
        "shared/math",
        "// Constants",
        "// Not as they were: constants",
    );
    let scene = builtin("gallery");
    let views = parallel_views(scene.start_pose(), 0.06, square_fov(40.0));
    for method in [Method::Path, Method::Photon] {
        let settings = settings(|s| s.method = method);
        let [own, wgpus] = [&ShaderLibrary::embedded(), &changed].map(|library| {
            let mut renderer =
                renderer_by(library, &scene, &settings, Eyes::Both, [24, 24]).unwrap();
            frame(&mut renderer, &views);
            radiance(&renderer, Eye::Right)
        });
        assert_eq!(strays(&own, &wgpus), 0, "{method:?}");
    }
}
