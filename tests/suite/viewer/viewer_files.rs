//! What the viewer reads and writes: dropped files, environments, saved settings and scenes, screenshots, shaders.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use egui::accesskit::Role;
use egui::{Key, Modifiers, vec2};
use egui_kittest::kittest::Queryable as _;
use stereolux::images::{ImageRgb, aces_filmic, read_image, srgb_encode, write_exr};
use stereolux::options::layers::Layers;
use stereolux::renderer::Eye;
use stereolux::scene::Scene;
use stereolux::scene::edit::{Document, Edit};
use stereolux::settings::Light;
use stereolux::viewer::App;
use stereolux::viewer::app::WindowCommand;
use stereolux::xr::View;

use super::viewer_support::{
    SIZE, Viewer, assert_no_errors, click_at, click_node, cornell, drag, fields, hold, node_of,
    open, path_tracing, picture, press, push, settle, shown, two_steps, type_into, until,
    until_error, until_shown,
};
use crate::suite::support::{Folder, assert_success, renderer, run_into};

/// The mean over `frames` frames that ended with `last`, as `render` would make it from files.
fn rendered(settings: &Path, scene: &Path, viewer: &App, last: u32, frames: u32) -> Vec<[f64; 3]> {
    let mut layers = Layers::default();
    layers.add_file(settings).unwrap();
    let settings = layers.finish().unwrap();
    let scene = Scene::load(scene).unwrap();
    let mut renderer = renderer(&scene, &settings.render, settings.size.unwrap());
    let views = shown(viewer).views;
    let mut sum = vec![[0.0; 3]; (SIZE[0] * SIZE[1]) as usize];
    for index in last + 1 - frames..=last {
        renderer.render_frame(&views, index, |_| ()).unwrap();
        let image = renderer.read_radiance(Eye::Left).unwrap().unwrap();
        for (sum, channel) in sum.as_flattened_mut().iter_mut().zip(image.as_flattened()) {
            *sum += f64::from(*channel);
        }
    }
    let mean = |sum: [f64; 3]| sum.map(|channel| channel / f64::from(frames));
    sum.into_iter().map(mean).collect()
}

#[test]
fn what_is_saved_renders_to_the_picture_that_was_shown() {
    let (folder, mut viewer) = cornell("viewer-save");
    click_node(&mut viewer, "short block");
    two_steps(&mut viewer);
    let [x_handle, ..] = viewer.state().gizmo.handles().unwrap();
    drag(&mut viewer, x_handle, vec2(-30.0, 0.0));
    viewer.get_by_label("Delete Del").scroll_to_me();
    push(&mut viewer, "Add child with light");
    settle(&mut viewer);
    press(&mut viewer, Modifiers::COMMAND, Key::S);
    assert!(!viewer.state().document().is_modified());
    viewer.get_by_label("Settings").click();
    viewer.step();
    viewer.get_by_label("Save as TOML").click();
    viewer.step();
    assert_no_errors(&viewer);
    let [settings, scene] = ["settings.toml", "cornell_edited.glb"].map(|name| folder.join(name));
    let frame = shown(viewer.state());
    let (last, frames) = (frame.index, frame.frames);
    let pixels = frame.shown.eyes[0].pixels.clone();
    let value = |linear: f64| srgb_encode(aces_filmic(linear as f32)) * 255.0;
    let is_off = |linear: f64, byte: u8| (value(linear) - f32::from(byte)).abs() > 0.51;
    let differing = |scene: &Path| {
        let again = rendered(&settings, scene, viewer.state(), last, frames);
        let shown = pixels.iter().map(|shown| shown.to_array());
        let pairs = again.iter().zip(shown);
        let wrong =
            |(mean, shown): &(&[f64; 3], [u8; 4])| (0..3).any(|c| is_off(mean[c], shown[c]));
        pairs.filter(wrong).count()
    };
    // The same frames of the same scene, but for bytes near a tie: the mean is the device's (`src/renderer/still.rs`).
    assert_eq!(differing(&scene), 0);
    // The comparison would notice the lamp that was added.
    let plain = Folder::new("viewer-save-plain");
    let unedited = plain.join("plain.glb");
    let mut document = Document::load("builtin:cornell").unwrap();
    document.save(&unedited).unwrap();
    let others = differing(&unedited);
    assert!(others > pixels.len() / 4, "{others}");
    // The command takes them too.
    let [settings, scene] = [&settings, &scene].map(|path| path.to_str().unwrap());
    let saved = ["--config", settings, "--scene", scene];
    assert_success(&run_into(&folder.join("rendered"), "render", &saved));
}

#[test]
fn a_screenshot_is_the_mean_of_both_eyes() {
    let (folder, mut viewer) = cornell("viewer-screenshot");
    press(&mut viewer, Modifiers::NONE, Key::T);
    let png = folder.join("view_0000.png");
    until(&mut viewer, "a screenshot", |app| {
        png.exists() && has_said(app, "view_0000.png")
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
    let next = folder.join("view_0001.png");
    until(&mut viewer, "another", |_| next.exists());
}

/// Who stops while a frame is computed has what is shown as files: its frames, and its pixels.
#[test]
fn a_screenshot_of_what_was_stopped_is_what_is_shown() {
    let (folder, mut viewer) = cornell("viewer-stopped");
    // Denoised, as `auto` has it, and then not.
    for number in 0..2 {
        if number == 1 {
            push(&mut viewer, "Denoise");
        }
        settle(&mut viewer);
        until_shown(&mut viewer, "a few frames", |app| shown(app).frames > 4);
        press(&mut viewer, Modifiers::NONE, Key::Escape);
        // What was on its way arrives.
        for _ in 0..40 {
            viewer.step();
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
        assert!(viewer.query_by_label("stopped").is_some());
        let frames = shown(viewer.state()).frames;
        let pixels = picture(&viewer);
        press(&mut viewer, Modifiers::NONE, Key::T);
        let name = format!("view_000{number}.png");
        until(&mut viewer, "a screenshot", |app| has_said(app, &name));
        let about = std::fs::read(folder.join(&format!("view_000{number}.json"))).unwrap();
        let about: serde_json::Value = serde_json::from_slice(&about).unwrap();
        assert_eq!(about["frames"], frames, "{about}");
        let written = read_image(&folder.join(&name)).unwrap();
        for (index, pixel) in pixels.iter().enumerate() {
            let [x, y] = [index as u32 % SIZE[0], index as u32 / SIZE[0]];
            let linear = written.get(x, y).unwrap();
            for (shown, linear) in pixel.to_array().into_iter().zip(linear) {
                // A step: `renderer::still` has where.
                let byte = (srgb_encode(linear) * 255.0).round() as u8;
                assert!(byte.abs_diff(shown) <= 1, "{x} {y}: {byte} {shown}");
            }
        }
        // Nothing was refined for it.
        viewer.step();
        assert_eq!(shown(viewer.state()).frames, frames);
    }
}

fn has_said(app: &App, what: &str) -> bool {
    app.messages.iter().any(|m| m.text.contains(what))
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

/// Drops a file onto the window.
pub fn drop_file(viewer: &mut Viewer, path: &Path) {
    let file: egui::DroppedFileHandle = Arc::new(Dropped(path.to_owned()));
    viewer.input_mut().dropped_files.push(file);
    viewer.step();
}

#[test]
fn a_broken_file_is_refused_and_a_good_one_opens() {
    let (folder, mut viewer) = cornell("viewer-drop");
    let broken = folder.write("broken.glb", b"glTF\x02\0\0\0 this is no scene");
    for (path, says) in [
        (broken.clone(), "broken.glb"),
        (folder.join("missing.gltf"), "missing.gltf"),
        (folder.join("notes.doc"), "is no scene"),
    ] {
        drop_file(&mut viewer, &path);
        until_error(&mut viewer, says);
    }
    assert_eq!(viewer.state().document().scene().name, "builtin:cornell");
    assert_eq!(shown(viewer.state()).seen[0].size, SIZE);
    settle(&mut viewer);

    let good = folder.join("gallery.glb");
    let mut gallery = Document::load("builtin:gallery").unwrap();
    gallery.save(&good).unwrap();
    drop_file(&mut viewer, &good);
    let is_other = |app: &App| app.document().scene().name != "builtin:cornell";
    until(&mut viewer, "the scene", is_other);
    assert_eq!(viewer.state().settings().scene, good.to_string_lossy());
    settle(&mut viewer);
    // Every node that is seen is the new scene's.
    let nodes = viewer.state().document().scene().nodes.len() as u32;
    let seen = &shown(viewer.state()).seen[0];
    let is_known = |node: &u32| *node < nodes || *node == u32::MAX;
    assert!(seen.nodes.iter().all(is_known));
    assert!(seen.nodes.iter().any(|node| *node != u32::MAX));
}

#[test]
fn a_scene_without_light_is_lit_when_it_is_opened_and_the_next_one_is_left_alone() {
    let folder = Folder::new("viewer-unlit");
    let mut viewer = open("builtin:cornell", &folder, |settings| {
        path_tracing(settings);
        settings.light = Light::Auto;
    });
    let mut document = Document::load("builtin:cornell").unwrap();
    let lit = folder.join("lit.glb");
    document.save(&lit).unwrap();
    let lamp = node_of(document.scene(), "lamp");
    document.edit(Edit::Delete { node: lamp }).unwrap();
    let dark = folder.join("dark.glb");
    document.save(&dark).unwrap();
    // Without light every pixel is black; the corners see nothing but what is around.
    let studio = "builtin:studio";
    for (path, around) in [(&dark, studio), (&lit, ""), (&dark, studio)] {
        drop_file(&mut viewer, path);
        let name = path.to_string_lossy().into_owned();
        until_shown(&mut viewer, "the scene", |app| app.settings().scene == name);
        let app = viewer.state();
        assert_eq!(app.settings().environment.path, around, "{name}");
        let is_black = shown(app).shown.eyes[0].pixels[0] == egui::Color32::BLACK;
        assert_eq!(is_black, around.is_empty(), "{name}");
    }
}

#[test]
fn a_studio_that_was_chosen_stays_and_the_chart_begins_anew_with_another_scene() {
    let folder = Folder::new("viewer-studio");
    let mut viewer = open("builtin:cornell", &folder, |settings| {
        path_tracing(settings);
        settings.light = Light::Auto;
        settings.environment.path = "builtin:studio".to_owned();
    });
    let path = folder.join("again.glb");
    let mut document = Document::load("builtin:cornell").unwrap();
    document.save(&path).unwrap();
    until(&mut viewer, "frames of the first scene", |app| {
        app.history.len() > 12
    });
    drop_file(&mut viewer, &path);
    let name = path.to_string_lossy().into_owned();
    until(&mut viewer, "the scene", |app| app.settings().scene == name);
    // Of the first scene there are more.
    let charted = viewer.state().history.len();
    assert!(charted < 12, "{charted}");
    settle(&mut viewer);
    let app = viewer.state();
    assert_eq!(app.settings().environment.path, "builtin:studio");
    let color = shown(app).shown.eyes[0].pixels[0];
    assert!(color != egui::Color32::BLACK);
    assert!(!app.history.is_empty());
    // Embedded surroundings are stronger at will, too.
    type_strength(&mut viewer, "4");
    until_shown(&mut viewer, "a stronger studio", |app| {
        shown(app).shown.eyes[0].pixels[0].r() > color.r()
    });
    let environment = &viewer.state().settings().environment;
    assert_eq!(
        (environment.path.as_str(), environment.strength),
        ("builtin:studio", 4.0)
    );
}

/// Writes how strong the surroundings are into the settings panel.
fn type_strength(viewer: &mut Viewer, text: &str) {
    push(viewer, "Settings");
    let in_panel = |viewer: &Viewer, role| {
        let mut found = fields(viewer, role);
        found.retain(|field| field.x > 800.0);
        found
    };
    let inputs = in_panel(viewer, Role::TextInput).into_iter();
    let search = inputs.min_by(|a, b| a.y.total_cmp(&b.y)).unwrap();
    click_at(viewer, search);
    viewer.event(egui::Event::Text("environment.strength".to_owned()));
    two_steps(viewer);
    let strength = in_panel(viewer, Role::SpinButton)[0];
    type_into(viewer, strength, text);
}

#[test]
fn an_environment_is_dropped_made_stronger_and_a_broken_one_is_refused() {
    let (folder, mut viewer) = cornell("viewer-environment");
    let corner = |app: &App| shown(app).shown.eyes[0].pixels[0];
    assert_eq!(corner(viewer.state()), egui::Color32::BLACK);
    let sky = folder.join("sky.exr");
    write_exr(&sky, &ImageRgb::filled(8, 4, [0.2; 3]).unwrap()).unwrap();
    drop_file(&mut viewer, &sky);
    until_shown(&mut viewer, "the sky", |app| {
        corner(app) != egui::Color32::BLACK
    });
    let byte = |linear: f32| (srgb_encode(aces_filmic(linear)) * 255.0).round() as u8;
    assert_eq!(corner(viewer.state()).r(), byte(0.2));
    let path = sky.to_string_lossy();
    assert_eq!(viewer.state().settings().environment.path, path);

    type_strength(&mut viewer, "2");
    until_shown(&mut viewer, "a stronger sky", |app| {
        corner(app).r() == byte(0.4)
    });
    assert_eq!(viewer.state().settings().environment.strength, 2.0);

    let broken = folder.write("broken.hdr", b"#?RADIANCE\nno map");
    drop_file(&mut viewer, &broken);
    until_error(&mut viewer, "broken.hdr");
    assert_eq!(viewer.state().settings().environment.path, path);
    settle(&mut viewer);
    assert_eq!(corner(viewer.state()).r(), byte(0.4));
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
    until_error(&mut viewer, "path_trace");
    // Frames go on.
    settle(&mut viewer);
    std::fs::write(&path, good.replacen("fn main(", "// Changed.\nfn main(", 1)).unwrap();
    press(&mut viewer, Modifiers::NONE, Key::F5);
    until(&mut viewer, "the mended shader", |app| {
        has_said(app, "read again")
    });
    settle(&mut viewer);
}

#[test]
fn a_scenes_own_surroundings_are_stronger_at_will_and_filtered_frames_are_counted() {
    let folder = Folder::new("viewer-own-surroundings");
    let mut viewer = open("builtin:water", &folder, |settings| {
        path_tracing(settings);
        settings.render.reconstruct.taa = true.into();
    });
    let corner = |app: &App| shown(app).shown.eyes[0].pixels[0].r();
    until_shown(&mut viewer, "clouds", |app| corner(app) > 0);
    let before = corner(viewer.state());
    until_shown(&mut viewer, "a few frames", |app| shown(app).frames > 3);
    type_strength(&mut viewer, "0.25");
    until_shown(&mut viewer, "darker clouds", |app| {
        (1..before).contains(&corner(app))
    });
}

#[test]
fn another_scene_takes_the_place_of_unsaved_changes_only_when_told_to() {
    let folder = Folder::new("viewer-unsaved");
    let path = folder.join("other.glb");
    Document::load("builtin:plane")
        .unwrap()
        .save(&path)
        .unwrap();
    let name = path.to_string_lossy().into_owned();
    let mut viewer = open("builtin:cornell", &folder, path_tracing);
    settle(&mut viewer);
    click_node(&mut viewer, "tall block");
    press(&mut viewer, Modifiers::NONE, Key::Delete);
    assert!(viewer.state().document().is_modified());
    drop_file(&mut viewer, &path);
    two_steps(&mut viewer);
    press(&mut viewer, Modifiers::NONE, Key::Escape);
    settle(&mut viewer);
    assert!(viewer.query_by_label("Open without saving").is_none());
    assert!(viewer.state().document().is_modified());
    drop_file(&mut viewer, &path);
    two_steps(&mut viewer);
    push(&mut viewer, "Open without saving");
    until(&mut viewer, "the other scene", |app| {
        app.settings().scene == name
    });
    // Nothing is lost: nothing is asked.
    let again = folder.join("again.glb");
    std::fs::copy(&path, &again).unwrap();
    drop_file(&mut viewer, &again);
    let name = again.to_string_lossy().into_owned();
    until(&mut viewer, "the third", |app| app.settings().scene == name);
}

/// The box in a window whose scene would be saved where a file of others lies, and that file.
fn before_a_file_of_others(folder: &Folder) -> (Viewer, PathBuf) {
    let path = folder.write("cornell_edited.glb", THEIRS);
    (open("builtin:cornell", folder, path_tracing), path)
}

const THEIRS: &str = "of somebody else";

/// Saving writes over what the window wrote itself, and asks about everything else.
#[test]
fn files_of_others_are_written_over_only_when_asked() {
    let folder = Folder::new("viewer-replace");
    let (mut viewer, path) = before_a_file_of_others(&folder);
    let is_theirs = || std::fs::read(&path).unwrap() == THEIRS.as_bytes();
    for (answer, stays) in [("Leave it", true), ("Replace it", false)] {
        press(&mut viewer, Modifiers::COMMAND, Key::S);
        two_steps(&mut viewer);
        assert!(is_theirs(), "asked first");
        push(&mut viewer, answer);
        assert_eq!(is_theirs(), stays, "{answer}");
    }
    let node = node_of(viewer.state().document().scene(), "tall block");
    let context = viewer.ctx.clone();
    let app = viewer.state_mut();
    app.edit(&context, Edit::Delete { node });
    press(&mut viewer, Modifiers::COMMAND, Key::S);
    two_steps(&mut viewer);
    assert!(viewer.query_by_label("Replace it").is_none());
    assert!(!viewer.state().document().is_modified());
    assert_no_errors(&viewer);
}

/// A window that a signal or a lost device ends keeps what was edited, beside what lies there.
#[test]
fn edits_outlive_the_window() {
    let folder = Folder::new("viewer-rescue");
    let (mut viewer, path) = before_a_file_of_others(&folder);
    assert!(viewer.state_mut().rescue().is_none(), "nothing to keep");
    let node = node_of(viewer.state().document().scene(), "tall block");
    let context = viewer.ctx.clone();
    viewer.state_mut().edit(&context, Edit::Delete { node });
    let kept = viewer.state_mut().rescue().unwrap().unwrap();
    assert_eq!(kept, folder.join("cornell_edited_2.glb"));
    assert_eq!(std::fs::read(&path).unwrap(), THEIRS.as_bytes());
    let scene = Scene::load(&kept).unwrap();
    let shows = |name| {
        scene
            .roots
            .iter()
            .any(|root| scene.subtree(*root)[node_of(&scene, name)])
    };
    assert!(shows("short block") && !shows("tall block"));
}

/// Another program's work is asked about, though this window wrote there before.
#[test]
fn a_file_that_another_program_has_written_since_is_asked_about() {
    let (folder, mut viewer) = cornell("viewer-written-since");
    let path = folder.join("cornell_edited.glb");
    press(&mut viewer, Modifiers::COMMAND, Key::S);
    assert!(path.exists());
    std::fs::write(&path, THEIRS).unwrap();
    let is_theirs = || std::fs::read(&path).unwrap() == THEIRS.as_bytes();
    press(&mut viewer, Modifiers::COMMAND, Key::S);
    two_steps(&mut viewer);
    assert!(is_theirs(), "asked first");
    push(&mut viewer, "Replace it");
    assert!(!is_theirs());
    // Told to, but in vain: the next time it is asked again.
    std::fs::remove_file(&path).unwrap();
    std::fs::create_dir(&path).unwrap();
    for _ in 0..2 {
        press(&mut viewer, Modifiers::COMMAND, Key::S);
        two_steps(&mut viewer);
        push(&mut viewer, "Replace it");
        until_error(&mut viewer, "cornell_edited.glb");
    }
}

/// Types into the window that asks for a path, over what stands there.
fn answer_path(viewer: &mut Viewer, path: &str) {
    two_steps(viewer);
    viewer.event(egui::Event::Text(path.to_owned()));
    two_steps(viewer);
    press(viewer, Modifiers::NONE, Key::Enter);
    two_steps(viewer);
}

/// Where the scene is saved changes only once it has been saved there.
#[test]
fn paths_that_were_declined_or_refused_are_no_ones_target() {
    let folder = Folder::new("viewer-targets");
    let mut viewer = open("builtin:cornell", &folder, path_tracing);
    let shifted = Modifiers::COMMAND | Modifiers::SHIFT;
    let theirs = folder.write("theirs.glb", THEIRS);
    press(&mut viewer, shifted, Key::S);
    answer_path(&mut viewer, &theirs.to_string_lossy());
    push(&mut viewer, "Leave it");
    press(&mut viewer, shifted, Key::S);
    answer_path(&mut viewer, &folder.join("scene.doc").to_string_lossy());
    until_error(&mut viewer, "scene.doc");
    let own = folder.join("cornell_edited.glb");
    press(&mut viewer, Modifiers::COMMAND, Key::S);
    assert!(own.exists());
    assert_eq!(std::fs::read(&theirs).unwrap(), THEIRS.as_bytes());
    // What was accepted is the target from then on.
    let other = folder.join("other.glb");
    press(&mut viewer, shifted, Key::S);
    answer_path(&mut viewer, &other.to_string_lossy());
    assert!(other.exists());
    std::fs::remove_file(&own).unwrap();
    press(&mut viewer, Modifiers::COMMAND, Key::S);
    assert!(!own.exists());
}

#[test]
fn a_path_that_is_typed_takes_the_place_of_the_folder_that_is_offered() {
    let (folder, mut viewer) = cornell("viewer-typed-path");
    let state = &mut viewer.state_mut().window_state;
    state.remember_file(&folder.join("room.glb").to_string_lossy());
    press(&mut viewer, Modifiers::COMMAND, Key::O);
    answer_path(&mut viewer, "builtin:plane");
    until(&mut viewer, "the other scene", |app| {
        app.settings().scene == "builtin:plane"
    });
}

/// A name that is being written when the window is closed or the scene is saved is not lost.
#[test]
fn a_name_in_hand_is_asked_about_and_saved() {
    let (folder, mut viewer) = cornell("viewer-name-in-hand");
    let node = click_node(&mut viewer, "tall block");
    two_steps(&mut viewer);
    let write = |viewer: &mut Viewer, name: &str| {
        let mut inputs = fields(viewer, Role::TextInput);
        inputs.retain(|field| field.x > 800.0);
        click_at(viewer, inputs[0]);
        viewer.step();
        press(viewer, Modifiers::COMMAND, Key::A);
        viewer.event(egui::Event::Text(name.to_owned()));
        two_steps(viewer);
    };
    let name_of = |app: &App| app.document().scene().nodes[node].name.clone();
    write(&mut viewer, "tower");
    viewer.state_mut().request_quit();
    assert_eq!(viewer.state_mut().take_commands(), [], "asked first");
    assert_eq!(name_of(viewer.state()), "tower");
    two_steps(&mut viewer);
    push(&mut viewer, "Go on");
    write(&mut viewer, "steeple");
    press(&mut viewer, Modifiers::COMMAND, Key::S);
    assert!(!viewer.state().document().is_modified());
    let saved = Scene::load(folder.join("cornell_edited.glb")).unwrap();
    assert!(saved.nodes.iter().any(|node| node.name == "steeple"));
    // Nor is it when something else is clicked.
    write(&mut viewer, "pillar");
    click_node(&mut viewer, "short block");
    two_steps(&mut viewer);
    assert_eq!(name_of(viewer.state()), "pillar");
}

/// Who saves before quitting over a file of others is asked about that, and has quit then.
#[test]
fn saving_over_a_file_of_others_goes_on_to_what_it_was_for() {
    let folder = Folder::new("viewer-save-and-quit");
    let (mut viewer, _) = before_a_file_of_others(&folder);
    let node = node_of(viewer.state().document().scene(), "tall block");
    let context = viewer.ctx.clone();
    viewer.state_mut().edit(&context, Edit::Delete { node });
    for (answer, commands) in [
        ("Leave it", vec![]),
        ("Replace it", vec![WindowCommand::Quit]),
    ] {
        viewer.state_mut().request_quit();
        two_steps(&mut viewer);
        push(&mut viewer, "Save and quit");
        assert_eq!(viewer.state_mut().take_commands(), [], "asked first");
        push(&mut viewer, answer);
        assert_eq!(viewer.state_mut().take_commands(), commands, "{answer}");
    }
    assert!(!viewer.state().document().is_modified());
}

/// Plays a walk for a second or so, and pauses; the views where it stands.
fn paused_walk(viewer: &mut Viewer) -> [View; 2] {
    push(viewer, "Motion");
    push(viewer, "Walk");
    for _ in 0..60 {
        viewer.step();
    }
    press(viewer, Modifiers::NONE, Key::Space);
    settle(viewer);
    shown(viewer.state()).views
}

/// Who takes the head out of a recording stands where that was.
#[test]
fn a_head_that_is_taken_from_a_recording_stays_where_it_was() {
    let (_folder, mut viewer) = cornell("viewer-take-head");
    let start = viewer.state().head();
    let there = View::midpoint_in_world(&paused_walk(&mut viewer));
    let way_m = (there - start.position).length();
    assert!(way_m > 0.01, "{way_m} m from the start");
    push(&mut viewer, "Motion");
    push(&mut viewer, "By hand");
    let head = viewer.state().head();
    assert!((head.position - there).length() < 1e-9);
}

/// Who walks away from a recording finds it again.
#[test]
fn a_recording_that_is_left_by_hand_waits_to_go_on() {
    let (_folder, mut viewer) = cornell("viewer-left-recording");
    let recorded = paused_walk(&mut viewer);
    hold(&mut viewer, Key::W, 5);
    settle(&mut viewer);
    assert_ne!(shown(viewer.state()).views, recorded);
    assert!(viewer.query_by_label_contains("left by hand").is_some());
    for key in [Key::Period, Key::Comma] {
        press(&mut viewer, Modifiers::NONE, key);
    }
    settle(&mut viewer);
    assert_eq!(shown(viewer.state()).views, recorded);
    assert!(viewer.query_by_label_contains("left by hand").is_none());
}
