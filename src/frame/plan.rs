//! The frame: which passes run, in which order, over what. This is the only place that says so, and what it says is what runs.
//!
//! [`plan`] knows no device. `stereolux info --scene` prints what it returns.

use super::buffers::Moment;
use super::passes::{self, Pass};
use super::photon_layout::{MapKind, MapLayout};
use super::step::{Eye, List, Only, PlannedStage, Size, Stage, Step, Steps};
use crate::gpu::features::ShaderFeatures;
use crate::options::{
    DirectLight, Loads, Method, PhotonEstimate, Reuse, Schedule, Search, Settings,
};
use crate::renderer::photon_records::PhotonGrid;

/// What a frame is planned for.
#[derive(Debug, Clone)]
pub struct FrameSpec<'a> {
    /// Settings.
    pub settings: &'a Settings,
    /// What shaders are specialised by.
    pub features: ShaderFeatures,
    /// Whether both eyes are rendered.
    pub both: bool,
    /// How the right eye reuses the left one now.
    pub reuse: Reuse,
    /// Samples that one dispatch of the path tracer takes, at most.
    pub samples_per_dispatch: u32,
    /// The photon map and that of caustics, where there are such.
    pub maps: Vec<MapLayout>,
    /// Slices in which photons are gathered, by map.
    pub slices: GatherSlices,
    /// What changes its shape, if anything does.
    pub shapes: Option<ShapeCounts>,
    /// Whether shaders ask where points were in the frame before.
    pub keeps_previous: bool,
}

/// Slices in which photons are gathered: a software driver ends long loops (`docs/lavapipe.md`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GatherSlices {
    /// From the map of photons.
    pub photons: u32,
    /// From the map of caustics.
    pub caustics: u32,
}

impl GatherSlices {
    /// Everything at once.
    pub const ONE: Self = Self {
        photons: 1,
        caustics: 1,
    };
}

/// What of the scene changes its shape.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ShapeCounts {
    /// Vertices.
    pub vertices: u32,
    /// Triangles.
    pub triangles: u32,
    /// Nodes of the hierarchies by height: first, number.
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

    fn eyes(&self) -> &'static [Eye] {
        if self.both { &Eye::BOTH } else { &[Eye::Left] }
    }
}

/// The frame's stages, in order.
#[must_use]
pub fn plan(frame: &FrameSpec<'_>) -> Vec<PlannedStage> {
    let mut stages = Vec::new();
    let mut add = |stage, when, steps: Vec<Step>| {
        if !steps.is_empty() {
            stages.push(PlannedStage {
                stage,
                when,
                longest_run: frame.samples_per_dispatch,
                steps,
            });
        }
    };
    add(Stage::Pose, "when a shape changes", pose(frame));
    for map in &frame.maps {
        let when = photons_when(frame.settings);
        add(Stage::Photons(map.config.kind), when, photons(map));
    }
    add(Stage::Begin, "every frame", begin(frame));
    add(Stage::Left, "every sample", left_eye(frame));
    add(Stage::Right, "every sample", right_eye(frame));
    let equal = "every sample, instead, where both eyes see the same";
    add(Stage::RightEqual, equal, right_eye_equal(frame));
    let once = "once, after all samples";
    add(Stage::Reconstruct, once, reconstruct(frame));
    stages
}

/// How often photons are traced.
fn photons_when(settings: &Settings) -> &'static str {
    if settings.photon.every_frame {
        "every frame"
    } else if settings.photon.progressive {
        "every sample"
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

/// Passes of the paths of the map of all photons but caustics; the rest of its stage builds what photons are searched by.
pub const PATH_PASSES: [&Pass; 3] = [
    &passes::photon_trace,
    &passes::photon_append,
    &passes::photon_count,
];

/// Traces paths batch by batch, then sorts their photons into a grid or a kd-tree.
fn photons(map: &MapLayout) -> Vec<Step> {
    let mut steps = Steps::of_map(map.config.kind);
    steps.clear(Moment::Map);
    for (batch, (first, count)) in (0..).zip(map.batches()) {
        photon_batch(&mut steps, map, batch, first, count);
    }
    steps.owner.batch = 0;
    let sixteenths = Size::Threads(map.capacity.div_ceil(16));
    steps.run(&passes::photon_bounds, sixteenths);
    steps.run(&passes::grid_setup, Size::Once);
    if map.is_tree() {
        kd_tree(&mut steps, map);
    } else {
        grid(&mut steps, map);
    }
    steps.done()
}

/// Paths leave photons in slots of their own; a prefix sum over their numbers says where each path's go in the list.
fn photon_batch(steps: &mut Steps, map: &MapLayout, batch: u32, first: u32, count: u32) {
    steps.owner.batch = if map.keeps_batches() { batch } else { 0 };
    let slots = map.slots_per_path;
    let trace = match map.config.kind {
        MapKind::Photons => &passes::photon_trace,
        MapKind::Caustics => &passes::caustic_trace,
    };
    let due = Only::BatchDue(batch);
    steps.clear(Moment::Batch).only(due);
    steps
        .run(trace, Size::Threads(map.tracing_threads(count)))
        .words(first, count, slots)
        .only(due);
    // The scan is in place, and counts that are kept serve again.
    let starts = if map.keeps_batches() {
        steps.copy("path_counts", "path_starts");
        "path_starts"
    } else {
        "path_counts"
    };
    scan(steps, starts, "path_sums", map.path_count_bytes());
    for (pass, size) in [
        (&passes::photon_append, Size::Threads(count)),
        (&passes::photon_count, Size::Once),
    ] {
        let step = steps.run(pass, size).words(first, count, slots);
        step.names(&[("path_starts", starts)]);
    }
}

/// Prefix sum over a buffer of `bytes` bytes.
fn scan(steps: &mut Steps, values: &'static str, sums: &'static str, bytes: u64) {
    let count = MapLayout::scan_values(bytes);
    let blocks = count.div_ceil(super::photon_layout::SCAN_BLOCK as u32);
    // A scan's first pass has one workgroup per block.
    scan_over(
        steps,
        values,
        sums,
        [Size::Groups(blocks), Size::Threads(count)],
    );
}

/// Prefix sum over the values that are in use.
fn scan_over(
    steps: &mut Steps,
    values: &'static str,
    sums: &'static str,
    [blocks, all]: [Size; 2],
) {
    let sizes = [blocks, Size::Once, all];
    let scan = [&passes::scan_blocks, &passes::scan_sums, &passes::scan_add];
    for (pass, size) in scan.into_iter().zip(sizes) {
        let names = [("scan_values", values), ("scan_sums", sums)];
        steps.run(pass, size).names(&names);
    }
}

const fn photon_grid(offset: usize) -> Size {
    Size::Indirect("photon_grid", offset as u64)
}

/// Over all stored photons.
const PHOTONS: Size = photon_grid(std::mem::offset_of!(PhotonGrid, photon_groups));

/// Counts the photons of every cell, sorts them by cell, and puts them where gathering reads them.
fn grid(steps: &mut Steps, map: &MapLayout) {
    steps
        .run(&passes::cell_count, PHOTONS)
        .names(&[("radix_to", "radix_even")]);
    // A table may have many times as many cells as are in use.
    let in_use = [
        photon_grid(std::mem::offset_of!(PhotonGrid, block_groups)),
        photon_grid(std::mem::offset_of!(PhotonGrid, value_groups)),
    ];
    scan_over(steps, "cell_starts", "cell_sums", in_use);
    radix_sort(steps, map);
    steps
        .run(&passes::photon_reorder, PHOTONS)
        .names(&[("radix_from", "radix_odd")]);
    steps.copy_texels("sorted_photons");
}

/// Sorts by key, stably, digit by digit, there and back between two buffers.
fn radix_sort(steps: &mut Steps, map: &MapLayout) {
    let (digits, bits) = map.digits();
    let blocks = map.blocks();
    for digit in 0..digits {
        let names = match digit % 2 {
            0 => [("radix_from", "radix_even"), ("radix_to", "radix_odd")],
            _ => [("radix_from", "radix_odd"), ("radix_to", "radix_even")],
        };
        let over_blocks = |steps: &mut Steps, pass| {
            let step = steps.run(pass, Size::Threads(blocks)).names(&names);
            step.words(digit * bits, blocks, (1 << bits) - 1);
        };
        steps.clear(Moment::Digit);
        over_blocks(steps, &passes::radix_count);
        scan(steps, "radix_table", "radix_sums", map.radix_bytes());
        over_blocks(steps, &passes::radix_scatter);
    }
}

/// Sorts photons once along each axis, then parts all three orders at the medians, level by level (Brown 2015, "Building a
/// balanced k-d tree in O(kn log n) time").
fn kd_tree(steps: &mut Steps, map: &MapLayout) {
    let orders = ["kd_orders_even", "kd_orders_odd"];
    let groups = |entry: u64| Size::Indirect("kd_groups", entry * 16);
    steps.run(&passes::kd_setup, Size::Once);
    for axis in 0..3 {
        let along = |step: &mut Step| {
            step.words(axis, map.capacity, 0);
        };
        along(
            steps
                .run(&passes::kd_keys, PHOTONS)
                .names(&[("radix_to", "radix_even")]),
        );
        radix_sort(steps, map);
        let names = [("radix_from", "radix_even"), ("kd_to", orders[0])];
        along(steps.run(&passes::kd_orders, PHOTONS).names(&names));
    }
    for level in 0..map.parted_levels() {
        let from = level as usize % 2;
        let names = [("kd_from", orders[from]), ("kd_to", orders[1 - from])];
        let over = |steps: &mut Steps, pass, size| {
            let step = steps.run(pass, size).names(&names);
            step.words(level, map.capacity, 0);
        };
        over(steps, &passes::kd_axis, Size::Threads(1 << level));
        over(steps, &passes::kd_flag, groups(0));
        scan_over(steps, "kd_marks", "kd_mark_sums", [groups(1), groups(2)]);
        over(steps, &passes::kd_move, groups(0));
    }
    let last = orders[map.parted_levels() as usize % 2];
    let step = steps.run(&passes::kd_place, PHOTONS);
    step.names(&[("kd_from", last)]).words(0, map.capacity, 0);
    steps.copy_texels("sorted_photons");
    steps.copy_texels("kd_nodes");
}

/// Zeroes the sums over a frame's samples.
fn begin(frame: &FrameSpec<'_>) -> Vec<Step> {
    let mut steps = Steps::of_eye(Stage::Begin.name(), Eye::Left);
    for &eye in frame.eyes() {
        steps.owner.eye = eye;
        steps.clear(Moment::Frame);
    }
    steps.done()
}

fn sample_of(frame: &FrameSpec<'_>, eye: Eye) -> Steps {
    Steps::of_eye(eye.name(), eye).told_of(frame.slices.photons)
}

fn left_eye(frame: &FrameSpec<'_>) -> Vec<Step> {
    let mut steps = sample_of(frame, Eye::Left);
    whole_eye(&mut steps, frame);
    steps.done()
}

fn right_eye(frame: &FrameSpec<'_>) -> Vec<Step> {
    let mut steps = sample_of(frame, Eye::Right);
    if frame.reuses() {
        reuse(&mut steps, frame);
        fill(&mut steps, frame);
    } else if frame.both {
        whole_eye(&mut steps, frame);
    }
    steps.done()
}

/// The right eye is the left one's copy.
fn right_eye_equal(frame: &FrameSpec<'_>) -> Vec<Step> {
    let mut steps = sample_of(frame, Eye::Right);
    if frame.reuses() {
        steps.clear(Moment::Sample);
        steps.clear(Moment::Reuse);
        steps.run(&passes::left_copy, Size::Tiles);
    }
    steps.done()
}

/// One sample of an eye by itself.
fn whole_eye(steps: &mut Steps, frame: &FrameSpec<'_>) {
    steps.clear(Moment::Sample);
    primary_hits(steps, frame, Size::Tiles);
    if !frame.is_photon() {
        return;
    }
    direct_light(steps, frame);
    if frame.settings.photon.half_rate {
        gather_at_half_rate(steps, frame);
    } else {
        gather(steps, frame, List::HITS);
    }
    caustics(steps, frame);
    steps.run(&passes::eye_combine, Size::Tiles);
}

/// Follows the eye's paths to the surfaces that gather photons, or, with the path method, to their ends.
fn primary_hits(steps: &mut Steps, frame: &FrameSpec<'_>, over: Size) {
    match (frame.settings.method, frame.settings.photon.schedule) {
        (Method::Path, _) => {
            steps.run(&passes::path_trace, over);
        }
        (Method::Photon, Schedule::Split) => {
            steps.run(&passes::eye_hits, over);
        }
        (Method::Photon, Schedule::Fused) => {
            in_slices(steps, &passes::eye_fused, over, frame.slices.photons);
        }
    }
    steps.set_up(List::HITS);
}

fn direct_light(steps: &mut Steps, frame: &FrameSpec<'_>) {
    if frame.settings.photon.direct == DirectLight::Nee {
        steps.run(&passes::direct_light, Size::List(List::HITS));
    }
}

/// The pass that estimates radiance from the map of photons; none where the one that traces does.
fn gather_pass(settings: &Settings) -> Option<&'static Pass> {
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

/// All that [`gather_pass`] may give.
pub const GATHERS: [&Pass; 5] = [
    &passes::photon_gather,
    &passes::shared_gather,
    &passes::nearest_gather,
    &passes::kd_gather,
    &passes::kd_nearest_gather,
];

fn gather(steps: &mut Steps, frame: &FrameSpec<'_>, list: List) {
    if let Some(pass) = gather_pass(frame.settings) {
        in_slices(steps, pass, Size::List(list), frame.slices.photons);
    }
}

/// Runs a pass once per slice of what it loops over.
fn in_slices(steps: &mut Steps, pass: &Pass, over: Size, slices: u32) {
    for slice in 0..slices {
        steps.run(pass, over).words(0, slice, slices);
    }
}

/// Gathers at every other pixel in each direction, interpolates between them, and gathers where that finds nothing.
fn gather_at_half_rate(steps: &mut Steps, frame: &FrameSpec<'_>) {
    steps.clear(Moment::HalfRate);
    steps.run(&passes::coarse_list, Size::List(List::HITS));
    steps.set_up(List::COARSE);
    gather(steps, frame, List::COARSE);
    steps.run(&passes::coarse_irradiance, Size::List(List::COARSE));
    steps.copy_texels("carried_light");
    steps.run(&passes::coarse_spread, Size::List(List::HITS));
    steps.set_up(List::GATHER);
    gather(steps, frame, List::GATHER);
}

fn caustics(steps: &mut Steps, frame: &FrameSpec<'_>) {
    if frame.has_caustics() {
        steps.owner.map = MapKind::Caustics;
        let (over, slices) = (Size::List(List::HITS), frame.slices.caustics);
        in_slices(steps, &passes::caustic_gather, over, slices);
        steps.owner.map = MapKind::Photons;
    }
}

/// The right eye takes what it can from the left one's sample and lists the pixels that stay empty.
fn reuse(steps: &mut Steps, frame: &FrameSpec<'_>) {
    steps.clear(Moment::Sample);
    steps.clear(Moment::Reuse);
    let left_hits = Size::List(List::LEFT_HITS);
    match frame.reuse {
        Reuse::Off => return,
        // Projects the left hits; the nearest one wins its right pixel.
        Reuse::Scatter => {
            steps.run(&passes::scatter_depth, left_hits);
            steps.run(&passes::scatter_winner, left_hits);
            steps.run(&passes::reuse_resolve, Size::Tiles);
        }
        // Traces primary rays and lights what they meet by the left samples around it.
        Reuse::Lookup => {
            steps.run(&passes::left_irradiance, left_hits);
            steps.copy_texels("carried_light");
            steps.run(&passes::reuse_lookup, Size::Tiles);
        }
    }
    steps.set_up(List::FILL);
}

/// The right eye's empty pixels render themselves; glossy ones may still reuse indirect light.
fn fill(steps: &mut Steps, frame: &FrameSpec<'_>) {
    let over = Size::List(List::FILL);
    primary_hits(steps, frame, over);
    if frame.is_photon() {
        direct_light(steps, frame);
        if frame.features.carry_indirect {
            steps.run(&passes::indirect_lookup, Size::List(List::HITS));
            steps.set_up(List::GATHER);
            gather(steps, frame, List::GATHER);
        } else {
            gather(steps, frame, List::HITS);
        }
        caustics(steps, frame);
        steps.run(&passes::eye_combine, over);
    }
    steps.run(&passes::fill_reasons, Size::List(List::HITS));
}

/// Where light lies while it is filtered: direct, indirect.
type Light = [&'static str; 2];
const PING: Light = ["direct_ping", "indirect_ping"];
const PONG: Light = ["direct_pong", "indirect_pong"];
/// What the next frame reads.
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
fn reconstruct(frame: &FrameSpec<'_>) -> Vec<Step> {
    let settings = &frame.settings.reconstruct;
    let mut steps = Steps::of_eye(Stage::Reconstruct.name(), Eye::Left);
    if !settings.is_on() {
        return steps.done();
    }
    if settings.svgf || settings.taa {
        for_eyes(&mut steps, frame, &passes::motion, |_| ());
    }
    let filtered = if settings.svgf {
        svgf(&mut steps, frame)
    } else {
        PING
    };
    for &eye in frame.eyes() {
        steps.turn_to(Stage::Reconstruct.name(), eye);
        let step = steps.run(&passes::recombine, Size::Tiles);
        step.names(&named(["direct_filtered", "indirect_filtered"], filtered));
        if settings.taa {
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

/// Accumulates light over frames, shares it between the eyes, and filters it by its variance. Says where it lies then.
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
        light = share(steps, frame, light, 0, &[&own[..], &theirs].concat());
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
        // Each eye's own pixels have weighed the neighbours a little differently: agree once more. Moments and lengths stay
        // as they are: what is written goes nowhere.
        let nowhere = [
            ("shared_moments", "own_moments"),
            ("shared_length", "own_history_length"),
        ];
        light = share(steps, frame, light, 1, &nowhere);
    }
    light
}

/// Each eye takes in the other's light where both see a surface.
fn share(
    steps: &mut Steps,
    frame: &FrameSpec<'_>,
    light: Light,
    index: u32,
    names: &[(&'static str, &'static str)],
) -> Light {
    let theirs = match light {
        PING => ["other_direct_ping", "other_indirect_ping"],
        PONG => ["other_direct_pong", "other_indirect_pong"],
        _ => ["other_direct_history", "other_indirect_history"],
    };
    let to = other(light);
    for_eyes(steps, frame, &passes::stereo_share, |step| {
        step.words(index, 0, 0);
        step.names(&named(["direct_mean", "indirect_mean"], light));
        step.names(&named(["other_direct", "other_indirect"], theirs));
        step.names(&named(["shared_direct", "shared_indirect"], to));
        step.names(names);
    });
    to
}

/// The picture of an eye that is shown: a buffer's name.
#[must_use]
pub fn shown_light(settings: &Settings) -> &'static str {
    if settings.reconstruct.taa {
        "displayed"
    } else if settings.reconstruct.is_on() {
        "reconstructed"
    } else {
        "radiance_sum"
    }
}

/// Both eyes' pictures go to a runtime, with their depths where it takes them, or to a window.
#[must_use]
pub fn present(settings: &Settings, passes: &[&Pass]) -> PlannedStage {
    let mut steps = Steps::of_eye(Stage::Present.name(), Eye::Left);
    for eye in Eye::BOTH {
        steps.turn_to(Stage::Present.name(), eye);
        for pass in passes {
            let step = steps.run(pass, Size::Fragments);
            step.names(&[("shown_light", shown_light(settings))]);
        }
    }
    PlannedStage {
        stage: Stage::Present,
        when: "where a runtime or a window takes the images",
        longest_run: 1,
        steps: steps.done(),
    }
}

/// What runs beside the frame, where someone asks for it.
#[must_use]
pub fn on_demand(settings: &Settings) -> [PlannedStage; 2] {
    let takers = [
        &passes::xr_submit,
        &passes::xr_submit_depth,
        &passes::mirror,
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
        longest_run: 1,
        steps,
    }
}

/// What a view of intermediate results runs, after a frame.
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
            in_slices(&mut steps, &passes::inspect_photons, Size::Tiles, slices);
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
            in_slices(&mut steps, &passes::inspect_caustics, Size::Tiles, slices);
        }
        // Every pixel has a ray of its own here, so nothing is read of what the other eye left.
        View::Motion => {
            let step = steps.run(&passes::motion, Size::Tiles).words(0, 0, 1);
            step.names(&[
                ("hit_rays", "inspected_normals"),
                ("first_surfaces", "inspected_hits"),
                ("left_first_surfaces", "inspected_hits"),
                ("scatter_winners", "inspected_hits"),
                ("provenance", "inspected_hits"),
                ("seen_surfaces", "inspected_surfaces"),
                ("motion", "inspection"),
            ]);
        }
    }
    steps.done()
}
