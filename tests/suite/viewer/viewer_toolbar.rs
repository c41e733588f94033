//! The toolbar, kept views, the frozen picture, hidden panels and the log.

use egui::accesskit::Role;
use egui::{Key, Modifiers, Pos2, Rect, Shape, TextureFilter, vec2};
use egui_kittest::kittest::Queryable as _;
use stereolux::images::{ImageRgb, aces_filmic, srgb_encode, write_exr};
use stereolux::settings::{Switch, Tone};
use stereolux::viewer::App;
use stereolux::viewer::panels::help::KEYS;

use super::viewer_support::{
    Viewer, assert_no_errors, choose, click_at, cornell, drag, fields, hold, node_of, open,
    path_tracing, place_of, press, push, settle, shown, two_steps, type_into, until_shown,
};
use crate::suite::support::Folder;

/// The cornell box under surroundings of the same radiance everywhere, which the corners of the pictures see.
fn surrounded(folder: &Folder) -> Viewer {
    let sky = folder.join("sky.exr");
    write_exr(&sky, &ImageRgb::filled(8, 4, [0.2; 3]).unwrap()).unwrap();
    let mut viewer = open("builtin:cornell", folder, path_tracing);
    let path = sky.to_string_lossy().into_owned();
    let context = viewer.ctx.clone();
    viewer.state_mut().open(&context, path);
    until_shown(&mut viewer, "the sky", |app| corner(app) != 0);
    viewer
}

fn corner(app: &App) -> u8 {
    shown(app).shown.eyes[0].pixels[0].r()
}

#[test]
fn exposure_curve_denoiser_and_surroundings_change_what_is_shown() {
    let folder = Folder::new("viewer-toolbar");
    let mut viewer = surrounded(&folder);
    let byte = |linear: f32| (srgb_encode(linear) * 255.0).round() as u8;
    assert_eq!(corner(viewer.state()), byte(aces_filmic(0.2)));

    // One stop, typed.
    let numbers = fields(&viewer, Role::SpinButton).into_iter();
    let exposure = numbers.min_by(|a, b| a.y.total_cmp(&b.y)).unwrap();
    type_into(&mut viewer, exposure, "1");
    let brighter = byte(aces_filmic(0.4));
    until_shown(&mut viewer, "a brighter sky", |app| corner(app) == brighter);
    assert_eq!(viewer.state().settings().render.output.exposure, 2.0);

    choose(&mut viewer, "aces curve", "linear");
    assert_eq!(viewer.state().settings().render.output.tone, Tone::Linear);
    until_shown(&mut viewer, "the linear curve", |app| {
        corner(app) == byte(0.4)
    });

    let denoises = |viewer: &Viewer| viewer.state().settings().render.reconstruct.svgf;
    for switch in [Switch::Off, Switch::On] {
        push(&mut viewer, "Denoise");
        assert_eq!(denoises(&viewer), switch, "auto denoises");
        settle(&mut viewer);
    }

    push(&mut viewer, "Surroundings: sky.exr");
    viewer.get_by_label("None").click();
    until_shown(&mut viewer, "no sky", |app| corner(app) == 0);
    assert_eq!(viewer.state().settings().environment.path, "");
    assert_no_errors(&viewer);
}

/// Textures that are drawn into `picture`, and where they would lie if nothing were cut off.
fn drawn(viewer: &Viewer, picture: Rect) -> Vec<(egui::TextureId, Rect, Rect)> {
    let shapes = viewer.output().shapes.iter();
    let drawn = shapes.filter_map(|clipped| match &clipped.shape {
        Shape::Mesh(mesh) => Some((mesh.texture_id, mesh.calc_bounds(), clipped.clip_rect)),
        _ => None,
    });
    let is_here = |clip: &Rect| picture.expand(0.5).contains_rect(*clip);
    drawn.filter(|(.., clip)| is_here(clip)).collect()
}

/// Parts of the screen on which textures are drawn within `picture`.
fn textured(viewer: &Viewer, picture: Rect) -> Vec<(egui::TextureId, Rect)> {
    let drawn = drawn(viewer, picture).into_iter();
    let visible = drawn.map(|(texture, bounds, clip)| (texture, bounds.intersect(clip)));
    visible.collect()
}

#[test]
fn a_frozen_picture_stays_left_of_a_line_that_is_dragged() {
    let (_folder, mut viewer) = cornell("viewer-frozen");
    viewer.step();
    let picture = viewer.state().shown_at[0].1;
    let [(present, whole)] = textured(&viewer, picture)[..] else {
        panic!("{:?}", textured(&viewer, picture));
    };
    assert_eq!(whole, picture);

    push(&mut viewer, "Freeze A");
    // Walking changes B alone.
    hold(&mut viewer, Key::W, 2);
    settle(&mut viewer);
    let line = |viewer: &Viewer| {
        let drawn = textured(viewer, picture);
        let [(_, b), (a, left)] = drawn[..] else {
            panic!("{drawn:?}");
        };
        assert_ne!(a, present);
        assert_eq!(b, picture);
        assert_eq!(left.min, picture.min);
        left.max.x
    };
    viewer.step();
    let before = line(&viewer);
    assert!((before - picture.center().x).abs() < 1.0, "{before}");
    let head = viewer.state().head();
    let on_line = Pos2::new(before, picture.center().y);
    drag(&mut viewer, on_line, vec2(-60.0, 0.0));
    viewer.step();
    // By the drag, to a point, and nothing looked around meanwhile.
    let after = line(&viewer);
    assert!((before - 60.0 - after).abs() < 1.0, "{before} {after}");
    assert_eq!(viewer.state().head(), head);

    // Enlarged, its pixels are squares as those of the present one are.
    let magnified = |viewer: &Viewer| {
        let textures = viewer.ctx.tex_manager();
        let (frozen, _) = textured(viewer, picture)[1];
        textures.read().meta(frozen).unwrap().options.magnification
    };
    assert_eq!(magnified(&viewer), TextureFilter::Linear);
    viewer.hover_at(picture.min + vec2(20.0, 100.0));
    viewer.event(egui::Event::Zoom(4.0));
    two_steps(&mut viewer);
    assert_eq!(magnified(&viewer), TextureFilter::Nearest);
    press(&mut viewer, Modifiers::NONE, Key::Escape);
    viewer.step();

    push(&mut viewer, "Freeze A");
    assert_eq!(textured(&viewer, picture).len(), 1);
}

#[test]
fn a_picture_is_enlarged_about_the_pointer_shifted_and_shown_whole_again() {
    let (_folder, mut viewer) = cornell("viewer-zoom");
    viewer.step();
    let picture = viewer.state().shown_at[0].1;
    let at = place_of(viewer.state(), "short block");
    let whole = |viewer: &Viewer| drawn(viewer, picture)[0].1;
    assert_eq!(whole(&viewer), picture);
    let share = (at - picture.min) / picture.size();
    viewer.hover_at(at);
    viewer.event(egui::Event::Zoom(4.0));
    two_steps(&mut viewer);
    let enlarged = whole(&viewer);
    // f32 on some hundred points.
    assert!((enlarged.size() - 4.0 * picture.size()).length() < 0.01);
    let there = enlarged.min + share * enlarged.size();
    assert!((there - at).length() < 0.01, "{there}");
    // Both pictures show the same part.
    let other = viewer.state().shown_at[1].1;
    let of_other = drawn(&viewer, other)[0].1;
    assert!(((of_other.min - other.min) - (enlarged.min - picture.min)).length() < 0.01);

    // What is seen there is still what is clicked.
    click_at(&mut viewer, at);
    viewer.step();
    let block = node_of(viewer.state().document().scene(), "short block");
    assert_eq!(viewer.state().selected(), Some(block));

    // Ctrl and a drag shift the picture, and turn nobody's head.
    let head = viewer.state().head();
    viewer.event(egui::Event::ModifiersChanged(Modifiers::COMMAND));
    let corner = picture.min + vec2(30.0, 30.0);
    drag(&mut viewer, corner, vec2(20.0, 10.0));
    viewer.step();
    let shifted = whole(&viewer).min - enlarged.min;
    assert!(shifted.x > 10.0 && shifted.y > 5.0, "{shifted}");
    assert_eq!(viewer.state().head(), head);
    viewer.event(egui::Event::ModifiersChanged(Modifiers::NONE));
    viewer.step();

    // Esc shows all, and leaves the selection for the next one.
    press(&mut viewer, Modifiers::NONE, Key::Escape);
    viewer.step();
    assert_eq!(whole(&viewer), picture);
    assert_eq!(viewer.state().selected(), Some(block));
    press(&mut viewer, Modifiers::NONE, Key::Escape);
    assert_eq!(viewer.state().selected(), None);
}

#[test]
fn views_are_kept_panels_hide_and_the_log_has_what_was_said() {
    let (_folder, mut viewer) = cornell("viewer-kept");
    let shifted = Modifiers::COMMAND | Modifiers::SHIFT;
    let start = viewer.state().head();
    // What Shift makes of the digit on an American keyboard.
    viewer.event_modifiers(
        egui::Event::Key {
            key: Key::Exclamationmark,
            physical_key: Some(Key::Num1),
            pressed: true,
            repeat: false,
            modifiers: shifted,
        },
        shifted,
    );
    viewer.step();
    hold(&mut viewer, Key::W, 5);
    assert_ne!(viewer.state().head(), start);
    // Nothing is kept there: it is said, and nobody moves.
    let walked = viewer.state().head();
    press(&mut viewer, Modifiers::COMMAND, Key::Num2);
    assert_eq!(viewer.state().head(), walked);
    press(&mut viewer, Modifiers::COMMAND, Key::Num1);
    assert_eq!(viewer.state().head(), start);

    viewer.step();
    let beside = viewer.state().shown_at[0].1.width();
    assert!(viewer.query_by_label("Freeze A").is_some());
    press(&mut viewer, Modifiers::NONE, Key::Tab);
    viewer.step();
    assert!(viewer.query_by_label("Freeze A").is_none());
    assert!(viewer.state().shown_at[0].1.width() > beside);
    press(&mut viewer, Modifiers::NONE, Key::Escape);
    viewer.step();
    assert!(viewer.query_by_label("Freeze A").is_some());
    assert_eq!(viewer.state().shown_at[0].1.width(), beside);

    push(&mut viewer, "Window");
    push(&mut viewer, "Log");
    for said in ["view 1 kept", "no view 2 is kept"] {
        let lines = viewer.query_all_by_label_contains(said);
        assert!(lines.count() > 0, "{said}");
    }
}

/// Whether all of a text is painted.
fn is_seen(viewer: &Viewer, text: &str) -> bool {
    viewer.output().shapes.iter().any(|clipped| {
        matches!(&clipped.shape, Shape::Text(shape) if shape.galley.text() == text
            && clipped.clip_rect.contains_rect(shape.visual_bounding_rect()))
    })
}

#[test]
fn panels_messages_and_help_fit_the_window() {
    let (_folder, mut viewer) = cornell("viewer-narrow");
    press(&mut viewer, Modifiers::NONE, Key::F1);
    two_steps(&mut viewer);
    for (keys, what) in KEYS {
        assert!(is_seen(&viewer, keys) && is_seen(&viewer, what), "{keys}");
    }
    press(&mut viewer, Modifiers::NONE, Key::Escape);

    viewer.set_size(vec2(520.0, 600.0));
    let node = node_of(viewer.state().document().scene(), "tall block");
    viewer.state_mut().select(Some(node));
    let context = viewer.ctx.clone();
    let name = "no scene at all, ".repeat(12) + "notes.doc";
    viewer.state_mut().open(&context, name);
    for _ in 0..6 {
        viewer.step();
    }
    let close = viewer.get_by_label("Close").rect();
    assert!(close.max.x < 520.0, "{close:?}");
    let tab = viewer.get_by_label("Settings").rect();
    assert!(tab.max.x < 520.0, "{tab:?}");
    // What does not fit is scrolled into view.
    let label = "Rotation, degrees";
    let before = viewer.get_by_label(label).rect();
    viewer.hover_at(before.center());
    viewer.step();
    viewer.event(egui::Event::MouseWheel {
        unit: egui::MouseWheelUnit::Point,
        delta: vec2(-60.0, 0.0),
        phase: egui::TouchPhase::Move,
        source: egui::MouseWheelSource::Unknown,
        modifiers: Modifiers::NONE,
    });
    for _ in 0..30 {
        viewer.step();
    }
    let after = viewer.get_by_label(label).rect();
    assert!(after.min.x < before.min.x - 20.0, "{before:?} {after:?}");

    // A window that was hardly there has its panels again.
    for size in [vec2(40.0, 40.0), vec2(1280.0, 800.0)] {
        viewer.set_size(size);
        for _ in 0..6 {
            viewer.step();
        }
    }
    let inputs = viewer.get_all_by_role(Role::TextInput);
    let widths: Vec<f32> = inputs.map(|input| input.rect().width()).collect();
    assert!(widths.iter().all(|width| *width > 100.0), "{widths:?}");
}
