//! Skins and morph targets on the device: against the f64 twin, brute force over the deformed triangles, the previous
//! frame, and hierarchies that are built anew.

use std::borrow::Cow;
use std::f64::consts::PI;

use glam::{DAffine3, DMat3, DVec3, Vec3, Vec4};
use stereolux::bvh::records::{BvhNode, Triangle};
use stereolux::bvh::{Bounds32, MESH_STACK, refit::sah_cost, tree};
use stereolux::gpu::{ShaderLibrary, buffers::read_buffer};
use stereolux::renderer::deform::{COST_CHECK_FRAMES, REBUILD_COST_RATIO, with_own_meshes};
use stereolux::renderer::frames_in_flight;
use stereolux::renderer::records::material::Vertex;
use stereolux::renderer::{Eye, InstanceId, Renderer};
use stereolux::scene::{Deformation, Mesh, Node, Scene, ScenePose};
use stereolux::settings::{Force, Method, Reuse};

use super::bvh_reference::ExactInstance;
use super::moving_support::*;
use super::support::*;
use super::trace_probe::{Random, TraceProbe, soup};
use crate::suite::scene::edits::node;

/// A renderer of few pixels, for its scene.
fn small(scene: &Scene) -> Renderer {
    renderer(scene, &method(Method::Path, Reuse::Off), [8, 8])
}

fn render(renderer: &mut Renderer, scene: &Scene, shift: DVec3, index: u32) {
    let mut head = scene.start_pose();
    head.position += shift;
    let views = parallel_views(head, 0.06, square_fov(30.0));
    renderer.render_frame(&views, index, |_| {}).unwrap();
}

/// What the device holds of the scene's geometry.
struct Geometry {
    triangles: Vec<Triangle>,
    nodes: Vec<BvhNode>,
    vertices: Vec<Vertex>,
}

fn geometry(renderer: &Renderer) -> Geometry {
    let hierarchies = renderer.scene().hierarchies();
    let context = renderer.context();
    let resources = renderer.scene().resources();
    let buffer = |name| match resources.get(name) {
        Some(wgpu::BindingResource::Buffer(binding)) => binding.buffer.clone(),
        _ => panic!("{name}"),
    };
    let vertices = buffer("vertices");
    let count = vertices.size() as usize / size_of::<Vertex>();
    let (triangles, nodes) = (buffer("triangles"), buffer("mesh_nodes"));
    let (triangle_count, node_count) = (hierarchies.triangles.len(), hierarchies.nodes.len());
    Geometry {
        triangles: read_buffer(context, "triangles", &triangles, triangle_count).unwrap(),
        nodes: read_buffer(context, "nodes", &nodes, node_count).unwrap(),
        vertices: read_buffer(context, "vertices", &vertices, count).unwrap(),
    }
}

/// Instances as exact transforms relative to the render origin, over the scene with its own meshes.
fn exact(renderer: &Renderer, scene: &Scene) -> Vec<ExactInstance> {
    scene
        .instances()
        .iter()
        .map(|placed| {
            let id = renderer.scene().instance_of_node(placed.node).unwrap();
            let mut at = renderer.scene().placement(id).unwrap();
            at.translation -= renderer.origin_in_world();
            let range = &renderer.scene().hierarchies().meshes[placed.mesh];
            let first = range.first_triangle;
            (at, first..first + range.triangle_count)
        })
        .collect()
}

/// Bound on the device's position error: base and each target's delta, four blended matrices of rounded weights and
/// rows, one product: some 24 roundings of the largest terms.
fn position_bound(deformation: &Deformation, mesh: &Mesh) -> f64 {
    let largest = |values: &[[f32; 3]]| {
        let all = values.as_flattened().iter();
        f64::from(all.fold(0.0f32, |most, x| most.max(x.abs())))
    };
    let mut reach = largest(&mesh.positions);
    for (target, weight) in mesh.targets.iter().zip(&deformation.weights) {
        reach += weight.abs() * largest(&target.positions);
    }
    let grow = |matrix: &DAffine3| {
        let rows = [0, 1, 2].map(|row| matrix.matrix3.row(row).abs().element_sum());
        rows.into_iter().fold(0.0, f64::max) * reach + matrix.translation.abs().max_element()
    };
    let matrices = deformation.object_from_mesh.iter();
    let grown = matrices.map(grow).fold(reach, f64::max);
    32.0 / 16_777_216.0 * grown
}

/// What carries a vertex along: its joints' matrices, blended.
fn blended(deformation: &Deformation, mesh: &Mesh, vertex: usize) -> DMat3 {
    let joints = &deformation.object_from_mesh;
    if joints.is_empty() {
        return DMat3::IDENTITY;
    }
    let own = mesh.joints[vertex];
    let shares = own.joints.into_iter().zip(own.weights);
    shares
        .map(|(joint, weight)| joints[usize::from(joint)].matrix3 * f64::from(weight))
        .sum()
}

/// Bound on the error of a tangent's three numbers together: four products of rounded rows and weights, three of their sums
/// with the tangent, and the sums are 9 roundings of a row.
fn tangent_bound(deformation: &Deformation) -> f64 {
    let matrices = deformation.object_from_mesh.iter();
    let rows = matrices.flat_map(|matrix| [0, 1, 2].map(|row| matrix.matrix3.row(row)));
    let largest = rows.map(|row| row.abs().element_sum()).fold(1.0, f64::max);
    3.0 * 9.0 / 16_777_216.0 * largest
}

/// A vertex' tangent, carried along as the difference of two points is, and the sign by which the bitangent, carried along
/// likewise, lies on its side of that and the deformed normal.
fn carried_tangent(mesh: &Mesh, vertex: usize, carry: DMat3, normal: DVec3) -> (DVec3, f64) {
    let rest = Vec4::from(mesh.tangents[vertex]);
    let along = rest.truncate().as_dvec3();
    let across = Vec3::from(mesh.normals[vertex]).as_dvec3().cross(along) * f64::from(rest.w);
    let carried = carry * along;
    (carried, normal.cross(carried).dot(carry * across).signum())
}

/// The largest error over its bound, of triangles' corners against the f64 twin.
fn worst_corner(scene: &Scene, held: &Geometry, renderer: &Renderer, pose: &ScenePose) -> f64 {
    let mut worst = 0.0f64;
    let mut note = |error: f64| {
        // `max` would pass a NaN over.
        let error = if error.is_nan() { f64::INFINITY } else { error };
        worst = worst.max(error);
    };
    for placed in scene.instances() {
        if !scene.deforms(placed.node) {
            continue;
        }
        let mesh = &scene.meshes[placed.mesh];
        let deformation = scene.deformation(placed.node, pose);
        let positions = deformation.positions(mesh);
        let normals = deformation.normals(mesh);
        let bound = position_bound(&deformation, mesh);
        let hierarchies = renderer.scene().hierarchies();
        let range = &hierarchies.meshes[placed.mesh];
        let end = range.first_triangle + range.triangle_count;
        for triangle in range.first_triangle..end {
            let corners = hierarchies.triangle_vertices[triangle as usize];
            let Triangle { v0, v1, v2, .. } = held.triangles[triangle as usize];
            for (v, corner) in [v0, v1, v2].iter().zip(corners) {
                let own = (corner - range.first_vertex) as usize;
                let error = (Vec3::from(*v).as_dvec3() - positions[own]).length();
                note(error / bound);
                // Unit vectors: the cofactors' products lose some 1e-5 where joints disagree.
                let normal = Vec3::from(held.vertices[corner as usize].normal).as_dvec3();
                note((normal - normals[own]).length() / 1e-4);
                let tangent = Vec4::from(held.vertices[corner as usize].tangent);
                let carry = blended(&deformation, mesh, own);
                let (along, side) = carried_tangent(mesh, own, carry, normals[own]);
                if f64::from(tangent.w) != side {
                    note(f64::INFINITY);
                }
                let error = (tangent.truncate().as_dvec3() - along).abs();
                note(error.element_sum() / tangent_bound(&deformation));
            }
        }
    }
    worst
}

fn check_boxes(held: &Geometry, renderer: &Renderer) {
    let hierarchies = renderer.scene().hierarchies();
    for range in &hierarchies.meshes {
        let end = range.first_triangle + range.triangle_count;
        let triangles = range.first_triangle..end;
        let bounds = |triangle: u32| {
            let Triangle { v0, v1, v2, .. } = held.triangles[triangle as usize];
            Some(Bounds32::of_points([v0, v1, v2].map(Vec3::from)))
        };
        let checked = tree::check(&held.nodes, range.root, triangles, range.depth, bounds);
        assert_eq!(checked, Ok(()));
    }
}

#[test]
fn hits_on_skinned_and_morphed_meshes_equal_exhaustive_search() {
    let scene = builtin("parade");
    let mut renderer = small(&scene);
    let probe_context = renderer.context().clone();
    let library = ShaderLibrary::embedded();
    let probe = TraceProbe::new(&probe_context, &library, &["probe_occlusion"]);
    let clip = scene.clip("parade").unwrap().unwrap();
    let mut random = Random(71);
    let mut before: Option<(Vec<ExactInstance>, Vec<Triangle>)> = None;
    for frame in 0..6 {
        let pose = scene.pose_at(clip, 0.63 * f64::from(frame));
        renderer.set_pose(&pose);
        render(&mut renderer, &scene, 0.1 * random.vector(), frame);
        let held = geometry(&renderer);
        let worst = worst_corner(&scene, &held, &renderer, &pose);
        assert!(worst < 1.0, "frame {frame}: {worst} times the bound");
        check_boxes(&held, &renderer);
        let now = exact(&renderer, &scene);
        let mut wrong = |exact: &[ExactInstance], triangles: &[Triangle]| {
            wrong_hits(&probe, renderer.scene(), exact, triangles, &mut random, 500)
        };
        let (misses, hits) = wrong(&now, &held.triangles);
        assert!(hits > 150, "{hits} rays hit");
        assert_eq!(misses, 0, "frame {frame}");
        // Negative controls: last frame's shapes are noticed by the search and by the twin.
        if let Some((exact, triangles)) = &before {
            assert!(wrong(exact, triangles).0 > 5);
            let stale = Geometry {
                triangles: triangles.clone(),
                ..held
            };
            assert!(worst_corner(&scene, &stale, &renderer, &pose) > 10.0);
            before = Some((now, geometry(&renderer).triangles));
        } else {
            before = Some((now, held.triangles));
        }
    }
}

/// Normals of a mirrored vertex are turned with the winding, so the bitangent stays where it was without another sign.
#[test]
fn bitangents_keep_their_side_where_a_joint_is_mirrored() {
    let scene = builtin("parade");
    let mut renderer = small(&scene);
    // The joint above it is bent: the vertices between them have matrices of either handedness.
    let mut pose = torn(&scene, 0.4);
    pose.world_from_node[node(&scene, "joint 2")] *=
        DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
    renderer.set_pose(&pose);
    render(&mut renderer, &scene, DVec3::ZERO, 0);
    let mut held = geometry(&renderer);
    let worst = worst_corner(&scene, &held, &renderer, &pose);
    assert!(worst < 1.0, "{worst} times the bound");
    // A tube of 17 rings: five of them, and what closes it, are mirrored.
    let tube = scene
        .instances()
        .into_iter()
        .find(|placed| placed.node == node(&scene, "tube"));
    let mesh = tube.unwrap().mesh;
    let deformation = scene.deformation(tube.unwrap().node, &pose);
    let own = 0..scene.meshes[mesh].positions.len();
    let turned = own.map(|v| blended(&deformation, &scene.meshes[mesh], v).determinant() < 0.0);
    let turned: Vec<bool> = turned.collect();
    let count = turned.iter().filter(|turned| **turned).count();
    assert!(
        count > 5 * 16 && count < turned.len() / 2,
        "{count} of {}",
        turned.len()
    );
    // Negative controls: tangents as they are at rest, and another sign where the matrix has one.
    let first = renderer.scene().hierarchies().meshes[mesh].first_vertex as usize;
    let vertices = held.vertices.clone();
    for (vertex, rest) in held.vertices[first..]
        .iter_mut()
        .zip(&scene.meshes[mesh].tangents)
    {
        vertex.tangent = *rest;
    }
    assert!(worst_corner(&scene, &held, &renderer, &pose) > 1e4);
    held.vertices = vertices;
    for (vertex, turned) in held.vertices[first..].iter_mut().zip(turned) {
        vertex.tangent[3] *= if turned { -1.0 } else { 1.0 };
    }
    assert_eq!(worst_corner(&scene, &held, &renderer, &pose), f64::INFINITY);
}

#[test]
fn deformed_points_are_found_where_the_frame_before_had_them() {
    let scene = builtin("parade");
    // What follows motion from frame to frame makes the renderer keep the previous one.
    let mut settings = method(Method::Path, Reuse::Off);
    settings.reconstruct.taa = true.into();
    let mut renderer = renderer(&scene, &settings, [8, 8]);
    let context = renderer.context().clone();
    let probe = PreviousProbe::new(&context, &["deformation"]);
    let clip = scene.clip("parade").unwrap().unwrap();
    let mut random = Random(72);
    let mut was: Option<(ScenePose, DVec3)> = None;
    for (frame, time_s) in [0.2, 0.5, 0.9, 0.9, 0.9, 1.3].into_iter().enumerate() {
        let pose = scene.pose_at(clip, time_s);
        renderer.set_pose(&pose);
        render(&mut renderer, &scene, 0.05 * random.vector(), frame as u32);
        let slots = (0..).zip(exact(&renderer, &scene));
        let slots: Vec<_> = slots.map(|(slot, (_, range))| (slot, range)).collect();
        let points = random_points(&mut random, &slots, 1500);
        let answers = probe.ask(&renderer.scene().resources(), &points);
        if let Some((was, origin)) = &was {
            let mut unlike_now = 0;
            for ((slot, triangle, weights), answer) in points.iter().zip(&answers) {
                let placed = scene.instances()[*slot as usize];
                let mesh = &scene.meshes[placed.mesh];
                let hierarchies = renderer.scene().hierarchies();
                let first = hierarchies.meshes[placed.mesh].first_vertex;
                let corners = hierarchies.triangle_vertices[*triangle as usize];
                let corners = [corners[0], corners[1], corners[2]];
                let own = corners.map(|corner| (corner - first) as usize);
                let at = |pose: &ScenePose, origin: DVec3| {
                    let deformation = scene.deformation(placed.node, pose);
                    let positions = deformation.positions(mesh);
                    let mut render = deformation.world_from_object;
                    render.translation -= origin;
                    let corners = own.map(|vertex| positions[vertex]);
                    let bound = f32_bound(&render, corners)
                        + DVec3::splat(2.0 * position_bound(&deformation, mesh));
                    (render.transform_point3(point_of(corners, *weights)), bound)
                };
                let (expected, bound) = at(was, *origin);
                let got = answer.expect("it was there");
                let is_there = (got - expected).abs().cmple(bound).all();
                assert!(is_there, "{frame}: {got}, not {expected}, beyond {bound}");
                let (now, bound) = at(&pose, renderer.origin_in_world());
                unlike_now += usize::from(!(got - now).abs().cmple(bound).all());
            }
            // Negative control: the head moves every frame, and with it every point's place relative to it.
            assert!(unlike_now > 1400, "frame {frame}: {unlike_now}");
        } else {
            assert!(answers.iter().all(Option::is_none));
        }
        was = Some((pose, renderer.origin_in_world()));
    }
}

/// The parade's tube alone, its joints far apart: a shape that its tree was not built for.
pub fn torn(scene: &Scene, share: f64) -> ScenePose {
    let mut pose = scene.rest_pose();
    for (index, node) in scene.nodes.iter().enumerate() {
        if node.name == "joint 1" {
            let turn = DAffine3::from_rotation_z(2.5 * share);
            pose.world_from_node[index] *= turn;
        }
        if node.name == "joint 2" {
            pose.world_from_node[index].translation += DVec3::new(-2.0, -0.9, 1.5) * share;
        }
    }
    pose
}

#[test]
fn hierarchies_that_have_drifted_are_built_anew() {
    let scene = builtin("parade");
    let mut renderer = small(&scene);
    let context = renderer.context().clone();
    let ratio = |renderer: &Renderer| {
        let scene = renderer.scene();
        let deformer = scene.deformer().unwrap();
        let ratios = deformer.cost_ratios(&context, scene.hierarchies()).unwrap();
        ratios.into_iter().fold(0.0, f64::max)
    };
    let pose = |renderer: &mut Renderer, share: f64, index: u32| {
        renderer.set_pose(&torn(&scene, share));
        render(renderer, &scene, DVec3::ZERO, index);
    };
    pose(&mut renderer, 0.0, 0);
    // At rest the device's boxes are the host's but for some 1e-6 m of padding and rounding at either end, and 2 cm wide or
    // more: 1e-4 of each of the two edges of an area, of theirs and of the root's.
    let at_rest = ratio(&renderer);
    assert!((at_rest - 1.0).abs() < 4e-4, "{at_rest}");
    // And in any pose the device's sums are those of its boxes. All terms are positive: an area has 5 roundings, a path of
    // at most MESH_STACK nodes 2 each, a quotient both.
    let assert_sums = |renderer: &Renderer| {
        let (hierarchies, nodes) = (renderer.scene().hierarchies(), geometry(renderer).nodes);
        let shapes = scene
            .instances()
            .into_iter()
            .filter(|placed| scene.deforms(placed.node));
        let due = shapes
            .map(|placed| {
                let root = hierarchies.meshes[placed.mesh].root;
                sah_cost(&nodes, root) / hierarchies.cost(placed.mesh)
            })
            .fold(0.0, f64::max);
        let bound = 2.0 * (5.0 + 2.0 * f64::from(MESH_STACK)) / 16_777_216.0;
        let found = ratio(renderer);
        assert!((found / due - 1.0).abs() < bound, "{found}, {due} is due");
    };
    assert_sums(&renderer);
    pose(&mut renderer, 0.5, 0);
    assert_sums(&renderer);
    let mut worst = 0.0f64;
    // Costs read in one frame steer the third after it.
    let last = COST_CHECK_FRAMES + frames_in_flight::MOST as u32;
    for index in 1..=last {
        pose(&mut renderer, 1.0 + 1e-3 * f64::from(index), index);
        worst = worst.max(ratio(&renderer));
    }
    assert!(worst > REBUILD_COST_RATIO, "{worst}");
    let rebuilds = |renderer: &Renderer| renderer.scene().deformer().unwrap().rebuilds();
    assert!(rebuilds(&renderer) > 0, "nothing was built anew");
    assert!(ratio(&renderer) < 1.1, "{}", ratio(&renderer));
    let torn = torn(&scene, 1.0 + 1e-3 * f64::from(last));
    let held = geometry(&renderer);
    check_boxes(&held, &renderer);
    assert!(worst_corner(&scene, &held, &renderer, &torn) < 1.0);
    let library = ShaderLibrary::embedded();
    let probe = TraceProbe::new(&context, &library, &["probe_occlusion"]);
    let exact = exact(&renderer, &scene);
    let (scene, triangles) = (renderer.scene(), &held.triangles);
    let (misses, _) = wrong_hits(&probe, scene, &exact, triangles, &mut Random(73), 500);
    assert_eq!(misses, 0);
}

#[test]
fn every_deforming_instance_has_a_mesh_of_its_own() {
    let mut scene = builtin("parade");
    let ball = node(&scene, "ball");
    let mut twin = scene.nodes[ball].clone();
    twin.parent_from_node.translation += DVec3::new(0.0, 0.8, 0.0);
    twin.morph_weights = vec![1.0];
    scene.roots.push(scene.nodes.len());
    scene.nodes.push(twin);
    let own = with_own_meshes(&scene);
    assert_eq!(own.meshes.len(), scene.meshes.len() + 1);
    let own_meshes: Vec<_> = own.instances().iter().map(|placed| placed.mesh).collect();
    assert_eq!(own_meshes.last(), Some(&scene.meshes.len()));
    let mut renderer = small(&scene);
    render(&mut renderer, &scene, DVec3::ZERO, 0);
    let held = geometry(&renderer);
    assert!(worst_corner(&own, &held, &renderer, &scene.rest_pose()) < 1.0);
    // Rigid scenes are not copied.
    let cornell = builtin("cornell");
    assert!(matches!(with_own_meshes(&cornell), Cow::Borrowed(_)));
}

#[test]
fn a_moving_scene_is_the_same_twice_and_not_the_same_later() {
    let scene = builtin("parade");
    let run = |times_ns: [i64; 3]| {
        let settings = settings(|s| {
            s.photon.count = 2048;
            s.reuse = Reuse::Lookup;
        });
        let mut renderer = renderer(&scene, &settings, [24, 24]);
        let views = parallel_views(scene.start_pose(), 0.06, square_fov(25.0));
        let mut frames = Vec::new();
        for (index, time_ns) in times_ns.into_iter().enumerate() {
            renderer.animate(time_ns);
            let result = renderer.render_frame(&views, index as u32, |_| {}).unwrap();
            assert!(result.photons.traced, "what moved has moved its light");
            frames.push(both_bits(&renderer));
        }
        frames
    };
    let first = run([5, 400_000_005, 800_000_005]);
    assert_eq!(first, run([5, 400_000_005, 800_000_005]));
    // Only differences of display times count.
    assert_eq!(first, run([77, 400_000_077, 800_000_077]));
    assert_ne!(first[1], run([5, 500_000_005, 800_000_005])[1]);
}

/// The scene as a pose has it, without anything that deforms: shapes and normals are the f64 twin's.
fn baked(scene: &Scene, pose: &ScenePose) -> Scene {
    let own = with_own_meshes(scene).into_owned();
    let mut still = own.clone();
    for (index, node) in still.nodes.iter_mut().enumerate() {
        node.parent_from_node = pose.world_from_node[index];
        (node.parent, node.skin) = (None, None);
        node.children.clear();
        node.morph_weights.clear();
        if !still.roots.contains(&index) {
            still.roots.push(index);
        }
    }
    for placed in own.instances() {
        if !own.deforms(placed.node) {
            continue;
        }
        let deformation = own.deformation(placed.node, pose);
        let from = &own.meshes[placed.mesh];
        let to_f32 = |all: Vec<DVec3>| all.iter().map(|v| v.as_vec3().to_array()).collect();
        still.nodes[placed.node].parent_from_node = deformation.world_from_object;
        still.meshes[placed.mesh] = Mesh {
            positions: to_f32(deformation.positions(from)),
            normals: to_f32(deformation.normals(from)),
            joints: Vec::new(),
            targets: Vec::new(),
            ..from.clone()
        };
    }
    still
}

/// Normals, shadows, the points that rays start from and refitted boxes at once: they would show in the picture.
#[test]
fn a_deformed_scene_looks_like_one_modelled_so() {
    let scene = builtin("parade");
    let clip = scene.clip("parade").unwrap().unwrap();
    let views = parallel_views(scene.start_pose(), 0.06, square_fov(25.0));
    let mut settings = method(Method::Path, Reuse::Off);
    settings.spp = 4;
    let size = [40, 40];
    let image = |scene: &Scene, pose: Option<&ScenePose>| {
        let mut renderer = renderer(scene, &settings, size);
        if let Some(pose) = pose {
            renderer.set_pose(pose);
        }
        renderer.render_frame(&views, 0, |_| {}).unwrap();
        radiance(&renderer, Eye::Left)
    };
    let [pose, later] = [1.3, 1.5].map(|time_s| scene.pose_at(clip, time_s));
    let deformed = image(&scene, Some(&pose));
    // The same rays and random numbers; positions differ by some 1e-7 of their size, normals by 1e-4 where joints
    // disagree, and what they reflect in proportion. A ray in a hundred may pass an edge on its other side.
    let strays = |other: &[[f32; 3]]| strays(&deformed, other, 1e-3);
    let allowed = deformed.len() / 100;
    let found = strays(&image(&baked(&scene, &pose), None));
    assert!(found <= allowed, "{found} pixels");
    // Negative control: a fifth of a second later.
    let found = strays(&image(&baked(&scene, &later), None));
    assert!(found > 10 * allowed, "{found} pixels");
}

/// What glows is picked by the power that it has in the pose.
#[test]
fn what_glows_and_deforms_has_the_power_of_its_shape() {
    let emission = [2.0, 1.0, 0.5];
    let mut scene = builtin("parade");
    scene.nodes.iter_mut().for_each(|node| node.light = None);
    for material in &mut scene.materials {
        (material.emission, material.emissive_texture) = (emission.map(|c| c as f32), None);
        material.double_sided = false;
    }
    let clip = scene.clip("parade").unwrap().unwrap();
    let mut renderer = small(&scene);
    let mut known = Vec::new();
    for (index, time_s) in [0.4, 1.3].into_iter().enumerate() {
        let pose = scene.pose_at(clip, time_s);
        renderer.set_pose(&pose);
        render(&mut renderer, &scene, DVec3::ZERO, index as u32);
        let area_m2: f64 = scene
            .instances()
            .iter()
            .map(|placed| {
                let mesh = &scene.meshes[placed.mesh];
                let positions = scene.positions_in_world(placed.node, mesh, &pose);
                let area = |[a, b, c]: [DVec3; 3]| 0.5 * (b - a).cross(c - a).length();
                let triangles = mesh.triangles.iter();
                let corners =
                    triangles.map(|t| t.vertices.map(|vertex| positions[vertex as usize]));
                corners.map(area).sum::<f64>()
            })
            .sum();
        let said = renderer.scene().total_power_w();
        for (channel, radiance) in emission.into_iter().enumerate() {
            // Powers are kept while they differ by 1e-9.
            let power = PI * area_m2 * radiance;
            assert!(
                (said[channel] / power - 1.0).abs() < 1e-8,
                "{said:?} W, {power}"
            );
        }
        known.push(said[0]);
    }
    // Negative control: the poses differ.
    assert!((known[0] / known[1] - 1.0).abs() > 1e-3, "{known:?}");
}

/// Adapters that read textures faster read copies of the scene's records: the copies follow what moves, changes its shape
/// or comes and goes.
#[test]
fn copies_in_textures_follow_what_moves() {
    let mut scene = builtin("parade");
    // Rows of the textures come before those of what deforms.
    let mut crumbs = soup(&mut Random(74), 3000, 0.3);
    crumbs.normals = vec![[0.0, 1.0, 0.0]; crumbs.positions.len()];
    for mesh in scene.nodes.iter_mut().filter_map(|node| node.mesh.as_mut()) {
        *mesh += 1;
    }
    scene.meshes.insert(0, crumbs);
    scene.roots.push(scene.nodes.len());
    let before = DAffine3::from_translation(DVec3::new(0.0, 1.6, -1.6));
    scene.nodes.push(Node {
        parent_from_node: before * DAffine3::from_scale(DVec3::splat(0.2)),
        ..Node::of_mesh(0)
    });
    let scene = scene;
    let lamp_node = node(&scene, "lamp");
    let lamp_mesh = scene.nodes[lamp_node].mesh.unwrap();
    let clip = scene.clip("parade").unwrap().unwrap();
    let views = parallel_views(scene.start_pose(), 0.06, square_fov(25.0));
    for render_by in [Method::Path, Method::Photon] {
        let [plain, copied] = [Force::Off, Force::On].map(|record_texels| {
            let settings = settings(|s| {
                s.method = render_by;
                s.photon.count = 1024;
                s.force.record_texels = record_texels;
            });
            let mut renderer = renderer(&scene, &settings, [20, 20]);
            let lamp = renderer.scene().instance_of_node(lamp_node).unwrap();
            let mut added: Option<InstanceId> = None;
            let mut frames = Vec::new();
            for index in 0..6 {
                // The last two frames show the same pose: there only the lamps differ.
                renderer.set_pose(&scene.pose_at(clip, 0.7 * f64::from(index.min(4))));
                let aside = DAffine3::from_translation(DVec3::new(0.4, -0.3, 0.0));
                match index {
                    1 => assert!(renderer.set_instance_transform(lamp, aside)),
                    2 => assert!(renderer.remove_instance(lamp)),
                    3 => {
                        let at = DAffine3::from_translation(DVec3::new(-0.4, -0.5, 0.2));
                        added = Some(renderer.add_instance(lamp_mesh, at).unwrap());
                    }
                    5 => assert!(renderer.remove_instance(added.unwrap())),
                    _ => {}
                }
                renderer.render_frame(&views, index, |_| {}).unwrap();
                frames.push(bits(&radiance(&renderer, Eye::Left)));
            }
            frames
        });
        for (index, (plain, copied)) in plain.iter().zip(&copied).enumerate() {
            let differ = plain.iter().zip(copied).filter(|(a, b)| a != b).count();
            assert_eq!(differ, 0, "{render_by:?}, frame {index}");
        }
        // Negative control: every frame differs from the one before, as stale copies would.
        for pair in plain.windows(2) {
            assert_ne!(pair[0], pair[1], "{render_by:?}");
        }
    }
}
