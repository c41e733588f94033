//! Pictures of what the window shows, as files.

use std::io::Write as _;
use std::path::Path;

use serde_json::json;

use super::frames::Wanted;
use super::render_engine::{EngineError, RenderEngine};
use crate::images::{Image, ImageError, ImageRgb, write_atomically, write_exr, write_png};
use crate::tone::tone_map_by;
use crate::xr::Pose;

/// Writes `view_NNNN.png` (the layout's eyes side by side, tone mapped), `view_NNNN_left.exr` and `view_NNNN_right.exr`
/// (linear radiance, mean of the frames so far; those eyes alone) and `view_NNNN.json` (from where, and how many frames)
/// under `folder`, with the first number that is free. `frames` as the window counts them: a reconstructed picture is a mean
/// of more than the device's. Returns a line for people.
///
/// # Errors
/// [`EngineError::Image`] naming the file.
pub fn write(
    folder: &Path,
    engine: &RenderEngine,
    wanted: &Wanted,
    size: [u32; 2],
    frames: u32,
) -> Result<String, EngineError> {
    let cannot = |reason: String| {
        EngineError::Image(ImageError::Unwritable {
            path: folder.to_owned(),
            reason,
        })
    };
    std::fs::create_dir_all(folder).map_err(|error| cannot(error.to_string()))?;
    let name = (0..10_000)
        .map(|number| format!("view_{number:04}"))
        .find(|name| !folder.join(format!("{name}.png")).exists())
        .ok_or_else(|| cannot("there are 10000 screenshots already".to_owned()))?;
    let means = [engine.mean(0)?, engine.mean(1)?];
    for (mean, eye) in means.iter().zip(["left", "right"]) {
        if let Some(mean) = mean {
            write_exr(&folder.join(format!("{name}_{eye}.exr")), mean)?;
        }
    }
    let [left_view, right_view] = &wanted.views;
    let about = json!({
        "frames": frames,
        "size": size,
        "scene": engine.scene().name,
        "left_eye": pose_words(&Pose::new(left_view.position_in_world, left_view.orientation)),
        "right_eye": pose_words(&Pose::new(right_view.position_in_world, right_view.orientation)),
    });
    write_atomically(&folder.join(format!("{name}.json")), |out| {
        writeln!(out, "{about:#}")
    })?;
    // Last: its name marks the number as taken.
    let path = folder.join(format!("{name}.png"));
    let output = &wanted.settings.render.output;
    let shown = |mean: &ImageRgb| tone_map_by(mean, output.exposure, output.tone);
    let picture = match &means {
        [Some(left), Some(right)] => Image::side_by_side(&shown(left), &shown(right))?,
        [Some(only), None] | [None, Some(only)] => shown(only),
        [None, None] => return Err(EngineError::NoRenderer),
    };
    write_png(&path, &picture)?;
    Ok(format!(
        "{} written, with an EXR of each eye that is shown",
        path.display()
    ))
}

/// A pose as `--pose` takes it.
fn pose_words(pose: &Pose) -> String {
    let (p, q) = (pose.position, pose.orientation);
    format!("{} {} {} {} {} {} {}", p.x, p.y, p.z, q.x, q.y, q.z, q.w)
}
