//! Denoising and anti-aliasing.

use super::FrameSpec;
use crate::frame::passes::{self, Pass};
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
    for &eye in frame.eyes() {
        steps.turn_to(Stage::Reconstruct.name(), eye);
        steps.run(&passes::background, Size::Tiles);
        steps.set_up(List::SEEN);
    }
    if settings.follows_motion() {
        for_eyes(&mut steps, frame, &passes::motion, |_| {});
    }
    let filtered = if settings.svgf.is_on() {
        svgf(&mut steps, frame)
    } else {
        PING
    };
    for &eye in frame.eyes() {
        steps.turn_to(Stage::Reconstruct.name(), eye);
        let step = steps.run(&passes::remodulate, Size::List(List::SEEN));
        step.names(&both(filtered));
        if settings.taa.is_on() {
            steps.run(&passes::taa, Size::Tiles);
        }
    }
    steps.done()
}

/// Runs a pass over what both eyes see of surfaces.
fn for_eyes(steps: &mut Steps, frame: &FrameSpec<'_>, pass: &Pass, set: impl Fn(&mut Step)) {
    for &eye in frame.eyes() {
        steps.turn_to(Stage::Reconstruct.name(), eye);
        set(steps.run(pass, Size::List(List::SEEN)));
    }
}

/// Accumulates light over frames, shares it between the eyes, and filters it by its variance. Returns its buffers.
fn svgf(steps: &mut Steps, frame: &FrameSpec<'_>) -> Light {
    let shares = frame.features.shares_light;
    let passes = frame.settings.reconstruct.atrous_passes;
    let own = [
        ("moments", "own_moments"),
        ("history_length", "own_history_length"),
    ];
    for_eyes(steps, frame, &passes::svgf_temporal, |step| {
        step.names(&[(MEAN, PING)]);
        if shares {
            step.names(&own);
        }
    });
    // History has been read by now and is written by the wavelet's first pass: light may pass through it.
    let (shared, estimated) = if shares {
        for_eyes(steps, frame, &passes::stereo_share, |step| {
            step.names(&both(PING)).names(&own).names(&[
                ("shared_light", HISTORY),
                ("other_moments", "other_own_moments"),
                ("other_history_length", "other_own_history_length"),
                ("shared_moments", "moments"),
                ("shared_length", "history_length"),
            ]);
        });
        (HISTORY, PING)
    } else if passes == 0 {
        (PING, HISTORY)
    } else {
        (PING, PONG)
    };
    // One eye after the other, for both pass through the same memory.
    for &eye in frame.eyes() {
        steps.turn_to(Stage::Reconstruct.name(), eye);
        let step = steps.run(&passes::svgf_variance, Size::List(List::SEEN));
        step.names(&[(MEAN, shared), ("light_filtered", estimated)]);
        let mut from = estimated;
        for index in 0..passes {
            // What the first pass leaves is what the next frame reads; the last one leaves light where it is the eye's own.
            let to = match (index, (passes - 1 - index) % 2) {
                (0, _) => HISTORY,
                (_, 0) => PING,
                _ => PONG,
            };
            let step = steps.run(&passes::svgf_atrous, Size::List(List::SEEN));
            step.words(index, 0, 0);
            step.names(&[("light_from", from), ("light_to", to)]);
            from = to;
        }
        if passes == 0 && shares {
            // With no pass at all the next frame reads the light as accumulated.
            steps.copy(PING, HISTORY);
        }
    }
    match passes {
        0 => estimated,
        1 => HISTORY,
        _ => PING,
    }
}
