//! What every pass becomes on the instruction set of AMD's RDNA 2 and 3, without such a card: code, registers, spills,
//! scratch, waves, estimated latency. See `docs/gpu.md`; `scripts/gpu_isa.sh` runs it.

mod card;
mod check;
mod kernels;
mod languages;
mod table;

use std::collections::HashSet;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Result;
use clap::{Parser, ValueEnum};
use rayon::prelude::*;
use stereolux::gpu::ShaderLibrary;

use card::{Card, Compiler, Family};
use kernels::{Kernel, kernels_of, load_scene};
use table::Row;

/// The scenes without `--scene`.
const SCENES: [&str; 3] = [
    "cornell=builtin:cornell",
    "gallery=builtin:gallery",
    "helmet=like:helmet",
];

/// What every pass becomes on the instruction set of AMD's cards, asked of Mesa's RADV on its null device
#[derive(Parser)]
struct Arguments {
    /// Generations of cards
    #[arg(long, value_delimiter = ',', default_values = ["rdna2", "rdna3"])]
    cards: Vec<Family>,
    /// NAME=SCENE[+SKY]: builtin:NAME, like:helmet (maps of colour, roughness and normals under a sky) or a glTF file, and
    /// an environment map
    #[arg(long = "scene", value_name = "NAME=SCENE[+SKY]",
        default_values = SCENES)]
    scenes: Vec<String>,
    /// Asks this machine's own driver instead, and writes what it says by its own names as CSV
    #[arg(long, conflicts_with_all = ["cards", "check", "store", "format"])]
    own: bool,
    /// Only these passes
    #[arg(long, value_delimiter = ',')]
    passes: Vec<String>,
    /// Shaders from files in place of the embedded ones
    #[arg(long, value_name = "FOLDER")]
    shaders: Option<PathBuf>,
    /// How the table is written to stdout
    #[arg(long, value_enum, default_value = "table")]
    format: Format,
    /// Fails where a kernel breaks a limit, has over 5 % more instructions than crates/isa/instructions.csv says (where all
    /// cards, scenes and passes are asked for), is no valid SPIR-V, or cannot be written in HLSL or MSL
    #[arg(long)]
    check: bool,
    /// Writes crates/isa/instructions.csv anew
    #[arg(long, conflicts_with_all = ["cards", "scenes", "passes"])]
    store: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum Format {
    Table,
    Csv,
    Json,
}

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let causes: Vec<String> = error.chain().map(ToString::to_string).collect();
            eprintln!("error: {}", causes.join(": "));
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<()> {
    if std::env::args()
        .nth(1)
        .is_some_and(|word| word == card::PROBE)
    {
        return Card::probe();
    }
    let arguments = Arguments::parse();
    // First of all: see `Card::open`.
    let families = if arguments.own {
        &[][..]
    } else {
        &arguments.cards
    };
    let cards = families
        .iter()
        .map(|&family| Card::open(family))
        .collect::<Result<Vec<_>>>()?;
    let library = match &arguments.shaders {
        Some(folder) => ShaderLibrary::with_folder(folder)?,
        None => ShaderLibrary::embedded(),
    };
    let (mut kernels, mut seen) = (Vec::new(), HashSet::new());
    for words in &arguments.scenes {
        let (name, scene) = load_scene(words)?;
        kernels.extend(kernels_of(&library, &name, &scene, &mut seen)?);
    }
    if !arguments.passes.is_empty() {
        kernels.retain(|kernel| arguments.passes.contains(&kernel.pass));
    }
    if arguments.own {
        return table::write_own(std::io::stdout().lock(), &Compiler::open()?, &kernels);
    }
    let jobs: Vec<(&Card, &Kernel)> = cards
        .iter()
        .flat_map(|card| kernels.iter().map(move |kernel| (card, kernel)))
        .collect();
    let rows = jobs
        .into_par_iter()
        .map(|(card, kernel)| Row::measure(card, kernel))
        .collect::<Result<Vec<Row>>>()?;
    match arguments.format {
        Format::Table => table::print(&cards, &rows),
        Format::Csv => table::write_csv(std::io::stdout().lock(), &rows)?,
        Format::Json => println!("{}", serde_json::to_string_pretty(&rows)?),
    }
    if arguments.store {
        check::store(&cards, &rows)?;
    }
    if arguments.check {
        languages::check(&kernels)?;
        let is_whole = arguments.passes.is_empty()
            && arguments.scenes == SCENES
            && Family::ALL
                .iter()
                .all(|family| arguments.cards.contains(family));
        check::check(&cards, &rows, is_whole)?;
    }
    Ok(())
}
