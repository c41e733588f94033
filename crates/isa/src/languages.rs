//! What other drivers are given: SPIR-V by Khronos' own validator, and whether naga writes HLSL and MSL of every kernel.

use std::io::Write as _;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::{Command, Stdio};

use anyhow::{Context as _, Result, bail};
use naga::back::{hlsl, msl};
use rayon::prelude::*;

use crate::kernels::Kernel;

/// Argument buffers of a stage on Metal (Metal Feature Set Tables, "Maximum number of entries in the buffer argument table").
const METAL_BUFFERS: usize = 31;

/// Checks every kernel in all three languages.
///
/// # Errors
/// A line per fault; `spirv-val` is not installed.
pub fn check(kernels: &[Kernel]) -> Result<()> {
    let faults: Vec<String> = kernels
        .par_iter()
        .flat_map_iter(|kernel| {
            let languages = [
                ("SPIR-V", spirv as fn(&Kernel) -> Result<()>),
                ("HLSL", hlsl),
                ("MSL", msl),
            ];
            languages.into_iter().filter_map(|(language, write)| {
                // naga panics at what it has not thought of.
                let outcome = catch_unwind(AssertUnwindSafe(|| write(kernel)));
                let fault = match outcome {
                    Ok(Ok(())) => return None,
                    Ok(Err(error)) => format!("{error:#}"),
                    Err(_) => "naga panicked".to_owned(),
                };
                Some(format!("{} in {language}: {fault}", kernel.name()))
            })
        })
        .collect();
    if faults.is_empty() {
        return Ok(());
    }
    bail!("{}", faults.join("\n"))
}

fn spirv(kernel: &Kernel) -> Result<()> {
    let (words, _) = kernel.spirv()?;
    validated(&words)
}

/// By `spirv-val`, for Vulkan 1.3.
fn validated(words: &[u32]) -> Result<()> {
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    let mut validator = Command::new("spirv-val")
        .args(["--target-env", "vulkan1.3", "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .context("cannot run spirv-val; install it (on Debian: apt-get install spirv-tools)")?;
    if let Some(mut input) = validator.stdin.take() {
        input.write_all(&bytes)?;
    }
    let output = validator.wait_with_output()?;
    if !output.status.success() {
        let said = [output.stdout, output.stderr].concat();
        bail!("{}", String::from_utf8_lossy(&said).trim());
    }
    Ok(())
}

fn hlsl(kernel: &Kernel) -> Result<()> {
    let info = kernel.shader.validate()?;
    let options = hlsl::Options {
        shader_model: hlsl::ShaderModel::V6_0,
        ..hlsl::Options::default()
    };
    let mut text = String::new();
    let pipeline = hlsl::PipelineOptions::default();
    hlsl::Writer::new(&mut text, &options, &pipeline).write(&kernel.shader.module, &info, None)?;
    Ok(())
}

fn msl(kernel: &Kernel) -> Result<()> {
    let info = kernel.shader.validate()?;
    let options = msl::Options {
        lang_version: (2, 4),
        ..msl::Options::default()
    };
    let pipeline = msl::PipelineOptions::default();
    msl::write_string(&kernel.shader.module, &info, &options, &pipeline)?;
    let buffers = kernel.buffers()?;
    if buffers > METAL_BUFFERS {
        bail!("{buffers} buffers, of {METAL_BUFFERS}");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::validated;

    #[test]
    fn a_module_without_an_end_is_refused() {
        // Magic number, version 1.6, generator, bound, schema; then half an instruction (SPIR-V 1.6, section 2.3).
        let refused = validated(&[0x0723_0203, 0x0001_0600, 0, 1, 0, 0x0004_0011]);
        assert!(refused.is_err());
    }
}
