//! What each command does, once its options are known to be usable.

/// A line on stderr. That nobody reads it any more is no reason to end, as it is for `eprintln!`.
macro_rules! eprint_line {
    ($($part:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr(), $($part)*);
    }};
}

#[cfg(feature = "bench")]
mod bench;
mod compare;
mod info;
mod merge;
mod new;
mod progress;
mod report;
mod run;
mod settings;
mod source;
#[cfg(feature = "viewer")]
mod view;

use std::ffi::OsString;
use std::io::{ErrorKind, Write as _};
use std::process::ExitCode;

use crate::app::{App, SceneAlone};
use crate::frame_loop::LoopError;
use crate::gpu::GpuError;
use crate::gpu::vulkan_interop::{disable_device_select_layer, quiet_openxr_loader};
use crate::images::ImageError;
use crate::metrics::CompareError;
use crate::mirror::MirrorError;
use crate::options::{EarlyExit, Options, parse, parse_run};
use crate::output::OutputError;
use crate::printable::escaped;
use crate::renderer::RenderError;
use crate::scene::SceneError;
use crate::scene_loading::Loaded;
use crate::settings::Settings;
use crate::xr::XrError;

/// The whole program: flags to checked options to a command; errors to an exit status.
pub fn main() -> ExitCode {
    start_with(|| parse(std::env::args_os()), execute)
}

/// Runs an application with the flags of `stereolux run`: `defaults` as they stand on a command line, and over them those
/// that the program was started with. Sessions, recordings, files and exit status are as of `stereolux run`.
pub fn run_app(app: &mut dyn App, defaults: &[&str]) -> ExitCode {
    run_app_with(app, defaults, std::env::args_os())
}

/// As [`run_app`], with other arguments than the program's own; the first is its name.
pub fn run_app_with(
    app: &mut dyn App,
    defaults: &[&str],
    args: impl IntoIterator<Item = OsString>,
) -> ExitCode {
    let options = || parse_run(defaults, args);
    start_with(options, |options| run::run(&options, app).map(|()| 0))
}

/// Carries out what the command line asks for; errors become an exit status.
fn start_with<T>(
    options: impl FnOnce() -> Result<T, EarlyExit>,
    execute: impl FnOnce(T) -> Result<u8, Failure>,
) -> ExitCode {
    // First of all: they do nothing once there is another thread, such as reads a pipe.
    disable_device_select_layer();
    quiet_openxr_loader();
    start_log();
    let options = match options() {
        Ok(options) => options,
        Err(exit) => {
            if exit.status == 0 {
                // A closed pipe is the reader's choice.
                let _ = write!(std::io::stdout(), "{}", exit.text);
                return ExitCode::SUCCESS;
            }
            eprint_line!("{}", exit.text.trim_end());
            return ExitCode::from(exit.status);
        }
    };
    match execute(options) {
        Ok(status) => ExitCode::from(status),
        Err(failure) => {
            eprint_line!("error: {}", failure.message);
            ExitCode::from(failure.status)
        }
    }
}

/// Why a command ends: the text on stderr and the exit status.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Failure {
    /// 1: failed while running; 2: unusable arguments or input.
    pub status: u8,
    /// One line: what, where, how to mend it.
    pub message: String,
}

impl Failure {
    /// Unusable arguments or input.
    pub fn unusable(message: impl ToString) -> Self {
        Self {
            status: 2,
            message: escaped(&message.to_string()),
        }
    }

    /// Failed while running.
    pub fn failed(message: impl ToString) -> Self {
        Self {
            status: 1,
            message: escaped(&message.to_string()),
        }
    }
}

/// Prints a result on stdout. A reader that leaves early, such as `head`, is no failure.
fn print_line(text: &str) -> Result<(), Failure> {
    match writeln!(std::io::stdout(), "{text}") {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(Failure::failed(format!("stdout: {error}")))
        }
        _ => Ok(()),
    }
}

macro_rules! unusable {
    ($($error:ty),+) => {$(
        impl From<$error> for Failure {
            fn from(error: $error) -> Self {
                Self::unusable(error)
            }
        }
    )+};
}

unusable! { SceneError, OutputError, ImageError, CompareError, MirrorError }

impl From<XrError> for Failure {
    fn from(error: XrError) -> Self {
        if error.is_unusable_input() {
            Self::unusable(error)
        } else {
            Self::failed(error)
        }
    }
}

#[cfg(not(target_vendor = "apple"))]
impl From<crate::xr::openxr::RuntimeError> for Failure {
    fn from(error: crate::xr::openxr::RuntimeError) -> Self {
        use crate::xr::openxr::RuntimeError;
        match error {
            RuntimeError::Gpu(error) => error.into(),
            error if error.is_unusable_input() => Self::unusable(error),
            error => Self::failed(error),
        }
    }
}

#[cfg(feature = "viewer")]
impl From<crate::viewer::ViewError> for Failure {
    fn from(error: crate::viewer::ViewError) -> Self {
        use crate::viewer::ViewError;
        match error {
            ViewError::Gpu(error) => error.into(),
            ViewError::NoWindow(_) | ViewError::CannotShow { .. } => Self::unusable(error),
            ViewError::Ended(_) => Self::failed(error),
        }
    }
}

impl From<GpuError> for Failure {
    fn from(error: GpuError) -> Self {
        match error {
            GpuError::NoMatchingAdapter { .. }
            | GpuError::Missing { .. }
            | GpuError::UserPass(_)
            | GpuError::TooLarge { .. }
            | GpuError::TooManyBuffers { .. } => Self::unusable(error),
            _ => Self::failed(error),
        }
    }
}

impl From<RenderError> for Failure {
    fn from(error: RenderError) -> Self {
        match error {
            RenderError::Gpu(error) => error.into(),
            RenderError::Bvh(error) => Self::unusable(error),
            RenderError::Pack(error) => Self::unusable(error),
            RenderError::Settings(_) | RenderError::Scene(_) => Self::unusable(error),
            RenderError::Interrupted => Self::failed(error),
        }
    }
}

impl From<LoopError> for Failure {
    fn from(error: LoopError) -> Self {
        match error {
            LoopError::Session(error) => error.into(),
            LoopError::Render(error) => error.into(),
            // The folder was writable when the run began.
            LoopError::Output(error) => Self::failed(error),
            LoopError::App(_) => Self::failed(error),
        }
    }
}

#[cfg(feature = "bench")]
impl From<crate::bench::BenchError> for Failure {
    fn from(error: crate::bench::BenchError) -> Self {
        use crate::bench::BenchError;
        use stereolux_report::ReportError;
        match error {
            BenchError::Scene(error) => error.into(),
            BenchError::Xr(error) => error.into(),
            BenchError::Render(error) => error.into(),
            BenchError::Shaders(_)
            | BenchError::Out { .. }
            | BenchError::Journal(_)
            | BenchError::Report(ReportError::Part { .. }) => Self::unusable(error),
            BenchError::Metrics(_)
            | BenchError::Image(_)
            | BenchError::Interrupted
            | BenchError::Report(_) => Self::failed(error),
        }
    }
}

/// Sends what is logged to stderr. Names out of files may be in it, so control characters are escaped.
pub fn start_log() {
    // An application may have a log of its own.
    let started = env_logger::Builder::from_env(env_logger::Env::default().default_filter_or(
        // wgpu reports each adapter quirk as a warning; what matters to a user comes back as an error.
        "warn,wgpu=error,wgpu_core=error,wgpu_hal=error,naga=error",
    ))
    .format(|out, record| {
        let (level, style) = (record.level(), out.default_level_style(record.level()));
        let text = record.args().to_string();
        let lines: Vec<String> = text.lines().map(escaped).collect();
        writeln!(out, "[{style}{level:<5}{style:#}] {}", lines.join("\n"))
    })
    .try_init();
    if started.is_err() {
        log::debug!("the log was started before");
    }
}

/// Carries out a command; the exit status of success is 0, unless `compare` finds too large an error.
///
/// # Errors
/// [`Failure`].
pub fn execute(options: Options) -> Result<u8, Failure> {
    match options {
        Options::Run(options) => run::run(&options, &mut SceneAlone).map(|()| 0),
        Options::Render(options) => run::render(&options).map(|()| 0),
        Options::Compare(options) => compare::compare(&options),
        Options::Info(options) => info::info(&options).map(|()| 0),
        Options::Merge(options) => merge::merge(&options).map(|()| 0),
        Options::New(options) => new::new(&options).map(|()| 0),
        Options::Settings(options) => settings::settings(&options).map(|()| 0),
        #[cfg(feature = "bench")]
        Options::Bench(options) => bench::bench(&options).map(|()| 0),
        #[cfg(not(feature = "bench"))]
        Options::Bench(_) => Err(not_built("bench", "bench")),
        #[cfg(feature = "viewer")]
        Options::View(options) => view::view(&options).map(|()| 0),
        #[cfg(not(feature = "viewer"))]
        Options::View(_) => Err(not_built("view", "viewer")),
    }
}

/// A command that this build was made without.
#[cfg(any(test, not(all(feature = "bench", feature = "viewer"))))]
fn not_built(command: &str, feature: &str) -> Failure {
    Failure::unusable(format!(
        "{command}: this build is without it; build with `cargo build --release --features {feature}`"
    ))
}

/// Loads the settings' scene and tells of its warnings.
fn load_scene(settings: &Settings) -> Result<Loaded, Failure> {
    let loaded = Loaded::open(settings)?;
    for warning in &loaded.scene.warnings {
        log::warn!("{warning}");
    }
    Ok(loaded)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// That `execute` says it in builds without a feature is the compiler's to check, in the headless pass of
    /// `scripts/test.sh`: its other arms do not exist there.
    #[test]
    fn a_command_that_was_not_built_names_its_feature_in_one_line() {
        for (command, feature) in [("bench", "bench"), ("view", "viewer")] {
            let Failure { status, message } = not_built(command, feature);
            assert_eq!(status, 2);
            assert!(message.starts_with(&format!("{command}: ")), "{message}");
            assert!(
                message.contains(&format!("--features {feature}`")),
                "{message}"
            );
            assert_eq!(message.lines().count(), 1, "{message}");
        }
    }
}
