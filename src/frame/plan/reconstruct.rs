//! Denoising and anti-aliasing.

use super::FrameSpec;
use crate::frame::passes::{self, Pass};
use crate::frame::step::{Eye, Size, Stage, Step, Steps};

/// Buffers of the light that is filtered: direct, indirect.
type Light = [&'static str; 2];
const PING: Light = ["direct_ping", "indirect_ping"];
const PONG: Light = ["direct_pong", "indirect_pong"];
/// Buffers that the next frame reads.
const HISTORY: Light = ["direct_history", "indirect_history"];

/// Light to write while `light` is read.
fn other(light: Light) -> Light {
    if light == PING { PONG } else { PING }
}

fn named(names: Light, light: Light) -> [(&'static str, &'static str); 2] {
    [(names[0], light[0]), (names[1], light[1])]
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
        step.names(&named(["direct_filtered", "indirect_filtered"], filtered));
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
    let settings = &frame.settings.reconstruct;
    let shares = settings.stereo && frame.both;
    let mut light = PING;
    for_eyes(steps, frame, &passes::svgf_temporal, |step| {
        step.names(&named(["direct_mean", "indirect_mean"], light));
        if shares {
            step.names(&[
                ("moments", "own_moments"),
                ("history_length", "own_history_length"),
            ]);
        }
    });
    if shares {
        let own = [
            ("moments", "own_moments"),
            ("history_length", "own_history_length"),
        ];
        let theirs = [
            ("other_moments", "other_own_moments"),
            ("other_history_length", "other_own_history_length"),
            ("shared_moments", "moments"),
            ("shared_length", "history_length"),
        ];
        // History has been read and is written only by the wavelet's first pass: light may pass through it.
        let to = match settings.atrous_passes {
            0 => PONG,
            _ => HISTORY,
        };
        light = share(
            steps,
            frame,
            &passes::stereo_share,
            [light, to],
            &[&own[..], &theirs].concat(),
        );
    }
    // What the wavelet's first pass leaves is what the next frame reads; with no pass at all, the light as accumulated.
    let to = match settings.atrous_passes {
        0 => HISTORY,
        _ => other(light),
    };
    for_eyes(steps, frame, &passes::svgf_variance, |step| {
        step.names(&named(["direct_mean", "indirect_mean"], light));
        step.names(&named(["direct_filtered", "indirect_filtered"], to));
    });
    light = to;
    for index in 0..settings.atrous_passes {
        let to = if index == 0 { HISTORY } else { other(light) };
        for_eyes(steps, frame, &passes::svgf_atrous, |step| {
            step.words(index, 0, 0);
            step.names(&named(["direct_from", "indirect_from"], light));
            step.names(&named(["direct_to", "indirect_to"], to));
        });
        light = to;
    }
    if shares {
        light = share(
            steps,
            frame,
            &passes::stereo_agree,
            [light, other(light)],
            &[],
        );
    }
    light
}

/// Mixes each eye's light with the other's where both see a surface. Returns where that lies: `to`.
fn share(
    steps: &mut Steps,
    frame: &FrameSpec<'_>,
    pass: &Pass,
    [light, to]: [Light; 2],
    names: &[(&'static str, &'static str)],
) -> Light {
    let theirs = match light {
        PING => ["other_direct_ping", "other_indirect_ping"],
        PONG => ["other_direct_pong", "other_indirect_pong"],
        _ => ["other_direct_history", "other_indirect_history"],
    };
    for_eyes(steps, frame, pass, |step| {
        step.names(&named(["direct_mean", "indirect_mean"], light));
        step.names(&named(["other_direct", "other_indirect"], theirs));
        step.names(&named(["shared_direct", "shared_indirect"], to));
        step.names(names);
    });
    to
}
