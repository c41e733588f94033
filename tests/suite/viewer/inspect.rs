//! Views of intermediate results: surfaces and picking, against f64.

use glam::{DAffine3, DVec3};
use stereolux::bvh::records::Triangle;
use stereolux::gpu::{ShaderLibrary, buffers::read_buffer};
use stereolux::renderer::{
    Eye, Inspected, InspectedValues, Inspection, InstanceId, RenderError, Renderer, SeenSurface,
};
use stereolux::scene::{AlphaMode, Material};
use stereolux::settings::{Eyes, Force, Method, Reuse};
use stereolux::xr::View;

use super::bsdf_probe::wide;
use super::bvh_reference::{ExactInstance, brute_force};
use super::hard_support::{add, square_ahead};
pub use super::photon_map::views;
use super::support::*;
use crate::suite::embedded_scenes::plane;

pub const SIZE: [u32; 2] = [40, 32];
const EYES: [Eye; 2] = Eye::ALL;

pub fn surfaces(renderer: &mut Renderer, eye: Eye) -> Vec<SeenSurface> {
    let library = ShaderLibrary::embedded();
    renderer.inspect_surfaces(&library, eye).unwrap()
}

pub fn inspected(renderer: &mut Renderer, view: Inspection, eye: Eye) -> Inspected {
    let found = renderer.inspect(&ShaderLibrary::embedded(), view, eye);
    let found = found.unwrap_or_else(|error| panic!("{view:?}: {error}"));
    let pixels = (found.size[0] * found.size[1]) as usize;
    if let Some(has_value) = &found.has_value {
        assert_eq!(has_value.len(), pixels, "{view:?}");
    }
    found
}

pub fn scalars(renderer: &mut Renderer, view: Inspection, eye: Eye) -> Vec<f32> {
    match inspected(renderer, view, eye).values {
        InspectedValues::Scalar(values) => values,
        other => panic!("{view:?}: {other:?}"),
    }
}

pub fn colors(renderer: &mut Renderer, view: Inspection, eye: Eye) -> Vec<[f32; 3]> {
    match inspected(renderer, view, eye).values {
        InspectedValues::Color(values) | InspectedValues::Direction(values) => values,
        other => panic!("{view:?}: {other:?}"),
    }
}

/// Ray through the centre of a pixel, from the view alone.
pub fn center_ray(view: &View, size: [u32; 2], pixel: usize) -> (DVec3, DVec3) {
    let ray = pixel_ray(view, pixel, size);
    (ray.origin, ray.direction.normalize())
}

/// The triangles as the device has them, deformed ones included.
fn triangles(renderer: &Renderer) -> Vec<Triangle> {
    let resources = renderer.scene().resources();
    let Some(wgpu::BindingResource::Buffer(binding)) = resources.get("triangles") else {
        panic!("no triangles");
    };
    let count = renderer.scene().hierarchies().triangles.len();
    read_buffer(renderer.context(), "triangles", binding.buffer, count).unwrap()
}

/// What brute force searches, by slot: `meshes` says which mesh each slot shows, `places` where (`None`: removed).
fn exact(renderer: &Renderer, meshes: &[usize], places: &[Option<DAffine3>]) -> Vec<ExactInstance> {
    let origin = renderer.origin_in_world();
    let hierarchies = renderer.scene().hierarchies();
    let placed = |(mesh, place): (&usize, &Option<DAffine3>)| {
        let range = &hierarchies.meshes[*mesh];
        let end = range.first_triangle + range.triangle_count;
        match place {
            Some(place) => {
                let mut place = *place;
                place.translation -= origin;
                (place, range.first_triangle..end)
            }
            None => (DAffine3::IDENTITY, 0..0),
        }
    };
    meshes.iter().zip(places).map(placed).collect()
}

/// How many pixels disagree with the exhaustive search, and how many of those that are certain see a surface.
fn wrong_surfaces(
    renderer: &mut Renderer,
    eye: Eye,
    view: &View,
    exact: &[ExactInstance],
) -> (usize, usize) {
    let triangles = triangles(renderer);
    let origin = renderer.origin_in_world();
    let seen = surfaces(renderer, eye);
    let (mut wrong, mut certain) = (0, 0);
    for (pixel, seen) in seen.iter().enumerate() {
        let (from, direction) = center_ray(view, SIZE, pixel);
        let from = from - origin;
        // The device's ray is rounded to f32, some 1e-7 of its direction: within 1e-4 of a border (barycentric) either
        // answer is right, as where two surfaces lie in one place.
        let all = brute_force(exact, &triangles, from, direction, 1e-4);
        let nearly = |t: f64| (t - all[0].t).abs() < 1e-4 * (1.0 + t);
        if all.iter().any(|hit| hit.inside < 1e-4) || all.iter().skip(1).any(|hit| nearly(hit.t)) {
            continue;
        }
        let Some(first) = all.first() else {
            wrong += usize::from(seen.instance.is_some());
            continue;
        };
        certain += 1;
        let triangle = &triangles[first.triangle];
        let place = exact[first.instance].0;
        let [a, b, c] =
            [triangle.v0, triangle.v1, triangle.v2].map(|v| place.transform_point3(wide(v)));
        let normal = (b - a).cross(c - a).normalize();
        let facing = -normal.dot(direction).signum();
        let normal_seen = wide(seen.geometric_normal_in_world);
        let shading = wide(seen.normal_in_world);
        // Distances: errors of tens of f32 units over slopes down to 1e-2. Normals are packed into 16 bits an axis:
        // a step of 2 / 65,535 in each of two coordinates, folded.
        let agrees = seen.instance == Some(InstanceId(first.instance as u32))
            && seen.triangle as usize == first.triangle
            && seen.material == triangle.material
            && (f64::from(seen.distance_m) - first.t).abs() < 1e-4 * (1.0 + first.t)
            && normal_seen.distance(facing * normal) < 1e-4
            && seen.is_front == (facing > 0.0)
            && (shading.length() - 1.0).abs() < 1e-5
            && shading.dot(normal_seen) > 0.0
            && seen.node == renderer.scene().shown_node(first.instance as u32)
            && seen.nodes_visited >= 1;
        wrong += usize::from(!agrees);
    }
    (wrong, certain)
}

#[test]
fn surfaces_are_those_of_an_exhaustive_search_whatever_moves() {
    for (name, half_degrees) in [("cornell", 20.0), ("gallery", 40.0)] {
        let scene = builtin(name);
        let settings = method(Method::Path, Reuse::Lookup);
        let mut renderer = renderer(&scene, &settings, SIZE);
        let views = views(&scene, half_degrees);
        let instances = scene.instances().into_iter();
        let (mut meshes, mut places): (Vec<usize>, Vec<Option<DAffine3>>) = instances
            .map(|placed| (placed.mesh, Some(placed.world_from_object)))
            .unzip();
        frame(&mut renderer, &views);
        let seen = surfaces(&mut renderer, Eye::Left);
        // The two that most pixels see, the room aside.
        let mut counts = vec![0; meshes.len()];
        for id in seen.iter().filter_map(|surface| surface.instance) {
            counts[id.0 as usize] += 1;
        }
        let mut slots: Vec<usize> = (0..meshes.len()).collect();
        slots.sort_by_key(|slot| std::cmp::Reverse(counts[*slot]));
        let (moved, removed) = (slots[1], slots[2]);
        for step in 0..2 {
            let now = exact(&renderer, &meshes, &places);
            for (eye, view) in EYES.into_iter().zip(&views) {
                let (wrong, certain) = wrong_surfaces(&mut renderer, eye, view, &now);
                assert_eq!(wrong, 0, "{name} {eye:?} step {step}");
                assert!(certain > seen.len() / 2, "{name}: {certain}");
            }
            if step == 1 {
                break;
            }
            // What has been moved shows with the next frame, not before.
            let shift = DAffine3::from_translation(DVec3::new(0.05, 0.08, 0.03));
            let place = shift * places[moved].unwrap();
            assert!(renderer.set_instance_transform(InstanceId(moved as u32), place));
            assert!(renderer.remove_instance(InstanceId(removed as u32)));
            let added = shift * shift * places[moved].unwrap();
            let id = renderer.add_instance(meshes[moved], added).unwrap();
            let (wrong, _) = wrong_surfaces(&mut renderer, Eye::Left, &views[0], &now);
            assert_eq!(wrong, 0, "{name}: the frame that is shown");
            places[moved] = Some(place);
            places[removed] = None;
            assert_eq!(id.0 as usize, meshes.len());
            meshes.push(meshes[moved]);
            places.push(Some(added));
            renderer.render_frame(&views, 1, |_| {}).unwrap();
            assert_eq!(renderer.scene().shown_node(id.0), None);
            // The scene as it was would be wrong now.
            let (wrong, _) = wrong_surfaces(&mut renderer, Eye::Left, &views[0], &now);
            assert!(wrong > 10, "{name}: {wrong}");
        }
    }
}

#[test]
fn surfaces_of_deforming_meshes_are_those_of_their_shape() {
    let scene = builtin("parade");
    let mut renderer = renderer(&scene, &method(Method::Path, Reuse::Off), SIZE);
    let views = views(&scene, 35.0);
    let own = stereolux::renderer::deform::with_own_meshes(&scene);
    let meshes: Vec<usize> = own.instances().iter().map(|placed| placed.mesh).collect();
    for index in 0..2 {
        renderer.animate(i64::from(index) * 700_000_000);
        renderer.render_frame(&views, index, |_| {}).unwrap();
        let slots = (0..meshes.len() as u32).map(InstanceId);
        let places: Vec<_> = slots.map(|slot| renderer.scene().placement(slot)).collect();
        let now = exact(&renderer, &meshes, &places);
        let (wrong, certain) = wrong_surfaces(&mut renderer, Eye::Right, &views[1], &now);
        assert!(wrong == 0 && certain > 300, "{index}: {wrong} of {certain}");
    }
}

#[test]
fn depth_normals_steps_and_instances_of_a_plane_in_closed_form() {
    let scene = builtin("plane");
    let mut renderer = renderer(&scene, &method(Method::Path, Reuse::Off), SIZE);
    let views = views(&scene, 40.0);
    frame(&mut renderer, &views);
    for (eye, view) in EYES.into_iter().zip(&views) {
        let depth = scalars(&mut renderer, Inspection::Depth, eye);
        let normals = colors(&mut renderer, Inspection::Normal, eye);
        let albedo = colors(&mut renderer, Inspection::Albedo, eye);
        let steps = scalars(&mut renderer, Inspection::BvhSteps, eye);
        let labels = inspected(&mut renderer, Inspection::Instance, eye);
        assert_eq!(labels.has_value, Some(vec![true; depth.len()]));
        assert_eq!(labels.values, InspectedValues::Labels(vec![0; depth.len()]));
        for pixel in 0..depth.len() {
            let (_, direction) = center_ray(view, SIZE, pixel);
            let exact = plane::DISTANCE_M / -direction.z;
            // A few roundings of f32.
            assert!((f64::from(depth[pixel]) / exact - 1.0).abs() < 1e-6);
            assert_eq!(normals[pixel], [0.0, 0.0, 1.0]);
            assert_eq!(albedo[pixel], [plane::ALBEDO; 3]);
            // The upper hierarchy's root: two triangles need no node of their own.
            assert_eq!(steps[pixel], 1.0);
        }
    }
    // Beside the plane: nothing but the root's boxes.
    let mut away = scene.start_pose();
    away.orientation = glam::DQuat::from_rotation_y(std::f64::consts::PI);
    play(
        &mut renderer,
        &parallel_views(away, 0.063, square_fov(30.0)),
        1..2,
    );
    let nothing = surfaces(&mut renderer, Eye::Left);
    for s in &nothing {
        assert!(s.instance.is_none() && s.node.is_none(), "{s:?}");
        assert!(s.nodes_visited == 1 && s.distance_m == 0.0, "{s:?}");
    }
    let count = nothing.len();
    let depth = inspected(&mut renderer, Inspection::Depth, Eye::Left);
    assert_eq!(depth.has_value, Some(vec![false; count]));
    assert_eq!(depth.values, InspectedValues::Scalar(vec![0.0; count]));
    let labels = inspected(&mut renderer, Inspection::Instance, Eye::Left).values;
    assert_eq!(labels, InspectedValues::Labels(vec![u32::MAX; count]));
}

#[test]
fn blended_panes_are_there_by_their_coverage_and_not_by_chance() {
    let pane = |coverage: f32| {
        let mut scene = builtin("plane");
        let mut glass = Material::lambert("pane", [0.25; 3]);
        glass.base_color[3] = coverage;
        glass.alpha_mode = AlphaMode::Blend;
        add(&mut scene, &square_ahead(5.0, 1.0), glass);
        let settings = method(Method::Path, Reuse::Off);
        let mut renderer = rendered(&scene, &settings, SIZE, &views(&scene, 40.0));
        let seen = surfaces(&mut renderer, Eye::Left);
        let mut seen: Vec<u32> = seen
            .iter()
            .map(|surface| surface.instance.unwrap().0)
            .collect();
        seen.dedup();
        seen
    };
    assert_eq!(pane(0.3), [1]);
    assert_eq!(pane(0.05), [0]);
}

#[test]
fn albedo_is_the_textured_base_colour_and_parts_add_up() {
    let scene = builtin("gallery");
    let settings = settings(|s| {
        s.reuse = Reuse::Off;
        s.output.parts = true;
    });
    let mut renderer = rendered(&scene, &settings, SIZE, &views(&scene, 40.0));
    for eye in EYES {
        let seen = surfaces(&mut renderer, eye);
        let albedo = colors(&mut renderer, Inspection::Albedo, eye);
        let parts = renderer.read_parts(eye).unwrap().unwrap();
        let (mut lambert, mut textured) = (0, 0);
        for (pixel, surface) in seen.iter().enumerate() {
            assert_eq!(albedo[pixel], surface.albedo);
            if surface.instance.is_none() {
                continue;
            }
            let material = &scene.materials[surface.material as usize];
            if [material.metallic, material.specular, material.transmission] == [0.0; 3] {
                // A Lambert surface reflects its base colour; one sample goes through the centre too.
                lambert += 1;
                textured += usize::from(material.base_color_texture.is_some());
                let expected = parts.albedo[pixel];
                let close = (0..3).all(|c| (surface.albedo[c] - expected[c]).abs() <= 1e-6);
                assert!(close, "{eye:?} {pixel}: {:?} {expected:?}", surface.albedo);
            }
        }
        assert!(lambert > 100 && textured > 20, "{lambert} {textured}");
        let direct = colors(&mut renderer, Inspection::Direct, eye);
        let indirect = colors(&mut renderer, Inspection::Indirect, eye);
        let radiance = radiance(&renderer, eye);
        let sums = direct.iter().zip(&indirect).zip(&radiance);
        for ((direct, indirect), radiance) in sums {
            for c in 0..3 {
                // Each part is rounded once.
                let error = (direct[c] + indirect[c] - radiance[c]).abs();
                let what = format!("{direct:?} {indirect:?} {radiance:?}");
                assert!(error <= 1e-6 * radiance[c], "{what}");
            }
        }
        assert!(mean(&indirect) > 0.05 * mean(&direct));
    }
}

#[test]
fn looking_leaves_the_frames_as_they_are() {
    let scene = builtin("gallery");
    let settings = settings(|s| s.photon.count = 2048);
    let mut with_all = settings.clone();
    with_all.output.motion = true;
    with_all.output.parts = true;
    with_all.force.caustics = Force::On;
    let views = views(&scene, 40.0);
    let [mut plain, mut alike, mut looked_at] =
        [&settings, &with_all, &with_all].map(|settings| renderer(&scene, settings, SIZE));
    let is_software = plain.context().adapter.is_software();
    let passes = looked_at.pass_names();
    for index in 0..3 {
        let moved = DAffine3::from_translation(DVec3::Y * 0.01 * f64::from(index))
            * scene.instances()[3].world_from_object;
        for renderer in [&mut plain, &mut alike, &mut looked_at] {
            renderer.set_instance_transform(InstanceId(3), moved);
            renderer.render_frame(&views, index, |_| {}).unwrap();
        }
        for eye in EYES {
            let [plain, alike, other] =
                [&plain, &alike, &looked_at].map(|one| bits(&radiance(one, eye)));
            assert!(alike == other, "frame {index} {eye:?}");
            // By other kernels, which a card's driver may round otherwise.
            assert!(plain == other || !is_software, "frame {index} {eye:?}");
            for view in Inspection::ALL {
                let has_none = (view, eye) == (Inspection::Provenance, Eye::Left);
                if view != Inspection::Variance && !has_none {
                    inspected(&mut looked_at, view, eye);
                }
            }
        }
    }
    // Nothing is compiled for frames.
    assert_eq!(looked_at.pass_names(), passes);
    let found = inspected(&mut looked_at, Inspection::Provenance, Eye::Right).values;
    let read = looked_at.read_provenance().unwrap().unwrap();
    assert_eq!(found, InspectedValues::Labels(read));
}

#[test]
fn what_is_missing_is_named_and_settings_for_a_view_make_it_work() {
    let scene = builtin("cornell");
    let views = views(&scene, 20.0);
    let library = ShaderLibrary::embedded();
    let poor = settings(|s| {
        s.method = Method::Path;
        s.reuse = Reuse::Off;
        s.path.max_depth = 3;
        s.photon.max_depth = 3;
    });
    let mut renderer = renderer(&scene, &poor, [12, 12]);
    let too_early = renderer.inspect_surfaces(&library, Eye::Left).unwrap_err();
    assert_says(&too_early.to_string(), &["render a frame"]);
    frame(&mut renderer, &views);
    for view in Inspection::ALL {
        let found = renderer.inspect(&library, view, Eye::Right);
        let Some(missing) = view.missing(&poor) else {
            found.unwrap();
            continue;
        };
        let error = found.unwrap_err();
        assert!(matches!(error, RenderError::Settings(_)), "{error}");
        let text = error.to_string();
        assert!(text.contains(missing) && !text.contains('\n'), "{text}");
        let mut enough = rendered(&scene, &view.settings_for(&poor), [12, 12], &views);
        inspected(&mut enough, view, Eye::Right);
    }
    // Another size has no frame yet.
    renderer.resize([10, 8]).unwrap();
    assert!(renderer.inspect_surfaces(&library, Eye::Left).is_err());
    frame(&mut renderer, &views);
    assert_eq!(surfaces(&mut renderer, Eye::Left).len(), 80);
    // A broken shader is an error that names it, as soon as passes are compiled again, and a good one works again.
    let mut broken = ShaderLibrary::embedded();
    broken.insert("passes/inspect_surfaces", "fn main() { let x = ; }");
    let depth = |renderer: &mut Renderer, library: &ShaderLibrary| {
        renderer.inspect(library, Inspection::Depth, Eye::Left)
    };
    depth(&mut renderer, &broken).unwrap();
    renderer.recompile_views();
    let error = depth(&mut renderer, &broken).unwrap_err().to_string();
    assert!(error.contains("inspect_surfaces"), "{error}");
    depth(&mut renderer, &library).unwrap();
    // One eye alone.
    let mut one = renderer_by(&library, &scene, &poor, Eyes::Right, [12, 12]).unwrap();
    frame(&mut one, &views);
    let alone = surfaces(&mut one, Eye::Right);
    let error = depth(&mut one, &library).unwrap_err();
    assert_says(&error.to_string(), &["left eye"]);
    let mut both = rendered(&scene, &poor, [12, 12], &views);
    assert_eq!(alone, surfaces(&mut both, Eye::Right));
}
