//! Every buffer that passes write: owner, size, when it is cleared, and how long it holds its data.
//!
//! A buffer is allocated if a pass of the plan binds it, at full size if one writes it; what is only declared gets
//! [`TOKEN_BYTES`]. A buffer has a texture copy if a shader declares a texture under its name.

use super::photon_layout::{
    GUIDE_BYTES, GUIDE_CELLS, MapLayout, PHOTON_BYTES, SORTED_PHOTON_BYTES,
};
use crate::renderer::records::photon::{PhotonCounters, PhotonGrid};
use crate::renderer::records::stereo::StereoCounters;

/// Bytes of a buffer that a shader declares and nothing writes: more than any record.
pub const TOKEN_BYTES: u64 = 256;

/// When buffers are cleared; the plan says where these moments lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Moment {
    /// Before a frame's first sample.
    Frame,
    /// Before a frame's first sample, if there are several: one alone is written over what was there.
    Sums,
    /// Before each sample of an eye.
    Sample,
    /// Before each sample of an eye that reuses the other's.
    Reuse,
    /// Before the left eye's light is divided by reflectance.
    Carry,
    /// Before photons are gathered at half rate.
    HalfRate,
    /// Before a photon map is traced.
    Map,
    /// Before it is learnt where to emit photons.
    Guide,
    /// Before a batch of photon paths is traced.
    Batch,
    /// Before a digit of the radix sort is counted.
    Digit,
    /// Before an inspection view counts.
    View,
}

/// Owner of a buffer, and what its size depends on.
#[derive(Debug, Clone, Copy)]
pub enum Scope {
    /// One per eye.
    Eye(fn(&ImageLayout) -> u64),
    /// One per frame; the eyes use it in turn.
    Frame(fn(&ImageLayout) -> u64),
    /// One per photon map.
    Map(fn(&MapLayout) -> u64),
    /// One per batch of photon paths if shares of the paths are kept, else one for all batches.
    Batch(fn(&MapLayout) -> u64),
}

/// What the sizes of the eyes' buffers depend on.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ImageLayout {
    /// Width and height of an eye's image, pixels.
    pub size: [u32; 2],
    /// Bytes of a pixel's k nearest photons between slices of a gather; 0 if there is one slice.
    pub heap_bytes: u64,
}

impl ImageLayout {
    /// 8x8 tiles of an eye's image, across and down.
    #[must_use]
    pub fn tiles(&self) -> [u32; 2] {
        self.size.map(|pixels| pixels.div_ceil(8))
    }

    /// Pixels of an eye's image.
    #[must_use]
    pub fn pixels(&self) -> u64 {
        u64::from(self.size[0]) * u64::from(self.size[1])
    }
}

/// How long a buffer holds its data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Holds {
    /// From its first write in a frame to its last use in it, or until the next frame begins where the plan keeps it; then its
    /// memory may hold something else ([`super::homes`]).
    Within,
    /// At all times.
    Always,
    /// Double-buffered: shaders call the previous frame's `NAME_before`.
    Turns,
}

/// One buffer.
#[derive(Debug, Clone, Copy)]
pub struct BufferRow {
    /// Name, as shaders declare it.
    pub name: &'static str,
    /// Owner and bytes.
    pub scope: Scope,
    /// When it is cleared.
    pub cleared: &'static [Moment],
    /// How long it holds its data.
    pub holds: Holds,
    /// Whether the host writes it, so that it always has its full size.
    pub host_writes: bool,
}

impl BufferRow {
    const fn new(name: &'static str, scope: Scope) -> Self {
        Self {
            name,
            scope,
            cleared: &[],
            holds: Holds::Always,
            host_writes: false,
        }
    }

    const fn cleared(mut self, moments: &'static [Moment]) -> Self {
        self.cleared = moments;
        self
    }

    const fn holds(mut self, holds: Holds) -> Self {
        self.holds = holds;
        self
    }

    const fn host_writes(mut self) -> Self {
        self.host_writes = true;
        self
    }

    /// Whether only the making of a photon map needs it.
    #[must_use]
    pub fn is_scratch(&self) -> bool {
        let is_of_map = matches!(self.scope, Scope::Map(_) | Scope::Batch(_));
        is_of_map && self.holds == Holds::Within
    }

    /// Whether it is double-buffered.
    #[must_use]
    pub fn takes_turns(&self) -> bool {
        self.holds == Holds::Turns
    }

    /// Buffers that it has: two if they take turns.
    #[must_use]
    pub fn turns(&self) -> u64 {
        if self.takes_turns() { 2 } else { 1 }
    }
}

macro_rules! per_pixel {
    ($scope:ident, $name:literal, $bytes:expr) => {
        BufferRow::new($name, Scope::$scope(|image| image.pixels() * $bytes)).holds(Holds::Within)
    };
}

/// A list of an eye's 8x8 tiles.
const fn tile_list(name: &'static str) -> BufferRow {
    let bytes = |image: &ImageLayout| image.tiles().map(u64::from).into_iter().product::<u64>() * 4;
    BufferRow::new(name, Scope::Eye(bytes))
}

macro_rules! fixed {
    ($scope:ident, $name:literal, $bytes:expr) => {
        BufferRow::new($name, Scope::$scope(|_| $bytes))
    };
}

const fn map(name: &'static str, bytes: fn(&MapLayout) -> u64) -> BufferRow {
    BufferRow::new(name, Scope::Map(bytes))
}

/// What only the making of a photon map needs.
const fn scratch(name: &'static str, bytes: fn(&MapLayout) -> u64) -> BufferRow {
    map(name, bytes).holds(Holds::Within)
}

const fn batch(name: &'static str, bytes: fn(&MapLayout) -> u64) -> BufferRow {
    BufferRow::new(name, Scope::Batch(bytes)).holds(Holds::Within)
}

/// All buffers. A list `NAME` of pixels or tiles is `NAME_list`, with its length in `NAME_count` and the workgroups of passes over
/// it in `NAME_groups` ([`super::step::List`]).
#[rustfmt::skip]
pub const BUFFERS: &[BufferRow] = &[
    // A sample of an eye: `shaders/shared/eye_hit.wesl`, `shaders/shared/parts.wesl`.
    per_pixel!(Eye, "hit_rays", 16),
    per_pixel!(Eye, "first_surfaces", 16),
    per_pixel!(Eye, "hit_list", 4),
    fixed!(Eye, "hit_count", 16).cleared(&[Moment::Sample]),
    fixed!(Eye, "hit_groups", 32),
    per_pixel!(Eye, "followed_list", 4),
    fixed!(Eye, "followed_count", 16).cleared(&[Moment::Sample]),
    fixed!(Eye, "followed_groups", 32),
    per_pixel!(Eye, "hit_paths", 16),
    per_pixel!(Eye, "hit_surfaces", 16),
    per_pixel!(Eye, "end_rays", 16),
    // Direct light and emission; indirect light and caustics.
    per_pixel!(Eye, "direct_light", 16),
    per_pixel!(Eye, "indirect_light", 16),
    per_pixel!(Eye, "direct_irradiance", 8),
    // Share of the pixel that surfaces cover, where the rest lets the room through: `shaders/shared/coverage.wesl`.
    per_pixel!(Eye, "coverage", 4).cleared(&[Moment::Frame]),
    per_pixel!(Eye, "steady_coverage", 4).holds(Holds::Turns),
    // Sums over a frame's samples.
    per_pixel!(Eye, "radiance_sum", 16).cleared(&[Moment::Sums]),
    per_pixel!(Eye, "direct_sum", 16).cleared(&[Moment::Sums]),
    per_pixel!(Eye, "albedo_sum", 16).cleared(&[Moment::Sums]),
    // One bit per pixel: hidden by the headset's lens.
    BufferRow::new("hidden_pixels", Scope::Eye(|image| image.pixels().div_ceil(32) * 4)).host_writes(),

    // Gathering at half rate, and lists of pixels that still gather.
    per_pixel!(Frame, "coarse_list", 4),
    fixed!(Frame, "coarse_count", 16).cleared(&[Moment::HalfRate]),
    fixed!(Frame, "coarse_groups", 32),
    per_pixel!(Frame, "gather_list", 4),
    fixed!(Frame, "gather_count", 16).cleared(&[Moment::HalfRate]),
    fixed!(Frame, "gather_groups", 32),
    // Demodulated light that other pixels take: `shaders/shared/carried.wesl`.
    // One for every other pixel in each direction (`shaders/shared/coarse.wesl`).
    BufferRow::new("coarse_light", Scope::Frame(|image| {
        image.size.map(|pixels| u64::from(pixels.div_ceil(2))).iter().product::<u64>() * 16
    }))
        .holds(Holds::Within)
        .cleared(&[Moment::HalfRate]),
    BufferRow::new("nearest_heaps", Scope::Frame(|image| image.pixels() * image.heap_bytes)),

    // Reuse of the left eye's samples.
    // Demodulated light, as above: `shaders/shared/carrying.wesl`.
    per_pixel!(Frame, "demodulated_light", 16).cleared(&[Moment::Carry]),
    per_pixel!(Frame, "first_emission", 8),
    // In their place where passes of the right eye's only name them.
    fixed!(Frame, "nothing_carried", TOKEN_BYTES),
    fixed!(Frame, "no_emission", TOKEN_BYTES),
    fixed!(Frame, "no_irradiance", TOKEN_BYTES),
    fixed!(Frame, "no_light_samples", TOKEN_BYTES),
    fixed!(Frame, "no_light_places", TOKEN_BYTES),
    // The left eye's: `shaders/shared/light_samples.wesl`.
    per_pixel!(Eye, "light_samples", 24),
    per_pixel!(Eye, "light_places", 16),
    per_pixel!(Frame, "scatter_targets", 8),
    per_pixel!(Frame, "scatter_nearest", 4).cleared(&[Moment::Reuse]),
    per_pixel!(Frame, "scatter_winners", 4).cleared(&[Moment::Reuse]),
    per_pixel!(Frame, "fill_list", 4),
    fixed!(Frame, "fill_count", 16).cleared(&[Moment::Reuse]),
    fixed!(Frame, "fill_groups", 32),
    per_pixel!(Frame, "provenance", 4),
    fixed!(Frame, "stereo_counters", size_of::<StereoCounters>() as u64).cleared(&[Moment::Frame]),

    // Reconstruction: `shaders/shared/reconstruction.wesl`.
    per_pixel!(Eye, "seen_surfaces", 16).holds(Holds::Turns),
    per_pixel!(Eye, "seen_albedo", 8),
    tile_list("tile_marks").cleared(&[Moment::Frame]),
    tile_list("seen_list"),
    fixed!(Eye, "seen_count", 16).cleared(&[Moment::Frame]),
    fixed!(Eye, "seen_groups", 32),
    tile_list("mixed_list"),
    fixed!(Eye, "mixed_count", 16).cleared(&[Moment::Frame]),
    fixed!(Eye, "mixed_groups", 32),
    tile_list("young_list"),
    fixed!(Eye, "young_count", 16).cleared(&[Moment::Frame]),
    fixed!(Eye, "young_groups", 32),
    per_pixel!(Eye, "motion", 8),
    per_pixel!(Eye, "moments", 8).holds(Holds::Turns),
    per_pixel!(Eye, "history_length", 4).holds(Holds::Turns),
    // Light on its way through the filter, and as the next frame reads it: `shaders/shared/filtered_light.wesl`.
    per_pixel!(Eye, "light_ping", 16),
    per_pixel!(Frame, "light_pong", 16),
    per_pixel!(Eye, "light_history", 16).holds(Holds::Always),
    per_pixel!(Eye, "still_light", 16).holds(Holds::Always),
    per_pixel!(Eye, "reconstructed", 16),
    per_pixel!(Eye, "anti_aliased", 16).holds(Holds::Turns),
    per_pixel!(Eye, "anti_aliased_moments", 8).holds(Holds::Turns),

    // A view that stands still, as a window shows it.
    per_pixel!(Eye, "mean_light", 16).holds(Holds::Always),
    per_pixel!(Eye, "shown_pixels", 4).holds(Holds::Always),

    // Of the dispatch that runs: `shaders/shared/work.wesl`.
    fixed!(Frame, "work_counts", size_of::<[u64; 5]>() as u64).cleared(&[Moment::Frame]),

    // Views of intermediate results.
    per_pixel!(Frame, "inspected_hits", 16).holds(Holds::Always),
    per_pixel!(Frame, "inspected_normals", 16).holds(Holds::Always),
    per_pixel!(Frame, "inspected_colors", 16).holds(Holds::Always),
    per_pixel!(Frame, "inspected_marks", 16).holds(Holds::Always),
    per_pixel!(Frame, "inspected_surfaces", 16).holds(Holds::Always),
    per_pixel!(Frame, "inspection", 16).holds(Holds::Always).cleared(&[Moment::View]),

    // Photon paths of a batch, in slots of their own.
    batch("path_photons", |map| u64::from(map.batch_paths) * u64::from(map.slots_per_path) * PHOTON_BYTES),
    batch("path_counts", |map| map.path_count_bytes()).cleared(&[Moment::Batch]),
    scratch("path_starts", |map| map.path_count_bytes()),
    // Of all values of a prefix sum, which nobody asks for.
    scratch("scan_total", |_| TOKEN_BYTES),
    scratch("path_sums", |map| MapLayout::sum_bytes(map.path_count_bytes())),
    // Where to emit: pilot paths, what each is worth, then sums over the cells: `shaders/shared/photon_guide.wesl`.
    scratch("pilot_photons", |map| u64::from(GUIDE_CELLS) * u64::from(map.slots_per_path) * PHOTON_BYTES),
    scratch("pilot_counts", |_| u64::from(GUIDE_CELLS) * 4),
    scratch("pilot_worths", |_| u64::from(GUIDE_CELLS) * 4),
    map("photon_guide", |_| GUIDE_BYTES).cleared(&[Moment::Guide]),
    scratch("guide_sums", |_| MapLayout::sum_bytes(GUIDE_BYTES)),
    // The list, the grid over it and the sort by cell.
    scratch("photons", |map| u64::from(map.capacity) * PHOTON_BYTES),
    map("photon_counters", |_| size_of::<PhotonCounters>() as u64).cleared(&[Moment::Map]),
    map("photon_bounds", |_| 24).cleared(&[Moment::Map]),
    map("photon_grid", |_| size_of::<PhotonGrid>() as u64),
    map("cell_starts", |map| map.cell_bytes()).cleared(&[Moment::Map]),
    scratch("cell_sums", |map| MapLayout::sum_bytes(map.cell_bytes())),
    map("longest_run", |_| 16).cleared(&[Moment::Map]),
    scratch("radix_even", |map| u64::from(map.capacity) * 8),
    scratch("radix_odd", |map| u64::from(map.capacity) * 8),
    scratch("radix_table", |map| map.radix_bytes()).cleared(&[Moment::Digit]),
    scratch("radix_sums", |map| MapLayout::sum_bytes(map.radix_bytes())),
    map("sorted_photons", |map| u64::from(map.capacity) * SORTED_PHOTON_BYTES),
    // The kd-tree: photon numbers in the orders of x, y and z; levels read one and write the other.
    scratch("kd_orders_even", |map| map.kd_places() * 4),
    scratch("kd_orders_odd", |map| map.kd_places() * 4),
    scratch("kd_axes", |map| u64::from(map.capacity) * 4),
    // One more entry marks the end of the last order.
    scratch("kd_marks", |map| (map.kd_places() + 1) * 4),
    scratch("kd_mark_sums", |map| MapLayout::sum_bytes((map.kd_places() + 1) * 4)),
    // Workgroups: see `kd_setup`.
    map("kd_groups", |_| 48),
    map("kd_nodes", |map| u64::from(map.capacity) * 16),
];

/// The row of a buffer.
#[must_use]
pub fn row(name: &str) -> Option<&'static BufferRow> {
    BUFFERS.iter().find(|row| row.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_buffer_has_a_name_of_its_own() {
        for (index, one) in BUFFERS.iter().enumerate() {
            assert!(
                !BUFFERS[..index].iter().any(|other| other.name == one.name),
                "{}",
                one.name
            );
            assert!(row(one.name).is_some());
        }
        assert!(row("no_such_buffer").is_none());
    }
}
