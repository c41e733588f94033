//! `run.json` and the line that ends a run.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Serialize;

use crate::frame_loop::Outcome;
use crate::gpu::context::AdapterSummary;
use crate::gpu::features::{DecidedBy, ShaderFeatures};
use crate::renderer::Renderer;
use crate::scene::{Needs, Scene};
use crate::settings::{Method, Settings};
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
    /// Device milliseconds of the photon map in the frames that traced it.
    pub photons_ms: f64,
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
    /// Frames rendered.
    pub frames: usize,
    /// Medians over the frames.
    pub medians: Medians,
}

/// Median; 0 of nothing.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    crate::metrics::median(&values.collect::<Vec<_>>()).unwrap_or_default()
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
        needs: &'a Needs,
        session: &str,
        info: &SessionInfo,
        size: [u32; 2],
        outcome: &Outcome,
    ) -> Self {
        let stats = &outcome.last;
        let mut by_pass: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
        for frame in stats {
            for (name, ms) in &frame.pass_ms {
                by_pass.entry(name).or_default().push(*ms);
            }
        }
        let context = renderer.context();
        Self {
            version: env!("CARGO_PKG_VERSION"),
            software_adapter: context.adapter.is_software(),
            adapter: context.adapter.clone(),
            timestamps: context.has_timestamps && settings.render.gpu.timestamps,
            session: session.to_owned(),
            headset: info.headset.clone(),
            refresh_hz: info.refresh_hz,
            size,
            radius_m: (settings.render.method == Method::Photon).then(|| renderer.radius_m()),
            caustic_radius_m: renderer.caustic_map().map(|_| renderer.caustic_radius_m()),
            settings,
            scene: SceneSummary {
                name: settings.scene.clone(),
                triangles: needs.stored_triangles,
                instances: needs.instances,
                lights: renderer.scene().light_count(),
                emitted_power_w: renderer.scene().total_power_w(),
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
            frames: outcome.frames,
            medians: Medians {
                pass_ms: by_pass
                    .into_iter()
                    .map(|(name, values)| (name.to_owned(), median(values.into_iter())))
                    .collect(),
                left_ms: median(stats.iter().map(|frame| frame.gpu_ms.left)),
                right_ms: median(stats.iter().map(|frame| frame.gpu_ms.right)),
                photons_ms: median(
                    stats
                        .iter()
                        .filter(|frame| frame.photons.traced)
                        .map(|frame| frame.gpu_ms.photons),
                ),
                frame_ms: median(stats.iter().map(|frame| frame.cpu_ms.frame)),
                reuse_fraction: median(stats.iter().map(|frame| frame.stereo.reuse_fraction)),
            },
        }
    }

    /// The line that ends a run.
    pub fn summary_line(&self, out: &Path) -> String {
        let m = &self.medians;
        let photons = if self.radius_m.is_some() {
            format!(", photons {:.1} ms when traced", m.photons_ms)
        } else {
            String::new()
        };
        format!(
            "{} frame{} of {}x{} per eye on {} ({}): left {:.1} ms, right {:.1} ms{photons} (device medians), reuse fraction {:.3}; pictures in {}",
            self.frames,
            if self.frames == 1 { "" } else { "s" },
            self.size[0],
            self.size[1],
            self.adapter.name,
            self.adapter.kind,
            m.left_ms,
            m.right_ms,
            m.reuse_fraction,
            out.display(),
        )
    }
}
