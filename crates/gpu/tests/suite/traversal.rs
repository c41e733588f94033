//! The shaders' traversal: nearest hits against exhaustive search in f64, watertight, free of self-intersection.

use glam::{DAffine3, DVec3, Vec3};
use stereolux_gpu::{GpuContext, ShaderLibrary};
use stereolux_scene::{Mesh, MeshTriangle};

use crate::adapter::context;
use crate::bvh_reference::{Arrays, Ray, trace};
use crate::trace_probe::*;

const MILLION: usize = 1_000_000;

/// A mesh by itself.
fn alone(context: &GpuContext, mesh: &Mesh, at: DAffine3) -> TraceScene {
    TraceScene::new(context, std::slice::from_ref(mesh), &[(at, 0)], DVec3::ZERO)
}

/// How many rays meet anything.
fn hits(answers: &[TraceAnswer]) -> usize {
    let hits = answers.iter().filter(|answer| answer.instance != MISS);
    hits.count()
}

fn random_scene(random: &mut Random) -> (Vec<Mesh>, Vec<(DAffine3, u32)>) {
    let needles: Vec<_> = (0..40)
        .map(|i| {
            let (a, along) = (random.vector(), random.vector());
            // Widths down to 1e-6 of the length, and every fifth without any area.
            let width = if i % 5 == 0 {
                0.0
            } else {
                10f64.powf(-6.0 * random.unit())
            };
            [a, a + along, a + 0.3 * along + width * random.vector()].map(|v| v.as_vec3())
        })
        .collect();
    let meshes = vec![
        soup(random, 200, 0.15),
        sphere(random, 12, 8, 0.1),
        mesh_of(&needles),
    ];
    let placed = (0..10)
        .map(|i| {
            let scale = match i % 4 {
                0 => DVec3::ONE,
                1 => DVec3::new(1.0, -1.0, 1.0),
                2 => DVec3::new(0.3, 2.0, 1.0),
                _ => DVec3::splat(4.0),
            };
            let at = 4.0 * random.vector();
            (
                DAffine3::from_scale_rotation_translation(scale, random.rotation(), at),
                i % 3,
            )
        })
        .collect();
    (meshes, placed)
}

#[test]
fn nearest_hits_equal_exhaustive_search() {
    let context = context();
    let probe = TraceProbe::new(&context, &ShaderLibrary::embedded(), &["probe_occlusion"]);
    let mut random = Random(21);
    let (meshes, mut placed) = random_scene(&mut random);
    let queries: Vec<_> = (0..6000)
        .map(|i| {
            let mut direction = random.direction();
            if i % 10 == 0 {
                direction[random.below(3)] = 0.0;
            }
            let length = 10f64.powf(2.0 * random.signed());
            TraceQuery::ray(
                (4.0 * random.vector()).as_vec3(),
                (length * direction.normalize()).as_vec3(),
            )
        })
        .collect();
    for far in [0.0, 1e6] {
        let origin = far * DVec3::new(1.0, -2.0, 0.5);
        if far > 0.0 {
            for (transform, _) in &mut placed {
                transform.translation += origin;
            }
        }
        let scene = TraceScene::new(&context, &meshes, &placed, origin);
        let answers = probe.run(&scene, &queries);
        let disagreements = |moved| {
            let (exact, triangles) = (&scene.exact, &scene.meshes.triangles);
            disagreements(exact, triangles, &queries, &answers, moved)
        };
        let (wrong, hits) = disagreements(DVec3::ZERO);
        assert!(hits > 2000, "{hits} rays hit");
        assert_eq!(wrong, 0, "{far} m from the origin");
        // Negative control: the comparison notices rays that were moved by a tenth of a metre.
        let (wrong, _) = disagreements(DVec3::splat(0.1));
        assert!(wrong > 1000, "{wrong}");

        // The twin on the CPU: the same surface but for rays that graze a border, where contraction may differ.
        let arrays = Arrays {
            top_nodes: scene.top.nodes(),
            mesh_nodes: &scene.meshes.nodes,
            instances: scene.top.instances(),
            triangles: &scene.meshes.triangles,
        };
        let differing = queries
            .iter()
            .zip(&answers)
            .filter(|(query, answer)| {
                let ray = Ray {
                    origin: query.origin.into(),
                    t_max: query.t_max,
                    direction: query.direction.into(),
                };
                let twin = trace(&arrays, &ray, false)
                    .map_or((MISS, MISS), |hit| (hit.instance, hit.triangle));
                let is_miss = answer.instance == MISS;
                let triangle = if is_miss { MISS } else { answer.triangle };
                twin != (answer.instance, triangle)
            })
            .count();
        assert!(differing <= 6, "{differing} of 6000 rays");
    }
}

#[test]
fn empty_scenes_miss() {
    let context = context();
    let probe = TraceProbe::new(&context, &ShaderLibrary::embedded(), &["probe_occlusion"]);
    let queries = [
        TraceQuery::ray(Vec3::ZERO, Vec3::X),
        TraceQuery::ray(Vec3::ONE, Vec3::new(0.0, -1.0, 0.0)),
    ];
    for placed in [vec![], vec![(DAffine3::IDENTITY, 0)]] {
        let scene = TraceScene::new(&context, &[Mesh::default()], &placed, DVec3::ZERO);
        for answer in probe.run(&scene, &queries) {
            assert_eq!((answer.instance, answer.is_occluded), (MISS, 0));
        }
    }
}

#[test]
fn coincident_surfaces_have_one_answer() {
    let context = context();
    let library = ShaderLibrary::embedded();
    let probe = TraceProbe::new(&context, &library, &[]);
    let mut random = Random(22);
    let ball = sphere(&mut random, 16, 12, 0.0);
    // Every triangle five times, in 20 instances at one place, between others that shape the tree: none of those comes as
    // near to the middle as the ball around it, whose vertices are 1 m away.
    let repeated = Mesh {
        triangles: (0..5).flat_map(|_| ball.triangles.clone()).collect(),
        ..ball
    };
    let middle = DVec3::new(0.1, 0.2, 3.0);
    let here = DAffine3::from_rotation_translation(random.rotation(), middle);
    let mut placed = vec![(here, 0); 20];
    placed.extend((0..10).map(|_| {
        let away = (2.1 + 7.0 * random.unit()) * random.direction();
        (DAffine3::from_translation(middle + away), 0)
    }));
    let scene = TraceScene::new(&context, &[repeated], &placed, DVec3::ZERO);
    let queries: Vec<_> = (0..20_000)
        .map(|_| TraceQuery::ray(middle.as_vec3(), random.direction().as_vec3()))
        .collect();
    let triangles = &scene.meshes.triangles;
    let corners = |i: u32| {
        let triangle = &triangles[i as usize];
        (triangle.v0, triangle.v1, triangle.v2)
    };
    // Rays that meet another instance than the first, or none, and those that meet another than the lowest of equal triangles.
    let strays = |probe: &TraceProbe<'_>| {
        let (mut instances, mut beside_first) = (0, 0);
        for answer in probe.run(&scene, &queries) {
            instances += usize::from(answer.instance != 0);
            let same = |i: &u32| corners(*i) == corners(answer.triangle);
            let is_hit = answer.instance != MISS;
            let first = (0..triangles.len() as u32).find(|i| is_hit && same(i));
            beside_first += usize::from(first != Some(answer.triangle));
        }
        (instances, beside_first)
    };
    // All of them meet the closed ball.
    assert_eq!(strays(&probe), (0, 0));
    // Negative control: whatever comes last wins.
    let equal = "!(crossing.t == (*hit).t";
    let last = weakened(&library, equal, "!(false && crossing.t == (*hit).t");
    let (instances, beside_first) = strays(&TraceProbe::new(&context, &last, &[]));
    assert!(
        instances > 10_000 && beside_first > 10_000,
        "{instances} {beside_first}"
    );
}

#[test]
fn perturbed_sphere_is_watertight() {
    let context = context();
    let probe = TraceProbe::new(&context, &ShaderLibrary::embedded(), &[]);
    let mut random = Random(23);
    let ball = sphere(&mut random, 96, 64, 0.01);
    let transforms = [
        DAffine3::from_scale_rotation_translation(
            DVec3::new(2.0, -0.7, 1.3),
            random.rotation(),
            DVec3::new(0.3, -0.1, 0.2),
        ),
        DAffine3::from_scale_rotation_translation(
            DVec3::splat(1e3),
            random.rotation(),
            DVec3::splat(50.0),
        ),
    ];
    for transform in transforms {
        let mut open = ball.clone();
        let queries: Vec<_> = (0..MILLION / transforms.len())
            .map(|i| {
                let vertices = ball.triangles[random.below(ball.triangles.len())].vertices;
                let [a, b, _] = vertices.map(|v| Vec3::from(ball.positions[v as usize]).as_dvec3());
                // A vertex, or a point on an edge.
                let along = if i % 2 == 0 { 0.0 } else { random.unit() };
                let target = transform.transform_point3(a + along * (b - a)).as_vec3();
                // Inside: the corners of this cube lie at 0.69 of a radius that varies by 1 %.
                let origin = transform.transform_point3(0.4 * random.vector()).as_vec3();
                TraceQuery::ray(origin, target - origin)
            })
            .collect();
        let scene = alone(&context, &ball, transform);
        assert_eq!(hits(&probe.run(&scene, &queries)), queries.len());

        // Negative control: one triangle less, and rays get out.
        open.triangles.swap_remove(1000);
        let scene = alone(&context, &open, transform);
        assert!(hits(&probe.run(&scene, &queries)) < queries.len());
    }
}

#[test]
fn needles_leave_no_gaps() {
    // A square cut into strips of random width down to 1e-6 m, each of two triangles, seen from 3 to 100 m.
    let context = context();
    let probe = TraceProbe::new(&context, &ShaderLibrary::embedded(), &[]);
    let mut random = Random(24);
    let mut cuts: Vec<f64> = (0..300).map(|_| random.unit()).collect();
    let near: Vec<f64> = cuts
        .iter()
        .map(|x| x + 1e-6 * (1.0 + random.unit()))
        .collect();
    cuts.extend(near);
    cuts.extend([0.0, 1.1]);
    cuts.sort_by(f64::total_cmp);
    let positions: Vec<_> = cuts
        .iter()
        .flat_map(|&x| [[x as f32, 0.0, 0.0], [x as f32, 1.0, 0.0]])
        .collect();
    let triangles: Vec<_> = (0..cuts.len() as u32 - 1)
        .flat_map(|i| {
            [
                [2 * i, 2 * i + 2, 2 * i + 1],
                [2 * i + 2, 2 * i + 3, 2 * i + 1],
            ]
        })
        .map(|vertices| MeshTriangle {
            vertices,
            material: 0,
        })
        .collect();
    let mesh = Mesh {
        positions,
        triangles,
        ..Mesh::default()
    };
    let transform =
        DAffine3::from_rotation_translation(random.rotation(), DVec3::new(0.5, -0.5, 0.25));
    let scene = alone(&context, &mesh, transform);
    let queries: Vec<_> = (0..200_000)
        .map(|i| {
            let x = if i % 2 == 0 {
                cuts[1 + random.below(cuts.len() - 2)].clamp(0.01, 1.09)
            } else {
                0.01 + random.unit()
            };
            let target =
                transform.transform_point3(DVec3::new(x, 0.01 + 0.98 * random.unit(), 0.0));
            let height = 3.0 + 97.0 * random.unit().powi(3);
            let side = if random.unit() < 0.5 { height } else { -height };
            let from = transform
                .transform_point3(DVec3::new(
                    2.0 * random.signed(),
                    2.0 * random.signed(),
                    side,
                ))
                .as_vec3();
            TraceQuery::ray(from, target.as_vec3() - from)
        })
        .collect();
    assert_eq!(hits(&probe.run(&scene, &queries)), queries.len());
}

/// Leaves surface points and counts rays that meet the very triangle they left, and points farther from its plane than
/// their bound says.
fn leave(scene: &TraceScene, probe: &TraceProbe<'_>, queries: &[TraceQuery]) -> (usize, usize) {
    let (mut self_hits, mut beyond) = (0, 0);
    for (query, answer) in queries.iter().zip(probe.run(scene, queries)) {
        self_hits +=
            usize::from((answer.instance, answer.triangle) == (query.instance, query.triangle));
        let [a, b, c] = scene.corners(query.instance, query.triangle);
        let normal = (b - a).cross(c - a).normalize();
        let distance = normal.dot(Vec3::from(answer.position).as_dvec3() - a).abs();
        // f64's own rounding in these sums is 1e-9 of f32's.
        let bound = 1.000_001 * normal.abs().dot(Vec3::from(answer.error).as_dvec3());
        let is_finite = answer
            .position
            .iter()
            .chain(&answer.normal)
            .all(|x| x.is_finite());
        beyond += usize::from(!is_finite || (normal.is_finite() && distance > bound));
    }
    (self_hits, beyond)
}

/// The traversal with something exchanged.
fn weakened(library: &ShaderLibrary, from: &str, to: &str) -> ShaderLibrary {
    let source = include_str!("../../../../shaders/shared/traversal.wesl");
    let weakened = source.replace(from, to);
    assert_ne!(weakened, source);
    let mut library = library.clone();
    library.insert("shared/traversal", weakened);
    library
}

/// The traversal with its bound on t's error switched off.
fn without_rejection(library: &ShaderLibrary) -> ShaderLibrary {
    weakened(library, "if t <= t_error {", "if t <= 0.0 {")
}

/// Triangles whose coordinates have magnitudes from 1e-8 to 1e8, each its own mesh.
fn extreme_triangles(random: &mut Random, count: usize) -> Vec<Mesh> {
    let mut meshes = Vec::new();
    while meshes.len() < count {
        let [a, b, c] =
            [(); 3].map(|()| {
                Vec3::from([(); 3].map(|()| {
                    (random.signed().signum() * 10f64.powf(8.0 * random.signed())) as f32
                }))
            });
        // pbrt's test leaves out what has no area to speak of; f32 knows no normal there.
        let (ab, ac) = ((b - a).as_dvec3(), (c - a).as_dvec3());
        if ab.cross(ac).length_squared() > 1e-20 {
            meshes.push(mesh_of(&[[a, b, c]]));
        }
    }
    meshes
}

fn departures(random: &mut Random, scene: &TraceScene, count: usize) -> Vec<TraceQuery> {
    (0..count)
        .map(|_| {
            let instance = random.below(scene.exact.len());
            let triangles = scene.exact[instance].1.clone();
            TraceQuery {
                t_max: 1e30,
                direction: random.direction().as_vec3().to_array(),
                instance: instance as u32,
                triangle: triangles.start + random.below(triangles.len()) as u32,
                weights: random.weights(),
                ..TraceQuery::default()
            }
        })
        .collect()
}

#[test]
fn no_ray_meets_the_triangle_it_leaves() {
    let context = context();
    let library = ShaderLibrary::embedded();
    let probe = TraceProbe::new(&context, &library, &["probe_respawn"]);
    let unguarded = TraceProbe::new(
        &context,
        &without_rejection(&library),
        &["probe_respawn", "probe_no_offset"],
    );
    let mut random = Random(25);

    // Extreme triangles as they are, in scenes of 20 (each crosses most others), then ordinary ones placed up to 1e6 m
    // away with all kinds of scale.
    let mut scenes: Vec<(&str, Vec<Mesh>, Vec<(DAffine3, u32)>, usize)> = (0..50)
        .map(|_| {
            let placed = (0..20).map(|mesh| (DAffine3::IDENTITY, mesh)).collect();
            (
                "extreme",
                extreme_triangles(&mut random, 20),
                placed,
                MILLION / 50,
            )
        })
        .collect();
    let ordinary = vec![
        soup(&mut random, 500, 0.3),
        sphere(&mut random, 32, 24, 0.05),
    ];
    let far = (0..60)
        .map(|i| {
            let scale = 10f64.powf(2.0 * random.signed());
            let scale = DVec3::new(scale, scale, if i % 3 == 0 { -3.0 * scale } else { scale });
            let at = 10f64.powf(6.0 * random.unit()) * random.direction();
            (
                DAffine3::from_scale_rotation_translation(scale, random.rotation(), at),
                i % 2,
            )
        })
        .collect();
    scenes.push(("far", ordinary, far, MILLION));
    for (name, meshes, placed, count) in scenes {
        let scene = TraceScene::new(&context, &meshes, &placed, DVec3::ZERO);
        let queries = departures(&mut random, &scene, count);
        let (self_hits, beyond) = leave(&scene, &probe, &queries);
        assert_eq!(beyond, 0, "{name}: points outside their error bounds");
        assert_eq!(self_hits, 0, "{name}: self-intersections");
        // Negative control: without offset and rejection the same rays do meet it.
        let (self_hits, _) = leave(&scene, &unguarded, &queries[..count / 10]);
        assert!(self_hits > count / 100, "{name}: {self_hits}");
    }
}

#[test]
fn flat_and_convex_surfaces_do_not_shadow_themselves() {
    // Neighbours in one plane, two layers of it that coincide, rotated, at several distances; and a closed sphere left
    // outward. Any hit at all is false, down to 89.99 degrees from the normal.
    let context = context();
    let library = ShaderLibrary::embedded();
    let probe = TraceProbe::new(&context, &library, &["probe_respawn"]);
    let offset_alone = TraceProbe::new(&context, &without_rejection(&library), &["probe_respawn"]);
    let unguarded = TraceProbe::new(
        &context,
        &without_rejection(&library),
        &["probe_respawn", "probe_no_offset"],
    );
    let mut random = Random(26);
    let mut triangles = Vec::new();
    for i in 0..12 {
        for j in 0..12 {
            let at = |x: i32, z: i32| Vec3::new(x as f32 - 6.0, 0.0, z as f32 - 6.0);
            triangles.push([at(i, j), at(i, j + 1), at(i + 1, j)]);
            triangles.push([at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)]);
        }
    }
    let plane = mesh_of(&triangles);
    let ball = sphere(&mut random, 32, 24, 0.0);
    for distance in [0.0, 10.0, 1e3, 1e6] {
        for (is_plane, mesh) in [(true, &plane), (false, &ball)] {
            let transform = DAffine3::from_rotation_translation(
                random.rotation(),
                distance * random.direction(),
            );
            let copies = if is_plane { 2 } else { 1 };
            let scene = TraceScene::new(
                &context,
                std::slice::from_ref(mesh),
                &vec![(transform, 0); copies],
                DVec3::ZERO,
            );
            let mut queries = departures(&mut random, &scene, 50_000);
            for (i, query) in queries.iter_mut().enumerate() {
                let [a, b, c] = scene.corners(query.instance, query.triangle);
                let normal = (b - a).cross(c - a).normalize();
                let mut direction = random.direction();
                if i % 2 == 0 {
                    let tangent = direction.cross(normal).normalize();
                    let angle = 89.99f64.to_radians();
                    direction = angle.cos() * normal + angle.sin() * tangent;
                }
                let is_outward = direction.dot(normal) > 0.0;
                query.direction = (if is_outward { direction } else { -direction })
                    .as_vec3()
                    .to_array();
            }
            let answers = probe.run(&scene, &queries);
            let place = format!("plane {is_plane}, {distance} m away");
            assert_eq!(hits(&answers), 0, "{place}");
            // The normal is the outward one.
            let inward = queries
                .iter()
                .zip(&answers)
                .filter(|(query, answer)| {
                    Vec3::from(query.direction).dot(answer.normal.into()) <= 0.0
                })
                .count();
            assert_eq!(inward, 0);
            // The offset does it without the other guard; without both there are hits.
            let by_offset = hits(&offset_alone.run(&scene, &queries));
            assert_eq!(by_offset, 0, "{place}, offset alone");
            assert!(hits(&unguarded.run(&scene, &queries)) > 1000, "{place}");
        }
    }
}

#[test]
fn normals_of_mirrored_instances_point_outward() {
    let context = context();
    let probe = TraceProbe::new(&context, &ShaderLibrary::embedded(), &["probe_respawn"]);
    let mut random = Random(27);
    let ball = sphere(&mut random, 24, 16, 0.0);
    for scale in [
        DVec3::ONE,
        DVec3::new(-1.0, 1.0, 1.0),
        DVec3::new(-2.0, -0.5, -3.0),
        DVec3::new(-1.0, -1.0, 4.0),
    ] {
        let center = DVec3::new(5.0, 6.0, 7.0);
        let transform = DAffine3::from_scale_rotation_translation(scale, random.rotation(), center);
        let scene = alone(&context, &ball, transform);
        let queries = departures(&mut random, &scene, 2000);
        for (query, answer) in queries.iter().zip(probe.run(&scene, &queries)) {
            let [a, b, c] = scene.corners(query.instance, query.triangle);
            let normal = (b - a).cross(c - a).normalize() * scale.element_product().signum();
            let found = Vec3::from(answer.normal).as_dvec3();
            // Thin triangles at the poles lose two digits.
            assert!(
                found.dot(normal) > 1.0 - 1e-5,
                "{scale}: {found} for {normal}"
            );
            assert!((found.length() - 1.0).abs() < 1e-6);
            assert!(found.dot((a + b + c) / 3.0 - center) > 0.0, "outward");
        }
    }
}

#[test]
fn grazing_rays_meet_the_floor_where_they_should() {
    // 200 m of floor in two triangles, seen at 89.99 degrees from heights of 1 to 15 mm.
    let context = context();
    let probe = TraceProbe::new(&context, &ShaderLibrary::embedded(), &[]);
    let [a, b, c, d] = [
        (-100.0, -100.0),
        (-100.0, 100.0),
        (100.0, 100.0),
        (100.0, -100.0),
    ]
    .map(|(x, z)| Vec3::new(x, 0.0, z));
    let floor = mesh_of(&[[a, b, c], [a, c, d]]);
    let scene = alone(&context, &floor, DAffine3::from_translation(DVec3::NEG_Y));
    let mut random = Random(28);
    let angle = 89.99f64.to_radians();
    let (queries, expected): (Vec<_>, Vec<_>) = (0..10_000)
        .map(|_| {
            let turn = 6.3 * random.unit();
            let direction = DVec3::new(
                angle.sin() * turn.cos(),
                -angle.cos(),
                angle.sin() * turn.sin(),
            )
            .as_vec3();
            let origin = Vec3::new(0.1, -1.0 + (0.001 + 0.014 * random.unit()) as f32, 0.2);
            let t = f64::from(origin.y + 1.0) / -f64::from(direction.y);
            (TraceQuery::ray(origin, direction), t)
        })
        .unzip();
    for (answer, t) in probe.run(&scene, &queries).iter().zip(expected) {
        assert_eq!(answer.instance, 0, "a ray at {t} m got through");
        // In rounding units. The sheared corners' x plays no part in where the plane is met, and their heights over the ray,
        // h + slope z with z up to 100 m, are off by 8 slope 100 m: 800 m along the ray. Edges' areas are differences of
        // products of up to 200 m by 0.04 m, so three of them are off by 3 x 4 x 8 m2; they weigh corners that lie up to
        // 200 m apart, and their sum is 40,000 m2 times the sine of 0.01 degrees, 7 m2: 2750 m. Over the direction's largest
        // part, 0.7 or more: 5100 m. And t is itself a quotient of sums: 10 of its own.
        let bound = (5100.0 + 10.0 * t) / 16_777_216.0;
        let error = (f64::from(answer.t) - t).abs();
        assert!(error < bound, "{} for {t}, beyond {bound}", answer.t);
    }
}
