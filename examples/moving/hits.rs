//! What rays meet on a model that changes its shape, beside an exhaustive search over triangles skinned in f64.

use glam::{DVec3, Vec3};
use stereolux::bvh::records::Triangle;
use stereolux::gpu::{GpuContext, ShaderLibrary};
use stereolux::renderer::deform::with_own_meshes;
use stereolux::renderer::{Renderer, SceneBuffers};
use stereolux::scene::{Scene, ScenePose};
use stereolux::settings::{Eyes, Method, RenderSettings};
use stereolux::xr::View;

use super::Outcome;
use super::moving_support::wrong_hits;
use super::trace_probe::{Random, TraceProbe};

/// Times of a clip at which rays are traced, off the keys.
const TIMES: u32 = 20;
const RAYS: usize = 500;

/// Triangles in leaf order, those of what changes its shape from their f64 twin.
fn skinned(held: &SceneBuffers, scene: &Scene, pose: &ScenePose) -> Vec<Triangle> {
    let hierarchies = held.hierarchies();
    let mut triangles = hierarchies.triangles.clone();
    for placed in scene.instances() {
        if !scene.deforms(placed.node) {
            continue;
        }
        let mesh = &scene.meshes[placed.mesh];
        let positions = scene.deformation(placed.node, pose).positions(mesh);
        let range = &hierarchies.meshes[placed.mesh];
        let end = range.first_triangle + range.triangle_count;
        for triangle in range.first_triangle..end {
            let corners = hierarchies.triangle_vertices[triangle as usize];
            let at = |corner: u32| {
                let position: DVec3 = positions[(corner - range.first_vertex) as usize];
                position.as_vec3().to_array()
            };
            let slot = &mut triangles[triangle as usize];
            [slot.v0, slot.v1, slot.v2] = [at(corners[0]), at(corners[1]), at(corners[2])];
        }
    }
    triangles
}

/// Prints how many random rays met what the exhaustive search met, clip by clip; false if any did not.
pub fn check(library: &ShaderLibrary, scene: &Scene, views: &[View; 2]) -> Outcome<bool> {
    let own = with_own_meshes(scene);
    let settings = RenderSettings {
        method: Method::Path,
        ..RenderSettings::default()
    };
    let context = GpuContext::open(None)?;
    let mut renderer = Renderer::new(context, library, scene, &settings, Eyes::Left, [8, 8])?;
    let context = renderer.context().clone();
    let probe = TraceProbe::new(&context, library, &["probe_occlusion"]);
    let mut random = Random(17);
    let mut agrees = true;
    println!(
        "\n| clip of {} | poses | rays that hit | wrong | wrong against the pose before | worst corner, of the reach |",
        scene.name
    );
    println!("|---|---|---|---|---|---|");
    let mut frame = 0;
    for clip in &scene.animations {
        let (mut hits, mut wrong, mut stale) = (0, 0, 0);
        let mut worst = 0.0f32;
        let mut before: Option<Vec<Triangle>> = None;
        for step in 0..TIMES {
            let time_s = clip.length_s * (f64::from(step) + 0.37) / f64::from(TIMES);
            let pose = scene.pose_at(clip, time_s);
            renderer.set_pose(&pose);
            renderer.render_frame(views, frame, |_| {})?;
            frame += 1;
            let held = renderer.scene();
            let exact: Vec<_> = own
                .instances()
                .iter()
                .filter_map(|placed| {
                    let mut at = held.placement(held.instance_of_node(placed.node)?)?;
                    at.translation -= renderer.origin_in_world();
                    let range = &held.hierarchies().meshes[placed.mesh];
                    let end = range.first_triangle + range.triangle_count;
                    Some((at, range.first_triangle..end))
                })
                .collect();
            let mut trace = |triangles: &[Triangle]| {
                wrong_hits(&probe, held, &exact, triangles, &mut random, RAYS)
            };
            let now = skinned(held, &own, &pose);
            let (misses, met) = trace(&now);
            hits += met;
            wrong += misses;
            if let Some(before) = &before {
                stale += trace(before).0;
            }
            worst = worst.max(worst_corner(&renderer, &now)?);
            before = Some(now);
        }
        println!(
            "| {} | {TIMES} | {hits} | {wrong} | {stale} | {worst:.1e} |",
            clip.name
        );
        // Poses that agree with the one before them say that the search would not notice a wrong one.
        agrees &= wrong == 0 && hits > 0 && stale > 0;
    }
    Ok(agrees)
}

/// Largest distance of a coordinate on the device from the f64 twin, over the largest coordinate.
fn worst_corner(renderer: &Renderer, exact: &[Triangle]) -> Outcome<f32> {
    let resources = renderer.scene().resources();
    let Some(wgpu::BindingResource::Buffer(binding)) = resources.get("triangles") else {
        return Err("the renderer holds no triangles".into());
    };
    let held: Vec<Triangle> = stereolux::gpu::buffers::read_buffer(
        renderer.context(),
        "triangles",
        binding.buffer,
        exact.len(),
    )?;
    let corners = |triangle: &Triangle| [triangle.v0, triangle.v1, triangle.v2].map(Vec3::from);
    let (mut worst, mut reach) = (0.0f32, 0.0f32);
    for (held, exact) in held.iter().zip(exact) {
        for (held, exact) in corners(held).into_iter().zip(corners(exact)) {
            worst = worst.max((held - exact).abs().max_element());
            reach = reach.max(exact.abs().max_element());
        }
    }
    Ok(worst / reach)
}
