//! Instances that move, come and go: what rays meet, where surfaces were, and what a frame costs to prepare.

use std::ops::Range;

use glam::{DAffine3, DQuat, DVec3, Vec3};
use stereolux::bvh::{records::Triangle, top::MOST_OPENED};
use stereolux::gpu::{GpuContext, ShaderFeatures, ShaderLibrary};
use stereolux::renderer::{InstanceId, SceneBuffers};
use stereolux::scene::{Material, Node, Scene};

use super::bvh_reference::ExactInstance;
use super::moving_support::*;
use super::support::context;
use super::trace_probe::{Random, TraceProbe, soup, sphere};

fn node(mesh: usize, parent_from_node: DAffine3) -> Node {
    Node {
        parent_from_node,
        ..Node::of_mesh(mesh)
    }
}

/// Two meshes placed `count` times around `center`, with shared vertices in one.
fn scene(random: &mut Random, count: usize, center: DVec3) -> Scene {
    let nodes = (0..count)
        .map(|i| node(i % 2, placement(random, center)))
        .collect();
    let mut meshes = vec![soup(random, 60, 0.2), sphere(random, 10, 6, 0.1)];
    for mesh in &mut meshes {
        mesh.normals = vec![[0.0, 1.0, 0.0]; mesh.positions.len()];
    }
    Scene {
        nodes,
        roots: (0..count).collect(),
        meshes,
        materials: vec![Material::lambert("grey", [0.5; 3])],
        ..Scene::default()
    }
}

fn placement(random: &mut Random, center: DVec3) -> DAffine3 {
    let [x, z] = [(); 2].map(|()| 1.0 + 0.5 * random.signed());
    let (scale, turn) = (DVec3::new(x, 1.0, z), random.rotation());
    DAffine3::from_scale_rotation_translation(scale, turn, center + 4.0 * random.vector())
}

fn range_of(scene: &SceneBuffers, mesh: usize) -> Range<u32> {
    let range = &scene.hierarchies().meshes[mesh];
    range.first_triangle..range.first_triangle + range.triangle_count
}

fn relative(mut transform: DAffine3, origin: DVec3) -> DAffine3 {
    transform.translation -= origin;
    transform
}

/// What brute force searches: every slot up to `slots`, empty ones without triangles.
fn exact(buffers: &SceneBuffers, meshes: &[usize], origin: DVec3) -> Vec<ExactInstance> {
    let of_slot = |(slot, mesh): (u32, &usize)| match buffers.placement(InstanceId(slot)) {
        Some(at) => (relative(at, origin), range_of(buffers, *mesh)),
        None => (DAffine3::IDENTITY, 0..0),
    };
    (0..).zip(meshes).map(of_slot).collect()
}

fn buffers(context: &GpuContext, scene: &Scene) -> SceneBuffers {
    SceneBuffers::new(context, scene, &ShaderFeatures::default()).unwrap()
}

#[test]
fn hits_on_moving_instances_equal_exhaustive_search() {
    let context = context();
    let probe = TraceProbe::new(&context, &ShaderLibrary::embedded(), &["probe_occlusion"]);
    let mut random = Random(61);
    for center in [DVec3::ZERO, DVec3::new(1e6, -2e6, 3e5)] {
        let scene = scene(&mut random, 6, center);
        let mut buffers = buffers(&context, &scene);
        let mut meshes: Vec<usize> = (0..6).map(|slot| slot % 2).collect();
        let mut before = Vec::new();
        for frame in 0..5 {
            for slot in [0, 3] {
                let at = placement(&mut random, center);
                buffers.place_instance(InstanceId(slot), at);
            }
            match frame {
                1 => assert!(buffers.remove_instance(InstanceId(2))),
                2 => {
                    let at = placement(&mut random, center);
                    let id = buffers.add_instance(1, at).unwrap();
                    assert_eq!(id, InstanceId(2), "the free number is used again");
                    meshes[2] = 1;
                }
                3 => {
                    let at = placement(&mut random, center);
                    assert_eq!(buffers.add_instance(0, at).unwrap(), InstanceId(6));
                    meshes.push(0);
                }
                _ => {}
            }
            let origin = center + random.vector();
            buffers.begin_frame(&context, origin).unwrap();
            let now = exact(&buffers, &meshes, origin);
            let triangles = buffers.hierarchies().triangles.clone();
            let mut wrong = |exact: &[ExactInstance]| {
                wrong_hits(&probe, &buffers, exact, &triangles, &mut random, 800)
            };
            let (misses, hits) = wrong(&now);
            assert!(hits > 250, "{hits} rays hit");
            assert_eq!(misses, 0, "frame {frame} around {center}");
            // Negative control: where things were in the frame before is noticed.
            if frame > 0 {
                assert!(wrong(&before).0 > 20);
            }
            before = now;
        }
    }
}

#[test]
fn previous_points_are_those_of_the_frame_before() {
    let context = context();
    let probe = PreviousProbe::new(&context, &[]);
    let mut random = Random(62);
    for center in [DVec3::ZERO, DVec3::new(-1e6, 1e6, 1e6)] {
        let scene = scene(&mut random, 4, center);
        let mut buffers = buffers(&context, &scene);
        let mut origin = center;
        buffers.begin_frame(&context, origin).unwrap();
        let slot = |slot: u32| (slot, range_of(&buffers, slot as usize % 2));
        let slots: Vec<(u32, Range<u32>)> = (0..4).map(slot).collect();
        let first = random_points(&mut random, &slots, 200);
        let answers = probe.ask(&buffers.resources(), &first);
        // Nothing comes before the first frame.
        assert!(answers.iter().all(Option::is_none));
        let mut added = None;
        for frame in 1..6 {
            let was = [0, 1, 2, 3, 4, 5].map(|slot| buffers.placement(InstanceId(slot)));
            let origin_was = origin;
            // The third frame is at rest: then a point was where it is.
            if frame != 3 {
                origin = center + random.vector();
                for slot in [1, 2] {
                    buffers.place_instance(InstanceId(slot), placement(&mut random, center));
                }
            }
            if frame == 2 {
                let at = placement(&mut random, center);
                added = Some(buffers.add_instance(0, at).unwrap());
            }
            buffers.begin_frame(&context, origin).unwrap();
            let mut shown = slots.clone();
            shown.extend(added.map(|id| (id.0, range_of(&buffers, 0))));
            let points = random_points(&mut random, &shown, 1000);
            let answers = probe.ask(&buffers.resources(), &points);
            let mut unlike_now = 0;
            for ((instance, triangle, weights), answer) in points.iter().zip(&answers) {
                let Some(was) = was[*instance as usize] else {
                    assert_eq!((frame, *answer), (2, None), "it was not there");
                    continue;
                };
                let Triangle { v0, v1, v2, .. } =
                    buffers.hierarchies().triangles[*triangle as usize];
                let corners = [v0, v1, v2].map(|v| Vec3::from(v).as_dvec3());
                let was = relative(was, origin_was);
                let expected = was.transform_point3(point_of(corners, *weights));
                let got = answer.expect("it was there");
                let bound = f32_bound(&was, corners);
                let error = (got - expected).abs();
                let is_there = error.cmple(bound).all();
                assert!(is_there, "frame {frame}: {error} beyond {bound}");
                let now = relative(buffers.placement(InstanceId(*instance)).unwrap(), origin);
                let now = now.transform_point3(point_of(corners, *weights));
                unlike_now += usize::from(!(got - now).abs().cmple(bound).all());
            }
            // Negative control: this frame's places are noticed, but for the frame at rest.
            assert_eq!(unlike_now > 500, frame != 3, "frame {frame}: {unlike_now}");
        }
    }
}

#[test]
fn a_frame_uploads_what_moved_and_no_triangles() {
    let context = context();
    let mut random = Random(63);
    let mut scene = scene(&mut random, 20, DVec3::ZERO);
    let mut fine = soup(&mut random, 1000, 0.2);
    fine.normals = vec![[0.0, 1.0, 0.0]; fine.positions.len()];
    scene.meshes[0] = fine;
    let mut buffers = buffers(&context, &scene);
    buffers.begin_frame(&context, DVec3::ZERO).unwrap();
    assert!(!buffers.scene_moved() || buffers.moved_instances().is_empty());
    buffers.begin_frame(&context, DVec3::ZERO).unwrap();
    buffers.begin_frame(&context, DVec3::ZERO).unwrap();
    assert_eq!(buffers.upload_bytes(), 0, "at rest nothing is uploaded");
    assert!(!buffers.scene_moved());
    let turned = DAffine3::from_quat(DQuat::from_rotation_y(1.0));
    buffers.place_instance(InstanceId(7), turned);
    let replaced = buffers.begin_frame(&context, DVec3::ZERO).unwrap();
    assert!(!replaced, "nothing has to be bound again");
    assert!(buffers.scene_moved());
    assert_eq!(buffers.moved_instances(), [7]);
    // 112 bytes of each instance or part, 64 of where an instance was, 64 of each node of the upper hierarchy, of which there
    // is one less than leaves: at least one leaf of each instance, and one more for whatever is opened. A mesh's triangles
    // alone are more than all that.
    let bytes = buffers.upload_bytes();
    let (parts, opened) = (2 * MOST_OPENED as u64, MOST_OPENED as u64);
    let least = 20 * (112 + 64) + 19 * 64;
    let most = least + parts * 112 + opened * 64;
    assert!(
        (least..=most).contains(&bytes),
        "{least} <= {bytes} <= {most}"
    );
    let triangles = buffers.hierarchies().triangles.len() * size_of::<Triangle>();
    assert!(triangles as u64 > most, "they would not be noticed");
    // At rest again: where all were in the frame before, and then nothing.
    for due in [20 * 64, 0] {
        buffers.begin_frame(&context, DVec3::ZERO).unwrap();
        assert_eq!(buffers.upload_bytes(), due);
    }
}
