//! The scene as a tree, with search.

use std::iter::successors;

use egui::collapsing_header::CollapsingState;
use egui::{Panel, ScrollArea, TextEdit, Ui};

use crate::scene::{Node, Scene};
use crate::viewer::app::App;
use crate::viewer::selection::{self, Selection};

/// Nodes whose subtrees are open at first: a scene of thousands of nodes opens only its roots.
const OPEN_UP_TO: usize = 200;
/// Matches of a search that are listed.
const MOST_MATCHES: usize = 500;

/// Width of the panel at least where the window has room, points: it comes back when a small window grows again.
const LEAST_WIDTH: f32 = 140.0;

/// The left panel.
pub fn show(app: &mut App, ui: &mut Ui) {
    if !app.window_state.hierarchy {
        return;
    }
    let panel = Panel::left("hierarchy").default_size(210.0);
    let panel = panel.min_size(LEAST_WIDTH);
    let panel = panel.max_size(super::MOST_OF_WINDOW * ui.ctx().content_rect().width());
    panel.show(ui, |ui| {
        ui.horizontal(|ui| {
            ui.label("Scene");
            ui.weak(&app.document.scene().name);
        });
        ui.add(
            TextEdit::singleline(&mut app.fields.search)
                .hint_text("Search nodes")
                .desired_width(f32::INFINITY),
        );
        ui.separator();
        let mut asked = Asked::default();
        let wanted = app.fields.search.trim().to_lowercase();
        let selected = &app.selected;
        let scrolls = std::mem::take(&mut app.fields.scroll_to_selected);
        ScrollArea::both().auto_shrink(false).show(ui, |ui| {
            let scene = app.document.scene();
            if wanted.is_empty() {
                // Ancestors of the selection open, so that it can be seen.
                let last = selected.last().filter(|_| scrolls);
                let up = successors(last, |node| scene.nodes.get(*node)?.parent);
                let opened: Vec<usize> = up.skip(1).collect();
                let tree = Tree {
                    scene,
                    selected,
                    opened: &opened,
                    scrolls,
                };
                for root in &scene.roots {
                    tree.show(ui, *root, 0, &mut asked);
                }
            } else {
                let mut matches = 0;
                for (index, _) in scene.placed_nodes() {
                    let node = &scene.nodes[index];
                    if node.name.to_lowercase().contains(&wanted) {
                        matches += 1;
                        if matches <= MOST_MATCHES {
                            row(ui, index, node, selected, false, &mut asked);
                        }
                    }
                }
                ui.weak(match matches {
                    0 => "nothing has that in its name".to_owned(),
                    n if n > MOST_MATCHES => format!("{n} nodes, the first {MOST_MATCHES} shown"),
                    n => format!("{n} nodes"),
                });
            }
        });
        let context = ui.ctx().clone();
        if let Some(node) = asked.select {
            app.selected.click(Some(node), selection::adds(&context));
        }
        if let Some(node) = asked.focus
            && !selection::adds(&context)
        {
            app.select(Some(node));
            app.focus_selected();
        }
        if let Some((node, is_hidden)) = asked.show
            && let Some(edit) = app.selected.show(node, is_hidden)
        {
            app.edit(&context, edit);
        }
    });
}

/// Levels of the tree: egui's stack grows with each. What lies deeper is selected in the picture.
const DEEPEST: usize = 64;

/// What was clicked.
#[derive(Default)]
struct Asked {
    select: Option<usize>,
    focus: Option<usize>,
    /// A node, and whether it is hidden from now on.
    show: Option<(usize, bool)>,
}

struct Tree<'a> {
    scene: &'a Scene,
    selected: &'a Selection,
    opened: &'a [usize],
    scrolls: bool,
}

impl Tree<'_> {
    fn show(&self, ui: &mut Ui, index: usize, depth: usize, asked: &mut Asked) {
        let Some(node) = self.scene.nodes.get(index) else {
            return;
        };
        let show_row = |ui: &mut Ui, asked: &mut Asked| {
            row(ui, index, node, self.selected, self.scrolls, asked);
        };
        if node.children.is_empty() || depth == DEEPEST {
            ui.horizontal(|ui| {
                ui.add_space(ui.spacing().indent);
                show_row(ui, asked);
            });
            return;
        }
        let opens = self.scene.nodes.len() <= OPEN_UP_TO;
        let id = ui.make_persistent_id(("node", index));
        let mut state = CollapsingState::load_with_default_open(ui.ctx(), id, opens);
        if self.opened.contains(&index) {
            state.set_open(true);
        }
        state.show_header(ui, |ui| show_row(ui, asked)).body(|ui| {
            for child in &node.children {
                self.show(ui, *child, depth + 1, asked);
            }
        });
    }
}

/// One node: its kind, its name, whether it is shown.
fn row(
    ui: &mut Ui,
    index: usize,
    node: &Node,
    selected: &Selection,
    scrolls: bool,
    asked: &mut Asked,
) {
    ui.horizontal(|ui| {
        let mut is_shown = !node.is_hidden;
        let toggle = ui.checkbox(&mut is_shown, "").on_hover_text("shown");
        if toggle.changed() {
            asked.show = Some((index, !is_shown));
        }
        let is_selected = selected.contains(index);
        let name = if node.name.is_empty() {
            "(no name)"
        } else {
            &node.name
        };
        let response = ui
            .selectable_label(is_selected, name)
            .on_hover_text(format!("{}, node {index}", kind(node)));
        if response.clicked() {
            asked.select = Some(index);
        }
        if response.double_clicked() {
            asked.focus = Some(index);
        }
        if selected.last() == Some(index) && scrolls {
            response.scroll_to_me(Some(egui::Align::Center));
        }
    });
}

/// What a node is, in a word or two.
pub fn kind(node: &Node) -> &'static str {
    match (node.mesh, node.light, node.camera) {
        (Some(_), _, _) if node.skin.is_some() => "skinned mesh",
        (Some(_), _, _) => "mesh",
        (_, Some(_), _) => "light",
        (_, _, Some(_)) => "camera",
        _ => "group",
    }
}
