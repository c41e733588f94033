//! The figures of a kernel, and how they are written.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Context as _, Result};
use rayon::prelude::*;
use serde::Serialize;

use crate::card::{Card, Compiler, Family, Statistics};
use crate::kernels::Kernel;

/// What a kernel became on a card.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    pub card: Family,
    pub scene: String,
    /// `photon`, `path`: a kernel of `run`'s frame by that method; `other`.
    pub frame: &'static str,
    pub pass: String,
    pub code_bytes: u32,
    pub instructions: u32,
    pub vgprs: u32,
    pub sgprs: u32,
    pub spilled_vgprs: u32,
    pub spilled_sgprs: u32,
    /// Lanes of a wave.
    pub lanes: u32,
    /// Bytes per lane.
    pub scratch_bytes: u32,
    /// Bytes per lane of the arrays that the shader declares in its threads' own memory.
    pub declared_bytes: u32,
    /// Bytes per workgroup.
    pub lds_bytes: u32,
    /// Waves of 64 lanes that a SIMD unit holds, 16 at most. Computed: Mesa 22 and 25 count in different units.
    pub waves: u32,
    /// The driver's estimate of a wave's time, cycles.
    pub latency_cycles: u32,
    /// The driver's estimate of cycles per wave with all units busy.
    pub inverse_throughput_cycles: u32,
}

impl Row {
    pub fn measure(card: &Card, kernel: &Kernel) -> Result<Self> {
        let found = compiled(&card.compiler, kernel)?;
        Self::of(card, kernel, &found).with_context(|| kernel.name())
    }

    fn of(card: &Card, kernel: &Kernel, found: &Statistics) -> Result<Self> {
        let whole = |name: &str| match found.get(name) {
            Some(value) => Ok(*value as u32),
            None => {
                let names: Vec<&str> = found.keys().map(String::as_str).collect();
                anyhow::bail!("the driver does not say {name:?}, only {names:?}")
            }
        };
        Ok(Self {
            card: card.family,
            scene: kernel.scene.clone(),
            frame: kernel.frame.name(),
            pass: kernel.pass.clone(),
            code_bytes: whole("Code size")?,
            instructions: whole("Instructions")?,
            vgprs: whole("VGPRs")?,
            sgprs: whole("SGPRs")?,
            spilled_vgprs: whole("Spilled VGPRs")?,
            spilled_sgprs: whole("Spilled SGPRs")?,
            lanes: whole("subgroup")?,
            // The driver counts a wave's.
            scratch_bytes: whole("Scratch size")? / whole("subgroup")?.max(1),
            declared_bytes: kernel.declared_bytes(),
            lds_bytes: whole("LDS size")?,
            waves: card
                .family
                .waves(whole("VGPRs")?, whole("LDS size")?, kernel.group_threads()),
            latency_cycles: whole("Latency")?,
            inverse_throughput_cycles: whole("Inverse Throughput")?,
        })
    }

    /// Names the kernel on its card.
    pub fn name(&self) -> String {
        format!(
            "{} {} {} ({})",
            self.card.name(),
            self.scene,
            self.pass,
            self.frame
        )
    }
}

fn compiled(compiler: &Compiler, kernel: &Kernel) -> Result<Statistics> {
    let (words, bindings) = kernel.spirv()?;
    compiler
        .compile(&words, &bindings)
        .with_context(|| kernel.name())
}

/// A Markdown table per card.
pub fn print(cards: &[Card], rows: &[Row]) {
    for card in cards {
        println!("\n{}, {}\n", card.family.name(), card.compiler.driver);
        println!(
            "| scene | frame | pass | code, KiB | instructions | VGPRs | SGPRs | spilled V/S | scratch, B/lane | LDS, B | waves | latency | inverse throughput |"
        );
        println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|");
        for row in rows.iter().filter(|row| row.card == card.family) {
            println!(
                "| {} | {} | {} | {:.1} | {} | {} | {} | {}/{} | {} | {} | {} | {} | {} |",
                row.scene,
                row.frame,
                row.pass,
                f64::from(row.code_bytes) / 1024.0,
                row.instructions,
                row.vgprs,
                row.sgprs,
                row.spilled_vgprs,
                row.spilled_sgprs,
                row.scratch_bytes,
                row.lds_bytes,
                row.waves,
                row.latency_cycles,
                row.inverse_throughput_cycles,
            );
        }
    }
}

pub fn write_csv(to: impl std::io::Write, rows: &[Row]) -> Result<()> {
    let mut csv = csv::Writer::from_writer(to);
    for row in rows {
        csv.serialize(row)?;
    }
    Ok(csv.flush()?)
}

/// What the machine's own driver says of each kernel, by its own names.
pub fn write_own(to: impl std::io::Write, compiler: &Compiler, kernels: &[Kernel]) -> Result<()> {
    let found = kernels
        .par_iter()
        .map(|kernel| compiled(compiler, kernel))
        .collect::<Result<Vec<Statistics>>>()?;
    let names: BTreeSet<&String> = found.iter().flat_map(BTreeMap::keys).collect();
    let mut csv = csv::Writer::from_writer(to);
    let head = ["device", "scene", "frame", "pass"].into_iter();
    csv.write_record(head.chain(names.iter().map(|name| name.as_str())))?;
    for (kernel, statistics) in kernels.iter().zip(&found) {
        let of = |name: &&String| {
            statistics
                .get(*name)
                .map_or_else(String::new, f64::to_string)
        };
        let cells = [
            compiler.device_name.as_str(),
            &kernel.scene,
            kernel.frame.name(),
            &kernel.pass,
        ];
        let cells = cells.map(str::to_owned).into_iter();
        csv.write_record(cells.chain(names.iter().map(of)))?;
    }
    Ok(csv.flush()?)
}
