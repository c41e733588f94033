//! What widgets remember from one pass to the next.

use std::path::Path;

use super::layout::Part;
use super::save_files::Saved;
use crate::scene::builtin::PREFIX;
use crate::scene::edit::Original;

/// What text fields hold while they are written in, and other state of widgets.
#[derive(Clone, Debug, Default)]
pub struct Fields {
    /// Search of the hierarchy.
    pub search: String,
    /// Search of the settings.
    pub settings_search: String,
    /// Where the edited scene is saved.
    pub scene_path: String,
    /// Where settings are saved.
    pub settings_path: String,
    /// A setting that is being written, and the text so far.
    pub setting: Option<(&'static str, String)>,
    /// What was wrong with the last setting, by key.
    pub refused: Option<(&'static str, String)>,
    /// The settings panel shows the other settings of the split view.
    pub edits_other: bool,
    /// Mesh and materials of a node among so many of the scene, with how many meshes have each.
    pub materials: Option<(usize, usize, Vec<[usize; 3]>)>,
    /// A rename in hand.
    pub name: Option<(usize, String)>,
    /// The tree has to show the selected node.
    pub scroll_to_selected: bool,
    /// Middle of the selected node and what is below it, in the node's own space.
    pub pivot: Option<(usize, glam::DVec3)>,
    /// The picture that has the gizmo.
    pub gizmo_part: Option<Part>,
    /// A field for text had the keyboard at the end of the last pass.
    pub had_text: bool,
    /// What a drag with the middle button goes around, and moves with: metres ahead of the head.
    pub orbit_m: f64,
    /// Keys that went down with Ctrl and are not up again: they command, and move nobody.
    pub commanding: Vec<egui::Key>,
    /// The divider of the split view is held.
    pub drags_divider: bool,
}

impl Fields {
    /// Empty, with names for files beside which nothing stands yet.
    pub fn new(out: &Path, original: &Original) -> Self {
        let stem = original.path().file_stem().map_or_else(
            || "scene".into(),
            |stem| stem.to_string_lossy().into_owned(),
        );
        let stem = stem.trim_start_matches(PREFIX).to_owned();
        let in_out = |name: String| out.join(name).to_string_lossy().into_owned();
        Self {
            scene_path: in_out(format!("{stem}_edited.glb")),
            settings_path: in_out("settings.toml".to_owned()),
            ..Self::default()
        }
    }

    /// Where this is saved.
    pub fn path_of(&mut self, what: Saved) -> &mut String {
        match what {
            Saved::Scene => &mut self.scene_path,
            Saved::Settings => &mut self.settings_path,
        }
    }
}
