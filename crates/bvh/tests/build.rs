//! Hierarchies as they are built: structure by `validate`, hits by exhaustive search.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::collections::BTreeSet;

use glam::{DAffine3, DMat3, DVec3, Vec3};
use stereolux_bvh::records::{INSTANCE_NUMBER_SHIFT, NO_EMITTER};
use stereolux_bvh::{
    BvhError, InstanceSource, MAX_INDEX, MaterialMarks, MeshHierarchies, TOP_STACK, TopLevel,
};

use shared::mesh::{Mesh, mesh_of, placed, soup};
use shared::reference::{Arrays, ExactInstance, Ray, brute_force, exact_instances, trace};
use shared::shapes::Random;

/// What the tests of the device use too.
#[allow(dead_code, reason = "each user takes a part")]
mod shared {
    pub mod mesh;
    pub mod reference;
    pub mod shapes;
}

/// A ray that reaches 1e9.
fn ray(origin: Vec3, direction: Vec3) -> Ray {
    Ray {
        origin,
        t_max: 1e9,
        direction,
    }
}

struct World {
    meshes: MeshHierarchies,
    top: TopLevel,
    exact: Vec<ExactInstance>,
}

impl World {
    fn new(meshes: &[Mesh], sources: &[InstanceSource], origin: DVec3) -> Self {
        let meshes = MeshHierarchies::build(meshes, &[]).unwrap();
        meshes.validate().unwrap();
        let top = TopLevel::build(origin, sources, &meshes).unwrap();
        top.validate().unwrap();
        let exact = exact_instances(sources, &meshes, origin);
        Self { meshes, top, exact }
    }

    /// A mesh as it lies.
    fn of(mesh: Mesh) -> Self {
        Self::new(&[mesh], &[placed(DAffine3::IDENTITY, 0)], DVec3::ZERO)
    }

    fn arrays(&self) -> Arrays<'_> {
        Arrays {
            top_nodes: self.top.nodes(),
            mesh_nodes: &self.meshes.nodes,
            instances: self.top.instances(),
            triangles: &self.meshes.triangles,
        }
    }

    /// Rays whose answer differs from the exhaustive search's beyond what rounding explains, of those that are clear
    /// of borders.
    fn disagreements(&self, rays: impl Iterator<Item = Ray>, t_tolerance: f64) -> (usize, usize) {
        let (mut wrong, mut hits) = (0, 0);
        for ray in rays {
            let found = trace(&self.arrays(), &ray, false);
            // Within 1e-4 of a border (in barycentric weight) either answer is right.
            let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
            let all = brute_force(&self.exact, &self.meshes.triangles, origin, direction, 1e-4);
            if all.iter().any(|hit| hit.inside < 1e-4) {
                continue;
            }
            hits += usize::from(!all.is_empty());
            let agrees = match (found, all.first()) {
                (None, None) => true,
                (Some(found), Some(first)) => {
                    // Surfaces closer together than the tolerance may trade places.
                    (f64::from(found.t) - first.t).abs() <= t_tolerance * (1.0 + first.t)
                        && all.iter().any(|hit| {
                            (hit.instance, hit.triangle)
                                == (found.instance as usize, found.triangle as usize)
                        })
                }
                _ => false,
            };
            let occluded = trace(&self.arrays(), &ray, true).is_some();
            wrong += usize::from(!agrees || occluded == all.is_empty());
        }
        (wrong, hits)
    }
}

fn random_rays(random: &mut Random, count: usize, spread: f64) -> Vec<Ray> {
    (0..count)
        .map(|_| Ray {
            origin: (spread * random.vector()).as_vec3(),
            t_max: f32::MAX,
            direction: random.direction().as_vec3(),
        })
        .collect()
}

#[test]
fn hits_equal_exhaustive_search() {
    let mut random = Random(1);
    let meshes = [
        soup(&mut random, 300, 0.1),
        soup(&mut random, 40, 0.5),
        soup(&mut random, 1, 0.8),
    ];
    let mut sources = Vec::new();
    for i in 0..12 {
        let scale = match i % 4 {
            0 => DVec3::ONE,
            1 => DVec3::new(-1.0, 1.0, 1.0),
            2 => DVec3::new(0.3, 2.0, 1.0),
            _ => DVec3::splat(5.0),
        };
        let transform = DAffine3::from_scale_rotation_translation(
            scale,
            random.rotation(),
            4.0 * random.vector(),
        );
        sources.push(placed(transform, i % 3));
    }
    let world = World::new(&meshes, &sources, DVec3::new(0.1, 0.2, 0.3));
    let rays = random_rays(&mut random, 4000, 5.0);
    // t is off by some tens of rounding units of coordinates up to 20 m.
    let (wrong, hits) = world.disagreements(rays.iter().copied(), 1e-4);
    assert!(hits > 800, "only {hits} rays hit anything");
    assert_eq!(wrong, 0);

    // Negative control: the comparison must notice a tree that lost a child.
    let mut broken = World::new(&meshes, &sources, DVec3::new(0.1, 0.2, 0.3));
    for node in broken.meshes.nodes.iter_mut().skip(3).step_by(7) {
        node.left_max = [-1e18; 3];
        node.left_min = [1e18; 3];
    }
    let (wrong, _) = broken.disagreements(rays.into_iter(), 1e-4);
    assert!(wrong > 10);
    assert!(broken.meshes.validate().is_err());
}

#[test]
fn world_far_from_origin_is_like_one_at_it() {
    let mut random = Random(2);
    let meshes = [soup(&mut random, 100, 0.2)];
    let far = DVec3::new(1e6, -2e6, 3e6);
    let near_sources: Vec<_> = (0..5)
        .map(|_| {
            // Multiples of 2^-10 stay exact beside 3e6.
            let at = (random.vector() * 2048.0).round() / 1024.0;
            let at = DAffine3::from_rotation_translation(random.rotation(), at);
            placed(at, 0)
        })
        .collect();
    let mut far_sources = near_sources.clone();
    for source in &mut far_sources {
        source.world_from_object.translation += far;
    }
    let near = World::new(&meshes, &near_sources, DVec3::ZERO);
    let there = World::new(&meshes, &far_sources, far);
    assert_eq!(near.top.instances(), there.top.instances());
    assert_eq!(near.top.nodes(), there.top.nodes());
}

#[test]
fn axis_aligned_rays_and_flat_meshes() {
    // A grid in the plane y = 0: flat boxes, and rays with two zero components of either sign through its vertices.
    let mut triangles = Vec::new();
    for i in 0..16 {
        for j in 0..16 {
            let at = |x: i32, z: i32| Vec3::new(x as f32, 0.0, z as f32);
            triangles.push([at(i, j), at(i, j + 1), at(i + 1, j)]);
            triangles.push([at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)]);
        }
    }
    let world = World::of(mesh_of(&triangles));
    for i in 0..=32 {
        for j in 0..=32 {
            let origin = Vec3::new(0.5 * i as f32, 3.0, 0.5 * j as f32);
            for zero in [0.0, -0.0, 1e-30] {
                if zero > 0.0 && (i == 32 || j == 32) {
                    // Truly beside the border.
                    continue;
                }
                let ray = ray(origin, Vec3::new(zero, -2.0, zero));
                assert_eq!(
                    trace(&world.arrays(), &ray, false).map(|hit| hit.t),
                    Some(1.5),
                    "{ray:?}"
                );
                let away = Ray {
                    direction: Vec3::new(zero, 2.0, zero),
                    ..ray
                };
                assert_eq!(trace(&world.arrays(), &away, false), None);
                let short = Ray { t_max: 1.5, ..ray };
                assert_eq!(
                    trace(&world.arrays(), &short, false),
                    None,
                    "t_max itself is out"
                );
            }
        }
    }
}

#[test]
fn degenerate_sets_build_and_never_hit_wrongly() {
    let p = Vec3::new(1.0, 2.0, 3.0);
    let unit = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let sets: Vec<(Mesh, bool)> = vec![
        (Mesh::default(), false),
        (mesh_of(&[unit]), true),
        (mesh_of(&[unit, unit]), true),
        (mesh_of(&vec![unit; 1000]), true),
        (mesh_of(&[[p, p, p]]), false),
        (
            mesh_of(&vec![[Vec3::ZERO, Vec3::X, Vec3::X * 2.0]; 50]),
            false,
        ),
        (mesh_of(&[unit, [p * 1e11, p * 1.1e11, p * -1e11]]), true),
        (mesh_of(&[unit.map(|v| v * 1e-12), unit]), true),
    ];
    for (index, (mesh, can_hit)) in sets.into_iter().enumerate() {
        let world = World::of(mesh);
        let ray = ray(Vec3::new(0.25, 0.25, 1.0), Vec3::NEG_Z);
        let hit = trace(&world.arrays(), &ray, false);
        assert_eq!(hit.is_some(), can_hit, "set {index}");
        if let Some(hit) = hit {
            assert_eq!((hit.t, hit.instance), (1.0, 0), "set {index}");
        }
    }
}

#[test]
fn many_triangles_of_one_size_build_in_time_and_hit() {
    const COUNT: usize = 200_000;
    let unit = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let strip: Vec<[Vec3; 3]> = (0..COUNT)
        .map(|at| unit.map(|corner| corner + Vec3::X * at as f32))
        .collect();
    for (triangles, last) in [(vec![unit; COUNT], 0), (strip, COUNT - 1)] {
        let began = std::time::Instant::now();
        let world = World::of(mesh_of(&triangles));
        // Clustering takes minutes over these.
        assert!(began.elapsed().as_secs() < 30, "{:?}", began.elapsed());
        world.meshes.validate().unwrap();
        let ray = ray(Vec3::new(last as f32 + 0.25, 0.25, 1.0), Vec3::NEG_Z);
        let hit = trace(&world.arrays(), &ray, false);
        assert_eq!(hit.map(|hit| hit.t), Some(1.0));
    }
}

#[test]
fn equal_distances_are_decided_by_index() {
    let unit = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let sources = [placed(DAffine3::IDENTITY, 0); 37];
    let world = World::new(&[mesh_of(&vec![unit; 100])], &sources, DVec3::ZERO);
    // The winner must not owe its place to the order of visits: the same from behind.
    for (height, direction) in [(1.0, Vec3::NEG_Z), (-1.0, Vec3::Z)] {
        let ray = ray(Vec3::new(0.2, 0.2, height), direction);
        let hit = trace(&world.arrays(), &ray, false).unwrap();
        assert_eq!((hit.instance, hit.triangle), (0, 0));
    }
}

#[test]
fn empty_scene_misses() {
    let world = World::new(&[], &[], DVec3::ZERO);
    let ray = Ray {
        t_max: 1e30,
        ..ray(Vec3::ZERO, Vec3::X)
    };
    assert_eq!(trace(&world.arrays(), &ray, false), None);
    let world = World::of(Mesh::default());
    assert_eq!(trace(&world.arrays(), &ray, true), None);
}

#[test]
fn instances_without_inverse_are_left_out() {
    let mesh = mesh_of(&[[Vec3::ZERO, Vec3::X, Vec3::Y]]);
    let flat = DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0));
    let nan = DAffine3::from_mat3(DMat3::from_diagonal(DVec3::splat(f64::NAN)));
    let sources = [
        placed(flat, 0),
        placed(DAffine3::IDENTITY, 0),
        placed(nan, 0),
    ];
    let world = World::new(&[mesh], &sources, DVec3::ZERO);
    let left_out = world.top.bounds().iter().filter(|b| b.is_empty());
    assert_eq!(left_out.count(), 2);
    let ray = ray(Vec3::new(0.2, 0.2, 1.0), Vec3::NEG_Z);
    let hit = trace(&world.arrays(), &ray, false);
    assert_eq!(hit.map(|hit| hit.instance), Some(1));
}

#[test]
fn bad_input_is_named() {
    let mut mesh = mesh_of(&[[Vec3::ZERO, Vec3::X, Vec3::Y]]);
    mesh.positions[1][2] = f32::NAN;
    assert!(matches!(
        MeshHierarchies::build(&[Mesh::default(), mesh.clone()], &[]),
        Err(BvhError::Coordinate {
            mesh: 1,
            vertex: 1,
            ..
        })
    ));
    mesh.positions[1][2] = 0.0;
    mesh.triangles[0].vertices[2] = 9;
    assert!(matches!(
        MeshHierarchies::build(&[mesh], &[]),
        Err(BvhError::VertexIndex {
            triangle: 0,
            index: 9,
            count: 3,
            ..
        })
    ));
    assert!(matches!(
        TopLevel::build(
            DVec3::ZERO,
            &[placed(DAffine3::IDENTITY, 0)],
            &MeshHierarchies::default()
        ),
        Err(BvhError::MeshIndex {
            instance: 0,
            mesh: 0,
            count: 0
        })
    ));
}

#[test]
fn arrays_of_several_meshes_refer_to_their_own() {
    let mut random = Random(3);
    let mut meshes = [
        soup(&mut random, 50, 0.2),
        Mesh::default(),
        soup(&mut random, 70, 0.2),
    ];
    for mesh in &mut meshes {
        for (triangle, material) in mesh.triangles.iter_mut().zip((0..3).cycle()) {
            triangle.material = material;
        }
    }
    let marks = [
        MaterialMarks::default(),
        MaterialMarks {
            emits: true,
            flags: 2,
        },
    ];
    let all = MeshHierarchies::build(&meshes, &marks).unwrap();
    all.validate().unwrap();
    assert_eq!(all.triangles.len(), 120);
    for (mesh, range) in meshes.iter().zip(&all.meshes) {
        let mut emitters = Vec::new();
        for i in range.first_triangle..range.first_triangle + range.triangle_count {
            let (triangle, [a, b, c, original]) =
                (all.triangles[i as usize], all.triangle_vertices[i as usize]);
            let source = mesh.triangles[original as usize];
            assert_eq!([a, b, c].map(|v| v - range.first_vertex), source.vertices);
            assert_eq!(triangle.v2, mesh.positions[source.vertices[2] as usize]);
            assert_eq!(triangle.material, source.material);
            assert_eq!(triangle.emitter != NO_EMITTER, source.material == 1);
            if triangle.emitter != NO_EMITTER {
                assert_eq!(triangle.flags, 2);
                emitters.push((original, triangle.emitter));
            }
        }
        // Ordinals follow the mesh's own order, without gaps.
        emitters.sort_unstable();
        assert_eq!(emitters.len() as u32, range.emitter_count);
        assert!(
            emitters
                .iter()
                .enumerate()
                .all(|(ordinal, &(_, emitter))| emitter == ordinal as u32)
        );
    }
}

#[test]
fn few_triangles_are_met_without_a_node_and_alike() {
    let mut random = Random(8);
    let counts = [1_u32, 4, 5, 12];
    let meshes: Vec<Mesh> = counts
        .iter()
        .map(|&count| soup(&mut random, count as usize, 0.8))
        .collect();
    let sources: Vec<_> = (0..4)
        .map(|i| placed(DAffine3::from_translation(random.vector()), i))
        .collect();
    let world = World::new(&meshes, &sources, DVec3::ZERO);
    for (range, count) in world.meshes.meshes.iter().zip(counts) {
        let begins_at_triangles = range.entry() >> MAX_INDEX.ilog2() == count;
        assert_eq!(begins_at_triangles, count <= 4, "{count} triangles");
    }
    let mut instances = world.top.instances().to_vec();
    for (instance, range) in instances.iter_mut().zip(&world.meshes.meshes) {
        instance.blas_root = range.root;
    }
    let by_nodes = Arrays {
        instances: &instances,
        ..world.arrays()
    };
    let mut hits = 0;
    for ray in random_rays(&mut random, 4000, 1.5) {
        let found = trace(&world.arrays(), &ray, false);
        assert_eq!(found, trace(&by_nodes, &ray, false));
        hits += u32::from(found.is_some());
    }
    assert!(hits > 500, "{hits}");
}

#[test]
fn builds_repeat_exactly() {
    // Enough triangles for the builder's parallel paths. Leaf order decides ties and keys alpha, so it must not depend
    // on scheduling.
    let mesh = soup(&mut Random(4), 60_000, 0.01);
    let first = MeshHierarchies::build(std::slice::from_ref(&mesh), &[]).unwrap();
    first.validate().unwrap();
    for _ in 0..3 {
        let again = MeshHierarchies::build(std::slice::from_ref(&mesh), &[]).unwrap();
        assert_eq!(again.triangle_vertices, first.triangle_vertices);
        assert_eq!(again.nodes, first.nodes);
    }
}

#[test]
fn instance_hierarchies_of_all_sizes_fit_their_stack() {
    let mut random = Random(5);
    let mesh = [mesh_of(&[[Vec3::ZERO, Vec3::X, Vec3::Y]])];
    let meshes = MeshHierarchies::build(&mesh, &[]).unwrap();
    for count in [0usize, 1, 2, 3, 100, 10_000] {
        for kind in 0..3 {
            let sources: Vec<_> = (0..count)
                .map(|i| {
                    let at = match kind {
                        0 => 100.0 * random.vector(),
                        1 => DVec3::ZERO,
                        // Exponentially spaced: a surface area split peels them off one by one.
                        _ => DVec3::X * 1.5f64.powi((i % 60) as i32),
                    };
                    let at = DAffine3::from_rotation_translation(random.rotation(), at);
                    placed(at, 0)
                })
                .collect();
            let top = TopLevel::build(DVec3::ZERO, &sources, &meshes).unwrap();
            top.validate().unwrap();
            assert!(top.depth() <= TOP_STACK);
        }
    }
}

#[test]
fn rebuilding_reuses_and_repeats() {
    let mut random = Random(6);
    let meshes = MeshHierarchies::build(&[soup(&mut random, 30, 0.3)], &[]).unwrap();
    let sources: Vec<_> = (0..100)
        .map(|_| {
            let at = (random.rotation(), 20.0 * random.vector());
            placed(DAffine3::from_rotation_translation(at.0, at.1), 0)
        })
        .collect();
    let fresh = TopLevel::build(DVec3::ONE, &sources, &meshes).unwrap();
    let mut reused = TopLevel::build(DVec3::ZERO, &sources[..7], &meshes).unwrap();
    reused.rebuild(DVec3::ONE, &sources, &meshes).unwrap();
    assert_eq!(fresh.nodes(), reused.nodes());
    assert_eq!(fresh.instances(), reused.instances());
}

#[test]
fn instance_bounds_hold_their_triangles() {
    let mut random = Random(7);
    let mesh = soup(&mut random, 64, 0.4);
    for _ in 0..200 {
        let scale = DVec3::new(
            10f64.powf(random.signed()),
            -1.0,
            10f64.powf(random.signed()),
        );
        let shear = DAffine3::from_quat(random.rotation()) * DAffine3::from_scale(scale);
        let transform = DAffine3::from_translation(1e3 * random.vector())
            * shear
            * DAffine3::from_quat(random.rotation());
        let world = World::new(
            std::slice::from_ref(&mesh),
            &[placed(transform, 0)],
            DVec3::ZERO,
        );
        let bounds = world.top.bounds()[0];
        for position in &mesh.positions {
            let point = transform.transform_point3(Vec3::from(*position).as_dvec3());
            assert!(
                point.cmpge(bounds.min.as_dvec3()).all()
                    && point.cmple(bounds.max.as_dvec3()).all()
            );
        }
        assert_eq!(world.top.instances()[0].flags, 1, "one axis is mirrored");
    }
}

/// Numbers of the instances that leaves name parts of.
fn opened(top: &TopLevel) -> Vec<u32> {
    let sources = top.bounds().len();
    let parts = top.instances()[sources..].iter();
    let opened: BTreeSet<u32> = parts
        .map(|part| part.flags >> INSTANCE_NUMBER_SHIFT)
        .collect();
    opened.into_iter().collect()
}

#[test]
fn what_overlaps_is_opened_and_met_alike() {
    let mut random = Random(9);
    let meshes = [
        soup(&mut random, 300, 0.2),
        soup(&mut random, 400, 0.1),
        soup(&mut random, 3, 0.5),
    ];
    let at = |x: f64, mesh| placed(DAffine3::from_translation(DVec3::X * x), mesh);
    let mut sheared = at(0.2, 1);
    sheared.world_from_object.matrix3.y_axis.x = 8.0;
    // The first three overlap, the third is too small to be opened; the fourth stands by itself.
    let mut sources = vec![at(0.0, 0), sheared, at(0.1, 2), at(20.0, 0)];
    let mut world = World::new(&meshes, &sources, DVec3::ZERO);
    assert_eq!(opened(&world.top), [0, 1]);
    let rays = random_rays(&mut random, 4000, 1.5);
    let (wrong, hits) = world.disagreements(rays.iter().copied(), 1e-4);
    assert!(hits > 500, "only {hits} rays hit anything");
    assert_eq!(wrong, 0);

    // Opened or whole, every ray meets the same to the last bit.
    let bent = MeshHierarchies::build_with_room(&meshes, &[], |_| true).unwrap();
    assert_eq!(bent.triangles, world.meshes.triangles);
    let whole = TopLevel::build(DVec3::ZERO, &sources, &bent).unwrap();
    assert!(opened(&whole).is_empty(), "what bends is not opened");
    let whole = Arrays {
        top_nodes: whole.nodes(),
        instances: whole.instances(),
        mesh_nodes: &bent.nodes,
        triangles: &bent.triangles,
    };
    for ray in &rays {
        assert_eq!(
            trace(&world.arrays(), ray, false),
            trace(&whole, ray, false)
        );
    }

    // A kept tree serves while its instances move a little, and gives way where they part or one is hidden.
    let parts = world.top.instances().len();
    for step in 0..40 {
        sources[1].world_from_object.translation.x += 0.01 * f64::from(step * step);
        if step == 39 {
            sources[0].world_from_object.matrix3 = DMat3::ZERO;
        }
        let origin = DVec3::splat(0.01 * f64::from(step));
        world.top.rebuild(origin, &sources, &world.meshes).unwrap();
        world.top.validate().unwrap();
        world.exact = exact_instances(&sources, &world.meshes, origin);
        if step < 39 {
            let (wrong, _) = world.disagreements(rays.iter().step_by(10).copied(), 1e-3);
            assert_eq!(wrong, 0, "step {step}");
        }
        if step == 2 {
            assert_eq!(world.top.instances().len(), parts, "the tree is kept");
        }
    }
    assert_eq!(opened(&world.top), []);
}
