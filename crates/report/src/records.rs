//! One record per measured row: everything that a reader needs in order to judge or repeat it, and nothing that changes
//! from one run to the next without the figures changing, so that reports can be compared.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;

pub use stereolux_images::metrics::BiasVariance;

use crate::statistics::{Estimate, Spread};

/// A reference's root variance is to be this share of the root of the smallest relative MSE against it.
pub const REFERENCE_SHARE: f64 = 0.1;
/// What names of the scenes that a suite generates to a size begin with.
pub const GENERATED: &str = "generated:";
/// The variant that tables 1 to 4 of the suite `tables` share: what the renderer does by default.
pub const DEFAULT_WAY: &str = "grid, radius, split, direct";
/// Width of a scene in the units in which the suite `tables` gives radii. The 2020 report does not state its unit; its box is
/// this wide.
pub const BOX_WIDTH_IN_TABLE_UNITS: f64 = 2.0;
/// The variant of the suite `scaling` whose host builds all hierarchies anew in every round.
pub const REBUILT: &str = "rebuilt whole";

/// Where a row was measured.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Machine {
    /// Adapter's name.
    pub adapter: String,
    /// `discrete`, `integrated`, `software`, ...
    pub kind: String,
    /// `Vulkan`, `Metal`, ...
    pub backend: String,
    /// Driver and its version.
    pub driver: String,
    /// True where the adapter computes on the CPU: such times say nothing about a GPU.
    pub software_adapter: bool,
}

impl Machine {
    /// Short label for tables: the adapter, and that it is software if it is.
    #[must_use]
    pub fn label(&self) -> String {
        if self.software_adapter {
            format!("{} (software adapter)", self.adapter)
        } else {
            self.adapter.clone()
        }
    }
}

/// Milliseconds of a row.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// `device` (timestamp queries) or `host` (the adapter has none; then only `host_*` are measured).
    pub clock: String,
    /// Rounds measured; each is one frame of every variant of the group in turn.
    pub rounds: u32,
    /// Rounds run before and discarded.
    pub warm_up: u32,
    /// By group of passes: `photons`, `build` (of these, what follows tracing), `gather`, `build_gather` (both), `left`, `right`, `eyes` (both), `frame` (all passes), `fill` and `carry` (the two parts
    /// of a reusing right eye), and on the host `host_update`, `host_frame`.
    pub ms: BTreeMap<String, Spread>,
    /// The same groups over those of the group's first variant, round by round.
    pub ratio: BTreeMap<String, Spread>,
    /// By pass.
    pub pass_ms: BTreeMap<String, Spread>,
}

/// Errors of one part of the picture against the path-traced reference, over the rounds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RegionErrors {
    /// Pixels, mean over the rounds.
    pub pixels: f64,
    /// Relative MSE. Standard errors here are over the rounds, which are independent renders.
    pub rel_mse: Option<Estimate>,
    /// Root mean square error.
    pub rmse: Option<Estimate>,
    /// (mean - reference's mean) / reference's mean.
    pub mean_rel_bias: Option<Estimate>,
    /// FLIP; for whole eyes only.
    pub flip: Option<Estimate>,
    /// Squared bias and variance; for whole eyes only.
    pub bias_variance: Option<BiasVariance>,
    /// Relative MSE over that of the group's first variant on the same pixels of the same frames.
    pub rel_mse_ratio: Option<Spread>,
    /// The reference's own variance over these pixels, in units of relative MSE; its root over the root of `rel_mse` is to
    /// be under a tenth.
    pub reference_variance: Option<f64>,
    /// Whether it is.
    pub reference_settled: bool,
}

impl RegionErrors {
    /// Whether the reference was good enough. An error of exactly 0 (a part that shows nothing but what is exact) needs no
    /// better one.
    #[must_use]
    pub fn is_settled(&self) -> bool {
        self.reference_settled || self.rel_mse.is_none_or(|error| error.value == 0.0)
    }

    /// Squared bias.
    #[must_use]
    pub fn bias_squared(&self) -> Option<Estimate> {
        self.bias_variance.map(|found| Estimate {
            value: found.bias_squared,
            standard_error: found.bias_squared_se,
        })
    }

    /// Variance of a frame.
    #[must_use]
    pub fn variance(&self) -> Option<Estimate> {
        self.bias_variance.map(|found| Estimate {
            value: found.variance,
            standard_error: found.variance_se,
        })
    }
}

/// Stereo reuse of a row, medians over the rounds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StereoFigures {
    /// Reused over all right-eye pixels that see a surface.
    pub reuse_fraction: Spread,
    /// Pixels reused.
    pub reused: f64,
    /// Pixels filled.
    pub filled: f64,
    /// Why, by reason.
    pub because: BTreeMap<String, f64>,
    /// Binocular relative MSE: the disagreement of both eyes' errors where both see the same point.
    pub binocular_rel_mse: Option<Estimate>,
    /// The same over that of the group's first variant, round by round.
    pub binocular_ratio: Option<Spread>,
    /// Pairs of pixels that it is a mean over.
    pub binocular_pairs: f64,
}

/// What the device was asked to hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Load {
    /// Triangles over all instances.
    pub triangles: u64,
    /// Placed meshes.
    pub instances: u64,
    /// Lights, every emissive triangle counted.
    pub lights: u64,
    /// Bytes uploaded when the head moves.
    pub upload_bytes: u64,
    /// Photon paths per frame, both maps.
    pub photon_paths: u64,
    /// Photons stored.
    pub photons_stored: u64,
    /// Photons dropped because the buffer was full; their paths do not count.
    pub photons_dropped: u64,
    /// Gather radius, metres.
    pub radius_m: Option<f64>,
}

/// A measured row.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Fingerprint of everything below that was decided before measuring, and of the code.
    pub key: String,
    /// Suite that defines the row.
    pub suite: String,
    /// Rows of one group were measured in turn, within one run.
    pub group: String,
    /// Name within the group; the group's first variant is what ratios refer to.
    pub variant: String,
    /// File, builtin or generated scene.
    pub scene: String,
    /// Headset profile and its changes.
    pub headset: String,
    /// Pixels per eye.
    pub size: [u32; 2],
    /// `both` or `left`.
    pub eyes: String,
    /// What the suite varies: numbers and words by name.
    pub factors: BTreeMap<String, Value>,
    /// All settings that differ from the defaults.
    pub settings: BTreeMap<String, Value>,
    /// Milliseconds.
    pub timing: Timing,
    /// By part of the picture: `left`, `right`, `right_reused`, `right_filled`.
    pub errors: BTreeMap<String, RegionErrors>,
    /// Variance between frames of a still view over the mean's square, without any reference: noise, not bias.
    pub frame_noise: Option<Estimate>,
    /// Reuse, in rows of both eyes.
    pub stereo: Option<StereoFigures>,
    /// Scene and photons.
    pub load: Load,
    /// Adapter and driver.
    pub machine: Machine,
    /// Crate version.
    pub version: String,
    /// Fingerprint of the measuring and rendering code.
    pub code: String,
}

/// The numbers and words of `value` as JSON, by their dotted paths in it.
#[must_use]
pub fn leaves(value: &impl Serialize) -> BTreeMap<String, Value> {
    fn gather(path: String, value: Value, into: &mut BTreeMap<String, Value>) {
        let under = |key: String| match path.as_str() {
            "" => key,
            _ => format!("{path}.{key}"),
        };
        match value {
            Value::Object(fields) => {
                for (key, field) in fields {
                    gather(under(key), field, into);
                }
            }
            other => {
                into.insert(path, other);
            }
        }
    }
    let mut into = BTreeMap::new();
    let tree = serde_json::to_value(value).unwrap_or_default();
    gather(String::new(), tree, &mut into);
    into
}

#[cfg(test)]
impl Row {
    /// A row without any figure, for tests.
    pub fn imagined(key: &str) -> Self {
        Self {
            key: key.to_owned(),
            suite: "test".to_owned(),
            ..Self::default()
        }
    }
}

impl Row {
    /// A factor that is a number.
    #[must_use]
    pub fn number(&self, factor: &str) -> Option<f64> {
        self.factors.get(factor).and_then(Value::as_f64)
    }

    /// A factor as text; empty if the row has none of that name.
    #[must_use]
    pub fn text(&self, factor: &str) -> String {
        match self.factors.get(factor) {
            Some(Value::String(text)) => text.clone(),
            Some(other) => other.to_string(),
            None => String::new(),
        }
    }

    /// Median milliseconds of a group of passes.
    #[must_use]
    pub fn ms(&self, group: &str) -> Option<f64> {
        self.timing.ms.get(group).map(|spread| spread.median)
    }

    /// Relative MSE of a part of the picture.
    #[must_use]
    pub fn rel_mse(&self, region: &str) -> Option<f64> {
        Some(self.errors.get(region)?.rel_mse?.value)
    }
}
