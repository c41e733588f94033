//! Makes the scenes under `assets/`, which the library embeds.
//!
//! `cargo run -p stereolux-scene --release --example make_assets` writes them again; a test holds them to what this code makes.

#[allow(dead_code, reason = "what is known in closed form is for tests")]
mod scenes;

use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets");
    for (name, make) in scenes::SCENES {
        let path = folder.join(format!("{name}.glb"));
        std::fs::write(&path, make()?)?;
        println!("{}", path.display());
    }
    Ok(())
}
