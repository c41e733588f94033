//! The table of settings: type, default, range, unit and sentence of each. The structs, their documentation and
//! defaults, and the [registry](super::registry) that flags, files, listings and panels read come from it.

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::choices::{
    Aov, AtrousPasses, Choice as _, DirectLight, ExrLayout, ExrPrecision, Force, FramesInFlight,
    ImageFormat, Kept, Kernel, Light, Loads, Method, Mips, Motion, PhotonEstimate, Reuse, Sampler,
    Schedule, Search, Space, Switch, Technique, Timestamps, Tone, Turn, WriteImages,
};
use super::kinds::{Kind, MAX_SIZE, OwnKind, Row, RowSection, listed};
use super::user_pass::UserPass;
use stereolux_base::limits::LoadLimits;

const fn whole(min: u64, max: u64) -> Kind {
    Kind::Whole { min, max }
}

/// The bounds are allowed.
const fn real(min: f64, max: f64) -> Kind {
    let inclusive = true;
    Kind::Real {
        min,
        max,
        inclusive,
    }
}

/// The bounds are not allowed.
const fn between(min: f64, max: f64) -> Kind {
    let inclusive = false;
    Kind::Real {
        min,
        max,
        inclusive,
    }
}

const SHARE: Kind = real(0.0, 1.0);
const POSITIVE: Kind = between(0.0, 1e9);
const NOT_NEGATIVE: Kind = real(0.0, 1e9);
const TEXT: Kind = Kind::Text { empty: true };
const NAME: Kind = Kind::Text { empty: false };
const AOVS: Kind = Kind::List { words: Aov::WORDS };

fn to_json(value: &impl Serialize) -> Value {
    serde_json::to_value(value).unwrap_or(Value::Null)
}

fn put<T: DeserializeOwned>(place: &mut T, value: Value) -> bool {
    match serde_json::from_value(value) {
        Ok(value) => {
            *place = value;
            true
        }
        Err(_) => false,
    }
}

/// What a row's type and, where that does not say it, its third column allow.
macro_rules! kind {
    ($type:ty) => {
        <$type as OwnKind>::KIND
    };
    ($type:ty, $kind:expr) => {
        $kind
    };
}

/// Makes a struct per block, `at` its place in [`Settings`], with the keys' prefix; and from each group of rows
/// `field: type = default, kind, unit` a list of [`Row`]s. The sentence is the row's doc comment. `parts`
/// names the structs inside.
macro_rules! settings {
    ($(
        $(#[$about:meta])*
        struct $name:ident at ($($place:ident)*) $prefix:literal {
            $(rows $group:ident {
                $(
                    $(#[doc = $sentence:literal])+
                    $field:ident: $type:ty = $default:expr $(, $kind:expr $(, $unit:literal)?)?;
                )+
            })*
            $(parts { $( $(#[$part_about:meta])+ $part:ident: $Part:ident; )+ })?
        }
    )+) => {$(
        $(#[$about])*
        #[derive(Clone, Debug, PartialEq)]
        pub struct $name {
            $($(
                $(#[doc = $sentence])+
                #[doc = concat!("\n\nDefault `", stringify!($default), "`" $(, "; `", stringify!($kind), "`" $(, ", ", $unit)?)?)]
                pub $field: $type,
            )+)*
            $($( $(#[$part_about])+ pub $part: $Part, )+)?
        }

        impl Default for $name {
            fn default() -> Self {
                Self {
                    $($( $field: $default, )+)*
                    $($( $part: $Part::default(), )+)?
                }
            }
        }

        impl $name {
            fn within(settings: &Settings) -> &Self {
                &(*settings)$(.$place)*
            }

            fn within_mut(settings: &mut Settings) -> &mut Self {
                &mut (*settings)$(.$place)*
            }
        }

        $(const $group: &[Row<Settings>] = &[$(
            Row {
                key: concat!($prefix, stringify!($field)),
                kind: kind!($type $(, $kind)?),
                unit: concat!($($($unit)?)?),
                doc: concat!($($sentence),+).trim_ascii_start(),
                get: |settings| to_json(&$name::within(settings).$field),
                set: |settings, value| put(&mut $name::within_mut(settings).$field, value),
            },
        )+];)*
    )+};
}

/// The user's own passes, as a config file lists them.
type UserPasses = Vec<UserPass>;

/// Headings and order of all listings.
pub(super) const SECTIONS: &[RowSection<Settings>] = &[
    RowSection::new("General", &[SCENE, TRANSPORT, DEVICE]),
    RowSection::new("Path tracing", &[PATH]),
    RowSection::new("Photon mapping", &[PHOTON]),
    RowSection::new("Stereo reuse", &[STEREO]),
    RowSection::new("Textures", &[TEXTURES]),
    RowSection::new("Reconstruction (denoising)", &[RECONSTRUCT]),
    RowSection::new("Environment", &[ENVIRONMENT, SURROUNDINGS]),
    RowSection::new("Animation", &[ANIMATION]),
    RowSection::new("Output", &[EXPOSURE, IMAGES, PARTS]),
    RowSection::new("Compiled features", &[FORCE]),
    RowSection::new("Simulated headset", &[SIMULATED]),
    RowSection::new("Input", &[INPUT]),
    RowSection::new("OpenXR", &[OPENXR]),
    RowSection::new("GPU", &[TIMING, SHADERS]),
    RowSection::new("Limits", &[LIMITS]),
];

settings! {
    /// Every setting, each in the range that the [registry](super::registry) checks. Keys are those of the config file,
    /// wherever the struct holds the value.
    struct Settings at () "" {
        rows SCENE {
            /// glTF file (.gltf, .glb) or builtin:NAME
            scene: String = "builtin:cornell".to_owned(), NAME;
            /// metres per unit of the scene file
            scene_scale: f64 = 1.0, POSITIVE, "metres";
            /// surroundings that light the scene; view takes auto unless told otherwise
            light: Light = Light::None;
        }
        rows DEVICE {
            /// image size per eye; unset takes the headset's
            size: Option<[u32; 2]> = None, Kind::Size { max: MAX_SIZE }, "pixels";
            /// headset profile from config/headsets/
            headset: String = "symmetric".to_owned(), NAME;
            /// part of the adapter's name; empty takes the best one
            adapter: String = String::new(), TEXT;
        }
        parts {
            /// The renderer's settings.
            render: RenderSettings;
            /// Environment map.
            environment: EnvironmentSettings;
            /// Files written.
            output: OutputSettings;
            /// Simulated headset.
            simulated: SimulatedSettings;
            /// What the wearer does.
            input: InputSettings;
            /// OpenXR sessions.
            openxr: OpenXrSettings;
            /// GPU use.
            gpu: GpuSettings;
            /// Limits on reading files.
            limits: LimitsSettings;
        }
    }

    /// The renderer's settings, independent of scene, headset and files.
    struct RenderSettings at (render) "" {
        rows TRANSPORT {
            /// light transport
            method: Method = Method::Photon;
            /// how the right eye reuses the left eye's work; off renders each eye separately
            reuse: Reuse = Reuse::Scatter;
            /// samples per pixel and frame, averaged
            spp: u32 = 1, whole(1, 1_048_576), "samples per pixel";
            /// random seed
            seed: u32 = 0, whole(0, u32::MAX as u64);
        }
        parts {
            /// Path tracer.
            path: PathSettings;
            /// Photon mapping.
            photon: PhotonSettings;
            /// Stereo reuse.
            stereo: StereoSettings;
            /// Textures.
            textures: TextureSettings;
            /// Denoising and anti-aliasing.
            reconstruct: ReconstructSettings;
            /// Playback of clips.
            animation: AnimationSettings;
            /// What a frame renders for its files.
            output: PictureSettings;
            /// Shader features forced on or off, for measuring.
            force: ForceSettings;
            /// What is timed.
            gpu: TimingSettings;
            /// What the eyes see beyond the scene.
            surroundings: SurroundingsSettings;
            /// The user's own passes.
            user_passes: UserPasses;
        }
    }

    /// Settings of the path tracer (`path.*`).
    struct PathSettings at (render path) "path." {
        rows PATH {
            /// length of a path from eye to light: 1 is emission seen directly, 2 is direct light
            max_depth: u32 = 12, whole(1, 64), "segments";
            /// end dim paths at random, without bias (Russian roulette)
            russian_roulette: bool = true;
            /// random numbers: independent, or Owen-scrambled Sobol points
            sampler: Sampler = Sampler::Sobol;
            /// how the path tracer finds lights: light and BSDF samples by MIS, light samples only, BSDF samples only
            technique: Technique = Technique::Mis;
            /// RIS candidates per shadow ray (resampled importance sampling), in both methods
            light_candidates: u32 = 4, whole(1, 16), "samples";
        }
    }

    /// Settings of photon mapping (`photon.*`).
    struct PhotonSettings at (render photon) "photon." {
        rows PHOTON {
            /// photons emitted per frame
            count: u32 = 262_144, whole(0, 67_108_864), "photons";
            /// gather radius; 0 takes it from the scene's area and the photon count
            radius_m: f64 = 0.0, NOT_NEGATIVE, "metres";
            /// photons emitted for the caustic map, in scenes with caustics; 0 takes photon.count
            caustic_count: u32 = 0, whole(0, 67_108_864), "photons";
            /// gather radius of caustics; 0 takes half of photon.radius_m
            caustic_radius_m: f64 = 0.0, NOT_NEGATIVE, "metres";
            /// length of a light path from eye to light, counted like path.max_depth
            max_depth: u32 = 12, whole(1, 64), "segments";
            /// direct light by next-event estimation or from the photon map
            direct: DirectLight = DirectLight::Nee;
            /// density kernel: weight of a photon by its distance from the gather point
            kernel: Kernel = Kernel::Constant;
            /// capacity of each map's photon buffer; 0 sizes it by the photon count and lets it grow
            capacity: u32 = 0, whole(0, 268_435_456), "photons";
            /// upper bound on the hash grid's cells
            grid_cells_max: u32 = 524_288, whole(64, 4_194_300), "cells";
            /// trace photons every frame, even if scene and lights are static
            every_frame: bool = false;
            /// frames over which photons are retraced once something moves, a share per frame; light lags by as many
            shares: u32 = 1, whole(1, 64);
            /// progressive photon mapping: a new map and a smaller radius per sample, converging to the path tracer
            progressive: bool = false;
            /// with reconstruct.still: new maps with smaller radii while nothing moves, one per frame of as many pixels as paths
            refine_at_rest: bool = true;
            /// share of new photons kept per progressive step (alpha)
            progressive_alpha: f64 = 0.7, between(0.0, 1.0);
            /// least cosine between a photon's surface normal and the gather point's for it to count
            normal_min_cos: f64 = 0.5, real(-1.0, 1.0), "cosine";
            /// automatic radii are smaller where photons are dense; grid and direct loads only
            adaptive_radius: bool = true;
            /// photons whose disc reaches over an edge carry more, so that no light is lost; not if estimated from the nearest
            edge_correction: bool = true;
            /// photon search structure; kd-tree is for comparison, caustics keep the grid
            search: Search = Search::Grid;
            /// estimate from all photons within the radius, or from the k nearest of them; caustics keep the radius
            estimate: PhotonEstimate = PhotonEstimate::Radius;
            /// k of the k nearest photons, within photon.radius_m
            nearest: u32 = 50, whole(1, 64), "photons";
            /// trace and gather in two kernels or in one; fused is for comparison
            schedule: Schedule = Schedule::Split;
            /// photons loaded per thread, or per workgroup through shared memory; cooperative is for comparison
            loads: Loads = Loads::Direct;
            /// gather at every other pixel in each direction and interpolate irradiance, caustics at full rate; auto: where svgf filters
            half_rate: Switch = Switch::Auto;
        }
    }

    /// Settings of stereo reuse (`stereo.*`).
    struct StereoSettings at (render stereo) "stereo." {
        rows STEREO {
            /// most view dependence with which light is taken over as it is; surfaces of more scatter it anew (max_lobe_shift)
            max_view_dependence: f64 = 0.0, SHARE;
            /// glossy surfaces take light over where their lobe moves by no more between the eyes; 0 never
            max_lobe_shift: f64 = 1.0, NOT_NEGATIVE, "lobe widths";
            /// the right eye tests a sample by the lights that it takes over by a shadow ray of its own, on all surfaces
            shadow_rays: bool = false;
        }
    }

    /// Settings of textures (`textures.*`).
    struct TextureSettings at (render textures) "textures." {
        rows TEXTURES {
            /// coarser levels of textures, chosen by how much of one a ray covers
            mips: Mips = Mips::Auto;
        }
    }

    /// Settings of denoising and anti-aliasing (`reconstruct.*`). The constants are those of Schied et al. 2017 (SVGF), Karis 2014 and
    /// Salvi 2016 (`taa_*`).
    struct ReconstructSettings at (render reconstruct) "reconstruct." {
        rows RECONSTRUCT {
            /// filter direct and indirect light over frames and neighbours (SVGF)
            svgf: Switch = Switch::Auto;
            /// with svgf: share accumulated light between the eyes where both see a surface
            stereo: bool = true;
            /// temporal anti-aliasing
            taa: Switch = Switch::Auto;
            /// while nothing moves, fade to the mean of all still frames
            still: Switch = Switch::Auto;
            /// passes of the a-trous wavelet filter; pass n reaches 2^(n - 1) pixels to each side
            atrous_passes: AtrousPasses = AtrousPasses::Auto;
            /// least weight of a new frame in the accumulated light
            color_alpha: f64 = 0.2, SHARE;
            /// least weight of a new frame in the luminance moments
            moments_alpha: f64 = 0.2, SHARE;
            /// luminance difference at which a neighbour's weight is 1/e
            sigma_luminance: f64 = 4.0, POSITIVE, "standard deviations";
            /// exponent of the cosine between a neighbour's normal and the pixel's
            sigma_normal: f64 = 128.0, POSITIVE;
            /// distance from the tangent plane at which a neighbour's weight is 1/e
            sigma_plane_px: f64 = 1.0, POSITIVE, "pixel widths";
            // From 4 frames on mirrors and glass are always limited, since their histories are no longer (Hardie and
            // Barner 1994).
            /// history length up to which light is held between its darkest and its brightest neighbour's (fireflies); 0 never
            firefly_frames: u32 = 1, whole(0, 1_000_000), "frames";
            /// least weight of a new frame in the anti-aliased picture
            taa_alpha: f64 = 0.2, SHARE;
            /// how far anti-aliased history may lie from the mean of its 3x3 neighbours before it is clipped
            taa_clip: f64 = 2.0, POSITIVE, "standard deviations";
            /// still frames up to which only the filter's image is shown
            still_from: u32 = 16, whole(0, 1_000_000), "frames";
            /// still frames from which only the mean is shown
            still_until: u32 = 64, whole(1, 1_000_000), "frames";
        }
    }

    /// Settings of the environment map (`environment.*`).
    struct EnvironmentSettings at (environment) "environment." {
        rows ENVIRONMENT {
            /// equirectangular .hdr or .exr file, builtin:sky, builtin:clouds or builtin:studio; empty for a black surround, or the scene's own
            path: String = String::new(), TEXT;
            /// factor on the environment's radiance
            strength: f64 = 1.0, NOT_NEGATIVE;
        }
    }

    /// What the eyes see beyond the scene (`environment.*`).
    struct SurroundingsSettings at (render surroundings) "environment." {
        rows SURROUNDINGS {
            /// show the wearer's room where a view leaves the scene, if the headset can; black in files and without a headset
            passthrough: bool = false;
        }
    }

    /// Settings of the scene's animation (`animation.*`).
    struct AnimationSettings at (render animation) "animation." {
        rows ANIMATION {
            /// clip by name, or by number in the file, from 0; none plays nothing, empty plays the first
            clip: String = String::new(), TEXT;
            /// seconds of the clip per second of display time
            speed: f64 = 1.0, real(-1000.0, 1000.0);
            /// time in the clip at the first frame
            time_s: f64 = 0.0, real(0.0, 1e6), "s";
        }
    }

    /// What a frame renders for its files (of `output.*`).
    struct PictureSettings at (render output) "output." {
        rows EXPOSURE {
            /// exposure factor of what is shown: PNG files, headset, mirror; EXR files are never scaled
            exposure: f64 = 1.0, NOT_NEGATIVE;
            /// curve from radiance to what is shown: PNG files, headset, mirror
            tone: Tone = Tone::Aces;
        }
        rows PARTS {
            /// also write direct light, indirect light and albedo of each eye: frame_NNNN_EYE_{direct,indirect,albedo}.exr
            parts: bool = false;
            /// keep the previous frame's positions, for views of motion; images do not change
            motion: bool = false;
            /// what may be read after a frame: the picture, depth for a runtime, or all; the less, the less memory
            kept: Kept = Kept::Picture;
            /// count each pass's rays, BVH nodes, triangle tests and photons, as `bench work` does; much slower, images do not
            /// change
            work: bool = false;
            /// also write trace.json: host stages and device passes on one clock, for Perfetto and chrome://tracing
            chrome_trace: bool = false;
        }
    }

    /// Which files are written (of `output.*`).
    struct OutputSettings at (output) "output." {
        rows IMAGES {
            /// write images; stats.jsonl and run.json are always written
            images: WriteImages = WriteImages::Auto;
            /// samples of EXR files: 32-bit or 16-bit floats
            exr: ExrPrecision = ExrPrecision::F32;
            /// EXR files per eye, or one per frame with both eyes as views
            layout: ExrLayout = ExrLayout::Files;
            /// further layers of EXR files
            aovs: String = String::new(), AOVS;
        }
    }

    /// Settings of the simulated headset (`simulated.*`).
    struct SimulatedSettings at (simulated) "simulated." {
        rows SIMULATED {
            /// motion of the simulated headset
            motion: Motion = Motion::Sway;
            /// TOML file of what the simulated hands do (docs/applications.md); empty: there are none
            hands: String = String::new(), TEXT;
        }
    }

    /// What becomes of the wearer's input (`input.*`).
    struct InputSettings at (input) "input." {
        rows INPUT {
            /// show the hands along their tracked joints, else a controller where one is held; view has none
            show_hands: bool = false;
        }
    }

    /// Settings of OpenXR sessions (`openxr.*`).
    struct OpenXrSettings at (openxr) "openxr." {
        rows OPENXR {
            /// reference space that the scene stands in: origin at the head, or on the floor
            space: Space = Space::Local;
            /// swapchain colour format: the runtime's choice, 8-bit sRGB, half floats
            format: ImageFormat = ImageFormat::Auto;
            /// submit a depth layer if the runtime takes it
            depth_layer: bool = true;
            /// trace no rays for pixels that the lens hides
            visibility_mask: bool = true;
            /// refresh rate to ask the runtime for; 0 leaves it to the runtime
            refresh_hz: f64 = 0.0, real(0.0, 1000.0), "Hz";
            /// the left stick walks and the right one turns; off leaves both to an application
            locomotion: bool = true;
            /// walking speed at full deflection of the stick
            move_m_per_s: f64 = 1.5, real(0.0, 100.0), "m/s";
            /// how the right stick turns
            turn: Turn = Turn::Snap;
            /// angle of one snap turn
            snap_turn_deg: f64 = 30.0, real(0.0, 180.0), "degrees";
            /// rate of a smooth turn at full deflection of the stick
            turn_deg_per_s: f64 = 90.0, real(0.0, 720.0), "degrees/s";
        }
    }

    /// What is timed (of `gpu.*`).
    struct TimingSettings at (render gpu) "gpu." {
        rows TIMING {
            /// what is timed with GPU timestamp queries
            timestamps: Timestamps = Timestamps::Auto;
        }
    }

    /// Which shaders are compiled, and how many frames the device is given at once (of `gpu.*`).
    struct GpuSettings at (gpu) "gpu." {
        rows SHADERS {
            /// folder laid out like shaders/ whose .wesl files replace the embedded ones; for work on shaders
            shader_folder: String = String::new(), TEXT;
            /// frames on their way to the device at once; images are the same bit for bit
            frames_in_flight: FramesInFlight = FramesInFlight::Auto;
        }
    }

    /// Limits on reading files (`limits.*`).
    struct LimitsSettings at (limits) "limits." {
        rows LIMITS {
            /// memory that loading a scene with its environment may take; 0 means 4, or half of the machine's if that is less
            load_memory: f64 = 0.0, real(0.0, 1e6), "GiB";
            /// scenes may read files outside their own folder
            allow_outside: bool = false;
        }
    }

    /// Shader features forced on or off (`force.*`).
    struct ForceSettings at (render force) "force." {
        rows FORCE {
            /// glossy and metallic lobes in the shaders: if the scene needs them, always, never
            glossy: Force = Force::Auto;
            /// glass in the shaders
            dielectric: Force = Force::Auto;
            /// textures in the shaders
            textures: Force = Force::Auto;
            /// normal maps in the shaders; on also turns textures on, textures = off also turns normal maps off
            normal_maps: Force = Force::Auto;
            /// alpha mask and blend in the shaders
            alpha: Force = Force::Auto;
            /// vertex colours in the shaders
            vertex_colors: Force = Force::Auto;
            /// the environment map in the shaders
            environment: Force = Force::Auto;
            /// a photon map of its own for caustics
            caustics: Force = Force::Auto;
            /// photons are emitted more where a first few were of use; auto: where light comes from afar
            guided_photons: Force = Force::Auto;
            /// texture copies of the scene's buffers, which software adapters read faster; auto: on those
            record_texels: Force = Force::Auto;
            /// one path per thread, sorts and scans by whole workgroups, as graphics cards want it; auto: on those
            wide_machine: Force = Force::Auto;
        }
    }
}

impl PhotonSettings {
    /// Checks that the ways to gather can be combined.
    ///
    /// # Errors
    /// One line: which cannot, and what to change.
    pub fn check_gather(&self) -> Result<(), String> {
        if self.half_rate.is_on() && self.schedule == Schedule::Fused {
            return Err(
                "photon.half_rate needs photon.schedule = \"split\"; change one of them".to_owned(),
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
        Err(format!("{set} needs {needs}; change one of them"))
    }
}

impl RenderSettings {
    /// Checks that the settings can be combined.
    ///
    /// # Errors
    /// One line: which cannot, and what to change.
    pub fn check(&self) -> Result<(), String> {
        self.photon.check_gather()?;
        if self.spp == 0 {
            return Err("a frame without samples shows nothing; spp must be at least 1".to_owned());
        }
        let photon = &self.photon;
        let counted = photon.search == Search::Grid
            && photon.estimate == PhotonEstimate::Radius
            && photon.loads == Loads::Direct;
        if self.output.work && self.method == Method::Photon && !counted {
            return Err(
                "output.work counts gathers with photon.search = \"grid\", photon.estimate = \"radius\" and \
                 photon.loads = \"direct\" alone; change one of them"
                    .to_owned(),
            );
        }
        match self.no_light_samples() {
            Some(needs) if self.stereo.shadow_rays => Err(format!(
                "stereo.shadow_rays needs {needs}; change one of them"
            )),
            _ => Ok(()),
        }
    }

    /// The setting that light samples need, which the left eye keeps for the right one, where it is another; `None`: they are
    /// kept.
    #[must_use]
    pub fn no_light_samples(&self) -> Option<&'static str> {
        match self.method {
            Method::Path if self.path.technique != Technique::Mis => {
                Some("path.technique = \"mis\"")
            }
            Method::Photon if self.photon.direct != DirectLight::Nee => {
                Some("photon.direct = \"nee\"")
            }
            Method::Photon if self.photon.schedule == Schedule::Fused => {
                Some("photon.schedule = \"split\"")
            }
            _ => None,
        }
    }
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

impl OutputSettings {
    /// The layers of `output.aovs`, each once.
    ///
    /// # Errors
    /// One line: a word that is none of them.
    pub fn aov_list(&self) -> Result<Vec<Aov>, String> {
        let mut list = Vec::new();
        for word in listed(&self.aovs) {
            match Aov::from_word(word) {
                Some(aov) if list.contains(&aov) => {}
                Some(aov) => list.push(aov),
                None => return Err(format!("output.aovs = {word}: must be {}", AOVS.allowed())),
            }
        }
        Ok(list)
    }
}

impl ReconstructSettings {
    /// Whether any of its passes runs.
    #[must_use]
    pub fn is_on(&self) -> bool {
        self.svgf.is_on() || self.taa.is_on() || self.still.is_on()
    }

    /// Whether what moves must be followed from frame to frame.
    #[must_use]
    pub fn follows_motion(&self) -> bool {
        self.svgf.is_on() || self.taa.is_on()
    }
}

impl RenderSettings {
    /// Decides what is left to `auto`, for a sequence or for frames that stand alone: with several samples per pixel, or alone, no
    /// switch is on.
    pub fn decide_switches(&mut self, is_sequence: bool) {
        let auto = is_sequence && self.spp == 1;
        let own = &mut self.reconstruct;
        for switch in [&mut own.svgf, &mut own.taa, &mut own.still] {
            if *switch == Switch::Auto {
                *switch = auto.into();
            }
        }
        own.atrous_passes = own.atrous_passes.with(self.method).into();
        // What lies between gathered pixels the filter would mix as well.
        let half_rate = &mut self.photon.half_rate;
        if *half_rate == Switch::Auto {
            let is_split = self.photon.schedule == Schedule::Split;
            *half_rate = (is_split && own.svgf.is_on()).into();
        }
    }
}
