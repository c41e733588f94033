//! The viewer without its window: egui's harness presses keys and buttons, and what comes of it is read from the state and
//! from the pixels that the rendering thread sends.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use egui::{Key, Modifiers, PointerButton, Pos2, Vec2, vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use glam::DVec3;
use stereolux::images::{ImageRgb, aces_filmic, read_image, srgb_encode, write_exr};
use stereolux::options::layers::Layers;
use stereolux::options::{Method, Settings};
use stereolux::renderer::{Eye, Inspection};
use stereolux::scene::Scene;
use stereolux::scene::edit::Document;
use stereolux::viewer::frames::{FrameReport, Look};
use stereolux::viewer::layout::{Layout, Part};
use stereolux::viewer::memory::Memory;
use stereolux::viewer::{App, Start};
use stereolux::xr::Headset;

use crate::suite::support::{Folder, renderer, stereolux};

type Viewer = Harness<'static, App>;

/// Long enough for a loaded machine; reached only by a fault.
const PATIENCE: Duration = Duration::from_secs(180);
/// Pixels per eye.
const SIZE: [u32; 2] = [64, 64];

/// A headset that the scenes fill.
fn narrow() -> Headset {
    let headset = Headset::load("symmetric").unwrap();
    headset.with_fov(-21.0, 21.0, 21.0, -21.0).unwrap()
}

fn open(scene: &str, folder: &Folder, change: impl FnOnce(&mut Settings)) -> Viewer {
    let mut settings = Settings {
        scene: scene.to_owned(),
        size: Some(SIZE),
        adapter: crate::suite::support::adapter_name().to_owned(),
        ..Settings::default()
    };
    settings.photon.count = 4096;
    change(&mut settings);
    let start = Start {
        document: Document::load(scene).unwrap(),
        settings,
        headset: narrow(),
        recording: None,
        out: folder.path().to_owned(),
        memory: Memory {
            layout: Layout::SideBySide,
            ..Memory::default()
        },
    };
    let app = App::new(start, || {}).unwrap();
    let mut viewer = Harness::builder()
        .with_size(vec2(1280.0, 800.0))
        .with_max_steps(8)
        .build_ui_state(|ui, app: &mut App| app.ui(ui), app);
    until(&mut viewer, "a full frame", App::is_up_to_date);
    viewer
}

/// Lets the viewer run until `done`.
fn until(viewer: &mut Viewer, what: &str, done: impl Fn(&App) -> bool) {
    let began = Instant::now();
    loop {
        viewer.step();
        if done(viewer.state()) {
            return;
        }
        let said: Vec<&str> = viewer
            .state()
            .messages()
            .iter()
            .map(|message| message.text.as_str())
            .collect();
        assert!(
            began.elapsed() < PATIENCE,
            "{what}: waited in vain; {said:?}"
        );
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn shown(app: &App) -> &FrameReport {
    app.frame().unwrap()
}

/// Waits for a full frame of what has been asked for.
fn settle(viewer: &mut Viewer) {
    // What was just pressed is answered by the next pass.
    viewer.step();
    until(viewer, "a new full frame", App::is_up_to_date);
}

/// Middle of the pixels of the left eye that see `node`, and where that is in the window.
fn place_of(app: &App, name: &str) -> Pos2 {
    let scene = app.document().scene();
    let node = node_of(scene, name) as u32;
    let seen = &shown(app).seen[0];
    let pixels: Vec<usize> = (0..seen.nodes.len())
        .filter(|pixel| seen.nodes[*pixel] == node)
        .collect();
    assert!(pixels.len() > 10, "{name} is hardly seen");
    // One of them, for the middle of a hollow shape lies outside it.
    let pixel = pixels[pixels.len() / 2];
    let [x, y] = [pixel as u32 % seen.size[0], pixel as u32 / seen.size[0]];
    let (part, rect) = app.shown_at()[0];
    assert_eq!(part, Part::Left);
    let place = vec2(x as f32 + 0.5, y as f32 + 0.5) / vec2(SIZE[0] as f32, SIZE[1] as f32);
    rect.min + place * rect.size()
}

fn node_of(scene: &Scene, name: &str) -> usize {
    let found = scene.nodes.iter().position(|node| node.name == name);
    found.unwrap_or_else(|| panic!("no node {name}"))
}

fn click_at(viewer: &mut Viewer, at: Pos2) {
    viewer.hover_at(at);
    viewer.step();
    for pressed in [true, false] {
        viewer.event(egui::Event::PointerButton {
            pos: at,
            button: PointerButton::Primary,
            pressed,
            modifiers: Modifiers::NONE,
        });
        viewer.step();
    }
}

fn drag(viewer: &mut Viewer, from: Pos2, by: Vec2) {
    viewer.hover_at(from);
    viewer.step();
    viewer.step();
    let button = |pos, pressed| egui::Event::PointerButton {
        pos,
        button: PointerButton::Primary,
        pressed,
        modifiers: Modifiers::NONE,
    };
    viewer.event(button(from, true));
    viewer.step();
    const STEPS: u32 = 6;
    for step in 1..=STEPS {
        viewer.event(egui::Event::PointerMoved(
            from + by * (step as f32 / STEPS as f32),
        ));
        viewer.step();
    }
    viewer.event(button(from + by, false));
    viewer.step();
}

fn press(viewer: &mut Viewer, modifiers: Modifiers, key: Key) {
    viewer.key_press_modifiers(modifiers, key);
    viewer.step();
}

/// Share of pixels that differ.
fn changed(a: &FrameReport, b: &[egui::Color32]) -> f64 {
    let pixels = &a.eyes[0].pixels;
    assert_eq!(pixels.len(), b.len());
    let differing = pixels.iter().zip(b).filter(|(a, b)| a != b).count();
    differing as f64 / b.len() as f64
}

fn errors(app: &App) -> Vec<&str> {
    app.messages()
        .iter()
        .filter(|message| message.is_error)
        .map(|message| message.text.as_str())
        .collect()
}

fn path_tracing(settings: &mut Settings) {
    settings.method = Method::Path;
    settings.path.max_depth = 3;
}

#[test]
fn keys_and_mouse_walk_and_look_and_the_picture_follows() {
    let folder = Folder::new("viewer-walk");
    let mut viewer = open("builtin:cornell", &folder, path_tracing);
    let before = shown(viewer.state()).eyes[0].pixels.clone();
    let start = viewer.state().head();
    viewer.key_down(Key::W);
    viewer.step();
    for _ in 0..10 {
        viewer.step();
    }
    viewer.key_up(Key::W);
    viewer.step();
    let walked = viewer.state().head();
    let ahead = start.orientation * DVec3::NEG_Z;
    let way = walked.position - start.position;
    assert!(way.dot(ahead) > 0.01, "{way}");
    // Straight ahead, to rounding.
    assert!(
        way.cross(ahead).length() < 1e-9 * way.length().max(1.0),
        "{way}"
    );
    let left_eye = narrow().views_from_head(&walked)[0];
    settle(&mut viewer);
    assert_eq!(shown(viewer.state()).views[0], left_eye);
    let moved = changed(shown(viewer.state()), &before);
    assert!(moved > 0.3, "{moved}");
    // The key is up: the head stands still.
    viewer.step();
    assert_eq!(viewer.state().head(), walked);

    // A drag turns the head and selects nothing.
    let rect = viewer.state().shown_at()[0].1;
    drag(&mut viewer, rect.center(), vec2(40.0, 0.0));
    assert_eq!(viewer.state().selected(), None);
    let turned = viewer.state().head();
    assert_eq!(turned.position, walked.position);
    // To the right by 40 points, of which 800 are half a turn; the drag counts from where egui sees it as one.
    let turn = (turned.heading_rad() - walked.heading_rad()) / std::f64::consts::PI * 800.0;
    assert!((-40.0..-25.0).contains(&turn), "{turn}");
    press(&mut viewer, Modifiers::NONE, Key::Home);
    assert_eq!(viewer.state().head(), start);
    assert!(
        errors(viewer.state()).is_empty(),
        "{:?}",
        errors(viewer.state())
    );
}

#[test]
fn a_click_selects_the_object_under_the_pixel_and_its_colour_changes_and_comes_back() {
    let folder = Folder::new("viewer-colour");
    let mut viewer = open("builtin:cornell", &folder, path_tracing);
    for name in ["tall block", "short block", "back wall"] {
        let at = place_of(viewer.state(), name);
        click_at(&mut viewer, at);
        let node = node_of(viewer.state().document().scene(), name);
        assert_eq!(viewer.state().selected(), Some(node), "{name}");
    }
    let at = place_of(viewer.state(), "left wall");
    click_at(&mut viewer, at);
    viewer.step();
    let scene = viewer.state().document().scene();
    let mesh = scene.nodes[node_of(scene, "left wall")].mesh.unwrap();
    let material = scene.meshes[mesh].triangles[0].material as usize;
    let from = scene.materials[material].clone();
    let before = shown(viewer.state()).eyes[0].pixels.clone();

    // The third number of the base colour, typed.
    let row = viewer.get_by_label("Base colour").rect();
    let blue = viewer
        .get_all_by_role(egui::accesskit::Role::SpinButton)
        .filter(|field| (field.rect().center().y - row.center().y).abs() < 8.0)
        .max_by(|a, b| a.rect().min.x.total_cmp(&b.rect().min.x))
        .unwrap()
        .rect()
        .center();
    click_at(&mut viewer, blue);
    viewer.step();
    press(&mut viewer, Modifiers::COMMAND, Key::A);
    viewer.event(egui::Event::Text("0.9".to_owned()));
    viewer.step();
    press(&mut viewer, Modifiers::NONE, Key::Enter);
    viewer.step();
    let to = &viewer.state().document().scene().materials[material];
    assert_eq!(to.base_color[2], 0.9);
    assert_eq!(to.base_color[..2], from.base_color[..2]);
    assert_eq!(to.roughness, from.roughness);
    assert!(viewer.state().document().undo_label().is_some());
    settle(&mut viewer);
    // The red wall has become violet where it is seen.
    let node = node_of(viewer.state().document().scene(), "left wall") as u32;
    let blue_of = |pixels: &[egui::Color32], frame: &FrameReport| {
        let wall = frame.seen[0].nodes.iter().zip(pixels);
        let of_wall: Vec<f64> = wall
            .filter(|(seen, _)| **seen == node)
            .map(|(_, pixel)| f64::from(pixel.b()))
            .collect();
        of_wall.iter().sum::<f64>() / of_wall.len() as f64
    };
    let frame = shown(viewer.state());
    let [was, is] = [
        blue_of(&before, frame),
        blue_of(&frame.eyes[0].pixels, frame),
    ];
    assert!(is > was + 20.0, "{was} {is}");

    press(&mut viewer, Modifiers::COMMAND, Key::Z);
    assert_eq!(viewer.state().document().scene().materials[material], from);
    settle(&mut viewer);
    let frame = shown(viewer.state());
    let back = blue_of(&frame.eyes[0].pixels, frame);
    // Noise of two means of path traced frames, far under the step above.
    assert!((back - was).abs() < 10.0, "{was} {back}");
    press(&mut viewer, Modifiers::COMMAND | Modifiers::SHIFT, Key::Z);
    assert_eq!(
        viewer.state().document().scene().materials[material].base_color[2],
        0.9
    );
    assert!(
        errors(viewer.state()).is_empty(),
        "{:?}",
        errors(viewer.state())
    );
}

#[test]
fn a_handle_moves_the_object_as_one_step_that_undo_takes_back() {
    let folder = Folder::new("viewer-handle");
    let mut viewer = open("builtin:cornell", &folder, path_tracing);
    let at = place_of(viewer.state(), "tall block");
    click_at(&mut viewer, at);
    viewer.step();
    viewer.step();
    let scene = viewer.state().document().scene();
    let node = node_of(scene, "tall block");
    let from = scene.nodes[node].clone();
    let before = shown(viewer.state()).eyes[0].pixels.clone();
    let [x_handle, ..] = viewer.state().gizmo_handles().expect("handles");
    drag(&mut viewer, x_handle, vec2(40.0, 0.0));
    let to = viewer.state().document().scene().nodes[node].clone();
    let way = to.parent_from_node.translation - from.parent_from_node.translation;
    assert!(way.x > 0.02 && way.x < 1.0, "{way}");
    // Along the arrow alone.
    assert!(way.y.abs() < 1e-9 && way.z.abs() < 1e-9, "{way}");
    assert_eq!(to.parent_from_node.matrix3, from.parent_from_node.matrix3);
    let history = viewer.state().document().history().count();
    assert_eq!(history, 1, "a drag is one step");
    settle(&mut viewer);
    assert!(changed(shown(viewer.state()), &before) > 0.05);
    // The surface moved with it: the click finds it at its new place.
    let there = place_of(viewer.state(), "tall block");
    assert!(there.x > at.x, "{there} {at}");
    press(&mut viewer, Modifiers::COMMAND, Key::Z);
    assert_eq!(viewer.state().document().scene().nodes[node], from);
    assert!(!viewer.state().document().is_modified());
    assert!(
        errors(viewer.state()).is_empty(),
        "{:?}",
        errors(viewer.state())
    );
}

#[test]
fn every_layout_and_every_view_shows_something_of_its_own() {
    let folder = Folder::new("viewer-looks");
    // Glass and a lamp: every intermediate result has something to show.
    let mut viewer = open("builtin:caustic", &folder, |_| ());
    for layout in Layout::ALL {
        let now = viewer.state().layout().name();
        choose(&mut viewer, now, layout.name());
        assert_eq!(viewer.state().layout(), layout);
        viewer.step();
        let parts: Vec<Part> = viewer
            .state()
            .shown_at()
            .iter()
            .map(|(part, _)| *part)
            .collect();
        assert_eq!(parts, layout.parts());
    }
    until(&mut viewer, "the other method's picture", |app| {
        shown(app).other.is_some()
    });
    assert_eq!(viewer.state().other_settings().method, Method::Path);
    choose(&mut viewer, Layout::Split.name(), Layout::SideBySide.name());
    let mut pictures: Vec<(Look, Arc<egui::ColorImage>)> = Vec::new();
    for look in Look::all() {
        if look != viewer.state().look() {
            let now = viewer.state().look().name();
            choose(&mut viewer, &now, &look.name());
        }
        assert_eq!(viewer.state().look(), look);
        settle(&mut viewer);
        if look != Look::Picture {
            // The error's reference and the variance begin with later frames.
            until(&mut viewer, "a legend", |app| shown(app).legend.is_some());
        }
        let frame = shown(viewer.state());
        // Provenance is the right eye's.
        let eye = usize::from(look == Look::Inspection(Inspection::Provenance));
        let picture = Arc::clone(&frame.eyes[eye]);
        let first = picture.pixels[0];
        // Nothing moves.
        let is_flat = look == Look::Inspection(Inspection::Motion);
        let is_one_colour = picture.pixels.iter().all(|pixel| *pixel == first);
        assert_eq!(is_one_colour, is_flat, "{look:?}");
        for (other, drawn) in &pictures {
            assert_ne!(drawn.pixels, picture.pixels, "{look:?} and {other:?}");
        }
        pictures.push((look, picture));
    }
    assert!(
        errors(viewer.state()).is_empty(),
        "{:?}",
        errors(viewer.state())
    );
}

/// Picks `wanted` in the box that shows `now`.
fn choose(viewer: &mut Viewer, now: &str, wanted: &str) {
    if now == wanted {
        return;
    }
    viewer
        .get_by(|node| {
            node.role() == egui::accesskit::Role::ComboBox && node.value().as_deref() == Some(now)
        })
        .click();
    viewer.step();
    viewer.step();
    let button = viewer
        .get_all_by_label(wanted)
        .last()
        .unwrap_or_else(|| panic!("{wanted} is not offered"));
    button.scroll_to_me();
    button.click();
    viewer.step();
    viewer.step();
}

/// The mean over `frames` frames that ended with `last`, as `render` would make it from files.
fn rendered(settings: &Path, scene: &Path, viewer: &App, last: u32, frames: u32) -> Vec<[f64; 3]> {
    let mut layers = Layers::default();
    layers.add_file(settings).unwrap();
    let settings = layers.finish().unwrap();
    let scene = Scene::load(scene).unwrap();
    let mut renderer = renderer(&scene, &settings, settings.size.unwrap());
    let views = shown(viewer).views;
    let mut sum = vec![[0.0; 3]; (SIZE[0] * SIZE[1]) as usize];
    for index in last + 1 - frames..=last {
        renderer.render_frame(&views, index, |_| ()).unwrap();
        let image = renderer.read_radiance(Eye::Left).unwrap().unwrap();
        for (sum, pixel) in sum.iter_mut().zip(image) {
            for (sum, channel) in sum.iter_mut().zip(pixel) {
                *sum += f64::from(channel);
            }
        }
    }
    sum.iter()
        .map(|sum| sum.map(|channel| channel / f64::from(frames)))
        .collect()
}

#[test]
fn what_is_saved_renders_to_the_picture_that_was_shown() {
    let folder = Folder::new("viewer-save");
    let mut viewer = open("builtin:cornell", &folder, path_tracing);
    let at = place_of(viewer.state(), "short block");
    click_at(&mut viewer, at);
    viewer.step();
    viewer.step();
    let [x_handle, ..] = viewer.state().gizmo_handles().unwrap();
    drag(&mut viewer, x_handle, vec2(-30.0, 0.0));
    viewer.get_by_label("Delete Del").scroll_to_me();
    viewer.get_by_label("Add child with light").click();
    viewer.step();
    viewer.step();
    settle(&mut viewer);
    press(&mut viewer, Modifiers::COMMAND, Key::S);
    assert!(!viewer.state().document().is_modified());
    viewer.get_by_label("Settings").click();
    viewer.step();
    viewer.get_by_label("Save as TOML").click();
    viewer.step();
    assert!(
        errors(viewer.state()).is_empty(),
        "{:?}",
        errors(viewer.state())
    );
    let (settings, scene) = (
        folder.join("settings.toml"),
        folder.join("cornell_edited.glb"),
    );
    let frame = shown(viewer.state());
    let (last, frames) = (frame.index, frame.frames);
    let pixels = frame.eyes[0].pixels.clone();
    let again = rendered(&settings, &scene, viewer.state(), last, frames);
    let byte = |linear: f64| (srgb_encode(aces_filmic(linear as f32)) * 255.0).round() as u8;
    let differing = again
        .iter()
        .zip(&pixels)
        .filter(|(mean, shown)| mean.map(byte) != [shown.r(), shown.g(), shown.b()])
        .count();
    // The same frames of the same scene: equal to the last byte. Records of an edited scene keep the order of a scene that
    // was just read, so not even rounding differs.
    assert_eq!(differing, 0);
    // The comparison would notice the lamp that was added.
    let plain = Folder::new("viewer-save-plain");
    let unedited = plain.join("plain.glb");
    let mut document = Document::load("builtin:cornell").unwrap();
    document.save(&unedited).unwrap();
    let other = rendered(&settings, &unedited, viewer.state(), last, frames);
    let differing = other
        .iter()
        .zip(&pixels)
        .filter(|(mean, shown)| mean.map(byte) != [shown.r(), shown.g(), shown.b()])
        .count();
    assert!(differing > pixels.len() / 4, "{differing}");
    // The command takes them too.
    let out = folder.join("rendered");
    let output = stereolux(&[
        "render",
        "--config",
        settings.to_str().unwrap(),
        "--scene",
        scene.to_str().unwrap(),
        "--out",
        out.to_str().unwrap(),
    ]);
    assert!(output.status.success(), "{output:?}");
}

#[test]
fn a_screenshot_is_the_mean_of_both_eyes() {
    let folder = Folder::new("viewer-screenshot");
    let mut viewer = open("builtin:cornell", &folder, path_tracing);
    press(&mut viewer, Modifiers::NONE, Key::T);
    let png = folder.join("view_0000.png");
    until(&mut viewer, "a screenshot", |app| {
        png.exists()
            && app
                .messages()
                .iter()
                .any(|m| m.text.contains("view_0000.png"))
    });
    let picture = read_image(&png).unwrap();
    assert_eq!([picture.width, picture.height], [2 * SIZE[0], SIZE[1]]);
    for (eye, first) in [("left", 0), ("right", SIZE[0])] {
        let image = read_image(&folder.join(&format!("view_0000_{eye}.exr"))).unwrap();
        assert_eq!([image.width, image.height], SIZE);
        for y in 0..SIZE[1] {
            for x in 0..SIZE[0] {
                let linear = image.get(x, y).unwrap();
                let shown = picture.get(first + x, y).unwrap();
                for (linear, shown) in linear.into_iter().zip(shown) {
                    // read_image decodes sRGB: half a step of 8 bits in display light.
                    let off = (srgb_encode(aces_filmic(linear)) - srgb_encode(shown)).abs();
                    assert!(off <= 0.5 / 255.0 + 1e-5, "{eye} {x} {y}: {linear} {shown}");
                }
            }
        }
    }
    // The next one has the next number.
    press(&mut viewer, Modifiers::NONE, Key::F12);
    until(&mut viewer, "another", |_| {
        folder.join("view_0001.png").exists()
    });
}

#[derive(Debug)]
struct Dropped(PathBuf);

impl egui::DroppedFile for Dropped {
    fn path(&self) -> &Path {
        &self.0
    }

    fn bytes(&self) -> Result<Vec<u8>, String> {
        std::fs::read(&self.0).map_err(|error| error.to_string())
    }
}

fn drop_file(viewer: &mut Viewer, path: &Path) {
    let file: egui::DroppedFileHandle = Arc::new(Dropped(path.to_owned()));
    viewer.input_mut().dropped_files.push(file);
    viewer.step();
}

#[test]
fn a_broken_file_is_refused_and_a_good_one_opens() {
    let folder = Folder::new("viewer-drop");
    let mut viewer = open("builtin:cornell", &folder, path_tracing);
    let broken = folder.join("broken.glb");
    std::fs::write(&broken, b"glTF\x02\0\0\0 this is no scene").unwrap();
    for (path, says) in [
        (broken.clone(), "broken.glb"),
        (folder.join("missing.gltf"), "missing.gltf"),
        (folder.join("notes.doc"), "is no scene"),
    ] {
        drop_file(&mut viewer, &path);
        until(&mut viewer, "an error", |app| {
            errors(app).iter().any(|e| e.contains(says))
        });
    }
    assert_eq!(viewer.state().document().scene().name, "builtin:cornell");
    assert_eq!(shown(viewer.state()).seen[0].size, SIZE);
    settle(&mut viewer);

    let good = folder.join("gallery.glb");
    Document::load("builtin:gallery")
        .unwrap()
        .save(&good)
        .unwrap();
    drop_file(&mut viewer, &good);
    until(&mut viewer, "the scene", |app| {
        app.document().scene().name != "builtin:cornell"
    });
    assert_eq!(viewer.state().settings().scene, good.to_string_lossy());
    settle(&mut viewer);
    // Every node that is seen is the new scene's.
    let nodes = viewer.state().document().scene().nodes.len() as u32;
    let seen = &shown(viewer.state()).seen[0];
    assert!(
        seen.nodes
            .iter()
            .all(|node| *node < nodes || *node == u32::MAX)
    );
    assert!(seen.nodes.iter().any(|node| *node != u32::MAX));
}

#[test]
fn an_environment_is_dropped_made_stronger_and_a_broken_one_is_refused() {
    let folder = Folder::new("viewer-environment");
    let mut viewer = open("builtin:cornell", &folder, path_tracing);
    let corner = |app: &App| shown(app).eyes[0].pixels[0];
    assert_eq!(corner(viewer.state()), egui::Color32::BLACK);
    let sky = folder.join("sky.exr");
    write_exr(&sky, &ImageRgb::filled(8, 4, [0.2; 3]).unwrap()).unwrap();
    drop_file(&mut viewer, &sky);
    until(&mut viewer, "the sky", |app| {
        app.is_up_to_date() && corner(app) != egui::Color32::BLACK
    });
    let byte = |linear: f32| (srgb_encode(aces_filmic(linear)) * 255.0).round() as u8;
    assert_eq!(corner(viewer.state()).r(), byte(0.2));
    let path = sky.to_string_lossy();
    assert_eq!(viewer.state().settings().environment.path, path);

    viewer.get_by_label("Settings").click();
    viewer.step();
    viewer.step();
    let search = viewer
        .get_all_by_role(egui::accesskit::Role::TextInput)
        .filter(|field| field.rect().min.x > 800.0)
        .min_by(|a, b| a.rect().min.y.total_cmp(&b.rect().min.y))
        .unwrap()
        .rect()
        .center();
    click_at(&mut viewer, search);
    viewer.event(egui::Event::Text("environment.strength".to_owned()));
    viewer.step();
    viewer.step();
    let strength = viewer
        .get_all_by_role(egui::accesskit::Role::SpinButton)
        .find(|field| field.rect().min.x > 800.0)
        .unwrap()
        .rect()
        .center();
    click_at(&mut viewer, strength);
    viewer.step();
    press(&mut viewer, Modifiers::COMMAND, Key::A);
    viewer.event(egui::Event::Text("2".to_owned()));
    viewer.step();
    press(&mut viewer, Modifiers::NONE, Key::Enter);
    until(&mut viewer, "a stronger sky", |app| {
        app.is_up_to_date() && corner(app).r() == byte(0.4)
    });
    assert_eq!(viewer.state().settings().environment.strength, 2.0);

    let broken = folder.join("broken.hdr");
    std::fs::write(&broken, b"#?RADIANCE\nno map").unwrap();
    drop_file(&mut viewer, &broken);
    until(&mut viewer, "an error", |app| {
        errors(app).iter().any(|error| error.contains("broken.hdr"))
    });
    assert_eq!(viewer.state().settings().environment.path, path);
    settle(&mut viewer);
    assert_eq!(corner(viewer.state()).r(), byte(0.4));
}

#[test]
fn nodes_are_found_hidden_deleted_and_brought_back() {
    let folder = Folder::new("viewer-nodes");
    let mut viewer = open("builtin:cornell", &folder, path_tracing);
    let count = |app: &App, name: &str| {
        let node = node_of(app.document().scene(), name) as u32;
        let seen = &shown(app).seen[0];
        seen.nodes.iter().filter(|seen| **seen == node).count()
    };
    let search = viewer
        .get_all_by_role(egui::accesskit::Role::TextInput)
        .min_by(|a, b| a.rect().min.x.total_cmp(&b.rect().min.x))
        .unwrap()
        .rect()
        .center();
    click_at(&mut viewer, search);
    viewer.event(egui::Event::Text("TALL".to_owned()));
    viewer.step();
    viewer.step();
    assert!(viewer.query_by_label("short block").is_none());
    viewer.get_by_label("tall block").click();
    viewer.step();
    viewer.step();
    let node = node_of(viewer.state().document().scene(), "tall block");
    assert_eq!(viewer.state().selected(), Some(node));
    assert!(count(viewer.state(), "tall block") > 50);
    viewer.get_by_label("Visible").click();
    viewer.step();
    assert!(viewer.state().document().scene().nodes[node].is_hidden);
    settle(&mut viewer);
    assert_eq!(count(viewer.state(), "tall block"), 0);
    // The keyboard belongs to the picture again.
    let rect = viewer.state().shown_at()[1].1;
    click_at(&mut viewer, rect.left_top() + vec2(3.0, 3.0));
    press(&mut viewer, Modifiers::COMMAND, Key::Z);
    settle(&mut viewer);
    assert!(count(viewer.state(), "tall block") > 50);
    let at = place_of(viewer.state(), "tall block");
    click_at(&mut viewer, at);
    press(&mut viewer, Modifiers::NONE, Key::Delete);
    assert_eq!(viewer.state().selected(), None);
    settle(&mut viewer);
    assert_eq!(count(viewer.state(), "tall block"), 0);
    press(&mut viewer, Modifiers::COMMAND, Key::Z);
    settle(&mut viewer);
    assert!(count(viewer.state(), "tall block") > 50);
    assert!(
        errors(viewer.state()).is_empty(),
        "{:?}",
        errors(viewer.state())
    );
}

#[test]
fn a_broken_shader_says_so_and_the_last_good_one_stays() {
    let folder = Folder::new("viewer-shaders");
    let shaders = folder.join("shaders");
    for kind in ["passes", "shared"] {
        let to = shaders.join(kind);
        std::fs::create_dir_all(&to).unwrap();
        for file in std::fs::read_dir(Path::new("shaders").join(kind)).unwrap() {
            let file = file.unwrap();
            std::fs::copy(file.path(), to.join(file.file_name())).unwrap();
        }
    }
    let in_folder = shaders.to_string_lossy().into_owned();
    let mut viewer = open("builtin:cornell", &folder, |settings| {
        path_tracing(settings);
        settings.gpu.shader_folder = in_folder;
    });
    let path = shaders.join("passes/path_trace.wesl");
    let good = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, good.replacen("fn main(", "fn main(nonsense ", 1)).unwrap();
    press(&mut viewer, Modifiers::NONE, Key::F5);
    until(&mut viewer, "the shader's error", |app| {
        errors(app).iter().any(|error| error.contains("path_trace"))
    });
    // Frames go on.
    settle(&mut viewer);
    std::fs::write(&path, good.replacen("fn main(", "// Changed.\nfn main(", 1)).unwrap();
    press(&mut viewer, Modifiers::NONE, Key::F5);
    until(&mut viewer, "the mended shader", |app| {
        app.messages()
            .iter()
            .any(|message| message.text.contains("read again"))
    });
    settle(&mut viewer);
}

#[test]
fn escape_closes_what_is_open_and_asks_before_edits_are_lost() {
    use stereolux::viewer::app::WindowCommand;
    let folder = Folder::new("viewer-escape");
    let mut viewer = open("builtin:cornell", &folder, path_tracing);
    press(&mut viewer, Modifiers::NONE, Key::F1);
    viewer.step();
    assert!(
        viewer
            .query_by_label("screenshot: PNG, and EXR of both eyes")
            .is_some()
    );
    press(&mut viewer, Modifiers::NONE, Key::Escape);
    viewer.step();
    assert!(
        viewer
            .query_by_label("screenshot: PNG, and EXR of both eyes")
            .is_none()
    );
    let at = place_of(viewer.state(), "tall block");
    click_at(&mut viewer, at);
    press(&mut viewer, Modifiers::NONE, Key::Delete);
    assert!(viewer.state().document().is_modified());
    press(&mut viewer, Modifiers::NONE, Key::Escape);
    viewer.step();
    assert_eq!(viewer.state_mut().take_commands(), []);
    assert!(viewer.query_by_label("Go on").is_some());
    viewer.get_by_label("Go on").click();
    viewer.step();
    press(&mut viewer, Modifiers::COMMAND, Key::Z);
    assert!(!viewer.state().document().is_modified());
    press(&mut viewer, Modifiers::NONE, Key::Escape);
    assert_eq!(viewer.state_mut().take_commands(), [WindowCommand::Quit]);
    press(&mut viewer, Modifiers::NONE, Key::F11);
    assert_eq!(
        viewer.state_mut().take_commands(),
        [WindowCommand::ToggleFullScreen]
    );
}
