//! Fingerprints the code that decides what is rendered and how it is measured, so that no cached figure outlives it.

use std::path::Path;
use std::{env, fs, io};

/// What decides the pixels of an image.
const RENDER_CODE: &[&str] = &[
    "Cargo.lock",
    "assets",
    "crates/base",
    "crates/bvh",
    "crates/gpu",
    "crates/images/src/images.rs",
    "crates/scene",
    "crates/settings",
    "crates/xr/src/view.rs",
    "shaders",
    "src/frame",
    "src/renderer",
];
/// What decides how images are measured, beside that; not how figures are laid out.
const BENCH_CODE: &[&str] = &[
    "config/headsets",
    "crates/images/src/metrics",
    "crates/report/src/records.rs",
    "crates/report/src/rounds.rs",
    "crates/report/src/samples.rs",
    "crates/report/src/statistics.rs",
    "crates/xr",
    "src/bench/correspondence.rs",
    "src/bench/instance_motion.rs",
    "src/bench/measure.rs",
    "src/bench/reference.rs",
    "src/bench/scenes.rs",
    "src/bench/variant_statistics.rs",
];

fn main() -> io::Result<()> {
    println!("cargo:rerun-if-changed=shaders");
    println!("cargo:rerun-if-changed=assets");
    println!("cargo:rerun-if-changed=src");
    println!("cargo:rerun-if-changed=crates");
    println!("cargo:rerun-if-changed=config/headsets");
    println!("cargo:rerun-if-changed=Cargo.lock");
    let manifest_dir = env::var("CARGO_MANIFEST_DIR").map_err(io::Error::other)?;
    let manifest = Path::new(&manifest_dir);
    let render = fingerprint(manifest, RENDER_CODE)?;
    let all: Vec<&str> = RENDER_CODE.iter().chain(BENCH_CODE).copied().collect();
    let bench = fingerprint(manifest, &all)?;
    println!("cargo:rustc-env=STEREOLUX_RENDER_CODE={render:032x}");
    println!("cargo:rustc-env=STEREOLUX_BENCH_CODE={bench:032x}");
    Ok(())
}

/// FNV-1a of 128 bits (Fowler, Noll and Vo) over the names and contents of files and of all files in folders.
fn fingerprint(root: &Path, paths: &[&str]) -> io::Result<u128> {
    let mut files = Vec::new();
    for path in paths {
        list(root, path, &mut files)?;
    }
    files.sort();
    let mut hash: u128 = 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d;
    let mut add = |bytes: &[u8]| {
        for &byte in bytes {
            hash = (hash ^ u128::from(byte)).wrapping_mul((1 << 88) + 0x13b);
        }
    };
    for file in files {
        let contents = fs::read(root.join(&file))?;
        add(file.as_bytes());
        add(&(contents.len() as u64).to_le_bytes());
        add(&contents);
    }
    Ok(hash)
}

fn list(root: &Path, path: &str, files: &mut Vec<String>) -> io::Result<()> {
    let full = root.join(path);
    if !full.is_dir() {
        files.push(path.to_owned());
        return Ok(());
    }
    for entry in fs::read_dir(full)? {
        let name = entry?.file_name().to_string_lossy().into_owned();
        list(root, &format!("{path}/{name}"), files)?;
    }
    Ok(())
}
