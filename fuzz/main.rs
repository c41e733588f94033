//! Feeds mutated inputs to every parser, and reports panics, slow inputs and memory.
//!
//! `cargo run --release --example fuzz -- [--parser NAME] [--first SEED] [--cases N] [--seconds S]`
//!
//! Each parser is given N inputs (1000), or as many as S seconds have room for.
//! Each input is told by parser and seed alone, so that `--parser NAME --first SEED --cases 1` runs one again. The seed in
//! hand is kept in a file, whose path is printed first: after an abort it says which it was. Give it little memory
//! (`ulimit -v 4194304`), so that an input that asks for much is found.

mod mutate;
mod parsers;
mod seeds;

use std::fs::File;
use std::io::{Seek as _, Write as _};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use parsers::{Feeder, Parser};

/// Longer than any input may take.
const PATIENCE: Duration = Duration::from_secs(10);

/// Inputs between two looks at memory, which take longer than most inputs.
const BATCH: u64 = 64;

/// What became of the inputs of one parser.
#[derive(Default)]
struct Tally {
    cases: u64,
    accepted: u64,
    panics: u64,
    slow: u64,
    longest: Duration,
    longest_seed: u64,
    peak_kib: u64,
    peak_seed: u64,
}

impl Tally {
    /// Notes what memory the batch that ends with `seed` took.
    fn see_peak(&mut self, seed: u64) {
        let peak = peak_kib();
        if peak > self.peak_kib {
            (self.peak_kib, self.peak_seed) = (peak, seed);
        }
    }
}

/// When a parser has had enough.
#[derive(Clone, Copy)]
enum Limit {
    Cases(u64),
    Time(Duration),
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().collect();
    let value = |name: &str| {
        let at = arguments.iter().position(|argument| argument == name)?;
        arguments.get(at + 1).cloned()
    };
    let number = |name: &str, otherwise: u64| {
        value(name)
            .and_then(|text| text.parse().ok())
            .unwrap_or(otherwise)
    };
    let first = number("--first", 0);
    let limit = match number("--seconds", 0) {
        0 => Limit::Cases(number("--cases", 1000)),
        seconds => Limit::Time(Duration::from_secs(seconds)),
    };
    let only = value("--parser");
    let folder = std::env::temp_dir().join(format!("stereolux-fuzz-{}", std::process::id()));
    if let Err(error) = std::fs::create_dir_all(&folder) {
        eprintln!("error: {}: {error}", folder.display());
        return ExitCode::from(2);
    }
    println!("seed in hand: {}", folder.join("seed").display());
    println!(
        "| parser | cases | accepted | cases/s | panics | over {} s | slowest | peak |",
        PATIENCE.as_secs()
    );
    println!("|---|---|---|---|---|---|---|---|");
    let mut faults = 0;
    for parser in Parser::ALL {
        let name = format!("{parser:?}");
        if only.as_ref().is_some_and(|only| *only != name) {
            continue;
        }
        let began = Instant::now();
        let tally = match run(parser, &folder, first, limit) {
            Ok(tally) => tally,
            Err(error) => {
                eprintln!("error: {}: {error}", folder.display());
                return ExitCode::from(2);
            }
        };
        println!(
            "| {name} | {} | {} | {:.0} | {} | {} | {:.2} s (seed {}) | {} MiB (up to seed {}) |",
            tally.cases,
            tally.accepted,
            tally.cases as f64 / began.elapsed().as_secs_f64(),
            tally.panics,
            tally.slow,
            tally.longest.as_secs_f64(),
            tally.longest_seed,
            tally.peak_kib / 1024,
            tally.peak_seed,
        );
        faults += tally.panics + tally.slow;
    }
    let _ = std::fs::remove_dir_all(&folder);
    ExitCode::from(u8::from(faults > 0))
}

fn run(parser: Parser, folder: &Path, first: u64, limit: Limit) -> std::io::Result<Tally> {
    let feeder = Feeder::new(parser, folder);
    let mut in_hand = File::create(folder.join("seed"))?;
    let mut tally = Tally::default();
    let start = Instant::now();
    for seed in first.. {
        let is_done = match limit {
            Limit::Cases(cases) => tally.cases == cases,
            Limit::Time(time) => start.elapsed() >= time,
        };
        if is_done {
            break;
        }
        in_hand.rewind()?;
        writeln!(in_hand, "{parser:?} {seed:20}")?;
        let is_first = (seed - first).is_multiple_of(BATCH);
        if is_first {
            reset_peak();
        }
        let began = Instant::now();
        let outcome = catch_unwind(AssertUnwindSafe(|| feeder.feed(seed)));
        let took = began.elapsed();
        tally.cases += 1;
        match outcome {
            Ok(accepted) => tally.accepted += u64::from(accepted),
            Err(_) => {
                println!("panic: {parser:?} {seed}");
                tally.panics += 1;
            }
        }
        if took > PATIENCE {
            println!("slow: {parser:?} {seed}: {:.1} s", took.as_secs_f64());
            tally.slow += 1;
        }
        if took > tally.longest {
            (tally.longest, tally.longest_seed) = (took, seed);
        }
        if (seed - first) % BATCH == BATCH - 1 {
            tally.see_peak(seed);
        }
    }
    tally.see_peak((first + tally.cases).saturating_sub(1));
    Ok(tally)
}

/// Lets the system count the peak of resident memory anew.
fn reset_peak() {
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

/// The peak of resident memory since then, KiB; 0 where the system does not tell.
fn peak_kib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.trim().strip_suffix("kB")?.trim().parse().ok())
        .unwrap_or(0)
}
