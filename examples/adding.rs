//! What a scene that is added while frames are shown costs them: `cargo run --release --example adding -- [SCENE] [RINGS] [SIZE]`.
//!
//! A ball of 4 RINGS^2 triangles (default 154: 94,864) is prepared on a thread, shown, and taken out again, a few times. Prints
//! milliseconds of frames in between, of those that came with a change, and of the host's part in it.

use std::error::Error;
use std::time::Instant;

use glam::{DAffine3, DVec3};
use stereolux::{
    Applied, Eyes, Fov, GpuContext, Material, Mesh, Node, Placement, RenderSettings, Renderer,
    Scene, ScenePart, ShaderLibrary, View,
};

/// Times that it comes and goes.
const ROUNDS: usize = 5;
/// Frames between two changes.
const FRAMES: u32 = 12;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let spec = arguments.next().unwrap_or_else(|| "cornell".to_owned());
    let rings = arguments.next().map_or(Ok(154), |text| text.parse())?;
    let size: u32 = arguments.next().map_or(Ok(128), |text| text.parse())?;
    stereolux::gpu::vulkan_interop::disable_device_select_layer();
    let mut scene = Scene::builtin(&spec)?;
    let mut settings = RenderSettings::default();
    settings.photon.count = 16_384;
    let context = GpuContext::open(None)?;
    println!("on {}", context.adapter.name);
    let library = ShaderLibrary::embedded();
    let eyes = Eyes::Both;
    let mut renderer = Renderer::new(context, &library, &scene, &settings, eyes, [size, size])?;
    let head = scene.start_pose();
    let views = [-0.03, 0.03].map(|side| View {
        position_in_world: head.position + head.orientation * (DVec3::X * side),
        orientation: head.orientation,
        fov: Fov::from_degrees(-40.0, 40.0, 40.0, -40.0),
    });
    let middle = scene.bounds_in_world().ok_or("nothing is placed")?.center();
    let to = DAffine3::from_scale_rotation_translation(DVec3::splat(0.2), head.orientation, middle);
    let part = ball(rings, 0.0);
    println!(
        "{spec}: {} triangles, {} more",
        scene.triangle_count(),
        part.triangle_count()
    );
    let preparation = renderer.part_preparation();
    let mut frame = 0;
    // Milliseconds of `FRAMES` frames; the first one shows the change that is made with it.
    let mut show = |renderer: &mut Renderer| -> Result<Vec<f64>, Box<dyn Error>> {
        (0..FRAMES)
            .map(|_| {
                let began = Instant::now();
                frame += 1;
                renderer.render_frame(&views, frame, |_| {})?;
                Ok(milliseconds(began))
            })
            .collect()
    };
    show(&mut renderer)?;
    println!(
        "round  without     with  longest while preparing  preparing  adding  its frame  removing  its frame"
    );
    for round in 0..ROUNDS {
        let without = show(&mut renderer)?;
        let own = part.clone();
        let thread = std::thread::spawn(move || {
            let began = Instant::now();
            let prepared = preparation.prepare(&own);
            prepared.map(|prepared| (own, prepared, milliseconds(began)))
        });
        let meanwhile = show(&mut renderer)?;
        let joined = thread
            .join()
            .map_err(|_| "the thread that prepares fell over")?;
        let (own, prepared, preparing) = joined?;
        let began = Instant::now();
        let added: ScenePart = scene.add_part(own, "ball", None, Placement::of(to))?;
        shown(renderer.add_part(&scene, &added, &prepared)?)?;
        let adding = milliseconds(began);
        let with = show(&mut renderer)?;
        let began = Instant::now();
        scene.remove_part(&added)?;
        shown(renderer.remove_part(&scene, &added)?)?;
        let removing = milliseconds(began);
        let after = show(&mut renderer)?;
        let longest = meanwhile.iter().copied().fold(0.0, f64::max);
        println!(
            "{round:>5} {:>8.1} {:>8.1} {longest:>24.1} {preparing:>10.1} {adding:>7.1} {:>10.1} {removing:>9.1} {:>10.1}",
            median(&without),
            median(&with[1..]),
            with[0],
            after[0],
        );
    }
    Ok(())
}

fn shown(applied: Applied) -> Result<(), String> {
    match applied {
        Applied::InPlace(_) => Ok(()),
        Applied::NeedsRebuild { why } => Err(why),
    }
}

fn milliseconds(began: Instant) -> f64 {
    began.elapsed().as_secs_f64() * 1e3
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}

/// A ball of radius 1 and `4 rings^2` triangles, of one material.
pub fn ball(rings: u32, emission: f32) -> Scene {
    let angle = |step: u32| f64::from(step) * std::f64::consts::PI / f64::from(rings);
    let around = 2 * rings + 1;
    let points: Vec<[f32; 3]> = (0..=rings)
        .flat_map(|ring| (0..around).map(move |along| (angle(ring), angle(along))))
        .map(|(polar, turn)| {
            let (level, side) = (polar.cos(), polar.sin());
            DVec3::new(side * turn.cos(), level, side * turn.sin())
                .as_vec3()
                .to_array()
        })
        .collect();
    let quads = (0..rings).flat_map(|ring| (0..2 * rings).map(move |along| ring * around + along));
    let triangles = quads.flat_map(|a| {
        let [b, c, d] = [a + 1, a + around, a + around + 1];
        [[a, b, c], [b, d, c]]
    });
    let name = || "ball".to_owned();
    Scene {
        nodes: vec![Node {
            name: name(),
            ..Node::of_mesh(0)
        }],
        roots: vec![0],
        meshes: vec![Mesh {
            name: name(),
            ..Mesh::plain(points.clone(), points, triangles, 0)
        }],
        materials: vec![Material {
            name: name(),
            base_color: [0.2, 0.7, 0.4, 1.0],
            metallic: 0.0,
            specular: 0.0,
            emission: [emission; 3],
            ..Material::default()
        }],
        ..Scene::default()
    }
}
