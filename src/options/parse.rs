//! The command line's words into [`Options`], and clap's reports into one line.

use std::error::Error as _;
use std::ffi::OsString;
use std::path::Path;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Arg, CommandFactory, FromArgMatches};

use super::cli::{
    BENCH_EXAMPLES, Cli, Options, RENDER_EXAMPLES, RUN_EXAMPLES, RunOptions, STATUS_HELP,
    VIEW_EXAMPLES,
};
use super::{OptionsError, quoted};

/// Why the command line did not become [`Options`]: help was asked for, or it is unusable.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EarlyExit {
    /// Text to print; an error is one line that starts with `error: `.
    pub text: String,
    /// 0 for help and version (print on stdout), 2 for errors (print on stderr).
    pub status: u8,
}

/// Ends the help of commands that take settings.
const SETTINGS_HELP: &str = "\
Settings for --set KEY=VALUE and for the TOML file of --config: `stereolux settings` lists them in groups,
`stereolux settings WORD` those that a word is about, config/example.toml all with their defaults.";

/// The clap command: values may begin with a minus sign.
fn command() -> clap::Command {
    let takes_any_text = |arg: &Arg| {
        arg.get_long().is_some()
            && arg.get_action().takes_values()
            && arg.get_possible_values().is_empty()
    };
    let plain = Cli::command().mut_subcommands(|command| {
        command.mut_args(|arg| {
            let may_begin_with_minus = takes_any_text(&arg);
            arg.allow_hyphen_values(may_begin_with_minus)
        })
    });
    let listings = [
        ("run", RUN_EXAMPLES),
        ("render", RENDER_EXAMPLES),
        ("bench", BENCH_EXAMPLES),
        ("view", VIEW_EXAMPLES),
    ];
    listings
        .into_iter()
        .fold(plain, |command, (name, examples)| {
            let text = format!("{examples}\n\n{SETTINGS_HELP}\n\n{STATUS_HELP}");
            command.mut_subcommand(name, |command| command.after_long_help(text))
        })
}

/// Reads the command line and checks all of it; the first argument is the program's name. Of files only the one of
/// `--config` is opened.
///
/// # Errors
/// [`EarlyExit`] with status 0 for `--help` and `--version`, and with status 2 and one line of text for anything
/// that is not a usable command line.
pub fn parse(args: impl IntoIterator<Item = OsString>) -> Result<Options, EarlyExit> {
    parse_with(command(), args.into_iter().collect())
}

fn parse_with(command: clap::Command, args: Vec<OsString>) -> Result<Options, EarlyExit> {
    refuse_flags_as_values(&args)?;
    let Cli { mut options } = command
        .try_get_matches_from(&args)
        .and_then(|matches| Cli::from_arg_matches(&matches))
        .map_err(|error| early_exit(&error, subcommand_of(&args).as_deref()))?;
    options.check()?;
    Ok(options)
}

/// The options of `stereolux run` for an application: `defaults`, and over them `args`, the program's name first. If its first
/// argument is `view`, the session is the desktop.
///
/// # Errors
/// As [`parse`].
pub fn parse_run(
    defaults: &[&str],
    args: impl IntoIterator<Item = OsString>,
) -> Result<RunOptions, EarlyExit> {
    let given: Vec<OsString> = args.into_iter().collect();
    let is_trace = |word: &OsString| {
        let word = word.to_string_lossy();
        word == "--trace" || word.starts_with("--trace=")
    };
    let replays = given.iter().any(is_trace);
    let mut given = given.into_iter().peekable();
    let program = given.next().unwrap_or_else(|| "stereolux".into());
    let mut all = vec![program, "run".into()];
    all.extend(defaults.iter().map(OsString::from));
    if replays {
        // Whatever session is the application's default.
        all.push("--session=replay".into());
    }
    if given.next_if(|word| word == "view").is_some() {
        all.push("--session=desktop".into());
    }
    all.extend(given);
    let name = Path::new(&all[0]).file_name().unwrap_or(&all[0]);
    let name = name.to_string_lossy().into_owned();
    let command = command().mut_subcommand("run", |run| {
        // The last one counts.
        run.args_override_self(true)
            .about(format!("Unless told otherwise: {}", defaults.join(" ")))
            .override_usage(format!("{name} [view] [OPTIONS]"))
    });
    let its_own = |exit: EarlyExit| EarlyExit {
        text: exit
            .text
            .replace("`stereolux run --help`", &format!("`{name} --help`")),
        ..exit
    };
    match parse_with(command, all).map_err(its_own)? {
        Options::Run(options) => Ok(*options),
        _ => Err(EarlyExit {
            text: "error: an application takes the flags of `stereolux run` and no command".into(),
            status: 2,
        }),
    }
}

impl From<OptionsError> for EarlyExit {
    fn from(error: OptionsError) -> Self {
        Self {
            text: format!("error: {error}"),
            status: 2,
        }
    }
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
                quoted(&value),
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
    if let Some(error) = refused_value(error) {
        return error.into();
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

/// What a flag's own check says of its value.
fn refused_value(error: &clap::Error) -> Option<OptionsError> {
    let text = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => Some(text.as_str()),
        _ => None,
    };
    if error.kind() != ErrorKind::ValueValidation {
        return None;
    }
    let flag = text(ContextKind::InvalidArg)?.split(' ').next()?;
    Some(OptionsError::BadFlag {
        flag: flag.to_owned(),
        value: quoted(text(ContextKind::InvalidValue)?),
        reason: error.source()?.to_string(),
    })
}
