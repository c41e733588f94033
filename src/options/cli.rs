//! The command line as typed: commands, flags and their help. Nothing is checked here that needs a range or a file;
//! [`super::resolve()`] does that.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::builder::StyledStr;
use clap::error::ErrorKind;
use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand, ValueEnum};

use super::registry;
use super::settings::{Method, Motion, Reuse};

const STATUS_HELP: &str = "\
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

const RUN_EXAMPLES: &str = "\
Examples:
  stereolux run --scene builtin:gallery --frames 20 --every 5
  stereolux run --headset quest3 --motion yaw --reuse off --out each-eye-by-itself
  stereolux run --record walk.jsonl --motion walk
  stereolux run --session replay --trace walk.jsonl
  stereolux run --trace freiburg1_xyz-groundtruth.txt --trace-body optical --frames 100
  stereolux run --set photon.kernel=cone --set photon.normal_min_cos=-1";

const RENDER_EXAMPLES: &str = "\
Examples:
  stereolux render --scene builtin:cornell --size 256x256 --ipd 0.063
  stereolux render --pose \"0 1.6 2 0 0 0 1\" --fov \"-40 40 40 -40\" --size 512x512
  stereolux render --method path --spp 256 --eyes left";

const VIEW_EXAMPLES: &str = "\
Examples:
  stereolux view --scene helmet.glb
  stereolux view --scene builtin:gallery --set environment.path=sky.hdr
  stereolux view --trace walk.jsonl
A recording waits at its first frame; it plays, steps and scrubs in the window. F1 there lists keys and mouse.";

const BENCH_EXAMPLES: &str = "\
Every frame that is measured traces its photons anew. Variants of a group take turns, frame by frame, and ratios are
formed within a turn. Errors are those of the frames that were timed, against a path-traced reference.
Settings that a suite varies replace those given here; `spp` is 1 except where the suite varies it.

Writes to --out: report.md, report.json, rows.csv, plots/*.svg and *.png, journal.jsonl, traces/, references/.

Examples:
  stereolux bench smoke --out out/smoke
  stereolux bench stereo --scene builtin:cornell --size 128x128 --out out/stereo
  stereolux bench pareto --scene helmet.glb --set environment.path=sky.hdr --rounds 16 --out out/pareto";

const COMPARE_HELP: &str = "\
Keys of the JSON object (x the image, r the reference, s the mean of r^2):
  rel_mse        mean over pixels and channels of (x - r)^2 / (r^2 + 0.01 s)
  rmse           square root of the mean of (x - r)^2
  mean_rel_bias  (mean x - mean r) / mean r, signed; null where the reference's mean is 0
  flip           mean FLIP difference of the tone-mapped pair, 0 to 1
  ..._se         standard error of each, from the spread over blocks of pixels
  width, height, pixels (counted), non_finite (pixels left out because a channel is NaN or infinite)

Examples:
  stereolux compare out/frame_0000_left.exr reference/frame_0000_left.exr
  stereolux compare a.exr b.exr --mask reused.png --max-rel-mse 0.01

Exit status: 0 done, 1 relative MSE above --max-rel-mse (or pixels that are not finite while that is given),
2 unusable arguments or input, such as images of different size.";

/// Stereo global illumination for headsets: photon mapping with stereo reuse, and the path tracer it is measured against
#[derive(Clone, Debug, Parser)]
#[command(name = "stereolux", version, after_help = MAIN_EXAMPLES, disable_help_subcommand = true)]
pub struct Cli {
    /// The command.
    #[command(subcommand)]
    pub command: Command,
}

/// Commands with their flags.
#[derive(Clone, Debug, Subcommand)]
pub enum Command {
    /// Run the stereo frame loop with a simulated, replayed or real headset
    Run(RunArgs),
    /// Render one stereo pair from one pose
    Render(RenderArgs),
    /// Print error metrics of an image against a reference as one JSON object
    Compare(CompareArgs),
    /// Measure speed against error over a suite of settings and write a report
    Bench(BenchArgs),
    /// Print adapters, OpenXR runtime and what a scene needs as one JSON object
    Info(InfoArgs),
    /// Open the desktop viewer
    View(ViewArgs),
}

/// Where settings come from: file, `--set`.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Settings")]
pub struct LayerArgs {
    /// TOML file of settings, under --set and all flags; unknown keys are errors
    #[arg(long, value_name = "FILE", allow_hyphen_values = true)]
    pub config: Option<PathBuf>,
    /// Change one setting, such as photon.kernel=cone; may be repeated, the last one wins.
    /// The value is TOML, or bare text. All keys are listed at the end of --help
    #[arg(long, value_name = "KEY=VALUE", allow_hyphen_values = true)]
    pub set: Vec<String>,
}

/// Flags shared by `run`, `render` and `view`.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Scene and rendering")]
pub struct SharedArgs {
    /// glTF 2.0 file (.gltf, .glb), or builtin:NAME with NAME one of cornell, plane, sphere, caustic, gallery
    /// [default: builtin:cornell]
    #[arg(long, value_name = "PATH|builtin:NAME", allow_hyphen_values = true)]
    pub scene: Option<String>,
    /// Let the scene name files outside its own folder. Only for scenes whose maker you trust: whatever they name is read
    #[arg(long)]
    pub allow_outside: bool,
    /// Light transport [default: photon]
    #[arg(long, value_enum)]
    pub method: Option<Method>,
    /// How the right eye reuses the left eye's work [default: scatter]
    #[arg(long, value_enum)]
    pub reuse: Option<Reuse>,
    /// Photons emitted per frame, 0 to 67108864 [default: 262144]
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    pub photons: Option<String>,
    /// Gather radius in metres; 0 takes it from the scene's area and the photon count [default: 0]
    #[arg(long, value_name = "M", allow_hyphen_values = true)]
    pub radius: Option<String>,
    /// Primary samples per pixel, averaged, 1 to 1048576. One goes through the pixel's centre,
    /// more spread over the pixel [default: 1]
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    pub spp: Option<String>,
    /// Pixels per eye, such as 512x512, each 1 to 16384 [default: the headset's]
    #[arg(long, value_name = "WxH", allow_hyphen_values = true)]
    pub size: Option<String>,
    /// Headset profile from config/headsets/: per-eye size, FOV angles, eye poses, IPD, refresh rate
    /// [default: symmetric]
    #[arg(long, value_name = "NAME", allow_hyphen_values = true)]
    pub headset: Option<String>,
    /// Random seed, 0 to 4294967295 [default: 0]
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    pub seed: Option<String>,
    /// Substring of a wgpu adapter's name (see `stereolux info`), upper or lower case
    /// [default: a discrete GPU, then integrated, then software]
    #[arg(long, value_name = "NAME", allow_hyphen_values = true)]
    pub adapter: Option<String>,
    /// Directory for images, stats.jsonl and run.json; made if missing
    #[arg(
        long,
        value_name = "DIR",
        default_value = "out",
        allow_hyphen_values = true
    )]
    pub out: PathBuf,
    /// Config file and `--set`.
    #[command(flatten)]
    pub layers: LayerArgs,
}

/// Where head and eye poses come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum SessionChoice {
    /// OpenXR if a runtime answers, else simulated; says which. With --trace: replay
    #[default]
    Auto,
    /// Simulated headset, the same motion every time
    Simulated,
    /// Poses from --trace
    Replay,
    /// OpenXR runtime, or an error if none answers
    Openxr,
}

/// The axis that points up in a recorded trace's world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum TraceUp {
    /// +Y, as in OpenXR and glTF
    Y,
    /// +Z, as in TUM and EuRoC recordings
    Z,
}

/// `stereolux run`.
#[derive(Clone, Debug, Args)]
#[command(after_help = RUN_EXAMPLES)]
pub struct RunArgs {
    /// Shared flags.
    #[command(flatten)]
    pub shared: SharedArgs,
    /// Session flags.
    #[command(flatten)]
    pub session: SessionArgs,
}

/// Flags of `run` alone.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Session")]
pub struct SessionArgs {
    /// Where poses come from
    #[arg(long, value_enum, default_value_t = SessionChoice::Auto)]
    pub session: SessionChoice,
    /// Recording flags.
    #[command(flatten)]
    pub recording: TraceArgs,
    /// Write the views that were really used to this native trace
    #[arg(long, value_name = "FILE", allow_hyphen_values = true)]
    pub record: Option<PathBuf>,
    /// Frames to run, 1 to 4294967295 [default: simulated 100; replay the whole trace; openxr until the session ends]
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    pub frames: Option<String>,
    /// Write images of every K-th frame, counted from frame 0; 1 to 4294967295 [default: 1]
    #[arg(long, value_name = "K", allow_hyphen_values = true)]
    pub every: Option<String>,
    /// Replay and simulate at the headset's refresh rate instead of as fast as the machine allows
    #[arg(long)]
    pub realtime: bool,
    /// Show what the eyes see, side by side, in a window of the desktop. Closing it ends the mirror, not the run
    #[arg(long)]
    pub mirror: bool,
    /// Motion of the simulated headset [default: sway]
    #[arg(long, value_enum)]
    pub motion: Option<Motion>,
}

/// Flags of a recording, of `run` and `view`.
#[derive(Clone, Debug, Default, Args)]
pub struct TraceArgs {
    /// Replay this recording: a native trace (JSON Lines, from --record), a TUM trajectory or a EuRoC ground-truth CSV.
    /// TUM and EuRoC hold head poses; the headset profile adds the eyes
    #[arg(long, value_name = "FILE", allow_hyphen_values = true)]
    pub trace: Option<PathBuf>,
    /// World axis that points up in the trace [default: z for TUM and EuRoC, y for native]
    #[arg(long, value_enum)]
    pub trace_up: Option<TraceUp>,
    /// What the recorded body frame is: openxr (x right, y up, z back), optical (x right, y down, z forward),
    /// or the rotation eye-from-body as "qx qy qz qw" [default: optical for TUM, the IMU of its vehicles for EuRoC]
    #[arg(
        long,
        value_name = "openxr|optical|\"qx qy qz qw\"",
        allow_hyphen_values = true
    )]
    pub trace_body: Option<String>,
    /// Move the trace's first pose onto the scene's starting pose, gravity kept vertical
    /// [default: true for TUM and EuRoC, false for native]
    #[arg(long, value_name = "true|false", num_args = 0..=1, default_missing_value = "true")]
    pub trace_recenter: Option<bool>,
}

/// Which eyes `render` renders and writes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Eyes {
    /// Both eyes
    #[default]
    Both,
    /// The left eye
    Left,
    /// The right eye, rendered by itself: there is no left eye to reuse
    Right,
}

/// `stereolux render`.
#[derive(Clone, Debug, Args)]
#[command(after_help = RENDER_EXAMPLES)]
pub struct RenderArgs {
    /// Shared flags.
    #[command(flatten)]
    pub shared: SharedArgs,
    /// View flags.
    #[command(flatten)]
    pub view: PoseArgs,
}

/// Flags of `render` alone.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "View")]
pub struct PoseArgs {
    /// Head pose in the world: position in metres and unit quaternion, +Y up, -Z forward
    /// [default: the scene's first glTF camera, else a pose that frames the scene]
    #[arg(long, value_name = "\"x y z qx qy qz qw\"", allow_hyphen_values = true)]
    pub pose: Option<String>,
    /// Distance between the eyes in metres, 0 to 1000; replaces the profile's eye offsets and cant
    /// [default: the headset's]
    #[arg(long, value_name = "M", allow_hyphen_values = true)]
    pub ipd: Option<String>,
    /// Angles of both eyes in degrees within +-89, left and down negative, such as "-40 40 40 -40";
    /// replaces the profile's angles and cant [default: the headset's]
    #[arg(
        long,
        value_name = "\"left right up down\"",
        allow_hyphen_values = true
    )]
    pub fov: Option<String>,
    /// Eyes to render
    #[arg(long, value_enum, default_value_t = Eyes::Both)]
    pub eyes: Eyes,
}

/// `stereolux compare`.
#[derive(Clone, Debug, Args)]
#[command(after_help = COMPARE_HELP)]
pub struct CompareArgs {
    /// Image to judge: EXR or HDR (linear), PNG or JPEG (sRGB, decoded)
    pub image: PathBuf,
    /// Reference image of the same size
    pub reference: PathBuf,
    /// Exit with status 1 if the relative MSE is above this number (0 or more)
    #[arg(long, value_name = "X", allow_hyphen_values = true)]
    pub max_rel_mse: Option<String>,
    /// Count only pixels that are white (any channel at least half) in this image of the same size
    #[arg(long, value_name = "FILE", allow_hyphen_values = true)]
    pub mask: Option<PathBuf>,
    /// Exposure factor before tone mapping, for FLIP only
    #[arg(
        long,
        value_name = "X",
        default_value = "1",
        allow_hyphen_values = true
    )]
    pub exposure: String,
    /// Pixels per degree of visual angle, for FLIP only; 67 is a 0.7 m wide 4K monitor seen from 0.7 m,
    /// headsets have about 12 to 25
    #[arg(
        long,
        value_name = "N",
        default_value = "67",
        allow_hyphen_values = true
    )]
    pub pixels_per_degree: String,
    /// Config file and `--set`, for `limits.load_memory`.
    #[command(flatten)]
    pub layers: LayerArgs,
}

/// What `bench` measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Suite {
    /// The 2020 report's five tables: ways to gather, and two eyes by themselves against stereo reuse
    Tables,
    /// Reuse modes side by side over scenes, eye distances, headsets and a recorded trace
    Stereo,
    /// Milliseconds against error over photons, radius, kernel, direct light and samples; the path tracer beside it
    Pareto,
    /// Cost against triangles, instances, lights, photons and pixels, with fitted exponents
    Scaling,
    /// A little of all of them, in about a minute
    Smoke,
}

/// `stereolux bench`.
#[derive(Clone, Debug, Args)]
#[command(after_help = STATUS_HELP)]
pub struct BenchArgs {
    /// Suite to run
    #[arg(value_enum)]
    pub suite: Suite,
    /// Directory for the report, the journal of finished rows and, unless --references says otherwise, the
    /// references; made if missing. A second run with the same settings goes on where the first one stopped
    #[arg(
        long,
        value_name = "DIR",
        default_value = "out",
        allow_hyphen_values = true
    )]
    pub out: PathBuf,
    /// Scene to measure, a glTF file or builtin:NAME; may be repeated
    /// [default: builtin:cornell; stereo and pareto also builtin:gallery and builtin:caustic]
    #[arg(long, value_name = "PATH|builtin:NAME", allow_hyphen_values = true)]
    pub scene: Vec<String>,
    /// Let scenes name files outside their own folder. Only for those whose maker you trust: whatever they name is read
    #[arg(long)]
    pub allow_outside: bool,
    /// Pixels per eye, such as 256x256, each 1 to 16384 [default: 256x256; smoke 32x32]
    #[arg(long, value_name = "WxH", allow_hyphen_values = true)]
    pub size: Option<String>,
    /// Rounds that are measured, each one frame of every variant in turn, 1 to 100000 [default: 8; smoke 3]
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    pub rounds: Option<String>,
    /// Frames of the recorded trace in the stereo suite, 1 to 100000 [default: 24; smoke 4]
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    pub frames: Option<String>,
    /// Most samples per pixel of a path-traced reference, 16 to 16777216. Errors that need a better one are marked
    /// [default: 4096; smoke 256]
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    pub reference_spp: Option<String>,
    /// Directory that keeps path-traced references between runs [default: DIR/references, DIR from --out]
    #[arg(long, value_name = "DIR", allow_hyphen_values = true)]
    pub references: Option<PathBuf>,
    /// Substring of a wgpu adapter's name [default: a discrete GPU, then integrated, then software]
    #[arg(long, value_name = "NAME", allow_hyphen_values = true)]
    pub adapter: Option<String>,
    /// Config file and `--set`.
    #[command(flatten)]
    pub layers: LayerArgs,
}

/// `stereolux info`.
#[derive(Clone, Debug, Args)]
#[command(after_help = STATUS_HELP)]
pub struct InfoArgs {
    /// Also say what this scene needs and what is left out: glTF 2.0 file or builtin:NAME
    #[arg(long, value_name = "PATH|builtin:NAME", allow_hyphen_values = true)]
    pub scene: Option<String>,
    /// Let the scene name files outside its own folder. Only for scenes whose maker you trust: whatever they name is read
    #[arg(long)]
    pub allow_outside: bool,
    /// Light transport that the scene's needs are worked out for [default: photon]
    #[arg(long, value_enum)]
    pub method: Option<Method>,
    /// Also list all settings: key, kind, default, range, unit, explanation
    #[arg(long)]
    pub settings: bool,
    /// Substring of a wgpu adapter's name; marks the adapter that would be used
    #[arg(long, value_name = "NAME", allow_hyphen_values = true)]
    pub adapter: Option<String>,
    /// Config file and `--set`.
    #[command(flatten)]
    pub layers: LayerArgs,
}

/// `stereolux view`.
#[derive(Clone, Debug, Args)]
#[command(after_help = VIEW_EXAMPLES)]
pub struct ViewArgs {
    /// Shared flags.
    #[command(flatten)]
    pub shared: SharedArgs,
    /// Recording flags.
    #[command(flatten, next_help_heading = "Recording")]
    pub recording: TraceArgs,
}

/// Why the command line did not become a [`Cli`]: help was asked for, or it is unusable.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EarlyExit {
    /// Text to print; an error is one line that starts with `error: `.
    pub text: String,
    /// 0 for help and version (print on stdout), 2 for errors (print on stderr).
    pub status: u8,
}

/// The clap command with the settings listed at the end of `--help`.
#[must_use]
pub fn command() -> clap::Command {
    let listed = |command: clap::Command, examples: &str| {
        let text = format!("{examples}\n\n{}\n{STATUS_HELP}", registry::help_text());
        command.after_long_help(StyledStr::from(text))
    };
    Cli::command()
        .mut_subcommand("run", |command| listed(command, RUN_EXAMPLES))
        .mut_subcommand("render", |command| listed(command, RENDER_EXAMPLES))
        .mut_subcommand("bench", |command| listed(command, BENCH_EXAMPLES))
        .mut_subcommand("view", |command| listed(command, VIEW_EXAMPLES))
}

/// Parses the command line; the first argument is the program's name.
///
/// # Errors
/// [`EarlyExit`] with status 0 for `--help` and `--version`, and with status 2 and one line of text for anything
/// that is not a usable command line.
pub fn parse(args: impl IntoIterator<Item = OsString>) -> Result<Cli, EarlyExit> {
    let args: Vec<OsString> = args.into_iter().collect();
    refuse_flags_as_values(&args)?;
    command()
        .try_get_matches_from(&args)
        .and_then(|matches| Cli::from_arg_matches(&matches))
        .map_err(|error| early_exit(&error, subcommand_of(&args).as_deref()))
}

/// The first argument that names a command.
fn subcommand_of(args: &[OsString]) -> Option<String> {
    let root = Cli::command();
    let found = args
        .iter()
        .skip(1)
        .find_map(|arg| root.find_subcommand(arg.to_str()?))?;
    Some(found.get_name().to_owned())
}

/// `--scene --spp 4`: values may begin with a minus sign, so clap would take `--spp` for the scene.
fn refuse_flags_as_values(args: &[OsString]) -> Result<(), EarlyExit> {
    let root = Cli::command();
    let Some(subcommand) = subcommand_of(args).and_then(|name| root.find_subcommand(name)) else {
        return Ok(());
    };
    let takes_value = |flag: &str| {
        flag.strip_prefix("--").is_some_and(|name| {
            subcommand.get_arguments().any(|argument| {
                argument.get_long() == Some(name)
                    && argument
                        .get_num_args()
                        .is_none_or(|range| range.min_values() > 0)
                    && argument.get_action().takes_values()
            })
        })
    };
    let mut at = 1;
    while let Some(arg) = args.get(at) {
        let text = arg.to_string_lossy();
        if text == "--" {
            break;
        }
        if !takes_value(&text) {
            at += 1;
            continue;
        }
        if let Some(value) = args.get(at + 1).map(|value| value.to_string_lossy())
            && value.starts_with("--")
        {
            let text = format!(
                "error: {text} needs a value, but {} follows; see `stereolux {} --help`",
                super::quoted(&value),
                subcommand.get_name()
            );
            return Err(EarlyExit { text, status: 2 });
        }
        at += 2;
    }
    Ok(())
}

/// Folds clap's report of several paragraphs into one line.
fn early_exit(error: &clap::Error, subcommand: Option<&str>) -> EarlyExit {
    let rendered = error.render().to_string();
    if matches!(
        error.kind(),
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion
    ) {
        return EarlyExit {
            text: rendered,
            status: 0,
        };
    }
    let commands = || {
        let root = Cli::command();
        let names: Vec<_> = root
            .get_subcommands()
            .map(clap::Command::get_name)
            .collect();
        names.join(", ")
    };
    if matches!(
        error.kind(),
        ErrorKind::MissingSubcommand | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand
    ) {
        let text = format!(
            "error: no command given; give one of {}; see `stereolux --help`",
            commands()
        );
        return EarlyExit { text, status: 2 };
    }
    let mut parts: Vec<String> = Vec::new();
    for paragraph in rendered.split("\n\n") {
        let words: Vec<&str> = paragraph.split_whitespace().collect();
        let line = words.join(" ");
        if line.is_empty() || line.starts_with("Usage:") || line.starts_with("For more information")
        {
            continue;
        }
        parts.push(line);
    }
    let mut text = parts.join("; ").replace("; tip: ", "; ");
    if !text.starts_with("error:") {
        text.insert_str(0, "error: ");
    }
    if error.kind() == ErrorKind::InvalidSubcommand {
        text.push_str(&format!("; the commands are {}", commands()));
    }
    let of = subcommand.map_or(String::new(), |name| format!("{name} "));
    text.push_str(&format!("; see `stereolux {of}--help`"));
    EarlyExit { text, status: 2 }
}
