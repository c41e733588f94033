//! The command line: commands, flags and their help. A single flag is checked here, combinations in `checks`.

use std::ops::Range;
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};

use super::setting_flags::{BENCH, COMPARE, INFO, RUN, SHARED, SettingFlags};
use super::values::{self, choice, real, whole};
use crate::settings::{Eyes, LimitsSettings, Settings};
use crate::xr::{Fov, Pose, TraceBody, TraceUp};
use stereolux_settings::choices;

pub(super) const STATUS_HELP: &str = "\
Exit status: 0 done, 1 failed while running, 2 unusable arguments or input.";

const MAIN_EXAMPLES: &str = "\
Examples:
  stereolux run                                    100 stereo frames of the Cornell box, simulated headset
  stereolux render --scene helmet.glb --size 512x512 --photons 1000000
  stereolux render --method path --spp 1024 --out reference
  stereolux compare out/frame_0000_left.exr reference/frame_0000_left.exr
  stereolux info --scene helmet.glb

Exit status: 0 done, 1 failed while running, 2 unusable arguments or input.
`stereolux COMMAND --help` explains a command in full.";

pub(super) const RUN_EXAMPLES: &str = "\
Examples:
  stereolux run --scene builtin:gallery --frames 20 --every 5
  stereolux run --headset quest3 --motion yaw --reuse off --out separate-eyes
  stereolux run --record walk.jsonl --motion walk
  stereolux run --session replay --trace walk.jsonl
  stereolux run --trace freiburg1_xyz-groundtruth.txt --trace-body optical --frames 100
  stereolux run --set photon.kernel=cone --set photon.normal_min_cos=-1";

pub(super) const RENDER_EXAMPLES: &str = "\
Examples:
  stereolux render --scene builtin:cornell --size 256x256 --ipd 0.063
  stereolux render --pose \"0 1.6 2 0 0 0 1\" --fov \"-40 40 40 -40\" --size 512x512
  stereolux render --method path --spp 256 --eyes left";

pub(super) const VIEW_EXAMPLES: &str = "\
Examples:
  stereolux view --scene helmet.glb
  stereolux view --scene builtin:gallery --set environment.path=sky.hdr
  stereolux view --trace walk.jsonl
A recording starts paused; play, step and scrub in the window. F1 lists keys and mouse.";

pub(super) const BENCH_EXAMPLES: &str = "\
Every measured frame retraces its photons, but in motion. Variants of a group take turns, frame by frame (motion: sequence
by sequence), and ratios are formed within a turn. Errors are those of the timed frames, against a path-traced reference.
Settings that a suite varies override those given here; `spp` is 1 except where the suite varies it. No images are
written, so that output.* changes nothing.

Writes to --out: report.md, report.html, report.json, rows.csv, columns.json (what each column of
rows.csv holds), plots/*.svg and *.png, journal.jsonl, traces/, references/; of motion and work
report.md, rows.csv, columns.json and motion's references/ alone.

Examples:
  stereolux bench smoke --out out/smoke
  stereolux bench stereo --scene builtin:cornell --size 128x128 --out out/stereo
  stereolux bench pareto --scene helmet.glb --set environment.path=sky.hdr --rounds 16 --out out/pareto";

const COMPARE_HELP: &str = "\
Keys of the JSON object (x the image, r the reference, s the mean of r^2):
  rel_mse        mean over pixels and channels of (x - r)^2 / (r^2 + 0.01 s)
  rmse           square root of the mean of (x - r)^2
  mean_rel_bias  (mean x - mean r) / mean r, signed
  flip           mean FLIP difference of the tone-mapped pair, 0 to 1
  ..._se         standard error of each, from the spread over blocks of pixels
                 (each is null where what it divides by is 0 and the images differ)
  mean_luminance, reference_mean_luminance  of the pixels that are counted
  width, height, pixels (counted), non_finite (pixels left out because a channel is NaN or infinite)

Examples:
  stereolux compare out/frame_0000_left.exr reference/frame_0000_left.exr
  stereolux compare a.exr b.exr --mask reused.png --max-rel-mse 0.01
  stereolux compare a.exr b.exr --report a_against_b

Exit status: 0 done, 1 relative MSE above --max-rel-mse (or, with it, pixels that are not finite),
2 unusable arguments or input, such as images of different size.";

/// Stereo global illumination for headsets: photon mapping with stereo reuse, and the path tracer it is measured against
#[derive(Clone, Debug, Parser)]
#[command(name = "stereolux", version, after_help = MAIN_EXAMPLES, disable_help_subcommand = true)]
pub(super) struct Cli {
    #[command(subcommand)]
    pub(super) options: Options,
}

/// A command with its options.
#[derive(Clone, Debug, Subcommand)]
pub enum Options {
    /// Run the stereo frame loop with a simulated, replayed or real headset
    Run(Box<RunOptions>),
    /// Render one stereo pair from one pose
    Render(Box<RenderOptions>),
    /// Print error metrics of an image against a reference as one JSON object
    Compare(CompareOptions),
    /// Measure speed against error over a suite of settings and write a report
    Bench(Box<BenchOptions>),
    /// Print adapters, OpenXR runtime and what a scene needs as one JSON object
    Info(Box<InfoOptions>),
    /// Open the desktop viewer
    View(Box<ViewOptions>),
    /// Join the statistics of a run's ranges, or the reports of a suite's parts
    Merge(MergeOptions),
    /// Write a crate for an application of your own: code, scene, recording, test
    New(NewOptions),
    /// List the settings for --set and --config, or those that a word is about
    Settings(SettingsOptions),
}

/// Sources of settings: a command's flags, a file, `--set`.
#[derive(Clone, Debug, Args)]
pub(super) struct LayerArgs<const FLAGS: usize> {
    #[command(flatten)]
    pub(super) flags: SettingFlags<FLAGS>,
    /// TOML file of settings; --set and flags override it; unknown keys are errors
    #[arg(long, value_name = "FILE", help_heading = "Settings")]
    pub(super) config: Option<PathBuf>,
    /// Change one setting, such as photon.kernel=cone; may be repeated, the last wins.
    /// The value is TOML, or bare text. `stereolux settings` lists all keys
    #[arg(long, value_name = "KEY=VALUE", help_heading = "Settings")]
    pub(super) set: Vec<String>,
}

/// Options shared by `run`, `render` and `view`.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Scene and rendering")]
pub struct SharedOptions {
    #[command(flatten)]
    pub(super) layers: LayerArgs<SHARED>,
    /// Directory for what is written; made if missing
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
}

choices! {
    /// Source of head and eye poses.
    pub enum SessionChoice {
        /// OpenXR if a runtime answers, else simulated, and says which; with --trace, replay
        Auto = "auto",
        /// Simulated headset, the same motion every time
        Simulated = "simulated",
        /// Poses from --trace
        Replay = "replay",
        /// A window: mouse and keyboard are head and hands
        Desktop = "desktop",
        /// OpenXR runtime, or an error if none answers
        Openxr = "openxr",
    }

    /// What `bench` measures.
    pub enum Suite {
        /// The 2020 report's five tables: ways to gather, and two separate eyes against stereo reuse
        Tables = "tables",
        /// Reuse modes side by side over scenes, eye distances, headsets and a recorded trace
        Stereo = "stereo",
        /// Error against time over photons, radius, kernel, direct light and samples, and for the path tracer
        Pareto = "pareto",
        /// Cost against triangles, instances, lights, photons and pixels, with fitted exponents
        Scaling = "scaling",
        /// A little of the four above, in about two minutes
        Smoke = "smoke",
        /// A moving head, raw and reconstructed: error, brightness, flicker, disagreement of the eyes, time
        Motion = "motion",
        /// Rays, nodes, triangle tests, photons and bytes of each pass, counted, and what named cards would allow: a model
        Work = "work",
    }
}

/// Options of `run`.
#[derive(Clone, Debug, Args)]
#[command(after_help = RUN_EXAMPLES)]
pub struct RunOptions {
    /// All settings.
    #[arg(skip)]
    pub settings: Settings,
    /// Shared with `render` and `view`.
    #[command(flatten)]
    pub shared: SharedOptions,
    /// The session.
    #[command(flatten)]
    pub session: SessionOptions,
    /// Whether a layer says how the right eye reuses the left one.
    #[arg(skip)]
    pub names_reuse: bool,
}

/// Options of `run` alone.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Session")]
pub struct SessionOptions {
    /// Source of poses
    #[arg(
        long = "session",
        value_name = "SESSION",
        value_parser = choice::<SessionChoice>(),
        default_value_t = SessionChoice::Auto
    )]
    pub choice: SessionChoice,
    /// The recording; there is one exactly if `choice` is [`SessionChoice::Replay`].
    #[command(flatten)]
    pub recording: TraceOptions,
    /// Where the head starts in the world: position in metres and unit quaternion, +Y up, -Z forward. With an OpenXR
    /// runtime, the place of its origin; with a recording, of its first pose
    /// [default: the scene's first glTF camera, else a pose that frames the scene]
    #[arg(long, value_name = "\"x y z qx qy qz qw\"", value_parser = values::pose)]
    pub pose: Option<Pose>,
    /// Record the views used to this native trace (JSON Lines)
    #[arg(long, value_name = "FILE")]
    pub record: Option<PathBuf>,
    /// Frames to run, 1 to 4294967295 [default: simulated 100; replay all; openxr and desktop until the session ends]
    #[arg(long, value_name = "N", value_parser = whole(1..=u32::MAX))]
    pub frames: Option<u32>,
    /// Render frames A to B-1 alone, as the whole run would; statistics and images keep their numbers. Frame 0 is
    /// rendered before them, without files: its photons serve all frames of a scene that stands still
    #[arg(long, value_name = "A..B", value_parser = values::frame_range)]
    pub range: Option<Range<u32>>,
    /// With --range: render N more frames before A, without files, for what frames leave to the next ones (filters, light
    /// that lags)
    #[arg(long, value_name = "N", value_parser = whole(0..=u32::MAX), default_value = "0")]
    pub warm_up: u32,
    /// Write images of every K-th frame, from frame 0 on; 1 to 4294967295
    #[arg(long, value_name = "K", value_parser = whole(1..=u32::MAX), default_value = "1")]
    pub every: u32,
    /// Replay or simulate at the headset's refresh rate instead of as fast as possible
    #[arg(long)]
    pub realtime: bool,
    /// Show both eyes side by side in a desktop window; closing it does not end the run
    #[arg(long)]
    pub mirror: bool,
    #[command(flatten)]
    pub(super) flags: SettingFlags<RUN>,
}

/// A recording to replay, in `run` and `view`. `None`: the default of the recording's format.
#[derive(Clone, Debug, Args)]
pub struct TraceOptions {
    /// Replay this recording: a native trace (from --record), a TUM trajectory or a EuRoC ground-truth CSV. TUM and
    /// EuRoC hold head poses; the headset profile adds the eyes
    #[arg(long, value_name = "FILE")]
    pub trace: Option<PathBuf>,
    /// World axis that points up in the trace [default: z; native traces have y up, and take none]
    #[arg(long, value_parser = choice::<TraceUp>())]
    pub trace_up: Option<TraceUp>,
    /// Axes of the recorded body: openxr (x right, y up, z back), optical (x right, y down, z forward), or the
    /// rotation eye-from-body as "qx qy qz qw" [default: optical for TUM, the vehicle's IMU for EuRoC]
    #[arg(long, value_name = "openxr|optical|\"qx qy qz qw\"", value_parser = values::trace_body)]
    pub trace_body: Option<TraceBody>,
    /// Move the first pose onto the scene's starting pose, keeping gravity vertical
    /// [default: true; native traces stay where they are, and take false alone]
    #[arg(long, value_name = "true|false", num_args = 0..=1, default_missing_value = "true")]
    pub trace_recenter: Option<bool>,
}

/// Options of `render`.
#[derive(Clone, Debug, Args)]
#[command(after_help = RENDER_EXAMPLES)]
pub struct RenderOptions {
    /// All settings.
    #[arg(skip)]
    pub settings: Settings,
    /// Whether a headset was named.
    #[arg(skip)]
    pub names_headset: bool,
    /// Shared with `run` and `view`.
    #[command(flatten)]
    pub shared: SharedOptions,
    /// The view.
    #[command(flatten)]
    pub view: PoseOptions,
}

/// Options of `render` alone.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "View")]
pub struct PoseOptions {
    /// Head pose in the world: position in metres and unit quaternion, +Y up, -Z forward
    /// [default: the scene's first glTF camera, else a pose that frames the scene]
    #[arg(long, value_name = "\"x y z qx qy qz qw\"", value_parser = values::pose)]
    pub pose: Option<Pose>,
    /// IPD, the distance between the eyes, in metres, 0 to 1; replaces the profile's eye offsets and cant
    /// [default: the headset's]
    #[arg(long, value_name = "M", value_parser = values::ipd_m)]
    pub ipd: Option<f64>,
    /// Field of view of both eyes: angles in degrees within +-89, left and down negative, such as
    /// "-40 40 40 -40"; replaces the profile's angles and cant [default: the glTF camera's where its pose is taken
    /// and --headset is not given, else the headset's]
    #[arg(long, value_name = "\"left right up down\"", value_parser = values::fov)]
    pub fov: Option<Fov>,
    /// Eyes to render
    #[arg(long, value_parser = choice::<Eyes>(), default_value_t = Eyes::Both)]
    pub eyes: Eyes,
}

/// Options of `compare`.
#[derive(Clone, Debug, Args)]
#[command(after_help = COMPARE_HELP)]
pub struct CompareOptions {
    /// Image to compare: EXR or HDR (linear), PNG or JPEG (sRGB, decoded)
    pub image: PathBuf,
    /// Reference image of the same size
    pub reference: PathBuf,
    /// Exit with status 1 if the relative MSE is above this number (0 or more)
    #[arg(long, value_name = "X", value_parser = real(|limit| limit >= 0.0, "a number, 0 or more"))]
    pub max_rel_mse: Option<f64>,
    /// Compare only pixels that are white (any channel at least half) in this image of the same size
    #[arg(long, value_name = "FILE")]
    pub mask: Option<PathBuf>,
    /// Exposure factor before tone mapping, for FLIP only
    #[arg(
        long,
        value_name = "X",
        value_parser = real(|factor| factor > 0.0 && factor <= 1e9, "a number above 0 and at most 1e9"),
        default_value = "1"
    )]
    pub exposure: f64,
    /// Pixels per degree of visual angle, for FLIP only; 67 is a 0.7 m wide 4K monitor at 0.7 m, headsets have
    /// about 12 to 25
    #[arg(
        long,
        value_name = "N",
        value_parser = real(|ppd| (1.0..=1000.0).contains(&ppd), "a number from 1 to 1000"),
        default_value = "67"
    )]
    pub pixels_per_degree: f64,
    /// Also write DIR/report.html, a page to look at the two: wiped, their differences, values under the pointer
    #[arg(long, value_name = "DIR")]
    pub report: Option<PathBuf>,
    /// Limits on reading the images.
    #[arg(skip)]
    pub limits: LimitsSettings,
    #[command(flatten)]
    pub(super) layers: LayerArgs<COMPARE>,
}

/// Options of `bench`. `None`: the suite's default.
#[derive(Clone, Debug, Args)]
#[command(after_help = STATUS_HELP)]
pub struct BenchOptions {
    /// All settings; the suite overrides some.
    #[arg(skip)]
    pub settings: Settings,
    /// Suite to run
    #[arg(value_parser = choice::<Suite>())]
    pub suite: Suite,
    /// Directory for report, journal and references; made if missing. The same command again resumes a suite
    /// that was stopped, but motion and work
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    /// Scene to measure, a glTF file, builtin:NAME, bench:lights (10,000 of them) or bench:indirect (a room lit by what a wall
    /// sends back); may be repeated [default: builtin:cornell; stereo and pareto also builtin:gallery and builtin:caustic,
    /// pareto bench:indirect besides; motion and work also builtin:gallery]
    #[arg(long = "scene", value_name = "PATH|builtin:NAME", value_parser = values::scene)]
    pub scenes: Vec<String>,
    /// Measured rounds, each one frame of every variant in turn, 1 to 100000 [default: 8; smoke 3; motion 2]
    #[arg(long, value_name = "N", value_parser = whole(1..=100_000))]
    pub rounds: Option<u32>,
    /// Frames of the swaying head in the suites stereo and motion, 1 to 100000 [default: 24; smoke 4; motion 40, at least 16]
    #[arg(long, value_name = "N", value_parser = whole(1..=100_000))]
    pub frames: Option<u32>,
    /// Most samples per pixel of a reference, 16 to 16777216, of one that is spread over the pixel (pareto, motion) at least
    /// 256, motion twice that; errors that need more are marked [default: 4096]
    #[arg(long, value_name = "N", value_parser = whole(16..=1 << 24))]
    pub reference_spp: Option<u32>,
    /// Directory that caches references between runs [default: DIR/references, DIR from --out]
    #[arg(long, value_name = "DIR")]
    pub references: Option<PathBuf>,
    /// Measure only part I of N, from 1, for a machine of its own; `merge` joins the parts' reports
    #[arg(long, value_name = "I/N", value_parser = values::shard)]
    pub shard: Option<[u32; 2]>,
    #[command(flatten)]
    pub(super) layers: LayerArgs<BENCH>,
}

/// Options of `info`.
#[derive(Clone, Debug, Args)]
#[command(after_help = STATUS_HELP)]
pub struct InfoOptions {
    /// All settings.
    #[arg(skip)]
    pub settings: Settings,
    /// Whether a scene to analyse was named.
    #[arg(skip)]
    pub names_scene: bool,
    #[command(flatten)]
    pub(super) layers: LayerArgs<INFO>,
    /// Some ten lines for people instead of JSON
    #[arg(long, conflicts_with = "lists_settings")]
    pub brief: bool,
    /// Also list all settings: key, kind, default, range, unit, sentence
    #[arg(long = "settings")]
    pub lists_settings: bool,
}

/// Options of `merge`.
#[derive(Clone, Debug, Args)]
#[command(after_help = STATUS_HELP)]
pub struct MergeOptions {
    /// Folders that `run --range` has written, which keep their images, or all that `bench --shard` has
    #[arg(required = true, value_name = "DIR")]
    pub folders: Vec<PathBuf>,
    /// Folder for the joined stats.jsonl and run.json, or report and journal; made if missing
    #[arg(long, value_name = "DIR", default_value = "merged")]
    pub out: PathBuf,
}

/// Options of `new`.
#[derive(Clone, Debug, Args)]
#[command(after_help = STATUS_HELP)]
pub struct NewOptions {
    /// Folder of the crate, which is named like it; must be new
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    /// Sources of stereolux that the crate builds against [default: those that this program was built from]
    #[arg(long, value_name = "CHECKOUT")]
    pub path: Option<PathBuf>,
}

/// Options of `settings`.
#[derive(Clone, Debug, Args)]
#[command(after_help = STATUS_HELP)]
pub struct SettingsOptions {
    /// Part of a key, a group, a value or an explanation, such as `photon` or `denoising`
    pub word: Option<String>,
}

/// Options of `view`.
#[derive(Clone, Debug, Args)]
#[command(after_help = VIEW_EXAMPLES)]
pub struct ViewOptions {
    /// All settings.
    #[arg(skip)]
    pub settings: Settings,
    /// Shared with `run` and `render`; `out` receives screenshots and saved files.
    #[command(flatten)]
    pub shared: SharedOptions,
    /// Recording to play.
    #[command(flatten, next_help_heading = "Recording")]
    pub recording: TraceOptions,
}
