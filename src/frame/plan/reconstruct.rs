//! Denoising and anti-aliasing.

use super::FrameSpec;
use crate::frame::passes::{self, Pass};
use crate::frame::step::{Eye, Size, Stage, Step, Steps};

/// Buffers of the light that is filtered: direct, indirect.
type Light = [&'static str; 2];
/// An eye's own.
const PING: Light = ["direct_ping", "indirect_ping"];
/// Both eyes use it in turn.
const PONG: Light = ["direct_pong", "indirect_pong"];
/// What the next frame reads.
const HISTORY: Light = ["direct_history", "indirect_history"];
/// What passes that read an eye's light call it.
const MEAN: Light = ["direct_mean", "indirect_mean"];

fn named(names: Light, light: Light) -> [(&'static str, &'static str); 2] {
    [(names[0], light[0]), (names[1], light[1])]
}

/// Names of the other eye's light.
fn theirs(light: Light) -> [(&'static str, &'static str); 2] {
    let lies = match light {
        HISTORY => ["other_direct_history", "other_indirect_history"],
        _ => ["other_direct_ping", "other_indirect_ping"],
    };
    named(["other_direct", "other_indirect"], lies)
}

/// Filters both eyes' light (SVGF: Schied et al. 2017), shares it between them, and shows the mean of still frames and
/// temporal anti-aliasing.
pub(super) fn reconstruct(frame: &FrameSpec<'_>) -> Vec<Step> {
    let settings = &frame.settings.reconstruct;
    let mut steps = Steps::of_eye(Stage::Reconstruct.name(), Eye::Left);
    if !settings.is_on() {
        return steps.done();
    }
    if settings.follows_motion() {
        for_eyes(&mut steps, frame, &passes::motion, |_| ());
    }
    let filtered = if settings.svgf.is_on() {
        svgf(&mut steps, frame)
    } else {
        PING
    };
    for &eye in frame.eyes() {
        steps.turn_to(Stage::Reconstruct.name(), eye);
        let step = steps.run(&passes::remodulate, Size::Tiles);
        step.names(&named(MEAN, filtered)).names(&theirs(filtered));
        if settings.taa.is_on() {
            steps.run(&passes::taa, Size::Tiles);
        }
    }
    steps.done()
}

/// Runs a pass over both eyes' images.
fn for_eyes(steps: &mut Steps, frame: &FrameSpec<'_>, pass: &Pass, set: impl Fn(&mut Step)) {
    for &eye in frame.eyes() {
        steps.turn_to(Stage::Reconstruct.name(), eye);
        set(steps.run(pass, Size::Tiles));
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
        step.names(&named(MEAN, PING));
        if shares {
            step.names(&own);
        }
    });
    // History has been read by now and is written by the wavelet's first pass: light may pass through it.
    let (shared, estimated) = if shares {
        for_eyes(steps, frame, &passes::stereo_share, |step| {
            step.names(&named(MEAN, PING)).names(&theirs(PING));
            step.names(&named(["shared_direct", "shared_indirect"], HISTORY));
            step.names(&own).names(&[
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
        let step = steps.run(&passes::svgf_variance, Size::Tiles);
        step.names(&named(MEAN, shared))
            .names(&named(["direct_filtered", "indirect_filtered"], estimated));
        let mut from = estimated;
        for index in 0..passes {
            // What the first pass leaves is what the next frame reads; the last one leaves light where it is the eye's own.
            let to = match (index, (passes - 1 - index) % 2) {
                (0, _) => HISTORY,
                (_, 0) => PING,
                _ => PONG,
            };
            let step = steps.run(&passes::svgf_atrous, Size::Tiles);
            step.words(index, 0, 0);
            step.names(&named(["direct_from", "indirect_from"], from));
            step.names(&named(["direct_to", "indirect_to"], to));
            from = to;
        }
        if passes == 0 && shares {
            // With no pass at all the next frame reads the light as accumulated.
            for (light, history) in PING.into_iter().zip(HISTORY) {
                steps.copy(light, history);
            }
        }
    }
    match passes {
        0 => estimated,
        1 => HISTORY,
        _ => PING,
    }
}
