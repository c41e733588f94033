//! One sample of each eye: separately, or the right one by reuse of the left one's.

use super::FrameSpec;
use crate::frame::buffers::Moment;
use crate::frame::passes::{self, Pass};
use crate::frame::photon_layout::MapKind;
use crate::frame::step::{Eye, List, Size, Step, Steps};
use crate::settings::{
    DirectLight, Loads, PhotonEstimate, RenderSettings, Reuse, Schedule, Search,
};

fn sample_of(frame: &FrameSpec<'_>, eye: Eye) -> Steps {
    let of = if frame.is_photon() {
        frame.slices.photons
    } else {
        frame.paths_per_thread
    };
    Steps::of_eye(eye.name(), eye).told_of(of)
}

pub(super) fn left_eye(frame: &FrameSpec<'_>) -> Vec<Step> {
    let mut steps = sample_of(frame, Eye::Left);
    if frame.features.carries_light {
        steps.clear(Moment::Carry);
    }
    whole_eye(&mut steps, frame);
    steps.done()
}

pub(super) fn right_eye(frame: &FrameSpec<'_>) -> Vec<Step> {
    let mut steps = sample_of(frame, Eye::Right);
    let mut own = sample_of(frame, Eye::Right);
    let left_samples = [
        ("light_samples", "left_light_samples"),
        ("light_places", "left_light_places"),
    ];
    if frame.reuses() {
        reuse(&mut steps, frame);
        steps.rename(&left_samples);
        fill(&mut own, frame);
    } else if frame.both {
        whole_eye(&mut own, frame);
    }
    // These carry nothing: the left eye's light makes room once it is looked up.
    own.rename(&[
        ("demodulated_light", "nothing_carried"),
        ("first_emission", "no_emission"),
        ("left_direct_irradiance", "no_irradiance"),
    ]);
    // Nobody takes this eye's light samples over. Paths write them where the left eye's were, which are read by then.
    own.rename(&if frame.is_photon() {
        [
            ("light_samples", "no_light_samples"),
            ("light_places", "no_light_places"),
        ]
    } else {
        left_samples
    });
    steps.append(own);
    steps.done()
}

/// The right eye is the left one's copy.
pub(super) fn right_eye_equal(frame: &FrameSpec<'_>) -> Vec<Step> {
    let mut steps = sample_of(frame, Eye::Right);
    if frame.reuses() {
        steps.clear(Moment::Sample);
        steps.clear(Moment::Reuse);
        steps.run(&passes::left_copy, Size::Tiles);
    }
    steps.done()
}

/// One sample of an eye without reuse.
fn whole_eye(steps: &mut Steps, frame: &FrameSpec<'_>) {
    steps.clear(Moment::Sample);
    steps.run_appending(&passes::first_hits, Size::Tiles, List::HITS);
    if !frame.is_photon() {
        steps.run(&passes::path_trace, Size::Runs(List::HITS));
        return;
    }
    let hits = Size::List(List::HITS);
    eye_paths(steps, frame, hits);
    if frame.settings.photon.half_rate.is_on() {
        gather_at_half_rate(steps, frame);
    } else {
        gather(steps, frame, hits);
    }
    caustics(steps, frame, hits);
    direct_light(steps, frame, hits);
    followed_light(steps, frame);
    steps.run(&passes::eye_combine, hits);
}

/// Follows the eye's paths from the first surface to those that gather photons.
fn eye_paths(steps: &mut Steps, frame: &FrameSpec<'_>, over: Size) {
    let (pass, slices) = match frame.settings.photon.schedule {
        Schedule::Split => (&passes::eye_hits, 1),
        Schedule::Fused => (&passes::eye_fused, frame.slices.photons),
    };
    let passes = steps.in_slices(pass, over, slices);
    if frame.follows() {
        for step in passes {
            step.appends(List::FOLLOWED);
        }
        steps.set_up(List::FOLLOWED);
    }
}

/// Lights the first surfaces that are followed, after all that the paths found.
fn followed_light(steps: &mut Steps, frame: &FrameSpec<'_>) {
    if frame.follows() {
        steps.run(&passes::followed_light, Size::List(List::FOLLOWED));
    }
}

fn direct_light(steps: &mut Steps, frame: &FrameSpec<'_>, over: Size) {
    if frame.settings.photon.direct == DirectLight::Nee {
        steps.run(&passes::direct_light, over);
    }
}

/// The pass that gathers photons; `None` if the tracing pass does.
fn gather_pass(settings: &RenderSettings) -> Option<&'static Pass> {
    let photon = &settings.photon;
    if photon.schedule == Schedule::Fused {
        return None;
    }
    Some(match (photon.search, photon.estimate, photon.loads) {
        (Search::Grid, PhotonEstimate::Radius, Loads::Direct) => &passes::photon_gather,
        (Search::Grid, PhotonEstimate::Radius, Loads::Cooperative) => &passes::shared_gather,
        (Search::Grid, PhotonEstimate::Nearest, _) => &passes::nearest_gather,
        (Search::KdTree, PhotonEstimate::Radius, _) => &passes::kd_gather,
        (Search::KdTree, PhotonEstimate::Nearest, _) => &passes::kd_nearest_gather,
    })
}

/// All that [`gather_pass`] may return.
pub const GATHERS: [&Pass; 5] = [
    &passes::photon_gather,
    &passes::shared_gather,
    &passes::nearest_gather,
    &passes::kd_gather,
    &passes::kd_nearest_gather,
];

fn gather(steps: &mut Steps, frame: &FrameSpec<'_>, over: Size) {
    if let Some(pass) = gather_pass(frame.settings) {
        steps.in_slices(pass, over, frame.slices.photons);
    }
}

/// Gathers at every other pixel in each direction, interpolates, and gathers where interpolation fails.
fn gather_at_half_rate(steps: &mut Steps, frame: &FrameSpec<'_>) {
    steps.clear(Moment::HalfRate);
    let [hits, coarse] = [List::HITS, List::COARSE].map(Size::List);
    steps.run_appending(&passes::coarse_list, hits, List::COARSE);
    gather(steps, frame, coarse);
    steps.run(&passes::coarse_irradiance, coarse);
    steps.copy_texels("coarse_light");
    steps
        .run(&passes::coarse_spread, hits)
        .names(&[("demodulated_light", "coarse_light")])
        .appends(List::GATHER);
    steps.set_up(List::GATHER);
    gather(steps, frame, Size::List(List::GATHER));
}

fn caustics(steps: &mut Steps, frame: &FrameSpec<'_>, over: Size) {
    if frame.has_caustics() {
        steps.owner.map = MapKind::Caustics;
        steps.in_slices(&passes::caustic_gather, over, frame.slices.caustics);
        steps.owner.map = MapKind::Photons;
    }
}

/// The right eye takes what light it can from the left one's sample and lists the pixels that stay without.
fn reuse(steps: &mut Steps, frame: &FrameSpec<'_>) {
    steps.clear(Moment::Sample);
    steps.clear(Moment::Reuse);
    let left_hits = Size::List(List::LEFT_HITS);
    match frame.reuse {
        Reuse::Off => return,
        // Left hits are projected; the nearest one wins its right pixel, whose ray meets its triangle without a traversal.
        Reuse::Scatter => {
            steps.run(&passes::scatter_depth, left_hits);
            steps.run(&passes::scatter_winner, left_hits);
        }
        // Right primary rays are traced.
        Reuse::Lookup => {}
    }
    steps.run_appending(&passes::reuse_hits, Size::Tiles, List::HITS);
    // What they meet is lit by the left samples around it.
    steps.copy_texels("demodulated_light");
    steps.run_appending(&passes::reuse_lookup, Size::List(List::HITS), List::FILL);
}

/// Renders the right eye's empty pixels; glossy ones may still reuse indirect light.
fn fill(steps: &mut Steps, frame: &FrameSpec<'_>) {
    let over = Size::List(List::FILL);
    if frame.reuse == Reuse::Scatter {
        steps.run(&passes::fill_hits, over);
    }
    if frame.is_photon() {
        eye_paths(steps, frame, over);
        gather(steps, frame, over);
        caustics(steps, frame, over);
        direct_light(steps, frame, over);
        followed_light(steps, frame);
        steps.run(&passes::eye_combine, over);
    } else {
        steps.run(&passes::path_trace, Size::Runs(List::FILL));
    }
    steps.run(&passes::fill_reasons, over);
}
