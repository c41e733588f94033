//! Values of actions as the last sync left them; at rest where nothing drives them, and for what is no number.

use glam::DVec2;
use openxr as xr;

/// Whether a button is held.
pub(super) fn held<G>(
    action: &xr::Action<bool>,
    session: &xr::Session<G>,
    path: xr::Path,
) -> xr::Result<bool> {
    let state = action.state(session, path)?;
    Ok(state.is_active && state.current_state)
}

/// How far something is pulled, from `low` to 1.
pub(super) fn pull<G>(
    action: &xr::Action<f32>,
    session: &xr::Session<G>,
    path: xr::Path,
    low: f32,
) -> xr::Result<f64> {
    let state = action.state(session, path)?;
    Ok(match state.is_active {
        true => within(state.current_state, low),
        false => 0.0,
    })
}

/// Where a stick stands: right and forward.
pub(super) fn stick<G>(
    action: &xr::Action<xr::Vector2f>,
    session: &xr::Session<G>,
    path: xr::Path,
) -> xr::Result<DVec2> {
    let state = action.state(session, path)?;
    let xr::Vector2f { x, y } = state.current_state;
    Ok(match state.is_active {
        true => DVec2::new(within(x, -1.0), within(y, -1.0)),
        false => DVec2::ZERO,
    })
}

fn within(value: f32, low: f32) -> f64 {
    match value.is_nan() {
        true => 0.0,
        false => f64::from(value.clamp(low, 1.0)),
    }
}
