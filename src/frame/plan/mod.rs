//! The plan of a frame: which passes run, in which order, over what. Nothing else states the order.
//!
//! [`plan`] knows no device. `stereolux info --scene` prints what it returns.

mod eyes;
mod on_demand;
mod photons;
mod reconstruct;

use super::buffers::Moment;
use super::passes::{self, Pass};
use super::photon_layout::MapLayout;
use super::step::{Eye, Only, PlannedStage, Size, Stage, Step, Steps};
use super::user_passes;
use crate::gpu::features::ShaderFeatures;
use crate::settings::{Method, RenderSettings, Reuse};

pub use eyes::GATHERS;
use on_demand::after;
pub use on_demand::{View, inspect, inspection, on_demand, present, shown_light};
pub use photons::PATH_PASSES;

use eyes::{left_eye, right_eye, right_eye_equal};
use photons::photons;
use reconstruct::reconstruct;

/// What the plan of a frame depends on.
#[derive(Debug, Clone)]
pub struct FrameSpec<'a> {
    /// Settings.
    pub settings: &'a RenderSettings,
    /// Features that shaders are specialised by.
    pub features: ShaderFeatures,
    /// Whether both eyes are rendered.
    pub both: bool,
    /// Reuse mode of this frame.
    pub reuse: Reuse,
    /// Paths that one thread of the path tracer follows, one after the other, at most.
    pub paths_per_thread: u32,
    /// The photon map and the caustic map, if any.
    pub maps: Vec<MapLayout>,
    /// Slices in which photons are gathered, by map.
    pub slices: GatherSlices,
    /// Deforming meshes, if any.
    pub shapes: Option<ShapeCounts>,
    /// Whether shaders ask for points' previous positions.
    pub keeps_previous: bool,
}

/// Slices of a gather: a software driver aborts long loops (`docs/lavapipe.md`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GatherSlices {
    /// From the map of photons.
    pub photons: u32,
    /// From the map of caustics.
    pub caustics: u32,
}

impl GatherSlices {
    /// One slice each.
    pub const ONE: Self = Self {
        photons: 1,
        caustics: 1,
    };
}

/// Sizes of the deforming meshes.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ShapeCounts {
    /// Vertices.
    pub vertices: u32,
    /// Triangles.
    pub triangles: u32,
    /// BLAS nodes by height: first, number.
    pub levels: Vec<[u32; 2]>,
}

impl FrameSpec<'_> {
    /// Whether the right eye reuses the left one.
    #[must_use]
    pub fn reuses(&self) -> bool {
        self.both && self.reuse != Reuse::Off
    }

    fn is_photon(&self) -> bool {
        self.settings.method == Method::Photon
    }

    fn has_caustics(&self) -> bool {
        self.is_photon() && self.features.caustics
    }

    /// Whether eye paths leave surfaces by lobes that gather no photons.
    fn follows(&self) -> bool {
        self.is_photon() && (self.features.glossy || self.features.dielectric)
    }

    fn eyes(&self) -> &'static [Eye] {
        if self.both { &Eye::ALL } else { &[Eye::Left] }
    }
}

/// The frame's stages, in order.
#[must_use]
pub fn plan(frame: &FrameSpec<'_>) -> Vec<PlannedStage> {
    let mut stages = Vec::new();
    let mut add = |stage, when, steps: Vec<Step>| {
        if !steps.is_empty() {
            stages.push(PlannedStage { stage, when, steps });
        }
    };
    add(Stage::Pose, "when a shape changes", pose(frame));
    for map in &frame.maps {
        let when = photons_when(frame.settings);
        let steps = photons(map, &frame.settings.photon);
        add(Stage::Photons(map.config.kind), when, steps);
    }
    add(Stage::Begin, "every frame", begin(frame));
    add(Stage::Left, "every sample", left_eye(frame));
    add(Stage::Right, "every sample", right_eye(frame));
    let equal = "every sample, instead, where both eyes see the same";
    add(Stage::RightEqual, equal, right_eye_equal(frame));
    let once = "once, after all samples";
    add(Stage::Reconstruct, once, reconstruct(frame));
    user_passes::insert(&mut stages, &frame.settings.user_passes);
    stages.push(after(frame));
    stages
}

/// How often photons are traced.
fn photons_when(settings: &RenderSettings) -> &'static str {
    if settings.photon.every_frame {
        "every frame"
    } else if settings.photon.progressive {
        "every sample"
    } else if settings.photon.refine_at_rest && settings.reconstruct.still.is_on() {
        "when the map is missing or something has moved: all, or a share per frame; at rest anew, with smaller radii"
    } else {
        "when the map is missing or something has moved: all, or a share per frame"
    }
}

/// Vertices, then triangles, then boxes from the leaves up.
fn pose(frame: &FrameSpec<'_>) -> Vec<Step> {
    let mut steps = Steps::of_eye(Stage::Pose.name(), Eye::Left);
    let Some(shapes) = &frame.shapes else {
        return steps.done();
    };
    if frame.keeps_previous {
        steps.copy("deformed_positions", "previous_positions");
    }
    let mut over = |pass: &Pass, first, count| {
        steps
            .run(pass, Size::Threads(count))
            .words(first, count, 0)
            .only(Only::NewPose);
    };
    over(&passes::deform, 0, shapes.vertices);
    over(&passes::deform_triangles, 0, shapes.triangles);
    for &[first, count] in &shapes.levels {
        over(&passes::refit, first, count);
    }
    steps.done()
}

/// Clears the sums over a frame's samples.
fn begin(frame: &FrameSpec<'_>) -> Vec<Step> {
    let mut steps = Steps::of_eye(Stage::Begin.name(), Eye::Left);
    for &eye in frame.eyes() {
        steps.owner.eye = eye;
        steps.clear(Moment::Frame);
        if !frame.features.one_sample {
            steps.clear(Moment::Sums);
        }
    }
    steps.done()
}
