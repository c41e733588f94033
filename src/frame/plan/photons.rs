//! Photon maps: paths, then a grid or a kd-tree over their photons.

use crate::frame::buffers::Moment;
use crate::frame::passes::{self, Pass};
use crate::frame::photon_layout::{
    FIRST_PILOT, GUIDE_BYTES, MapKind, MapLayout, PATHS_PER_TRIED, SCAN_BLOCK,
};
use crate::frame::step::{Only, Size, Step, Steps};
use crate::renderer::records::photon::PhotonGrid;
use crate::settings::{PhotonEstimate, PhotonSettings};

/// Passes that trace photon paths; the rest of the stage builds the search structure.
pub const PATH_PASSES: [&Pass; 6] = [
    &passes::guide_look,
    &passes::guide_setup,
    &passes::photon_trace,
    &passes::photon_edges,
    &passes::photon_append,
    &passes::photon_count,
];

/// Traces paths batch by batch, then sorts their photons into a grid or a kd-tree.
pub(super) fn photons(map: &MapLayout, settings: &PhotonSettings) -> Vec<Step> {
    // The nearest photons' disc is known only where they are gathered.
    let by_radius =
        settings.estimate == PhotonEstimate::Radius || map.config.kind == MapKind::Caustics;
    let corrects_edges = settings.edge_correction && by_radius;
    let mut steps = Steps::of_map(map.config.kind);
    steps.clear(Moment::Map);
    if map.config.guided {
        guide(&mut steps, map);
    }
    for (batch, (first, count)) in (0..).zip(map.batches()) {
        photon_batch(&mut steps, map, corrects_edges, batch, [first, count]);
    }
    steps.owner.batch = 0;
    let sixteenths = Size::Threads(map.capacity.div_ceil(16));
    steps.run(&passes::photon_bounds, sixteenths);
    steps
        .run(&passes::grid_setup, Size::Once)
        .words(0, 1 << map.config.digits().1, 0);
    if map.is_tree() {
        kd_tree(&mut steps, map);
    } else {
        grid(&mut steps, map);
    }
    steps.done()
}

fn trace_pass(map: &MapLayout) -> &'static Pass {
    match map.config.kind {
        MapKind::Photons => &passes::photon_trace,
        MapKind::Caustics => &passes::caustic_trace,
    }
}

/// Pilot paths, whose photons are looked at and forgotten, one in each cell of emission; then sums over the cells' weights. What
/// they say holds for all shares of the paths.
fn guide(steps: &mut Steps, map: &MapLayout) {
    steps.only = Only::BatchDue(0);
    steps.clear(Moment::Guide);
    let paths = map.pilot_paths();
    if paths > 0 {
        let threads = map.tracing_threads(paths);
        for (pass, size) in [
            (trace_pass(map), Size::Threads(threads)),
            (&passes::guide_look, Size::Threads(paths)),
        ] {
            let step = steps.run(pass, size);
            step.words(FIRST_PILOT, paths, map.slots_per_path).names(&[
                ("path_photons", "pilot_photons"),
                ("path_counts", "pilot_counts"),
            ]);
        }
        steps.run(&passes::guide_setup, Size::Once);
        scan(steps, "photon_guide", "guide_sums", GUIDE_BYTES);
    }
    steps.only = Only::Always;
}

/// Paths store photons in their own slots; a prefix sum over their counts gives each path's place in the list.
fn photon_batch(
    steps: &mut Steps,
    map: &MapLayout,
    corrects_edges: bool,
    batch: u32,
    [first, count]: [u32; 2],
) {
    steps.owner.batch = if map.keeps_batches() { batch } else { 0 };
    let slots = map.slots_per_path;
    let trace = trace_pass(map);
    steps.only = Only::BatchDue(batch);
    steps.clear(Moment::Batch);
    steps
        .run(trace, Size::Threads(map.tracing_threads(count)))
        .words(first, count, slots);
    if corrects_edges {
        let threads = map.tracing_threads(count).div_ceil(PATHS_PER_TRIED);
        steps
            .run(&passes::photon_edges, Size::Threads(threads))
            .words(first, count, slots);
    }
    steps.only = Only::Always;
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
    let blocks = count.div_ceil(SCAN_BLOCK as u32);
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
    let parts = [("scan_values", values), ("scan_sums", sums)];
    steps.run(&passes::scan_blocks, blocks).names(&parts);
    // The blocks' totals are one block.
    let whole = [("scan_values", sums), ("scan_sums", "scan_total")];
    steps.run(&passes::scan_blocks, Size::Once).names(&whole);
    steps.run(&passes::scan_add, all).names(&parts);
}

const fn photon_grid(offset: usize) -> Size {
    Size::Indirect("photon_grid", offset as u64)
}

/// Over all stored photons.
const PHOTONS: Size = photon_grid(std::mem::offset_of!(PhotonGrid, photon_groups));

/// Counts the photons of every cell, sorts them by cell, and copies them into that order.
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

/// Stable radix sort by key, between two buffers.
fn radix_sort(steps: &mut Steps, map: &MapLayout) {
    let (digits, bits) = map.config.digits();
    let wide = map.config.wide_machine;
    // A workgroup per block, or a thread.
    let size = if wide {
        PHOTONS
    } else {
        Size::Threads(map.blocks())
    };
    let in_use = [
        photon_grid(std::mem::offset_of!(PhotonGrid, sort_block_groups)),
        photon_grid(std::mem::offset_of!(PhotonGrid, sort_value_groups)),
    ];
    for digit in 0..digits {
        let names = match digit % 2 {
            0 => [("radix_from", "radix_even"), ("radix_to", "radix_odd")],
            _ => [("radix_from", "radix_odd"), ("radix_to", "radix_even")],
        };
        let over_blocks = |steps: &mut Steps, pass| {
            let step = steps.run(pass, size).names(&names);
            step.words(digit * bits, 0, (1 << bits) - 1);
        };
        // Whole workgroups count in their own memory, and write every place of the table that is in use.
        if !wide {
            steps.clear(Moment::Digit);
        }
        over_blocks(steps, &passes::radix_count);
        scan_over(steps, "radix_table", "radix_sums", in_use);
        over_blocks(steps, &passes::radix_scatter);
    }
}

/// Sorts photons once along each axis, then splits all three orders at the medians, level by level (Brown 2015, "Building a
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
