//! Reuse where it is hard: canted eyes, bumps at grazing angles, holes, textures that shine, shapes that change. What the
//! right eye takes over has the mean of what it would have traced.

use glam::{DQuat, DVec3};
use stereolux::gpu::ShaderLibrary;
use stereolux::renderer::Eye;
use stereolux::scene::{AlphaMode, Image, Material, Scene, Texture, TextureRef};
use stereolux::settings::{Eyes, Method, Reuse};
use stereolux::xr::{Pose, View};

use super::lookup::varnished_cornell;
use super::support::{
    builtin, mean, parallel_views, radiance, renderer_by, settings, square_fov, statistics,
};
use crate::suite::bvh::deforming::torn;
use crate::suite::frame::layout::changed;
use crate::suite::transport::hard_support::{
    add, add_point_light, add_sun, constant_environment, quad, tiles,
};

const SIZE: usize = 32;
/// Blocks along a side.
const BLOCKS: usize = 4;
const FRAMES: u32 = 32;

/// A box with a sheet of `material` in it, 0.8 m ahead of the eyes, whose texture is `texel` over 16x16 texels.
fn sheet(material: Material, turn: DQuat, texel: impl Fn(u32, u32) -> [u8; 4]) -> (Scene, Pose) {
    let mut scene = builtin("cornell");
    let head = scene.start_pose();
    scene.images.push(Image {
        name: "made".to_owned(),
        width: 16,
        height: 16,
        rgba8: (0..256).flat_map(|at| texel(at % 16, at / 16)).collect(),
    });
    scene.textures.push(Texture {
        image: scene.images.len() as u32 - 1,
        ..Texture::default()
    });
    let [u, v] = [DVec3::X, DVec3::Y].map(|axis| turn * axis);
    let middle = head.position + head.orientation * DVec3::NEG_Z * 0.8;
    add(
        &mut scene,
        &quad(middle - 0.25 * (u + v), 0.5 * u, 0.5 * v),
        material,
    );
    let mesh = scene.meshes.last_mut().unwrap();
    let corner = |k: u16| [2 * (k & 1), k & 2].map(f32::from);
    mesh.uv0 = [0, 1, 3, 0, 3, 2].map(corner).to_vec();
    (scene, head)
}

fn on_top(of: &Scene) -> Option<TextureRef> {
    Some(TextureRef::plain(of.textures.len() as u32))
}

fn cases() -> Vec<(&'static str, Scene, [View; 2])> {
    let plain = builtin("cornell");
    let texture = on_top(&plain);
    let upright = DQuat::IDENTITY;
    let checks = |x: u32, y: u32| (x / 4 + y / 4).is_multiple_of(2);
    let views = |head| parallel_views(head, 0.063, square_fov(20.0));
    let mut canted = views(plain.start_pose());
    for (view, turn) in canted.iter_mut().zip([0.1, -0.1]) {
        view.orientation *= DQuat::from_rotation_y(turn) * DQuat::from_rotation_z(turn);
    }
    let white = Material::lambert("sheet", [0.8; 3]);
    let bumps = Material {
        normal_texture: texture,
        ..white.clone()
    };
    let grazing = DQuat::from_rotation_x(-1.4);
    let waves = |x: u32, _| [if x % 8 < 4 { 168 } else { 88 }, 128, 248, 255];
    let (bumpy, head) = sheet(bumps, grazing, waves);
    // Shading normals that the eyes see from the front and from behind, the left one of the strip between more.
    let varnish = Material {
        roughness: 0.6,
        specular: 1.0,
        ..white.clone()
    };
    let beside = head.position + DVec3::new(0.5, 0.0, -0.4);
    let mut metal = white.clone();
    [metal.metallic, metal.roughness] = [1.0, 0.4];
    let leaning = [&white, &varnish, &metal].map(|material| {
        let (mut scene, _) = sheet(material.clone(), upright, |_, _| [255; 4]);
        let lean = DQuat::from_rotation_y(88_f64.to_radians()) * DVec3::Z;
        let mesh = scene.meshes.last_mut().unwrap();
        mesh.normals.fill(lean.as_vec3().to_array());
        add_point_light(&mut scene, beside, 2.0);
        scene
    });
    let [leaning, leaning_varnish, leaning_metal] = leaning;
    // Two channels of three say nothing about the light but in every other square of the sheet, and the lamp none.
    let painted = Material {
        base_color_texture: texture,
        ..white.clone()
    };
    // The varnish shows them what the paint does not.
    let varnished = Material {
        roughness: 1.0,
        specular: 1.0,
        ..painted.clone()
    };
    let (mut pure_in_varnish, _) = sheet(varnished, upright, |x, y| {
        let rest = 255 * u8::from((x / 2 + y / 2) % 2 == 0);
        [255 - rest, rest, rest, 255]
    });
    add_point_light(&mut pure_in_varnish, beside, 2.0);
    let (mut pure, _) = sheet(painted, upright, |x, y| {
        let rest = 255 * u8::from(checks(x, y));
        [255, rest, rest, 255]
    });
    for material in &mut pure.materials[..plain.materials.len()] {
        let first = usize::from(material.emission == [0.0; 3]);
        material.base_color[first..3].fill(0.0);
    }
    add_point_light(&mut pure, beside, 2.0);
    let holes = Material {
        base_color_texture: texture,
        alpha_mode: AlphaMode::Mask { cutoff: 0.5 },
        double_sided: true,
        ..white.clone()
    };
    let (holed, _) = sheet(holes.clone(), upright, |x, y| {
        [200, 200, 200, 255 * u8::from(checks(x, y))]
    });
    let veil = Material {
        alpha_mode: AlphaMode::Blend,
        ..holes
    };
    // Faint: a wall behind it is seen by most rays, and must not be by all.
    let (gauzy, _) = sheet(veil.clone(), upright, |_, _| [10, 10, 10, 26]);
    let (veiled, _) = sheet(veil, upright, |_, _| [200, 200, 200, 128]);
    let sign = Material {
        emissive_texture: texture,
        emission: [2.0; 3],
        ..white.clone()
    };
    let (metallic, _) = sheet(metal, DQuat::from_rotation_x(0.6), |_, _| [255; 4]);
    // Many samples of it find no light but its own: those must count, too.
    let glow = Material {
        emission: [0.01; 3],
        ..sign.clone()
    };
    let (glowing, _) = sheet(glow, DQuat::from_rotation_x(1.2), |_, _| [255; 4]);
    let (shining, _) = sheet(sign, upright, |x, y| [255 * u8::from(checks(x, y)); 4]);
    // Light from afar comes in by the box's open side.
    let mut sky = varnished_cornell(0.5);
    for material in &mut sky.materials {
        material.emission = [0.0; 3];
    }
    let mut sun = sky.clone();
    sky.environment = Some(constant_environment([1.0; 3]));
    let slanted = DQuat::from_rotation_y(0.3) * DQuat::from_rotation_x(-0.4);
    add_sun(&mut sun, slanted * DVec3::Z, 3.0);
    let parade = builtin("parade");
    let parade_views = views(parade.start_pose());
    vec![
        ("canted", plain, canted),
        ("bumps", bumpy, views(head)),
        ("leaning", leaning, views(head)),
        ("leaning varnish", leaning_varnish, views(head)),
        ("leaning metal", leaning_metal, views(head)),
        ("pure colours", pure, views(head)),
        ("pure colours in varnish", pure_in_varnish, views(head)),
        ("holes", holed, views(head)),
        ("veil", veiled, views(head)),
        ("gauze", gauzy, views(head)),
        ("sign", shining, views(head)),
        ("glow", glowing, views(head)),
        ("metal", metallic, views(head)),
        ("sky", sky, views(head)),
        ("sun", sun, views(head)),
        ("parade", parade, parade_views),
    ]
}

/// Luminance (plain mean of channels) of each block and of all.
fn blocks(image: &[[f32; 3]]) -> Vec<f64> {
    let mut all = tiles(image, SIZE, SIZE / BLOCKS);
    all.push(mean(image));
    all
}

/// Whether means are alike: within 3 standard errors and 0.5 % over the image, and 4 and 1 % in each block, as 400 of them are
/// asked. The shares are what visibility that is taken over may cost.
fn are_alike(a: &[(f64, f64)], b: &[(f64, f64)]) -> bool {
    a.iter().zip(b).enumerate().all(|(index, (a, b))| {
        let [errors, share] = if index == BLOCKS * BLOCKS {
            [3.0, 0.005]
        } else {
            [4.0, 0.01]
        };
        (a.0 - b.0).abs() <= errors * (a.1 + b.1).sqrt() + share * b.0
    })
}

/// Means of blocks with the squares of their errors, over frames, of both eyes; and the share of the right eye's surfaces that
/// was taken over.
fn means(
    library: &ShaderLibrary,
    by: Method,
    reuse: Reuse,
    (name, scene, views): &(&str, Scene, [View; 2]),
) -> ([Vec<(f64, f64)>; 2], f64) {
    let settings = settings(|s| {
        s.method = by;
        s.reuse = reuse;
        // Samples lie anywhere in their pixels, and elsewhere in each eye.
        s.spp = 2;
        s.photon.count = 4096;
        s.photon.every_frame = true;
    });
    let size = [SIZE as u32; 2];
    let mut renderer = renderer_by(library, scene, &settings, Eyes::Both, size).unwrap();
    if *name == "parade" {
        renderer.set_pose(&torn(scene, 0.3));
    }
    let mut values = Eye::ALL.map(|_| vec![Vec::new(); BLOCKS * BLOCKS + 1]);
    let mut reused = 0.0;
    for index in 0..FRAMES {
        let result = renderer.render_frame(views, index, |_| {}).unwrap();
        let [taken, rest] = [result.stereo.reused, result.stereo.filled].map(f64::from);
        reused += taken / (taken + rest).max(1.0) / f64::from(FRAMES);
        for (values, eye) in values.iter_mut().zip(Eye::ALL) {
            for (values, value) in values.iter_mut().zip(blocks(&radiance(&renderer, eye))) {
                values.push(value);
            }
        }
    }
    let of_eye = |eye: Vec<Vec<f64>>| -> Vec<_> { eye.iter().map(|v| statistics(v)).collect() };
    (values.map(of_eye), reused)
}

#[test]
fn what_is_taken_over_has_the_mean_of_what_would_be_traced() {
    let library = ShaderLibrary::embedded();
    for (by, case) in [Method::Photon, Method::Path]
        .into_iter()
        .flat_map(|by| cases().into_iter().map(move |case| (by, case)))
    {
        let name = case.0;
        let ([left, native], none) = means(&library, by, Reuse::Off, &case);
        assert!(none == 0.0 && !are_alike(&left, &native), "{by:?}, {name}");
        for reuse in [Reuse::Scatter, Reuse::Lookup] {
            let ([_, found], share) = means(&library, by, reuse, &case);
            let whole = [&found, &native].map(|means| means[BLOCKS * BLOCKS].0);
            eprintln!("{by:?}, {name}, {reuse:?}: {whole:?}, {share:.2} taken over");
            assert!(
                share > 0.4 && are_alike(&found, &native),
                "{by:?}, {name}, {reuse:?}"
            );
        }
    }
}

/// Negative controls: what the left eye's surfaces found under a sky is not carried over, and what it saw from behind their normals,
/// or in channels that they do not reflect, counts as light that is none.
#[test]
fn what_is_not_carried_and_what_is_none_is_noticed() {
    for (name, by, module, carries) in [
        (
            "leaning varnish",
            Method::Path,
            "shared/carrying",
            "found.kind = 0u;",
        ),
        (
            "leaning metal",
            Method::Photon,
            "passes/followed_light",
            " && wo.z > 0.0",
        ),
        (
            "pure colours",
            Method::Photon,
            "shared/mixing",
            " || (theirs.y & asked) != 0u",
        ),
        (
            "pure colours in varnish",
            Method::Photon,
            "shared/mixing",
            " || (theirs.y & asked) != 0u",
        ),
        (
            "sky",
            Method::Photon,
            "passes/direct_light",
            "by_surface = radiance * (weight / bounce.pdf);",
        ),
        (
            "sky",
            Method::Path,
            "passes/path_trace",
            "(*path).arriving += arriving;",
        ),
    ] {
        let case = cases().into_iter().find(|case| case.0 == name).unwrap();
        let library = changed(module, carries, "");
        let [native, found] =
            [Reuse::Off, Reuse::Lookup].map(|reuse| means(&library, by, reuse, &case).0[1].clone());
        let whole = [&found, &native].map(|means| means[BLOCKS * BLOCKS].0);
        eprintln!("{name}, {by:?} without {module}'s part: {whole:?}");
        assert!(!are_alike(&found, &native), "{name}, {by:?}");
    }
}
