//! Denoising and anti-aliasing.

use super::FrameSpec;
use crate::frame::passes;
use crate::frame::step::{Eye, List, Size, Stage, Step, Steps};

/// Where light is on its way through the filter: a buffer of direct and indirect light.
type Light = &'static str;
/// An eye's own.
const PING: Light = "light_ping";
/// Both eyes use it in turn.
const PONG: Light = "light_pong";
/// What the next frame reads.
const HISTORY: Light = "light_history";
/// What passes that read an eye's light call it.
const MEAN: &str = "light_mean";

/// Binds an eye's light and the other eye's.
fn both(light: Light) -> [(&'static str, &'static str); 2] {
    let theirs = match light {
        HISTORY => "other_light_history",
        _ => "other_light_ping",
    };
    [(MEAN, light), ("other_light", theirs)]
}

/// Filters both eyes' light (SVGF: Schied et al. 2017), shares it between them, and shows the mean of still frames and
/// temporal anti-aliasing.
pub(super) fn reconstruct(frame: &FrameSpec<'_>) -> Vec<Step> {
    let settings = &frame.settings.reconstruct;
    let mut steps = Steps::of_eye(Stage::Reconstruct.name(), Eye::Left);
    if !settings.is_on() {
        return steps.done();
    }
    let mut filtered = PING;
    for &eye in frame.eyes() {
        steps.turn_to(Stage::Reconstruct.name(), eye);
        steps.run_appending(&passes::background, Size::Tiles, List::SEEN);
        if settings.taa.is_on() {
            steps.set_up(List::MIXED);
        }
        if settings.follows_motion() {
            steps.run(&passes::motion, Size::List(List::SEEN));
        }
        if settings.svgf.is_on() {
            let passes = settings.atrous_passes.with(frame.settings.method);
            filtered = svgf(&mut steps, passes);
        }
    }
    for &eye in frame.eyes() {
        steps.turn_to(Stage::Reconstruct.name(), eye);
        let step = steps.run(&passes::remodulate, Size::List(List::SEEN));
        step.names(&both(filtered));
        if settings.taa.is_on() {
            // A pass of the user's may have changed any pixel since.
            let over = match frame.settings.user_passes.is_empty() {
                true => Size::List(List::MIXED),
                false => Size::Tiles,
            };
            steps.run(&passes::taa, over);
        }
    }
    steps.done()
}

/// Accumulates an eye's light over frames and filters it by its variance. Returns its buffer.
fn svgf(steps: &mut Steps, passes: u32) -> Light {
    let seen = Size::List(List::SEEN);
    steps
        .run(&passes::svgf_temporal, seen)
        .appends(List::YOUNG)
        .names(&[(MEAN, PING)]);
    steps.set_up(List::YOUNG);
    // What the next frame reads is what the first pass of the wavelet leaves, or what there is without one.
    let (young, over) = match passes {
        0 => (HISTORY, seen),
        _ => (PONG, Size::List(List::YOUNG)),
    };
    steps
        .run(&passes::svgf_young, over)
        .names(&[(MEAN, PING), ("light_young", young)]);
    let mut from = if passes == 0 { HISTORY } else { PING };
    for index in 0..passes {
        // The last one leaves light where it is the eye's own.
        let to = match (index, (passes - 1 - index) % 2) {
            (0, _) => HISTORY,
            (_, 0) => PING,
            _ => PONG,
        };
        let young = if index == 0 { PONG } else { from };
        steps
            .run(&passes::svgf_atrous, seen)
            .words(index, 0, 0)
            .names(&[
                ("light_from", from),
                ("light_young", young),
                ("light_to", to),
            ]);
        from = to;
    }
    from
}
