//! Flags that are settings: a row names the setting, and the help is the setting's own.

use clap::{Arg, ArgMatches, Args, Command, Error, FromArgMatches};
use serde_json::Value;

use super::OptionsError;
use super::layers::Layers;
use super::values::words;
use crate::scene::builtin;
use crate::settings::registry::{self, Kind, Setting};

/// The flag, the setting's key, what stands for the value in the help, and what the help says after the setting's sentence
/// (`{scenes}` stands for the names of the embedded scenes, a default in brackets replaces the setting's).
type Row = (&'static str, &'static str, &'static str, &'static str);

/// Those of `run`, `render` and `view`.
pub(super) const SHARED: usize = 0;
/// Those of `run` besides.
pub(super) const RUN: usize = 1;
/// Those of `bench`.
pub(super) const BENCH: usize = 2;
/// Those of `info`.
pub(super) const INFO: usize = 3;
/// Those of `compare`: none.
pub(super) const COMPARE: usize = 4;

const TRUST: &str = "; only for scenes that you trust, since any file they name is read";

#[rustfmt::skip]
const ROWS: [&[Row]; 5] = [
    &[
        ("--scene", "scene", "PATH|builtin:NAME", ", with NAME one of {scenes}"),
        ("--scene-scale", "scene_scale", "FACTOR", ""),
        ("--light", "light", "LIGHT", ""),
        ("--allow-outside", "limits.allow_outside", "true|false", TRUST),
        ("--method", "method", "METHOD", ""),
        ("--reuse", "reuse", "REUSE", ""),
        ("--photons", "photon.count", "N", ""),
        ("--radius", "photon.radius_m", "M", ""),
        ("--spp", "spp", "N", ". One goes through the pixel's centre, more are spread over the pixel"),
        ("--size", "size", "WxH", ""),
        ("--headset", "headset", "NAME", ": per-eye size, FOV angles, eye poses, IPD, refresh rate"),
        ("--seed", "seed", "N", ""),
        ("--adapter", "adapter", "NAME",
            " (discrete GPU, then integrated, then software); any case, see `stereolux info`"),
    ],
    &[
        ("--motion", "simulated.motion", "MOTION", ""),
    ],
    &[
        ("--size", "size", "WxH", " [default: 256x256; smoke 32x32; motion 96x96]"),
        ("--allow-outside", "limits.allow_outside", "true|false", TRUST),
        ("--adapter", "adapter", "NAME", " (discrete GPU, then integrated, then software)"),
    ],
    &[
        ("--scene", "scene", "PATH|builtin:NAME", "; reports its needs and what is left out [default: none]"),
        ("--scene-scale", "scene_scale", "FACTOR", ""),
        ("--light", "light", "LIGHT", ""),
        ("--allow-outside", "limits.allow_outside", "true|false", TRUST),
        ("--method", "method", "METHOD", " to report the scene's needs for"),
        ("--adapter", "adapter", "NAME", "; the scene's frame is listed for it"),
    ],
    &[],
];

/// The flags of a list of [`ROWS`] as they were given.
#[derive(Clone, Debug)]
pub(super) struct SettingFlags<const LIST: usize> {
    given: Vec<(Row, String)>,
}

impl<const LIST: usize> SettingFlags<LIST> {
    /// Whether a flag was given.
    pub(super) fn has(&self, flag: &str) -> bool {
        self.given.iter().any(|((known, ..), _)| *known == flag)
    }

    /// Puts what was given on.
    pub(super) fn put_on(&self, layers: &mut Layers) -> Result<(), OptionsError> {
        for ((flag, key, ..), value) in &self.given {
            layers.add_flag(flag, key, value)?;
        }
        Ok(())
    }
}

impl<const LIST: usize> FromArgMatches for SettingFlags<LIST> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, Error> {
        let given = |row: &Row| Some((*row, matches.get_one::<String>(long(row))?.clone()));
        Ok(Self {
            given: ROWS[LIST].iter().filter_map(given).collect(),
        })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

impl<const LIST: usize> Args for SettingFlags<LIST> {
    fn augment_args(command: Command) -> Command {
        command.args(ROWS[LIST].iter().map(arg))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

/// The flag without its minus signs.
fn long((flag, ..): &Row) -> &'static str {
    flag.trim_start_matches('-')
}

/// The flag as clap takes it.
fn arg(row: &Row) -> Arg {
    let (_, key, value, more) = *row;
    let arg = Arg::new(long(row)).long(long(row)).value_name(value);
    let Some(setting) = registry::find(key) else {
        return arg;
    };
    let arg = arg.help(help(setting, more));
    match setting.kind {
        Kind::Choice {
            words: known,
            sentences,
        } => arg.value_parser(words(known, sentences)),
        // A word that follows is not the flag's.
        Kind::Bool => arg
            .num_args(0..=1)
            .require_equals(true)
            .default_missing_value("true"),
        _ => arg,
    }
}

/// The setting's sentence, range and default, and what the flag adds.
fn help(setting: &Setting, more: &str) -> String {
    let mut help = setting.doc.to_owned();
    if let Some(first) = help
        .get_mut(..1)
        .filter(|_| !setting.doc.starts_with("glTF"))
    {
        first.make_ascii_uppercase();
    }
    help += &match setting.kind {
        Kind::Whole { min, max } => format!(", {min} to {max}"),
        Kind::Size { max } => format!("; such as 512x512, each 1 to {max}"),
        Kind::Real { .. } if !setting.unit.is_empty() => format!(" ({})", setting.unit),
        _ => String::new(),
    };
    help += &more.replace("{scenes}", &builtin::NAMES.join(", "));
    match setting.default_value() {
        _ if more.contains("[default") => {}
        Value::Null => {}
        Value::String(text) if text.is_empty() => {}
        Value::String(text) => help += &format!(" [default: {text}]"),
        number => help += &format!(" [default: {}]", number.to_string().trim_end_matches(".0")),
    }
    help
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_flag_is_a_setting() {
        for (flag, key, ..) in ROWS.into_iter().flatten() {
            assert!(registry::find(key).is_some(), "{flag}: {key}");
        }
    }
}
