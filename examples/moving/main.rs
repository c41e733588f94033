//! What moving a model costs its hierarchies, and whether rays still meet it: `cargo run --release --example moving -- MODEL`.
//!
//! Over the clips of a model that has a skin or morph targets: what random rays meet beside an exhaustive search (exit status
//! 1 where they differ), and what its refitted hierarchies cost beside ones built anew. What moving instances cost is in
//! `stereolux bench scaling`.

// The probe of the test suite, and the comparator of the hierarchies' tests.
#[allow(dead_code)]
#[path = "../../crates/bvh/tests/shared/reference.rs"]
mod bvh_reference;
#[allow(dead_code)]
#[path = "../../crates/bvh/tests/shared/shapes.rs"]
mod bvh_shapes;
mod hits;
#[allow(dead_code, clippy::unwrap_used)]
#[path = "../../tests/suite/bvh/moving_support.rs"]
mod moving_support;
#[allow(dead_code, clippy::unwrap_used)]
#[path = "../../crates/gpu/tests/shared/trace_probe.rs"]
mod trace_probe;

use std::process::ExitCode;

use glam::{DQuat, DVec3};
use stereolux::bvh::MeshHierarchies;
use stereolux::gpu::{GpuContext, ShaderLibrary};
use stereolux::renderer::Renderer;
use stereolux::scene::{Mesh, Scene};
use stereolux::settings::{Eyes, Method, RenderSettings};
use stereolux::xr::{Fov, View};

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

fn views() -> [View; 2] {
    [-0.03, 0.03].map(|x| View {
        position_in_world: DVec3::new(x, 1.0, 2.0),
        orientation: DQuat::from_rotation_x(-0.4),
        fov: Fov::from_degrees(-30.0, 30.0, 30.0, -30.0),
    })
}

/// Cost ratios over the clips of a model: refitted over first built, and over built anew for the pose.
fn refits(library: &ShaderLibrary, scene: &Scene) -> Outcome<()> {
    println!(
        "\n| clip of {} | time, s | refitted / as built | refitted / built anew |",
        scene.name
    );
    println!("|---|---|---|---|");
    for clip in &scene.animations {
        for step in 0..8 {
            let settings = RenderSettings {
                method: Method::Path,
                ..RenderSettings::default()
            };
            let context = GpuContext::open(None)?;
            let mut renderer =
                Renderer::new(context, library, scene, &settings, Eyes::Left, [8, 8])?;
            let time_s = clip.length_s * f64::from(step) / 8.0;
            let pose = scene.pose_at(clip, time_s);
            renderer.set_pose(&pose);
            renderer.render_frame(&views(), 0, |_| {})?;
            let held = renderer.scene();
            let Some(deformer) = held.deformer() else {
                return Ok(());
            };
            let ratios = deformer.cost_ratios(renderer.context(), held.hierarchies())?;
            let placed = scene
                .instances()
                .into_iter()
                .filter(|at| scene.deforms(at.node));
            for (placed, ratio) in placed.zip(ratios) {
                let mesh = &scene.meshes[placed.mesh];
                let positions = scene.deformation(placed.node, &pose).positions(mesh);
                let now = Mesh {
                    positions: positions.iter().map(|at| at.as_vec3().to_array()).collect(),
                    triangles: mesh.triangles.clone(),
                    ..Mesh::default()
                };
                let anew = MeshHierarchies::build(&[now], &[])?.cost(0);
                let built = held.hierarchies().cost(placed.mesh);
                let over = ratio * built / anew;
                println!("| {} | {time_s:.3} | {ratio:.3} | {over:.3} |", clip.name);
            }
        }
    }
    Ok(())
}

fn main() -> Outcome<ExitCode> {
    let path = std::env::args()
        .nth(1)
        .ok_or("give a model, .gltf or .glb")?;
    let library = ShaderLibrary::embedded();
    let scene = Scene::load(path)?;
    if !hits::check(&library, &scene, &views())? {
        eprintln!("moving: rays met something else than the exhaustive search");
        return Ok(ExitCode::FAILURE);
    }
    refits(&library, &scene)?;
    Ok(ExitCode::SUCCESS)
}
