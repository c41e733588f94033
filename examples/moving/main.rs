//! Moves instances through the library, and says what that costs the host.
//!
//! `cargo run --release --example moving` prints tables: one moving object beside a full rebuild, instances from 1 to
//! 10,000 that all move, and many triangles beside few in the same view.
//!
//! With a model that has a skin or morph targets as its argument it prints instead what random rays meet over the
//! model's clips beside an exhaustive search (exit status 1 where they differ), and what its refitted hierarchies cost
//! beside ones built anew.

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
use std::time::Instant;

use glam::{DAffine3, DQuat, DVec3};
use stereolux::bvh::{MaterialMarks, MeshHierarchies};
use stereolux::gpu::ShaderFeatures;
use stereolux::gpu::{GpuContext, ShaderLibrary};
use stereolux::renderer::{InstanceId, Renderer, SceneBuffers};
use stereolux::scene::{Material, Mesh, MeshTriangle, Node, Scene};
use stereolux::settings::{Eyes, Method, RenderSettings, Reuse};
use stereolux::xr::{Fov, View};

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// A wavy square of 2 n^2 triangles, 4 m wide.
fn waves(n: u32) -> Mesh {
    let at = |i: u32| 4.0 * f64::from(i) / f64::from(n) - 2.0;
    let point = |i: u32, j: u32| {
        let (x, z) = (at(i), at(j));
        [
            x as f32,
            (0.1 * (3.0 * x).sin() * (2.0 * z).cos()) as f32,
            z as f32,
        ]
    };
    let index = |i: u32, j: u32| j * (n + 1) + i;
    let mut mesh = Mesh::default();
    for j in 0..=n {
        for i in 0..=n {
            mesh.positions.push(point(i, j));
            mesh.normals.push([0.0, 1.0, 0.0]);
        }
    }
    for j in 0..n {
        for i in 0..n {
            let [a, b, c, d] = [
                index(i, j),
                index(i + 1, j),
                index(i + 1, j + 1),
                index(i, j + 1),
            ];
            for vertices in [[a, c, b], [a, d, c]] {
                mesh.triangles.push(MeshTriangle {
                    vertices,
                    material: 0,
                });
            }
        }
    }
    mesh
}

/// Waves, a lamp over them, and `count` small copies of a 200-triangle mesh that can move.
fn scene(n: u32, count: usize) -> Scene {
    let lamp = Mesh {
        positions: vec![[-1.0, 3.0, -1.0], [1.0, 3.0, -1.0], [1.0, 3.0, 1.0]],
        normals: vec![[0.0, -1.0, 0.0]; 3],
        triangles: vec![MeshTriangle {
            vertices: [0, 1, 2],
            material: 1,
        }],
        ..Mesh::default()
    };
    let node = |mesh| Node {
        mesh: Some(mesh),
        ..Node::default()
    };
    let mut scene = Scene {
        nodes: vec![node(0), node(1)],
        meshes: vec![waves(n), lamp, waves(10)],
        materials: vec![
            Material::lambert("grey", [0.6; 3]),
            Material {
                emission: [5.0; 3],
                ..Material::lambert("lamp", [0.0; 3])
            },
        ],
        ..Scene::default()
    };
    for index in 0..count {
        scene.nodes.push(Node {
            parent_from_node: place(index, 0),
            ..node(2)
        });
    }
    scene.roots = (0..scene.nodes.len()).collect();
    scene
}

fn place(index: usize, frame: usize) -> DAffine3 {
    let angle = 2.4 * index as f64 + 0.05 * frame as f64;
    let radius = 0.02 * (index as f64).sqrt() + 0.2;
    DAffine3::from_scale_rotation_translation(
        DVec3::splat(0.02),
        DQuat::from_rotation_y(angle),
        DVec3::new(radius * angle.cos(), 0.4, radius * angle.sin()),
    )
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or_default()
}

fn ms(began: Instant) -> f64 {
    1e3 * began.elapsed().as_secs_f64()
}

/// Host milliseconds and bytes of a frame in which the first `moving` of the small copies move.
fn update(context: &GpuContext, scene: &Scene, moving: usize) -> Outcome<(f64, u64)> {
    let features = ShaderFeatures {
        emitters: true,
        ..ShaderFeatures::default()
    };
    let mut buffers = SceneBuffers::new(context, scene, &features)?;
    buffers.begin_frame(context, DVec3::ZERO)?;
    let mut times = Vec::new();
    for frame in 1..=60 {
        let began = Instant::now();
        for index in 0..moving {
            buffers.place_instance(InstanceId(2 + index as u32), place(index, frame));
        }
        buffers.begin_frame(context, DVec3::Y * 1e-3 * frame as f64)?;
        times.push(ms(began));
        context.queue.submit([]);
        context.wait("moving")?;
    }
    Ok((median(times), buffers.upload_bytes()))
}

fn views() -> [View; 2] {
    [-0.03, 0.03].map(|x| View {
        position_in_world: DVec3::new(x, 1.0, 2.0),
        orientation: DQuat::from_rotation_x(-0.4),
        fov: Fov::from_degrees(-30.0, 30.0, 30.0, -30.0),
    })
}

fn frame_ms(library: &ShaderLibrary, scenes: &[Scene]) -> Outcome<Vec<f64>> {
    let settings = RenderSettings {
        method: Method::Path,
        reuse: Reuse::Off,
        ..RenderSettings::default()
    };
    let mut renderers = Vec::new();
    for scene in scenes {
        let context = GpuContext::open(None)?;
        let size = [128, 128];
        renderers.push(Renderer::new(
            context,
            library,
            scene,
            &settings,
            Eyes::Both,
            size,
        )?);
    }
    let mut times = vec![Vec::new(); scenes.len()];
    for index in 0..9 {
        for (renderer, times) in renderers.iter_mut().zip(&mut times) {
            renderer.set_instance_transform(InstanceId(2), place(0, index as usize));
            let began = Instant::now();
            renderer.render_frame(&views(), index, |_| {})?;
            times.push(ms(began));
        }
    }
    Ok(times.into_iter().map(median).collect())
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
    let library = ShaderLibrary::embedded();
    if let Some(path) = std::env::args().nth(1) {
        let scene = Scene::load(path)?;
        let agrees = hits::check(&library, &scene, &views())?;
        if !agrees {
            eprintln!("moving: rays met something else than the exhaustive search");
            return Ok(ExitCode::FAILURE);
        }
        refits(&library, &scene)?;
        return Ok(ExitCode::SUCCESS);
    }
    let context = GpuContext::open(None)?;
    println!("{}\n", context.adapter.name);
    println!(
        "| scene | triangles | host ms of a frame with one moving object | bytes | full rebuild, ms |"
    );
    println!("|---|---|---|---|---|");
    for n in [130, 920] {
        let scene = scene(n, 1);
        let (host_ms, bytes) = update(&context, &scene, 1)?;
        let marks: Vec<MaterialMarks> = scene.materials.iter().map(MaterialMarks::from).collect();
        let mut times = Vec::new();
        for _ in 0..3 {
            let began = Instant::now();
            MeshHierarchies::build(&scene.meshes, &marks)?;
            times.push(ms(began));
        }
        let triangles = scene.triangle_count();
        let rebuild = median(times);
        println!("| waves {n} | {triangles} | {host_ms:.4} | {bytes} | {rebuild:.1} |");
    }
    println!(
        "\n| instances that all move | host ms | us per instance | bytes |\n|---|---|---|---|"
    );
    for count in [1, 10, 100, 1000, 10_000] {
        let (host_ms, bytes) = update(&context, &scene(130, count), count)?;
        println!(
            "| {count} | {host_ms:.4} | {:.3} | {bytes} |",
            1e3 * host_ms / count as f64
        );
    }
    let scenes = [scene(130, 1), scene(920, 1)];
    let times = frame_ms(&library, &scenes)?;
    println!("\n| triangles | frame ms, path, 1 spp, 128x128, both eyes |\n|---|---|");
    for (scene, time) in scenes.iter().zip(&times) {
        println!("| {} | {time:.1} |", scene.triangle_count());
    }
    println!("\nratio {:.2}", times[1] / times[0]);
    Ok(ExitCode::SUCCESS)
}
