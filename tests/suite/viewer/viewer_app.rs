//! What a person does in the viewer by keys, mouse and panels.

use std::sync::Arc;

use egui::accesskit::Role;
use egui::{Key, Modifiers, vec2};
use egui_kittest::kittest::{NodeT as _, Queryable as _};
use glam::DVec3;
use stereolux::images::read_image;
use stereolux::renderer::Inspection;
use stereolux::scene::edit::Edit;
use stereolux::settings::{Method, Reuse};
use stereolux::viewer::App;
use stereolux::viewer::frames::{FrameReport, ViewMode};
use stereolux::viewer::layout::{Layout, Part};

use super::viewer_support::{
    Viewer, assert_no_errors, changed, choose, click_at, click_node, cornell, drag, drag_with,
    errors, fields, hold, narrow, node_of, open, path_tracing, picture, place_of, press, push,
    settle, shown, two_steps, type_into, until, until_shown,
};
use crate::suite::support::Folder;

#[test]
fn keys_and_mouse_walk_and_look_and_the_picture_follows() {
    let (_folder, mut viewer) = cornell("viewer-walk");
    let before = picture(&viewer);
    let start = viewer.state().head();
    hold(&mut viewer, Key::W, 11);
    let walked = viewer.state().head();
    let ahead = start.orientation * DVec3::NEG_Z;
    let way = walked.position - start.position;
    assert!(way.dot(ahead) > 0.01, "{way}");
    // Straight ahead, to rounding.
    let aside = way.cross(ahead).length();
    assert!(aside < 1e-9 * way.length().max(1.0), "{way}");
    let left_eye = narrow().views_from_head(&walked)[0];
    settle(&mut viewer);
    assert_eq!(shown(viewer.state()).views[0], left_eye);
    let moved = changed(shown(viewer.state()), &before);
    assert!(moved > 0.3, "{moved}");
    // The key is up: the head stands still.
    viewer.step();
    assert_eq!(viewer.state().head(), walked);
    // Nor does it move by a letter that was a command, though Ctrl is let go first.
    viewer.key_down_modifiers(Modifiers::COMMAND, Key::D);
    for _ in 0..5 {
        viewer.step();
    }
    assert_eq!(viewer.state().head(), walked);
    viewer.key_up(Key::D);
    viewer.step();
    let from = viewer.state().head();
    hold(&mut viewer, Key::D, 3);
    assert_ne!(viewer.state().head(), from);
    let walked = viewer.state().head();

    // A drag turns the head and selects nothing.
    let rect = viewer.state().shown_at[0].1;
    drag(&mut viewer, rect.center(), vec2(40.0, 0.0));
    assert_eq!(viewer.state().selected(), None);
    let turned = viewer.state().head();
    assert_eq!(turned.position, walked.position);
    // To the right by 40 points, of which 800 are half a turn; the drag counts from where egui sees it as one.
    let turn = (turned.heading_rad() - walked.heading_rad()) / std::f64::consts::PI * 800.0;
    assert!((-40.0..-25.0).contains(&turn), "{turn}");
    press(&mut viewer, Modifiers::NONE, Key::Home);
    assert_eq!(viewer.state().head(), start);
    assert_no_errors(&viewer);
}

#[test]
fn a_click_selects_the_object_under_the_pixel_and_its_colour_changes_and_comes_back() {
    let (_folder, mut viewer) = cornell("viewer-colour");
    for name in ["tall block", "short block", "back wall"] {
        let node = click_node(&mut viewer, name);
        assert_eq!(viewer.state().selected(), Some(node), "{name}");
    }
    let wall = click_node(&mut viewer, "left wall");
    viewer.step();
    let scene = viewer.state().document().scene();
    let mesh = scene.nodes[wall].mesh.unwrap();
    let material = scene.meshes[mesh].triangles[0].material as usize;
    let from = scene.materials[material].clone();
    let before = picture(&viewer);

    // The third number of the base colour, typed.
    let row = viewer.get_by_label("Base colour").rect().center();
    let mut numbers = fields(&viewer, Role::SpinButton);
    numbers.retain(|field| (field.y - row.y).abs() < 8.0);
    numbers.sort_by(|a, b| a.x.total_cmp(&b.x));
    type_into(&mut viewer, *numbers.last().unwrap(), "0.9");
    viewer.step();
    let to = &viewer.state().document().scene().materials[material];
    assert_eq!(to.base_color[2], 0.9);
    assert_eq!(to.base_color[..2], from.base_color[..2]);
    assert_eq!(to.roughness, from.roughness);
    assert!(viewer.state().document().undo_label().is_some());
    // History is kept over edits. Where the preview has full size, the first frame shows at most 0.8 of what was (`taa_alpha`
    // is 0.2), the sixteenth 0.8^16, under 3 %: a unit of the step.
    let until_history_has_faded = |viewer: &mut _| {
        two_steps(viewer);
        until_shown(viewer, "sixteen frames", |app| shown(app).frames >= 16);
    };
    until_history_has_faded(&mut viewer);
    // The red wall has become violet where it is seen.
    let blue_of = |pixels: &[egui::Color32], frame: &FrameReport| {
        let seen = frame.seen[0].nodes.iter().zip(pixels);
        let of_wall = seen.filter(|(seen, _)| **seen == wall as u32);
        let blue: Vec<f64> = of_wall.map(|(_, pixel)| f64::from(pixel.b())).collect();
        blue.iter().sum::<f64>() / blue.len() as f64
    };
    let frame = shown(viewer.state());
    let [was, is] = [&before, &frame.shown.eyes[0].pixels].map(|pixels| blue_of(pixels, frame));
    assert!(is > was + 20.0, "{was} {is}");

    press(&mut viewer, Modifiers::COMMAND, Key::Z);
    assert_eq!(viewer.state().document().scene().materials[material], from);
    until_history_has_faded(&mut viewer);
    let frame = shown(viewer.state());
    let back = blue_of(&frame.shown.eyes[0].pixels, frame);
    // Noise of two means of path traced frames, far under the step above.
    assert!((back - was).abs() < 10.0, "{was} {back}");
    press(&mut viewer, Modifiers::COMMAND | Modifiers::SHIFT, Key::Z);
    let again = &viewer.state().document().scene().materials[material];
    assert_eq!(again.base_color[2], 0.9);
    assert_no_errors(&viewer);
}

#[test]
fn a_handle_moves_the_object_as_one_step_that_undo_takes_back() {
    let (_folder, mut viewer) = cornell("viewer-handle");
    let at = place_of(viewer.state(), "tall block");
    let node = click_node(&mut viewer, "tall block");
    two_steps(&mut viewer);
    let scene = viewer.state().document().scene();
    let from = scene.nodes[node].clone();
    let before = picture(&viewer);
    let [x_handle, ..] = viewer.state().gizmo.handles().expect("handles");
    // Undoing while it is held does nothing.
    drag_with(&mut viewer, x_handle, vec2(40.0, 0.0), |viewer| {
        press(viewer, Modifiers::COMMAND, Key::Z);
    });
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
    assert_no_errors(&viewer);
}

#[test]
fn every_layout_and_every_view_shows_something_of_its_own() {
    let folder = Folder::new("viewer-looks");
    // Glass and a lamp: every intermediate result has something to show.
    let mut viewer = open("builtin:caustic", &folder, |_| ());
    for layout in Layout::ALL {
        let now = viewer.state().window_state.layout.name();
        choose(&mut viewer, now, layout.name());
        assert_eq!(viewer.state().window_state.layout, layout);
        viewer.step();
        let parts = viewer.state().shown_at.iter().map(|(part, _)| *part);
        assert_eq!(parts.collect::<Vec<Part>>(), layout.parts());
    }
    let has_other = |app: &App| shown(app).other.is_some();
    until(&mut viewer, "the other method's picture", has_other);
    assert_eq!(viewer.state().other.render.method, Method::Path);
    choose(&mut viewer, Layout::Split.name(), Layout::SideBySide.name());
    let mut pictures: Vec<(ViewMode, Arc<egui::ColorImage>)> = Vec::new();
    for mode in ViewMode::all() {
        if mode != viewer.state().view_mode {
            let now = viewer.state().view_mode.name();
            choose(&mut viewer, &now, &mode.name());
        }
        assert_eq!(viewer.state().view_mode, mode);
        settle(&mut viewer);
        if mode != ViewMode::Picture {
            // The error's reference and the variance begin with later frames.
            let has_legend = |app: &App| shown(app).shown.legend.is_some();
            until(&mut viewer, "a legend", has_legend);
        }
        let frame = shown(viewer.state());
        // Provenance is the right eye's.
        let eye = usize::from(mode == ViewMode::Inspection(Inspection::Provenance));
        let picture = Arc::clone(&frame.shown.eyes[eye]);
        let first = picture.pixels[0];
        // Nothing moves.
        let is_flat = mode == ViewMode::Inspection(Inspection::Motion);
        let is_one_colour = picture.pixels.iter().all(|pixel| *pixel == first);
        assert_eq!(is_one_colour, is_flat, "{mode:?}");
        for (other, drawn) in &pictures {
            assert_ne!(drawn.pixels, picture.pixels, "{mode:?} and {other:?}");
        }
        pictures.push((mode, picture));
    }
    assert_no_errors(&viewer);
}

#[test]
fn a_layout_of_one_eye_renders_that_eye_alone() {
    let folder = Folder::new("viewer-one-eye");
    let mut viewer = open("builtin:cornell", &folder, |settings| {
        path_tracing(settings);
        settings.render.reuse = Reuse::Off;
    });
    let pictures = |app: &App| [0, 1].map(|eye| shown(app).shown.eyes[eye].pixels.clone());
    // Single samples of a lit room: eyes that see it from other places differ in far more than this.
    let far = |a: &[egui::Color32], b: &[egui::Color32]| {
        let differing = a.iter().zip(b).filter(|(a, b)| a.r().abs_diff(b.r()) > 60);
        differing.count()
    };
    let both = pictures(viewer.state());
    let mut layout = Layout::SideBySide;
    for (next, eye) in [(Layout::Left, 0), (Layout::Right, 1)] {
        choose(&mut viewer, layout.name(), next.name());
        layout = next;
        until(&mut viewer, "one eye", App::is_up_to_date);
        let frame = shown(viewer.state());
        let rendered = [0, 1].map(|eye| frame.pictures[eye].is_some());
        assert_eq!(rendered, [eye == 0, eye == 1]);
        let mut passes = frame.stats.pass_ms.keys();
        // A single eye lies in the left one's buffers, whichever it is.
        assert!(passes.all(|pass| !pass.starts_with("right.")));
        let one = &frame.shown.eyes[eye].pixels;
        let [own, other] = [eye, 1 - eye].map(|eye| far(one, &both[eye]));
        assert!(2 * own < other, "{next:?}: {own} {other}");
        // A click finds what that eye sees.
        let block = click_node(&mut viewer, "short block");
        assert_eq!(viewer.state().selected(), Some(block));
        until(&mut viewer, "radiance", |app| shown(app).radiance.is_some());

        press(&mut viewer, Modifiers::NONE, Key::F12);
        let png = folder.join(&format!("view_000{eye}.png"));
        until(&mut viewer, "a screenshot", |_| png.exists());
        let written = |name: &str| folder.join(&format!("view_000{eye}_{name}.exr")).exists();
        assert_eq!([written("left"), written("right")], rendered);
        let width = shown(viewer.state()).size[0];
        assert_eq!(read_image(&png).unwrap().width, width);
    }
    choose(&mut viewer, layout.name(), Layout::SideBySide.name());
    until(&mut viewer, "both eyes", App::is_up_to_date);
    let frame = shown(viewer.state());
    assert!(frame.pictures.iter().all(Option::is_some));
    assert_no_errors(&viewer);
}

#[test]
fn nodes_are_found_hidden_deleted_and_brought_back() {
    let (_folder, mut viewer) = cornell("viewer-nodes");
    let count = |app: &App, name: &str| {
        let node = node_of(app.document().scene(), name) as u32;
        let seen = &shown(app).seen[0];
        seen.nodes.iter().filter(|seen| **seen == node).count()
    };
    let inputs = fields(&viewer, Role::TextInput).into_iter();
    let search = inputs.min_by(|a, b| a.x.total_cmp(&b.x)).unwrap();
    click_at(&mut viewer, search);
    viewer.event(egui::Event::Text("TALL".to_owned()));
    two_steps(&mut viewer);
    assert!(viewer.query_by_label("short block").is_none());
    push(&mut viewer, "tall block");
    let node = node_of(viewer.state().document().scene(), "tall block");
    assert_eq!(viewer.state().selected(), Some(node));
    assert!(count(viewer.state(), "tall block") > 50);
    viewer.get_by_label("Visible").click();
    viewer.step();
    assert!(viewer.state().document().scene().nodes[node].is_hidden);
    settle(&mut viewer);
    assert_eq!(count(viewer.state(), "tall block"), 0);
    // The keyboard belongs to the picture again.
    let rect = viewer.state().shown_at[1].1;
    click_at(&mut viewer, rect.left_top() + vec2(3.0, 3.0));
    press(&mut viewer, Modifiers::COMMAND, Key::Z);
    settle(&mut viewer);
    assert!(count(viewer.state(), "tall block") > 50);
    click_node(&mut viewer, "tall block");
    press(&mut viewer, Modifiers::NONE, Key::Delete);
    assert_eq!(viewer.state().selected(), None);
    settle(&mut viewer);
    assert_eq!(count(viewer.state(), "tall block"), 0);
    press(&mut viewer, Modifiers::COMMAND, Key::Z);
    settle(&mut viewer);
    assert!(count(viewer.state(), "tall block") > 50);
    assert_no_errors(&viewer);
}

#[test]
fn escape_closes_what_is_open_and_asks_before_edits_are_lost() {
    use stereolux::viewer::app::WindowCommand;
    let (_folder, mut viewer) = cornell("viewer-escape");
    press(&mut viewer, Modifiers::NONE, Key::F1);
    viewer.step();
    assert!(viewer.query_by_label("this help").is_some());
    press(&mut viewer, Modifiers::NONE, Key::Escape);
    viewer.step();
    assert!(viewer.query_by_label("this help").is_none());
    // So are the log and what went wrong, and nothing is stopped by that.
    let context = viewer.ctx.clone();
    viewer.state_mut().open(&context, "notes.doc".to_owned());
    push(&mut viewer, "Window");
    push(&mut viewer, "Log");
    click_at(&mut viewer, egui::pos2(400.0, 700.0));
    let is_log_open = |viewer: &Viewer| viewer.query_all_by_label_contains(" s  ").count() > 0;
    assert!(is_log_open(&viewer));
    press(&mut viewer, Modifiers::NONE, Key::Escape);
    viewer.step();
    assert!(!is_log_open(&viewer));
    assert_eq!(errors(viewer.state()).len(), 1);
    press(&mut viewer, Modifiers::NONE, Key::Escape);
    assert_no_errors(&viewer);
    viewer.step();
    assert!(viewer.query_by_label("stopped").is_none());
    click_node(&mut viewer, "tall block");
    press(&mut viewer, Modifiers::NONE, Key::Delete);
    assert!(viewer.state().document().is_modified());
    for _ in 0..3 {
        press(&mut viewer, Modifiers::NONE, Key::Escape);
    }
    assert_eq!(viewer.state_mut().take_commands(), [], "Esc never quits");
    press(&mut viewer, Modifiers::COMMAND, Key::Q);
    viewer.step();
    assert_eq!(viewer.state_mut().take_commands(), []);
    assert!(viewer.state().title().ends_with("(not saved)"));
    assert!(viewer.query_by_label("Go on").is_some());
    viewer.get_by_label("Go on").click();
    viewer.step();
    press(&mut viewer, Modifiers::COMMAND, Key::Z);
    assert!(!viewer.state().document().is_modified());
    press(&mut viewer, Modifiers::COMMAND, Key::Q);
    assert_eq!(viewer.state_mut().take_commands(), [WindowCommand::Quit]);
    press(&mut viewer, Modifiers::NONE, Key::F11);
    let commands = viewer.state_mut().take_commands();
    assert_eq!(commands, [WindowCommand::ToggleFullScreen]);
}

/// On a slow adapter several presses fall into one pass: each counts.
#[test]
fn two_presses_within_one_pass_are_two() {
    let (_folder, mut viewer) = cornell("viewer-presses");
    let context = viewer.ctx.clone();
    for name in ["tall block", "short block"] {
        let node = node_of(viewer.state().document().scene(), name);
        viewer.state_mut().edit(&context, Edit::Delete { node });
    }
    let count = |viewer: &Viewer| viewer.state().document().history().count();
    assert_eq!(count(&viewer), 2);
    let twice = |viewer: &mut Viewer, modifiers, key| {
        let events = [true, false, true, false].map(|pressed| egui::Event::Key {
            key,
            physical_key: None,
            pressed,
            repeat: false,
            modifiers,
        });
        viewer.input_mut().events.extend(events);
        two_steps(viewer);
    };
    twice(&mut viewer, Modifiers::COMMAND, Key::Z);
    assert_eq!(count(&viewer), 0);
    twice(&mut viewer, Modifiers::COMMAND | Modifiers::SHIFT, Key::Z);
    assert_eq!(count(&viewer), 2);
    // A room of 2 m: twice as fast, twice.
    let speed = |viewer: &Viewer| {
        let line = viewer.get_by_label_contains("walks at ");
        let line = line.accesskit_node().value().unwrap();
        let words: Vec<&str> = line.split(' ').collect();
        words[2].parse::<f64>().unwrap()
    };
    let before = speed(&viewer);
    twice(&mut viewer, Modifiers::NONE, Key::CloseBracket);
    // Two decimals.
    assert!((speed(&viewer) - 4.0 * before).abs() < 0.03, "{before}");
    push(&mut viewer, "Motion");
    push(&mut viewer, "Walk");
    press(&mut viewer, Modifiers::NONE, Key::Space);
    let frame = |viewer: &Viewer| {
        let slider = viewer.get_by(|node| node.role() == Role::Slider);
        slider.accesskit_node().numeric_value().unwrap()
    };
    let before = frame(&viewer);
    twice(&mut viewer, Modifiers::NONE, Key::Period);
    assert_eq!(frame(&viewer), before + 2.0);
}
