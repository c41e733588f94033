//! Several nodes at once: clicks that add and take away, and edits of all of them as one step.

use egui::{Key, Modifiers, vec2};
use egui_kittest::kittest::Queryable as _;
use glam::DVec3;
use stereolux::viewer::App;

use super::viewer_support::{
    Viewer, click_at, click_with, drag, errors, node_of, open, path_tracing, place_of, press,
    settle,
};
use crate::suite::support::Folder;

const BLOCKS: [&str; 2] = ["short block", "tall block"];

fn blocks(app: &App) -> [usize; 2] {
    BLOCKS.map(|name| node_of(app.document().scene(), name))
}

fn places(app: &App) -> [DVec3; 2] {
    let scene = app.document().scene();
    blocks(app).map(|node| scene.nodes[node].parent_from_node.translation)
}

fn are_reached(app: &App) -> [bool; 2] {
    let scene = app.document().scene();
    blocks(app).map(|node| scene.reaches(node))
}

fn undo(viewer: &mut Viewer) {
    press(viewer, Modifiers::COMMAND, Key::Z);
}

/// Both blocks, by clicks in the picture; the tall one last.
fn both_selected(folder: &Folder) -> Viewer {
    let mut viewer = open("builtin:cornell", folder, path_tracing);
    let [short, tall] = BLOCKS.map(|name| place_of(viewer.state(), name));
    click_at(&mut viewer, short);
    click_with(&mut viewer, tall, Modifiers::COMMAND);
    assert_eq!(viewer.state().all_selected(), blocks(viewer.state()));
    viewer.step();
    viewer
}

#[test]
fn clicks_with_ctrl_or_shift_add_and_take_away_in_the_picture_and_in_the_tree() {
    let folder = Folder::new("viewer-selection");
    let mut viewer = both_selected(&folder);
    let [short, tall] = blocks(viewer.state());
    assert_eq!(
        viewer.state().selected(),
        Some(tall),
        "the last one is edited"
    );
    assert!(viewer.query_by_label_contains("2 selected").is_some());
    let at = place_of(viewer.state(), BLOCKS[1]);
    click_with(&mut viewer, at, Modifiers::SHIFT);
    assert_eq!(viewer.state().all_selected(), [short]);
    viewer.step();
    assert!(viewer.query_by_label_contains("2 selected").is_none());
    for expected in [vec![short, tall], vec![short]] {
        let row = viewer.get_by_label(BLOCKS[1]).rect().center();
        click_with(&mut viewer, row, Modifiers::COMMAND);
        assert_eq!(viewer.state().all_selected(), expected);
    }
    // A click alone is what it was.
    click_at(&mut viewer, at);
    assert_eq!(viewer.state().all_selected(), [tall]);
    press(&mut viewer, Modifiers::NONE, Key::Escape);
    assert_eq!(viewer.state().all_selected(), [0_usize; 0]);
}

#[test]
fn all_that_is_selected_is_deleted_hidden_copied_and_moved_as_one_step() {
    let folder = Folder::new("viewer-several");
    let mut viewer = both_selected(&folder);
    let before = places(viewer.state());
    let steps = |viewer: &Viewer| viewer.state().document().history().count();
    press(&mut viewer, Modifiers::NONE, Key::Delete);
    assert_eq!(are_reached(viewer.state()), [false; 2]);
    assert_eq!(steps(&viewer), 1);
    assert_eq!(viewer.state().all_selected(), [0_usize; 0]);
    undo(&mut viewer);
    assert_eq!(are_reached(viewer.state()), [true; 2]);
    assert!(!viewer.state().document().is_modified());

    settle(&mut viewer);
    for (name, modifiers) in BLOCKS.into_iter().zip([Modifiers::NONE, Modifiers::SHIFT]) {
        let at = place_of(viewer.state(), name);
        click_with(&mut viewer, at, modifiers);
    }
    viewer.step();
    viewer.get_by_label("Visible").click();
    viewer.step();
    let hidden = |app: &App| blocks(app).map(|node| app.document().scene().nodes[node].is_hidden);
    assert_eq!(hidden(viewer.state()), [true; 2]);
    assert_eq!(steps(&viewer), 1);
    undo(&mut viewer);
    assert_eq!(hidden(viewer.state()), [false; 2]);

    // By the handles, which stand at the last one.
    settle(&mut viewer);
    let [x_handle, ..] = viewer.state().gizmo.handles().expect("handles");
    drag(&mut viewer, x_handle, vec2(40.0, 0.0));
    let after = places(viewer.state());
    let ways = [0, 1].map(|block| after[block] - before[block]);
    assert!(ways[0].x > 0.02, "{ways:?}");
    // f64's half unit on metres, over the steps of a drag.
    assert!((ways[0] - ways[1]).length() < 1e-12, "{ways:?}");
    assert_eq!(steps(&viewer), 1, "a drag is one step");
    undo(&mut viewer);
    assert_eq!(places(viewer.state()), before);

    let count = viewer.state().document().scene().nodes.len();
    press(&mut viewer, Modifiers::COMMAND, Key::D);
    assert_eq!(steps(&viewer), 1);
    let scene = viewer.state().document().scene();
    let copies = viewer.state().all_selected();
    assert_eq!(copies, [count, count + 1]);
    assert!(copies.iter().all(|copy| scene.reaches(*copy)));
    undo(&mut viewer);
    assert_eq!(viewer.state().document().scene().nodes.len(), count);
    let said = errors(viewer.state());
    assert!(said.is_empty(), "{said:?}");
}
