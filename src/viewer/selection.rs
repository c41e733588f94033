//! The nodes that are selected, and what is done with all of them at once: one step of the history.

use glam::DAffine3;

use super::app::App;
use crate::scene::Scene;
use crate::scene::edit::Edit;

/// Nodes in the order in which they were selected. The last one is what the inspector edits and where the handles stand.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Selection {
    nodes: Vec<usize>,
}

impl Selection {
    /// All of them.
    pub fn nodes(&self) -> &[usize] {
        &self.nodes
    }

    /// The last one.
    pub fn last(&self) -> Option<usize> {
        self.nodes.last().copied()
    }

    /// Whether a node is among them.
    pub fn contains(&self, node: usize) -> bool {
        self.nodes.contains(&node)
    }

    /// This one alone, or nothing.
    pub fn set(&mut self, node: Option<usize>) {
        self.nodes.clear();
        self.nodes.extend(node);
    }

    /// What a click means: the node alone, or nothing; or, if it `adds`, the node too, or all but the node.
    pub fn click(&mut self, node: Option<usize>, adds: bool) {
        match node {
            _ if !adds => self.set(node),
            Some(node) if self.contains(node) => self.nodes.retain(|other| *other != node),
            Some(node) => self.nodes.push(node),
            None => {}
        }
    }

    /// Keeps those that the scene reaches.
    pub fn forget_missing(&mut self, scene: &Scene) {
        self.nodes.retain(|node| scene.reaches(*node));
    }

    /// For every node of the scene, whether it is selected or below what is; `None` without a selection.
    pub fn covered(&self, scene: &Scene) -> Option<Vec<bool>> {
        let subtrees = self.nodes.iter().map(|node| scene.subtree(*node));
        subtrees.reduce(|mut all, one| {
            all.iter_mut().zip(one).for_each(|(all, one)| *all |= one);
            all
        })
    }

    /// Those that hang below no other: what moves, goes or is copied takes along what is below it.
    pub fn tops(&self, scene: &Scene) -> Vec<usize> {
        let parent = |node: usize| scene.nodes.get(node).and_then(|node| node.parent);
        let hangs = |node: usize| {
            let mut above = std::iter::successors(parent(node), |at| parent(*at));
            above.any(|at| self.contains(at))
        };
        let tops = self.nodes.iter().copied();
        tops.filter(|node| !hangs(*node)).collect()
    }
}

/// Several edits as one; a single one as itself.
fn together(mut edits: Vec<Edit>) -> Option<Edit> {
    match edits.len() {
        0 | 1 => edits.pop(),
        _ => Some(Edit::Several(edits)),
    }
}

impl Selection {
    /// Takes all out of the scene.
    pub fn delete(&self, scene: &Scene) -> Option<Edit> {
        let mut tops = self.tops(scene);
        // Joints cannot go before what hangs on them.
        let holds_skin = |node: usize| {
            let inside = scene.subtree(node).into_iter().zip(&scene.nodes);
            let mut skinned = inside.map(|(is_inside, node)| is_inside && node.skin.is_some());
            skinned.any(|is| is)
        };
        tops.sort_by_cached_key(|node| !holds_skin(*node));
        let edits = tops.into_iter().map(|node| Edit::Delete { node });
        together(edits.collect())
    }

    /// Copies all; with the nodes that the copies will be.
    pub fn duplicate(&self, scene: &Scene) -> (Option<Edit>, Vec<usize>) {
        let tops = self.tops(scene);
        let mut next = scene.nodes.len();
        let copies = tops.iter().map(|node| {
            let copy = next;
            next += scene.subtree(*node).into_iter().filter(|is| *is).count();
            copy
        });
        let copies = copies.collect();
        let edits = tops.into_iter().map(|node| Edit::Duplicate { node });
        (together(edits.collect()), copies)
    }

    /// Shows or hides `node`, and if it is selected all that are.
    pub fn show(&self, node: usize, is_hidden: bool) -> Option<Edit> {
        let nodes = if self.contains(node) {
            self.nodes.as_slice()
        } else {
            &[node]
        };
        let edits = nodes
            .iter()
            .map(|&node| Edit::Visibility { node, is_hidden });
        together(edits.collect())
    }

    /// Brings the last one to `world_from_last`, and all others along as if it were one thing. Skinned meshes stay: their
    /// joints place them.
    pub fn carry(&self, scene: &Scene, world_from_last: DAffine3) -> Option<Edit> {
        let last = self.last()?;
        let world = scene.rest_pose().world_from_node;
        let step = world_from_last * world[last].inverse();
        let edits = self.tops(scene).into_iter().filter_map(|node| {
            let found = scene.nodes.get(node).filter(|node| node.skin.is_none())?;
            let world_from_node = if node == last {
                world_from_last
            } else {
                step * world[node]
            };
            let parent_from_node = match found.parent {
                Some(parent) => world[parent].inverse() * world_from_node,
                None => world_from_node,
            };
            Some(Edit::place(node, parent_from_node))
        });
        together(edits.collect())
    }
}

impl App {
    /// All nodes that are selected; the last one is [`App::selected`].
    pub fn all_selected(&self) -> &[usize] {
        self.selected.nodes()
    }

    pub(super) fn delete_selected(&mut self, context: &egui::Context) {
        if let Some(edit) = self.selected.delete(self.document.scene()) {
            self.edit(context, edit);
        }
        self.forget_missing();
    }

    pub(super) fn duplicate_selected(&mut self, context: &egui::Context) {
        let count = self.document.scene().nodes.len();
        let (edit, copies) = self.selected.duplicate(self.document.scene());
        if let Some(edit) = edit {
            self.edit(context, edit);
        }
        if self.document.scene().nodes.len() > count {
            self.selected = Selection { nodes: copies };
            self.fields.scroll_to_selected = true;
        }
    }
}

/// Whether the click that ends in this pass adds to what is selected.
pub fn adds(context: &egui::Context) -> bool {
    let is_adding = |event: &egui::Event| match event {
        egui::Event::PointerButton {
            pressed: false,
            modifiers,
            ..
        } => modifiers.command || modifiers.shift,
        _ => false,
    };
    context.input(|input| input.events.iter().any(is_adding))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn a_parent_takes_its_children_along_once_and_clicks_add_and_remove() {
        let mut scene = Scene::builtin("parade").unwrap();
        let is_below = |scene: &Scene, node: usize| scene.nodes[node].parent.is_some();
        let child = (0..scene.nodes.len())
            .find(|node| is_below(&scene, *node) && scene.nodes[*node].skin.is_none())
            .unwrap();
        let parent = scene.nodes[child].parent.unwrap();
        let mut selection = Selection::default();
        for node in [child, parent] {
            selection.click(Some(node), true);
        }
        assert_eq!(selection.nodes(), [child, parent]);
        assert_eq!(selection.tops(&scene), [parent]);
        assert_eq!(
            selection.delete(&scene),
            Some(Edit::Delete { node: parent })
        );
        selection.click(None, true);
        selection.click(Some(parent), true);
        assert_eq!(selection.nodes(), [child], "the sky changes nothing");

        // Both as one thing: the last one to where it is brought, its parent by the same way.
        selection.click(Some(parent), true);
        selection.click(Some(child), true);
        selection.click(Some(child), true);
        let world = |scene: &Scene| scene.rest_pose().world_from_node;
        let before = world(&scene);
        let way = DAffine3::from_translation(DVec3::new(0.5, -0.25, 2.0));
        let edit = selection.carry(&scene, way * before[child]).unwrap();
        edit.apply(&mut scene).unwrap();
        for node in [child, parent] {
            let is = world(&scene)[node];
            assert!(is.abs_diff_eq(way * before[node], 1e-9), "{node}");
        }
    }
}
