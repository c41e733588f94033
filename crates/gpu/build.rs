//! Lists every shader under `shaders/` as an embedded source, so that none can be forgotten.

use std::fmt::Write as _;
use std::path::Path;
use std::{env, fs, io};

fn main() -> io::Result<()> {
    let manifest_dir = env::var("CARGO_MANIFEST_DIR").map_err(io::Error::other)?;
    let out_dir = env::var("OUT_DIR").map_err(io::Error::other)?;
    let root = Path::new(&manifest_dir).join("../../shaders");
    println!("cargo:rerun-if-changed={}", root.display());

    let mut names = Vec::new();
    collect(&root, "", &mut names)?;
    names.sort();

    let mut table = String::from("&[\n");
    for name in &names {
        let path = root.join(format!("{name}.wesl"));
        // `{:?}` quotes the path the way a Rust string literal wants it.
        let _ = writeln!(table, "    ({name:?}, include_str!({path:?})),");
    }
    table.push(']');
    fs::write(Path::new(&out_dir).join("shader_table.rs"), table)
}

fn collect(folder: &Path, prefix: &str, names: &mut Vec<String>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if entry.file_type()?.is_dir() {
            collect(&entry.path(), &format!("{prefix}{name}/"), names)?;
        } else if let Some(stem) = name.strip_suffix(".wesl") {
            names.push(format!("{prefix}{stem}"));
        }
    }
    Ok(())
}
