//! A scene with the history of its edits, and the file that it came from.

use std::collections::VecDeque;
use std::path::Path;

use super::super::{Material, Node, PunctualLight, Scene, SceneError, builtin, import};
use super::{Edit, EditError};
use stereolux_base::files::KnownFile;
use stereolux_base::limits::{LoadBudget, LoadLimits};

/// Steps that can be undone; older ones are forgotten.
pub const HISTORY_LIMIT: usize = 1000;

/// What a scene was read from, kept for writing it back: its bytes, and the values that edits are told by.
#[derive(Clone, Debug, Default)]
pub struct Original {
    /// `builtin:NAME`, or the path as given.
    pub spec: String,
    /// The glTF or GLB file as it was read; other files that it names are read again when it is saved.
    pub bytes: Vec<u8>,
    /// Its nodes.
    pub nodes: Vec<Node>,
    /// Its roots.
    pub roots: Vec<usize>,
    /// Its materials.
    pub materials: Vec<Material>,
    /// Its lights.
    pub lights: Vec<PunctualLight>,
    /// What reading its files again may cost and reach.
    pub limits: LoadLimits,
    /// Files of its buffers and images, as they were.
    pub files: Vec<KnownFile>,
}

impl Original {
    /// Path of the file, against which files beside it are found; a name for embedded scenes.
    #[must_use]
    pub fn path(&self) -> &Path {
        Path::new(&self.spec)
    }

    /// Notes the values of `scene`, as it was read from `bytes`.
    #[must_use]
    pub fn new(spec: &str, bytes: Vec<u8>, scene: &Scene) -> Self {
        Self {
            spec: spec.to_owned(),
            bytes,
            nodes: scene.nodes.clone(),
            roots: scene.roots.clone(),
            materials: scene.materials.clone(),
            lights: scene.lights.clone(),
            limits: LoadLimits::default(),
            files: Vec::new(),
        }
    }
}

#[derive(Clone, Debug)]
struct Step {
    undo: Edit,
    redo: Edit,
    label: String,
    /// States of the scene before and after, by number.
    before: u64,
    after: u64,
    /// The drag that it belongs to.
    gesture: Option<u64>,
}

/// A scene that is edited.
#[derive(Clone, Debug, Default)]
pub struct Document {
    scene: Scene,
    original: Original,
    undo: VecDeque<Step>,
    redo: Vec<Step>,
    state: u64,
    saved: u64,
    last_state: u64,
    gesture: Option<u64>,
    gestures: u64,
    /// What was applied since it was last asked for, if anybody asks.
    changes: Option<Vec<Edit>>,
}

impl Document {
    /// Reads a scene: the path of a `.gltf` or `.glb`, or `builtin:NAME`. Takes as much memory as a load may by default.
    ///
    /// # Errors
    /// As [`Scene::load`] and [`Scene::builtin`].
    pub fn load(spec: &str) -> Result<Self, SceneError> {
        Self::load_within(spec, &LoadBudget::default())
    }

    /// As [`Document::load`], taking and reaching what `budget` allows; saving reads the scene's files within the same limits.
    ///
    /// # Errors
    /// As [`Document::load`].
    pub fn load_within(spec: &str, budget: &LoadBudget) -> Result<Self, SceneError> {
        let path = Path::new(spec);
        let is_embedded = spec.starts_with(builtin::PREFIX);
        let bytes = if is_embedded {
            builtin::glb(spec)?.into_owned()
        } else {
            import::read_file(path, budget)?
        };
        let mut scene = import::from_bytes(path, &bytes, budget)?;
        let again = LoadBudget::new(budget.limits());
        let files = import::files(path, &bytes, &again)?;
        if is_embedded {
            scene.environment = builtin::environment(spec)?;
        }
        let original = Original {
            limits: budget.limits(),
            files: files.into_iter().map(KnownFile::new).collect(),
            ..Original::new(spec, bytes, &scene)
        };
        Ok(Self::new(scene, original))
    }

    /// A scene that has been read already.
    #[must_use]
    pub fn new(scene: Scene, original: Original) -> Self {
        Self {
            scene,
            original,
            ..Self::default()
        }
    }

    /// The scene as it stands.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// As [`Scene::scale`]: no step of the history. Saved files keep it, as a node around all others.
    pub fn scale(&mut self, metres_per_unit: f64) {
        self.scene.scale(metres_per_unit);
    }

    /// Puts another environment around the scene: a setting, and no step of the history.
    pub fn set_environment(&mut self, environment: Option<super::super::Environment>) {
        self.scene.environment = environment;
    }

    /// What it was read from.
    #[must_use]
    pub fn original(&self) -> &Original {
        &self.original
    }

    /// For a copy of the scene elsewhere, in another thread for one: from the first call on, the edits that were applied
    /// since the last call, undone and redone ones too. Applied in order to a copy made at the first call, they bring it up
    /// to date; no mesh and no image is copied for it.
    pub fn take_changes(&mut self) -> Vec<Edit> {
        self.changes.replace(Vec::new()).unwrap_or_default()
    }

    fn note(&mut self, applied: &Edit) {
        if let Some(changes) = &mut self.changes {
            changes.push(applied.clone());
        }
    }

    /// Carries an edit out as a step of the history. One that changes nothing leaves no step. Within a gesture it takes the
    /// place of the step before it, if that changed the same thing.
    ///
    /// # Errors
    /// [`EditError`]; scene and history are then unchanged.
    pub fn edit(&mut self, edit: Edit) -> Result<(), EditError> {
        edit.check_by_hand(&self.scene)?;
        let label = edit.label(&self.scene);
        let redo = edit.clone();
        let undo = edit.apply(&mut self.scene)?;
        if redo.left_all(&undo) {
            return Ok(());
        }
        self.note(&redo);
        self.redo.clear();
        self.last_state += 1;
        let before = self.state;
        self.state = self.last_state;
        let merges = |last: &Step| {
            self.gesture.is_some()
                && last.gesture == self.gesture
                && last.redo.is_replaced_by(&redo)
        };
        if let Some(last) = self.undo.back_mut().filter(|last| merges(last)) {
            last.redo = redo;
            last.after = self.state;
            if last.redo.left_all(&last.undo) {
                // Dragged back to where it was.
                self.state = last.before;
                self.undo.pop_back();
            }
            return Ok(());
        }
        self.undo.push_back(Step {
            undo,
            redo,
            label,
            before,
            after: self.state,
            gesture: self.gesture,
        });
        if self.undo.len() > HISTORY_LIMIT {
            self.undo.pop_front();
        }
        Ok(())
    }

    /// A drag begins: until [`Document::end_gesture`], edits that replace one another are one step.
    pub fn begin_gesture(&mut self) {
        self.gestures += 1;
        self.gesture = Some(self.gestures);
    }

    /// Whether a drag has begun and is not over.
    #[must_use]
    pub fn is_in_gesture(&self) -> bool {
        self.gesture.is_some()
    }

    /// The drag is over.
    pub fn end_gesture(&mut self) {
        self.gesture = None;
    }

    /// Takes the last step back; false if there is none. Ends a gesture.
    ///
    /// # Errors
    /// [`EditError::Stale`] only if the history does not fit the scene, which nothing here lets happen.
    pub fn undo(&mut self) -> Result<bool, EditError> {
        self.end_gesture();
        let Some(step) = self.undo.back() else {
            return Ok(false);
        };
        let (edit, state) = (step.undo.clone(), step.before);
        edit.clone().apply(&mut self.scene)?;
        self.state = state;
        self.note(&edit);
        self.redo.extend(self.undo.pop_back());
        Ok(true)
    }

    /// Takes the step that was undone last again; false if there is none. Ends a gesture.
    ///
    /// # Errors
    /// As [`Document::undo`].
    pub fn redo(&mut self) -> Result<bool, EditError> {
        self.end_gesture();
        let Some(step) = self.redo.last() else {
            return Ok(false);
        };
        let (edit, state) = (step.redo.clone(), step.after);
        edit.clone().apply(&mut self.scene)?;
        self.state = state;
        self.note(&edit);
        self.undo.extend(self.redo.pop());
        Ok(true)
    }

    /// What undo would take back, for a menu; `None` if there is nothing.
    #[must_use]
    pub fn undo_label(&self) -> Option<&str> {
        self.undo.back().map(|step| step.label.as_str())
    }

    /// What redo would do again, for a menu; `None` if there is nothing.
    #[must_use]
    pub fn redo_label(&self) -> Option<&str> {
        self.redo.last().map(|step| step.label.as_str())
    }

    /// Labels of all steps that can be undone, the oldest first.
    pub fn history(&self) -> impl Iterator<Item = &str> {
        self.undo.iter().map(|step| step.label.as_str())
    }

    /// Whether the scene differs from what was loaded or saved last, as far as the history tells.
    #[must_use]
    pub fn is_modified(&self) -> bool {
        self.state != self.saved
    }

    /// The scene as it stands has been saved.
    pub fn mark_saved(&mut self) {
        self.saved = self.state;
        // A drag that goes on must not move the state that was saved.
        if self.gesture.is_some() {
            self.begin_gesture();
        }
    }
}
