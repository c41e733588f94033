//! What the window draws itself while the renderer is at work, against what the renderer says that pixels see.

use stereolux::gpu::GpuContext;
use stereolux::scene::Scene;
use stereolux::scene::edit::Edit;
use stereolux::viewer::App;
use stereolux::viewer::frames::FrameReport;
use stereolux::viewer::sketch::{Sketcher, Stand, Wish};
use stereolux::xr::View;

use super::textures::bytes;
use super::viewer_support::{SIZE, cornell, node_of, shown};
use crate::suite::support::{adapter_name, pixel_ray};

/// Colour of the rim.
const RIM: [u8; 3] = [255, 170, 30];

fn left_eye(
    scene: &Scene,
    source: Option<(&FrameReport, &Stand)>,
    views: [View; 2],
    selected: Option<Vec<bool>>,
) -> Vec<[u8; 3]> {
    let gpu = GpuContext::open(Some(adapter_name())).unwrap();
    let wish = Wish {
        scene,
        scene_number: 0,
        source,
        views,
        size: SIZE,
        near_m: 1e-3,
        selected,
    };
    let [left, _] = Sketcher::new(&gpu).unwrap().draw(&gpu, &wish).unwrap();
    let bytes = bytes(&gpu, &left, 4);
    bytes
        .chunks_exact(4)
        .map(|texel| [texel[0], texel[1], texel[2]])
        .collect()
}

/// Share of the frame's pixels, of those `admits` names, whose colour the sketch has to within a few steps.
fn alike(
    app: &App,
    sketch: &[[u8; 3]],
    at: impl Fn(usize) -> Option<usize>,
    admits: impl Fn(usize) -> bool,
) -> f64 {
    let frame = &shown(app).shown.eyes[0].pixels;
    let is_alike = |pixel: usize| {
        let of_sketch = sketch[at(pixel)?];
        let of_frame = frame[pixel];
        let of_frame = [of_frame.r(), of_frame.g(), of_frame.b()];
        Some((0..3).all(|k| of_frame[k].abs_diff(of_sketch[k]) <= 6))
    };
    let pixels = (0..frame.len()).filter(|pixel| admits(*pixel));
    let pairs: Vec<bool> = pixels.filter_map(is_alike).collect();
    assert!(pairs.len() > 50, "{}", pairs.len());
    pairs.iter().filter(|is_alike| **is_alike).count() as f64 / pairs.len() as f64
}

#[test]
fn a_sketch_from_the_frames_own_place_is_the_frame() {
    let (_folder, viewer) = cornell("viewer-sketch-place");
    let app = viewer.state();
    let scene = app.document().scene();
    let (frame, stand) = (shown(app), Stand::of(scene));
    let sketch = left_eye(scene, Some((frame, &stand)), frame.views, None);
    // Pixels' centres meet texels' centres: what is seen is taken as it is. At silhouettes triangles may cover a centre
    // that a ray just missed.
    let same = alike(app, &sketch, Some, |_| true);
    assert!(same > 0.97, "{same}");
    // Without a frame, the walls are shaded: another picture.
    let shaded = left_eye(scene, None, frame.views, None);
    let same = alike(app, &shaded, Some, |_| true);
    assert!(same < 0.3, "{same}");
    let dark = shaded.iter().filter(|pixel| **pixel == [0; 3]).count();
    assert!(dark < shaded.len() / 100, "{dark}");
}

#[test]
fn a_sketch_follows_the_head_and_a_dragged_object_takes_its_light_along() {
    let (_folder, viewer) = cornell("viewer-sketch-head");
    let app = viewer.state();
    let scene = app.document().scene();
    let (frame, stand) = (shown(app), Stand::of(scene));
    // An eye that has gone sideways sees each surface elsewhere, where geometry says.
    let mut views = frame.views;
    for view in &mut views {
        view.position_in_world.x += 0.15;
    }
    let [width, height] = SIZE;
    let at = |pixel: usize| {
        let distance_m = f64::from(frame.seen[0].distances_m[pixel]);
        let ray = pixel_ray(&frame.views[0], pixel, SIZE);
        let in_world = ray.origin + ray.direction * distance_m;
        let (x, y) = views[0].pixel_from_point_in_world(in_world, width, height)?;
        Some(y as usize * width as usize + x as usize)
    };
    let wall = node_of(scene, "back wall") as u32;
    let on_wall = |pixel: usize| frame.seen[0].nodes[pixel] == wall;
    let sketch = left_eye(scene, Some((frame, &stand)), views, None);
    // Half a pixel off, a smooth wall changes little; what is hidden now is not counted against it by much.
    let moved = alike(app, &sketch, at, on_wall);
    let stayed = alike(app, &sketch, Some, |_| true);
    assert!(moved > 0.6 && moved > stayed + 0.1, "{moved} {stayed}");

    // The short block, lifted: it is where it went, in the light that it had, with a rim around it.
    let mut lifted = scene.clone();
    let node = node_of(scene, "short block");
    let mut parent_from_node = lifted.nodes[node].parent_from_node;
    parent_from_node.translation.y += 0.3;
    let lift = Edit::place(node, parent_from_node);
    lift.apply(&mut lifted).unwrap();
    let selected = (0..lifted.nodes.len()).map(|other| other == node).collect();
    let sketch = left_eye(&lifted, Some((frame, &stand)), frame.views, Some(selected));
    let is_rim: Vec<usize> = (0..sketch.len()).filter(|i| sketch[*i] == RIM).collect();
    let rows = |pixels: &[usize]| {
        let sum: usize = pixels.iter().map(|pixel| pixel / width as usize).sum();
        sum as f64 / pixels.len() as f64
    };
    let is_block = |pixel: &usize| frame.seen[0].nodes[*pixel] == node as u32;
    let of_block: Vec<usize> = (0..sketch.len()).filter(is_block).collect();
    assert!(is_rim.len() > 10, "{}", is_rim.len());
    let (rim, block) = (rows(&is_rim), rows(&of_block));
    assert!(rim < block - 3.0, "{rim} {block}");
}

#[test]
fn a_new_colour_is_seen_before_any_frame() {
    let (_folder, viewer) = cornell("viewer-sketch-colour");
    let app = viewer.state();
    let scene = app.document().scene();
    let (frame, stand) = (shown(app), Stand::of(scene));
    let node = node_of(scene, "back wall");
    let material = scene.meshes[scene.nodes[node].mesh.unwrap()].triangles[0].material as usize;
    let mut painted = scene.clone();
    painted.materials[material].base_color[0] *= 0.25;
    let before = left_eye(scene, Some((frame, &stand)), frame.views, None);
    let after = left_eye(&painted, Some((frame, &stand)), frame.views, None);
    // A quarter of the light is 0.25^(1 / 2.2) of the display value.
    let expected = 0.25_f64.powf(1.0 / 2.2);
    let on_wall = (0..before.len())
        .filter(|pixel| frame.seen[0].nodes[*pixel] == node as u32 && before[*pixel][0] > 60);
    let ratio = |pixel: usize| f64::from(after[pixel][0]) / f64::from(before[pixel][0]);
    let ratios: Vec<f64> = on_wall.map(ratio).collect();
    let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
    assert!((mean - expected).abs() < 0.03, "{mean} {expected}");
}
