//! Levels of textures: which one a ray reads, what normals add to roughness, how wide rays are beyond surfaces, and a checkerboard
//! to the horizon.

use std::f64::consts::{FRAC_1_PI, PI};

use bytemuck::{Pod, Zeroable};
use glam::{DAffine3, DQuat, DVec3};
use stereolux::gpu::Resources;
use stereolux::renderer::Eye;
use stereolux::renderer::packing::sample_image;
use stereolux::scene::{AlphaMode, Image, Material, Scene, Texture, TextureRef};
use stereolux::settings::{Method, Mips, Reuse};
use stereolux::xr::Pose;

use super::lights_probe::{SceneUpload, add_triangles};
use super::support::{
    both_bits, builtin, context, parallel_views, radiance, rendered, settings, square_fov,
};
use super::trace_probe::{ask, probe};

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
struct Query {
    ray_direction: [f32; 3],
    width_m: f32,
    spread: f32,
    distance_m: f32,
    pdf: f32,
    flags: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Answer {
    level: f32,
    taps: f32,
    alpha: f32,
    spread: f32,
    width_m: f32,
    glass_alpha: f32,
    passing_alpha: f32,
}

const TEXELS: u32 = 256;

fn textured(texel: impl Fn(u32, u32) -> [u8; 4], size: u32, scale: f32) -> (Scene, TextureRef) {
    let bytes = (0..size * size).flat_map(|at| texel(at % size, at / size));
    let scene = Scene {
        images: vec![Image {
            name: "made".to_owned(),
            width: size,
            height: size,
            rgba8: bytes.collect(),
        }],
        textures: vec![Texture::default()],
        ..Scene::default()
    };
    let reference = TextureRef {
        texcoord_from_uv: [scale, 0.0, 0.0, 0.0, scale, 0.0],
        ..TextureRef::plain(0)
    };
    (scene, reference)
}

/// Of the triangle that is asked about; its coordinates are its metres.
const CORNERS: [DVec3; 3] = [DVec3::ZERO, DVec3::X, DVec3::Y];

/// Answers for the triangle with the same normal everywhere.
fn answers(scene: Scene, material: Material, queries: &[Query]) -> Vec<Answer> {
    answers_of([DVec3::Z; 3], scene, material, queries)
}

fn answers_of(
    normals: [DVec3; 3],
    mut scene: Scene,
    material: Material,
    queries: &[Query],
) -> Vec<Answer> {
    add_triangles(&mut scene, &[CORNERS], material, DAffine3::IDENTITY);
    scene.meshes[0].normals = normals.map(|normal| normal.as_vec3().to_array()).to_vec();
    let context = context();
    let on = [
        "textures",
        "base_color_maps",
        "normal_maps",
        "glossy",
        "dielectric",
        "thin_walls",
        "mips",
    ];
    let kernel = probe(&context, include_str!("mips_probe.wesl"), &on);
    let upload = SceneUpload::new(&context, &scene, DVec3::ZERO);
    let resources = upload.with(Resources::new());
    ask(&context, &kernel, &resources, queries, queries.len())
}

fn query(width_m: f64, cosine: f64) -> Query {
    let sine = (1.0 - cosine * cosine).sqrt();
    // Neither along the triangle's edges nor along the texture's axes.
    let direction = DVec3::new(0.6 * sine, 0.8 * sine, -cosine);
    Query {
        ray_direction: direction.as_vec3().to_array(),
        width_m: width_m as f32,
        ..Query::default()
    }
}

/// A square texture's level is the logarithm of the texels that a ray's width covers; a slanted one takes a tap per width.
#[test]
fn the_level_is_the_logarithm_of_texels_per_ray() {
    let widths = [0.001, 0.0039, 0.004, 0.01, 0.05, 0.3];
    for scale in [1.0_f32, 2.5] {
        let (scene, reference) = textured(|_, _| [255; 4], TEXELS, scale);
        let material = Material {
            base_color_texture: Some(reference),
            ..Material::default()
        };
        for (cosine, taps) in [(1.0, 1.0), (0.9, 1.0), (1.0 / 3.0, 3.0), (0.01, 8.0)] {
            let queries = widths.map(|width| query(width, cosine));
            let found = answers(scene.clone(), material.clone(), &queries);
            for (width, found) in widths.iter().zip(found) {
                let texels = width * f64::from(scale) * f64::from(TEXELS);
                let longest = (texels / cosine).max(1.0);
                let count = (longest / texels.max(1.0) - 0.25).ceil().clamp(1.0, 8.0);
                let due = texels.max(longest / count).max(1.0).log2().min(8.0);
                // Some 30 roundings of 2^-24 in the rates, over ln 2; the cosine's own at 0.01 is a hundred times as large.
                let tolerance = 5e-6 / cosine;
                let off = (f64::from(found.level) - due).abs();
                assert!(off < tolerance, "{width} at {cosine}: {found:?}, not {due}");
                assert_eq!(f64::from(found.taps), count, "{width} at {cosine}");
                assert!(texels < 8.0 || count == taps);
            }
        }
    }
}

/// Two normals at +-10 degrees, a texel each: where a ray covers many, they add their slopes' variance to alpha squared, but
/// for what passes a thin wall, which they do not turn.
#[test]
fn normals_that_a_ray_covers_make_a_surface_rougher() {
    let theta = 10.0_f64.to_radians();
    let byte = |value: f64| ((0.5 * value + 0.5) * 255.0).round() as u8;
    let texel = |x: u32, _: u32| {
        let side = if x.is_multiple_of(2) { 1.0 } else { -1.0 };
        [byte(side * theta.sin()), 128, byte(theta.cos()), 255]
    };
    let (scene, reference) = textured(texel, TEXELS, 1.0);
    for roughness in [0.0_f32, 0.3, 0.6] {
        let material = Material {
            roughness,
            metallic: 1.0,
            base_color_texture: Some(reference),
            normal_texture: Some(reference),
            ..Material::default()
        };
        let queries = [query(0.0, 1.0), query(0.1, 1.0)];
        let found = answers(scene.clone(), material.clone(), &queries);
        let plain = f64::from(roughness * roughness);
        let off = (f64::from(found[0].alpha) - plain).abs();
        assert!(off < 1e-6, "{found:?}");
        let due = (plain * plain + theta.tan().powi(2)).sqrt();
        // The law's own difference at this angle (see packing's tests) and a byte.
        let tolerance = theta.tan() * (1.0 - theta.cos()) + 2.0 / 255.0;
        let off = (f64::from(found[1].alpha) - due).abs();
        assert!(off < tolerance, "{found:?}, {due}");
        for is_open in [false, true] {
            let glass = Material {
                metallic: 0.0,
                transmission: 1.0,
                is_open,
                ..material.clone()
            };
            let found = answers(scene.clone(), glass, &queries)[1];
            let off = (f64::from(found.glass_alpha) - due).abs();
            assert!(off < tolerance, "{found:?}, {due}");
            let [due, tolerance] = if is_open {
                [plain, 1e-6]
            } else {
                [due, tolerance]
            };
            let off = (f64::from(found.passing_alpha) - due).abs();
            assert!(off < tolerance, "{found:?}, {due}");
        }
    }
}

/// `BSDF_DELTA` and `BSDF_TRANSMITTED` in `shaders/shared/bsdf_types.wesl`.
const DELTA: u32 = 1;
const TRANSMITTED: u32 = 2;

/// f64 twin: how wide a cone opens whose edge is reflected, or refracted by an index, where it meets a sphere that bulges towards it
/// (a hollow for negative radii). A cone a millionth as wide, by exact angles.
fn edge_beyond(width: f64, spread: f64, radius: f64, refracted_by: Option<f64>) -> f64 {
    const SMALL: f64 = 1e-6;
    let (height, slope) = (0.5 * SMALL * width, 0.5 * SMALL * spread);
    let normal = (height / radius).asin();
    // Angles away from the axis; the ray's own is measured from the normal.
    let incident = slope.atan() + normal;
    let beyond = match refracted_by {
        None => incident + normal,
        Some(eta) => (incident.sin() / eta).asin() - normal,
    };
    2.0 / SMALL * beyond.tan() * height.signum()
}

/// A triangle with the normals of a sphere, met along its axis from outside and from inside.
#[test]
fn cones_widen_beyond_curved_mirrors_and_lenses_as_their_edges_do() {
    const IOR: f64 = 1.5;
    let (scene, reference) = textured(|_, _| [255; 4], 8, 1.0);
    let material = Material {
        base_color_texture: Some(reference),
        metallic: 0.0,
        transmission: 1.0,
        roughness: 0.0,
        ior: IOR as f32,
        ..Material::default()
    };
    let met = DVec3::new(0.2, 0.3, 0.0);
    // Spheres through the corners, whose normals then are linear in the plane: interpolated they turn by one over the distance of
    // the place in the plane from the centre. The last one is flat.
    for depth in [2.0, 10.0, 1e9] {
        let center = DVec3::new(0.5, 0.5, -depth);
        let normals = CORNERS.map(|corner| (corner - center).normalize());
        let radius = (met - center).length();
        let (mut queries, mut due) = (Vec::new(), Vec::new());
        // The last one has passed its focus.
        for (width, spread, distance) in [
            (0.0, 0.01, 2.0),
            (0.03, 0.0, 1.0),
            (0.03, -0.004, 3.0),
            (0.01, -0.03, 2.0),
        ] {
            for (side, flags) in [
                (1.0, DELTA),
                (-1.0, DELTA),
                (1.0, DELTA | TRANSMITTED),
                (-1.0, DELTA | TRANSMITTED),
            ] {
                let direction = DVec3::new(0.0, 0.0, -side);
                queries.push(Query {
                    ray_direction: direction.as_vec3().to_array(),
                    width_m: width as f32,
                    spread: spread as f32,
                    distance_m: distance as f32,
                    pdf: 1.0,
                    flags,
                });
                let there = width + spread * distance;
                let eta = if side > 0.0 { IOR } else { 1.0 / IOR };
                let refracted_by = (flags & TRANSMITTED != 0).then_some(eta);
                due.push((
                    there,
                    spread,
                    edge_beyond(there, spread, side * radius, refracted_by),
                ));
            }
        }
        let found = answers_of(normals, scene.clone(), material.clone(), &queries);
        for ((query, found), (there, spread, due)) in queries.iter().zip(&found).zip(due) {
            // A dozen roundings of 2^-24 of each term; and as many of normals, whose difference over the triangle's 1 m is the
            // turn.
            let turned = there.abs() / radius;
            let tolerance = 1e-6 * (spread.abs() + turned) + 2e-6 * there.abs();
            let off = (f64::from(found.spread) - due).abs();
            assert!(
                off < tolerance,
                "{depth} {query:?}: {found:?}, not {due} +- {tolerance}"
            );
            let off = (f64::from(found.width_m) - there.abs()).abs();
            assert!(off < 1e-7, "{query:?}: {found:?}, not {there} wide");
            // Negative control: what the cone was like before is something else, but for flat mirrors.
            let is_flat = depth > 1e6 && (query.flags == DELTA || spread == 0.0);
            assert!(
                is_flat || (due - spread).abs() > 100.0 * tolerance,
                "{query:?}"
            );
        }
    }
}

/// A bounce of density p adds a sixteenth of 1 / p sr to the cone's solid angle: half a radian across for a diffuse surface.
#[test]
fn rough_bounces_open_cones_by_their_share_of_the_density() {
    let (scene, reference) = textured(|_, _| [255; 4], 8, 1.0);
    let material = Material {
        base_color_texture: Some(reference),
        ..Material::default()
    };
    let densities = [FRAC_1_PI, 0.05, 4.0, 300.0];
    for spread in [0.0, 0.02] {
        let of = |density: f64, flags| Query {
            spread: spread as f32,
            distance_m: 1.0,
            pdf: density as f32,
            flags,
            ..query(0.0, 1.0)
        };
        let queries = densities.map(|density| of(density, 0));
        let found = answers(scene.clone(), material.clone(), &queries);
        for (density, found) in densities.iter().zip(&found) {
            let solid_angle = |spread: f64| 0.25 * PI * spread * spread;
            let added = solid_angle(f64::from(found.spread)) - solid_angle(spread);
            // A dozen roundings of 2^-24 of all of it.
            let off = (added * 16.0 * density - 1.0).abs();
            let whole = 1.0 + solid_angle(spread) * 16.0 * density;
            assert!(off < 1e-6 * whole, "{density}: {found:?}");
        }
        if spread == 0.0 {
            assert!((found[0].spread - 0.5).abs() < 1e-6, "{found:?}");
        }
        // Negative control: a mirror's bounce adds nothing.
        let mirrored = answers(scene.clone(), material.clone(), &[of(FRAC_1_PI, DELTA)]);
        assert_eq!(mirrored[0].spread, spread as f32);
    }
}

/// Half the floor's width, m: farther away than any pixel's centre sees it.
const FLOOR_M: f64 = 100.0;
const SIZE: usize = 64;
const EYE: DVec3 = DVec3::new(0.03, 1.0, 0.0);
/// Where the mirror stands.
const MIRROR_Z: f64 = -0.5;

/// A glowing floor of black and white squares of 0.25 m, perhaps with a mirror before the eye.
fn checkerboard(with_mirror: bool) -> Scene {
    let texel = |x: u32, y: u32| [255 * ((x / 8 + y / 8) % 2) as u8; 4];
    let (mut scene, reference) = textured(texel, 64, 0.5);
    let at = |x: f64, z: f64| DVec3::new(FLOOR_M * x, 0.0, FLOOR_M * z);
    let floor = [
        [at(-1.0, 1.0), at(1.0, 1.0), at(1.0, -1.0)],
        [at(-1.0, 1.0), at(1.0, -1.0), at(-1.0, -1.0)],
    ];
    let material = Material {
        emission: [1.0; 3],
        emissive_texture: Some(reference),
        ..Material::lambert("squares", [0.0; 3])
    };
    add_triangles(&mut scene, &floor, material, DAffine3::IDENTITY);
    let places = floor.iter().flatten();
    scene.meshes[0].uv0 = places.map(|at| [at.x as f32, at.z as f32]).collect();
    if with_mirror {
        let at = |x: f64, y: f64| DVec3::new(x, y, MIRROR_Z);
        let mirror = [
            [at(-50.0, -1.0), at(50.0, -1.0), at(50.0, 50.0)],
            [at(-50.0, -1.0), at(50.0, 50.0), at(-50.0, 50.0)],
        ];
        let material = Material {
            metallic: 1.0,
            roughness: 0.0,
            ..Material::default()
        };
        add_triangles(&mut scene, &mirror, material, DAffine3::IDENTITY);
        scene.meshes[1].normals = vec![[0.0, 0.0, 1.0]; 6];
    }
    scene
}

/// The lower half of what an eye sees, one number per pixel.
fn seen(scene: &Scene, position: DVec3, turn: f64, mips: Mips) -> Vec<f64> {
    let settings = settings(|s| {
        s.method = Method::Path;
        s.reuse = Reuse::Off;
        s.path.max_depth = 2;
        s.textures.mips = mips;
    });
    let head = Pose::new(position, DQuat::from_rotation_y(turn));
    let views = parallel_views(head, 0.0, square_fov(45.0));
    let renderer = rendered(scene, &settings, [SIZE as u32; 2], &views);
    assert_eq!(renderer.features().mips, mips == Mips::On);
    let lower = &radiance(&renderer, Eye::Left)[SIZE * SIZE / 2..];
    lower.iter().map(|pixel| f64::from(pixel[1])).collect()
}

/// The same by 4,096 samples spread over each pixel, of an endless floor.
fn converged(scene: &Scene) -> Vec<f64> {
    let sample = |x: f64, y: f64| {
        let tangent = |at: f64| 2.0 * at / SIZE as f64 - 1.0;
        let (right, down) = (tangent(x), tangent(y));
        let at = [EYE.x + right / down, -1.0 / down].map(|metres| 0.5 * metres);
        sample_image(scene, 0, at, false)[0]
    };
    let pixel = |at: usize| {
        let (x, y) = (at % SIZE, SIZE / 2 + at / SIZE);
        let part = |k: usize| (k as f64 + 0.5) / 64.0;
        let samples = (0..4096).map(|k| sample(x as f64 + part(k % 64), y as f64 + part(k / 64)));
        samples.sum::<f64>() / 4096.0
    };
    (0..SIZE * SIZE / 2).map(pixel).collect()
}

fn rms(a: &[f64], b: &[f64]) -> f64 {
    let sum: f64 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
    (sum / a.len() as f64).sqrt()
}

/// One sample per pixel. The contrast is 1.
#[test]
fn a_checkerboard_to_the_horizon_has_no_aliases() {
    let scene = checkerboard(false);
    let due = converged(&scene);
    let error = |mips| rms(&seen(&scene, EYE, 0.0, mips), &due);
    let (with, without) = (error(Mips::On), error(Mips::Off));
    assert!(with < 0.05, "{with}");
    // Negative control: what is seen without levels.
    assert!(without > 0.15, "{without}");
}

/// Levels count texels that reach the cutoff by themselves. Where the vertices' alpha keeps all of them below it nothing is met.
#[test]
fn vertices_cut_out_what_no_texel_can_keep() {
    let brightness = |vertex_alpha: f32| {
        let mut scene = checkerboard(false);
        let material = &mut scene.materials[0];
        material.base_color_texture = material.emissive_texture;
        material.alpha_mode = AlphaMode::Mask { cutoff: 0.5 };
        let mesh = &mut scene.meshes[0];
        mesh.colors = vec![[1.0, 1.0, 1.0, vertex_alpha]; mesh.positions.len()];
        mesh.has_colors = true;
        let seen = seen(&scene, EYE, 0.0, Mips::On);
        seen.iter().sum::<f64>() / seen.len() as f64
    };
    assert_eq!(brightness(0.4), 0.0);
    // Half of the squares, with all of their light near by and half of it where levels mix them.
    let kept = brightness(0.6);
    assert!((0.25..0.5).contains(&kept), "{kept}");
}

/// What a mirror shows is what its mirror image shows, turned over; and so as free of aliases.
#[test]
fn a_mirrored_checkerboard_is_read_as_its_mirror_image() {
    let image_of_eye = DVec3::new(EYE.x, EYE.y, 2.0 * MIRROR_Z - EYE.z);
    let turned = |image: Vec<f64>| -> Vec<f64> {
        let rows = image.chunks(SIZE);
        rows.flat_map(|row| row.iter().rev().copied()).collect()
    };
    for mips in [Mips::On, Mips::Off] {
        let mirrored = seen(&checkerboard(true), EYE, 0.0, mips);
        let due = turned(seen(&checkerboard(false), image_of_eye, PI, mips));
        // A coordinate of up to 50 repeats of 64 texels is rounded to 2^-24 of that some ten times: 2e-3 texels, of which
        // each may change the value by 1. Where the texture is not averaged, rays to the horizon multiply that.
        let allowed = if mips == Mips::On { 0.02 } else { 0.5 };
        let worst = mirrored.iter().zip(&due).map(|(a, b)| (a - b).abs());
        let worst = worst.fold(0.0, f64::max);
        assert!(worst < allowed, "{mips:?}: {worst}");
        assert!(rms(&mirrored, &due) < 0.005);
        // Negative control: not turned over it is another picture.
        assert!(rms(&mirrored, &turned(due)) > 0.1);
    }
}

/// Both eyes read the same levels where they stand in the same place.
#[test]
fn eyes_in_one_place_see_the_same_bits_with_levels() {
    let scene = builtin("gallery");
    for reuse in [Reuse::Off, Reuse::Lookup, Reuse::Scatter] {
        let settings = settings(|s| {
            s.reuse = reuse;
            s.textures.mips = Mips::On;
        });
        let views = parallel_views(scene.start_pose(), 0.0, square_fov(40.0));
        let [left, right] = both_bits(&rendered(&scene, &settings, [24, 24], &views));
        assert_eq!(left, right, "{reuse:?}");
    }
}
