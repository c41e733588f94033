//! The settings tree: every value that a config file, `--set` or a flag can change.
//!
//! Ranges, units and one-line docs that a person sees live in [`super::registry`]; a test holds the two together.

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

use super::reconstruct::ReconstructSettings;
use crate::limits::LoadLimits;

/// Light transport method (`method`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Photon mapping: photons traced from the lights, gathered at the eye's hits
    #[default]
    Photon,
    /// Path tracing: the reference that errors are measured against
    Path,
}

/// How the right eye reuses the left eye's work (`reuse`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reuse {
    /// Render each eye by itself
    Off,
    /// Scatter the left eye's hits into the right eye, trace only what stays empty
    #[default]
    Scatter,
    /// Trace the right eye's primary rays and take light from left samples that agree in place and normal
    Lookup,
}

/// Random numbers of the path tracer (`path.sampler`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sampler {
    /// Independent uniform numbers
    Random,
    /// Owen-scrambled Sobol points
    #[default]
    Sobol,
}

/// How the path tracer finds lights (`path.technique`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Technique {
    /// By light samples and by the surfaces' directions, weighted by the balance heuristic
    #[default]
    Mis,
    /// By light samples alone
    Light,
    /// By the surfaces' directions alone, which find no point, spot or directional light
    Bsdf,
}

/// Where photon mapping takes direct light from (`photon.direct`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DirectLight {
    /// Next-event estimation; the map holds only photons that scattered at least once
    #[default]
    Nee,
    /// The photon map, as in the 2020 report
    Map,
}

/// Weight of a photon by its distance from the gather point (`photon.kernel`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kernel {
    /// The same weight over the whole disc
    #[default]
    Constant,
    /// 2 (1 - d^2/r^2) / (pi r^2)
    Epanechnikov,
    /// Falls linearly to the rim: 3 (1 - d/r) / (pi r^2)
    Cone,
}

/// How photons around a point are found (`photon.search`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Search {
    /// A hash grid whose cells are as wide as the radius
    #[default]
    Grid,
    /// A left-balanced kd-tree
    KdTree,
}

/// Which photons make an estimate (`photon.estimate`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PhotonEstimate {
    /// All within the radius
    #[default]
    Radius,
    /// The nearest ones within the radius, `photon.nearest` of them at most
    Nearest,
}

/// Kernels of one sample of an eye (`photon.schedule`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Schedule {
    /// One that traces, one that gathers
    #[default]
    Split,
    /// One that traces and gathers
    Fused,
}

/// How a gather loads photons (`photon.loads`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Loads {
    /// Every thread its own
    #[default]
    Direct,
    /// A workgroup together, through its shared memory
    Cooperative,
}

/// Motion of the simulated headset (`simulated.motion`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Motion {
    /// The head does not move
    Still,
    /// The head turns left and right
    Yaw,
    /// The head moves along a walk
    Walk,
    /// Small band-limited movements of a standing person
    #[default]
    Sway,
}

/// A shader feature that is compiled in when needed, always or never (`force.*`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Force {
    /// In when the scene needs it
    #[default]
    Auto,
    /// Always in
    On,
    /// Always out, even where that changes the image
    Off,
}

impl Force {
    /// Whether the feature is in, given what the scene needs.
    #[must_use]
    pub fn apply(self, needed: bool) -> bool {
        match self {
            Self::Auto => needed,
            Self::On => true,
            Self::Off => false,
        }
    }
}

/// Every setting, validated against [`super::registry`] before it is built.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// glTF file or `builtin:NAME`; default `builtin:cornell`.
    pub scene: String,
    /// Light transport; default photon mapping.
    pub method: Method,
    /// Right eye's reuse of the left; default scatter.
    pub reuse: Reuse,
    /// Primary samples per pixel and frame, 1 to 1048576; default 1.
    pub spp: u32,
    /// Random seed; default 0.
    pub seed: u32,
    /// Pixels per eye, width and height, 1 to 16384 each; `None` takes the headset's.
    pub size: Option<[u32; 2]>,
    /// Headset profile's name; default `symmetric`.
    pub headset: String,
    /// Substring of the adapter's name; empty takes the best one.
    pub adapter: String,
    /// Path tracer.
    pub path: PathSettings,
    /// Photon mapping.
    pub photon: PhotonSettings,
    /// Stereo reuse.
    pub stereo: StereoSettings,
    /// Filtering over time, neighbours and eyes.
    pub reconstruct: ReconstructSettings,
    /// Environment map.
    pub environment: EnvironmentSettings,
    /// What moves by itself.
    pub animation: AnimationSettings,
    /// Files written.
    pub output: OutputSettings,
    /// Shader features forced in or out, for measuring.
    pub force: ForceSettings,
    /// Simulated headset.
    pub simulated: SimulatedSettings,
    /// OpenXR sessions.
    pub openxr: OpenXrSettings,
    /// GPU use.
    pub gpu: GpuSettings,
    /// What reading files may cost and reach.
    pub limits: LimitsSettings,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            scene: "builtin:cornell".to_owned(),
            method: Method::default(),
            reuse: Reuse::default(),
            spp: 1,
            seed: 0,
            size: None,
            headset: "symmetric".to_owned(),
            adapter: String::new(),
            path: PathSettings::default(),
            photon: PhotonSettings::default(),
            stereo: StereoSettings::default(),
            reconstruct: ReconstructSettings::default(),
            environment: EnvironmentSettings::default(),
            animation: AnimationSettings::default(),
            output: OutputSettings::default(),
            force: ForceSettings::default(),
            simulated: SimulatedSettings::default(),
            openxr: OpenXrSettings::default(),
            gpu: GpuSettings::default(),
            limits: LimitsSettings::default(),
        }
    }
}

/// Settings of the path tracer (`path.*`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PathSettings {
    /// Segments of the whole path from eye to light, 1 to 64: 1 is emission seen directly, 2 is direct light; default 12.
    pub max_depth: u32,
    /// End dim paths by chance, without bias; default true.
    pub russian_roulette: bool,
    /// Random numbers; default Sobol points.
    pub sampler: Sampler,
    /// How lights are found; default both ways.
    pub technique: Technique,
    /// Samples of lights that the one of a shadow ray is chosen from, in both methods, 1 to 16; default 4.
    pub light_candidates: u32,
}

impl Default for PathSettings {
    fn default() -> Self {
        Self {
            max_depth: 12,
            russian_roulette: true,
            sampler: Sampler::default(),
            technique: Technique::default(),
            light_candidates: 4,
        }
    }
}

/// Settings of photon mapping (`photon.*`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PhotonSettings {
    /// Photons emitted per frame, 0 to 67108864; default 262144.
    pub count: u32,
    /// Gather radius in metres; 0 takes it from the scene's area and the photon count; default 0.
    pub radius_m: f64,
    /// Photons emitted for the map of caustics, 0 to 67108864, in scenes that can form them; 0 takes `count`; default 0.
    pub caustic_count: u32,
    /// Gather radius of caustics in metres; 0 takes half of `radius_m`; default 0.
    pub caustic_radius_m: f64,
    /// Segments of the whole path from eye to light, 1 to 64; default 12.
    pub max_depth: u32,
    /// Source of direct light; default next-event estimation.
    pub direct: DirectLight,
    /// Density kernel; default constant.
    pub kernel: Kernel,
    /// Photons that the buffer holds, 0 to 268435456; 0 takes it from the photon count; default 0.
    pub capacity: u32,
    /// Upper bound on hash-grid cells, 64 to 4194300; default 524288.
    pub grid_cells_max: u32,
    /// Trace photons anew for every frame, even where scene and lights are static; default false.
    pub every_frame: bool,
    /// Shares in which the photons are traced anew once something moves, one per frame, 1 to 64; default 1: all at once.
    pub shares: u32,
    /// Shrink the radius from sample to sample; default false.
    pub progressive: bool,
    /// Share of new photons kept per progressive step (alpha of Hachisuka and Jensen 2009), in (0, 1); default 0.7.
    pub progressive_alpha: f64,
    /// Smallest cosine between a photon's surface normal and the gather point's, -1 to 1; default 0.5.
    pub normal_min_cos: f64,
    /// How photons are found, caustics aside; default the grid.
    pub search: Search,
    /// Which photons make an estimate, caustics aside; default all within the radius.
    pub estimate: PhotonEstimate,
    /// Photons of [`PhotonEstimate::Nearest`], 1 to 64; default 50.
    pub nearest: u32,
    /// Kernels of a sample; default split.
    pub schedule: Schedule,
    /// How a gather loads photons, caustics aside; default each thread by itself.
    pub loads: Loads,
    /// Gather at every other pixel in each direction, caustics aside, and interpolate between them; default off.
    pub half_rate: bool,
}

impl PhotonSettings {
    /// Whether these ways to gather go together; if not, in one line, why and what to do.
    ///
    /// # Errors
    /// The line.
    pub fn check_gather(&self) -> Result<(), String> {
        if self.half_rate && self.schedule == Schedule::Fused {
            return Err(
                "photon.half_rate goes with photon.schedule = \"split\" only; change one of them"
                    .to_owned(),
            );
        }
        let plain = self.search == Search::Grid && self.estimate == PhotonEstimate::Radius;
        let fused = self.schedule == Schedule::Fused;
        let cooperative = self.loads == Loads::Cooperative;
        let (set, needs) = match (fused, cooperative) {
            (true, true) => ("photon.schedule = \"fused\"", "photon.loads = \"direct\""),
            (true, false) if !plain => (
                "photon.schedule = \"fused\"",
                "photon.search = \"grid\" and photon.estimate = \"radius\"",
            ),
            (false, true) if !plain => (
                "photon.loads = \"cooperative\"",
                "photon.search = \"grid\" and photon.estimate = \"radius\"",
            ),
            _ => return Ok(()),
        };
        Err(format!("{set} goes with {needs} only; change one of them"))
    }
}

impl Default for PhotonSettings {
    fn default() -> Self {
        Self {
            count: 262_144,
            radius_m: 0.0,
            caustic_count: 0,
            caustic_radius_m: 0.0,
            max_depth: 12,
            direct: DirectLight::default(),
            kernel: Kernel::default(),
            capacity: 0,
            grid_cells_max: 524_288,
            every_frame: false,
            shares: 1,
            progressive: false,
            progressive_alpha: 0.7,
            normal_min_cos: 0.5,
            search: Search::default(),
            estimate: PhotonEstimate::default(),
            nearest: 50,
            schedule: Schedule::default(),
            loads: Loads::default(),
            half_rate: false,
        }
    }
}

/// Settings of stereo reuse (`stereo.*`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StereoSettings {
    /// View-dependence limit of what may be carried over, 0 to 1; at 0 only what does not depend on the viewing
    /// direction; default 0.
    pub max_view_dependence: f64,
    /// Of surfaces beyond that limit, `--reuse lookup` takes the indirect light over where their lobe moves by at most
    /// this share of its width between the eyes, 0 or more; 0 never; default 0.25.
    pub max_lobe_shift: f64,
}

impl Default for StereoSettings {
    fn default() -> Self {
        Self {
            max_view_dependence: 0.0,
            max_lobe_shift: 0.25,
        }
    }
}

/// Settings of the scene's animation (`animation.*`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AnimationSettings {
    /// Clip by name, or by number from 0; `none` plays nothing, empty (default) the first one there is.
    pub clip: String,
    /// Seconds of the clip per second of display time, -1000 to 1000; default 1.
    pub speed: f64,
    /// Second of the clip that the first frame shows, 0 to 1e6; default 0.
    pub time_s: f64,
}

impl Default for AnimationSettings {
    fn default() -> Self {
        Self {
            clip: String::new(),
            speed: 1.0,
            time_s: 0.0,
        }
    }
}

/// Settings of the environment map (`environment.*`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EnvironmentSettings {
    /// Equirectangular `.hdr` or `.exr`; empty for a black surround.
    pub path: String,
    /// Factor on its radiance, 0 or more; default 1.
    pub strength: f64,
}

impl Default for EnvironmentSettings {
    fn default() -> Self {
        Self {
            path: String::new(),
            strength: 1.0,
        }
    }
}

/// Settings of the files written (`output.*`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OutputSettings {
    /// Exposure factor of the tone-mapped PNG; EXR files are never scaled; default 1.
    pub exposure: f64,
    /// Write images; default true.
    pub images: bool,
    /// Split radiance into direct and indirect light, and write those and the albedo; default false.
    pub parts: bool,
    /// Keep where things were in the frame before, for views of motion; images stay as they are; default false.
    pub motion: bool,
}

impl Default for OutputSettings {
    fn default() -> Self {
        Self {
            exposure: 1.0,
            images: true,
            parts: false,
            motion: false,
        }
    }
}

/// Shader features forced in or out (`force.*`); all default to [`Force::Auto`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ForceSettings {
    /// Glossy and metallic lobes.
    pub glossy: Force,
    /// Dielectrics.
    pub dielectric: Force,
    /// Textures.
    pub textures: Force,
    /// Normal maps.
    pub normal_maps: Force,
    /// Alpha mask and blend.
    pub alpha: Force,
    /// Vertex colours.
    pub vertex_colors: Force,
    /// The environment map.
    pub environment: Force,
    /// The map of caustics.
    pub caustics: Force,
    /// Copies of the scene's records in textures; by itself on software adapters.
    pub record_texels: Force,
}

impl ForceSettings {
    /// Shader feature names with their setting, in the registry's order.
    #[must_use]
    pub fn by_feature(&self) -> [(&'static str, Force); 9] {
        [
            ("glossy", self.glossy),
            ("dielectric", self.dielectric),
            ("textures", self.textures),
            ("normal_maps", self.normal_maps),
            ("alpha", self.alpha),
            ("vertex_colors", self.vertex_colors),
            ("environment", self.environment),
            ("caustics", self.caustics),
            ("record_texels", self.record_texels),
        ]
    }
}

/// Settings of the simulated headset (`simulated.*`).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SimulatedSettings {
    /// Its motion; default sway.
    pub motion: Motion,
}

/// The runtime's space that the scene stands in (`openxr.space`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Space {
    /// Origin where the wearer's head was when the runtime recentred last
    #[default]
    Local,
    /// Origin on the floor in the middle of the play area
    Stage,
}

/// Colour format of the images for the runtime (`openxr.format`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ImageFormat {
    /// The first of the two that the runtime names
    #[default]
    Auto,
    /// 8 bits, sRGB
    Srgb,
    /// Half floats, linear
    Half,
}

/// Settings of OpenXR sessions (`openxr.*`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OpenXrSettings {
    /// Space; default local.
    pub space: Space,
    /// Colour format; default auto.
    pub format: ImageFormat,
    /// Submit depth where the runtime takes it; default true.
    pub depth_layer: bool,
    /// Spend no rays on pixels that the lens hides; default true.
    pub visibility_mask: bool,
    /// Refresh rate to ask for, hertz, 0 to 1000; 0 leaves it to the runtime; default 0.
    pub refresh_hz: f64,
    /// Walking speed at full deflection of the stick, m/s, 0 to 100; default 1.5.
    pub move_m_per_s: f64,
    /// One snap turn, degrees, 0 to 180; default 30.
    pub snap_turn_deg: f64,
}

impl Default for OpenXrSettings {
    fn default() -> Self {
        Self {
            space: Space::default(),
            format: ImageFormat::default(),
            depth_layer: true,
            visibility_mask: true,
            refresh_hz: 0.0,
            move_m_per_s: 1.5,
            snap_turn_deg: 30.0,
        }
    }
}

/// Settings of GPU use (`gpu.*`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GpuSettings {
    /// Time each pass with timestamp queries; default true.
    pub timestamps: bool,
    /// Folder whose `.wesl` files replace the embedded shaders of the same name; empty (default): none.
    pub shader_folder: String,
}

impl Default for GpuSettings {
    fn default() -> Self {
        Self {
            timestamps: true,
            shader_folder: String::new(),
        }
    }
}

/// Settings of what reading files may cost and reach (`limits.*`).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LimitsSettings {
    /// Memory that loading a scene with its environment may take, GiB, 0 to 1e6; 0 takes 4, or half of the machine's
    /// memory if that is less; default 0.
    pub load_memory: f64,
    /// Whether a scene may name files outside its own folder; default false.
    pub allow_outside: bool,
}

impl LimitsSettings {
    /// As a load takes them.
    #[must_use]
    pub fn load(&self) -> LoadLimits {
        let otherwise = LoadLimits::default();
        LoadLimits {
            memory_bytes: match self.load_memory {
                0.0 => otherwise.memory_bytes,
                // Saturates.
                gib => (gib * f64::from(1 << 30)) as u64,
            },
            allow_outside: self.allow_outside,
        }
    }
}
