//! `run.json` and the line that ends a run.

use std::collections::BTreeMap;
use std::path::Path;

use serde::ser::Error as _;
use serde::{Serialize, Serializer};
use serde_json::{Value, json};

use crate::frame_loop::Outcome;
use crate::gpu::features::{DecidedBy, ShaderFeatures};
use crate::renderer::Renderer;
use crate::scene::{Needs, Scene};
use crate::settings::{Method, Reuse, Settings};
use crate::xr::SessionInfo;

/// Medians over the frames, over the last 1,000 of a longer run.
#[derive(Debug, Serialize)]
pub struct Medians {
    /// Device milliseconds by pass, over the frames that ran it.
    pub pass_ms: BTreeMap<String, f64>,
    /// Device milliseconds of the left eye.
    pub left_ms: f64,
    /// Device milliseconds of the right eye.
    pub right_ms: f64,
    /// Device milliseconds of the photon map in the frames that traced it, if any did.
    pub photons_ms: Option<f64>,
    /// Device milliseconds of a frame, both eyes and all passes.
    pub total_ms: f64,
    /// Host milliseconds of a frame.
    pub frame_ms: f64,
    /// Reuse fraction.
    pub reuse_fraction: f64,
}

/// A run after its last frame.
pub struct EndedRun<'a> {
    pub settings: &'a Settings,
    pub renderer: &'a Renderer,
    pub scene: &'a Scene,
    /// Embedded environment that lights the scene, and why.
    pub light: Option<String>,
    /// Where the views came from.
    pub session: &'a str,
    pub info: &'a SessionInfo,
    /// Pixels per eye.
    pub size: [u32; 2],
    pub outcome: &'a Outcome,
    /// Why the run ended before its end.
    pub error: Option<&'a str>,
}

/// Median; 0 of nothing.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    crate::metrics::median(&values.collect::<Vec<_>>()).unwrap_or_default()
}

impl Medians {
    /// Of frames as `stats.jsonl` holds them.
    pub fn of(frames: &[Value]) -> Self {
        let all = |of: &dyn Fn(&Value) -> Option<f64>| median(frames.iter().filter_map(of));
        let device = |part: &str| all(&|frame| frame["gpu_ms"][part].as_f64());
        let traced: Vec<f64> = frames
            .iter()
            .filter(|frame| frame["photons"]["traced"] == true)
            .filter_map(|frame| frame["gpu_ms"]["photons"].as_f64())
            .collect();
        let mut by_pass: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
        let passes = frames
            .iter()
            .filter_map(|frame| frame["pass_ms"].as_object());
        for (name, ms) in passes.flatten() {
            by_pass.entry(name).or_default().extend(ms.as_f64());
        }
        let by_pass = by_pass.into_iter();
        Self {
            pass_ms: by_pass
                .map(|(name, values)| (name.to_owned(), median(values.into_iter())))
                .collect(),
            left_ms: device("left"),
            right_ms: device("right"),
            photons_ms: crate::metrics::median(&traced),
            total_ms: device("total"),
            frame_ms: all(&|frame| frame["cpu_ms"]["frame"].as_f64()),
            reuse_fraction: all(&|frame| frame["stereo"]["reuse_fraction"].as_f64()),
        }
    }
}

/// As `run.json`.
impl Serialize for EndedRun<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let (settings, renderer, scene) = (self.settings, self.renderer, self.scene);
        let adapter = &renderer.context().adapter;
        let needs = Needs::of(scene);
        let bounds = scene.bounds_in_world();
        let caustics = renderer.caustic_map();
        // A path may be other than UTF-8.
        let resolved = serde_json::to_value(settings).map_err(S::Error::custom)?;
        let report = json!({
            "version": env!("CARGO_PKG_VERSION"),
            "adapter": adapter,
            // Timings of one say nothing about a GPU.
            "software_adapter": adapter.is_software(),
            "timestamps": self.is_timed(),
            "session": self.session,
            "headset": self.info.headset,
            "refresh_hz": self.info.refresh_hz,
            "size": self.size,
            "radius_m": self.uses_photons().then(|| renderer.radius_m()),
            "caustic_radius_m": caustics.map(|_| renderer.caustic_radius_m()),
            "error": self.error,
            // The EXR files have it as `stereolux.settings`.
            "settings_hash": format!("{:016x}", settings.picture_hash()),
            "wall_s": self.outcome.wall_s,
            "frames_per_second": self.frames_per_second(),
            "budget_ms": self.budget_ms(),
            "settings": resolved,
            "scene": {
                "name": settings.scene,
                // Of all meshes, each counted once.
                "triangles": needs.stored_triangles,
                "instances": needs.instances,
                // Every emissive triangle counted.
                "lights": renderer.scene().light_count(),
                "emitted_power_w": renderer.scene().total_power_w(),
                "light": self.light,
                "hierarchy_depth": renderer.scene().hierarchies().max_depth,
                "bounds_in_world": bounds.map(|of| [of.min.to_array(), of.max.to_array()]),
                "outside_files": scene.source.outside_files,
                "too_bright_lights": scene.source.too_bright_lights,
            },
            "needs": needs,
            "features": renderer.features().report(ShaderFeatures::decided_up_to(DecidedBy::Renderer)),
            "passes": renderer.pass_names(),
            "frames": self.outcome.frames,
            "medians": self.medians(),
        });
        report.serialize(serializer)
    }
}

impl EndedRun<'_> {
    fn medians(&self) -> Medians {
        let stats = self.outcome.last.iter().map(serde_json::to_value);
        Medians::of(&stats.flatten().collect::<Vec<_>>())
    }

    /// What the headset allows a frame, milliseconds.
    fn budget_ms(&self) -> f64 {
        1e3 / self.info.refresh_hz
    }

    fn frames_per_second(&self) -> f64 {
        match self.outcome.wall_s {
            wall_s if wall_s > 0.0 => self.outcome.frames as f64 / wall_s,
            _ => 0.0,
        }
    }

    /// Whether passes were timed by the device.
    fn is_timed(&self) -> bool {
        self.renderer.context().has_timestamps && self.settings.render.gpu.timestamps.is_on()
    }

    fn uses_photons(&self) -> bool {
        self.settings.render.method == Method::Photon
    }

    /// The line that ends a run.
    pub fn summary_line(&self, out: &Path) -> String {
        let (m, frames) = (self.medians(), self.outcome.frames);
        let adapter = &self.renderer.context().adapter;
        let has_both_eyes = self.renderer.has_both_eyes();
        let photons = match m.photons_ms.filter(|_| self.uses_photons()) {
            Some(ms) => format!(", photons {ms:.1} ms when traced"),
            None => String::new(),
        };
        let (who, eyes) = match has_both_eyes {
            true => (
                "both eyes",
                format!("left {:.1} ms, right {:.1} ms", m.left_ms, m.right_ms),
            ),
            // A lone eye is rendered as the left one.
            false => ("one eye", format!("{:.1} ms", m.left_ms)),
        };
        let times = match self.is_timed() {
            true => format!(
                "{who} {:.1} ms of the {:.1} ms that {:.0} Hz allow ({eyes}{photons}; device medians)",
                m.total_ms,
                self.budget_ms(),
                self.info.refresh_hz
            ),
            false => "not timed by the device".to_owned(),
        };
        let reused = match has_both_eyes && self.settings.render.reuse != Reuse::Off {
            true => format!(
                ", {:.0} % of the right eye reused",
                100.0 * m.reuse_fraction
            ),
            false => String::new(),
        };
        let what = if self.settings.output.images.is_on() && frames > 0 {
            "pictures"
        } else {
            "statistics"
        };
        format!(
            "{} frame{} of {}x{} per eye on {} ({}): {times}, {:.1} frames/s of wall time{reused}; {what} in {}",
            frames,
            if frames == 1 { "" } else { "s" },
            self.size[0],
            self.size[1],
            adapter.name,
            adapter.kind,
            self.frames_per_second(),
            out.display(),
        )
    }
}
