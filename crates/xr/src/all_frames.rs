//! A session that nothing is rendered for: the views that it would show.

use super::{FrameSubmission, View, XrError, XrSession};

/// Runs a session to its end, `most` frames at most, and returns the display time (nanoseconds) and both eyes' views of
/// every frame that is to be seen.
///
/// # Errors
/// Those of the session.
pub fn all_frames(
    session: &mut dyn XrSession,
    most: usize,
) -> Result<Vec<(i64, [View; 2])>, XrError> {
    let mut frames = Vec::new();
    while frames.len() < most
        && let Some(state) = session.wait_frame()?
    {
        let time_ns = state.predicted_display_time_ns;
        session.begin_frame()?;
        let located = if state.should_render {
            session.locate_views(time_ns)?;
            session.relocate_views(time_ns)?
        } else {
            None
        };
        if let Some(located) = &located {
            session.acquire_targets()?;
            frames.push((time_ns, located.views));
        }
        session.end_frame(FrameSubmission::new(time_ns, located.as_ref()))?;
    }
    Ok(frames)
}
