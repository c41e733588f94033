//! What a runtime's images hold: colour against the PNG path, depth against f64, pixels that the lens hides.

use glam::DVec3;
use stereolux::gpu::{GpuContext, ShaderLibrary};
use stereolux::images::{Image, ImageRgb8, aces_filmic, tone_map};
use stereolux::renderer::{Eye, Renderer};
use stereolux::scene::{Material, Scene};
use stereolux::settings::{Eyes, Kept, Method, Reuse, Switch, Tone};
use stereolux::tone::tone_map_by;
use stereolux::xr::view::Fov;
use stereolux::xr::{Headset, HiddenArea, RuntimeTargets, SessionInfo, View};

use crate::suite::frame::layout::changed;
use crate::suite::support::{
    Triangles, bits, both, both_bits, builtin, context, frame, hit_rays, method, parallel_views,
    pixel_ray, radiance, renderer, renderer_by,
};
use crate::suite::textures::{bytes, target_texture};
use crate::suite::transport::hard_support::{add, constant_environment};

const SIZE: [u32; 2] = [64, 48];

fn targets(context: &GpuContext, format: wgpu::TextureFormat, depth: bool) -> RuntimeTargets {
    let pair = |format| [(); 2].map(|()| target_texture(context, SIZE, format));
    RuntimeTargets {
        color: pair(format),
        depth: depth.then(|| pair(wgpu::TextureFormat::Depth32Float)),
        near_m: 0.05,
    }
}

/// IEEE 754 half to f64.
fn half(bits: u16) -> f64 {
    let (sign, exponent, fraction) = (bits >> 15, (bits >> 10) & 31, f64::from(bits & 1023));
    let magnitude = match exponent {
        0 => fraction * 2_f64.powi(-24),
        31 => f64::INFINITY,
        _ => (1.0 + fraction / 1024.0) * 2_f64.powi(i32::from(exponent) - 15),
    };
    if sign == 1 { -magnitude } else { magnitude }
}

/// What the PNG shows of these pixels at an exposure of 1.5.
fn png_of(pixels: Vec<[f32; 3]>, tone: Tone) -> ImageRgb8 {
    tone_map_by(&Image::new(SIZE[0], SIZE[1], pixels).unwrap(), 1.5, tone)
}

/// Asymmetric and canted.
fn views() -> [View; 2] {
    let head = builtin("cornell").start_pose();
    let mut views = parallel_views(head, 0.07, Fov::from_degrees(-32.0, 22.0, 25.0, -20.0));
    views[1].orientation = (views[1].orientation * glam::DQuat::from_rotation_y(0.05)).normalize();
    views[1].fov = Fov::from_degrees(-22.0, 32.0, 25.0, -20.0);
    views
}

fn rendered(reuse: Reuse, exposure: f64) -> Renderer {
    let mut settings = method(Method::Photon, reuse);
    settings.output.exposure = exposure;
    settings.spp = 2;
    let mut renderer = renderer(&builtin("cornell"), &settings, SIZE);
    frame(&mut renderer, &views());
    renderer
}

#[test]
fn images_hold_what_the_png_shows_encoded_once() {
    let mut renderer = rendered(Reuse::Scatter, 1.5);
    let library = ShaderLibrary::embedded();
    for eye in [Eye::Left, Eye::Right] {
        let image = Image::new(SIZE[0], SIZE[1], radiance(&renderer, eye)).unwrap();
        let png = tone_map(&image, 1.5);
        let index = usize::from(eye == Eye::Right);
        for (format, order) in [
            (wgpu::TextureFormat::Rgba8UnormSrgb, [0, 1, 2]),
            (wgpu::TextureFormat::Bgra8UnormSrgb, [2, 1, 0]),
        ] {
            let targets = targets(renderer.context(), format, false);
            renderer.submit_to(&library, &targets).unwrap();
            let found = bytes(renderer.context(), &targets.color[index], 4);
            let mut off = 0;
            for (texel, expected) in found.chunks_exact(4).zip(&png.pixels) {
                for (channel, value) in order.iter().zip(expected) {
                    // Vulkan lets an 8-bit sRGB store be off by 0.6 of a step before rounding: one step after.
                    let difference = texel[*channel].abs_diff(*value);
                    assert!(difference <= 1, "{format:?}: {texel:?} for {expected:?}");
                    off += u32::from(difference);
                }
                assert_eq!(texel[3], 255);
            }
            // 0.6 instead of 0.5: at most a fifth of the stores round to the neighbour.
            assert!(off < SIZE[0] * SIZE[1] * 3 / 5, "{format:?}: {off} steps");
        }
        let targets = targets(renderer.context(), wgpu::TextureFormat::Rgba16Float, false);
        renderer.submit_to(&library, &targets).unwrap();
        let found = bytes(renderer.context(), &targets.color[index], 8);
        for (texel, pixel) in found.chunks_exact(8).zip(&image.pixels) {
            for (half_bytes, linear) in texel.chunks_exact(2).zip(pixel) {
                let value = half(u16::from_le_bytes([half_bytes[0], half_bytes[1]]));
                let expected = f64::from(aces_filmic(linear * 1.5));
                // Half floats have 11 bits: half a step is 2^-12 of the value, a whole one if rounded towards zero.
                let allowed = expected * 2_f64.powi(-10) + 1e-6;
                assert!(
                    (value - expected).abs() <= allowed,
                    "{value} for {expected}"
                );
            }
        }
    }
    // The eyes differ, so an exchange would have shown.
    let [left, right] = both_bits(&renderer);
    assert_ne!(left, right);
}

#[test]
fn runtime_and_mirror_get_the_reconstructed_picture() {
    let mut settings = method(Method::Path, Reuse::Off);
    settings.output.exposure = 1.5;
    settings.output.tone = Tone::Agx;
    settings.reconstruct.svgf = true.into();
    settings.reconstruct.taa = true.into();
    let mut renderer = renderer(&builtin("cornell"), &settings, SIZE);
    let library = ShaderLibrary::embedded();
    let format = wgpu::TextureFormat::Rgba8UnormSrgb;
    // What is shown changes places from frame to frame: an even and an odd one.
    for index in 0..4 {
        renderer.render_frame(&views(), index, |_| {}).unwrap();
        let pictures = both(&renderer).map(|shown| png_of(shown, Tone::Agx));
        let aces = both(&renderer).map(|shown| png_of(shown, Tone::Aces));
        let targets = targets(renderer.context(), format, false);
        renderer.submit_to(&library, &targets).unwrap();
        let window = target_texture(renderer.context(), [2 * SIZE[0], SIZE[1]], format);
        renderer.mirror_to(&library, &window).unwrap();
        let mirrored = bytes(renderer.context(), &window, 4);
        for (eye, picture) in pictures.iter().enumerate() {
            let submitted = bytes(renderer.context(), &targets.color[eye], 4);
            let rows = mirrored.chunks_exact(8 * SIZE[0] as usize);
            let half: Vec<u8> = rows
                .flat_map(|row| row.chunks_exact(4 * SIZE[0] as usize).nth(eye).unwrap())
                .copied()
                .collect();
            for (what, found) in [("runtime", &submitted), ("mirror", &half)] {
                // An 8-bit store may round to the neighbour, as above.
                let furthest = |picture: &ImageRgb8| {
                    let texels = found.chunks_exact(4).zip(&picture.pixels);
                    let off = texels.map(|(texel, expected)| off(texel, *expected));
                    off.max().unwrap()
                };
                assert!(furthest(picture) <= 1, "{what}, frame {index}, eye {eye}");
                // The other eye's picture, another curve's and the frame without reconstruction are others.
                assert!(furthest(&pictures[1 - eye]) > 20, "{what}");
                assert!(furthest(&aces[eye]) > 20, "{what}");
                let raw = renderer.read_samples(Eye::ALL[eye]).unwrap().unwrap();
                let raw = png_of(raw, Tone::Agx);
                assert!(index == 0 || furthest(&raw) > 20, "{what}, frame {index}");
            }
        }
    }
}

/// The channel that is furthest off.
fn off(texel: &[u8], expected: [u8; 3]) -> u8 {
    let channels = texel.iter().zip(expected);
    channels.map(|(a, b)| a.abs_diff(b)).max().unwrap()
}

/// At a lower resolution the runtime gets the upper left part of its images, and a window the same picture enlarged.
#[test]
fn a_lower_resolution_fills_the_upper_left_part() {
    let mut renderer = rendered(Reuse::Scatter, 1.0);
    let library = ShaderLibrary::embedded();
    let format = wgpu::TextureFormat::Rgba8UnormSrgb;
    let targets = targets(renderer.context(), format, true);
    let window = target_texture(renderer.context(), [2 * SIZE[0], SIZE[1]], format);
    renderer.submit_to(&library, &targets).unwrap();
    renderer.mirror_to(&library, &window).unwrap();
    let mut quality = renderer.most_quality();
    quality.resolution_scale = 0.5;
    renderer.set_quality(&quality).unwrap();
    frame(&mut renderer, &views());
    let made = renderer.context().resources_made();
    renderer.submit_to(&library, &targets).unwrap();
    renderer.mirror_to(&library, &window).unwrap();
    assert_eq!(renderer.context().resources_made(), made);
    let [width, height] = [32, 24];
    assert_eq!(renderer.size(), [width, height]);
    let depths = targets.depth.as_ref().unwrap();
    let mirrored = bytes(renderer.context(), &window, 4);
    for (index, eye) in [Eye::Left, Eye::Right].into_iter().enumerate() {
        let image = Image::new(width, height, radiance(&renderer, eye)).unwrap();
        let png = tone_map(&image, 1.0);
        let color = bytes(renderer.context(), &targets.color[index], 4);
        let depth = bytes(renderer.context(), &depths[index], 4);
        let rays = hit_rays(&renderer, eye);
        for (place, texel) in color.chunks_exact(4).enumerate() {
            let (x, y) = (place as u32 % SIZE[0], place as u32 / SIZE[0]);
            let depth: [u8; 4] = depth[4 * place..][..4].try_into().unwrap();
            if x >= width || y >= height {
                assert_eq!(texel, [0, 0, 0, 255]);
                assert_eq!(f32::from_le_bytes(depth), 0.0);
                continue;
            }
            let expected = png.pixels[(y * width + x) as usize];
            // One step, as above. A pixel of the image is four of the window, whose four places all lie in it.
            let in_window = (y * 2 * SIZE[0] + x) * 2 + index as u32 * SIZE[0];
            let shown = [0, 1, 2 * SIZE[0], 2 * SIZE[0] + 1].map(|k| 4 * (in_window + k) as usize);
            let shown = shown.map(|at| &mirrored[at..at + 4]);
            for texel in shown.into_iter().chain([texel]) {
                let what = format!("{texel:?} for {expected:?} at {x}, {y}");
                assert!(off(texel, expected) <= 1, "{what}");
            }
            let is_hit = rays[(y * width + x) as usize][3] > 0.0;
            assert_eq!(f32::from_le_bytes(depth) > 0.0, is_hit, "{x}, {y}");
        }
    }
}

#[test]
fn depth_is_the_distance_along_the_eye_s_axis_also_where_pixels_are_carried_over() {
    let scene = builtin("cornell");
    let triangles = Triangles::of(&scene);
    let library = ShaderLibrary::embedded();
    for case in 0..4 {
        let reuse = [Reuse::Off, Reuse::Scatter][case % 2];
        let filters = [Switch::Off, Switch::On][case / 2];
        let mut settings = method(Method::Photon, reuse);
        (settings.reconstruct.svgf, settings.reconstruct.taa) = (filters, filters);
        settings.photon.count = 100;
        settings.output.kept = Kept::Picture;
        let mut without = renderer(&scene, &settings, SIZE);
        settings.output.kept = Kept::Depth;
        let mut renderer = renderer(&scene, &settings, SIZE);
        let stereo = frame(&mut renderer, &views()).stereo;
        assert_eq!(stereo.reused > 0, reuse == Reuse::Scatter);
        let format = wgpu::TextureFormat::Rgba16Float;
        let [own, targets] = [&without, &renderer].map(|of| targets(of.context(), format, true));
        renderer.submit_to(&library, &targets).unwrap();
        frame(&mut without, &views());
        assert_eq!(without.submit_to(&library, &own).is_ok(), case > 1);
        let depth = targets.depth.as_ref().unwrap();
        for (index, view) in views().iter().enumerate() {
            let found = bytes(renderer.context(), &depth[index], 4);
            let (mut near, mut misses, total) = (0, 0, found.len() / 4);
            for (pixel, texel) in found.chunks_exact(4).enumerate() {
                let ray = pixel_ray(view, pixel, SIZE);
                let value = f64::from(f32::from_le_bytes(texel.try_into().unwrap()));
                let Some((distance, ..)) = triangles.closest(ray.origin, ray.direction, 1e-4)
                else {
                    near += usize::from(value == 0.0);
                    misses += 1;
                    continue;
                };
                let expected_m = -view.point_in_eye(ray.origin + ray.direction * distance).z;
                // A carried-over sample lies anywhere in its pixel, as do those of filters; else it is the pixel's own ray in f32.
                let tolerance = if case == 0 { 1e-5 } else { 0.06 };
                near += usize::from((0.05 / value - expected_m).abs() < tolerance * expected_m);
            }
            // Rays along silhouettes fall to one side in f32 and to the other in f64; a carried-over sample may lie beyond.
            let least = total * if case == 0 { 99 } else { 90 } / 100;
            assert!(misses > 10 && misses < total / 2, "{misses} see nothing");
            assert!(near >= least, "{reuse:?}, eye {index}: {near} of {total}");
        }
    }
}

#[test]
fn hidden_pixels_are_black_and_the_others_as_without_a_mask() {
    let scene = builtin("cornell");
    // The corner of each eye's image, cut off at a slant.
    let corner = |side: f64| {
        HiddenArea::from_triangles(vec![[[side, 1.0], [side, -0.6], [-0.5 * side, 1.0]]])
    };
    let hidden = [corner(-0.8), corner(0.8)];
    for (light, reuse) in [
        (Method::Path, Reuse::Off),
        (Method::Photon, Reuse::Off),
        (Method::Photon, Reuse::Scatter),
    ] {
        let settings = method(light, reuse);
        let whole = super::support::rendered(&scene, &settings, SIZE, &views());
        let headset = Headset::load("symmetric").unwrap();
        let mut session = SessionInfo::of_profile("masked".to_owned(), &headset);
        session.hidden = Some(hidden.clone());
        let mut masked = Renderer::for_session(
            context(),
            &ShaderLibrary::embedded(),
            &scene,
            &settings,
            Eyes::Both,
            SIZE,
            &session,
        )
        .unwrap();
        let result = frame(&mut masked, &views());
        for (index, eye) in [Eye::Left, Eye::Right].into_iter().enumerate() {
            let mask = hidden[index].pixels(&views()[index].fov.tangents(), SIZE);
            let (without, with) = (radiance(&whole, eye), radiance(&masked, eye));
            let mut count = 0;
            for pixel in 0..with.len() {
                let is_hidden = mask[pixel / 32] >> (pixel % 32) & 1 == 1;
                count += usize::from(is_hidden);
                if is_hidden {
                    // What the left eye scatters there costs nothing and is left alone.
                    if eye == Eye::Left || reuse == Reuse::Off {
                        assert_eq!(with[pixel], [0.0; 3]);
                    }
                } else if reuse == Reuse::Off || eye == Eye::Left {
                    let [with, without] = [&with, &without].map(|all| all[pixel].map(f32::to_bits));
                    assert_eq!(with, without, "{eye:?} {pixel}");
                }
            }
            assert!(count > 100 && count < with.len() / 2, "{count} hidden");
            if reuse == Reuse::Scatter && eye == Eye::Right {
                continue;
            }
            let lit = |image: &[[f32; 3]]| image.iter().filter(|p| p[0] > 0.0).count();
            assert!(lit(&without) > lit(&with));
        }
        if reuse == Reuse::Scatter {
            assert!(result.stereo.reused > 0 && result.stereo.filled > 0);
        }
    }
}

#[test]
fn reuse_can_be_switched_and_back() {
    let scene = builtin("cornell");
    let mut switched = renderer(&scene, &method(Method::Photon, Reuse::Scatter), SIZE);
    let first = frame(&mut switched, &views());
    let with_reuse = bits(&radiance(&switched, Eye::Right));
    assert!(switched.switch_reuse());
    let second = frame(&mut switched, &views());
    assert!(first.stereo.reused > 0);
    assert_eq!(second.stereo.reused, 0);
    let settings = method(Method::Photon, Reuse::Off);
    let mut off = super::support::rendered(&scene, &settings, SIZE, &views());
    let right = |renderer: &Renderer| bits(&radiance(renderer, Eye::Right));
    assert_eq!(right(&switched), right(&off));
    assert!(switched.switch_reuse());
    frame(&mut switched, &views());
    assert_eq!(right(&switched), with_reuse);
    assert!(!off.switch_reuse(), "nothing was compiled to switch to");
}

/// Both eyes' texels in a frame, where the room may show.
fn texels(renderer: &mut Renderer, views: &[View; 2], frame: u32) -> [Vec<[u8; 4]>; 2] {
    renderer.render_frame(views, frame, |_| {}).unwrap();
    let targets = targets(renderer.context(), wgpu::TextureFormat::Rgba8Unorm, false);
    let library = ShaderLibrary::embedded();
    renderer.submit_to(&library, &targets).unwrap();
    targets.color.each_ref().map(|eye| {
        let found = bytes(renderer.context(), eye, 4);
        let texels = found.chunks_exact(4);
        texels.map(|t| [t[0], t[1], t[2], t[3]]).collect()
    })
}

/// The box under a blue sky, and what has many edges.
fn under_the_sky() -> Scene {
    let mut scene = builtin("cornell");
    scene.environment = Some(constant_environment([0.5, 1.0, 2.0]));
    let head = scene.start_pose();
    // Splinters at places of the R3 sequence, between the eyes and the box.
    let splinters = (0..800).map(|k| {
        let place = DVec3::new(0.8192, 0.6711, 0.5497) * f64::from(k);
        let at = place.fract() - DVec3::new(0.5, 0.5, 1.4);
        let corners = [at, at + 0.05 * place.fract(), at + 0.05 * DVec3::X];
        corners.map(|corner| head.position + head.orientation * corner)
    });
    let splinters: Vec<_> = splinters.collect();
    add(&mut scene, &splinters, Material::default());
    scene
}

/// A headset's images where the room may show: opaque where surfaces are, of the same colours, and nothing elsewhere.
#[test]
fn surroundings_let_the_room_through_and_surfaces_do_not() {
    let scene = under_the_sky();
    for (way, reuse) in [
        (Method::Photon, Reuse::Off),
        (Method::Photon, Reuse::Scatter),
        (Method::Path, Reuse::Off),
        (Method::Path, Reuse::Lookup),
    ] {
        let seen = |passthrough: bool| {
            let mut settings = method(way, reuse);
            settings.surroundings.passthrough = passthrough;
            let mut renderer = renderer(&scene, &settings, SIZE);
            (texels(&mut renderer, &views(), 0), renderer)
        };
        let ((plain, renderer), (through, _)) = (seen(false), seen(true));
        for (eye, (plain, through)) in Eye::ALL.into_iter().zip(plain.iter().zip(&through)) {
            let hits = hit_rays(&renderer, eye);
            let [mut covered, mut open] = [0; 2];
            for ((hit, plain), through) in hits.iter().zip(plain).zip(through) {
                assert_eq!(plain[3], 255);
                if hit[3] > 0.0 {
                    covered += 1;
                    assert_eq!(through, plain, "{reuse:?} {eye:?}");
                } else {
                    open += 1;
                    assert_eq!(*through, [0; 4], "{reuse:?} {eye:?}");
                    assert!(plain[2] > plain[0], "the surroundings are blue: {plain:?}");
                }
            }
            assert!(covered > 500 && open > 100, "{covered} {open}");
        }
    }
}

/// At rest alpha is the mean over all still frames, none of which forgets another; without that mean it is not.
#[test]
fn a_still_heads_alpha_is_the_mean_of_what_its_frames_cover() {
    const FRAMES: u32 = 24;
    let scene = under_the_sky();
    for still in [true, false] {
        let mut settings = method(Method::Photon, Reuse::Off);
        settings.surroundings.passthrough = true;
        (settings.reconstruct.taa, settings.reconstruct.still) = (true.into(), still.into());
        let mut renderer = renderer(&scene, &settings, SIZE);
        let mut means = vec![0.0; 2 * (SIZE[0] * SIZE[1]) as usize];
        let mut shown = [vec![], vec![]];
        for frame in 0..FRAMES {
            shown = texels(&mut renderer, &views(), frame);
            let hits = Eye::ALL.map(|eye| hit_rays(&renderer, eye)).concat();
            let met = means.iter_mut().zip(hits).filter(|(_, hit)| hit[3] > 0.0);
            met.for_each(|(mean, _)| *mean += 255.0 / f64::from(FRAMES));
        }
        // Half of a byte's step, and a rounding of 2^-24 with each of the frames' sums.
        let reach = 0.5 + f64::from(FRAMES) * 255.0 * 2_f64.powi(-24);
        let pairs = means.iter().zip(shown.concat());
        let differ = pairs.filter(|(mean, texel)| (**mean - f64::from(texel[3])).abs() > reach);
        let differ = differ.count();
        let is_edge = |mean: &&f64| 0.0 < **mean && **mean < 255.0;
        let edges = means.iter().filter(is_edge).count();
        assert!(edges > 50, "{edges}");
        let expected = if still { 0..1 } else { edges / 2..edges + 1 };
        assert!(expected.contains(&differ), "{still}: {differ} of {edges}");
    }
}

/// Where the other eye's hits are reused, alpha is that of the eye's own: also where a scattered hit that its own ray misses
/// is traced again. Equal eyes are equal.
#[test]
fn reuse_covers_what_the_right_eye_meets_by_itself() {
    let mut scene = under_the_sky();
    for material in &mut scene.materials {
        (material.metallic, material.roughness) = (1.0, 0.5);
    }
    // A rash cache believes in every winner; where nothing is taken over, all of its hits are traced again.
    let found = |hit: &str| format!("hit.instance == INVALID {{\n        return {hit};");
    let winner =
        found("Hit(left_hit_rays[own].w, record.instance, record.triangle, record.weights, 0.0)");
    let rash = changed("shared/cached_hit", &found("none"), &winner);
    let sound = ShaderLibrary::embedded();
    let alphas = |library: &ShaderLibrary, way, reuse, views: &[View; 2]| {
        let mut settings = method(way, reuse);
        settings.surroundings.passthrough = true;
        settings.stereo.max_lobe_shift *= f64::from(u8::from(!std::ptr::eq(library, &rash)));
        let mut renderer = renderer_by(library, &scene, &settings, Eyes::Both, SIZE).unwrap();
        let shown = texels(&mut renderer, views, 0);
        for (light, texel) in both(&renderer).concat().iter().zip(shown.concat()) {
            assert!(texel[3] > 0 || *light == [0.0; 3], "files are black there");
        }
        shown.map(|eye| eye.iter().map(|texel| texel[3]).collect::<Vec<_>>())
    };
    for way in [Method::Photon, Method::Path] {
        let alone = alphas(&sound, way, Reuse::Off, &views());
        let is_rim = |pair: &&[u8]| pair[0] != pair[1];
        assert!(alone[1].windows(2).filter(is_rim).count() > 300);
        let others = [
            (&sound, Reuse::Scatter),
            (&sound, Reuse::Lookup),
            (&rash, Reuse::Scatter),
        ];
        for (library, reuse) in others {
            let seen = alphas(library, way, reuse, &views());
            assert!(seen == alone, "{way:?} {reuse:?}");
        }
        let [left, right] = alphas(&sound, way, Reuse::Scatter, &[views()[0]; 2]);
        assert!(left == alone[0] && right == left, "{way:?}");
    }
}
