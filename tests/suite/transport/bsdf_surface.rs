//! Surfaces as shading sees them: textures, vertex colours, normals, emission, alpha.

use bytemuck::{Pod, Zeroable};
use glam::{DAffine3, DMat3, DVec3};
use stereolux::gpu::buffers::storage_buffer_with_data;
use stereolux::gpu::{GpuContext, Resources};
use stereolux::renderer::packing::sample_image;
use stereolux::scene::{AlphaMode, Filter, Image, Material, Scene, Texture, TextureRef, Wrap};

use super::bsdf_probe::wide;
use super::bsdf_twin::Dice;
use super::lights_probe::{SceneUpload, add_triangles, glowing};
use super::support::context;
use super::trace_probe::{ask, probe};

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Query {
    ray_direction: [f32; 3],
    instance: u32,
    weights: [f32; 2],
    triangle: u32,
    key: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Answer {
    geometric_normal: [f32; 3],
    front_face: u32,
    shading_normal: [f32; 3],
    passes: u32,
    emission: [f32; 3],
    reserved_0: u32,
    albedo: [f32; 3],
    reserved_1: u32,
    attenuation: [f32; 3],
    reserved_2: u32,
}

const ALL: [&str; 9] = [
    "textures",
    "base_color_maps",
    "emissive_maps",
    "normal_maps",
    "alpha",
    "vertex_colors",
    "emitters",
    "uv1",
    "dielectric",
];

fn load(context: &GpuContext, on: &[&str], scene: &Scene, queries: &[Query]) -> Vec<Answer> {
    let kernel = probe(context, include_str!("bsdf_surface.wesl"), on);
    let upload = SceneUpload::new(context, scene, DVec3::ZERO);
    let count = queries.len();
    let query_count = storage_buffer_with_data(context, "query_count", &[count as u32]).unwrap();
    let resources = upload.with(Resources::new().with("query_count", &query_count));
    ask(context, &kernel, &resources, queries, count)
}

fn triangle() -> [DVec3; 3] {
    [DVec3::ZERO, DVec3::X, DVec3::Y]
}

fn query(weights: [f32; 2]) -> Query {
    Query {
        ray_direction: [0.0, 0.0, -1.0],
        instance: 0,
        weights,
        triangle: 0,
        key: 0,
    }
}

/// The triangle of this material, as it stands.
fn triangle_of(scene: &mut Scene, material: Material) {
    add_triangles(scene, &[triangle()], material, DAffine3::IDENTITY);
}

fn noise_image(seed: u64, width: u32, height: u32) -> Image {
    let mut dice = Dice::new(seed);
    let bytes = (0..width * height * 4).map(|_| (dice.unit() * 256.0) as u8);
    Image {
        name: format!("noise {seed}"),
        width,
        height,
        rgba8: bytes.collect(),
    }
}

/// A scene whose texture 0 has this value everywhere.
fn solid_scene(texel: [u8; 4]) -> Scene {
    Scene {
        images: vec![Image {
            name: "solid".to_owned(),
            width: 1,
            height: 1,
            rgba8: texel.to_vec(),
        }],
        textures: vec![texture(0)],
        ..Scene::default()
    }
}

fn texture_ref(texture: u32) -> Option<TextureRef> {
    Some(TextureRef::plain(texture))
}

fn texture(image: u32) -> Texture {
    Texture {
        image,
        ..Texture::default()
    }
}

#[test]
fn textures_read_as_gltf_samplers_say() {
    let context = context();
    let wraps = [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp];
    let mut dice = Dice::new(21);
    for (case, filter) in [Filter::Linear, Filter::Nearest].into_iter().enumerate() {
        for (index, wrap_u) in wraps.into_iter().enumerate() {
            let wrap_v = wraps[(index + case) % 3];
            let mut scene = Scene {
                images: vec![noise_image(1, 64, 64), noise_image(2, 7, 5)],
                ..Scene::default()
            };
            let sampler = Texture {
                image: 1,
                wrap_u,
                wrap_v,
                filter,
            };
            scene.textures = vec![texture(0), sampler];
            // KHR_texture_transform: offset, rotation and scale that leave the unit square on all sides.
            let transform = [2.5f32, -1.2, -0.7, 0.9, 3.1, -1.9];
            let uv_set = case as u32;
            let material = Material {
                base_color: [0.5, 1.0, 0.25, 1.0],
                base_color_texture: Some(TextureRef {
                    texture: 1,
                    uv_set,
                    texcoord_from_uv: transform,
                }),
                ..Material::lambert("textured", [1.0; 3])
            };
            triangle_of(&mut scene, material);
            scene.meshes[0].uv1 = vec![[0.3, 0.1], [0.9, -0.4], [-0.2, 1.3]];
            let mesh = &scene.meshes[0];
            let corners = [&mesh.uv0, &mesh.uv1][case].clone();
            let mut random = |_| {
                let at = [dice.unit(), dice.unit()];
                let is_inside = at[0] + at[1] < 1.0;
                query(at.map(|x| if is_inside { x as f32 } else { 1.0 - x as f32 }))
            };
            let queries: Vec<Query> = (0..1000).map(&mut random).collect();
            let on = ["textures", "base_color_maps", "uv1"];
            let answers = load(&context, &on, &scene, &queries);
            let mut compared = 0;
            for (query, answer) in queries.iter().zip(answers) {
                let [b1, b2] = query.weights.map(f64::from);
                let uv: [f64; 2] = std::array::from_fn(|axis| {
                    let at = |corner: usize| f64::from(corners[corner][axis]);
                    (1.0 - b1 - b2) * at(0) + b1 * at(1) + b2 * at(2)
                });
                let m = transform.map(f64::from);
                let at = [0, 3].map(|row| m[row] * uv[0] + m[row + 1] * uv[1] + m[row + 2]);
                let near_edge = |t: f64| (t - t.round()).abs() < 1e-4;
                if filter == Filter::Nearest && (near_edge(at[0] * 7.0) || near_edge(at[1] * 5.0)) {
                    continue;
                }
                compared += 1;
                let texel = sample_image(&scene, 1, at, true);
                for (channel, factor) in [0.5, 1.0, 0.25].into_iter().enumerate() {
                    let due = factor * texel[channel];
                    // Coordinates of up to 30 texels carry 30 x 2^-22; one texel changes the colour by at most 1.
                    let error = (f64::from(answer.albedo[channel]) - due).abs();
                    let what = format!("{filter:?} {wrap_u:?} {wrap_v:?} at {at:?}");
                    assert!(error < 2e-5, "{what}: {answer:?}, {due} is due");
                }
            }
            assert!(compared > 990);
        }
    }
}

#[test]
fn vertex_colours_multiply_and_features_that_are_off_do_not() {
    let context = context();
    let mut scene = Scene::default();
    triangle_of(&mut scene, Material::lambert("painted", [0.8, 0.6, 0.4]));
    scene.meshes[0].colors = vec![
        [1.0, 0.0, 0.0, 1.0],
        [0.0, 1.0, 0.0, 1.0],
        [0.0, 0.0, 1.0, 1.0],
    ];
    let queries = [query([0.25, 0.125])];
    let painted = load(&context, &["vertex_colors"], &scene, &queries)[0].albedo;
    for (albedo, due) in painted.iter().zip([0.8 * 0.625, 0.6 * 0.25, 0.4 * 0.125]) {
        // unorm16 is exact at 0 and 1.
        assert!((f64::from(*albedo) - due).abs() < 1e-6, "{painted:?}");
    }
    let plain = load(&context, &[], &scene, &queries)[0].albedo;
    assert_eq!(plain, [0.8, 0.6, 0.4]);
}

/// Placement with shear and different scales.
fn placement(mirrored: bool) -> DAffine3 {
    let turn = DMat3::from_rotation_y(0.7) * DMat3::from_rotation_x(-0.4);
    let shape = DMat3::from_cols(
        DVec3::new(if mirrored { -2.0 } else { 2.0 }, 0.0, 0.0),
        DVec3::new(0.3, 1.0, 0.0),
        DVec3::new(0.0, 0.2, 0.5),
    );
    DAffine3 {
        matrix3: turn * shape,
        translation: DVec3::new(1.0, 2.0, 3.0),
    }
}

#[test]
fn normals_and_normal_maps_survive_placement_and_mirroring() {
    let context = context();
    for mirrored in [false, true] {
        for sign in [1.0f32, -1.0] {
            let place = placement(mirrored);
            // x 0.6, y 0.2, z 0.803... before scaling.
            let mut scene = solid_scene([204, 153, 230, 255]);
            let material = Material {
                normal_texture: texture_ref(0),
                normal_scale: 0.5,
                ..Material::lambert("bumpy", [0.5; 3])
            };
            add_triangles(&mut scene, &[triangle()], material, place);
            let normal = DVec3::new(0.1, 0.2, 0.97).normalize();
            scene.meshes[0].normals = vec![normal.as_vec3().to_array(); 3];
            let tangent = (DVec3::X - normal * normal.x).normalize();
            scene.meshes[0].tangents = vec![tangent.as_vec3().extend(sign).to_array(); 3];

            // Outside is where the winding says, which mirroring turns over with the triangle: the inverse transpose.
            let cofactor = place.matrix3.inverse().transpose();
            let outward = (cofactor * DVec3::Z).normalize();
            let carried = (cofactor * normal).normalize();
            let along = place.matrix3 * tangent;
            let along = (along - carried * carried.dot(along)).normalize();
            // The bitangent of the object, carried over and made perpendicular: its side is what the sign decides.
            let across = place.matrix3 * (normal.cross(tangent) * f64::from(sign));
            let side = carried.cross(along).dot(across).signum();
            let across = carried.cross(along) * side;
            let texel = [204.0, 153.0, 230.0].map(|byte: f64| byte / 255.0 * 2.0 - 1.0);
            let mapped =
                (along * (0.5 * texel[0]) + across * (0.5 * texel[1]) + carried * texel[2])
                    .normalize();

            for face in [1.0, -1.0] {
                let from = Query {
                    ray_direction: (-face * outward).as_vec3().to_array(),
                    ..query([0.2, 0.3])
                };
                let plain = load(&context, &[], &scene, &[from])[0];
                let bumpy = load(&context, &["textures", "normal_maps"], &scene, &[from])[0];
                let near = |a: [f32; 3], b: DVec3| (wide(a) - b).length() < 1e-5;
                assert_eq!(plain.front_face == 1, face > 0.0);
                for (found, due) in [
                    (plain.geometric_normal, outward),
                    (plain.shading_normal, carried),
                    (bumpy.shading_normal, mapped),
                ] {
                    let what = format!("mirrored {mirrored}, w {sign}, face {face}");
                    assert!(near(found, face * due), "{what}: {found:?}, {due} is due");
                }
            }
        }
    }
}

#[test]
fn normals_that_contradict_the_winding_are_turned_and_broken_ones_replaced() {
    let context = context();
    for normal in [[0.0f32, 0.0, -1.0], [0.0; 3], [f32::NAN; 3]] {
        let mut scene = Scene::default();
        triangle_of(&mut scene, Material::lambert("flat", [0.5; 3]));
        scene.meshes[0].normals = vec![normal; 3];
        let answer = load(&context, &[], &scene, &[query([0.3, 0.3])])[0];
        assert_eq!(answer.shading_normal, [0.0, 0.0, 1.0], "{normal:?}");
    }
}

#[test]
fn emission_shows_on_the_front_or_on_both_sides_times_its_texture() {
    let context = context();
    for double_sided in [false, true] {
        let mut scene = solid_scene([255, 188, 0, 255]);
        let material = Material {
            emissive_texture: texture_ref(0),
            double_sided,
            ..glowing([3.0, 2.0, 1.0])
        };
        triangle_of(&mut scene, material);
        let front = query([0.3, 0.3]);
        let back = Query {
            ray_direction: [0.0, 0.0, 1.0],
            ..front
        };
        let answers = load(&context, &ALL, &scene, &[front, back]);
        // 188 / 255 is 0.50289 in linear light.
        let due = [3.0, 2.0 * 0.502_886_458, 0.0];
        let near =
            |emission: [f32; 3]| (0..3).all(|c| (f64::from(emission[c]) - due[c]).abs() < 1e-5);
        assert!(near(answers[0].emission), "{:?}", answers[0]);
        let back = answers[1].emission;
        let is_due = [back == [0.0; 3], near(back)][usize::from(double_sided)];
        assert!(is_due, "double sided {double_sided}: {back:?}");
    }
}

#[test]
fn blend_passes_by_chance_and_mask_by_threshold() {
    let context = context();
    let mut scene = solid_scene([255, 255, 255, 128]);
    let material = |alpha: f32, mode| Material {
        base_color: [1.0, 1.0, 1.0, alpha],
        base_color_texture: texture_ref(0),
        alpha_mode: mode,
        ..Material::lambert("veil", [1.0; 3])
    };
    let cutoff = AlphaMode::Mask { cutoff: 0.4 };
    for (alpha, mode) in [
        (0.6, AlphaMode::Blend),
        (1.0, AlphaMode::Opaque),
        (0.9, cutoff),
        (0.7, cutoff),
    ] {
        triangle_of(&mut scene, material(alpha, mode));
    }
    let count = 100_000u32;
    let mut counts = [0u32; 4];
    let queries: Vec<Query> = (0..count)
        .map(|index| Query {
            instance: index % 4,
            triangle: index % 4,
            key: index / 4,
            ..query([0.3, 0.3])
        })
        .collect();
    let answers = load(&context, &ALL, &scene, &queries);
    for (query, answer) in queries.iter().zip(&answers) {
        counts[query.instance as usize] += answer.passes;
    }
    let each = f64::from(count / 4);
    let chance = 1.0 - 0.6 * 128.0 / 255.0;
    let error = (chance * (1.0 - chance) / each).sqrt();
    let share = f64::from(counts[0]) / each;
    assert!(
        (share - chance).abs() < 4.0 * error,
        "{share}, {chance} due"
    );
    // 0.9 x 128 / 255 is above the cutoff of 0.4, 0.7 x 128 / 255 below it.
    assert_eq!(counts[1..], [0, 0, count / 4]);
    // The same ray gets the same answer however often it asks.
    let mut elsewhere = queries.clone();
    for query in &mut elsewhere {
        (query.instance, query.triangle) = (0, 0);
    }
    let again = load(&context, &ALL, &scene, &elsewhere);
    let is_one = |asked: &[Answer]| asked.iter().all(|a| a.passes == asked[0].passes);
    assert!(again.chunks(4).all(is_one));
}

#[test]
fn absorption_follows_beers_law() {
    let context = context();
    let mut scene = Scene::default();
    let material = Material {
        transmission: 1.0,
        attenuation_distance_m: 1.0,
        attenuation_color: [0.5, 1.0, 0.1],
        ..Material::lambert("glass", [1.0; 3])
    };
    triangle_of(&mut scene, material);
    let left = load(&context, &ALL, &scene, &[query([0.3, 0.3])])[0].attenuation;
    for (left, due) in left.iter().zip([0.25, 1.0, 0.01]) {
        let off = (f64::from(*left) / due - 1.0).abs();
        assert!(off < 1e-5, "{left} of {due}");
    }
}
