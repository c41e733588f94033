//! Every setting with its kind, range, unit and one line of explanation.
//!
//! One list drives validation, the listing under `--help` and `info --settings`, and the viewer's panel.
//! Defaults are not repeated here: they are read from [`Settings::default`].

use std::fmt::Write as _;

use serde::Serialize;
use serde_json::Value;

use super::settings::Settings;

pub use super::kinds::{Kind, Setting};

const FORCE: Kind = Kind::Choice(&["auto", "on", "off"]);
const SHARE: Kind = Kind::Real {
    min: 0.0,
    max: 1.0,
    inclusive: true,
};
const SIGMA: Kind = Kind::Real {
    min: 0.0,
    max: 1e9,
    inclusive: false,
};
const DEPTH: Kind = Kind::Whole { min: 1, max: 64 };

const fn setting(key: &'static str, kind: Kind, unit: &'static str, doc: &'static str) -> Setting {
    Setting {
        key,
        kind,
        unit,
        doc,
    }
}

/// Largest width or height of an eye's image in pixels.
pub const MAX_SIZE: u32 = 16_384;

/// All settings, in the order of [`Settings`].
pub static SETTINGS: &[Setting] = &[
    setting(
        "scene",
        Kind::Text { empty: false },
        "",
        "glTF file (.gltf, .glb) or builtin:NAME",
    ),
    setting(
        "method",
        Kind::Choice(&["photon", "path"]),
        "",
        "light transport",
    ),
    setting(
        "reuse",
        Kind::Choice(&["off", "scatter", "lookup"]),
        "",
        "how the right eye reuses the left; off renders each by itself",
    ),
    setting(
        "spp",
        Kind::Whole {
            min: 1,
            max: 1_048_576,
        },
        "samples per pixel",
        "primary samples per pixel and frame, averaged",
    ),
    setting(
        "seed",
        Kind::Whole {
            min: 0,
            max: u32::MAX as u64,
        },
        "",
        "random seed",
    ),
    setting(
        "size",
        Kind::Size { max: MAX_SIZE },
        "pixels",
        "size of each eye's image; unset takes the headset's",
    ),
    setting(
        "headset",
        Kind::Text { empty: false },
        "",
        "headset profile from config/headsets/",
    ),
    setting(
        "adapter",
        Kind::Text { empty: true },
        "",
        "substring of the adapter's name; empty takes the best one",
    ),
    setting(
        "path.max_depth",
        DEPTH,
        "segments",
        "length of a path from eye to light: 1 is emission seen directly, 2 is direct light",
    ),
    setting(
        "path.russian_roulette",
        Kind::Bool,
        "",
        "end dim paths by chance, without bias",
    ),
    setting(
        "path.sampler",
        Kind::Choice(&["random", "sobol"]),
        "",
        "independent random numbers or Owen-scrambled Sobol points",
    ),
    setting(
        "path.technique",
        Kind::Choice(&["mis", "light", "bsdf"]),
        "",
        "how the path tracer finds lights: both ways weighted, by light samples, by the surfaces' directions",
    ),
    setting(
        "path.light_candidates",
        Kind::Whole { min: 1, max: 16 },
        "samples",
        "light samples that the one of a shadow ray is chosen from, by what each would bring; in both methods",
    ),
    setting(
        "photon.count",
        Kind::Whole {
            min: 0,
            max: 67_108_864,
        },
        "photons",
        "photons emitted per frame",
    ),
    setting(
        "photon.radius_m",
        Kind::Real {
            min: 0.0,
            max: 1e9,
            inclusive: true,
        },
        "metres",
        "gather radius; 0 takes it from the scene's area and the photon count",
    ),
    setting(
        "photon.caustic_count",
        Kind::Whole {
            min: 0,
            max: 67_108_864,
        },
        "photons",
        "photons emitted for the map of caustics, in scenes that can form them; 0 takes photon.count",
    ),
    setting(
        "photon.caustic_radius_m",
        Kind::Real {
            min: 0.0,
            max: 1e9,
            inclusive: true,
        },
        "metres",
        "gather radius of caustics; 0 takes half of photon.radius_m",
    ),
    setting(
        "photon.max_depth",
        DEPTH,
        "segments",
        "length of a path from eye to light, counted as path.max_depth is",
    ),
    setting(
        "photon.direct",
        Kind::Choice(&["nee", "map"]),
        "",
        "direct light by next-event estimation or from the photon map",
    ),
    setting(
        "photon.kernel",
        Kind::Choice(&["constant", "epanechnikov", "cone"]),
        "",
        "weight of a photon by its distance from the gather point",
    ),
    setting(
        "photon.capacity",
        Kind::Whole {
            min: 0,
            max: 268_435_456,
        },
        "photons",
        "stored photons that each map's buffer holds; 0 takes it from the photon count",
    ),
    setting(
        "photon.grid_cells_max",
        Kind::Whole {
            min: 64,
            max: 4_194_300,
        },
        "cells",
        "upper bound on the hash grid's cells",
    ),
    setting(
        "photon.every_frame",
        Kind::Bool,
        "",
        "trace photons for every frame, even where scene and lights are static",
    ),
    setting(
        "photon.shares",
        Kind::Whole { min: 1, max: 64 },
        "",
        "shares in which photons are traced anew once something moves, one per frame; light lags by as many frames",
    ),
    setting(
        "photon.progressive",
        Kind::Bool,
        "",
        "shrink the radius from sample to sample, converging to the path tracer",
    ),
    setting(
        "photon.progressive_alpha",
        Kind::Real {
            min: 0.0,
            max: 1.0,
            inclusive: false,
        },
        "",
        "share of new photons kept at each progressive step",
    ),
    setting(
        "photon.normal_min_cos",
        Kind::Real {
            min: -1.0,
            max: 1.0,
            inclusive: true,
        },
        "cosine",
        "a photon counts where its surface normal and the gather point's agree this well",
    ),
    setting(
        "photon.search",
        Kind::Choice(&["grid", "kd-tree"]),
        "",
        "how photons around a point are found; kd-tree is for comparison, and caustics keep the grid",
    ),
    setting(
        "photon.estimate",
        Kind::Choice(&["radius", "nearest"]),
        "",
        "estimate from all photons within the radius, or from the nearest of them; caustics keep the radius",
    ),
    setting(
        "photon.nearest",
        Kind::Whole { min: 1, max: 64 },
        "photons",
        "how many the estimate from the nearest takes, within photon.radius_m",
    ),
    setting(
        "photon.schedule",
        Kind::Choice(&["split", "fused"]),
        "",
        "trace and gather in two kernels or in one; fused is for comparison",
    ),
    setting(
        "photon.loads",
        Kind::Choice(&["direct", "cooperative"]),
        "",
        "each thread loads its photons, or a workgroup together; cooperative is for comparison",
    ),
    setting(
        "photon.half_rate",
        Kind::Bool,
        "",
        "gather at every other pixel in each direction and interpolate between them, caustics aside",
    ),
    setting(
        "stereo.max_view_dependence",
        Kind::Real {
            min: 0.0,
            max: 1.0,
            inclusive: true,
        },
        "",
        "view-dependence limit of reuse; 0 reuses only what does not depend on the viewing direction",
    ),
    setting(
        "stereo.max_lobe_shift",
        Kind::Real {
            min: 0.0,
            max: 1e9,
            inclusive: true,
        },
        "lobe widths",
        "lookup: glossy surfaces take indirect light over where their lobe moves by no more between the eyes; 0 never",
    ),
    setting(
        "reconstruct.svgf",
        Kind::Bool,
        "",
        "filter direct and indirect light over frames and neighbours (SVGF)",
    ),
    setting(
        "reconstruct.stereo",
        Kind::Bool,
        "",
        "with svgf: the eyes share their accumulated light where both see a surface",
    ),
    setting(
        "reconstruct.taa",
        Kind::Bool,
        "",
        "temporal anti-aliasing of what is shown: PNG files, a headset's images, the mirror; EXR files are before it",
    ),
    setting(
        "reconstruct.still",
        Kind::Bool,
        "",
        "while nothing moves, the mean over the still frames takes the picture over",
    ),
    setting(
        "reconstruct.atrous_passes",
        Kind::Whole { min: 0, max: 8 },
        "",
        "passes of the wavelet filter; the last reaches 2^(passes + 1) pixels to each side",
    ),
    setting(
        "reconstruct.color_alpha",
        SHARE,
        "",
        "least share of a new frame in the accumulated light",
    ),
    setting(
        "reconstruct.moments_alpha",
        SHARE,
        "",
        "least share of a new frame in the luminance moments",
    ),
    setting(
        "reconstruct.sigma_luminance",
        SIGMA,
        "standard deviations",
        "luminance difference at which a neighbour's weight is 1/e",
    ),
    setting(
        "reconstruct.sigma_normal",
        SIGMA,
        "",
        "exponent of the cosine between a neighbour's normal and the pixel's",
    ),
    setting(
        "reconstruct.sigma_plane_px",
        SIGMA,
        "pixel widths",
        "distance from the tangent plane at which a neighbour's weight is 1/e",
    ),
    setting(
        "reconstruct.firefly_frames",
        Kind::Whole {
            min: 0,
            max: 1_000_000,
        },
        "frames",
        "light with at most so many frames behind it is limited to its brightest neighbour's; 0 never",
    ),
    setting(
        "reconstruct.taa_alpha",
        SHARE,
        "",
        "share of a new frame in the displayed image",
    ),
    setting(
        "reconstruct.taa_clip",
        SIGMA,
        "standard deviations",
        "how far from the mean of its 3x3 neighbours a history colour may lie",
    ),
    setting(
        "reconstruct.still_from",
        Kind::Whole {
            min: 0,
            max: 1_000_000,
        },
        "frames",
        "still frames up to which the filter alone is shown",
    ),
    setting(
        "reconstruct.still_until",
        Kind::Whole {
            min: 1,
            max: 1_000_000,
        },
        "frames",
        "still frames from which on the mean alone is shown",
    ),
    setting(
        "environment.path",
        Kind::Text { empty: true },
        "",
        "equirectangular .hdr or .exr file; empty for a black surround",
    ),
    setting(
        "environment.strength",
        Kind::Real {
            min: 0.0,
            max: 1e9,
            inclusive: true,
        },
        "",
        "factor on the environment's radiance",
    ),
    setting(
        "animation.clip",
        Kind::Text { empty: true },
        "",
        "clip by name, or by number from 0; none plays nothing, empty the first one there is",
    ),
    setting(
        "animation.speed",
        Kind::Real {
            min: -1000.0,
            max: 1000.0,
            inclusive: true,
        },
        "",
        "seconds of the clip per second of display time",
    ),
    setting(
        "animation.time_s",
        Kind::Real {
            min: 0.0,
            max: 1e6,
            inclusive: true,
        },
        "s",
        "second of the clip that the first frame shows",
    ),
    setting(
        "output.exposure",
        Kind::Real {
            min: 0.0,
            max: 1e9,
            inclusive: true,
        },
        "",
        "exposure factor of what is shown: PNG files and a headset's images; EXR files are never scaled",
    ),
    setting(
        "output.images",
        Kind::Bool,
        "",
        "write images; stats.jsonl and run.json are written in any case",
    ),
    setting(
        "output.parts",
        Kind::Bool,
        "",
        "also write each eye's direct light, indirect light and albedo, frame_NNNN_EYE_{direct,indirect,albedo}.exr",
    ),
    setting(
        "output.motion",
        Kind::Bool,
        "",
        "keep where things were in the frame before, for views of motion; images stay as they are",
    ),
    setting(
        "force.glossy",
        FORCE,
        "",
        "glossy and metallic lobes in the shaders: as the scene needs, always, never",
    ),
    setting("force.dielectric", FORCE, "", "glass in the shaders"),
    setting("force.textures", FORCE, "", "textures in the shaders"),
    setting(
        "force.normal_maps",
        FORCE,
        "",
        "normal maps in the shaders; on brings textures, which off takes them away with",
    ),
    setting(
        "force.alpha",
        FORCE,
        "",
        "alpha mask and blend in the shaders",
    ),
    setting(
        "force.vertex_colors",
        FORCE,
        "",
        "vertex colours in the shaders",
    ),
    setting(
        "force.environment",
        FORCE,
        "",
        "the environment map in the shaders",
    ),
    setting(
        "force.caustics",
        FORCE,
        "",
        "a map of caustics, apart from the other photons",
    ),
    setting(
        "force.record_texels",
        FORCE,
        "",
        "the scene's records in textures, which software adapters read faster; auto: on those",
    ),
    setting(
        "simulated.motion",
        Kind::Choice(&["still", "yaw", "walk", "sway"]),
        "",
        "motion of the simulated headset",
    ),
    setting(
        "openxr.space",
        Kind::Choice(&["local", "stage"]),
        "",
        "space of the runtime that the scene stands in: around the head's place, or on the floor",
    ),
    setting(
        "openxr.format",
        Kind::Choice(&["auto", "srgb", "half"]),
        "",
        "colour format of the images for the runtime: the runtime's choice, 8-bit sRGB, half floats",
    ),
    setting(
        "openxr.depth_layer",
        Kind::Bool,
        "",
        "submit depth where the runtime takes it",
    ),
    setting(
        "openxr.visibility_mask",
        Kind::Bool,
        "",
        "spend no rays on pixels that the lens hides",
    ),
    setting(
        "openxr.refresh_hz",
        Kind::Real {
            min: 0.0,
            max: 1000.0,
            inclusive: true,
        },
        "Hz",
        "refresh rate to ask the runtime for; 0 leaves it to the runtime",
    ),
    setting(
        "openxr.move_m_per_s",
        Kind::Real {
            min: 0.0,
            max: 100.0,
            inclusive: true,
        },
        "m/s",
        "walking speed at full deflection of the stick",
    ),
    setting(
        "openxr.snap_turn_deg",
        Kind::Real {
            min: 0.0,
            max: 180.0,
            inclusive: true,
        },
        "degrees",
        "one snap turn",
    ),
    setting(
        "gpu.timestamps",
        Kind::Bool,
        "",
        "time each pass with GPU timestamp queries",
    ),
    setting(
        "gpu.shader_folder",
        Kind::Text { empty: true },
        "",
        "folder whose .wesl files replace the embedded shaders of the same name; for work on shaders",
    ),
    setting(
        "limits.load_memory",
        Kind::Real {
            min: 0.0,
            max: 1e6,
            inclusive: true,
        },
        "GiB",
        "memory that loading a scene with its environment may take; 0 takes 4, or half of the machine's if that is less",
    ),
    setting(
        "limits.allow_outside",
        Kind::Bool,
        "",
        "scenes may name files outside their own folder",
    ),
];

/// The setting under a dotted key.
#[must_use]
pub fn find(key: &str) -> Option<&'static Setting> {
    SETTINGS.iter().find(|setting| setting.key == key)
}

/// Keys of the settings under a section, such as `photon`; empty if there is no such section.
#[must_use]
pub fn section_keys(name: &str) -> Vec<&'static str> {
    let under = |key: &&'static str| {
        key.strip_prefix(name)
            .is_some_and(|rest| rest.starts_with('.'))
    };
    SETTINGS
        .iter()
        .map(|setting| setting.key)
        .filter(under)
        .collect()
}

/// The known key most like an unknown one; `section` looks among the sections' names as well.
#[must_use]
pub fn nearest(unknown: &str, section: bool) -> &'static str {
    let score = |known: &str| {
        let whole = strsim::normalized_damerau_levenshtein(unknown, known);
        // `radius_m` should find `photon.radius_m`; a little less sure than the same words in full.
        let leaf = known.rsplit('.').next().map_or(0.0, |leaf| {
            0.9 * strsim::normalized_damerau_levenshtein(unknown, leaf)
        });
        whole.max(leaf)
    };
    let sections = SETTINGS
        .iter()
        .filter_map(|setting| Some(setting.key.split_once('.')?.0))
        .filter(|_| section);
    let mut best = ("scene", -1.0);
    for known in SETTINGS.iter().map(|setting| setting.key).chain(sections) {
        let likeness = score(known);
        if likeness > best.1 {
            best = (known, likeness);
        }
    }
    best.0
}

/// The default of a setting as JSON, `null` where unset.
#[must_use]
pub fn default_of(key: &str) -> Value {
    value_of(&Settings::default(), key)
}

pub use super::sections::{Section, section_of, sections, value_of};

/// A setting as `info --settings` prints it.
#[derive(Clone, Debug, Serialize)]
pub struct SettingRow {
    /// Dotted key.
    pub key: &'static str,
    /// `bool`, `whole`, `real`, `choice`, `text` or `size`.
    pub kind: &'static str,
    /// Default, `null` where unset.
    pub default: Value,
    /// Allowed values in words.
    pub allowed: String,
    /// Unit, or empty.
    pub unit: &'static str,
    /// One line of explanation.
    pub doc: &'static str,
}

/// All settings as rows, in the registry's order.
#[must_use]
pub fn rows() -> Vec<SettingRow> {
    SETTINGS
        .iter()
        .map(|setting| SettingRow {
            key: setting.key,
            kind: setting.kind.name(),
            default: default_of(setting.key),
            allowed: setting.kind.allowed(),
            unit: setting.unit,
            doc: setting.doc,
        })
        .collect()
}

/// All settings as text, for `--help`.
#[must_use]
pub fn help_text() -> String {
    let mut text = String::from(
        "Settings, for --set KEY=VALUE and for the TOML file of --config\n\
         (a dotted key there is a key under a [section]; flags win over --set, --set over the file):\n",
    );
    for row in rows() {
        let default = match &row.default {
            Value::Null => "unset".to_owned(),
            other => other.to_string(),
        };
        let unit = if row.unit.is_empty() {
            String::new()
        } else {
            format!(", {}", row.unit)
        };
        let range = match row.kind {
            "text" => String::new(),
            _ => format!("; {}", row.allowed),
        };
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "  {} = {default}{unit}\n      {}{range}",
            row.key, row.doc
        );
    }
    text
}
