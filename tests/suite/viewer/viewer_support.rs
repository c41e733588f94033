//! The viewer without its window: egui's harness presses keys and buttons, and what comes of it is read from the state and
//! from the pixels that the rendering thread sends.

use std::time::{Duration, Instant};

use egui::accesskit::Role;
use egui::{Key, Modifiers, PointerButton, Pos2, Vec2, vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use stereolux::scene::edit::Document;
use stereolux::settings::{Method, Settings};
use stereolux::viewer::frames::FrameReport;
use stereolux::viewer::layout::Layout;
use stereolux::viewer::window_state::WindowState;
use stereolux::viewer::{App, Start};
use stereolux::xr::{Fov, Headset};

pub use crate::suite::scene::edits::node as node_of;
use crate::suite::support::Folder;

pub type Viewer = Harness<'static, App>;

/// Long enough for a loaded machine; reached only by a fault.
const PATIENCE: Duration = Duration::from_secs(180);
/// Pixels per eye.
pub const SIZE: [u32; 2] = [64, 64];

/// A headset that the scenes fill.
pub fn narrow() -> Headset {
    let fov = Fov::from_degrees(-21.0, 21.0, 21.0, -21.0);
    let headset = Headset::load("symmetric").unwrap();
    headset.with_fov(fov).unwrap()
}

pub fn open(scene: &str, folder: &Folder, change: impl FnOnce(&mut Settings)) -> Viewer {
    let mut settings = Settings {
        scene: scene.to_owned(),
        size: Some(SIZE),
        adapter: crate::suite::support::adapter_name().to_owned(),
        ..Settings::default()
    };
    settings.render.photon.count = 4096;
    change(&mut settings);
    let start = Start {
        document: Document::load(scene).unwrap(),
        settings,
        headset: narrow(),
        is_auto_lit: false,
        recording: None,
        out: folder.path().to_owned(),
        window_state: WindowState {
            layout: Layout::SideBySide,
            ..WindowState::default()
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

/// The Cornell box by paths, and the folder `name`, which must outlive the viewer.
pub fn cornell(name: &str) -> (Folder, Viewer) {
    let folder = Folder::new(name);
    let viewer = open("builtin:cornell", &folder, path_tracing);
    (folder, viewer)
}

/// Lets the viewer run until `done`.
pub fn until(viewer: &mut Viewer, what: &str, done: impl Fn(&App) -> bool) {
    let began = Instant::now();
    loop {
        viewer.step();
        if done(viewer.state()) {
            return;
        }
        let said = viewer.state().messages.iter().map(|m| &m.text);
        let said: Vec<&String> = said.collect();
        assert!(began.elapsed() < PATIENCE, "{what}: in vain; {said:?}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Lets the viewer run until a full frame is as `done` wants it.
pub fn until_shown(viewer: &mut Viewer, what: &str, done: impl Fn(&App) -> bool) {
    until(viewer, what, |app| app.is_up_to_date() && done(app));
}

/// Lets the viewer run until an error says so.
pub fn until_error(viewer: &mut Viewer, says: &str) {
    let is_said = |app: &App| errors(app).iter().any(|error| error.contains(says));
    until(viewer, says, is_said);
}

/// Two passes: egui measures a layout before it is shown.
pub fn two_steps(viewer: &mut Viewer) {
    viewer.step();
    viewer.step();
}

/// Presses the button of this label.
pub fn push(viewer: &mut Viewer, label: &str) {
    viewer.get_by_label(label).click();
    two_steps(viewer);
}

/// Clicks where the left eye sees the node of this name, and says which it is.
pub fn click_node(viewer: &mut Viewer, name: &str) -> usize {
    let at = place_of(viewer.state(), name);
    click_at(viewer, at);
    node_of(viewer.state().document().scene(), name)
}

/// Holds a key down for so many passes.
pub fn hold(viewer: &mut Viewer, key: Key, passes: u32) {
    viewer.key_down(key);
    for _ in 0..passes {
        viewer.step();
    }
    viewer.key_up(key);
    viewer.step();
}

/// Middles of the window's fields of a kind.
pub fn fields(viewer: &Viewer, role: Role) -> Vec<Pos2> {
    let fields = viewer.get_all_by_role(role);
    fields.map(|field| field.rect().center()).collect()
}

/// The left eye's picture.
pub fn picture(viewer: &Viewer) -> Vec<egui::Color32> {
    shown(viewer.state()).shown.eyes[0].pixels.clone()
}

pub fn assert_no_errors(viewer: &Viewer) {
    assert_eq!(errors(viewer.state()), Vec::<&str>::new());
}

pub fn shown(app: &App) -> &FrameReport {
    app.frame().unwrap()
}

/// Waits for a full frame of what has been asked for.
pub fn settle(viewer: &mut Viewer) {
    // What was just pressed is answered by the next pass.
    viewer.step();
    until(viewer, "a new full frame", App::is_up_to_date);
}

/// Middle of the pixels of the left eye that see `node`, and where that is in the window.
pub fn place_of(app: &App, name: &str) -> Pos2 {
    let scene = app.document().scene();
    let node = node_of(scene, name) as u32;
    let (part, rect) = app.shown_at[0];
    let seen = &shown(app).seen[part.eye()];
    let mut pixels: Vec<usize> = (0..seen.nodes.len()).collect();
    pixels.retain(|pixel| seen.nodes[*pixel] == node);
    assert!(pixels.len() > 10, "{name} is hardly seen");
    // One of them, for the middle of a hollow shape lies outside it.
    let pixel = pixels[pixels.len() / 2];
    let [x, y] = [pixel as u32 % seen.size[0], pixel as u32 / seen.size[0]];
    let place = vec2(x as f32 + 0.5, y as f32 + 0.5) / vec2(SIZE[0] as f32, SIZE[1] as f32);
    rect.min + place * rect.size()
}

fn button(viewer: &mut Viewer, pos: Pos2, pressed: bool, modifiers: Modifiers) {
    viewer.event(egui::Event::PointerButton {
        pos,
        button: PointerButton::Primary,
        pressed,
        modifiers,
    });
    viewer.step();
}

pub fn click_at(viewer: &mut Viewer, at: Pos2) {
    click_with(viewer, at, Modifiers::NONE);
}

pub fn click_with(viewer: &mut Viewer, at: Pos2, modifiers: Modifiers) {
    viewer.hover_at(at);
    viewer.step();
    button(viewer, at, true, modifiers);
    button(viewer, at, false, modifiers);
}

pub fn drag(viewer: &mut Viewer, from: Pos2, by: Vec2) {
    drag_with(viewer, from, by, |_| ());
}

/// Drags, and does something else half way.
pub fn drag_with(viewer: &mut Viewer, from: Pos2, by: Vec2, half_way: impl Fn(&mut Viewer)) {
    viewer.hover_at(from);
    two_steps(viewer);
    button(viewer, from, true, Modifiers::NONE);
    const STEPS: u32 = 6;
    for step in 1..=STEPS {
        let share = step as f32 / STEPS as f32;
        viewer.event(egui::Event::PointerMoved(from + by * share));
        viewer.step();
        if 2 * step == STEPS {
            half_way(viewer);
        }
    }
    button(viewer, from + by, false, Modifiers::NONE);
}

pub fn press(viewer: &mut Viewer, modifiers: Modifiers, key: Key) {
    viewer.key_press_modifiers(modifiers, key);
    viewer.step();
}

/// Share of pixels that differ.
pub fn changed(a: &FrameReport, b: &[egui::Color32]) -> f64 {
    let pixels = &a.shown.eyes[0].pixels;
    assert_eq!(pixels.len(), b.len());
    let differing = pixels.iter().zip(b).filter(|(a, b)| a != b).count();
    differing as f64 / b.len() as f64
}

pub fn errors(app: &App) -> Vec<&str> {
    let errors = app.messages.iter().filter(|message| message.is_error);
    errors.map(|message| message.text.as_str()).collect()
}

pub fn path_tracing(settings: &mut Settings) {
    settings.render.method = Method::Path;
    settings.render.path.max_depth = 3;
}

/// Replaces what stands in the field at a place, and ends with Enter.
pub fn type_into(viewer: &mut Viewer, at: Pos2, text: &str) {
    click_at(viewer, at);
    viewer.step();
    press(viewer, Modifiers::COMMAND, Key::A);
    viewer.event(egui::Event::Text(text.to_owned()));
    viewer.step();
    press(viewer, Modifiers::NONE, Key::Enter);
}

/// Picks `wanted` in the box that shows `now`.
pub fn choose(viewer: &mut Viewer, now: &str, wanted: &str) {
    if now == wanted {
        return;
    }
    viewer
        .get_by(|node| node.role() == Role::ComboBox && node.value().as_deref() == Some(now))
        .click();
    two_steps(viewer);
    let offered = viewer.get_all_by_label(wanted).last();
    let button = offered.unwrap_or_else(|| panic!("{wanted} is not offered"));
    button.scroll_to_me();
    button.click();
    two_steps(viewer);
}
