//! Controllers' models as a runtime has them, and where a recording keeps them: beside itself.

use std::path::{Component, Path};

use serde::Serializer;
use serde_json::Value;
use stereolux_base::files::{self, Unreachable};
use stereolux_base::limits::{LoadBudget, LoadLimits};

use super::input::Side;
use super::trace::Fields;
use super::validation::Fault;

/// Models larger than this are refused, bytes.
pub(super) const MOST_BYTES: u32 = 64 << 20;

/// What a controller looks like.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ControllerModel {
    /// The hand that holds it.
    pub side: Side,
    /// Binary glTF, its origin at the grip; nobody has checked it.
    pub glb: Vec<u8>,
}

/// Names of files with models, left and right.
pub(super) type ModelNames = [Option<String>; 2];

/// What a recording's file of a model is called.
pub(super) fn file_name(recording: &Path, side: Side) -> String {
    let stem = recording.file_stem().and_then(|stem| stem.to_str());
    // As `read_name` takes it.
    let stem = stem.unwrap_or("recording").replace(['\\', ':'], "_");
    format!("{stem}.{}.glb", side.word())
}

/// What all models of a recording may take together: one for each hand, and as often again when a session is lost.
pub(super) fn budget() -> LoadBudget {
    LoadBudget::new(LoadLimits {
        memory_bytes: 8 * u64::from(MOST_BYTES),
        ..LoadLimits::default()
    })
}

/// Reads a file that a recording names.
pub(super) fn load(recording: &Path, name: &str, budget: &LoadBudget) -> Result<Vec<u8>, String> {
    let folder = recording.parent().unwrap_or(recording);
    let place = files::below(folder, Path::new(name)).map_err(|error| match error {
        Unreachable::Missing(reason) => reason,
        Unreachable::Outside => "it lies outside the recording's folder".to_owned(),
    });
    place
        .and_then(|place| files::load_regular(&place, budget))
        .map_err(|reason| format!("'{name}' cannot be read: {reason}"))
}

/// The names in a frame's line.
pub(super) fn read_names(path: &str, value: &Value) -> Result<ModelNames, Fault> {
    let fields = Fields::of(path, value, &Side::BOTH.map(Side::word))?;
    let [left, right] = Side::BOTH.map(|side| fields.optional(side.word(), read_name));
    Ok([left?, right?])
}

/// A file beside the recording, and nothing that leads elsewhere on any system.
fn read_name(path: &str, value: &Value) -> Result<String, Fault> {
    let name = value.as_str().unwrap_or_default();
    let mut components = Path::new(name).components();
    let is_plain = matches!(components.next(), Some(Component::Normal(_)))
        && components.next().is_none()
        && !name.contains(['/', '\\', ':', '\0']);
    if is_plain {
        return Ok(name.to_owned());
    }
    let what = format!("{value} is not the name of a file beside the recording");
    Err(Fault::new(path, what))
}

/// As a frame's line has them.
pub(super) fn write_names<S: Serializer>(
    names: &ModelNames,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let known = Side::BOTH.into_iter().zip(names);
    serializer.collect_map(known.filter_map(|(side, name)| Some((side.word(), name.as_ref()?))))
}
