//! `run.json` and the line that ends a run.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Serialize;
use serde_json::Value;

use crate::frame_loop::Outcome;
use crate::gpu::context::AdapterSummary;
use crate::gpu::features::{DecidedBy, ShaderFeatures};
use crate::renderer::Renderer;
use crate::scene::{Needs, Scene};
use crate::settings::{Method, Reuse, Settings};
use crate::xr::SessionInfo;

/// What a scene holds, for `run.json`.
#[derive(Debug, Serialize)]
pub struct SceneSummary {
    /// File or builtin name.
    pub name: String,
    /// Triangles of all meshes, each counted once.
    pub triangles: usize,
    /// Placed meshes.
    pub instances: usize,
    /// Lights, every emissive triangle counted.
    pub lights: usize,
    /// Total emitted power, W per channel.
    pub emitted_power_w: [f64; 3],
    /// Embedded environment that lights it, and why; `null` without one.
    pub light: Option<String>,
    /// Deepest mesh hierarchy, inner nodes.
    pub hierarchy_depth: u32,
    /// Lower and upper corner, world, metres.
    pub bounds_in_world: Option<[[f64; 3]; 2]>,
    /// Files outside the scene's folder that were read (`--allow-outside`), the first hundred.
    pub outside_files: Vec<String>,
    /// Lights, or glowing meshes, of more power than can be rendered.
    pub too_bright_lights: usize,
}

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

/// `run.json`.
#[derive(Debug, Serialize)]
pub struct RunReport<'a> {
    /// Crate version.
    pub version: &'static str,
    /// Adapter and driver.
    pub adapter: AdapterSummary,
    /// Timings of a software adapter say nothing about a GPU.
    pub software_adapter: bool,
    /// Whether passes were timed by the device.
    pub timestamps: bool,
    /// Where the views came from.
    pub session: String,
    /// Headset name.
    pub headset: String,
    /// Refresh rate, Hz.
    pub refresh_hz: f64,
    /// Pixels per eye.
    pub size: [u32; 2],
    /// Gather radius in use, metres; with the photon method.
    pub radius_m: Option<f64>,
    /// Gather radius of the caustic map, metres, if there is one.
    pub caustic_radius_m: Option<f64>,
    /// Why the run ended before its end; `null` if it did not.
    pub error: Option<String>,
    /// Hash of the settings that pixels depend on, hexadecimal; the EXR files have it as `stereolux.settings`.
    pub settings_hash: String,
    /// Wall time of all frames, seconds.
    pub wall_s: f64,
    /// Frames per second of wall time.
    pub frames_per_second: f64,
    /// What the headset allows a frame, milliseconds.
    pub budget_ms: f64,
    /// The resolved settings.
    pub settings: &'a Settings,
    /// The scene.
    pub scene: SceneSummary,
    /// What the scene needs, and what is left out.
    pub needs: &'a Needs,
    /// Shader features that were compiled in.
    pub features: BTreeMap<&'static str, bool>,
    /// Passes that were compiled.
    pub passes: Vec<String>,
    /// Whether both eyes are rendered.
    #[serde(skip)]
    pub has_both_eyes: bool,
    /// Frames rendered.
    pub frames: usize,
    /// Medians over the frames.
    pub medians: Medians,
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

impl<'a> RunReport<'a> {
    /// Collects everything after the last frame.
    #[expect(
        clippy::too_many_arguments,
        reason = "one call site; a struct of the same fields would only be moved"
    )]
    pub fn new(
        settings: &'a Settings,
        renderer: &Renderer,
        scene: &Scene,
        light: Option<String>,
        needs: &'a Needs,
        session: &str,
        info: &SessionInfo,
        size: [u32; 2],
        outcome: &Outcome,
        error: Option<String>,
    ) -> Self {
        let stats = outcome.last.iter().map(serde_json::to_value);
        let stats: Vec<Value> = stats.flatten().collect();
        let context = renderer.context();
        Self {
            version: env!("CARGO_PKG_VERSION"),
            software_adapter: context.adapter.is_software(),
            adapter: context.adapter.clone(),
            timestamps: context.has_timestamps && settings.render.gpu.timestamps.is_on(),
            session: session.to_owned(),
            headset: info.headset.clone(),
            refresh_hz: info.refresh_hz,
            size,
            radius_m: (settings.render.method == Method::Photon).then(|| renderer.radius_m()),
            caustic_radius_m: renderer.caustic_map().map(|_| renderer.caustic_radius_m()),
            error,
            settings_hash: format!("{:016x}", settings.picture_hash()),
            wall_s: outcome.wall_s,
            frames_per_second: match outcome.wall_s {
                wall_s if wall_s > 0.0 => outcome.frames as f64 / wall_s,
                _ => 0.0,
            },
            budget_ms: 1e3 / info.refresh_hz,
            settings,
            scene: SceneSummary {
                name: settings.scene.clone(),
                triangles: needs.stored_triangles,
                instances: needs.instances,
                lights: renderer.scene().light_count(),
                emitted_power_w: renderer.scene().total_power_w(),
                light,
                hierarchy_depth: renderer.scene().hierarchies().max_depth,
                bounds_in_world: scene
                    .bounds_in_world()
                    .map(|bounds| [bounds.min.to_array(), bounds.max.to_array()]),
                outside_files: scene.source.outside_files.clone(),
                too_bright_lights: scene.source.too_bright_lights,
            },
            needs,
            features: renderer
                .features()
                .report(ShaderFeatures::decided_up_to(DecidedBy::Renderer)),
            passes: renderer.pass_names(),
            has_both_eyes: renderer.has_both_eyes(),
            frames: outcome.frames,
            medians: Medians::of(&stats),
        }
    }

    /// The line that ends a run.
    pub fn summary_line(&self, out: &Path) -> String {
        let m = &self.medians;
        let photons = match (self.radius_m, m.photons_ms) {
            (Some(_), Some(ms)) => format!(", photons {ms:.1} ms when traced"),
            _ => String::new(),
        };
        let (who, eyes) = match self.has_both_eyes {
            true => (
                "both eyes",
                format!("left {:.1} ms, right {:.1} ms", m.left_ms, m.right_ms),
            ),
            // A lone eye is rendered as the left one.
            false => ("one eye", format!("{:.1} ms", m.left_ms)),
        };
        let times = match self.timestamps {
            true => format!(
                "{who} {:.1} ms of the {:.1} ms that {:.0} Hz allow ({eyes}{photons}; device medians)",
                m.total_ms, self.budget_ms, self.refresh_hz
            ),
            false => "not timed by the device".to_owned(),
        };
        let reused = match self.has_both_eyes && self.settings.render.reuse != Reuse::Off {
            true => format!(
                ", {:.0} % of the right eye reused",
                100.0 * m.reuse_fraction
            ),
            false => String::new(),
        };
        let what = if self.settings.output.images.is_on() && self.frames > 0 {
            "pictures"
        } else {
            "statistics"
        };
        format!(
            "{} frame{} of {}x{} per eye on {} ({}): {times}, {:.1} frames/s of wall time{reused}; {what} in {}",
            self.frames,
            if self.frames == 1 { "" } else { "s" },
            self.size[0],
            self.size[1],
            self.adapter.name,
            self.adapter.kind,
            self.frames_per_second,
            out.display(),
        )
    }
}
