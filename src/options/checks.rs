//! What concerns several flags together, and the settings that they make.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use super::cli::{
    BenchOptions, InfoOptions, LayerArgs, Options, RunOptions, SessionChoice, SessionOptions,
    SharedOptions, Suite, TraceOptions,
};
use super::layers::Layers;
use super::{OptionsError, quoted};
use crate::output::is_taken;
use crate::settings::{Light, Settings};
use crate::xr::trace::begins_as_recording;

impl Options {
    /// Checks the flags as a whole, and fills the settings in.
    ///
    /// # Errors
    /// [`OptionsError`], one line.
    pub(super) fn check(&mut self) -> Result<(), OptionsError> {
        match self {
            Self::Run(options) => options.check()?,
            Self::Render(options) => {
                let layers = options.shared.layers.read()?;
                options.names_headset = layers.is_set("headset");
                options.settings = layers.finish()?;
                let inputs = options.shared.inputs(&options.settings);
                keeps_inputs(&inputs, None, &options.shared.out)?;
            }
            Self::Compare(options) => options.limits = options.layers.read()?.finish()?.limits,
            Self::Bench(options) => options.check()?,
            Self::Info(options) => options.check()?,
            Self::Settings(_) | Self::Merge(_) | Self::New(_) => {}
            Self::View(options) => {
                let layers = options.shared.layers.read()?;
                let lights = layers.is_set("light");
                options.settings = layers.finish()?;
                if !lights {
                    options.settings.light = Light::Auto;
                }
                options.recording.check()?;
            }
        }
        Ok(())
    }
}

impl SharedOptions {
    /// Files that are read, and what names them.
    fn inputs<'a>(&'a self, settings: &'a Settings) -> Vec<(&'static str, &'a Path)> {
        let config = self
            .layers
            .config
            .iter()
            .map(|path| ("--config", path.as_path()));
        let named = [
            ("--scene", &settings.scene),
            ("environment.path", &settings.environment.path),
            ("headset", &settings.headset),
        ];
        let named = named.map(|(name, path)| (name, Path::new(path)));
        config.chain(named).collect()
    }
}

/// Refuses a recording over what is read, and what is read, or recorded, under names in `out` that a run clears and writes itself.
fn keeps_inputs(
    inputs: &[(&'static str, &Path)],
    record: Option<&Path>,
    out: &Path,
) -> Result<(), OptionsError> {
    let out_itself = resolved(out);
    let is_lost = |path: &Path| {
        let taken = path
            .file_name()
            .and_then(OsStr::to_str)
            .is_some_and(is_taken);
        taken && path.parent() == Some(&out_itself)
    };
    let refused = |name: &str, path: &Path, why: &str| {
        let path = quoted(&path.to_string_lossy());
        Err(OptionsError::Conflict(format!("{name} {path} {why}")))
    };
    let recorded = record.map(|path| (path, resolved(path)));
    if let Some((path, file)) = &recorded
        && is_lost(file)
    {
        return refused(
            "--record",
            path,
            "is a file that the run writes to --out itself; give it another name",
        );
    }
    // Whatever else the run may read, a script of hands or a scene's images, is none either.
    if let Some((path, file)) = &recorded
        && file.is_file()
        && !begins_as_recording(file).unwrap_or(true)
    {
        let why = "is there and is not a recording; give --record another name";
        return refused("--record", path, why);
    }
    for (name, path) in inputs {
        let file = resolved(path);
        if let Some((path, recorded)) = &recorded
            && is_one_file(&file, recorded)
        {
            let why = format!("is the file that {name} reads; give --record another name");
            return refused("--record", path, &why);
        }
        if path.is_file() && is_lost(&file) {
            return refused(
                name,
                path,
                "lies in --out under a name that a run clears and writes; give --out another folder",
            );
        }
    }
    Ok(())
}

/// Whether two resolved names lead to one file, also by hard links.
fn is_one_file(a: &Path, b: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt as _;
        let number = |path: &Path| path.metadata().ok().map(|about| (about.dev(), about.ino()));
        if number(a).is_some_and(|file| number(b) == Some(file)) {
            return true;
        }
    }
    a == b
}

/// The file or folder itself, whatever leads to it; one that is still to be made by the folder that it will be in.
fn resolved(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| {
        let folder = path.parent().filter(|folder| *folder != Path::new(""));
        let folder = folder.unwrap_or(Path::new(".")).canonicalize();
        match (folder, path.file_name()) {
            (Ok(folder), Some(name)) => folder.join(name),
            _ => path.to_owned(),
        }
    })
}

impl<const FLAGS: usize> LayerArgs<FLAGS> {
    fn read(&self) -> Result<Layers, OptionsError> {
        let mut layers = Layers::default();
        if let Some(path) = &self.config {
            layers.add_file(path)?;
        }
        for argument in &self.set {
            layers.add_set(argument)?;
        }
        self.flags.put_on(&mut layers)?;
        Ok(layers)
    }
}

impl RunOptions {
    fn check(&mut self) -> Result<(), OptionsError> {
        let mut layers = self.shared.layers.read()?;
        self.session.flags.put_on(&mut layers)?;
        self.session.check()?;
        self.names_reuse = layers.is_set("reuse");
        self.settings = layers.finish()?;
        let recording = &self.session.recording;
        let trace = recording
            .trace
            .iter()
            .map(|path| ("--trace", path.as_path()));
        let inputs: Vec<_> = self
            .shared
            .inputs(&self.settings)
            .into_iter()
            .chain(trace)
            .collect();
        keeps_inputs(&inputs, self.session.record.as_deref(), &self.shared.out)
    }
}

impl SessionOptions {
    fn check(&mut self) -> Result<(), OptionsError> {
        let conflict = |text: &str| Err(OptionsError::Conflict(text.to_owned()));
        self.choice = match (self.choice, self.recording.trace.is_some()) {
            (SessionChoice::Auto, true) => SessionChoice::Replay,
            (SessionChoice::Replay, false) => {
                return conflict("--session replay needs a recording; add --trace FILE");
            }
            (chosen, true) if chosen != SessionChoice::Replay => {
                return conflict(&format!(
                    "--trace and --session {chosen} exclude each other; give --session replay or leave one out"
                ));
            }
            (chosen, _) => chosen,
        };
        if self.flags.has("--motion")
            && matches!(
                self.choice,
                SessionChoice::Replay | SessionChoice::Openxr | SessionChoice::Desktop
            )
        {
            return conflict(
                "--motion moves the simulated headset; give --session simulated or leave --motion out",
            );
        }
        if self.pose.is_some() && self.recording.trace_recenter == Some(false) {
            return conflict(
                "--pose is where a recording starts, and --trace-recenter=false leaves it where it is; leave one out",
            );
        }
        if let Some(range) = &self.range {
            if self.choice == SessionChoice::Desktop {
                return conflict(
                    "--range cuts a recording or a simulation; a window shows every frame, leave it out",
                );
            }
            if self.choice == SessionChoice::Openxr {
                return conflict(
                    "--range cuts a recording or a simulation; an OpenXR runtime shows every frame, leave it out",
                );
            }
            if self.record.is_some() {
                return conflict(
                    "--range renders some frames and --record writes down all; leave one out",
                );
            }
            self.frames.get_or_insert(range.end);
        } else if self.warm_up != 0 {
            return conflict("--warm-up is for --range; leave it out, or say which range");
        }
        if self.realtime && self.choice == SessionChoice::Openxr {
            return conflict(
                "--realtime paces replay and simulation; an OpenXR runtime sets its own pace, leave it out",
            );
        }
        let wants_simulation = self.range.is_some() || self.realtime || self.flags.has("--motion");
        if self.choice == SessionChoice::Auto && wants_simulation {
            // Not a headset that happens to be there.
            self.choice = SessionChoice::Simulated;
        }
        self.recording.check()?;
        Ok(())
    }
}

impl TraceOptions {
    fn check(&self) -> Result<(), OptionsError> {
        let given = [
            (self.trace_up.is_some(), "--trace-up"),
            (self.trace_body.is_some(), "--trace-body"),
            (self.trace_recenter.is_some(), "--trace-recenter"),
        ];
        match given.iter().find(|(is_given, _)| *is_given) {
            Some((_, flag)) if self.trace.is_none() => Err(OptionsError::Conflict(format!(
                "{flag} needs a recording to apply to; add --trace FILE"
            ))),
            _ => Ok(()),
        }
    }
}

impl BenchOptions {
    fn check(&mut self) -> Result<(), OptionsError> {
        let layers = self.layers.read()?;
        let is_named = layers.is_set("scene");
        let names_headset = layers.is_set("headset");
        self.settings = layers.finish()?;
        if self.suite == Suite::Work && !names_headset {
            self.settings.headset = "quest3".to_owned();
        }
        if self.suite == Suite::Motion && self.shard.is_some() {
            return Err(OptionsError::Conflict(
                "bench motion has no parts; leave --shard out, or share out its scenes".to_owned(),
            ));
        }
        let of_others = [
            (self.rounds.is_some(), "--rounds"),
            (self.frames.is_some(), "--frames"),
            (self.reference_spp.is_some(), "--reference-spp"),
            (self.references.is_some(), "--references"),
            (self.shard.is_some(), "--shard"),
        ];
        if let Some((_, flag)) = of_others.iter().find(|(is_given, _)| *is_given)
            && self.suite == Suite::Work
        {
            return Err(OptionsError::Conflict(format!(
                "bench work counts one frame of each scene and method; leave {flag} out"
            )));
        }
        if self.scenes.is_empty() && is_named {
            // A scene from --set or the config file is the one to measure, too.
            self.scenes.push(self.settings.scene.clone());
        }
        Ok(())
    }
}

impl InfoOptions {
    fn check(&mut self) -> Result<(), OptionsError> {
        let layers = self.layers.read()?;
        self.names_scene = layers.is_set("scene");
        self.settings = layers.finish()?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::folders::Folder;

    #[test]
    fn nothing_that_is_read_is_written_over() {
        let folder = Folder::new("inputs");
        let at = |name: &str| folder.join(name);
        std::fs::create_dir_all(at("out")).unwrap();
        let [trace, cleared, kept] = ["walk.jsonl", "out/frame_0000_left.exr", "out/sky.exr"]
            .map(|name| folder.write(name, ""));
        folder.write("hands.toml", "[[left]]\n");
        folder.write("old.jsonl", r#"{"format":"stereolux-trace","version":1}"#);
        let check = |input: &Path, record: Option<&Path>| {
            keeps_inputs(&[("--trace", input)], record, &at("out")).map_err(|e| e.to_string())
        };
        let says = |found: Result<(), String>, what: &str| {
            let message = found.unwrap_err();
            assert!(message.contains(what), "{message}");
        };
        assert_eq!(check(&trace, Some(&at("other.jsonl"))), Ok(()));
        assert_eq!(check(&trace, Some(&at("old.jsonl"))), Ok(()));
        says(check(&trace, Some(&at("hands.toml"))), "not a recording");
        // By whatever name.
        for alias in ["walk.jsonl", "./walk.jsonl", "out/../walk.jsonl"] {
            says(check(&trace, Some(&at(alias))), "that --trace reads");
        }
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(&trace, at("link.jsonl")).unwrap();
            says(check(&trace, Some(&at("link.jsonl"))), "that --trace reads");
        }
        says(check(&trace, Some(&at("out/stats.jsonl"))), "itself");
        says(check(&cleared, None), "clears");
        assert_eq!(check(&kept, Some(&at("out/walk.jsonl"))), Ok(()));
        // A builtin scene is no file, nor is a folder that is still to be made one in the way.
        let new = at("new");
        assert_eq!(
            keeps_inputs(&[("--scene", Path::new("builtin:cornell"))], None, &new),
            Ok(())
        );
        let record = new.join("run.json");
        assert!(keeps_inputs(&[], Some(&record), &new).is_err());
    }
}
