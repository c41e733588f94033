//! Flags as typed into checked options, one struct per command.

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use glam::DQuat;

use super::cli::{
    BenchArgs, Cli, Command, CompareArgs, Eyes, InfoArgs, LayerArgs, RenderArgs, RunArgs,
    SessionArgs, SessionChoice, SharedArgs, Suite, TraceArgs, TraceUp, ViewArgs,
};
use super::layers::Layers;
use super::numbers::{self, FovAngles, HeadPose};
use super::settings::{LimitsSettings, Settings};
use super::{OptionsError, quoted};

/// Frames of a simulated session without `--frames`.
pub const SIMULATED_FRAMES: u32 = 100;
/// Largest `--ipd` in metres: scenes may be a hundred kilometres across, eyes on stalks are not absurd.
pub const MAX_IPD_M: f64 = 1e3;

/// A command with its checked options.
#[derive(Clone, Debug, PartialEq)]
pub enum Options {
    /// `run`.
    Run(Box<RunOptions>),
    /// `render`.
    Render(Box<RenderOptions>),
    /// `compare`.
    Compare(CompareOptions),
    /// `bench`.
    Bench(Box<BenchOptions>),
    /// `info`.
    Info(Box<InfoOptions>),
    /// `view`.
    View(Box<ViewOptions>),
}

/// What the recorded body frame of a trace is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TraceBody {
    /// x right, y up, z back.
    Openxr,
    /// x right, y down, z forward.
    Optical,
    /// Any rotation `eye_from_body`, unit length.
    EyeFromBody(DQuat),
}

/// A trace to replay. `None` in a field leaves the choice to the trace's format.
#[derive(Clone, Debug, PartialEq)]
pub struct TraceOptions {
    /// The file.
    pub path: PathBuf,
    /// World up; formats' default: z for TUM and EuRoC, y for native.
    pub up: Option<TraceUp>,
    /// Body frame; formats' default: optical for TUM, the vehicles' IMU for EuRoC.
    pub body: Option<TraceBody>,
    /// Whether to move the first pose onto the scene's starting pose; formats' default: true for TUM and EuRoC.
    pub recenter: Option<bool>,
}

/// Options of `run`.
#[derive(Clone, Debug, PartialEq)]
pub struct RunOptions {
    /// All settings.
    pub settings: Settings,
    /// Output directory.
    pub out: PathBuf,
    /// Source of poses; [`SessionChoice::Auto`] only without a trace.
    pub session: SessionChoice,
    /// The trace; `Some` exactly if `session` is [`SessionChoice::Replay`].
    pub trace: Option<TraceOptions>,
    /// Where to record the views used.
    pub record: Option<PathBuf>,
    /// `--frames`, 1 or more; `None`: [`SIMULATED_FRAMES`] when simulated, the whole trace, until OpenXR ends.
    pub frames: Option<u32>,
    /// Images are written of frames whose index is a multiple of this; 1 or more.
    pub every: u32,
    /// Pace replay and simulation at the refresh rate.
    pub realtime: bool,
    /// Show the images in a window.
    pub mirror: bool,
}

/// Options of `render`.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderOptions {
    /// All settings.
    pub settings: Settings,
    /// Output directory.
    pub out: PathBuf,
    /// Head pose; `None`: the scene's starting pose.
    pub pose: Option<HeadPose>,
    /// Distance between the eyes in metres, 0 to [`MAX_IPD_M`]; `None`: the headset's.
    pub ipd_m: Option<f64>,
    /// Angles of both eyes; `None`: the headset's.
    pub fov: Option<FovAngles>,
    /// Eyes to render.
    pub eyes: Eyes,
}

/// Options of `compare`.
#[derive(Clone, Debug, PartialEq)]
pub struct CompareOptions {
    /// Image to judge.
    pub image: PathBuf,
    /// Reference.
    pub reference: PathBuf,
    /// Relative MSE above which the exit status is 1; finite, 0 or more.
    pub max_rel_mse: Option<f64>,
    /// Mask: white pixels count.
    pub mask: Option<PathBuf>,
    /// Exposure factor for FLIP, above 0.
    pub exposure: f64,
    /// Pixels per degree for FLIP, 1 to 1000.
    pub pixels_per_degree: f64,
    /// What reading the images may cost.
    pub limits: LimitsSettings,
}

/// Options of `bench`.
#[derive(Clone, Debug, PartialEq)]
pub struct BenchOptions {
    /// All settings, under those that the suite sets.
    pub settings: Settings,
    /// Suite.
    pub suite: Suite,
    /// Report directory.
    pub out: PathBuf,
    /// Scenes; empty: the suite's own.
    pub scenes: Vec<String>,
    /// Rounds, 1 or more; `None`: the suite's own number.
    pub rounds: Option<u32>,
    /// Frames of the recorded trace, 1 or more; `None`: the suite's own number.
    pub frames: Option<u32>,
    /// Most samples per pixel of a reference; `None`: the suite's own number.
    pub reference_spp: Option<u32>,
    /// Where references are kept; `None`: below `out`.
    pub references: Option<PathBuf>,
}

/// Options of `info`.
#[derive(Clone, Debug, PartialEq)]
pub struct InfoOptions {
    /// All settings.
    pub settings: Settings,
    /// Scene to analyse; `Some` if a flag, `--set` or the config file names one.
    pub scene: Option<String>,
    /// List all settings.
    pub list_settings: bool,
}

/// Options of `view`.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewOptions {
    /// All settings.
    pub settings: Settings,
    /// Views to play.
    pub trace: Option<TraceOptions>,
    /// Output directory, for screenshots and what is saved.
    pub out: PathBuf,
}

/// Checks a command line as a whole. Reads the config file, opens nothing else.
///
/// # Errors
/// [`OptionsError`], one line; exit status 2.
pub fn resolve(cli: Cli) -> Result<Options, OptionsError> {
    Ok(match cli.command {
        Command::Run(args) => Options::Run(Box::new(resolve_run(args)?)),
        Command::Render(args) => Options::Render(Box::new(resolve_render(args)?)),
        Command::Compare(args) => Options::Compare(resolve_compare(args)?),
        Command::Bench(args) => Options::Bench(Box::new(resolve_bench(args)?)),
        Command::Info(args) => Options::Info(Box::new(resolve_info(args)?)),
        Command::View(args) => Options::View(Box::new(resolve_view(args)?)),
    })
}

fn base_layers(args: &LayerArgs) -> Result<Layers, OptionsError> {
    let mut layers = Layers::default();
    if let Some(path) = &args.config {
        layers.add_file(path)?;
    }
    for argument in &args.set {
        layers.add_set(argument)?;
    }
    Ok(layers)
}

/// The word of a flag's choice, the same as the setting's.
fn word(choice: Option<impl ValueEnum>) -> Option<String> {
    Some(choice?.to_possible_value()?.get_name().to_owned())
}

fn put(
    layers: &mut Layers,
    flag: &'static str,
    key: &str,
    value: Option<impl AsRef<str>>,
) -> Result<(), OptionsError> {
    match value {
        Some(value) => layers.add_flag(flag, key, value.as_ref()),
        None => Ok(()),
    }
}

fn put_outside(layers: &mut Layers, is_allowed: bool) -> Result<(), OptionsError> {
    let word = is_allowed.then_some("true");
    put(layers, "--allow-outside", "limits.allow_outside", word)
}

fn shared_layers(args: &SharedArgs) -> Result<Layers, OptionsError> {
    let mut layers = base_layers(&args.layers)?;
    put(&mut layers, "--scene", "scene", args.scene.as_ref())?;
    put_outside(&mut layers, args.allow_outside)?;
    put(&mut layers, "--method", "method", word(args.method))?;
    put(&mut layers, "--reuse", "reuse", word(args.reuse))?;
    put(
        &mut layers,
        "--photons",
        "photon.count",
        args.photons.as_ref(),
    )?;
    put(
        &mut layers,
        "--radius",
        "photon.radius_m",
        args.radius.as_ref(),
    )?;
    put(&mut layers, "--spp", "spp", args.spp.as_ref())?;
    put(&mut layers, "--size", "size", args.size.as_ref())?;
    put(&mut layers, "--headset", "headset", args.headset.as_ref())?;
    put(&mut layers, "--seed", "seed", args.seed.as_ref())?;
    put(&mut layers, "--adapter", "adapter", args.adapter.as_ref())?;
    require_path("--out", &args.out)?;
    Ok(layers)
}

fn require_path(flag: &'static str, path: &Path) -> Result<(), OptionsError> {
    if path.as_os_str().is_empty() {
        return Err(OptionsError::BadFlag {
            flag,
            value: "\"\"".to_owned(),
            reason: "the path is empty".to_owned(),
        });
    }
    Ok(())
}

fn bad(flag: &'static str, value: &str, reason: impl Into<String>) -> OptionsError {
    OptionsError::BadFlag {
        flag,
        value: quoted(value),
        reason: reason.into(),
    }
}

fn count(flag: &'static str, text: Option<&String>) -> Result<Option<u32>, OptionsError> {
    let Some(text) = text else { return Ok(None) };
    match text.trim().parse::<u32>() {
        Ok(number) if number > 0 => Ok(Some(number)),
        _ => Err(bad(
            flag,
            text,
            format!("must be a whole number from 1 to {}", u32::MAX),
        )),
    }
}

fn real(
    flag: &'static str,
    text: &str,
    allowed: impl Fn(f64) -> bool,
    words: &str,
) -> Result<f64, OptionsError> {
    match text.trim().parse::<f64>() {
        Ok(number) if number.is_finite() && allowed(number) => Ok(number + 0.0),
        _ => Err(bad(flag, text, format!("must be {words}"))),
    }
}

fn resolve_run(args: RunArgs) -> Result<RunOptions, OptionsError> {
    let mut layers = shared_layers(&args.shared)?;
    let flags = args.session;
    put(
        &mut layers,
        "--motion",
        "simulated.motion",
        word(flags.motion),
    )?;
    let frames = count("--frames", flags.frames.as_ref())?;
    let every = count("--every", flags.every.as_ref())?.unwrap_or(1);
    let session = session(&flags)?;
    let trace = trace(&flags.recording)?;
    if let Some(record) = &flags.record {
        require_path("--record", record)?;
        if flags.recording.trace.as_ref() == Some(record) {
            return Err(OptionsError::Conflict(format!(
                "--record {} is the file that --trace reads; give --record another name",
                quoted(&record.to_string_lossy())
            )));
        }
    }
    Ok(RunOptions {
        settings: layers.finish()?,
        out: args.shared.out,
        session,
        trace,
        record: flags.record,
        frames,
        every,
        realtime: flags.realtime,
        mirror: flags.mirror,
    })
}

fn session(flags: &SessionArgs) -> Result<SessionChoice, OptionsError> {
    let conflict = |text: &str| Err(OptionsError::Conflict(text.to_owned()));
    let session = match (flags.session, flags.recording.trace.is_some()) {
        (SessionChoice::Auto, true) => SessionChoice::Replay,
        (SessionChoice::Replay, false) => {
            return conflict("--session replay needs a recording; add --trace FILE");
        }
        (SessionChoice::Simulated, true) => {
            return conflict(
                "--trace does not go with --session simulated; give --session replay or leave one out",
            );
        }
        (SessionChoice::Openxr, true) => {
            return conflict(
                "--trace does not go with --session openxr; give --session replay or leave one out",
            );
        }
        (chosen, _) => chosen,
    };
    if flags.motion.is_some() && matches!(session, SessionChoice::Replay | SessionChoice::Openxr) {
        return conflict(
            "--motion moves the simulated headset; give --session simulated or leave --motion out",
        );
    }
    if flags.realtime && session == SessionChoice::Openxr {
        return conflict(
            "--realtime paces replay and simulation; an OpenXR runtime sets its own pace, leave it out",
        );
    }
    Ok(session)
}

fn trace(flags: &TraceArgs) -> Result<Option<TraceOptions>, OptionsError> {
    let Some(path) = flags.trace.clone() else {
        for (given, flag) in [
            (flags.trace_up.is_some(), "--trace-up"),
            (flags.trace_body.is_some(), "--trace-body"),
            (flags.trace_recenter.is_some(), "--trace-recenter"),
        ] {
            if given {
                return Err(OptionsError::Conflict(format!(
                    "{flag} needs a recording to apply to; add --trace FILE"
                )));
            }
        }
        return Ok(None);
    };
    require_path("--trace", &path)?;
    let body = match flags.trace_body.as_deref() {
        None => None,
        Some("openxr") => Some(TraceBody::Openxr),
        Some("optical") => Some(TraceBody::Optical),
        Some(text) => Some(
            numbers::numbers::<4>(text, "openxr, optical or qx qy qz qw")
                .and_then(numbers::quaternion)
                .map(TraceBody::EyeFromBody)
                .map_err(|reason| bad("--trace-body", text, reason))?,
        ),
    };
    Ok(Some(TraceOptions {
        path,
        up: flags.trace_up,
        body,
        recenter: flags.trace_recenter,
    }))
}

fn resolve_render(args: RenderArgs) -> Result<RenderOptions, OptionsError> {
    let settings = shared_layers(&args.shared)?.finish()?;
    let view = args.view;
    let pose = view
        .pose
        .map(|text| numbers::pose(&text).map_err(|reason| bad("--pose", &text, reason)))
        .transpose()?;
    let fov = view
        .fov
        .map(|text| numbers::fov(&text).map_err(|reason| bad("--fov", &text, reason)))
        .transpose()?;
    let ipd_m = view
        .ipd
        .map(|text| {
            let words = format!("a distance in metres from 0 to {MAX_IPD_M}");
            real(
                "--ipd",
                &text,
                |ipd| (0.0..=MAX_IPD_M).contains(&ipd),
                &words,
            )
        })
        .transpose()?;
    Ok(RenderOptions {
        settings,
        out: args.shared.out,
        pose,
        ipd_m,
        fov,
        eyes: view.eyes,
    })
}

fn resolve_compare(args: CompareArgs) -> Result<CompareOptions, OptionsError> {
    let max_rel_mse = args
        .max_rel_mse
        .map(|text| {
            real(
                "--max-rel-mse",
                &text,
                |limit| limit >= 0.0,
                "a number, 0 or more",
            )
        })
        .transpose()?;
    let exposure = real(
        "--exposure",
        &args.exposure,
        |exposure| exposure > 0.0 && exposure <= 1e9,
        "a number above 0 and at most 1e9",
    )?;
    let pixels_per_degree = real(
        "--pixels-per-degree",
        &args.pixels_per_degree,
        |ppd| (1.0..=1000.0).contains(&ppd),
        "a number from 1 to 1000",
    )?;
    Ok(CompareOptions {
        limits: base_layers(&args.layers)?.finish()?.limits,
        image: args.image,
        reference: args.reference,
        max_rel_mse,
        mask: args.mask,
        exposure,
        pixels_per_degree,
    })
}

fn resolve_bench(args: BenchArgs) -> Result<BenchOptions, OptionsError> {
    const MOST_ROUNDS: u32 = 100_000;
    const REFERENCE_SAMPLES: std::ops::RangeInclusive<u32> = 16..=1 << 24;
    let mut layers = base_layers(&args.layers)?;
    put_outside(&mut layers, args.allow_outside)?;
    put(&mut layers, "--size", "size", args.size.as_ref())?;
    put(&mut layers, "--adapter", "adapter", args.adapter.as_ref())?;
    require_path("--out", &args.out)?;
    if let Some(references) = &args.references {
        require_path("--references", references)?;
    }
    if args.scene.iter().any(String::is_empty) {
        return Err(bad("--scene", "", "must be a glTF file or builtin:NAME"));
    }
    let within = |flag, text: Option<&String>, range: std::ops::RangeInclusive<u32>| {
        let number = count(flag, text)?;
        match (number, text) {
            (Some(number), Some(text)) if !range.contains(&number) => Err(bad(
                flag,
                text,
                format!(
                    "must be a whole number from {} to {}",
                    range.start(),
                    range.end()
                ),
            )),
            _ => Ok(number),
        }
    };
    let rounds = within("--rounds", args.rounds.as_ref(), 1..=MOST_ROUNDS)?;
    let frames = within("--frames", args.frames.as_ref(), 1..=MOST_ROUNDS)?;
    let reference_spp = within(
        "--reference-spp",
        args.reference_spp.as_ref(),
        REFERENCE_SAMPLES,
    )?;
    let named = layers.is_set("scene");
    let settings = layers.finish()?;
    let scenes = match args.scene {
        // A scene from --set or the config file is the one to measure, too.
        scenes if scenes.is_empty() && named => vec![settings.scene.clone()],
        scenes => scenes,
    };
    Ok(BenchOptions {
        settings,
        suite: args.suite,
        out: args.out,
        scenes,
        rounds,
        frames,
        reference_spp,
        references: args.references,
    })
}

fn resolve_info(args: InfoArgs) -> Result<InfoOptions, OptionsError> {
    let mut layers = base_layers(&args.layers)?;
    put(&mut layers, "--scene", "scene", args.scene.as_ref())?;
    put_outside(&mut layers, args.allow_outside)?;
    put(&mut layers, "--method", "method", word(args.method))?;
    put(&mut layers, "--adapter", "adapter", args.adapter.as_ref())?;
    let named = layers.is_set("scene");
    let settings = layers.finish()?;
    let scene = named.then(|| settings.scene.clone());
    Ok(InfoOptions {
        settings,
        scene,
        list_settings: args.settings,
    })
}

fn resolve_view(args: ViewArgs) -> Result<ViewOptions, OptionsError> {
    Ok(ViewOptions {
        settings: shared_layers(&args.shared)?.finish()?,
        trace: trace(&args.recording)?,
        out: args.shared.out,
    })
}
