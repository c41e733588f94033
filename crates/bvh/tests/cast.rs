//! Rays on the host: against a search over every triangle, shapes known in closed form, and shared edges.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use glam::{DAffine3, DVec3, Vec3};
use stereolux_bvh::cast::{Ray, cast_at_all};
use stereolux_bvh::{InstanceSource, MeshHierarchies, MeshTriangle};

use shared::mesh::{Mesh, placed, soup};
use shared::reference::{brute_force, exact_instances};
use shared::shapes::Random;

/// What the other tests use too.
#[allow(dead_code, reason = "each user takes a part")]
mod shared {
    pub mod mesh;
    pub mod reference;
    pub mod shapes;
}

impl Mesh {
    fn new(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Self {
        let triangle = |vertices| MeshTriangle {
            vertices,
            material: 0,
        };
        Self {
            positions: positions.iter().map(Vec3::to_array).collect(),
            triangles: triangles.into_iter().map(triangle).collect(),
        }
    }

    /// From -1 to 1 along each axis, fronts outside.
    fn cube() -> Self {
        let corner = |i: u32| Vec3::from([0, 1, 2].map(|axis| (i >> axis & 1) as f32 * 2.0 - 1.0));
        let sides = [
            [0, 4, 6, 2],
            [1, 3, 7, 5],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 2, 3, 1],
            [4, 5, 7, 6],
        ];
        let halves = sides
            .iter()
            .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
        Self::new((0..8).map(corner).collect(), halves.collect())
    }

    fn corners(&self) -> impl Iterator<Item = [DVec3; 3]> {
        let corner = |vertex: u32| Vec3::from(self.positions[vertex as usize]).as_dvec3();
        self.triangles.iter().map(move |t| t.vertices.map(corner))
    }
}

fn ray(origin: DVec3, direction: DVec3) -> Ray {
    Ray {
        origin,
        direction,
        t_max: f64::INFINITY,
    }
}

fn random_rays(random: &mut Random, count: usize, center: DVec3, spread: f64) -> Vec<Ray> {
    let ray = |_| ray(center + spread * random.vector(), random.direction());
    (0..count).map(ray).collect()
}

/// Rays that meet another triangle through the tree than by looking at all of them, down to the last bit; and how many hit.
fn lost(meshes: &MeshHierarchies, mesh: &Mesh, rays: &[Ray]) -> (usize, usize) {
    let hits = rays.iter().map(|ray| {
        let all = cast_at_all(mesh.corners(), ray);
        (meshes.cast(0, ray) != all, all.is_some())
    });
    hits.fold((0, 0), |(wrong, met), (is_wrong, is_met)| {
        (wrong + usize::from(is_wrong), met + usize::from(is_met))
    })
}

#[test]
fn the_tree_loses_nothing() {
    let mut random = Random(1);
    for (count, size, spread) in [
        (1, 0.8, 2.0),
        (4, 0.8, 2.0),
        (3000, 0.1, 1.2),
        (500, 0.5, 1e4),
    ] {
        let mesh = soup(&mut random, count, size);
        let mut meshes = MeshHierarchies::build(std::slice::from_ref(&mesh), &[]).unwrap();
        let mut rays = random_rays(&mut random, 2000, DVec3::ZERO, spread);
        // Far ones are aimed; some run along an axis, where slabs have no distance.
        for (at, ray) in rays.iter_mut().enumerate() {
            if spread > 10.0 {
                ray.direction = 0.5 * random.vector() - ray.origin;
            } else if at % 4 == 0 {
                ray.direction = DVec3::AXES[at / 4 % 3] * if at % 8 == 0 { 2.0 } else { -0.5 };
            }
            if at % 5 == 0 {
                ray.t_max = random.unit();
            }
        }
        let (wrong, met) = lost(&meshes, &mesh, &rays);
        assert_eq!(wrong, 0, "{count} triangles");
        if count < 1000 {
            continue;
        }
        assert!(met > 400, "only {met} rays meet anything");
        // Negative control: a tree that lost some children.
        for node in meshes.nodes.iter_mut().skip(3).step_by(7) {
            node.left_max = [-1e18; 3];
            node.left_min = [1e18; 3];
        }
        assert!(lost(&meshes, &mesh, &rays).0 > 10);
    }
}

/// Against code that shares no arithmetic: the triangle's plane, then areas in it, in world space.
#[test]
fn placed_meshes_are_met_where_they_are() {
    let mut random = Random(2);
    let meshes = [300, 40, 1].map(|count| soup(&mut random, count, 0.3));
    let trees = MeshHierarchies::build(&meshes, &[]).unwrap();
    // At 1e6 m, too: f64 has 1e-10 m there.
    for center in [DVec3::ZERO, DVec3::new(1e6, -2e6, 1e6)] {
        let scales = [
            DVec3::ONE,
            DVec3::new(-1.0, 1.0, 1.0),
            DVec3::new(0.3, 2.0, 1.0),
            DVec3::splat(5.0),
        ];
        let sources: Vec<InstanceSource> = (0..12)
            .map(|i| {
                let at = center + 4.0 * random.vector();
                let scale = scales[i % 4];
                let at = DAffine3::from_scale_rotation_translation(scale, random.rotation(), at);
                placed(at, i as u32 % 3)
            })
            .collect();
        let exact = exact_instances(&sources, &trees, center);
        let mut met = 0;
        for ray in random_rays(&mut random, 3000, center, 5.0) {
            let from = ray.origin - center;
            let all = brute_force(&exact, &trees.triangles, from, ray.direction, 1e-6);
            // Within 1e-6 of a border, in shares of the triangle, either answer is right.
            if all.iter().any(|hit| hit.inside < 1e-6) {
                continue;
            }
            let found = trees.cast_at(&sources, &ray, |_| true, |_| None);
            let Some(first) = all.first() else {
                assert_eq!(found, None);
                continue;
            };
            met += 1;
            let found = found.expect("the search meets something");
            let leaf = first.triangle;
            let (instance, triangle) = (first.instance as u32, trees.triangle_vertices[leaf][3]);
            assert_eq!((found.instance, found.hit.triangle), (instance, triangle));
            // Either side rounds some 30 times at the size of what it adds: coordinates of 10 m, and those of the world; a
            // plane seen at a slant stretches that by 1 / cos.
            let slant = found.normal_in_world.dot(ray.direction).abs();
            let size = 10.0 + center.abs().max_element();
            let bound = 60.0 * f64::EPSILON * size / slant;
            assert!(
                (found.hit.t - first.t).abs() <= bound,
                "{found:?} {first:?} {bound}"
            );
            // Weights and normal say the same point and plane.
            let mut corners = meshes[sources[instance as usize].mesh as usize].corners();
            let corners = corners.nth(triangle as usize).unwrap();
            let [a, b, c] =
                corners.map(|corner| exact[instance as usize].0.transform_point3(corner));
            let [u, v, w] = found.hit.weights;
            let point = u * a + v * b + w * c;
            let across = (b - a).cross(c - a).length() / (b - a).length().max((c - a).length());
            let off = point.distance(from + found.hit.t * ray.direction);
            assert!(off <= bound * (1.0 + 10.0 / across), "{off}");
            let normal = (b - a).cross(c - a).normalize();
            let front = if scales[instance as usize % 4].x < 0.0 {
                -normal
            } else {
                normal
            };
            assert!(found.normal_in_world.distance(front) < 1e-9 * (1.0 + 1.0 / across));
        }
        assert!(met > 600, "only {met} rays meet anything");
    }
}

#[test]
fn shapes_known_in_closed_form() {
    let cube = Mesh::cube();
    let trees = MeshHierarchies::build(std::slice::from_ref(&cube), &[]).unwrap();
    let at = DVec3::new(5.0, 0.0, -2.0);
    let sources = [placed(DAffine3::from_translation(at), 0)];
    let cast = |ray: Ray| trees.cast_at(&sources, &ray, |_| true, |_| None);
    let hit = cast(ray(DVec3::new(0.0, 0.25, -2.5), 2.0 * DVec3::X)).unwrap();
    // Halves and quarters: nothing is rounded.
    assert_eq!((hit.hit.t, hit.normal_in_world), (2.0, DVec3::NEG_X));
    // From inside the other side is met from behind.
    let hit = cast(ray(at, DVec3::X)).unwrap();
    assert_eq!((hit.hit.t, hit.normal_in_world), (1.0, DVec3::X));
    let near = |t_max| {
        cast(Ray {
            t_max,
            ..ray(DVec3::new(0.0, 0.25, -2.5), DVec3::X)
        })
    };
    assert!(near(4.0).is_some() && near(4.0f64.next_down()).is_none());
    assert_eq!(cast(ray(DVec3::ZERO, DVec3::NEG_X)), None);
    // A placement without extent is met by nothing.
    let flat = [placed(DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0)), 0)];
    let down = ray(DVec3::new(0.1, 3.0, 0.2), DVec3::NEG_Y);
    assert_eq!(trees.cast_at(&flat, &down, |_| true, |_| None), None);

    // A ball of n rings: its faces leave the sphere by 1 - cos of half a face's angle at most, which is below
    // (pi / n)^2 for the diagonal of a face.
    const RINGS: u32 = 64;
    let vertex = |i: u32| {
        let (ring, along) = (i / (2 * RINGS), i % (2 * RINGS));
        let (polar, turn) = [ring, along]
            .map(|k| f64::from(k) * std::f64::consts::PI / f64::from(RINGS))
            .into();
        DVec3::new(
            polar.sin() * turn.cos(),
            polar.cos(),
            polar.sin() * turn.sin(),
        )
        .as_vec3()
    };
    let quads = (0..RINGS).flat_map(|ring| (0..2 * RINGS).map(move |along| (ring, along)));
    let triangles = quads.flat_map(|(ring, along)| {
        let at = |ring: u32, along: u32| ring * 2 * RINGS + along % (2 * RINGS);
        let (a, b) = (at(ring, along), at(ring, along + 1));
        let (c, d) = (at(ring + 1, along), at(ring + 1, along + 1));
        [[a, b, c], [b, d, c]]
    });
    let count = (RINGS + 1) * 2 * RINGS;
    let ball = Mesh::new((0..count).map(vertex).collect(), triangles.collect());
    let trees = MeshHierarchies::build(std::slice::from_ref(&ball), &[]).unwrap();
    let mut random = Random(3);
    for _ in 0..1000 {
        let to = random.direction();
        let hit = trees
            .cast(0, &ray(3.0 * to, -to))
            .expect("the ball has no hole");
        let sag = (std::f64::consts::PI / f64::from(RINGS)).powi(2);
        assert!(hit.t >= 2.0 - 1e-6 && hit.t <= 2.0 + sag, "{hit:?}");
    }
}

/// Rays at corners and edges that triangles share, from many sides: each meets the surface.
#[test]
fn nothing_slips_through_shared_edges() {
    const SIDE: u32 = 16;
    let mut random = Random(4);
    // A hilly sheet, so that no two triangles lie in one plane.
    let at = |x: u32, y: u32| x + y * (SIDE + 1);
    let points: Vec<Vec3> = (0..=SIDE)
        .flat_map(|y| (0..=SIDE).map(move |x| (x, y)))
        .map(|(x, y)| {
            Vec3::new(
                x as f32 * 0.1,
                0.02 * random.signed() as f32,
                y as f32 * 0.1,
            )
        })
        .collect();
    let quads = (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| (x, y)));
    let triangles = quads.flat_map(|(x, y)| {
        let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1)];
        [[a, c, b], [b, c, d]]
    });
    let sheet = Mesh::new(points.clone(), triangles.collect());
    let trees = MeshHierarchies::build(std::slice::from_ref(&sheet), &[]).unwrap();
    let inner = || (1..SIDE).flat_map(|y| (1..SIDE).map(move |x| (x, y)));
    for (x, y) in inner() {
        let [here, right, slant] =
            [at(x, y), at(x + 1, y), at(x + 1, y - 1)].map(|i| points[i as usize].as_dvec3());
        for share in [0.0, 0.3, 0.5, 0.9] {
            for to in [here.lerp(right, share), here.lerp(slant, share)] {
                let from = to + DVec3::new(random.signed(), 1.0 + random.unit(), random.signed());
                let hit = trees.cast(0, &ray(from, to - from));
                // The sheet is met at 1 but for the roundings of the point aimed at, a few units in 2 m over its slope.
                assert!(
                    hit.is_some_and(|hit| (hit.t - 1.0).abs() < 1e-12),
                    "{hit:?}"
                );
            }
        }
    }
}
