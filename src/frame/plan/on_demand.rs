//! What follows a frame: images that are kept, and steps on demand, which present pictures or views of intermediate results.

use super::FrameSpec;
use crate::frame::buffers::{BUFFERS, Moment};
use crate::frame::passes::{self, Domain, Pass};
use crate::frame::photon_layout::MapKind;
use crate::frame::step::{Eye, PlannedStage, Size, Stage, Step, Steps};
use crate::settings::{Kept, RenderSettings};

/// The picture of an eye that is shown: a buffer's name.
#[must_use]
pub fn shown_light(settings: &RenderSettings) -> &'static str {
    if settings.reconstruct.taa.is_on() {
        "anti_aliased"
    } else if settings.reconstruct.is_on() {
        "reconstructed"
    } else {
        "radiance_sum"
    }
}

/// Which share of its pixels surfaces cover.
fn shown_coverage(settings: &RenderSettings) -> &'static str {
    if settings.reconstruct.taa.is_on() {
        "steady_coverage"
    } else {
        "coverage"
    }
}

/// Keeps the images that are read after a frame. What no pass writes needs no keeping.
pub(super) fn after(frame: &FrameSpec<'_>) -> PlannedStage {
    let settings = frame.settings;
    let output = &settings.output;
    let mut names = vec![
        shown_light(settings),
        shown_coverage(settings),
        "provenance",
    ];
    if output.kept != Kept::Picture {
        names.push("hit_rays");
    }
    if output.parts || output.kept == Kept::All {
        names.extend(["radiance_sum", "direct_sum", "albedo_sum"]);
    }
    if output.kept == Kept::All {
        names.extend(["motion", "scatter_winners"]);
    }
    let mut steps = Steps::of_eye(Stage::After.name(), Eye::Left);
    for &eye in frame.eyes() {
        steps.owner.eye = eye;
        names.iter().for_each(|name| steps.keep(name));
    }
    if settings.photon.progressive {
        // Photons are traced between samples, whose sums must not lie there.
        for map in &frame.maps {
            steps.owner.map = map.config.kind;
            let rows = BUFFERS.iter().filter(|row| row.is_scratch());
            rows.for_each(|row| steps.keep(row.name));
        }
    }
    PlannedStage {
        stage: Stage::After,
        when: "until the next frame",
        steps: steps.done(),
    }
}

/// Both eyes' pictures go to a runtime, with their depths where it takes them, to a window, or into the mean of a still view.
#[must_use]
pub fn present(settings: &RenderSettings, passes: &[&Pass]) -> PlannedStage {
    let mut steps = Steps::of_eye(Stage::Present.name(), Eye::Left);
    for eye in Eye::ALL {
        steps.turn_to(Stage::Present.name(), eye);
        for pass in passes {
            let size = match pass.over {
                Domain::Fragments => Size::Fragments,
                _ => Size::Tiles,
            };
            let step = steps.run(pass, size);
            step.names(&[
                ("shown_light", shown_light(settings)),
                ("shown_coverage", shown_coverage(settings)),
            ]);
        }
    }
    PlannedStage {
        stage: Stage::Present,
        when: "where a runtime or a window takes the images",
        steps: steps.done(),
    }
}

/// Stages that run on demand.
#[must_use]
pub fn on_demand(settings: &RenderSettings) -> [PlannedStage; 2] {
    let takers = [
        &passes::xr_submit,
        &passes::xr_submit_depth,
        &passes::mirror,
        &passes::still_picture,
    ];
    let views = [
        View::Surfaces,
        View::PhotonsAround(1),
        View::PhotonDots {
            map: MapKind::Photons,
            stored: 0,
            clears: true,
        },
        View::CausticLight(1),
        View::Motion,
    ];
    let views = views.map(|view| inspect(view, Eye::Left, Eye::Left));
    [present(settings, &takers), inspection(views.concat())]
}

/// Steps of views as a stage.
#[must_use]
pub fn inspection(steps: Vec<Step>) -> PlannedStage {
    PlannedStage {
        stage: Stage::Inspect,
        when: "when a view is asked for",
        steps,
    }
}

/// A pass of a view of intermediate results.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum View {
    /// What the ray through each pixel's centre meets.
    Surfaces,
    /// Photons around it, in so many slices.
    PhotonsAround(u32),
    /// Photons of a map that are seen in each pixel.
    PhotonDots {
        /// Which map.
        map: MapKind,
        /// How many photons it holds.
        stored: u32,
        /// It is the first map that is counted.
        clears: bool,
    },
    /// Light from the map of caustics alone, in so many slices.
    CausticLight(u32),
    /// Where surfaces were in the frame before.
    Motion,
}

/// The passes of a view of an eye. `eye` looks, `buffers` are the eye's whose image it is (the left ones of an only eye).
#[must_use]
pub fn inspect(view: View, eye: Eye, buffers: Eye) -> Vec<Step> {
    let mut steps = Steps::of_eye(Stage::Inspect.name(), eye);
    steps.owner.eye = buffers;
    match view {
        View::Surfaces => {
            steps
                .run(&passes::inspect_surfaces, Size::Tiles)
                .words(0, 0, 1);
        }
        View::PhotonsAround(slices) => {
            steps.in_slices(&passes::inspect_photons, Size::Tiles, slices);
        }
        View::PhotonDots {
            map,
            stored,
            clears,
        } => {
            steps.owner.map = map;
            if clears {
                steps.clear(Moment::View);
            }
            steps
                .run(&passes::inspect_dots, Size::Threads(stored))
                .words(0, 0, 1);
        }
        View::CausticLight(slices) => {
            steps.owner.map = MapKind::Caustics;
            steps.in_slices(&passes::inspect_caustics, Size::Tiles, slices);
        }
        View::Motion => {
            let step = steps.run(&passes::motion, Size::Tiles).words(0, 0, 1);
            step.names(&[
                ("hit_rays", "inspected_normals"),
                ("first_surfaces", "inspected_hits"),
                ("seen_surfaces", "inspected_surfaces"),
                ("motion", "inspection"),
            ]);
        }
    }
    steps.done()
}
