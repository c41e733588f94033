//! `new`: writes a crate with an application, a scene, a recording and a test.

use std::path::{Path, PathBuf};

use super::{Failure, print_line};
use crate::options::NewOptions;

macro_rules! files {
    ($($file:literal = $source:literal),+ $(,)?) => {
        &[$(($file, include_str!(concat!("../../assets/template/", $source)))),+]
    };
}

/// Files of the crate, and what is in them; `NAME` and `STEREOLUX` stand for what differs.
const FILES: &[(&str, &str)] = files! {
    "Cargo.toml" = "Cargo.toml.in",
    "README.md" = "README.md",
    ".gitignore" = "gitignore",
    "src/main.rs" = "src/main.rs",
    "tests/replay.rs" = "tests/replay.rs",
    "scene.gltf" = "scene.gltf",
    "hands.toml" = "hands.toml",
    "recording.jsonl" = "recording.jsonl",
    ".github/workflows/test.yml" = ".github/workflows/test.yml",
};

/// Where this program's sources were when it was built. They are on no registry.
const BUILT_FROM: &str = env!("CARGO_MANIFEST_DIR");

/// Words that cargo takes for something else than a crate.
const TAKEN: [&str; 10] = [
    "stereolux",
    "test",
    "core",
    "std",
    "alloc",
    "proc_macro",
    "build",
    "deps",
    "examples",
    "incremental",
];

/// Writes the crate.
pub fn new(options: &NewOptions) -> Result<(), Failure> {
    let folder = &options.folder;
    let name = crate_name(folder)?;
    let checkout = checkout(options.path.as_deref().unwrap_or(Path::new(BUILT_FROM)))?;
    let stereolux = format!(
        "{{ path = {}, default-features = false }}",
        toml::Value::from(checkout.display().to_string())
    );
    let is_free = match std::fs::read_dir(folder) {
        Ok(mut entries) => entries.next().is_none(),
        Err(error) => error.kind() == std::io::ErrorKind::NotFound,
    };
    if !is_free {
        return Err(Failure::unusable(format!(
            "{}: is there and not an empty folder; name one that is new",
            folder.display()
        )));
    }
    // Written beside and moved, so that there is a whole crate or none.
    let partial = folder.with_file_name(format!(".{name}.part{}", std::process::id()));
    let written = write(&partial, &name, &stereolux, &checkout)
        .and_then(|()| std::fs::rename(&partial, folder));
    if let Err(error) = written {
        // What cannot be removed either is named by the error that is told.
        let _ = std::fs::remove_dir_all(&partial);
        return Err(Failure::unusable(format!(
            "{}: cannot be written: {error}",
            folder.display()
        )));
    }
    print_line(&format!(
        "{}: a crate with an application, a scene, a recording and a test; `cargo test` there replays the recording",
        folder.display()
    ))
}

fn write(folder: &Path, name: &str, stereolux: &str, checkout: &Path) -> std::io::Result<()> {
    for (file, text) in FILES {
        let path = folder.join(file);
        if let Some(parent) = path.parent() {
            std::fs::create_dir_all(parent)?;
        }
        // Neither's text is searched for the other's word.
        let parts = text
            .split("STEREOLUX")
            .map(|part| part.replace("NAME", name));
        std::fs::write(path, parts.collect::<Vec<_>>().join(stereolux))?;
    }
    // The versions that the checkout was tested with; cargo leaves out what the crate does not need.
    let lock = checkout.join("Cargo.lock");
    if lock.is_file() {
        std::fs::copy(lock, folder.join("Cargo.lock"))?;
    }
    Ok(())
}

/// The crate's name: the folder's last part.
fn crate_name(folder: &Path) -> Result<String, Failure> {
    let name = folder.file_name().and_then(|name| name.to_str());
    let refused = |why: &str| {
        Failure::unusable(format!(
            "{}: {why}; name a folder like my-app",
            folder.display()
        ))
    };
    let name = name.ok_or_else(|| refused("names no crate"))?;
    let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    if !name.starts_with(|c: char| c.is_ascii_alphabetic()) || !name.chars().all(is_plain) {
        return Err(refused(
            "a crate's name begins with a letter and has letters, digits, - and _ only",
        ));
    }
    if TAKEN.contains(&name) {
        return Err(refused("that name belongs to another crate"));
    }
    Ok(name.to_owned())
}

/// The absolute path of stereolux's sources.
fn checkout(path: &Path) -> Result<PathBuf, Failure> {
    let refused = |why: String| {
        let mend = "name the folder of stereolux's sources with --path";
        Failure::unusable(format!("{}: {why}; {mend}", path.display()))
    };
    let manifest = path.join("Cargo.toml");
    let text = std::fs::read_to_string(&manifest)
        .map_err(|error| refused(format!("Cargo.toml: {error}")))?;
    let parsed: Option<toml::Table> = text.parse().ok();
    let name = parsed
        .as_ref()
        .and_then(|manifest| manifest.get("package")?.get("name")?.as_str());
    if name != Some("stereolux") {
        return Err(refused("holds another crate than stereolux".to_owned()));
    }
    let absolute = path.canonicalize();
    absolute.map_err(|error| refused(error.to_string()))
}
