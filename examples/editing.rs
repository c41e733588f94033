//! What edits of a scene that is shown cost the host: `cargo run --release --example editing -- SCENE`.
//!
//! Prints, for each kind of edit, milliseconds of the edit itself, of showing it (`Renderer::apply_scene`) and of preparing
//! the next frame, with the bytes that were uploaded; then what saving the scene takes. The frame itself is the GPU's.

use std::error::Error;
use std::time::Instant;

use glam::{DQuat, DVec3};
use stereolux::{
    Applied, Document, Edit, Eyes, Fov, GpuContext, NewContent, NewNode, Placement, RenderSettings,
    Renderer, ShaderLibrary, Trs, View,
};

/// Rounds of every edit; the median and the longest count.
const ROUNDS: usize = 15;

fn main() -> Result<(), Box<dyn Error>> {
    let spec = std::env::args().nth(1);
    let spec = spec.unwrap_or_else(|| "builtin:gallery".to_owned());
    stereolux::gpu::vulkan_interop::disable_device_select_layer();
    let mut document = Document::load(&spec)?;
    let scene = document.scene();
    let (instances, triangles) = (scene.instances().len(), scene.triangle_count());
    println!("{spec}: {instances} instances, {triangles} triangles");
    let mut settings = RenderSettings::default();
    settings.photon.count = 4096;
    let context = GpuContext::open(None)?;
    println!("on {}", context.adapter.name);
    let began = Instant::now();
    let mut renderer = Renderer::new(
        context,
        &ShaderLibrary::embedded(),
        scene,
        &settings,
        Eyes::Both,
        [64, 64],
    )?;
    println!("a new renderer: {:.0} ms", milliseconds(began));
    let head = scene.start_pose();
    let views = [-0.03, 0.03].map(|side| View {
        position_in_world: head.position + head.orientation * (DVec3::X * side),
        orientation: head.orientation,
        fov: Fov::from_degrees(-40.0, 40.0, 40.0, -40.0),
    });
    renderer.render_frame(&views, 0, |_| {})?;
    let placed = scene
        .instances()
        .first()
        .copied()
        .ok_or("nothing is placed")?;
    let (node, mesh) = (placed.node, placed.mesh);
    let used = scene.meshes[mesh].triangles[0].material as usize;
    println!(
        "edit             edit ms      shown ms  (longest)    next frame ms  bytes now  bytes next"
    );
    for kind in [
        "move",
        "turn",
        "colour",
        "hide",
        "duplicate",
        "own material",
    ] {
        let mut times = Vec::new();
        let mut bytes = [0; 2];
        for round in 0..ROUNDS {
            let edit = edit_of(kind, &document, node, mesh, used, round);
            let began = Instant::now();
            document.edit(edit)?;
            let edited = milliseconds(began);
            let began = Instant::now();
            let applied = renderer.apply_scene(document.scene())?;
            let shown = milliseconds(began);
            let Applied::InPlace(done) = applied else {
                println!("{kind}: {applied:?}");
                break;
            };
            let frame = renderer.render_frame(&views, round as u32 + 1, |_| {})?;
            bytes = [done.uploaded_bytes, renderer.scene().upload_bytes()];
            times.push([edited, shown, frame.cpu_ms.update]);
        }
        let median = |column: usize| {
            let mut sorted: Vec<f64> = times.iter().map(|row| row[column]).collect();
            sorted.sort_by(f64::total_cmp);
            sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
        };
        let longest = times.iter().map(|row| row[1]).fold(0.0, f64::max);
        let [now, next] = bytes;
        println!(
            "{kind:<14} {:>9.3} {:>13.3} {longest:>10.3} {:>16.3} {now:>10} {next:>11}",
            median(0),
            median(1),
            median(2),
        );
    }
    let began = Instant::now();
    let saved = document.to_glb()?;
    println!(
        "saved: {} bytes in {:.0} ms",
        saved.len(),
        milliseconds(began)
    );
    Ok(())
}

fn edit_of(
    kind: &str,
    document: &Document,
    node: usize,
    mesh: usize,
    material: usize,
    round: usize,
) -> Edit {
    let scene = document.scene();
    let share = round as f64 / ROUNDS as f64;
    let mut parts: Trs = scene.nodes[node].trs();
    match kind {
        "move" => {
            parts.translation.x += 0.01;
            let to = Placement::Parts(parts);
            Edit::Transform { node, to }
        }
        "turn" => {
            parts.rotation = DQuat::from_rotation_y(0.1) * parts.rotation;
            let to = Placement::Parts(parts);
            Edit::Transform { node, to }
        }
        "colour" => {
            let mut to = scene.materials[material].clone();
            to.base_color[0] = share as f32;
            let to = Box::new(to);
            Edit::Material { material, to }
        }
        "hide" => Edit::Visibility {
            node,
            is_hidden: round.is_multiple_of(2),
        },
        "own material" => {
            let used = scene.meshes[mesh].triangles[0].material as usize;
            Edit::OwnMaterial {
                mesh,
                material: used,
            }
        }
        _ => Edit::Add {
            parent: scene.nodes[node].parent,
            node: NewNode {
                name: "copy".to_owned(),
                to: Placement::Parts(parts),
                content: NewContent::Mesh(mesh),
            },
        },
    }
}

fn milliseconds(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}
